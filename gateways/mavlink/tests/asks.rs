//! Nothing that asks this vehicle for something stays unanswered: old forms, messages to all systems, and messages of
//! what is not offered.

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::MavlinkStations;
use mavlink_gateway::message::{
    self, COMMAND_ACK, COMMAND_CANCEL, COMMAND_LONG, LOG_DATA, LOG_ENTRY, LOG_REQUEST_DATA,
    LOG_REQUEST_LIST, MESSAGE_INTERVAL, MISSION_ACK, MISSION_ITEM_INT, MISSION_SET_CURRENT,
    MISSION_WRITE_PARTIAL_LIST, MessageKind, PARAM_ERROR, PARAM_SET, PARAM_VALUE, SET_MODE,
    SET_POSITION_TARGET_GLOBAL_INT, STATUSTEXT,
};
use mavlink_gateway::wire::{MessageWriter, frames};
use mavlink_gateway::{Mode, OrderKind, Settings};

use crate::common::{
    HERE, QGC, SCRIPT, World, acks, clear, count, long, of_kind, reposition, request_list, results,
    texts,
};

const NAN: f32 = f32::NAN;

/// A message of zeros but for these bytes.
fn with(kind: MessageKind, length: usize, set: &[(usize, u8)]) -> MessageWriter {
    let byte = |at: usize| set.iter().find(|one| one.0 == at).map_or(0, |one| one.1);
    (0..length).fold(MessageWriter::new(kind), |message, at| message.u8(byte(at)))
}

/// How many refusals the gateway has counted for the one station.
fn refused(world: &World) -> u64 {
    let mut sample = MavlinkStations::default();
    world.gateway.describe(&mut sample, world.now);
    sample.stations[0].refused
}

/// Messages with their lengths, and where they name the system; a component follows it where the table says so.
#[rustfmt::skip]
const ASKING: [(MessageKind, usize, usize, bool); 37] = [
    (message::CHANGE_OPERATOR_CONTROL, 28, 0, false),
    (message::MISSION_REQUEST_PARTIAL_LIST, 7, 4, true),
    (MISSION_WRITE_PARTIAL_LIST, 7, 4, true),
    (message::SET_GPS_GLOBAL_ORIGIN, 21, 12, false),
    (message::PARAM_MAP_RC, 37, 18, true),
    (message::SAFETY_SET_ALLOWED_AREA, 27, 24, true),
    (message::REQUEST_DATA_STREAM, 6, 2, true),
    (message::MANUAL_CONTROL, 11, 10, false),
    (message::RC_CHANNELS_OVERRIDE, 18, 16, true),
    (COMMAND_CANCEL, 4, 2, true),
    (message::SET_ATTITUDE_TARGET, 39, 36, true),
    (message::SET_POSITION_TARGET_LOCAL_NED, 53, 50, true),
    (SET_POSITION_TARGET_GLOBAL_INT, 53, 50, true),
    (LOG_REQUEST_LIST, 6, 4, true),
    (LOG_REQUEST_DATA, 12, 10, true),
    (message::LOG_ERASE, 2, 0, true),
    (message::LOG_REQUEST_END, 2, 0, true),
    (message::GPS_INJECT_DATA, 113, 0, true),
    (message::V2_EXTENSION, 254, 3, true),
    (message::TUNNEL, 133, 2, true),
    (message::SERIAL_CONTROL, 81, 79, true),
    (message::SET_ACTUATOR_CONTROL_TARGET, 43, 41, true),
    (message::SET_HOME_POSITION, 53, 52, false),
    (message::SETUP_SIGNING, 42, 8, true),
    (message::PLAY_TUNE, 32, 0, true),
    (message::GIMBAL_MANAGER_SET_ATTITUDE, 35, 32, true),
    (message::GIMBAL_DEVICE_SET_ATTITUDE, 32, 30, true),
    (message::GIMBAL_MANAGER_SET_PITCHYAW, 23, 20, true),
    (message::GIMBAL_MANAGER_SET_MANUAL_CONTROL, 23, 20, true),
    (message::PARAM_EXT_REQUEST_READ, 20, 2, true),
    (message::PARAM_EXT_REQUEST_LIST, 2, 0, true),
    (message::PARAM_EXT_SET, 147, 0, true),
    (message::CAN_FRAME, 16, 4, true),
    (message::CANFD_FRAME, 72, 4, true),
    (message::CAN_FILTER_MODIFY, 37, 32, true),
    (message::PLAY_TUNE_V2, 200, 4, true),
    (message::REQUEST_EVENT, 6, 4, true),
];

