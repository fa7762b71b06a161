//! Missions as a station sees them: they come whole or not at all, are checked and flown, pause, and can be read.

use ipc_types::code::{CameBetween, PilotSwitch, Reason, Stage};
use ipc_types::payload::{ControlSender, RequestReport};
use mavlink_gateway::message::{
    self, MISSION_ACK, MISSION_COUNT, MISSION_CURRENT, MISSION_ITEM_INT, MISSION_ITEM_REACHED,
    MISSION_REQUEST_INT, MISSION_SET_CURRENT, SET_MODE,
};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{Mission, Mode, Order, OrderKind, Settings, StationLost};

use crate::common::{
    HERE, QGC, SCRIPT, Sent, Station, World, acks, clear, count, of_kind, reposition, request_item,
    request_list, request_of, results, texts,
};

const NAN: f32 = f32::NAN;

/// MAV_MISSION_RESULT.
const ACCEPTED: u8 = 0;
const ERROR: u8 = 1;
const UNSUPPORTED: u8 = 3;
const NO_SPACE: u8 = 4;
const PARAM_7: u8 = 12;
const INVALID_SEQUENCE: u8 = 13;
const DENIED: u8 = 14;
const CANCELLED: u8 = 15;

/// An item in a frame above home.
fn item(sequence: u16, command: u16, first: f32, (north, z): (i32, f32)) -> MessageWriter {
    let (x, y) = match north {
        0 => (0, 0),
        north => ((HERE.0 * 1e7) as i32 + north, (HERE.1 * 1e7) as i32),
    };
    let message = MessageWriter::new(MISSION_ITEM_INT)
        .f32(first)
        .f32(0.0)
        .f32(0.0)
        .f32(NAN);
    let message = message.i32(x).i32(y).f32(z).u16(sequence).u16(command);
    message.u8(1).u8(1).u8(6).u8(0).u8(1).u8(0)
}

/// Take off, two waypoints with a hover at the second, a speed, a third waypoint, and land.
fn survey() -> Vec<MessageWriter> {
    let speed = MessageWriter::new(MISSION_ITEM_INT)
        .f32(1.0)
        .f32(4.0)
        .f32(-1.0)
        .f32(0.0);
    let speed = speed.i32(0).i32(0).f32(0.0).u16(3).u16(178);
    vec![
        item(0, 22, 0.0, (0, 15.0)),
        item(1, 16, 0.0, (1_000, 15.0)),
        item(2, 16, 5.0, (2_000, 15.0)),
        speed.u8(1).u8(1).u8(2).u8(0).u8(1).u8(0),
        item(4, 16, 0.0, (3_000, 15.0)),
        item(5, 21, 0.0, (0, 0.0)),
    ]
}

/// The numbers of the items that are asked for.
fn requests(sent: &[Sent]) -> Vec<u16> {
    let asked = of_kind(sent, MISSION_REQUEST_INT).into_iter();
    asked.map(|one| u16::from_le_bytes(one.bytes(0))).collect()
}

/// The numbers of the items that were reached.
fn reached(sent: &[Sent]) -> Vec<u16> {
    let reached = of_kind(sent, MISSION_ITEM_REACHED).into_iter();
    reached
        .map(|one| u16::from_le_bytes(one.bytes(0)))
        .collect()
}

/// MISSION_CURRENT: item, state.
fn current(world: &mut World) -> (u16, u8) {
    let sent = world.run(60);
    let last = of_kind(&sent, MISSION_CURRENT)
        .pop()
        .cloned()
        .expect("MISSION_CURRENT");
    (u16::from_le_bytes(last.bytes(0)), last.bytes::<1>(4)[0])
}

/// The station chooses the item that is next.
fn jump(world: &mut World, number: u16) {
    let message = MessageWriter::new(MISSION_SET_CURRENT).u16(number);
    world.receive(QGC, &QGC.frame(&message.u8(1).u8(1)));
    world.serve("");
}

fn mode(world: &mut World) -> u32 {
    let sent = world.run(60);
    let last = of_kind(&sent, message::HEARTBEAT)
        .pop()
        .cloned()
        .expect("a heartbeat");
    u32::from_le_bytes(last.bytes(0))
}

/// Sends items as they are asked for, and gives what was sent after the last one.
fn upload(world: &mut World, from: Station, items: &[MessageWriter], rules: &str) -> Vec<Sent> {
    world.receive(from, &from.frame(&count(items.len() as u16, 0)));
    for (number, item) in items.iter().enumerate() {
        assert_eq!(requests(&world.sent()), [number as u16]);
        world.receive(from, &from.frame(item));
    }
    world.serve(rules);
    world.sent()
}

fn with_survey(mut world: World) -> World {
    let sent = upload(&mut world, QGC, &survey(), "");
    assert_eq!(results(&sent), [ACCEPTED], "{:?}", texts(&sent));
    world
}

