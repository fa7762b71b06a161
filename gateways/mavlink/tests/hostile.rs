//! Stations that lie, hurry or speak an old form: nothing moves by mistake, and each gets an answer.

use ipc_types::code::Reason;
use ipc_types::payload::MavlinkStations;
use mavlink_gateway::message::{
    COMMAND_ACK, HEARTBEAT, MISSION_ACK, MISSION_ITEM, MISSION_ITEM_INT, MISSION_REQUEST_INT,
    STATUSTEXT,
};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{OrderKind, Settings};

use crate::common::{
    HERE, QGC, SCRIPT, Sent, Station, World, acks, clear, count, heartbeat, long, reposition,
    results, texts,
};

const NAN: f32 = f32::NAN;
const INFINITY: f32 = f32::INFINITY;

fn here() -> (i32, i32) {
    ((HERE.0 * 1e7) as i32, (HERE.1 * 1e7) as i32)
}

#[test]
fn what_is_no_place_or_no_number_moves_nothing_and_is_denied() {
    let (x, y) = here();
    let goto = |x, y, z| long(192, [-1.0, 0.0, 0.0, NAN, x, y, z]);
    let in_the_air = [
        reposition(6, 900_000_001, y, 30.0),
        reposition(6, x, 1_800_000_001, 30.0),
        reposition(6, i32::MAX, y, 30.0),
        reposition(6, x, i32::MIN, 30.0),
        reposition(6, x, y, INFINITY),
        reposition(6, i32::MAX, i32::MAX, INFINITY),
        goto(INFINITY, INFINITY, 30.0),
        goto(37.0, NAN, 30.0),
        goto(NAN, NAN, -INFINITY),
        long(193, [NAN; 7]),
        long(193, [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        // Not mode 4, Mission, by its lowest eight bits.
        long(176, [1.0, 260.0, 4.0, 0.0, 0.0, 0.0, 0.0]),
        long(176, [1.0, 4.0, 260.0, 0.0, 0.0, 0.0, 0.0]),
        long(22, [0.0, 0.0, 0.0, NAN, NAN, NAN, INFINITY]),
        long(22, [0.0, 0.0, 0.0, NAN, 91.0, NAN, 45.0]),
        long(178, [1.0, NAN, 0.0, 0.0, 0.0, 0.0, 0.0]),
        long(179, [0.0, 0.0, 0.0, 0.0, 37.0, -6.0, INFINITY]),
        long(179, [0.0, 0.0, 0.0, 0.0, NAN, -6.0, 10.0]),
        long(400, [NAN; 7]),
    ];
    for message in in_the_air {
        let mut world = World::flying();
        world.receive(QGC, &QGC.frame(&message));
        assert_eq!(world.orders(), [], "{message:?}");
        let answers = acks(&world.sent());
        assert_eq!(answers.len(), 1, "{message:?}");
        assert_eq!(answers[0].1, 2, "{message:?}");
    }
}

#[test]
fn a_system_with_the_number_of_all_is_none() {
    let mut world = World::with_station();
    let nobody = |message: &MessageWriter| message.frame(0, 0, 190);
    world.receive(QGC, &nobody(&heartbeat()));
    world.receive(QGC, &nobody(&long(400, [1.0; 7])));
    world.receive(QGC, &nobody(&count(3, 0)));
    assert_eq!(world.orders(), []);
    let answers = |one: &&Sent| {
        matches!(
            one.kind,
            COMMAND_ACK | MISSION_ACK | MISSION_REQUEST_INT | STATUSTEXT
        )
    };
    assert_eq!(world.sent().iter().find(answers), None);
}

/// A take-off to this height.
fn take_off(z: f32) -> MessageWriter {
    let message = MessageWriter::new(MISSION_ITEM_INT).f32s(0.0, 3).f32(NAN);
    let message = message.i32(0).i32(0).f32(z).u16(0).u16(22);
    message.u8(1).u8(1).u8(6).u8(0).u8(1).u8(0)
}

/// A helicopter with a mission of one item.
fn with_mission() -> World {
    let mut world = World::with_station();
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    world.receive(QGC, &QGC.frame(&take_off(15.0)));
    world.serve("");
    assert_eq!(results(&world.sent()), [0]);
    world
}

#[test]
fn a_start_behind_a_clearing_is_answered() {
    let mut world = with_mission();
    world.receive(QGC, &QGC.frame(&clear(0)));
    world.command(QGC, 300, [0.0; 7]);
    world.command(QGC, 224, [0.0; 7]);
    let busy = Reason::Busy.code();
    assert_eq!(acks(&world.sent()), [(300, 1, busy), (224, 1, busy)]);
    world.serve("");
    assert_eq!(results(&world.sent()), [0]);
    assert_eq!(world.orders(), []);
    assert_eq!(world.disk.as_ref().map(|mission| mission.count()), Some(0));
}

#[test]
fn a_clearing_behind_a_mission_that_waits_for_its_check_clears() {
    let mut world = with_mission();
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    world.receive(QGC, &QGC.frame(&take_off(20.0)));
    world.receive(QGC, &QGC.frame(&clear(0)));
    world.serve("");
    assert_eq!(results(&world.sent()), [0]);
    assert_eq!(world.disk.as_ref().map(|mission| mission.count()), Some(0));
}

#[test]
fn a_mission_and_a_fence_that_come_alternately_do_not_mix() {
    let mut world = World::with_station();
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    // Without `[fence] accept` this one is denied, and the other one goes on.
    world.receive(QGC, &QGC.frame(&count(1, 1)));
    assert_eq!(results(&world.sent()), [14]);
    world.receive(QGC, &QGC.frame(&take_off(15.0)));
    world.serve("");
    assert_eq!(results(&world.sent()), [0]);
}

#[test]
fn items_in_the_old_form_are_refused_at_once() {
    // Mission, fence, rally points.
    for mission_type in [0, 1, 2] {
        let old = MessageWriter::new(MISSION_ITEM)
            .f32s(0.0, 4)
            .f32(37.0)
            .f32(-6.0);
        let old = old.f32(15.0).u16(0).u16(16).u8(1).u8(1);
        let old = old.u8(3).u8(0).u8(1).u8(mission_type);
        let mut world = World::with_station();
        world.receive(QGC, &QGC.frame(&count(2, 0)));
        world.sent();
        world.receive(QGC, &QGC.frame(&old));
        let sent = world.sent();
        assert_eq!(results(&sent), [3], "{mission_type}");
        let text = texts(&sent).remove(0);
        assert_eq!(text.0, 3);
        assert!(text.1.ends_with("send MISSION_ITEM_INT"), "{text:?}");
        // The transfer of that type is over.
        world.pass(300);
        let asked = world.sent();
        let asked = asked.iter().any(|one| one.kind == MISSION_REQUEST_INT);
        assert_eq!(asked, mission_type != 0);
    }
}

#[test]
fn whoever_does_not_answer_the_question_for_an_item_is_told_which_it_was() {
    let mut world = World::with_station();
    world.receive(QGC, &QGC.frame(&count(2, 0)));
    world.pass(1_600);
    let sent = world.sent();
    assert_eq!(results(&sent), [15]);
    let expected = "no MISSION_ITEM_INT came for item 1";
    assert!(
        texts(&sent)
            .iter()
            .any(|(_, text)| text.ends_with(expected)),
        "{sent:?}"
    );
}

/// The stations that are there, by their systems.
fn systems(world: &World) -> Vec<u32> {
    let mut sample = MavlinkStations::default();
    world.gateway.describe(&mut sample, world.now);
    let stations = &sample.stations[..sample.count as usize];
    stations.iter().map(|one| one.system).collect()
}

#[test]
fn heartbeats_under_many_numbers_of_one_address_leave_room_for_a_station() {
    let mut world = World::new(Settings::default());
    let flood = |world: &mut World| {
        for number in 2..=254 {
            world.receive(SCRIPT, &heartbeat().frame(0, number, 1));
        }
    };
    flood(&mut world);
    assert_eq!(systems(&world).len(), 8);
    world.sent();
    world.heartbeat(QGC);
    flood(&mut world);
    assert!(systems(&world).contains(&255), "{:?}", systems(&world));
    world.command(QGC, 400, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(world.kinds(), [OrderKind::Start]);
    world.sent();
    let heard = world.run(60);
    // Of the others one gives way, and the rest go on.
    for station in [QGC, SCRIPT] {
        let is_its = |one: &&Sent| one.kind == HEARTBEAT && one.to == station.address();
        assert_ne!(heard.iter().find(is_its), None);
    }
}

#[test]
fn a_station_that_may_command_gets_the_place_of_one_that_may_not_and_keeps_it() {
    let mut world = World::flying_with(Settings {
        commanders: vec![255],
        ..Settings::default()
    });
    let may = |port| Station { port, system: 255 };
    let may_not = |port| Station { port, system: 9 };
    (1..=20).for_each(|port| world.heartbeat(may_not(port)));
    assert_eq!(systems(&world), [255, 9, 9, 9, 9, 9, 9, 9]);
    (101..=107).for_each(|port| world.heartbeat(may(port)));
    (1..=20).for_each(|port| world.heartbeat(may_not(port)));
    assert_eq!(systems(&world), [255; 8]);
    // A ninth is told why it has no place.
    world.sent();
    world.heartbeat(may(108));
    world.command(may(108), 193, [0.0; 7]);
    let sent = world.sent();
    assert_eq!(acks(&sent), [(193, 1, 0)]);
    let text = texts(&sent).remove(0).1;
    assert_eq!(text, "eight stations are connected already");
}

#[test]
fn a_station_that_has_commanded_gives_way_to_none() {
    let mut world = World::flying();
    let own = |number| Station {
        port: QGC.port,
        system: number,
    };
    (11..=17).for_each(|number| world.heartbeat(own(number)));
    for number in 11..=17 {
        world.command(own(number), 193, [0.0; 7]);
    }
    // Of this address one has not commanded, the first.
    world.heartbeat(SCRIPT);
    assert_eq!(systems(&world), [11, 12, 13, 14, 15, 16, 17, 245]);
    world.heartbeat(Station {
        port: 40_001,
        system: 246,
    });
    assert_eq!(systems(&world), [11, 12, 13, 14, 15, 16, 17, 245]);
}

#[test]
fn each_station_is_told_in_words_why_it_was_refused() {
    let mut world = World::flying();
    // Two of them are behind one router.
    let third = Station {
        system: 7,
        ..SCRIPT
    };
    world.heartbeat(SCRIPT);
    world.heartbeat(third);
    world.sent();
    let disarm = [0.0; 7];
    for station in [QGC, SCRIPT, third, QGC] {
        world.command(station, 400, disarm);
    }
    let sent = world.sent();
    let denied = |to: Station| {
        let own = sent.iter().filter(|one| one.to == to.address());
        let own: Vec<Sent> = own.cloned().collect();
        (acks(&own).len(), texts(&own).len())
    };
    // An equal one to the same station within five seconds is one.
    assert_eq!(denied(QGC), (2, 1));
    assert_eq!(denied(SCRIPT), (2, 2));
}

#[test]
fn a_command_for_which_there_is_no_room_is_refused_in_words() {
    let mut world = World::flying();
    for number in 0..17 {
        world.command(
            QGC,
            192,
            [-1.0, 0.0, 0.0, NAN, 37.4, -6.0, 30.0 + number as f32],
        );
    }
    let sent = world.sent();
    let (acks, texts) = (acks(&sent), texts(&sent));
    let busy = Reason::TooManyRequests.code();
    assert!(acks.contains(&(192, 1, busy)), "{acks:?}");
    let text = "goto was refused: too many orders have no end yet";
    assert!(texts.iter().any(|(_, one)| one == text), "{texts:?}");
}
