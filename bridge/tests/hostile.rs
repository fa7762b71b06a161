//! Requests of any bit pattern, as a faulty client may leave them in shared memory: each is answered with exactly one
//! final report, nothing that cannot be flown reaches the DSP, and the bridge goes on.

use std::collections::HashMap;

use bridge::Input;
use dsp_protocol::{Command, port};
use fastrand::Rng;
use ipc_types::code::{ControlCommand, MovementKind, Stage};
use ipc_types::payload::{ModuleControl, MovementData, SharedStruct};

use crate::rig::{HOME, Rig, north};

const SEEDS: u64 = 3000;
const REQUESTS: u64 = 100;

/// Any bit pattern, as a faulty client may leave it.
fn payload<T: SharedStruct>(random: &mut Rng) -> T {
    let mut bytes = vec![0; size_of::<T>()];
    random.fill(&mut bytes);
    T::from_bytes(&bytes).expect("as many bytes as it has")
}

/// Any bit pattern, of which a part was made plausible, so that the rest gets past the first checks.
fn movement(random: &mut Rng) -> MovementData {
    let mut data: MovementData = payload(random);
    if random.u8(..8) > 0 {
        data.kind = random.choice(MovementKind::ALL).unwrap().code();
        data.path_id = random.u64(..3);
        (data.first, data.last) = (random.u16(..3), random.u16(..3));
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
    let mut value = |plausible: f64| match random.u8(..6) {
        0 => random.choice(wild).unwrap(),
        _ => plausible,
    };
    data.latitude_deg = value(HOME.latitude_deg);
    data.longitude_deg = value(HOME.longitude_deg);
    data.altitude_m = value(20.0);
    let begin_by_ns = [0, 1, 5_000_000_000, u64::MAX, data.begin_by_ns];
    data.begin_by_ns = random.choice(begin_by_ns).unwrap();
    data.sender_lost = random.choice([0, 1, 2, 3, data.sender_lost]).unwrap();
    data.lease_ms = random.choice([0, 0, 500, 60_000, data.lease_ms]).unwrap();
    data.repeat = random.choice([0, 0, 1, data.repeat]).unwrap();
    data
}

fn control(random: &mut Rng) -> ModuleControl {
    let mut data: ModuleControl = payload(random);
    if random.bool() {
        data.command = random.choice(ControlCommand::ALL).unwrap().code();
    }
    data
}

/// The step before that a request names: mostly none, else a request that there was, or any number.
fn after(random: &mut Rng, request_id: u64, any: u64) -> u64 {
    let before = request_id.wrapping_sub(1);
    random.choice([0, 0, 0, 0, before, any]).unwrap()
}

fn one_step(rig: &mut Rig, random: &mut Rng, request_id: u64) {
    match random.u64(..6) {
        0 => {
            let control = control(random);
            let control = ModuleControl {
                request_id,
                issued_ns: random
                    .choice([rig.now.0, rig.now.0, control.issued_ns])
                    .unwrap(),
                after: after(random, request_id, control.after),
                ..control
            };
            rig.ask_control(control);
        }
        1 => rig.run(10 << random.u64(..6)),
        2 => rig.dsp.status.flying = random.u64(..2) > 0,
        _ => {
            let movement = movement(random);
            let movement = MovementData {
                request_id,
                issued_ns: random
                    .choice([rig.now.0, rig.now.0, movement.issued_ns])
                    .unwrap(),
                after: after(random, request_id, movement.after),
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
        let mut random = Rng::with_seed(seed);
        let first = random.u64(..) | 1 << 63;
        for number in 0..REQUESTS {
            one_step(&mut rig, &mut random, first.wrapping_add(number));
        }
        // Zero is no id, but a client may send it.
        let movement = MovementData {
            request_id: 0,
            ..movement(&mut random)
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
fn any_step(rig: &mut Rig, random: &mut Rng) {
    let point = north(random.u64(..20) as i32);
    match random.u64(..20) {
        0 => drop(rig.control(ControlCommand::Start)),
        1 => drop(rig.control(ControlCommand::Stop)),
        2 => drop(rig.take_off()),
        3 => drop(rig.land()),
        4..=8 => {
            let (id, first, last) = (random.u64(..2), random.u64(..2), random.u64(..2));
            rig.waypoint(id, first as u16, last as u16, point);
        }
        9 => rig.dsp.acknowledges = random.u64(..3) > 0,
        10 => rig.dsp.silent = random.u64(..3) == 0,
        11 => rig.dsp.grants = random.u64(..3) > 0,
        12 => rig.dsp.status.flying = random.u64(..2) > 0,
        13 => rig.dsp.at(point),
        14 => rig.dsp_error(random.choice([8, 18, 30, 40, 102, 999]).unwrap()),
        15 if random.u64(..4) == 0 => rig.apply(Input::PortClosed),
        15 if random.u64(..2) == 0 => rig.apply(Input::PortOpened(Default::default())),
        16 if random.u64(..4) == 0 => (rig.dsp.mask, rig.dsp.time_ms) = (0, 0),
        17 => {
            let noise: Vec<u8> = (0..random.u64(..40)).map(|_| random.u8(..)).collect();
            rig.apply(Input::Received(&noise));
        }
        _ => rig.run(10 << random.u64(..8)),
    }
}

#[test]
fn every_request_has_exactly_one_final_report() {
    for seed in 0..400 {
        let mut rig = Rig::started();
        let mut random = Rng::with_seed(seed);
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