fn choose_mission(world: &mut World, from: Station) {
    let message = MessageWriter::new(SET_MODE)
        .u32(Mode::Mission.custom())
        .u8(1)
        .u8(1);
    world.receive(from, &from.frame(&message));
    world.serve("");
}

/// The one order that the bridge is asked for.
#[track_caller]
fn order(world: &mut World) -> Order {
    let orders = world.orders();
    assert_eq!(orders.len(), 1, "{orders:?}, {:?}", texts(&world.sent()));
    orders[0]
}

/// The bridge takes an order and does it.
fn done(world: &mut World, order: &Order) {
    world.report(order, Stage::Accepted, Reason::None);
    world.report(order, Stage::Done, Reason::None);
}

/// The bridge has started the module, which its state says.
fn started(world: &mut World, start: &Order) {
    assert_eq!(start.kind, OrderKind::Start);
    done(world, start);
    world.state.blocked = 0;
    world.tick(20);
}

/// So many waypoints of the path were reached.
fn progress(world: &mut World, order: &Order, waypoints_reached: u32) {
    let report = RequestReport {
        request_id: request_of(order),
        waypoints_reached,
        ..RequestReport::new(Stage::Progress, Reason::None)
    };
    world.gateway.report(order.number, &report, "", world.now);
    world.gateway.advance(world.now);
}

/// The mission of [`survey`] in the air, on its way to the items 1 and 2, with the order of that path.
fn on_path() -> (World, Order) {
    let mut world = with_survey(World::flying());
    choose_mission(&mut world, QGC);
    let path = order(&mut world);
    assert_eq!(
        (path.kind, world.gateway.path(path.number).len()),
        (OrderKind::Path, 2)
    );
    world.report(&path, Stage::Accepted, Reason::None);
    world.sent();
    (world, path)
}

#[test]
fn a_mission_comes_is_kept_and_is_read_bit_by_bit() {
    let mut world = World::with_station();
    assert_eq!(current(&mut world), (0, 1), "there is none");
    let sent = upload(&mut world, QGC, &survey(), "");
    assert_eq!(results(&sent), [ACCEPTED]);
    let id = of_kind(&sent, MISSION_ACK)[0].bytes::<4>(4);
    let mission = world.disk.clone().expect("it was kept");
    assert_eq!((u32::from_le_bytes(id), mission.count()), (mission.id(), 6));
    assert_eq!(current(&mut world), (0, 2));

    // Another program reads it; a gateway that was started anew has it.
    let mut again = World::with_station();
    again
        .gateway
        .restore(Mission::decode(&mission.encode()).unwrap());
    again.heartbeat(SCRIPT);
    again.sent();
    let list = request_list(0);
    again.receive(SCRIPT, &SCRIPT.frame(&list));
    let sent = again.sent();
    let answer = of_kind(&sent, MISSION_COUNT)[0];
    assert_eq!(
        (answer.to, answer.bytes::<2>(0), answer.bytes::<4>(5)),
        (SCRIPT.address(), [6, 0], id)
    );
    for (number, uploaded) in survey().iter().enumerate() {
        let request = request_item(number as u16, 0);
        again.receive(SCRIPT, &SCRIPT.frame(&request));
        let sent = again.sent();
        let item = of_kind(&sent, MISSION_ITEM_INT)[0];
        let expected = uploaded.payload().0;
        assert_eq!(item.bytes::<32>(0), expected[..32], "item {number}");
        assert_eq!(item.bytes::<2>(32), [245, 190]);
        assert_eq!(item.bytes::<3>(34), expected[34..37]);
    }
    let beyond = request_item(6, 0);
    again.receive(SCRIPT, &SCRIPT.frame(&beyond));
    assert_eq!(results(&again.sent()), [INVALID_SEQUENCE]);
}

#[test]
fn a_station_reads_the_mission_with_which_it_began() {
    let mut world = with_survey(World::with_station());
    world.heartbeat(SCRIPT);
    let list = request_list(0);
    world.receive(SCRIPT, &SCRIPT.frame(&list));
    upload(&mut world, QGC, &[item(0, 22, 0.0, (0, 9.0))], "");
    let request = request_item(5, 0);
    world.receive(SCRIPT, &SCRIPT.frame(&request));
    assert_eq!(of_kind(&world.sent(), MISSION_ITEM_INT).len(), 1);
    let thanks = MessageWriter::new(MISSION_ACK).u8(1).u8(1).u8(0).u8(0);
    world.receive(SCRIPT, &SCRIPT.frame(&thanks));
    world.receive(SCRIPT, &SCRIPT.frame(&request));
    assert_eq!(
        results(&world.sent()),
        [INVALID_SEQUENCE],
        "there is one item"
    );
}

