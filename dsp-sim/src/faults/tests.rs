//! Both directions and the events together: order, determinism, and that no byte is lost uncounted.

use dsp_protocol::{Command, DspErrorCode, FlowControl, Status, StatusMask, Waypoint};
use proptest::prelude::*;

use super::*;

fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

fn script(seed: u64, faults: Vec<Fault>) -> Script {
    Script { seed, faults }
}

fn always(direction: Directions, damage: Damage) -> Fault {
    Fault::Bytes {
        direction,
        window: Window::ALWAYS,
        damage,
    }
}

fn injector(faults: Vec<Fault>) -> Injector {
    Injector::new(&script(1, faults), Profile::Classic)
}

fn drain(injector: &mut Injector, direction: Direction, now: Duration) -> Vec<u8> {
    std::iter::from_fn(|| injector.leave(direction, now)).collect()
}

/// Messages of one direction and some garbage, as bytes.
fn exchange(direction: Direction) -> Vec<u8> {
    let messages: Vec<Vec<u8>> = match direction {
        Direction::ToPc => [
            Downlink::Status(Status::default()),
            Downlink::Ack { command: 4 },
            Downlink::FlowControl(FlowControl::Send),
            Downlink::Error(DspErrorCode(30)),
        ]
        .map(|message| message.encode().as_bytes().to_vec())
        .into(),
        Direction::ToDsp => {
            let waypoint = Waypoint {
                latitude_deg: 37.0,
                longitude_deg: -6.0,
                altitude_m: 10.0,
            };
            [
                Uplink::Command(Command::ClearErrors),
                Uplink::Waypoint(waypoint),
            ]
            .map(|message| message.encode().as_bytes().to_vec())
            .into()
        }
    };
    let mut bytes = messages.concat();
    bytes.extend([0x11, 0xF5, 0x22, 0xC3]);
    bytes.repeat(20)
}

#[test]
fn the_directions_have_their_own_faults() {
    for (directions, expected) in [
        (Directions::ToPc, [0, 10]),
        (Directions::ToDsp, [10, 0]),
        (Directions::Both, [0, 0]),
    ] {
        let mut injector = injector(vec![always(directions, Damage::Outage)]);
        for byte in 0..10 {
            injector.enter(Direction::ToPc, ms(1), byte);
            injector.enter(Direction::ToDsp, ms(1), byte);
        }
        let left = [Direction::ToPc, Direction::ToDsp]
            .map(|direction| drain(&mut injector, direction, ms(1)).len());
        assert_eq!(left, expected, "{directions:?}");
    }
}

#[test]
fn both_directions_of_one_fault_roll_different_dice() {
    let mut injector = injector(vec![always(Directions::Both, Damage::Drop { rate: 0.5 })]);
    for byte in 0..100 {
        injector.enter(Direction::ToPc, ms(1), byte);
        injector.enter(Direction::ToDsp, ms(1), byte);
    }
    let to_pc = drain(&mut injector, Direction::ToPc, ms(1));
    let to_dsp = drain(&mut injector, Direction::ToDsp, ms(1));
    assert_ne!(to_pc, to_dsp);
}

#[test]
fn a_fault_that_is_appended_changes_nothing_of_those_before() {
    let drop = always(Directions::ToPc, Damage::Drop { rate: 0.5 });
    let never = always(Directions::ToPc, Damage::Drop { rate: 0.0 });
    let bytes_of = |faults| {
        let mut injector = injector(faults);
        for byte in 0..200 {
            injector.enter(Direction::ToPc, ms(1), byte);
        }
        drain(&mut injector, Direction::ToPc, ms(1))
    };
    let alone = bytes_of(vec![drop]);
    assert_eq!(bytes_of(vec![drop, never]), alone);
    assert_ne!(bytes_of(vec![never, drop]), alone);
}

