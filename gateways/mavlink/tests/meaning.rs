//! What commands mean, whatever they come in: each parameter of each command is done, named in a text, or the command
//! is refused; and altitudes are those of their frames.

use ipc_types::code::{PilotSwitch, Reason, Stage};
use ipc_types::payload::WaypointPosition;
use mavlink_gateway::message::{self, COMMAND_INT, MISSION_ITEM_INT};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{OrderKind, Settings};
use plans::mavlink::names::COMMANDS;
use plans::mavlink::parameters::parameter;

use crate::common::{HERE, QGC, Sent, World, acks, count, long, results, texts};

const NAN: f64 = f64::NAN;

/// How far telemetry's zero lies above sea in these tests, m: not at sea level.
const ZERO_M: f64 = 31.5;

fn settings() -> Settings {
    Settings {
        zero_above_sea_m: Some(ZERO_M),
        ..Settings::default()
    }
}

/// What a command comes in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Carrier {
    Long,
    Int(u8),
    /// MISSION_ITEM_INT with `current`.
    Guided(u8, u8),
}

impl Carrier {
    fn message(self, command: u16, params: [f64; 7]) -> MessageWriter {
        let [a, b, c, d, x, y, z] = params;
        let frame = match self {
            Carrier::Long => return long(command, params.map(|value| value as f32)),
            Carrier::Int(frame) | Carrier::Guided(frame, _) => frame,
        };
        let integer = |value: f64| match (value.is_nan(), frame) {
            (true, _) => i32::MAX,
            (false, 2) => value as i32,
            _ => (value * 1e7).round() as i32,
        };
        let kind = match self {
            Carrier::Guided(..) => MISSION_ITEM_INT,
            _ => COMMAND_INT,
        };
        let message = [a, b, c, d]
            .iter()
            .fold(MessageWriter::new(kind), |message, value| {
                message.f32(*value as f32)
            });
        let message = message.i32(integer(x)).i32(integer(y)).f32(z as f32);
        match self {
            Carrier::Guided(_, current) => {
                let message = message.u16(0).u16(command).u8(1).u8(1);
                message.u8(frame).u8(current).u8(1).u8(0)
            }
            _ => message.u16(command).u8(1).u8(1).u8(frame).u8(0).u8(0),
        }
    }
}

/// What becomes of a command.
struct Outcome {
    /// The result of its answer; `None` if that is the bridge's.
    result: Option<u8>,
    texts: Vec<String>,
    /// What it does: orders, and what is sent afterwards.
    done: String,
}

/// A mission of two items is there, and the helicopter flies or stands on the ground.
fn world(is_flying: bool) -> World {
    let mut world = match is_flying {
        true => World::flying_with(settings()),
        false => World::new(settings()),
    };
    world.heartbeat(QGC);
    let waypoint = [0.0, 0.0, 0.0, NAN, HERE.0 + 1e-4, HERE.1, 20.0];
    world.receive(QGC, &QGC.frame(&count(2, 0)));
    for number in 0..2 {
        let item = Carrier::Guided(6, 0).message(16, waypoint);
        let payload = item.payload();
        let mut bytes: Vec<u8> = (0..38).map(|at| payload.u8(at)).collect();
        bytes[28] = number;
        let item = bytes
            .iter()
            .fold(MessageWriter::new(MISSION_ITEM_INT), |item, byte| {
                item.u8(*byte)
            });
        world.receive(QGC, &QGC.frame(&item));
    }
    world.serve("");
    assert_eq!(results(&world.sent()), [0]);
    world.tick(20);
    world.sent();
    world
}

