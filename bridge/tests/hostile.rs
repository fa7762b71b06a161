//! Requests of any bit pattern, as a faulty client may leave them in shared memory: each is answered with exactly one
//! final report, nothing that cannot be flown reaches the DSP, and the bridge goes on.

use std::collections::HashMap;

use bridge::Input;

use dsp_protocol::{Command, port};
use ipc_types::code::{ControlCommand, MovementKind, Stage};
use ipc_types::payload::{ModuleControl, MovementData, SharedStruct};

use crate::rig::{HOME, Random, Rig, north};

const SEEDS: u64 = 3000;
const REQUESTS: u64 = 100;

/// Payloads that a faulty client may leave.
impl Random {
    /// Any bit pattern.
    fn payload<T: SharedStruct>(&mut self) -> T {
        let bytes: Vec<u8> = (0..size_of::<T>()).map(|_| self.next() as u8).collect();
        T::from_bytes(&bytes).expect("as many bytes as it has")
    }

    /// Any bit pattern, of which a part was made plausible, so that the rest gets past the first checks.
    fn movement(&mut self) -> MovementData {
        let mut data: MovementData = self.payload();
        if self.below(8) > 0 {
            data.kind = self.pick(MovementKind::ALL).code();
            data.path_id = self.below(3);
            (data.first, data.last) = (self.below(3) as u16, self.below(3) as u16);
        }
        let wild = [
            f64::NAN,
            f64::INFINITY,
            f64::MAX,
            -0.0,
            1e-320,
            90.0,
            -180.0,
            1e5,
        ];
        let mut value = |plausible: f64| match self.below(6) {
            0 => self.pick(&wild),
            _ => plausible,
        };
        data.latitude_deg = value(HOME.latitude_deg);
        data.longitude_deg = value(HOME.longitude_deg);
        data.altitude_m = value(20.0);
        data.begin_by_ns = self.pick(&[0, 1, 5_000_000_000, u64::MAX, data.begin_by_ns]);
        data.repeat = self.pick(&[0, 0, 1, data.repeat]);
        data
    }

    fn control(&mut self) -> ModuleControl {
        let mut data: ModuleControl = self.payload();
        if self.below(2) > 0 {
            data.command = self.pick(ControlCommand::ALL).code();
        }
        data
    }
}

fn one_step(rig: &mut Rig, random: &mut Random, request_id: u64) {
    match random.below(6) {
        0 => {
            let control = random.control();
            let control = ModuleControl {
                request_id,
                issued_ns: random.pick(&[rig.now.0, rig.now.0, control.issued_ns]),
                ..control
            };
            rig.ask_control(control);
        }
        1 => rig.run(10 << random.below(6)),
        2 => rig.dsp.status.flying = random.below(2) > 0,
        _ => {
            let movement = random.movement();
            let movement = MovementData {
                request_id,
                issued_ns: random.pick(&[rig.now.0, rig.now.0, movement.issued_ns]),
                ..movement
            };
            rig.ask_movement(movement);
        }
    }
    rig.exchange();
}

#[test]
fn any_request_gets_one_final_report_and_nothing_wild_reaches_the_dsp() {
    let (mut waypoints, mut take_offs) = (0, 0);
    for seed in 0..SEEDS {
        let mut rig = Rig::started();
        let mut random = Random(seed);
        let first = random.next() | 1 << 63;
        for number in 0..REQUESTS {
            one_step(&mut rig, &mut random, first.wrapping_add(number));
        }
        // Zero is no id, but a client may send it.
        let movement = MovementData {
            request_id: 0,
            ..random.movement()
        };
        rig.ask_movement(movement);
        rig.run(1000);
        rig.apply(Input::Close);

        let requests = check_final_reports(&rig, seed);
        assert!(requests > 40, "seed {seed}: {requests}");
        for waypoint in &rig.dsp.waypoints {
            let is_near = (waypoint.latitude_deg - HOME.latitude_deg).abs() < 1.0
                && (waypoint.longitude_deg - HOME.longitude_deg).abs() < 1.0
                && (-1000.0..=20_000.0).contains(&waypoint.altitude_m);
            assert!(is_near, "seed {seed}: {waypoint:?}");
        }
        waypoints += rig.dsp.waypoints.len();
        for command in &rig.dsp.commands {
            if let Command::Write32 {
                port: port::TAKE_OFF_ALTITUDE_M,
                value,
            } = command
            {
                take_offs += 1;
                assert!((0.0..=200.0).contains(value), "seed {seed}: {value}");
            }
        }
    }
    assert!(waypoints > 0 && take_offs > 0, "{waypoints}, {take_offs}");
}

/// Something that may happen in a flight, in whatever order.
fn any_step(rig: &mut Rig, random: &mut Random) {
    let point = north(random.below(20) as i32);
    match random.below(20) {
        0 => drop(rig.control(ControlCommand::Start)),
        1 => drop(rig.control(ControlCommand::Stop)),
        2 => drop(rig.take_off()),
        3 => drop(rig.land()),
        4..=8 => {
            let (id, first, last) = (random.below(2), random.below(2), random.below(2));
            rig.waypoint(id, first as u16, last as u16, point);
        }
        9 => rig.dsp.acknowledges = random.below(3) > 0,
        10 => rig.dsp.silent = random.below(3) == 0,
        11 => rig.dsp.grants = random.below(3) > 0,
        12 => rig.dsp.status.flying = random.below(2) > 0,
        13 => rig.dsp.at(point),
        14 => rig.dsp_error([8, 18, 30, 40, 102, 999][random.below(6) as usize]),
        15 if random.below(4) == 0 => rig.apply(Input::PortClosed),
        15 if random.below(2) == 0 => rig.apply(Input::PortOpened),
        16 if random.below(4) == 0 => (rig.dsp.mask, rig.dsp.time_ms) = (0, 0),
        17 => {
            let noise: Vec<u8> = (0..random.below(40))
                .map(|_| random.below(256) as u8)
                .collect();
            rig.apply(Input::Received(&noise));
        }
        _ => rig.run(10 << random.below(8)),
    }
}

#[test]
fn every_request_has_exactly_one_final_report() {
    for seed in 0..400 {
        let mut rig = Rig::started();
        let mut random = Random(seed);
        for _ in 0..200 {
            any_step(&mut rig, &mut random);
        }
        rig.apply(Input::Close);
        check_final_reports(&rig, seed);
    }
}

/// Each request has one final report, and no other after it. Returns how many requests there were.
fn check_final_reports(rig: &Rig, seed: u64) -> usize {
    let mut finals: HashMap<u64, u32> = HashMap::new();
    for report in &rig.out.reports {
        let stage = Stage::from_code(report.stage).expect("a stage of the contract");
        let count = finals.entry(report.request_id).or_default();
        assert_eq!(
            *count, 0,
            "seed {seed}: {stage} after the final report of request {}",
            report.request_id
        );
        *count += u32::from(stage.is_final());
    }
    for (request, count) in &finals {
        assert_eq!(*count, 1, "seed {seed}: request {request}");
    }
    finals.len()
}