#[test]
fn events_come_once_and_are_counted() {
    let times = Times::once(ms(10));
    let dsp_events = [
        DspEvent::RaiseError(DspErrorCode(45)),
        DspEvent::Reboot,
        DspEvent::StopStatus,
        DspEvent::Hang(ms(5)),
        DspEvent::ClockJump(-7),
        DspEvent::ChangeMask(StatusMask(5)),
    ];
    let helicopter_events = [
        HelicopterEvent::PilotTakesOver(ms(5)),
        HelicopterEvent::BatteryLow { volts: 21.0 },
        HelicopterEvent::FuelLow { percent: 5.0 },
        HelicopterEvent::GpsAltitudeDrift {
            rate_mps: 0.1,
            length: ms(5),
        },
        HelicopterEvent::LoseFix(ms(5)),
    ];
    let dsp_faults = dsp_events.map(|event| Fault::Dsp { times, event });
    let helicopter_faults = helicopter_events.map(|event| Fault::Helicopter { times, event });
    let mut injector = injector([&dsp_faults[..], &helicopter_faults].concat());
    let events: Vec<Happening> = dsp_events
        .map(Happening::Dsp)
        .into_iter()
        .chain(helicopter_events.map(Happening::Helicopter))
        .collect();
    assert_eq!(injector.next_deadline(), Some(ms(10)));
    assert_eq!(injector.next_event(ms(9)), None);
    let came: Vec<Happening> = std::iter::from_fn(|| injector.next_event(ms(10))).collect();
    assert_eq!(came, events);
    assert_eq!(injector.next_deadline(), None);
    let counters = injector.counters();
    let counted = [
        counters.errors_raised,
        counters.reboots,
        counters.status_stops,
        counters.hangs,
        counters.clock_jumps,
        counters.mask_changes,
        counters.pilot_takeovers,
        counters.battery_drops,
        counters.fuel_drops,
        counters.gps_drifts,
        counters.gps_fix_losses,
    ];
    assert_eq!(counted, [1; 11]);
}

#[test]
fn the_port_goes_and_comes_back() {
    let hang_up = |at, length, elsewhere| Fault::HangUp {
        times: Times::once(ms(at)),
        length: ms(length),
        elsewhere,
    };
    let mut injector = injector(vec![
        hang_up(10, 20, false),
        hang_up(25, 1, true),
        hang_up(50, 10, false),
    ]);
    let mut seen = Vec::new();
    while let Some(now) = injector.next_deadline() {
        assert_eq!(injector.next_event(now), None, "nothing happens in the DSP");
        let PortState {
            hang_ups,
            is_gone,
            elsewhere,
        } = injector.port();
        seen.push((now.as_millis(), hang_ups, is_gone, elsewhere));
    }
    let expected = [
        (10, 1, true, false),
        (25, 2, true, true),
        // The longer of both.
        (30, 2, false, true),
        (50, 3, true, false),
        (60, 3, false, false),
    ];
    assert_eq!(seen, expected);
    assert_eq!(injector.counters().hang_ups, 3);
}

/// A window in the first two seconds.
fn windows() -> impl Strategy<Value = Window> {
    (0_u64..1_000, 1_u64..1_000, proptest::option::of(0_u64..500)).prop_map(
        |(from, length, every)| {
            let window = Window::between(ms(from), ms(from + length));
            every.map_or(window, |every| window.every(ms(length + every)))
        },
    )
}

fn damages() -> impl Strategy<Value = Damage> {
    prop_oneof![
        (0.0..0.1).prop_map(|bit_error_rate| Damage::FlipBits { bit_error_rate }),
        (0.0..1.0).prop_map(|rate| Damage::Drop { rate }),
        (0.0..1.0).prop_map(|rate| Damage::Duplicate { rate }),
        (0.0..1.0).prop_map(|rate| Damage::Insert { rate }),
        (0_u64..300, 0_u64..300).prop_map(|(delay, jitter)| Damage::Delay {
            delay: ms(delay),
            jitter: ms(jitter),
        }),
        (1_usize..20, 1_u64..10).prop_map(|(chunk_bytes, gap)| Damage::Split {
            chunk_bytes,
            gap: ms(gap),
        }),
        (0.0..0.1, 1_u32..50).prop_map(|(rate, length_bytes)| Damage::Burst { rate, length_bytes }),
        prop_oneof![Just(AfterStall::Pass), Just(AfterStall::Drop)]
            .prop_map(|then| Damage::Stall { then }),
        Just(Damage::Outage),
    ]
}