#[test]
fn what_is_not_offered_gets_a_text_and_is_counted_and_what_is_for_others_does_not() {
    for (kind, length, at, has_component) in ASKING {
        let targets = [(1, 0), (1, 1), (0, 0), (2, 1), (1, 154)];
        for (system, component) in targets {
            let is_for_us = system < 2 && (component < 2 || !has_component);
            let mut world = World::flying();
            let mut set = vec![(at, system)];
            if has_component {
                set.push((at + 1, component));
            }
            let message = with(kind, length, &set);
            for _ in 0..3 {
                world.receive(QGC, &QGC.frame(&message));
            }
            let sent = world.sent();
            let said = texts(&sent);
            let name = kind.name();
            assert_eq!(
                said.len(),
                usize::from(is_for_us),
                "{name} {system}/{component}: {said:?}"
            );
            assert!(
                said.iter().all(|(_, text)| text.starts_with(name)),
                "{said:?}"
            );
            assert_eq!(refused(&world), if is_for_us { 3 } else { 0 }, "{name}");
            assert_eq!(world.kinds(), []);
        }
    }
}

#[test]
fn where_the_protocol_has_an_answer_it_comes() {
    let mut world = World::flying();
    let ask = |world: &mut World, message: &MessageWriter| {
        world.receive(QGC, &QGC.frame(message));
        world.sent()
    };
    // A mission of which a part is changed is as it was.
    let part = with(
        MISSION_WRITE_PARTIAL_LIST,
        7,
        &[(0, 1), (2, 1), (4, 1), (5, 1)],
    );
    assert_eq!(results(&ask(&mut world, &part)), [3]);
    // There is no log, and nothing of it.
    let list = with(LOG_REQUEST_LIST, 6, &[(4, 1), (5, 1)]);
    let sent = ask(&mut world, &list);
    assert_eq!(of_kind(&sent, LOG_ENTRY)[0].bytes::<14>(0), [0; 14]);
    let data = with(LOG_REQUEST_DATA, 12, &[(0, 9), (8, 7), (10, 1), (11, 1)]);
    let sent = ask(&mut world, &data);
    assert_eq!(
        of_kind(&sent, LOG_DATA)[0].bytes::<7>(0),
        [9, 0, 0, 0, 7, 0, 0]
    );
    // No command is taken back.
    let cancel = with(COMMAND_CANCEL, 4, &[(0, 22), (2, 1), (3, 1)]);
    assert_eq!(acks(&ask(&mut world, &cancel)), [(22, 2, 0)]);
    // Set points come 20 times in a second, and a text once in a minute.
    let point = with(SET_POSITION_TARGET_GLOBAL_INT, 53, &[(50, 1), (51, 1)]);
    let mut said = 0;
    for _ in 0..61 * 20 {
        world.tick(50);
        world.receive(QGC, &QGC.frame(&point));
        let sent = world.sent();
        said += texts(&sent)
            .iter()
            .filter(|(_, text)| text.starts_with("SET_"))
            .count();
    }
    assert_eq!(said, 2);
}

#[test]
fn what_changes_the_vehicle_must_name_it_and_what_reads_need_not() {
    let mut world = World::with_station();
    // A command, whatever it is, to all systems.
    for (command, params) in [
        (400, [1.0; 7]),
        (22, [10.0; 7]),
        (193, [0.0; 7]),
        (4242, [0.0; 7]),
    ] {
        let message = params
            .iter()
            .fold(MessageWriter::new(COMMAND_LONG), |message, param| {
                message.f32(*param)
            });
        let message = message.u16(command).u8(0).u8(0).u8(0);
        world.receive(QGC, &QGC.frame(&message));
        let sent = world.sent();
        assert_eq!(acks(&sent), [(command, 2, 0)]);
        let text = &texts(&sent)[0].1;
        assert!(
            text.ends_with("it was sent to all systems; name this one, 1"),
            "{text}"
        );
    }
    assert_eq!(refused(&world), 4);
    let mission = |kind, length, at| with(kind, length, &[(at, 0)]);
    let changes = [
        (mission(message::MISSION_COUNT, 5, 2), MISSION_ACK),
        (mission(message::MISSION_CLEAR_ALL, 3, 0), MISSION_ACK),
        (mission(MISSION_SET_CURRENT, 4, 2), MISSION_ACK),
        (
            with(MISSION_ITEM_INT, 38, &[(30, 16), (35, 2)]),
            MISSION_ACK,
        ),
        (with(PARAM_SET, 23, &[(6, b'D')]), PARAM_ERROR),
        (with(SET_MODE, 6, &[(2, 4), (3, 3)]), STATUSTEXT),
    ];
    for (message, answer) in &changes {
        world.receive(QGC, &QGC.frame(message));
        let sent = world.sent();
        let name = message.kind.name();
        assert!(!of_kind(&sent, *answer).is_empty(), "{name}: {sent:?}");
        let text = &texts(&sent)[0].1;
        assert!(
            text.contains(name) && text.contains("name this one"),
            "{text}"
        );
    }
    assert_eq!((world.kinds(), refused(&world)), (vec![], 10));
    // Reading is for all.
    let list = with(message::MISSION_REQUEST_LIST, 3, &[]);
    let take_off = with(message::PARAM_REQUEST_READ, 20, &[(0, 255), (1, 255)]);
    let take_off = {
        let mut bytes: Vec<u8> = (0..20).map(|at| take_off.payload().u8(at)).collect();
        bytes[4..19].copy_from_slice(b"MIS_TAKEOFF_ALT");
        bytes
            .iter()
            .fold(MessageWriter::new(take_off.kind), |message, byte| {
                message.u8(*byte)
            })
    };
    for (message, answer) in [(&list, message::MISSION_COUNT), (&take_off, PARAM_VALUE)] {
        world.receive(QGC, &QGC.frame(message));
        assert_eq!(
            of_kind(&world.sent(), answer).len(),
            1,
            "{:?}",
            message.kind.name()
        );
    }
}