#[test]
fn a_refused_mission_leaves_the_one_of_before() {
    let ceiling = "[fence]\nceiling_m = 40.0\n";
    let mut world = with_survey(World::with_station());
    let before = world.disk.clone();
    let sent = upload(&mut world, QGC, &survey(), ceiling);
    assert_eq!(results(&sent), [PARAM_7]);
    let text = &texts(&sent)[0].1;
    assert!(
        text.starts_with("the mission was refused: item 1: ends its climb above the ceiling"),
        "{text}"
    );
    assert!(text.ends_with("by 5.0 m"), "{text}");
    assert_eq!((world.disk.clone(), current(&mut world)), (before, (0, 2)));

    let rally_points = count(3, 2);
    let many = count(2049, 0);
    for (message, result) in [(&rally_points, UNSUPPORTED), (&many, NO_SPACE)] {
        world.receive(QGC, &QGC.frame(message));
        assert_eq!(results(&world.sent()), [result]);
    }
    // A disk that is full.
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    world.receive(QGC, &QGC.frame(&item(0, 22, 0.0, (0, 9.0))));
    while let Some(task) = world.gateway.poll_task() {
        match task {
            mavlink_gateway::Task::Rules => world.gateway.rules(None, world.now),
            mavlink_gateway::Task::PutFence(_) | mavlink_gateway::Task::RestoreFence => {
                panic!("no fence was sent")
            }
            mavlink_gateway::Task::Save(mission) => {
                world
                    .gateway
                    .saved(mission, Err("no space".to_owned()), world.now);
            }
        }
    }
    let sent = world.sent();
    assert_eq!(results(&sent), [ERROR]);
    assert_eq!(current(&mut world), (0, 2));
    // One that never comes whole.
    world.receive(QGC, &QGC.frame(&count(2, 0)));
    world.pass(2_000);
    assert_eq!(results(&world.sent()), [CANCELLED]);
}

#[test]
fn what_is_remarkable_is_a_notice_and_an_empty_mission_is_none() {
    let mut world = World::with_station();
    let sent = upload(
        &mut world,
        QGC,
        &[item(0, 22, 0.0, (0, 9.0)), item(1, 206, 3.0, (0, 0.0))],
        "",
    );
    assert_eq!(results(&sent), [ACCEPTED]);
    let notice = (
        5,
        "item 2: DO_SET_CAM_TRIGG_DIST (206) is not done".to_owned(),
    );
    assert!(texts(&sent).contains(&notice), "{:?}", texts(&sent));
    for message in [count(0, 0), clear(0), clear(255)] {
        world = with_survey(world);
        world.receive(QGC, &QGC.frame(&message));
        world.serve("");
        assert_eq!(results(&world.sent()), [ACCEPTED]);
        assert_eq!(world.disk.as_ref().map(Mission::count), Some(0));
        assert_eq!(current(&mut world), (0, 1));
    }
}

#[test]
fn what_changes_the_flight_is_said_whatever_else_is_not_done() {
    let mut world = World::with_station();
    // Ten loads of the common dialect, headings and radii, and one item after which the author stops.
    let loads = [187, 206, 211, 526, 530, 1000, 1001, 2000, 2004, 2500];
    let mut items = vec![item(0, 22, 0.0, (0, 15.0))];
    for load in loads {
        items.push(item(items.len() as u16, load, 3.0, (0, 0.0)));
    }
    let last = item(items.len() as u16, 16, 0.0, (1_000, 15.0));
    let payload = last.payload();
    let bytes = (0..38).map(|at| match at {
        // Parameters 2, 4 and autocontinue.
        6 | 14 => 0x80,
        7 | 15 => 0x40,
        12 | 13 | 36 => 0,
        at => payload.u8(at),
    });
    let message = MessageWriter::new(MISSION_ITEM_INT);
    items.push(bytes.fold(message, |message, byte| message.u8(byte)));
    let sent = upload(&mut world, QGC, &items, "");
    assert_eq!(results(&sent), [ACCEPTED], "{:?}", texts(&sent));
    let said: Vec<String> = texts(&sent).into_iter().map(|(_, text)| text).collect();
    let expected = [
        "item 12: asks for an acceptance radius of 4 m, which is not done",
        "item 12: asks for a stop after the item (autocontinue is off), which is not done",
        "item 2: DO_SET_ACTUATOR (187) is not done",
        "item 3: DO_SET_CAM_TRIGG_DIST (206) is not done",
        "item 4: DO_GRIPPER (211) is not done",
        "item 5: STORAGE_FORMAT (526) is not done",
        "items 6, 7, 8, 9, 10, 11, ?: more that is not done; `ril plan check` names it",
    ];
    assert_eq!(said[..7], expected, "{said:?}");
}