fn outcome(before: &World, carrier: Carrier, command: u16, params: [f64; 7]) -> Outcome {
    let mut world = World {
        gateway: before.gateway.clone(),
        disk: None,
        put: None,
        ..*before
    };
    world.receive(QGC, &QGC.frame(&carrier.message(command, params)));
    world.serve("");
    let sent = world.sent();
    let orders = world.orders();
    let mut paths: Vec<_> = orders
        .iter()
        .map(|order| (order.kind, world.gateway.path(order.number).to_vec()))
        .collect();
    let answers = acks(&sent);
    let mut given = answers.iter().map(|ack| (ack.0, ack.1)).collect::<Vec<_>>();
    given.extend(results(&sent).iter().map(|result| (command, *result)));
    let [result] = match given[..] {
        [] if !orders.is_empty() => [None],
        [(of, result)] => {
            assert_eq!(of, command);
            [Some(result)]
        }
        _ => panic!("{carrier:?} {command} {params:?}: {given:?}"),
    };
    let is_content = |one: &&Sent| {
        !matches!(
            one.kind,
            message::COMMAND_ACK | message::MISSION_ACK | message::STATUSTEXT
        )
    };
    let now: Vec<&Sent> = sent.iter().filter(is_content).collect();
    let later = match parameter(command, 1).is_some() {
        true => world.run(12),
        false => Vec::new(),
    };
    let later: Vec<(&str, &[u8])> = later
        .iter()
        .filter(is_content)
        .map(|one| (one.kind.name(), &one.payload[..]))
        .collect();
    if let [start] = orders[..]
        && start.kind == OrderKind::Start
    {
        world.report(&start, Stage::Done, Reason::None);
        paths.extend(world.kinds().iter().map(|kind| (*kind, Vec::new())));
    }
    Outcome {
        result,
        texts: texts(&sent).into_iter().map(|(_, text)| text).collect(),
        done: format!("{paths:?} {now:?} {later:?}"),
    }
}

/// A command that is done, and whether in the air.
fn good(command: u16) -> Option<([f64; 7], bool)> {
    let place = [HERE.0 + 0.01, HERE.1];
    let at = |first: [f64; 4], z| {
        let [a, b, c, d] = first;
        [a, b, c, d, place[0], place[1], z]
    };
    let with = |a, b| [a, b, 0.0, 0.0, 0.0, 0.0, 0.0];
    Some(match command {
        16 => (at([0.0, 0.0, 0.0, NAN], 90.0), true),
        20 => ([0.0; 7], true),
        21 => ([0.0, 0.0, 0.0, NAN, NAN, NAN, 0.0], true),
        22 => ([0.0, 0.0, 0.0, NAN, NAN, NAN, 90.0], false),
        176 => ([1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0], true),
        178 => ([1.0, 4.0, -1.0, 0.0, 0.0, 0.0, 0.0], true),
        179 => (at([0.0; 4], 90.0), true),
        192 => (at([-1.0, 0.0, 0.0, NAN], 90.0), true),
        193 => (with(0.0, 0.0), true),
        224 => (with(1.0, 0.0), true),
        262 => (with(7.0, 0.0), true),
        300 => (with(0.0, 0.0), true),
        400 => (with(1.0, 0.0), false),
        410 | 520 => (with(0.0, 0.0), true),
        510 | 512 => (with(30.0, 0.0), true),
        511 => (with(30.0, 40_000.0), true),
        _ => return None,
    })
}

#[test]
fn each_parameter_of_each_command_is_done_or_named_or_the_command_is_refused() {
    let (flying, standing) = (world(true), world(false));
    let mut commands: Vec<u16> = COMMANDS.iter().map(|row| row.0).collect();
    commands.extend([4242, u16::MAX, u16::MAX - 1]);
    for command in commands {
        let Some((params, is_flying)) = good(command).filter(|_| command != 16) else {
            for params in [[0.0; 7], [5.0; 7]] {
                let out = outcome(&flying, Carrier::Long, command, params);
                let (result, text) = (out.result, &out.texts[0]);
                assert!(matches!(result, Some(2 | 3)), "{command}: {result:?}");
                assert!(text.contains(&format!("{command}")), "{command}: {text}");
                assert!(
                    !text.contains("MAV_CMD") || !(400..4242).contains(&command),
                    "{text}"
                );
            }
            continue;
        };
        let before = if is_flying { &flying } else { &standing };
        for carrier in [Carrier::Long, Carrier::Int(0), Carrier::Int(6)] {
            judge(before, carrier, command, params);
        }
    }
    for carrier in [
        Carrier::Guided(0, 2),
        Carrier::Guided(6, 2),
        Carrier::Guided(6, 3),
    ] {
        let params = good(16).expect("a waypoint").0;
        judge(&flying, carrier, 16, params);
        for command in [17, 21, 22, 178, 206, 4242] {
            let out = outcome(&flying, carrier, command, params);
            assert_eq!(out.result, Some(3), "{command}");
            assert!(
                out.texts[0].contains(&format!("{command}")),
                "{:?}",
                out.texts
            );
        }
    }
}

