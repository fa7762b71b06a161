//! Requests of any bit pattern, as a faulty client may leave them in shared memory: each is answered with exactly one
//! final report, nothing that cannot be flown reaches the DSP, and the bridge goes on.

mod desk;

use std::collections::HashMap;

use bridge::{Input, RequestKey};
use desk::{Desk, HOME};
use dsp_protocol::{Command, port};
use ipc_types::code::{ControlCommand, MovementKind, Stage};
use ipc_types::payload::{ModuleControl, MovementData, SharedStruct};

const SEEDS: u64 = 3000;
const REQUESTS: u64 = 100;

/// SplitMix64: small, seeded, the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }

    fn pick<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len() as u64) as usize]
    }

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

fn one_step(desk: &mut Desk, random: &mut Random, request_id: u64) {
    match random.below(6) {
        0 => {
            let control = random.control();
            let control = ModuleControl {
                request_id,
                issued_ns: random.pick(&[desk.now.0, desk.now.0, control.issued_ns]),
                ..control
            };
            let key = RequestKey::Control(request_id);
            desk.apply(Input::Control {
                key,
                sender: None,
                request: control,
            });
        }
        1 => desk.run(10 << random.below(6)),
        2 => desk.dsp.status.flying = random.below(2) > 0,
        _ => {
            let movement = random.movement();
            let movement = MovementData {
                request_id,
                issued_ns: random.pick(&[desk.now.0, desk.now.0, movement.issued_ns]),
                ..movement
            };
            let key = RequestKey::Movement(request_id);
            desk.apply(Input::Movement {
                key,
                sender: None,
                request: movement,
            });
        }
    }
    desk.exchange();
}

#[test]
fn any_request_gets_one_final_report_and_nothing_wild_reaches_the_dsp() {
    let (mut waypoints, mut take_offs) = (0, 0);
    for seed in 0..SEEDS {
        let mut desk = Desk::started();
        let mut random = Random(seed);
        let first = random.next() | 1 << 63;
        for number in 0..REQUESTS {
            one_step(&mut desk, &mut random, first.wrapping_add(number));
        }
        // Zero is no id, but somebody may send it.
        let key = RequestKey::Movement(0);
        let movement = MovementData {
            request_id: 0,
            ..random.movement()
        };
        desk.apply(Input::Movement {
            key,
            sender: None,
            request: movement,
        });
        desk.run(1000);
        desk.apply(Input::Close);

        let mut finals: HashMap<u64, u32> = HashMap::new();
        for report in &desk.out.reports {
            let stage = Stage::from_code(report.stage).expect("a stage of the contract");
            *finals.entry(report.request_id).or_default() += u32::from(stage.is_final());
        }
        assert!(finals.len() > 40, "seed {seed}: {finals:?}");
        for (request, count) in finals {
            assert_eq!(count, 1, "seed {seed}: request {request}");
        }
        for waypoint in &desk.dsp.waypoints {
            let is_near = (waypoint.latitude_deg - HOME.latitude_deg).abs() < 1.0
                && (waypoint.longitude_deg - HOME.longitude_deg).abs() < 1.0
                && (-1000.0..=20_000.0).contains(&waypoint.altitude_m);
            assert!(is_near, "seed {seed}: {waypoint:?}");
        }
        waypoints += desk.dsp.waypoints.len();
        for command in &desk.dsp.commands {
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