#[test]
fn mavlink_1_is_answered_in_mavlink_1() {
    let mut world = World::with_station();
    let asked = [
        (long(400, [1.0; 7]), Some(COMMAND_ACK)),
        (
            reposition(6, 374_200_000, -60_010_000, 30.0),
            Some(COMMAND_ACK),
        ),
        (count(3, 0), Some(MISSION_ACK)),
        (clear(0), Some(MISSION_ACK)),
        (request_list(0), Some(MISSION_ACK)),
        (with(SET_MODE, 6, &[(4, 1)]), None),
        (with(PARAM_SET, 23, &[(4, 1)]), None),
        (with(message::MANUAL_CONTROL, 11, &[(10, 1)]), None),
    ];
    for (number, (message, answer)) in asked.iter().enumerate() {
        // Texts are said once in five seconds.
        world.tick(6_000);
        world.sent();
        world.heartbeat(QGC);
        world.sent();
        let frame = message.frame_of_version_1(9, QGC.system, 190);
        world
            .gateway
            .datagram(QGC.address(), &frame, world.now, world.now);
        let mut kinds = Vec::new();
        while let Some(datagram) = world.gateway.poll_datagram() {
            let [Ok(frame)] = frames(&datagram.bytes).collect::<Vec<_>>()[..] else {
                panic!("no frame")
            };
            assert!(frame.is_version_1 && datagram.to == QGC.address());
            kinds.push(frame.kind);
            match frame.kind {
                COMMAND_ACK => assert_eq!(frame.payload.u8(2), 2, "denied"),
                MISSION_ACK => assert_eq!(frame.payload.u8(2), 14, "denied"),
                _ => assert_eq!(frame.payload.0.len(), 51),
            }
        }
        let expected: Vec<MessageKind> = answer.iter().copied().chain([STATUSTEXT]).collect();
        assert_eq!(kinds, expected, "{}", message.kind.name());
        assert_eq!(refused(&world), number as u64 + 1);
    }
    assert_eq!(world.kinds(), []);
    // To another system.
    let message = with(SET_MODE, 6, &[(4, 7)]);
    let frame = message.frame_of_version_1(9, QGC.system, 190);
    world
        .gateway
        .datagram(QGC.address(), &frame, world.now, world.now);
    assert_eq!(world.sent(), []);
}

#[test]
fn an_item_to_be_flown_to_at_once_is_a_goto_whose_answer_is_the_bridges() {
    let guided = |current: u8, x: i32, z: f32| {
        let message = MessageWriter::new(MISSION_ITEM_INT).f32s(0.0, 3).f32(NAN);
        let message = message
            .i32(x)
            .i32((HERE.1 * 1e7) as i32)
            .f32(z)
            .u16(0)
            .u16(16);
        message.u8(1).u8(1).u8(6).u8(current).u8(1).u8(0)
    };
    let north = (HERE.0 * 1e7) as i32 + 10_000;
    for (stage, reason, result) in [
        (Stage::Accepted, Reason::None, 0),
        (Stage::Refused, Reason::FenceBreach, 14),
        (Stage::Refused, Reason::Busy, 1),
    ] {
        let mut world = World::flying();
        for _ in 0..3 {
            world.receive(QGC, &QGC.frame(&guided(2, north, 30.0)));
        }
        let orders = world.orders();
        assert!(matches!(orders[..], [order] if matches!(order.kind, OrderKind::GoTo(_))));
        assert!(results(&world.sent()).is_empty());
        world.report(&orders[0], stage, reason);
        let sent = world.sent();
        assert_eq!(results(&sent), [result], "{reason}");
        assert_eq!(texts(&sent).is_empty(), result == 0);
    }
    // By one that may not command, and on the ground.
    let settings = Settings {
        commanders: vec![SCRIPT.system],
        ..Settings::default()
    };
    for mut world in [World::flying_with(settings), World::with_station()] {
        world.receive(QGC, &QGC.frame(&guided(2, north, 30.0)));
        let sent = world.sent();
        assert_eq!((results(&sent).len(), texts(&sent).len()), (1, 1));
        assert_eq!(world.kinds(), []);
    }
    // In the middle of an upload it is no item of it.
    let mut world = World::flying();
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    world.receive(QGC, &QGC.frame(&guided(3, north, 30.0)));
    assert!(matches!(world.kinds()[..], [OrderKind::GoTo(_)]));
    world.receive(QGC, &QGC.frame(&guided(1, north, 30.0)));
    world.serve("");
    assert_eq!(results(&world.sent()), [0]);
}