/// Each parameter of a command in its turn asks for something.
fn judge(before: &World, carrier: Carrier, command: u16, mut params: [f64; 7]) {
    if let (Carrier::Int(6) | Carrier::Guided(6, _), 16 | 22 | 179 | 192) = (carrier, command) {
        params[6] -= 40.0;
    }
    let good = outcome(before, carrier, command, params);
    assert!(
        matches!(good.result, None | Some(0)),
        "{carrier:?} {command}: {:?}",
        good.texts
    );
    for number in 1..=7_u8 {
        let (_, neutral) = parameter(command, number).expect("a command that is done");
        for value in [7.25, 2.0, -3.0, f64::INFINITY] {
            if neutral.contains(&value) || (5..=6).contains(&number) && value.is_infinite() {
                continue;
            }
            let mut params = params;
            params[usize::from(number) - 1] = value;
            let out = outcome(before, carrier, command, params);
            let what = format!("{carrier:?} {command}, parameter {number} = {value}");
            // Requests for messages are answered by a result alone.
            let is_refused = matches!(out.result, Some(1..));
            let is_request = matches!(command, 410 | 510..=520);
            assert!(!is_refused || is_request || !out.texts.is_empty(), "{what}");
            // Integers of a place have no more digits than that.
            let named = format!("{}", value as f32);
            let is_named = out.texts.iter().any(|text| {
                text.contains(&named) || !good.texts.contains(text) && text.contains("is not done")
            });
            let is_done = out.done != good.done;
            assert!(
                is_refused || is_named || is_done,
                "{what} is lost: {:?}, {}",
                out.texts,
                out.done
            );
        }
    }
}

/// The altitude that the helicopter is sent to, of a command that goes to a place.
fn altitude_of(kinds: &[OrderKind]) -> Option<f64> {
    match kinds {
        [] => None,
        [OrderKind::GoTo(WaypointPosition { altitude_m, .. })] => Some(*altitude_m),
        other => panic!("{other:?}"),
    }
}

