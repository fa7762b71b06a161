//! What commands become, how they are answered, and who may give them.

use ipc_types::code::{Functionality, ModuleStatus, PilotSwitch, Reason, Stage};
use ipc_types::payload::WaypointPosition;
use mavlink_gateway::message::{COMMAND_ACK, HOME_POSITION, SET_MODE, STATUSTEXT};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{Mode, OrderKind, Settings, answer_of};

use crate::common::{HERE, QGC, SCRIPT, World, acks, long, reposition, texts};

const NAN: f32 = f32::NAN;

fn one(param: f32) -> [f32; 7] {
    [param, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// NAV_TAKEOFF to this altitude, on the spot.
fn take_off(z: f32) -> [f32; 7] {
    [NAN, 0.0, 0.0, NAN, NAN, NAN, z]
}

fn speed(mps: f32) -> [f32; 7] {
    [1.0, mps, -1.0, 0.0, 0.0, 0.0, 0.0]
}

#[test]
fn each_command_on_the_ground() {
    use OrderKind::{Hold, Land, Speed, Start, TakeOff};
    // Command, orders, and the result if it is answered at once.
    type Row<'a> = (u16, [f32; 7], &'a [OrderKind], Option<u8>);
    let table: [Row<'_>; 37] = [
        (400, one(1.0), &[Start], None),
        (400, one(0.0), &[], Some(0)),
        (400, one(7.0), &[], Some(2)),
        (22, take_off(NAN), &[Start], None),
        // Above sea, which is telemetry's zero here.
        (22, take_off(45.0), &[Start], None),
        (22, take_off(30.2), &[], Some(2)),
        (22, take_off(400.0), &[], Some(2)),
        (22, [0.0, 0.0, 0.0, 0.0, 37.5, -6.0, 45.0], &[], Some(2)),
        (21, [0.0, 0.0, 0.0, NAN, NAN, NAN, 0.0], &[Land], None),
        (21, [0.0, 0.0, 0.0, NAN, 37.5, -6.0, 0.0], &[], Some(2)),
        (20, one(0.0), &[], Some(1)),
        (193, one(0.0), &[Hold], None),
        (193, one(1.0), &[], Some(2)),
        (300, one(0.0), &[], Some(2)),
        (176, [1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0], &[Hold], None),
        (
            176,
            [1.0, 50_593_792.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            &[Hold],
            None,
        ),
        (176, [1.0, 4.0, 6.0, 0.0, 0.0, 0.0, 0.0], &[Land], None),
        (176, [1.0, 4.0, 4.0, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        (176, [1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        // By its number alone, and whatever else the flags say; other flags ask for no mode, and halves are none.
        (176, [0.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0], &[Hold], None),
        (176, [NAN, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0], &[Hold], None),
        (176, [209.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0], &[Hold], None),
        (176, [208.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        (176, [257.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        (
            176,
            [1.0, 50_593_792.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            &[],
            Some(2),
        ),
        (176, [1.0, 260.0, 3.0, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        (176, [1.0, 4.0, 259.0, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        (176, [1.0, 4.5, 3.0, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        (176, [1.0, 4.0, 3.5, 0.0, 0.0, 0.0, 0.0], &[], Some(2)),
        (262, one(7.0), &[Land], None),
        (262, one(0.0), &[], Some(2)),
        (224, one(0.5), &[], Some(2)),
        (178, speed(5.0), &[Speed(5.0)], None),
        (178, speed(50.0), &[], Some(2)),
        (185, one(1.0), &[], Some(2)),
        (246, one(1.0), &[], Some(2)),
        (2000, one(0.0), &[], Some(3)),
    ];
    for (command, params, expected, result) in table {
        let mut world = World::with_station();
        world.command(QGC, command, params);
        assert_eq!(world.kinds(), expected, "{command} {params:?}");
        let answers: Vec<u8> = acks(&world.sent()).iter().map(|ack| ack.1).collect();
        assert_eq!(answers, Vec::from_iter(result), "{command} {params:?}");
    }
    let mut world = World::with_station();
    world.command(QGC, 22, take_off(45.0));
    let start = world.orders()[0];
    world.report(&start, Stage::Done, Reason::None);
    let then = world.orders();
    assert_eq!(then[0].kind, TakeOff(15.0));
    assert!(then[0].issued == start.issued && then[0].begin_by == start.begin_by);
}

#[test]
fn each_command_in_the_air() {
    let above = |altitude_m| WaypointPosition {
        latitude_deg: HERE.0,
        longitude_deg: HERE.1,
        altitude_m,
    };
    let is_near = |a: WaypointPosition, b: WaypointPosition| {
        (a.latitude_deg - b.latitude_deg).abs() < 1e-6
            && (a.longitude_deg - b.longitude_deg).abs() < 1e-6
            && (a.altitude_m - b.altitude_m).abs() < 1e-3
    };
    let (x, y) = (374_200_000, -60_010_000);
    let there = WaypointPosition {
        latitude_deg: 37.42,
        ..above(60.0)
    };
    let goto: [(MessageWriter, Option<WaypointPosition>, Option<u8>); 11] = [
        (reposition(0, x, y, 60.0), Some(there), None),
        (reposition(5, x, y, 60.0), Some(there), None),
        (reposition(3, x, y, 30.0), Some(there), None),
        (reposition(6, x, y, 30.0), Some(there), None),
        (
            reposition(6, x, y, NAN),
            Some(WaypointPosition {
                altitude_m: 50.0,
                ..there
            }),
            None,
        ),
        (reposition(10, x, y, 30.0), None, Some(2)),
        (reposition(6, 0, 0, 30.0), None, Some(2)),
        (
            reposition(0, i32::MAX, i32::MAX, 70.0),
            Some(above(70.0)),
            None,
        ),
        // The second half of QGroundControl's pause.
        (reposition(0, i32::MIN, i32::MIN, 50.4), None, Some(0)),
        (long(20, one(0.0)), Some(above(50.0)), None),
        (
            long(176, [1.0, 4.0, 5.0, 0.0, 0.0, 0.0, 0.0]),
            Some(above(50.0)),
            None,
        ),
    ];
    for (message, expected, result) in goto {
        let mut world = World::flying();
        world.receive(QGC, &QGC.frame(&message));
        let kinds = world.kinds();
        match (&kinds[..], expected) {
            ([], None) => {}
            ([OrderKind::GoTo(place)], Some(expected)) => {
                assert!(is_near(*place, expected), "{place:?}, {message:?}");
            }
            _ => panic!("{kinds:?}, {message:?}"),
        }
        let answers: Vec<u8> = acks(&world.sent()).iter().map(|ack| ack.1).collect();
        assert_eq!(answers, Vec::from_iter(result), "{message:?}");
    }
    // No coordinates and no height: hold.
    let mut world = World::flying();
    world.receive(QGC, &QGC.frame(&reposition(0, i32::MAX, i32::MAX, NAN)));
    assert_eq!(world.kinds(), [OrderKind::Hold]);
    // Disarming never stops the rotor, forced or not.
    for force in [0.0, 21_196.0, 2_989.0] {
        let mut world = World::flying();
        world.command(QGC, 400, [0.0, force, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(world.kinds(), []);
        let sent = world.sent();
        assert_eq!(acks(&sent), [(400, 2, 0)]);
        assert!(texts(&sent)[0].1.contains("use Land"), "{sent:?}");
    }
    // Also when the same was done on the ground just before.
    let mut world = World::with_station();
    world.state.blocked = 0;
    world.tick(20);
    world.command(QGC, 400, one(0.0));
    let stop = world.orders()[0];
    assert_eq!(stop.kind, OrderKind::Stop);
    world.report(&stop, Stage::Done, Reason::None);
    world.telemetry.flying = 1;
    world.tick(20);
    world.command(QGC, 400, one(0.0));
    assert_eq!(acks(&world.sent()), [(400, 0, 0), (400, 2, 0)]);
    // A landing that is under way is what was asked for.
    let mut world = World::flying();
    world.state.functionality = Functionality::Landing.code();
    world.tick(20);
    world.command(QGC, 21, [0.0; 7]);
    assert_eq!(
        (world.kinds(), acks(&world.sent())),
        (vec![], vec![(21, 0, 0)])
    );
}

#[test]
fn each_reason_is_an_answer_and_a_text() {
    for reason in Reason::ALL {
        let mut world = World::flying();
        world.receive(
            QGC,
            &QGC.frame(&reposition(6, 374_200_000, -60_010_000, 30.0)),
        );
        let order = world.orders()[0];
        world.report(&order, Stage::Refused, reason);
        let sent = world.sent();
        let expected = answer_of(Stage::Refused, reason);
        assert_eq!(acks(&sent), [(192, expected.result as u8, reason.code())]);
        let is_said = texts(&sent) == [(3, format!("goto refused ({reason})"))];
        assert_eq!(is_said, !expected.is_accepted(), "{reason}: {sent:?}");
    }
}

#[test]
fn an_answer_is_the_first_report_and_what_comes_later_is_a_text() {
    let mut world = World::flying();
    world.receive(
        QGC,
        &QGC.frame(&reposition(6, 374_200_000, -60_010_000, 30.0)),
    );
    let order = world.orders()[0];
    assert_eq!(order.issued, world.now);
    // Never "in progress": MAVSDK takes the first answer for the last one.
    world.pass(900);
    assert_eq!(acks(&world.sent()), []);
    world.report(&order, Stage::Accepted, Reason::None);
    world.report(&order, Stage::Progress, Reason::None);
    assert_eq!(acks(&world.sent()), [(192, 0, 0)]);
    world.report(&order, Stage::Aborted, Reason::FenceBreach);
    let sent = world.sent();
    assert_eq!(acks(&sent), []);
    assert_eq!(
        texts(&sent),
        [(3, "goto aborted (fence-breach)".to_owned())]
    );
    // A copy gets the later verdict.
    world.receive(
        QGC,
        &QGC.frame(&reposition(6, 374_200_000, -60_010_000, 30.0)),
    );
    assert_eq!(acks(&world.sent()), [(192, 2, Reason::FenceBreach.code())]);
    assert_eq!(world.kinds(), []);
}

#[test]
fn a_change_of_height_that_is_too_small_is_said_not_to_be_done() {
    // From where, by how much, and whether the helicopter hovers; what is said, and how many orders.
    for (from_m, change_m, hovers, is_said, orders) in [
        (50.0, 0.1, true, false, 0),
        (0.0, 0.2, true, false, 0),
        (50.0, 0.6, true, true, 0),
        (50.0, 0.6, false, false, 1),
        (50.0, 1.0, true, false, 1),
        (50.0, 2.0, true, false, 1),
    ] {
        let mut world = World::flying();
        world.telemetry.geodetic.altitude_m = from_m;
        if !hovers {
            world.state.functionality = Functionality::FollowingPath.code();
        }
        world.tick(20);
        world.sent();
        let height = from_m as f32 + change_m;
        world.command(QGC, 192, [-1.0, 0.0, 0.0, NAN, NAN, NAN, height]);
        let sent = world.sent();
        assert_eq!(world.kinds().len(), orders, "{change_m}");
        assert_eq!(acks(&sent).len(), 1 - orders, "{change_m}");
        let said = texts(&sent)
            .iter()
            .any(|(_, text)| text.contains("the height stays"));
        assert_eq!(said, is_said, "{change_m}: {:?}", texts(&sent));
    }
}

#[test]
fn a_change_of_speed_on_a_path_is_said_to_stop_the_helicopter() {
    for (functionality, is_said) in [
        (Functionality::FollowingPath, true),
        (Functionality::Holding, false),
    ] {
        let mut world = World::flying();
        world.state.functionality = functionality.code();
        world.tick(20);
        world.sent();
        world.command(QGC, 178, speed(5.0));
        assert_eq!(world.kinds(), [OrderKind::Speed(5.0)]);
        let text = "speed: the helicopter stops for a moment";
        let said = texts(&world.sent());
        assert_eq!(said.iter().any(|(_, one)| one == text), is_said);
    }
}

#[test]
fn a_bridge_that_does_not_answer_is_an_unknown_outcome_and_nothing_follows() {
    let mut world = World::with_station();
    world.command(QGC, 22, take_off(NAN));
    let start = world.orders()[0];
    world.pass(1_000);
    let sent = world.sent();
    assert_eq!(acks(&sent), [(22, 4, 0)]);
    assert!(
        texts(&sent)[0].1.contains("look before you repeat"),
        "{sent:?}"
    );
    // The start is done all the same; the take-off would come late.
    world.report(&start, Stage::Done, Reason::None);
    assert_eq!(world.kinds(), []);
}

#[test]
fn a_hold_cancels_a_take_off_that_waits_for_its_start() {
    let mut world = World::with_station();
    world.heartbeat(SCRIPT);
    world.sent();
    world.command(QGC, 22, take_off(NAN));
    let start = world.orders()[0];
    world.command(SCRIPT, 193, one(0.0));
    assert_eq!(world.kinds(), [OrderKind::Hold]);
    assert_eq!(acks(&world.sent()), [(22, 6, 0)]);
    world.report(&start, Stage::Done, Reason::None);
    assert_eq!(world.kinds(), []);
}

#[test]
fn copies_are_carried_out_once_and_a_stop_each_time() {
    let mut world = World::flying();
    let goto = reposition(6, 374_200_000, -60_010_000, 30.0);
    world.receive(QGC, &QGC.frame(&goto));
    world.receive(QGC, &QGC.frame(&goto));
    let orders = world.orders();
    assert_eq!(orders.len(), 1);
    assert_eq!(acks(&world.sent()), []);
    world.report(&orders[0], Stage::Accepted, Reason::None);
    world.sent();
    world.pass(2_400);
    world.tick(10);
    world.sent();
    world.receive(QGC, &QGC.frame(&goto));
    assert_eq!(
        (world.kinds(), acks(&world.sent())),
        (vec![], vec![(192, 0, 0)])
    );
    world.tick(200);
    world.receive(QGC, &QGC.frame(&goto));
    let again = world.orders();
    assert_eq!(again.len(), 1, "the memory is over");
    // The station's own path may be replaced, that of another one may not.
    assert!(again[0].preempts);
    world.heartbeat(SCRIPT);
    world.receive(SCRIPT, &SCRIPT.frame(&goto));
    assert!(!world.orders()[0].preempts);

    world.state.functionality = Functionality::FollowingPath.code();
    world.tick(20);
    for _ in 0..3 {
        world.command(SCRIPT, 193, one(0.0));
        let orders = world.orders();
        assert_eq!(orders.len(), 1);
        assert!(orders[0].preempts && orders[0].begin_by.is_none());
        world.report(&orders[0], Stage::Done, Reason::None);
    }
    // A flood of holds is one, once the helicopter holds.
    world.state.functionality = Functionality::Holding.code();
    world.tick(1);
    for _ in 0..100 {
        world.command(SCRIPT, 193, one(0.0));
    }
    assert!(world.kinds().len() <= 1);
}

#[test]
fn a_return_flies_home_and_lands_unless_something_else_comes() {
    let mut world = World::flying();
    world.command(QGC, 20, one(0.0));
    let path = world.orders()[0];
    world.report(&path, Stage::Accepted, Reason::None);
    world.state.functionality = Functionality::FollowingPath.code();
    world.sent();
    world.tick(20);
    let sent = world.sent();
    let heartbeat = sent
        .iter()
        .find(|one| one.kind.id == 0)
        .expect("a heartbeat");
    assert_eq!(
        u32::from_le_bytes(heartbeat.bytes(0)),
        Mode::Return.custom()
    );
    let mut held = World {
        gateway: world.gateway.clone(),
        ..World::flying()
    };
    held.now = world.now;
    world.report(&path, Stage::Done, Reason::None);
    assert_eq!(world.kinds(), [OrderKind::Land]);
    // A hold that comes just before its end: no landing follows.
    held.command(QGC, 193, one(0.0));
    assert_eq!(held.kinds(), [OrderKind::Hold]);
    held.report(&path, Stage::Done, Reason::None);
    assert_eq!(held.kinds(), []);
}

#[test]
fn set_mode_is_answered_by_the_heartbeat_and_refused_by_a_text() {
    let mut world = World::flying();
    let mode = |mode: Mode| MessageWriter::new(SET_MODE).u32(mode.custom()).u8(1).u8(1);
    for _ in 0..3 {
        world.receive(QGC, &QGC.frame(&mode(Mode::TakeOff)));
    }
    let sent = world.sent();
    assert_eq!(acks(&sent), []);
    assert_eq!(texts(&sent).len(), 1, "{sent:?}");
    world.receive(QGC, &QGC.frame(&mode(Mode::Land)));
    assert_eq!(world.kinds(), [OrderKind::Land]);
    assert!(world.sent().iter().all(|one| one.kind != COMMAND_ACK));
}

#[test]
fn arming_and_take_off_are_refused_while_the_helicopter_is_not_ready() {
    let ways: [fn(&mut World); 3] = [
        |world| world.state.safety.pilot_switch = PilotSwitch::Manual.code(),
        |world| world.telemetry.valid_groups = 0,
        |world| world.state.safety.action = ipc_types::code::SafetyAction::Refuse.code(),
    ];
    for way in ways {
        let mut world = World::with_station();
        way(&mut world);
        world.tick(20);
        world.sent();
        world.command(QGC, 400, one(1.0));
        world.command(QGC, 22, take_off(NAN));
        assert_eq!(world.kinds(), []);
        assert_eq!(acks(&world.sent()), [(400, 1, 0), (22, 1, 0)]);
    }
}

#[test]
fn only_hold_and_land_are_passed_on_while_the_helicopter_is_not_heard() {
    let mut world = World::flying();
    world.pass(3_000);
    world.sent();
    world.receive(
        QGC,
        &QGC.frame(&reposition(6, 374_200_000, -60_010_000, 30.0)),
    );
    world.command(QGC, 400, one(0.0));
    world.command(QGC, 20, one(0.0));
    assert_eq!(world.kinds(), []);
    let down = Reason::LinkDown.code();
    assert_eq!(
        acks(&world.sent()),
        [(192, 1, down), (400, 1, down), (20, 1, down)]
    );
    world.command(QGC, 193, one(0.0));
    world.command(QGC, 21, [0.0; 7]);
    assert_eq!(world.kinds(), [OrderKind::Hold, OrderKind::Land]);
}

#[test]
fn only_stations_that_may_command_do() {
    let settings = Settings {
        commanders: vec![245],
        ..Settings::default()
    };
    let mut world = World::new(settings);
    world.heartbeat(QGC);
    world.command(QGC, 193, one(0.0));
    world.command(SCRIPT, 193, one(0.0));
    assert_eq!(world.kinds(), []);
    let sent = world.sent();
    assert_eq!(acks(&sent), [(193, 2, 0), (193, 2, 0)]);
    assert!(
        texts(&sent)
            .iter()
            .any(|(_, text)| text.contains("HEARTBEAT before")),
        "{sent:?}"
    );
    world.heartbeat(SCRIPT);
    world.command(SCRIPT, 193, one(0.0));
    assert_eq!(world.kinds(), [OrderKind::Hold]);
    // Those for another vehicle, or for another component, are nobody's.
    for (system, component) in [(2, 1), (2, 0), (0, 100), (1, 100)] {
        let message = MessageWriter::new(mavlink_gateway::message::COMMAND_LONG);
        let message = (0..7).fold(message, |message, _| message.f32(0.0));
        let message = message.u16(21).u8(system).u8(component).u8(0);
        world.sent();
        world.receive(SCRIPT, &SCRIPT.frame(&message));
        assert_eq!((world.kinds(), acks(&world.sent())), (vec![], vec![]));
    }
}

#[test]
fn a_full_bridge_keeps_room_for_a_stop() {
    let mut world = World::flying();
    for number in 0..10 {
        let goto = reposition(6, 374_200_000 + number, -60_010_000, 30.0);
        world.receive(QGC, &QGC.frame(&goto));
    }
    assert_eq!(world.kinds().len(), 7);
    let many = Reason::TooManyRequests.code();
    assert_eq!(acks(&world.sent()), [(192, 1, many); 3]);
    world.command(QGC, 21, [0.0; 7]);
    assert_eq!(world.kinds(), [OrderKind::Land]);
}

#[test]
fn what_the_bridge_does_by_itself_is_a_text_to_all() {
    let mut world = World::flying();
    world.state.safety.rule = ipc_types::code::SafetyRule::Battery.code();
    world.state.safety.action = ipc_types::code::SafetyAction::Land.code();
    world.tick(20);
    assert_eq!(
        texts(&world.sent()),
        [(0, "safety rule battery: land".to_owned())]
    );
    world.state.safety.action = 0;
    world.state.safety.rule = 0;
    world.state.status = ModuleStatus::Aborted.code();
    world.state.imi_error = 100;
    world.tick(20);
    let expected = [
        (6, "safety rule battery: over".to_owned()),
        (2, "the module was aborted: hero-dsp-fatal-error".to_owned()),
    ];
    assert_eq!(texts(&world.sent()), expected);
    // Stations hear of a movement of others when its sender was lost, and not when an order replaced it.
    for (reason, expected) in [
        (Reason::Replaced, vec![]),
        (
            Reason::SenderLost,
            vec![(4, "the path ended: sender-lost".to_owned())],
        ),
    ] {
        world.state.last_end.request_id += 1;
        world.state.last_end.stage = Stage::Aborted.code();
        world.state.last_end.reason = reason.code();
        world.tick(20);
        assert_eq!(texts(&world.sent()), expected);
    }
    // A relay translates the moment anew with each sample.
    for _ in 0..300 {
        world.state.last_end.ended_ns += 20_000;
        world.tick(20);
        assert_eq!(texts(&world.sent()), []);
    }
}

#[test]
fn home_can_be_set_at_this_site_and_all_are_told_at_once() {
    let at = |latitude: f32, longitude: f32, z| [0.0, 0.0, 0.0, 0.0, latitude, longitude, z];
    for is_flying in [false, true] {
        let mut world = match is_flying {
            true => World::flying(),
            false => World::with_station(),
        };
        world.heartbeat(SCRIPT);
        world.run(300);
        world.command(QGC, 179, at(37.5, -6.0, 40.0));
        world.tick(20);
        let sent = world.sent();
        assert_eq!(acks(&sent), [(179, 0, 0)]);
        let homes: Vec<_> = sent
            .iter()
            .filter(|one| one.kind == HOME_POSITION)
            .collect();
        assert_eq!(homes.len(), 2, "both stations see it at once");
        assert_eq!(i32::from_le_bytes(homes[0].bytes(0)), 375_000_000);
        let said: Vec<_> = sent.iter().filter(|one| one.kind == STATUSTEXT).collect();
        assert!(
            said.iter().all(|one| one.to == SCRIPT.address()),
            "{said:?}"
        );
        let text = &texts(&sent)[0].1;
        assert!(
            text.starts_with("home was set by station 255/190: 37.5"),
            "{text}"
        );
        if is_flying {
            world.command(QGC, 20, one(0.0));
            let kinds = world.kinds();
            let OrderKind::GoTo(place) = kinds[0] else {
                panic!("{kinds:?}")
            };
            assert_eq!((place.latitude_deg, place.altitude_m), (37.5, 50.0));
        }
    }
    // So far above and below the helicopter it may be, and where it is.
    for (z, result) in [(2_050.0, 0), (2_050.5, 2), (-1_950.0, 0), (-1_950.5, 2)] {
        let mut world = World::flying();
        world.command(QGC, 179, at(37.5, -6.0, z));
        assert_eq!(acks(&world.sent())[0].1, result, "{z}");
    }
    for (latitude, z, is_said) in [(NAN, NAN, false), (NAN, 0.0, false), (37.5, NAN, true)] {
        let mut world = World::flying();
        world.command(QGC, 179, [1.0, 0.0, 0.0, 0.0, latitude, latitude, z]);
        let sent = world.sent();
        assert_eq!(acks(&sent), [(179, 0, 0)]);
        let notice = "home: it is where the helicopter is, and not elsewhere";
        assert_eq!(texts(&sent).iter().any(|(_, text)| text == notice), is_said);
    }
    // What is no home of a flight from here.
    for params in [
        one(0.0),
        one(2.0),
        at(1e-7, -6.0, 40.0),
        at(37.5, 6.0, 40.0),
        at(37.5, -6.0, -3e38),
        at(37.5, -6.0, 3_000.0),
        at(37.5, -6.0, NAN),
        at(NAN, NAN, 40.0),
        at(91.0, -6.0, 40.0),
    ] {
        let mut world = World::flying();
        world.command(QGC, 179, params);
        let sent = world.sent();
        assert_eq!(acks(&sent)[0].1, 2, "{params:?}");
        assert!(
            texts(&sent)[0].1.starts_with("home was refused"),
            "{sent:?}"
        );
    }
}
