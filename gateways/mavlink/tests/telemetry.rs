//! What stations are sent without asking, and that nothing is sent of a helicopter that is not heard.

use ipc_types::code::{Functionality, LinkState};
use mavlink_gateway::message::{
    ATTITUDE, AUTOPILOT_VERSION, AVAILABLE_MODES, COMMAND_ACK, GLOBAL_POSITION_INT, HEARTBEAT,
    MESSAGE_INTERVAL, MISSION_ACK, MISSION_COUNT, PING, STATUSTEXT, TIMESYNC,
};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{MAX_STATIONS, Mode, Settings, StreamId};

use crate::common::{QGC, SCRIPT, Sent, Station, World, acks, texts};

fn count(sent: &[Sent], stream: StreamId) -> usize {
    sent.iter().filter(|one| one.kind == stream.kind()).count()
}

#[test]
fn a_named_address_gets_heartbeats_alone_until_a_station_is_there() {
    let settings = Settings {
        stations: vec![QGC.address()],
        ..Settings::default()
    };
    let mut world = World::new(settings);
    let sent = world.run(100);
    assert!(sent.iter().all(|one| one.kind == HEARTBEAT), "{sent:?}");
    assert_eq!(sent.len(), 3);
    world.heartbeat(QGC);
    let sent = world.run(500);
    assert_eq!(count(&sent, StreamId::Attitude), 101);
    assert_eq!(count(&sent, StreamId::GlobalPosition), 51);
    assert_eq!(count(&sent, StreamId::AttitudeQuaternion), 0);
    // The station is gone after 30 s, and with it everything but the heartbeat.
    world.run(1_600);
    let sent = world.run(100);
    assert!(
        !sent.is_empty() && sent.iter().all(|one| one.kind == HEARTBEAT),
        "{sent:?}"
    );
}

#[test]
fn nothing_is_sent_of_a_helicopter_that_is_not_heard() {
    let mut world = World::with_station();
    assert_eq!(count(&world.run(50), StreamId::Heartbeat), 1);
    world.pass(2_000);
    world.sent();
    world.pass(10);
    let sent = world.sent();
    assert!(sent.iter().all(|one| one.kind == STATUSTEXT), "{sent:?}");
    assert!(
        texts(&sent)[0].1.contains("is not heard any more"),
        "{sent:?}"
    );
    world.pass(10_000);
    assert_eq!(world.sent(), []);
    // Old samples that come late are not sent.
    let old = world.telemetry;
    world.gateway.telemetry(&old, world.now);
    world.gateway.advance(world.now);
    assert_eq!(world.sent(), []);
    world.tick(20);
    assert!(count(&world.sent(), StreamId::Heartbeat) == 1);
    // A line that is down is the same at once.
    world.state.link.state = LinkState::Silent.code();
    world.tick(20);
    world.sent();
    world.tick(2_000);
    assert_eq!(world.sent(), []);
}

#[test]
fn no_sample_goes_twice_and_a_change_of_mode_goes_at_once() {
    let mut world = World::with_station();
    world.tick(20);
    world.sent();
    world.pass(1_900);
    let sent = world.sent();
    assert_eq!(count(&sent, StreamId::GlobalPosition), 1, "{sent:?}");
    assert_eq!(count(&sent, StreamId::Heartbeat), 1);
    world.tick(10);
    world.sent();
    world.state.functionality = Functionality::TakingOff.code();
    world.gateway.state(&world.state, world.now);
    world.gateway.advance(world.now);
    let sent = world.sent();
    let heartbeat = sent
        .iter()
        .find(|one| one.kind == HEARTBEAT)
        .expect("a heartbeat");
    assert_eq!(
        u32::from_le_bytes(heartbeat.bytes(0)),
        Mode::TakeOff.custom()
    );
}