#[test]
fn only_a_station_that_may_command_sends_a_mission() {
    let settings = Settings {
        commanders: vec![QGC.system],
        ..Settings::default()
    };
    let mut world = World::new(settings);
    world.heartbeat(SCRIPT);
    world.sent();
    world.receive(SCRIPT, &SCRIPT.frame(&count(1, 0)));
    assert_eq!(results(&world.sent()), [DENIED]);
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    assert_eq!(results(&world.sent()), [DENIED], "it sent no heartbeat");
    world.heartbeat(QGC);
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    assert_eq!(requests(&world.sent()), [0]);
}

/// QGroundControl chooses the mode, waits for the heartbeat, and arms.
#[test]
fn a_mission_is_primed_on_the_ground_and_the_arming_of_its_station_starts_it() {
    let mut world = with_survey(World::with_station());
    world.heartbeat(SCRIPT);
    choose_mission(&mut world, QGC);
    assert_eq!(world.kinds(), []);
    assert_eq!(mode(&mut world), Mode::Mission.custom());
    let arm = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    world.command(QGC, 400, arm);
    world.serve("");
    let start = order(&mut world);
    started(&mut world, &start);
    assert_eq!(acks(&world.sent()), [(400, 0, 0)]);
    let take_off = order(&mut world);
    assert_eq!(take_off.kind, OrderKind::TakeOff(15.0));

    // Another station's arming is an arming, and so is that of 10 s later.
    for (from, seconds) in [(SCRIPT, 0), (QGC, 10)] {
        let mut world = with_survey(World::with_station());
        world.heartbeat(SCRIPT);
        choose_mission(&mut world, QGC);
        world.run(50 * seconds);
        world.command(from, 400, arm);
        let start = order(&mut world);
        done(&mut world, &start);
        assert_eq!(world.kinds(), []);
        assert_eq!(mode(&mut world), Mode::Hold.custom());
    }
    // So is one after another order.
    let mut world = with_survey(World::with_station());
    choose_mission(&mut world, QGC);
    world.command(QGC, 193, [0.0; 7]);
    assert_eq!(mode(&mut world), Mode::Hold.custom());
}