#[test]
fn each_altitude_is_that_of_its_frame_whatever_it_comes_in() {
    let (flying, standing) = (world(true), world(false));
    let place = [0.0, 0.0, 0.0, NAN, HERE.0 + 0.01, HERE.1];
    let with = |z: f64| {
        let [a, b, c, d, x, y] = place;
        [a, b, c, d, x, y, z]
    };
    let here = |z: f64| [0.0, 0.0, 0.0, NAN, NAN, NAN, z];
    let clone = |world: &World| World {
        gateway: world.gateway.clone(),
        disk: None,
        put: None,
        ..*world
    };
    for frame in 0..=21_u8 {
        // 25 m over home, or over sea 25 m above telemetry's zero.
        let (z, altitude_m) = match frame {
            0 | 5 => (ZERO_M + 25.0, Some(25.0)),
            3 | 6 => (25.0, Some(HERE.2 + 25.0)),
            _ => (25.0, None),
        };
        let forms = [
            (Carrier::Int(frame), 192),
            (Carrier::Guided(frame, 2), 16),
            (Carrier::Guided(frame, 3), 16),
        ];
        for (carrier, command) in forms {
            let mut world = clone(&flying);
            let params = match carrier {
                Carrier::Guided(_, 3) => here(z),
                _ => with(z),
            };
            world.receive(QGC, &QGC.frame(&carrier.message(command, params)));
            let kinds = world.kinds();
            assert_eq!(altitude_of(&kinds), altitude_m, "{carrier:?}");
            let sent = world.sent();
            let is_refused = !acks(&sent).is_empty() || !results(&sent).is_empty();
            let is_said = !texts(&sent).is_empty();
            assert_eq!(
                (is_refused, is_said),
                (altitude_m.is_none(), altitude_m.is_none()),
                "{carrier:?}: {:?}",
                texts(&sent)
            );
        }
        // Home.
        let mut world = clone(&flying);
        let set = Carrier::Int(frame).message(179, with(z));
        world.receive(QGC, &QGC.frame(&set));
        let result = acks(&world.sent())[0].1;
        assert_eq!(result == 0, altitude_m.is_some(), "{frame}");
        if let Some(altitude_m) = altitude_m {
            world.command(QGC, 20, [0.0; 7]);
            world.orders();
            // Heights over home are over that one now.
            let message = Carrier::Int(6).message(192, with(1.0));
            world.receive(QGC, &QGC.frame(&message));
            assert_eq!(altitude_of(&world.kinds()), Some(altitude_m + 1.0));
        }
        // A take-off, by the height over the ground on which it stands.
        let mut world = clone(&standing);
        let z = match frame {
            0 | 5 => ZERO_M + HERE.2 + 12.0,
            _ => 12.0,
        };
        let take_off = Carrier::Int(frame).message(22, here(z));
        world.receive(QGC, &QGC.frame(&take_off));
        let orders = world.orders();
        assert_eq!(!orders.is_empty(), altitude_m.is_some(), "{frame}");
        if let [start] = orders[..] {
            world.report(&start, Stage::Done, Reason::None);
            assert_eq!(world.kinds(), [OrderKind::TakeOff(12.0)], "{frame}");
        }
        // Landing has no altitude, but its place needs a frame with places.
        let mut world = clone(&flying);
        let land = Carrier::Int(frame).message(21, [0.0, 0.0, 0.0, NAN, HERE.0, HERE.1, 0.0]);
        world.receive(QGC, &QGC.frame(&land));
        let is_global = matches!(frame, 0 | 3 | 5 | 6 | 10 | 11);
        assert_eq!(world.kinds() == [OrderKind::Land], is_global, "{frame}");
        // An item of a mission, which must be above the ground.
        let mut world = clone(&flying);
        let z = match frame {
            0 | 5 => ZERO_M + HERE.2 + 20.0,
            _ => 20.0,
        };
        world.receive(QGC, &QGC.frame(&count(1, 0)));
        let item = Carrier::Guided(frame, 0).message(16, with(z));
        world.receive(QGC, &QGC.frame(&item));
        world.serve("");
        let result = results(&world.sent());
        assert_eq!(result == [0], altitude_m.is_some(), "{frame}: {result:?}");
        if altitude_m.is_some() {
            world.command(QGC, 300, [0.0; 7]);
            world.serve("");
            let path = world.orders()[0];
            let altitude_m = world.gateway.path(path.number)[0].altitude_m;
            assert_eq!(altitude_m, HERE.2 + 20.0);
        }
    }
    // COMMAND_LONG has no frame: above sea.
    for (command, before) in [(192, &flying), (22, &standing)] {
        let mut world = clone(before);
        let params = match command {
            192 => with(ZERO_M + 20.0),
            _ => here(ZERO_M + HERE.2 + 12.0),
        };
        world.receive(QGC, &QGC.frame(&Carrier::Long.message(command, params)));
        match command {
            192 => assert_eq!(altitude_of(&world.kinds()), Some(20.0)),
            _ => {
                let said = texts(&world.sent());
                assert_eq!(
                    said[0].1,
                    "take-off: 73.5 m above sea are 12.0 m over the ground"
                );
            }
        }
    }
}

#[test]
fn what_is_not_done_is_told_by_the_name_of_what_was_asked_for() {
    let mut standing = world(false);
    for (command, first, second, text) in [
        (400, 1.0, 7.25, "arm"),
        (400, 0.0, 7.25, "disarm"),
        (
            176,
            1.0,
            2.0,
            "altitude control by stick: there is no such mode",
        ),
    ] {
        let params = [first, second, 0.0, 0.0, 0.0, 0.0, 0.0];
        let message = Carrier::Long.message(command, params);
        standing.receive(QGC, &QGC.frame(&message));
        let said = texts(&standing.sent());
        assert!(
            said.iter().any(|(_, one)| one.starts_with(text)),
            "{said:?}"
        );
    }
}

