//! What the gateway keeps: no answer says that a mission is kept before it is on the disk, and a disk that takes it
//! late, or never, holds nothing else up.

use ipc_types::code::{Reason, Stage};
use mavlink_gateway::message::{ATTITUDE, HEARTBEAT, MISSION_COUNT};
use mavlink_gateway::{Mission, OrderKind, Task};

use crate::common::{
    QGC, SCRIPT, World, acks, clear, count, long, of_kind, request_list, results, texts,
};
use crate::newest::{done, one, upload, waypoint, with_mission};

/// MAV_MISSION_RESULT.
const ACCEPTED: u8 = 0;
const ERROR: u8 = 1;

/// The missions that the disk is to take; the bridge has no rules.
fn on_its_way(world: &mut World) -> Vec<Mission> {
    let mut missions = Vec::new();
    while let Some(task) = world.gateway.poll_task() {
        match task {
            Task::Rules => world.gateway.rules(None, world.now),
            Task::Save(mission) => missions.push(mission),
            other => panic!("{other:?}"),
        }
    }
    missions
}

/// The one mission that the disk is to take, which has not been answered.
#[track_caller]
fn the_one_on_its_way(world: &mut World, items: u16) -> Mission {
    let mission = on_its_way(world).pop().expect("it goes onto the disk");
    assert_eq!((mission.count(), on_its_way(world)), (items, vec![]));
    assert_eq!(results(&world.sent()), [0; 0]);
    mission
}

/// How many items the mission has that stations read.
fn read(world: &mut World) -> u16 {
    world.heartbeat(SCRIPT);
    world.sent();
    world.receive(SCRIPT, &SCRIPT.frame(&request_list(0)));
    u16::from_le_bytes(of_kind(&world.sent(), MISSION_COUNT)[0].bytes(0))
}

#[test]
fn a_mission_is_acknowledged_when_it_is_on_the_disk_and_meanwhile_everything_else_goes_on() {
    type Ask = fn(&mut World);
    let asks: [(&str, Ask, u16); 4] = [
        ("another mission", |world| upload(world, 3), 3),
        (
            "one without items",
            |world| world.receive(QGC, &QGC.frame(&count(0, 0))),
            0,
        ),
        (
            "a clearing",
            |world| world.receive(QGC, &QGC.frame(&clear(0))),
            0,
        ),
        (
            "a clearing of all",
            |world| world.receive(QGC, &QGC.frame(&clear(255))),
            0,
        ),
    ];
    for ((what, ask, items), (written, result)) in asks.into_iter().flat_map(|asked| {
        let answers = [(Ok(()), ACCEPTED), (Err("no space".to_owned()), ERROR)];
        answers.into_iter().map(move |answer| (asked, answer))
    }) {
        let mut world = with_mission(World::flying(), 2);
        ask(&mut world);
        let mission = the_one_on_its_way(&mut world, items);
        // 3.6 s: nearly as long as the disk may take.
        for (command, kind) in [
            (193, OrderKind::Hold),
            (21, OrderKind::Land),
            (193, OrderKind::Hold),
        ] {
            let sent = world.run(60);
            assert_eq!(results(&sent), [0; 0], "{what}");
            for kind in [HEARTBEAT, ATTITUDE] {
                assert!(!of_kind(&sent, kind).is_empty(), "{what}: {kind:?}");
            }
            world.receive(QGC, &QGC.frame(&long(command, one(0.0))));
            assert_eq!(done(&mut world), [kind], "{what}");
            let sent = world.sent();
            assert_eq!(
                (acks(&sent), results(&sent)),
                (vec![(command, 0, 0)], vec![])
            );
            assert_eq!(read(&mut world), 2, "{what}: the one before is in force");
            world.heartbeat(QGC);
        }
        world.sent();
        world.gateway.saved(mission, written, world.now);
        assert_eq!(results(&world.sent()), [result], "{what}");
        assert_eq!(read(&mut world), [items, 2][usize::from(result)], "{what}");
        assert_eq!(results(&world.run(300)), [0; 0], "{what}: one answer");
    }
}

#[test]
fn what_the_disk_takes_too_late_is_no_answer_to_a_newer_mission() {
    let mut world = with_mission(World::flying(), 2);
    upload(&mut world, 3);
    let late = the_one_on_its_way(&mut world, 3);
    for _ in 0..4 {
        world.heartbeat(QGC);
        world.tick(1_000);
    }
    assert_eq!(results(&world.sent()), [ERROR]);
    // Neither another one, nor the one in force: the disk may have either in a moment.
    let mut told = Vec::new();
    for items in [4, 2] {
        upload(&mut world, items);
        assert_eq!(on_its_way(&mut world), []);
        let sent = world.sent();
        assert_eq!(results(&sent), [ERROR], "{items}");
        told.extend(texts(&sent));
    }
    let why = "still on its way to the disk";
    assert!(told.iter().any(|one| one.1.contains(why)), "{told:?}");
    world.gateway.saved(late, Ok(()), world.now);
    let in_force = the_one_on_its_way(&mut world, 2);
    assert_eq!(read(&mut world), 2);
    world.gateway.saved(in_force, Ok(()), world.now);
    assert_eq!(results(&world.sent()), [0; 0]);
    upload(&mut world, 4);
    let newer = the_one_on_its_way(&mut world, 4);
    world.gateway.saved(newer, Ok(()), world.now);
    assert_eq!(
        (results(&world.sent()), read(&mut world)),
        (vec![ACCEPTED], 4)
    );
}

#[test]
fn the_mission_in_force_is_written_again_when_the_disk_may_have_another_one() {
    let mut world = with_mission(World::flying(), 2);
    upload(&mut world, 3);
    // Such as that the folder cannot be forced onto the disk.
    let other = the_one_on_its_way(&mut world, 3);
    world
        .gateway
        .saved(other, Err("on purpose".to_owned()), world.now);
    assert_eq!(results(&world.sent()), [ERROR]);
    // The gateway may be started again before a station uploads anything.
    let again = the_one_on_its_way(&mut world, 2);
    let failed = Err("on purpose".to_owned());
    world.gateway.saved(again, failed, world.now);
    let told = "the disk may have another mission than the one in force: on purpose";
    assert_eq!(texts(&world.sent()), [(3, told.to_owned())]);
    assert_eq!(on_its_way(&mut world), [], "it is not tried for ever");
    upload(&mut world, 2);
    let in_force = the_one_on_its_way(&mut world, 2);
    world.gateway.saved(in_force, Ok(()), world.now);
    assert_eq!(results(&world.sent()), [ACCEPTED]);
    // There it is.
    upload(&mut world, 2);
    assert_eq!(
        (on_its_way(&mut world), results(&world.sent())),
        (vec![], vec![ACCEPTED])
    );
}

#[test]
fn a_mission_that_was_begun_while_it_came_again_is_flown_on() {
    let mut world = with_mission(World::flying(), 2);
    world.receive(QGC, &QGC.frame(&count(2, 0)));
    world.command(QGC, 300, one(0.0));
    world.serve("");
    let path = world.orders()[0];
    assert_eq!(path.kind, OrderKind::Path);
    world.report(&path, Stage::Accepted, Reason::None);
    world.sent();
    let items = [0, 1].map(|number| waypoint(number, 1_000 + 1_000 * i32::from(number)));
    items
        .iter()
        .for_each(|item| world.receive(QGC, &QGC.frame(item)));
    assert_eq!(on_its_way(&mut world), []);
    assert_eq!(results(&world.sent()), [ERROR]);
}