#[test]
fn all_steps_follow_each_other_and_each_item_is_reached_once() {
    let mut world = with_survey(World::with_station());
    world.command(QGC, 300, [0.0; 7]);
    world.serve("");
    let start = order(&mut world);
    started(&mut world, &start);
    assert_eq!(acks(&world.sent()), [(300, 0, 0)]);
    let take_off = order(&mut world);
    assert_eq!(take_off.kind, OrderKind::TakeOff(15.0));
    assert_eq!(
        (current(&mut world), mode(&mut world)),
        ((0, 3), Mode::Mission.custom())
    );
    done(&mut world, &take_off);
    assert_eq!(reached(&world.sent()), [0]);

    let path = order(&mut world);
    assert_eq!(path.kind, OrderKind::Path);
    let points = world.gateway.path(path.number).to_vec();
    assert!(
        (points[1].latitude_deg - (HERE.0 + 2e-4)).abs() < 1e-6 && points[1].altitude_m == 45.0,
        "{points:?}"
    );
    world.report(&path, Stage::Accepted, Reason::None);
    progress(&mut world, &path, 1);
    assert_eq!(reached(&world.sent()), [1]);
    assert_eq!(current(&mut world), (2, 3));
    progress(&mut world, &path, 2);
    world.report(&path, Stage::Done, Reason::None);
    assert_eq!(reached(&world.sent()), [0; 0], "it still hovers there");
    // Five seconds.
    world.run(245);
    assert_eq!(world.kinds(), []);
    let sent = world.run(10);
    assert_eq!(reached(&sent), [2]);
    let speed = order(&mut world);
    assert_eq!(speed.kind, OrderKind::Speed(4.0));
    done(&mut world, &speed);
    let path = order(&mut world);
    done(&mut world, &path);
    let land = order(&mut world);
    assert_eq!(land.kind, OrderKind::Land);
    assert_eq!(mode(&mut world), Mode::Mission.custom());
    world.sent();
    done(&mut world, &land);
    let sent = world.sent();
    assert_eq!(reached(&sent), [5]);
    assert!(texts(&sent).contains(&(6, "mission done".to_owned())));
    assert_eq!((current(&mut world), world.kinds()), ((5, 4 + 1), vec![]));
    // A station chooses where it is to begin next, and leaves that to another.
    jump(&mut world, 2);
    assert_eq!((current(&mut world), world.kinds()), ((2, 4 + 1), vec![]));
    jump(&mut world, 0);
    // Once more, from the beginning.
    world.command(QGC, 300, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    world.serve("");
    assert_eq!(order(&mut world).kind, OrderKind::TakeOff(15.0));
}

#[test]
fn a_start_is_checked_with_the_rules_of_now() {
    let mut world = with_survey(World::with_station());
    world.command(QGC, 300, [0.0; 7]);
    world.serve("[fence]\nceiling_m = 40.0\n");
    let sent = world.sent();
    assert_eq!((world.kinds(), acks(&sent)), (vec![], vec![(300, 2, 0)]));
    assert!(
        texts(&sent)[0].1.contains("above the ceiling"),
        "{:?}",
        texts(&sent)
    );
    // A bridge that does not say them.
    world.pass(3_000);
    world.tick(20);
    world.command(QGC, 300, [0.0; 7]);
    while world.gateway.poll_task().is_some() {}
    world.run(60);
    assert_eq!(world.kinds(), []);

    // Nothing to be flown, no such item, not to the end only.
    for (params, result) in [
        ([9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2),
        ([0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2),
        ([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2),
        ([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2),
    ] {
        world.sent();
        world.command(QGC, 300, params);
        assert_eq!(acks(&world.sent()), [(300, result, 0)], "{params:?}");
    }
    // No item is the next one.
    world.command(QGC, 300, [NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    world.serve("");
    assert_eq!(order(&mut world).kind, OrderKind::Start);
    let mut empty = World::flying();
    empty.command(QGC, 300, [0.0; 7]);
    assert_eq!(acks(&empty.sent()), [(300, 2, 0)]);
}

#[test]
fn a_refusal_of_the_bridge_is_the_answer_and_ends_the_mission() {
    let mut world = with_survey(World::flying());
    world.command(QGC, 300, [0.0; 7]);
    world.serve("");
    let path = order(&mut world);
    world.report(&path, Stage::Refused, Reason::PilotHasControl);
    let sent = world.sent();
    let reason = Reason::PilotHasControl.code();
    assert_eq!(acks(&sent), [(300, 1, reason)]);
    let text = "mission stopped at item 2: path refused (pilot-has-control)";
    assert_eq!(texts(&sent), [(3, text.to_owned())]);
    assert_eq!(current(&mut world), (1, 4));
}

#[test]
fn a_hold_pauses_it_and_it_goes_on_with_the_item_that_was_not_reached() {
    let (mut world, path) = on_path();
    progress(&mut world, &path, 1);
    world.command(QGC, 193, [0.0; 7]);
    let hold = order(&mut world);
    assert_eq!(hold.kind, OrderKind::Hold);
    // The path ends meanwhile: nothing new begins before the hold is answered.
    world.report(&path, Stage::Aborted, Reason::Replaced);
    world.report(&hold, Stage::Accepted, Reason::None);
    let sent = world.sent();
    let text = (5, "mission paused: item 3 is the next one".to_owned());
    assert_eq!(texts(&sent).iter().filter(|one| **one == text).count(), 1);
    assert_eq!((current(&mut world), world.kinds()), ((2, 4), vec![]));
    // A copy of the start is none.
    choose_mission(&mut world, QGC);
    assert_eq!(world.kinds(), []);
    // The station chooses an item in between, and then that one again.
    for item in [1, 2] {
        jump(&mut world, item);
        assert_eq!((current(&mut world), world.kinds()), ((item, 4), vec![]));
    }
    // Goes on.
    for (command, param) in [(193, 1.0), (300, 0.0)] {
        let mut world = World {
            gateway: world.gateway.clone(),
            disk: None,
            put: None,
            ..world
        };
        world.command(QGC, command, [param, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        world.serve("");
        let path = order(&mut world);
        assert_eq!(world.gateway.path(path.number).len(), 1);
        world.report(&path, Stage::Accepted, Reason::None);
        assert_eq!(current(&mut world), (2, 3));
    }
}

#[test]
fn a_hold_that_is_refused_does_not_end_it_and_one_between_two_steps_does() {
    let mut world = with_survey(World::with_station());
    world.command(QGC, 300, [0.0; 7]);
    world.serve("");
    let start = order(&mut world);
    started(&mut world, &start);
    let take_off = order(&mut world);
    world.report(&take_off, Stage::Accepted, Reason::None);
    world.command(QGC, 193, [0.0; 7]);
    let hold = order(&mut world);
    world.report(&take_off, Stage::Done, Reason::None);
    assert_eq!(world.kinds(), [], "the hold is not answered yet");
    world.report(&hold, Stage::Refused, Reason::UnableToAbort);
    let path = order(&mut world);
    assert_eq!(path.kind, OrderKind::Path);

    done(&mut world, &path);
    world.command(QGC, 193, [0.0; 7]);
    let hold = order(&mut world);
    world.report(&hold, Stage::Accepted, Reason::None);
    world.run(600);
    assert_eq!((world.kinds(), current(&mut world)), (vec![], (2, 4)));
}

#[test]
fn a_stop_before_the_module_has_started_cancels_it() {
    for (is_answered, stop, kind) in [
        (false, 400, OrderKind::Stop),
        (true, 400, OrderKind::Stop),
        (true, 193, OrderKind::Hold),
    ] {
        let mut world = with_survey(World::with_station());
        world.command(QGC, 300, [0.0; 7]);
        world.serve("");
        let start = order(&mut world);
        if is_answered {
            world.report(&start, Stage::Accepted, Reason::None);
        }
        world.command(QGC, stop, [0.0; 7]);
        assert_eq!(world.kinds(), [kind]);
        started(&mut world, &start);
        assert_eq!(world.kinds(), []);
        let expected = if is_answered { 0 } else { 6 };
        assert_eq!(acks(&world.sent())[0], (300, expected, 0));
    }
}

#[test]
fn another_movement_and_the_pilot_pause_it_too() {
    let (mut world, path) = on_path();
    let there = reposition(6, 374_200_000, -60_010_000, 30.0);
    world.receive(QGC, &QGC.frame(&there));
    let goto = order(&mut world);
    assert!(goto.preempts, "its own path");
    world.report(&goto, Stage::Accepted, Reason::None);
    world.report(&path, Stage::Aborted, Reason::Replaced);
    assert_eq!(current(&mut world), (1, 4));

    let (mut world, path) = on_path();
    world.report(&path, Stage::Aborted, Reason::PilotHasControl);
    assert_eq!(current(&mut world), (1, 4));

    // Also in a hover, in which the bridge has no movement to end.
    for is_manual in [true, false] {
        let (mut world, path) = on_path();
        world.report(&path, Stage::Done, Reason::None);
        match is_manual {
            true => world.state.safety.pilot_switch = PilotSwitch::Manual.code(),
            false => world.state.blocked = 1,
        }
        world.tick(20);
        world.state.safety.pilot_switch = PilotSwitch::Auto.code();
        world.state.blocked = 0;
        world.run(400);
        assert_eq!((world.kinds(), current(&mut world)), (vec![], (2, 4)));
    }
}

#[test]
fn another_station_may_hold_but_neither_goto_nor_jump() {
    let (mut world, _) = on_path();
    world.heartbeat(SCRIPT);
    let there = reposition(6, 374_200_000, -60_010_000, 30.0);
    world.receive(SCRIPT, &SCRIPT.frame(&there));
    world.command(SCRIPT, 224, [4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(world.kinds(), []);
    let busy = Reason::Busy.code();
    assert_eq!(acks(&world.sent()), [(192, 1, busy), (224, 1, busy)]);
    world.command(SCRIPT, 193, [0.0; 7]);
    assert_eq!(world.kinds(), [OrderKind::Hold]);
}

#[test]
fn no_mission_is_sent_while_one_is_flown() {
    let (mut world, _) = on_path();
    world.heartbeat(SCRIPT);
    world.sent();
    for (from, message) in [(QGC, count(3, 0)), (SCRIPT, count(3, 0)), (QGC, clear(0))] {
        world.receive(from, &from.frame(&message));
        assert_eq!(results(&world.sent()), [DENIED]);
    }
    // It can be read.
    let list = request_list(0);
    world.receive(SCRIPT, &SCRIPT.frame(&list));
    assert_eq!(
        of_kind(&world.sent(), MISSION_COUNT)[0].bytes::<2>(0),
        [6, 0]
    );
}

#[test]
fn a_jump_replaces_the_path_and_before_the_start_it_chooses_the_first_item() {
    let (mut world, path) = on_path();
    jump(&mut world, 4);
    // The speed that the items before ask for, then the path to item 4.
    let speed = order(&mut world);
    assert_eq!(speed.kind, OrderKind::Speed(4.0));
    done(&mut world, &speed);
    let other = order(&mut world);
    // The bridge knows no step by a speed that follows none: it judges the path by the moment of the jump.
    assert_eq!((other.after, other.issued), (0, world.now));
    assert!(other.kind == OrderKind::Path && other.preempts);
    world.report(&other, Stage::Accepted, Reason::None);
    world.report(&path, Stage::Aborted, Reason::Replaced);
    assert_eq!(current(&mut world), (4, 3));
    jump(&mut world, 6);
    let sent = world.sent();
    assert_eq!(
        (results(&sent), world.kinds()),
        (vec![INVALID_SEQUENCE], vec![])
    );
    // Not during the landing.
    world.report(&other, Stage::Done, Reason::None);
    assert_eq!(order(&mut world).kind, OrderKind::Land);
    jump(&mut world, 1);
    assert_eq!(world.kinds(), []);

    let mut world = with_survey(World::flying());
    jump(&mut world, 4);
    let sent = world.sent();
    assert_eq!(
        u16::from_le_bytes(of_kind(&sent, MISSION_CURRENT)[0].bytes(0)),
        4
    );
    choose_mission(&mut world, QGC);
    let speed = order(&mut world);
    assert_eq!(speed.kind, OrderKind::Speed(4.0));
    world.report(&speed, Stage::Accepted, Reason::None);
    assert_eq!(current(&mut world), (4, 3));
}

#[test]
fn the_mission_of_a_lost_station_is_paused_and_that_of_another_is_not() {
    for (station_lost, expected) in [
        (StationLost::Continue, None),
        (StationLost::Hold, Some(OrderKind::Hold)),
        (StationLost::Land, Some(OrderKind::Land)),
    ] {
        for lost in [QGC, SCRIPT] {
            let mut world = with_survey(World::flying_with(Settings {
                station_lost,
                ..Settings::default()
            }));
            world.heartbeat(SCRIPT);
            choose_mission(&mut world, QGC);
            let path = order(&mut world);
            world.report(&path, Stage::Accepted, Reason::None);
            let there = if lost == QGC { SCRIPT } else { QGC };
            for _ in 0..12 {
                world.heartbeat(there);
                world.tick(1_000);
                world.sent();
            }
            let expected = expected.filter(|_| lost == QGC);
            let orders = world.orders();
            let kinds: Vec<_> = orders.iter().map(|order| order.kind).collect();
            assert_eq!(kinds, Vec::from_iter(expected), "{station_lost:?}");
            let is_paused = expected.is_some();
            if is_paused {
                world.report(&path, Stage::Aborted, Reason::Replaced);
            }
            let state = current(&mut world).1;
            assert_eq!(state, if is_paused { 4 } else { 3 });
        }
    }
}

/// The bridge stood still: the mission stops for want of an answer, and its path is flown all the same.
#[test]
fn the_path_of_a_mission_that_was_stopped_is_held_when_its_station_is_lost() {
    for (station_lost, expected) in [
        (StationLost::Continue, None),
        (StationLost::Hold, Some(OrderKind::Hold)),
        (StationLost::Land, Some(OrderKind::Land)),
    ] {
        let mut world = with_survey(World::flying_with(Settings {
            station_lost,
            ..Settings::default()
        }));
        choose_mission(&mut world, QGC);
        let path = order(&mut world);
        for _ in 0..8 {
            world.heartbeat(QGC);
            world.tick(1_000);
        }
        assert_ne!(current(&mut world).1, 3, "it is stopped");
        world.report(&path, Stage::Accepted, Reason::None);
        assert_eq!(world.kinds(), []);
        world.heartbeat(SCRIPT);
        for _ in 0..12 {
            world.heartbeat(SCRIPT);
            world.tick(1_000);
            world.sent();
        }
        assert_eq!(world.kinds(), Vec::from_iter(expected), "{station_lost:?}");
    }
}

/// Nothing interrupts a take-off: its mission goes no further, and where it shall land it does so then.
#[test]
fn the_take_off_of_a_mission_whose_station_is_lost_ends_in_a_hover_or_a_landing() {
    for (station_lost, expected) in [
        (StationLost::Hold, None),
        (StationLost::Land, Some(OrderKind::Land)),
    ] {
        let mut world = World::new(Settings {
            station_lost,
            ..Settings::default()
        });
        world.heartbeat(QGC);
        let mut world = with_survey(world);
        world.state.blocked = 0;
        world.tick(20);
        choose_mission(&mut world, QGC);
        world.command(QGC, 300, [0.0; 7]);
        world.serve("");
        let take_off = order(&mut world);
        assert!(matches!(take_off.kind, OrderKind::TakeOff(_)));
        world.report(&take_off, Stage::Accepted, Reason::None);
        for _ in 0..12 {
            world.tick(1_000);
            world.sent();
        }
        assert_eq!(world.kinds(), []);
        world.telemetry.flying = 1;
        world.report(&take_off, Stage::Done, Reason::None);
        world.tick(20);
        assert_eq!(world.kinds(), Vec::from_iter(expected), "{station_lost:?}");
    }
}

#[test]
fn a_station_that_clears_everything_does_not_change_the_answer_to_the_transfer_of_another() {
    const ALL: u8 = 255;
    let mut world = World::with_station();
    world.heartbeat(SCRIPT);
    world.sent();
    world.receive(QGC, &QGC.frame(&count(2, 0)));
    world.receive(SCRIPT, &SCRIPT.frame(&clear(ALL)));
    let answer = |sent: &[Sent]| {
        let ack = of_kind(sent, MISSION_ACK)[0].bytes::<4>(0);
        (ack[2], ack[3])
    };
    assert_eq!(answer(&world.sent()), (ERROR, ALL));
    for (number, item) in survey()[..2].iter().enumerate() {
        world.receive(QGC, &QGC.frame(item));
        if number == 0 {
            assert_eq!(requests(&world.sent()), [1]);
        }
    }
    world.serve("");
    assert_eq!(answer(&world.sent()), (ACCEPTED, 0));
}

#[test]
fn each_step_of_a_mission_names_the_one_before() {
    let mut world = with_survey(World::with_station());
    world.command(QGC, 300, [0.0; 7]);
    world.serve("");
    let start = order(&mut world);
    assert_eq!(start.after, 0);
    started(&mut world, &start);
    let take_off = order(&mut world);
    assert_eq!(take_off.after, request_of(&start));
    done(&mut world, &take_off);
    let path = order(&mut world);
    assert_eq!(path.after, request_of(&take_off));
    done(&mut world, &path);
    world.run(255);
    let speed = order(&mut world);
    assert_eq!(speed.after, request_of(&path));
    done(&mut world, &speed);
    let path = order(&mut world);
    assert_eq!(path.after, request_of(&speed));
    done(&mut world, &path);
    assert_eq!(order(&mut world).after, request_of(&path));

    // The module runs already: the first step follows none, and was issued with the mission.
    let mut world = with_survey(World::flying());
    let issued = world.now;
    choose_mission(&mut world, QGC);
    let path = order(&mut world);
    assert_eq!((path.after, path.issued), (0, issued));
}

#[test]
fn a_mission_that_begins_with_a_hover_is_as_old_as_its_command() {
    let mut world = World::flying();
    let items = [item(0, 19, 20.0, (0, 0.0)), item(1, 16, 0.0, (1_000, 15.0))];
    let sent = upload(&mut world, QGC, &items, "");
    assert_eq!(results(&sent), [ACCEPTED], "{:?}", texts(&sent));
    let issued = world.now;
    choose_mission(&mut world, QGC);
    assert_eq!(world.kinds(), []);
    world.run(1_010);
    let path = order(&mut world);
    assert_eq!((path.after, path.issued), (0, issued));
    let begin_by = path.begin_by.expect("a moment");
    assert!(begin_by > world.now, "it is not late for its hover");
}

#[test]
fn what_lies_behind_a_hover_without_end_is_not_reached() {
    for first in [0, 1] {
        let mut world = World::flying();
        let place = |number: u16, command| {
            item(
                number,
                command,
                0.0,
                (1_000 + 1_000 * i32::from(number), 15.0),
            )
        };
        let items = [place(0, 16), place(1, 16), place(2, 17), place(3, 16)];
        let sent = upload(&mut world, QGC, &items, "");
        assert_eq!(results(&sent), [ACCEPTED], "{:?}", texts(&sent));
        let message = MessageWriter::new(MISSION_SET_CURRENT);
        let message = message.u16(first).u8(1).u8(1);
        world.receive(QGC, &QGC.frame(&message));
        choose_mission(&mut world, QGC);
        let path = order(&mut world);
        assert_eq!(
            world.gateway.path(path.number).len(),
            3 - usize::from(first)
        );
        done(&mut world, &path);
        let seen = reached(&world.sent());
        assert_eq!(seen, Vec::from_iter(first..3));
        assert_eq!(world.kinds(), []);
    }
}

#[test]
fn a_mission_that_was_superseded_says_what_came_between_and_can_be_gone_on_with() {
    let (mut world, path) = on_path();
    world.report(&path, Stage::Done, Reason::None);
    world.run(255);
    let speed = order(&mut world);
    world.sent();
    let refused = RequestReport {
        request_id: request_of(&speed),
        between: CameBetween::Hold.code(),
        between_request_id: 77,
        between_sender: ControlSender {
            process: 4711,
            ..ControlSender::default()
        },
        ..RequestReport::new(Stage::Refused, Reason::Superseded)
    };
    (world.gateway).report(speed.number, &refused, "words", world.now);
    world.gateway.advance(world.now);
    assert_eq!(world.kinds(), []);
    let expected = "mission stopped at item 4: before it came a hold of process 4711";
    let told = texts(&world.sent());
    assert!(told.iter().any(|(_, text)| text == expected), "{told:?}");
    // It is begun anew by a command of its own, which is no copy of the first.
    world.run(150);
    choose_mission(&mut world, QGC);
    let again = order(&mut world);
    assert_eq!((again.kind, again.after), (OrderKind::Speed(4.0), 0));
}

#[test]
fn the_landing_of_a_return_and_the_take_off_of_an_arming_name_the_step_before() {
    let mut world = World::flying();
    world.command(QGC, 20, [0.0; 7]);
    let path = order(&mut world);
    assert_eq!(path.after, 0);
    done(&mut world, &path);
    assert_eq!(order(&mut world).after, request_of(&path));

    let mut world = World::with_station();
    world.command(QGC, 22, [NAN; 7]);
    let start = order(&mut world);
    assert_eq!((start.kind, start.after), (OrderKind::Start, 0));
    done(&mut world, &start);
    assert_eq!(order(&mut world).after, request_of(&start));
}
