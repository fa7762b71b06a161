//! The newest intent counts, and no answer says otherwise: the same bits again after something else, frames that
//! overtake each other, and what has waited to be read.

use ipc_types::code::{Functionality, ModuleStatus, Reason, Stage};
use mavlink_gateway::message::{MISSION_CURRENT, MISSION_ITEM_INT, MISSION_SET_CURRENT};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{KeptProgress, Mission, OrderKind, Settings, Task};

use crate::common::{
    HERE, QGC, SCRIPT, World, acks, clear, count, long, of_kind, reposition, results, texts,
};

const ACCEPTED: u8 = 0;
const REJECTED: u8 = 1;

pub fn one(param: f32) -> [f32; 7] {
    [param, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn speed(mps: f32) -> [f32; 7] {
    [1.0, mps, -1.0, 0.0, 0.0, 0.0, 0.0]
}

fn goto(north: i32) -> MessageWriter {
    reposition(6, 374_200_000 + north, -60_010_000, 30.0)
}

/// The bridge takes each order and does it.
pub fn done(world: &mut World) -> Vec<OrderKind> {
    let orders = world.orders();
    for order in &orders {
        world.report(order, Stage::Accepted, Reason::None);
        world.report(order, Stage::Done, Reason::None);
    }
    orders.iter().map(|order| order.kind).collect()
}

/// A waypoint, above home.
pub fn waypoint(sequence: u16, north: i32) -> MessageWriter {
    let (x, y) = ((HERE.0 * 1e7) as i32 + north, (HERE.1 * 1e7) as i32);
    let message = MessageWriter::new(MISSION_ITEM_INT)
        .f32(0.0)
        .f32(0.0)
        .f32(0.0);
    let message = message.f32(f32::NAN).i32(x).i32(y).f32(20.0).u16(sequence);
    message.u16(16).u8(1).u8(1).u8(6).u8(0).u8(1).u8(0)
}

pub fn upload(world: &mut World, items: u16) {
    world.receive(QGC, &QGC.frame(&count(items, 0)));
    for number in 0..items {
        let item = waypoint(number, 1_000 + 1_000 * i32::from(number));
        world.receive(QGC, &QGC.frame(&item));
    }
}

pub fn with_mission(mut world: World, items: u16) -> World {
    upload(&mut world, items);
    world.serve("");
    assert_eq!(results(&world.sent()), [ACCEPTED]);
    world
}

/// The network has doubled the items of a mission, and brings them once more in the next upload.
#[test]
fn an_item_of_an_earlier_upload_is_none_of_the_next_one() {
    let upload = |world: &mut World, north: i32, late: &[Vec<u8>]| {
        let items = [0, 1].map(|number| waypoint(number, north + 1_000 * i32::from(number)));
        world.receive(QGC, &QGC.frame(&count(2, 0)));
        let frames = items.map(|item| QGC.frame(&item));
        for (index, frame) in frames.iter().enumerate() {
            late.get(index).inspect(|late| world.receive(QGC, late));
            world.receive(QGC, frame);
        }
        world.serve("");
        assert_eq!(results(&world.sent()), [ACCEPTED]);
        (frames, world.disk.clone().expect("a mission"))
    };
    let (_, expected) = upload(&mut World::flying(), 5_000, &[]);
    let mut world = World::flying();
    let (first, _) = upload(&mut world, 1_000, &[]);
    let (_, second) = upload(&mut world, 5_000, &first);
    assert_eq!(second, expected);
}

fn is_superseded(world: &mut World) -> bool {
    let sent = world.sent();
    let acks = acks(&sent);
    let is = acks.len() == 1 && (acks[0].1, acks[0].2) == (REJECTED, Reason::Superseded.code());
    is && !texts(&sent).is_empty()
}

#[test]
fn the_same_command_again_after_another_of_its_kind_is_carried_out() {
    use OrderKind::{Speed, Start, Stop};
    // A state that is older than the orders does not decide.
    let mut world = World::with_station();
    for (param, kind) in [(1.0, Start), (0.0, Stop), (1.0, Start), (0.0, Stop)] {
        world.command(QGC, 400, one(param));
        assert_eq!(done(&mut world), [kind]);
        assert_eq!(acks(&world.sent()), [(400, ACCEPTED, 0)]);
    }
    for (mps, kind) in [(5.0, Speed(5.0)), (8.0, Speed(8.0)), (5.0, Speed(5.0))] {
        world.command(QGC, 178, speed(mps));
        assert_eq!(done(&mut world), [kind]);
        assert_eq!(acks(&world.sent()), [(178, ACCEPTED, 0)]);
    }
    // Also when a parameter has set it meanwhile.
    let set = MessageWriter::new(mavlink_gateway::message::PARAM_SET)
        .f32(9.0)
        .u8(1)
        .u8(1);
    let name = *b"DSP_CRUISE_MPS\0\0";
    let set = name.iter().fold(set, |set, byte| set.u8(*byte)).u8(9);
    world.receive(QGC, &QGC.frame(&set));
    world.command(QGC, 178, speed(5.0));
    assert!(done(&mut world).contains(&Speed(5.0)));
    // Something of another kind is nothing in between.
    world.command(QGC, 400, one(1.0));
    assert!(done(&mut world).contains(&Start));
    world.sent();
    world.command(QGC, 178, speed(5.0));
    assert_eq!(
        (world.kinds(), acks(&world.sent())),
        (vec![], vec![(178, ACCEPTED, 0)])
    );

    let home = |north: f32| [0.0, 0.0, 0.0, 0.0, 37.5 + north, -6.0, 40.0];
    let mut world = World::flying();
    for north in [0.0, 0.25, 0.0] {
        world.command(QGC, 179, home(north));
    }
    assert_eq!(acks(&world.sent()), [(179, ACCEPTED, 0); 3]);
    world.command(QGC, 20, one(0.0));
    let kinds = world.kinds();
    let OrderKind::GoTo(place) = kinds[0] else {
        panic!("{kinds:?}")
    };
    assert_eq!(place.latitude_deg, 37.5);

    let mut world = with_mission(World::flying(), 6);
    for item in [3.0, 5.0, 3.0] {
        world.command(QGC, 224, one(item));
    }
    world.serve("");
    world.command(QGC, 300, one(0.0));
    world.serve("");
    let path = world.orders()[0];
    assert_eq!(world.gateway.path(path.number).len(), 3, "from item 3 on");
}

#[test]
fn after_a_stop_or_another_station_s_order_the_same_bits_move_nothing() {
    let others = World::flying;
    for (from, between) in [
        (QGC, long(193, one(0.0))),
        (SCRIPT, long(193, one(0.0))),
        (SCRIPT, goto(7)),
        (QGC, long(21, [0.0; 7])),
    ] {
        let mut world = others();
        world.heartbeat(SCRIPT);
        world.receive(QGC, &QGC.frame(&goto(1)));
        done(&mut world);
        world.receive(from, &from.frame(&between));
        assert_eq!(done(&mut world).len(), 1);
        world.sent();
        world.receive(QGC, &QGC.frame(&goto(1)));
        assert_eq!(world.kinds(), [], "{between:?}");
        assert!(is_superseded(&mut world), "{between:?}");
        // Another place is another command, and so is the same one later.
        world.receive(QGC, &QGC.frame(&goto(2)));
        assert_eq!(world.kinds().len(), 1);
        world.tick(2_500);
        world.receive(QGC, &QGC.frame(&goto(1)));
        assert_eq!(world.kinds().len(), 1);
    }
    // Its own other path is nothing to be kept from.
    let mut world = others();
    for north in [1, 2, 1] {
        world.receive(QGC, &QGC.frame(&goto(north)));
        assert_eq!(done(&mut world).len(), 1);
    }
}

#[test]
fn a_copy_of_what_goes_on_is_told_so_when_the_order_since_was_refused() {
    let mut world = World::flying();
    // The station's own.
    world.receive(QGC, &QGC.frame(&goto(1)));
    let first = world.orders()[0];
    world.report(&first, Stage::Accepted, Reason::None);
    world.receive(QGC, &QGC.frame(&goto(7)));
    let second = world.orders()[0];
    world.report(&second, Stage::Refused, Reason::FenceBreach);
    world.sent();
    world.receive(QGC, &QGC.frame(&goto(1)));
    assert_eq!(world.kinds(), []);
    assert_eq!(acks(&world.sent()), [(192, ACCEPTED, 0)]);
    // Another station's.
    let mut world = World::flying();
    world.heartbeat(SCRIPT);
    world.receive(QGC, &QGC.frame(&goto(1)));
    let first = world.orders()[0];
    world.report(&first, Stage::Accepted, Reason::None);
    world.sent();
    let others = SCRIPT.frame(&goto(7));
    world.receive(SCRIPT, &others);
    let second = world.orders()[0];
    // What becomes of it is not known yet.
    world.receive(QGC, &QGC.frame(&goto(1)));
    assert!(is_superseded(&mut world));
    world.report(&second, Stage::Refused, Reason::FenceBreach);
    world.sent();
    world.receive(QGC, &QGC.frame(&goto(1)));
    assert_eq!(world.kinds(), []);
    assert_eq!(acks(&world.sent()), [(192, ACCEPTED, 0)]);
    world.report(&first, Stage::Aborted, Reason::Stopped);
    world.sent();
    // Of one that the bridge has said nothing of, nobody knows that it goes on.
    world.receive(QGC, &QGC.frame(&goto(2)));
    assert_eq!(world.orders().len(), 1);
    world.tick(2_000);
    assert_eq!(acks(&world.sent()).len(), 1);
    world.receive(SCRIPT, &SCRIPT.frame(&goto(8)));
    let third = world.orders()[0];
    world.report(&third, Stage::Refused, Reason::FenceBreach);
    world.sent();
    world.receive(QGC, &QGC.frame(&goto(2)));
    assert_ne!(acks(&world.sent()), [(192, ACCEPTED, 0)]);
    world.receive(QGC, &QGC.frame(&goto(1)));
    let superseded = (192, REJECTED, Reason::Superseded.code());
    assert_eq!(
        (world.kinds(), acks(&world.sent())),
        (vec![], vec![superseded])
    );
}

#[test]
fn what_was_sent_before_the_station_s_own_order_and_comes_after_it_is_not_carried_out() {
    let mut world = World::flying();
    let frames = [goto(1), long(400, one(1.0)), long(178, speed(4.0))].map(|one| QGC.frame(&one));
    let hold = QGC.frame(&long(193, one(0.0)));
    world.receive(QGC, &hold);
    assert_eq!(done(&mut world), [OrderKind::Hold]);
    world.sent();
    world.receive(QGC, &frames[0]);
    assert_eq!(world.kinds(), []);
    assert!(is_superseded(&mut world));
    // Its speed is another matter, and a stop acts at any time.
    world.receive(QGC, &frames[2]);
    assert_eq!(world.kinds(), [OrderKind::Speed(4.0)]);
    let early = QGC.frame(&long(193, one(0.0)));
    world.receive(QGC, &QGC.frame(&goto(3)));
    assert_eq!(done(&mut world).len(), 1);
    world.tick(200);
    world.receive(QGC, &early);
    assert_eq!(world.kinds(), [OrderKind::Hold]);
    // A station that begins anew is not shut out for longer than a moment.
    world.tick(2_500);
    world.receive(QGC, &goto(4).frame(0, QGC.system, 190));
    assert_eq!(world.kinds().len(), 1);
}

#[test]
fn a_late_copy_of_a_clearing_leaves_the_newer_mission() {
    for retry in [false, true] {
        let mut world = with_mission(World::with_station(), 2);
        let first = QGC.frame(&clear(0));
        let second = QGC.frame(&clear(0));
        world.receive(QGC, &first);
        world.serve("");
        world.sent();
        let mut world = with_mission(world, 3);
        world.tick(500);
        world.sent();
        world.receive(QGC, if retry { &second } else { &first });
        world.serve("");
        assert_eq!(world.disk.as_ref().map(Mission::count), Some(3));
        let sent = world.sent();
        assert_eq!(results(&sent), [0_u8; 0]);
        assert!(texts(&sent)[0].1.contains("MISSION_CLEAR_ALL"), "{sent:?}");
        // One that was sent afterwards clears it.
        world.receive(QGC, &QGC.frame(&clear(0)));
        world.serve("");
        assert_eq!(world.disk.as_ref().map(Mission::count), Some(0));
    }
}

#[test]
fn copies_that_have_waited_behind_one_that_was_too_late_are_refused_as_it_was() {
    let mut world = World::flying();
    let mut results = Vec::new();
    // A gateway that stood still reads both at once.
    for age_ms in [1_500, 800] {
        world.receive_late(QGC, &QGC.frame(&goto(1)), age_ms);
        assert_eq!(world.orders(), []);
        results.extend(acks(&world.sent()));
    }
    assert_eq!(results, [(192, REJECTED, Reason::TooLate.code()); 2]);
    // Who has read that commands it again.
    world.pass(10);
    world.receive(QGC, &QGC.frame(&goto(1)));
    assert_eq!(world.orders().len(), 1);
}

#[test]
fn what_has_waited_to_be_read_is_not_carried_out_and_its_moment_is_that_at_which_it_came() {
    let mut world = World::flying();
    let late = |message: MessageWriter, age_ms| {
        let mut world = World::flying();
        world.receive_late(QGC, &QGC.frame(&message), age_ms);
        let orders = world.orders();
        (world, orders)
    };
    // The answer is due by then, and the bridge judges by that moment.
    let (mut one_late, orders) = late(goto(1), 900);
    assert_eq!(orders[0].issued.0, one_late.now.0 - 900_000_000);
    assert_eq!(
        orders[0].begin_by.map(|by| by.0),
        Some(one_late.now.0 + 100_000_000)
    );
    one_late.pass(100);
    assert_eq!(acks(&one_late.sent()), [(192, 4, 0)]);
    let kinds = [
        goto(1),
        long(22, [f32::NAN; 7]),
        long(178, speed(3.0)),
        long(20, one(0.0)),
    ];
    for message in kinds
        .into_iter()
        .chain([long(179, [0.0, 0.0, 0.0, 0.0, 37.5, -6.0, 40.0])])
    {
        let (mut world, orders) = late(message, 11_500);
        assert_eq!(orders, []);
        let sent = world.sent();
        let (_, result, reason) = acks(&sent)[0];
        assert_eq!((result, reason), (REJECTED, Reason::TooLate.code()));
        assert!(texts(&sent)[0].1.contains("it came 11.5 s ago"), "{sent:?}");
    }
    // What stops the helicopter may begin later; its moment is the old one.
    for (message, kind) in [
        (long(193, one(0.0)), OrderKind::Hold),
        (long(21, [0.0; 7]), OrderKind::Land),
    ] {
        let (mut world, orders) = late(message, 11_500);
        assert_eq!((orders[0].kind, orders[0].begin_by), (kind, None));
        assert_eq!(orders[0].issued.0, world.now.0 - 11_500_000_000);
        world.pass(900);
        assert_eq!(acks(&world.sent()), [], "the bridge has its time");
    }
    // A mission neither begins nor goes away.
    world = with_mission(world, 3);
    let jump = MessageWriter::new(MISSION_SET_CURRENT).u16(2).u8(1).u8(1);
    for message in [long(300, one(0.0)), clear(0), count(2, 0), jump] {
        world.receive_late(QGC, &QGC.frame(&message), 11_500);
        world.serve("");
        assert_eq!(world.kinds(), [], "{message:?}");
        assert_eq!(world.disk.as_ref().map(Mission::count), Some(3));
        assert!(!texts(&world.sent()).is_empty(), "{message:?}");
    }
    // Nor is a station there that was there long ago.
    world.tick(15_000);
    world.receive_late(QGC, &QGC.frame(&crate::common::heartbeat()), 14_000);
    world.tick(16_500);
    assert!(!world.gateway.has_stations());
}

#[test]
fn a_copy_of_what_was_carried_out_gets_its_answer_and_a_refusal_gets_a_text() {
    let mut world = World::with_station();
    world.command(QGC, 400, one(1.0));
    assert_eq!(done(&mut world), [OrderKind::Start]);
    world.telemetry.valid_groups = 0;
    world.tick(20);
    world.sent();
    world.command(QGC, 400, one(1.0));
    assert_eq!(
        (world.kinds(), acks(&world.sent())),
        (vec![], vec![(400, ACCEPTED, 0)])
    );
    // The end of a path long ago is no answer to another command.
    let mut world = World::flying();
    world.receive(QGC, &QGC.frame(&goto(1)));
    let path = world.orders()[0];
    world.report(&path, Stage::Accepted, Reason::None);
    world.tick(60_000);
    world.heartbeat(QGC);
    world.tick(20);
    world.report(&path, Stage::Aborted, Reason::FenceBreach);
    world.receive(QGC, &QGC.frame(&goto(1)));
    let again = world.orders();
    assert_eq!(again.len(), 1);
    world.report(&again[0], Stage::Refused, Reason::FenceBreach);
    world.tick(100);
    world.sent();
    world.receive(QGC, &QGC.frame(&goto(1)));
    let sent = world.sent();
    assert_eq!(acks(&sent), [(192, 2, Reason::FenceBreach.code())]);
    assert!(texts(&sent)[0].1.contains("fence-breach"), "{sent:?}");
}

/// Each rest of the module and each command: none is a dead end for a station, and none is accepted without effect.
#[test]
fn a_station_gets_out_of_every_rest_in_the_air_by_its_own_means() {
    let mission = long(300, one(0.0));
    let resume = long(193, one(1.0));
    for (status, functionality) in [
        (ModuleStatus::WaitingDataToStart, Functionality::AtRest),
        (ModuleStatus::Aborted, Functionality::AtRest),
        (ModuleStatus::Ended, Functionality::AtRest),
        (ModuleStatus::Aborted, Functionality::Holding),
    ] {
        let rest = || {
            let mut world = with_mission(World::flying(), 3);
            world.state.blocked = 1;
            world.state.status = status.code();
            world.state.functionality = functionality.code();
            world.tick(20);
            world.sent();
            world
        };
        // The command, and the orders that it becomes when the bridge does each.
        type IsRight = fn(&[OrderKind]) -> bool;
        let commands: [(MessageWriter, IsRight); 7] = [
            (long(400, one(1.0)), |kinds| kinds == [OrderKind::Start]),
            (long(193, one(0.0)), |kinds| kinds == [OrderKind::Hold]),
            (long(21, [0.0; 7]), |kinds| kinds == [OrderKind::Land]),
            (mission.clone(), |kinds| {
                matches!(kinds, [OrderKind::Start, OrderKind::Path])
            }),
            (resume.clone(), |kinds| {
                matches!(kinds, [OrderKind::Start, OrderKind::Path])
            }),
            (goto(1), |kinds| {
                matches!(kinds, [OrderKind::Start, OrderKind::GoTo(_)])
            }),
            (long(20, one(0.0)), |kinds| {
                matches!(
                    kinds,
                    [OrderKind::Start, OrderKind::GoTo(_), OrderKind::Land]
                )
            }),
        ];
        for (message, is_right) in commands {
            let mut world = rest();
            world.receive(QGC, &QGC.frame(&message));
            world.serve("");
            let mut kinds = Vec::new();
            for _ in 0..5 {
                let step = done(&mut world);
                if step.contains(&OrderKind::Start) {
                    world.state.blocked = 0;
                    world.tick(20);
                }
                kinds.extend(step);
                world.gateway.advance(world.now);
                if kinds.ends_with(&[OrderKind::Path]) {
                    break;
                }
            }
            assert!(is_right(&kinds), "{status}: {message:?}: {kinds:?}");
            let answers: Vec<u8> = acks(&world.sent()).iter().map(|ack| ack.1).collect();
            assert_eq!(answers, [ACCEPTED], "{status}: {message:?}");
        }
        // What stands against a start is said, and a landing is still taken.
        let mut world = rest();
        world.state.safety.action = ipc_types::code::SafetyAction::Hold.code();
        world.tick(20);
        world.sent();
        for message in [
            long(400, one(1.0)),
            mission.clone(),
            goto(1),
            long(20, one(0.0)),
        ] {
            world.receive(QGC, &QGC.frame(&message));
            world.serve("");
            assert_eq!(world.kinds(), []);
            let sent = world.sent();
            assert_eq!(acks(&sent)[0].1, REJECTED);
            assert!(texts(&sent)[0].1.contains("safety rule"), "{sent:?}");
        }
        world.command(QGC, 21, [0.0; 7]);
        assert_eq!(world.kinds(), [OrderKind::Land]);
    }
}

#[test]
fn a_mission_comes_to_a_gateway_that_began_in_the_air() {
    let mut world = World::new(Settings::default());
    world.gateway = mavlink_gateway::Gateway::new(Settings::default(), 1);
    world.state.blocked = 0;
    world.state.ground_valid = 0;
    world.telemetry.flying = 1;
    world.tick(20);
    world.heartbeat(QGC);
    world.sent();
    let mut world = with_mission(world, 3);
    world.command(QGC, 300, one(0.0));
    world.serve("");
    let sent = world.sent();
    assert!(
        texts(&sent)
            .iter()
            .any(|one| one.1.contains("home is not known")),
        "{sent:?}"
    );
    // The station says where home is, and flies.
    world.command(QGC, 179, [0.0, 0.0, 0.0, 0.0, 37.4112, -6.001, 30.0]);
    // What was refused just now stays refused for its copies.
    world.tick(2_500);
    world.command(QGC, 300, one(0.0));
    world.serve("");
    assert!(matches!(world.kinds()[..], [OrderKind::Path]));
}

#[test]
fn a_gateway_that_is_started_anew_goes_on_with_the_item_that_was_not_reached() {
    let mut world = with_mission(World::flying(), 4);
    let mut kept = Vec::new();
    let mut keep = |world: &mut World| {
        world.tick(1_000);
        let now = world.now;
        kept.extend(world.gateway.poll_progress(now));
        kept.last().copied()
    };
    let begin = keep(&mut world).expect("from the first item");
    world.command(QGC, 300, one(0.0));
    world.serve("");
    let path = world.orders()[0];
    world.report(&path, Stage::Accepted, Reason::None);
    let report = ipc_types::payload::RequestReport {
        waypoints_reached: 2,
        ..ipc_types::payload::RequestReport::new(Stage::Progress, Reason::None)
    };
    world.gateway.report(path.number, &report, "", world.now);
    let progress = keep(&mut world).expect("its progress");
    assert_ne!(progress, begin);
    assert_eq!(keep(&mut world), Some(progress), "once");
    assert_eq!(
        KeptProgress::decode(progress.encode().as_bytes()),
        Ok(progress)
    );

    let again = |progress, mission: &Mission| {
        let mut again = World::flying();
        again.gateway.restore(mission.clone());
        again.gateway.restore_progress(progress);
        again.heartbeat(SCRIPT);
        let sent = again.run(60);
        let text = texts(&sent);
        let current = of_kind(&sent, MISSION_CURRENT)
            .pop()
            .expect("how far it is");
        let [item, _, _, _, state] = current.bytes(0);
        again.command(QGC, 300, one(0.0));
        again.serve("");
        let path = again.orders()[0];
        let points = again.gateway.path(path.number).len();
        (text, (item, state), points)
    };
    let mission = world.disk.clone().expect("a mission");
    let (text, shown, points) = again(progress, &mission);
    // Paused.
    assert_eq!(shown, (2, 4));
    assert!(
        text.iter()
            .any(|one| one.1.contains("item 3 is the next one")),
        "{text:?}"
    );
    assert_eq!(points, 2);
    let (text, shown, points) = again(begin, &mission);
    // Not started.
    assert_eq!(shown, (0, 2));
    assert_eq!(points, 4);
    let is_told = text.iter().any(|one| one.1.contains("is the next one"));
    assert!(!is_told, "{text:?}");
    // Of another mission it says nothing.
    let other = with_mission(World::flying(), 5).disk.expect("a mission");
    assert_eq!(again(progress, &other).2, 5);
    for wrong in [
        "",
        "ril-progress 1 5",
        "ril-progress 2 5 5",
        "ril-progress 1 x 5",
        "\u{1f681}",
    ] {
        assert!(KeptProgress::decode(wrong.as_bytes()).is_err(), "{wrong}");
    }
}

#[test]
fn a_disk_that_does_not_answer_costs_a_mission_and_nothing_else() {
    let mut world = with_mission(World::flying(), 2);
    upload(&mut world, 3);
    let mut saving = Vec::new();
    while let Some(task) = world.gateway.poll_task() {
        match task {
            Task::Rules => world.gateway.rules(None, world.now),
            Task::Save(mission) => saving.push(mission),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(saving.len(), 1);
    world.sent();
    // Telemetry and a hold go on, and no mission begins whose answer is awaited.
    assert!(!world.run(20).is_empty());
    world.command(QGC, 193, one(0.0));
    assert_eq!(done(&mut world), [OrderKind::Hold]);
    world.command(QGC, 300, one(0.0));
    world.tick(20);
    let busy = Reason::Busy.code();
    assert_eq!(
        acks(&world.sent()),
        [(193, ACCEPTED, 0), (300, REJECTED, busy)]
    );
    for _ in 0..4 {
        world.heartbeat(QGC);
        world.tick(1_000);
    }
    let sent = world.sent();
    assert_eq!(results(&sent), [1], "an error");
    assert!(
        texts(&sent)
            .iter()
            .any(|one| one.1.contains("the disk does not take it")),
        "{sent:?}"
    );
    // The one in force is flown meanwhile.
    world.command(QGC, 300, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    world.serve("");
    let path = world.orders()[0];
    assert_eq!(world.gateway.path(path.number).len(), 2);
    // The disk comes back, and what it has taken late gives way to it.
    world.disk = saving.pop();
    let late = world.disk.clone().expect("a mission");
    world.gateway.saved(late, Ok(()), world.now);
    world.serve("");
    assert_eq!(world.disk.as_ref().map(Mission::count), Some(2));
    world.sent();
    assert_eq!(results(&world.sent()), [0_u8; 0]);
}

#[test]
fn a_mission_s_first_movement_is_as_old_as_its_command() {
    let mut world = with_mission(World::flying(), 2);
    world.receive_late(QGC, &QGC.frame(&long(300, one(0.0))), 400);
    let came = world.now.0 - 400_000_000;
    world.tick(100);
    world.serve("");
    let path = world.orders()[0];
    assert_eq!((path.kind, path.issued.0), (OrderKind::Path, came));
    assert_eq!(path.begin_by.map(|by| by.0), Some(came + 1_000_000_000));
}