#[test]
fn no_place_is_written_in_many_ways_and_a_half_of_one_is_none() {
    let flying = world(true);
    // Latitude and longitude of COMMAND_INT as they stand in it, and whether the height changes here.
    let cases = [
        (i32::MAX, i32::MAX, true),
        (i32::MIN, i32::MIN, true),
        (0x7ff8_0000, 0x7ff8_0000, true),
        (i32::MAX, 1, false),
        (900_000_001, 1, false),
        (0, 0, false),
    ];
    for (x, y, is_here) in cases {
        let mut world = World {
            gateway: flying.gateway.clone(),
            disk: None,
            put: None,
            ..flying
        };
        world.receive(QGC, &QGC.frame(&crate::common::reposition(6, x, y, 40.0)));
        assert_eq!(altitude_of(&world.kinds()).is_some(), is_here, "{x} {y}");
        assert_eq!(texts(&world.sent()).is_empty(), is_here, "{x} {y}");
    }
}

/// Each command whose answer is kept, what the helicopter is afterwards, and what the same bits get again.
#[test]
fn a_copy_of_what_was_carried_out_gets_the_kept_answer_whatever_it_would_be_now() {
    type Change = fn(&mut World);
    let changes: [(&str, Change); 4] = [
        ("not heard", |world| world.pass(2_200)),
        ("manual", |world| {
            world.state.safety.pilot_switch = PilotSwitch::Manual.code();
        }),
        ("no position", |world| world.telemetry.valid_groups = 0),
        ("off or on the ground", |world| {
            world.telemetry.flying = 1 - world.telemetry.flying;
            world.state.blocked = 0;
        }),
    ];
    let with = |first, second, third| [first, second, third, 0.0, 0.0, 0.0, 0.0];
    let to = |first, fourth, z| [first, 0.0, 0.0, fourth, HERE.0 + 0.01, HERE.1, z];
    // In the air, the command, and its parameters.
    let table = [
        (false, 400, with(1.0, 0.0, 0.0)),
        (false, 400, with(0.0, 0.0, 0.0)),
        (false, 22, [0.0, 0.0, 0.0, NAN, NAN, NAN, NAN]),
        (true, 20, with(0.0, 0.0, 0.0)),
        (true, 176, with(1.0, 4.0, 5.0)),
        (true, 178, with(1.0, 4.0, -1.0)),
        (true, 179, to(0.0, 0.0, 90.0)),
        (true, 192, to(-1.0, NAN, 90.0)),
        (true, 193, with(1.0, 0.0, 0.0)),
        (true, 224, with(1.0, 0.0, 0.0)),
        (true, 300, with(0.0, 0.0, 0.0)),
    ];
    let rows = table.iter().flat_map(|row| changes.map(|it| (*row, it)));
    for ((is_flying, command, params), (name, change)) in rows {
        let mut world = world(is_flying);
        let is_disarming = (command, params[0]) == (400, 0.0);
        if is_disarming {
            world.state.blocked = 0;
            world.tick(20);
        }
        let message = Carrier::Long.message(command, params);
        world.receive(QGC, &QGC.frame(&message));
        world.serve("");
        while let [order, ..] = world.orders()[..] {
            world.report(&order, Stage::Done, Reason::None);
        }
        let what = format!("{command} {params:?}, then {name}");
        let first = acks(&world.sent());
        assert_eq!(first, [(command, 0, 0)], "{what}");
        change(&mut world);
        if name != "not heard" {
            world.tick(20);
        }
        world.sent();
        world.receive(QGC, &QGC.frame(&message));
        let expected = match name {
            // How the helicopter is decides whether it may be disarmed.
            "off or on the ground" if is_disarming => (command, 2, 0),
            "not heard" if is_disarming => (command, 1, Reason::LinkDown.code()),
            _ => first[0],
        };
        assert_eq!(acks(&world.sent()), [expected], "{what}");
        assert_eq!(world.kinds(), [], "{what}");
    }
}

/// What was refused is refused again, or done when it can be done now.
#[test]
fn a_copy_of_what_was_refused_here_is_judged_anew() {
    let mut world = world(false);
    world.state.safety.pilot_switch = PilotSwitch::Manual.code();
    world.tick(20);
    world.sent();
    let arm = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    world.command(QGC, 400, arm);
    assert_eq!((acks(&world.sent())[0].1, world.kinds().len()), (1, 0));
    world.state.safety.pilot_switch = PilotSwitch::Auto.code();
    world.tick(20);
    world.command(QGC, 400, arm);
    assert_eq!(world.kinds(), [OrderKind::Start]);
}