#[test]
fn a_station_chooses_messages_and_rates() {
    let mut world = World::with_station();
    let param = |id: u32, value: f32| [id as f32, value, 0.0, 0.0, 0.0, 0.0, 0.0];
    world.command(QGC, 511, param(ATTITUDE.id, 20_000.0));
    world.command(QGC, 511, param(GLOBAL_POSITION_INT.id, -1.0));
    world.command(QGC, 511, param(99, 0.0));
    world.command(QGC, 511, param(ATTITUDE.id, 5.0));
    let results: Vec<u8> = acks(&world.sent()).iter().map(|ack| ack.1).collect();
    assert_eq!(results, [0, 0, 3, 2]);
    let sent = world.run(50);
    assert_eq!(
        (
            count(&sent, StreamId::Attitude),
            count(&sent, StreamId::GlobalPosition)
        ),
        (50, 0)
    );
    world.command(QGC, 510, param(ATTITUDE.id, 0.0));
    world.command(QGC, 512, param(AUTOPILOT_VERSION.id, 0.0));
    world.command(QGC, 512, param(AVAILABLE_MODES.id, 0.0));
    world.command(QGC, 512, param(AVAILABLE_MODES.id, 2.0));
    world.command(QGC, 512, param(31, 0.0));
    world.command(QGC, 512, param(397, 0.0));
    world.command(QGC, 410, param(0, 0.0));
    let sent = world.sent();
    let interval = sent
        .iter()
        .find(|one| one.kind == MESSAGE_INTERVAL)
        .expect("an interval");
    assert_eq!(i32::from_le_bytes(interval.bytes(0)), 20_000);
    assert_eq!(
        sent.iter()
            .filter(|one| one.kind == AVAILABLE_MODES)
            .count(),
        8
    );
    assert_eq!(count(&sent, StreamId::AttitudeQuaternion), 1);
    assert_eq!(count(&sent, StreamId::Home), 1);
    let results: Vec<u8> = acks(&sent).iter().map(|ack| ack.1).collect();
    assert_eq!(results, [0, 0, 0, 0, 0, 3, 0]);
}

#[test]
fn clocks_and_fences_are_answered_so_that_no_station_waits() {
    let mut world = World::with_station();
    let messages = [
        MessageWriter::new(PING).u64(5).u32(6).u8(0).u8(0),
        MessageWriter::new(TIMESYNC).i64(0).i64(77),
        MessageWriter::new(mavlink_gateway::message::MISSION_REQUEST_LIST)
            .u8(1)
            .u8(1)
            .u8(2),
        MessageWriter::new(MISSION_COUNT).u16(12).u8(1).u8(1).u8(2),
    ];
    for message in messages {
        world.receive(QGC, &QGC.frame(&message));
    }
    let sent = world.sent();
    let one = |kind| sent.iter().find(|one| one.kind == kind).expect("an answer");
    assert_eq!(
        one(PING).bytes(0),
        [5, 0, 0, 0, 0, 0, 0, 0, 6, 0, 0, 0, 255, 190]
    );
    assert_eq!(
        i64::from_le_bytes(one(TIMESYNC).bytes(0)),
        world.now.0 as i64
    );
    assert_eq!(i64::from_le_bytes(one(TIMESYNC).bytes(8)), 77);
    assert_eq!(one(MISSION_COUNT).bytes(0), [0, 0, 255, 190, 2]);
    assert_eq!(one(MISSION_ACK).bytes(0), [255, 190, 3, 2]);
}

#[test]
fn the_ninth_station_gets_no_telemetry_and_is_refused() {
    let mut world = World::new(Settings::default());
    let station = |port: usize| Station {
        port: 1_000 + port as u16,
        system: 255,
    };
    for port in 0..=MAX_STATIONS {
        world.heartbeat(station(port));
    }
    world.sent();
    world.tick(1_000);
    let ninth = station(MAX_STATIONS);
    let sent = world.sent();
    assert!(sent.iter().all(|one| one.to != ninth.address()));
    assert!(sent.iter().any(|one| one.to == station(7).address()));
    world.command(ninth, 21, [0.0; 7]);
    assert_eq!(acks(&world.sent()), [(21, 1, 0)]);
    assert_eq!(world.kinds(), []);
    // Behind one address, several stations get each message once.
    let mut world = World::with_station();
    world.heartbeat(Station {
        system: SCRIPT.system,
        ..QGC
    });
    world.sent();
    world.tick(1_000);
    assert_eq!(count(&world.sent(), StreamId::Heartbeat), 1);
    assert!(world.sent().iter().all(|one| one.kind != COMMAND_ACK));
}