fn faults() -> impl Strategy<Value = Fault> {
    let directions = prop_oneof![
        Just(Directions::ToPc),
        Just(Directions::ToDsp),
        Just(Directions::Both)
    ];
    let messages = prop_oneof![
        Just(MessageKind::Ack),
        Just(MessageKind::FlowControl),
        Just(MessageKind::Status),
        Just(MessageKind::Error),
        Just(MessageKind::Command),
        Just(MessageKind::Waypoint)
    ];
    let acts = prop_oneof![
        Just(Act::Drop),
        Just(Act::Repeat),
        (0_u64..300).prop_map(|delay| Act::Late(ms(delay))),
        Just(Act::Reorder)
    ];
    prop_oneof![
        (directions, windows(), damages()).prop_map(|(direction, window, damage)| Fault::Bytes {
            direction,
            window,
            damage,
        }),
        (messages, windows(), 0.0..1.0, acts).prop_map(|(message, window, rate, act)| {
            Fault::Messages {
                message,
                window,
                rate,
                act,
            }
        }),
    ]
}

/// Two seconds of exchange, one byte each two milliseconds, looked at every `step`; gives what came out in each
/// direction, and when.
fn run(script: &Script, step: Duration) -> (Injector, [Vec<(Duration, u8)>; 2]) {
    const DIRECTIONS: [Direction; 2] = [Direction::ToPc, Direction::ToDsp];
    let mut injector = Injector::new(script, Profile::Classic);
    let exchanges = DIRECTIONS.map(exchange);
    let mut sent = 0;
    let mut out = [Vec::new(), Vec::new()];
    let (mut now, end) = (Duration::ZERO, ms(4_000));
    while now < end {
        let deadline = injector.next_deadline().unwrap_or(end);
        now = deadline.min(now + step).min(end);
        while sent < 1_000 && ms(2 * sent) <= now {
            for (direction, exchange) in DIRECTIONS.into_iter().zip(&exchanges) {
                let byte = exchange[sent as usize % exchange.len()];
                injector.enter(direction, ms(2 * sent), byte);
            }
            sent += 1;
        }
        for (direction, out) in DIRECTIONS.into_iter().zip(&mut out) {
            while let Some(byte) = injector.leave(direction, now) {
                out.push((now, byte));
            }
        }
    }
    (injector, out)
}

fn bytes(out: &[Vec<(Duration, u8)>; 2]) -> [Vec<u8>; 2] {
    [0, 1].map(|way| out[way].iter().map(|(_, byte)| *byte).collect())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_byte_is_lost_uncounted(seed: u64, faults in prop::collection::vec(faults(), 0..6)) {
        let (injector, out) = run(&script(seed, faults), ms(7));
        let counters = injector.counters();
        for (direction, counters, out) in [
            (Direction::ToPc, counters.to_pc, &out[0]),
            (Direction::ToDsp, counters.to_dsp, &out[1]),
        ] {
            prop_assert_eq!(counters.entered, 1_000);
            prop_assert_eq!(counters.left, out.len() as u64);
            let waiting = injector.waiting(direction) as u64;
            prop_assert_eq!(counters.gained(), counters.lost() + counters.left + waiting);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_at_the_same_times_however_the_clock_steps(
        seed: u64,
        faults in prop::collection::vec(faults(), 0..6),
        step_ms in 1_u64..200,
    ) {
        let script = script(seed, faults);
        let (first, out) = run(&script, ms(3));
        let (again, same) = run(&script, ms(3));
        prop_assert_eq!(&out, &same);
        prop_assert_eq!(first.counters(), again.counters());
        let (_, coarse) = run(&script, ms(step_ms));
        prop_assert_eq!(bytes(&out), bytes(&coarse));
    }
}

#[test]
fn another_seed_gives_other_faults() {
    let noisy = |seed| {
        script(
            seed,
            vec![always(Directions::Both, Damage::Drop { rate: 0.3 })],
        )
    };
    let (_, one) = run(&noisy(1), ms(3));
    let (_, two) = run(&noisy(2), ms(3));
    assert_ne!(bytes(&one), bytes(&two));
}