#[test]
fn a_helicopter_on_the_ground_is_held_already() {
    let modes = [
        long(193, [0.0; 7]),
        long(176, [1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0]),
        MessageWriter::new(SET_MODE)
            .u32(Mode::Hold.custom())
            .u8(1)
            .u8(1),
    ];
    for message in modes {
        let mut world = World::with_station();
        world.receive(QGC, &QGC.frame(&message));
        let hold = world.orders()[0];
        assert_eq!(hold.kind, OrderKind::Hold);
        // As the bridge says it while the module is not started.
        world.report(&hold, Stage::Refused, Reason::NotStarted);
        let sent = world.sent();
        assert!(acks(&sent).iter().all(|ack| ack.1 == 0), "{sent:?}");
        assert_eq!(texts(&sent), []);
        assert_eq!(refused(&world), 0);
    }
    // In the air a module that is not started holds nothing, and a landing on the ground is none.
    for (mut world, command, result) in [(World::flying(), 193, 1), (World::with_station(), 21, 1)]
    {
        world.command(QGC, command, [0.0; 7]);
        let order = world.orders()[0];
        world.report(&order, Stage::Refused, Reason::NotStarted);
        assert_eq!(acks(&world.sent())[0].1, result);
    }
}

/// MAVSDK's `start_mission`, then `arm`: it holds before it arms, since the mode is that of a mission.
#[test]
fn an_arming_after_the_start_of_a_mission_holds_first_and_arms() {
    let mut world = World::with_station();
    world.receive(QGC, &QGC.frame(&count(1, 0)));
    let take_off = with(
        MISSION_ITEM_INT,
        38,
        &[
            (26, 0x70),
            (27, 0x41),
            (30, 22),
            (32, 1),
            (33, 1),
            (34, 6),
            (36, 1),
        ],
    );
    world.receive(QGC, &QGC.frame(&take_off));
    world.serve("");
    world.sent();
    let mode = |sub: f32| [1.0, 4.0, sub, 0.0, 0.0, 0.0, 0.0];
    world.command(QGC, 176, mode(4.0));
    assert_eq!(acks(&world.sent()), [(176, 0, 0)]);
    world.command(QGC, 176, mode(3.0));
    let hold = world.orders()[0];
    world.report(&hold, Stage::Refused, Reason::NotStarted);
    assert_eq!(acks(&world.sent())[0].1, 0);
    world.command(QGC, 400, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let start = world.orders()[0];
    world.report(&start, Stage::Done, Reason::None);
    assert_eq!(acks(&world.sent()), [(400, 0, 0)]);
    assert_eq!(
        world.kinds(),
        [],
        "the hold has ended the mission's waiting"
    );
}

#[test]
fn an_interval_that_is_longer_than_its_field_is_the_longest() {
    let mut world = World::flying();
    let set = |id, us| [id, us, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (us, told) in [
        (5e9, i32::MAX),
        (3e38, i32::MAX),
        (2e6, 2_000_000),
        (-1.0, -1),
    ] {
        world.command(QGC, 511, set(30.0, us));
        world.command(QGC, 510, set(30.0, 0.0));
        let sent = world.sent();
        assert!(acks(&sent).iter().all(|ack| ack.1 == 0));
        let interval = of_kind(&sent, MESSAGE_INTERVAL)[0];
        assert_eq!(i32::from_le_bytes(interval.bytes(0)), told, "{us}");
        world.tick(20);
        world.sent();
    }
    // A number that is no message's is not that of another one.
    for id in [65_566.0, 30.5, -1.0] {
        world.command(QGC, 510, set(id, 0.0));
        let sent = world.sent();
        let interval = of_kind(&sent, MESSAGE_INTERVAL)[0];
        assert_eq!(
            (interval.bytes::<4>(0), interval.bytes::<2>(4)),
            ([0; 4], [255, 255])
        );
    }
}
