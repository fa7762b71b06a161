//! The geofence of the bridge, as stations ask for it.

use ipc_types::code::OutlineKind;
use ipc_types::payload::{BridgeOutline, OutlinePoint};
use mavlink_gateway::message::{
    MISSION_ACK, MISSION_CLEAR_ALL, MISSION_COUNT, MISSION_ITEM_INT, MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST,
};
use mavlink_gateway::wire::Message;

use crate::common::{QGC, Sent, Station, World, texts};

const FENCE: u8 = 1;

fn point(latitude_deg: f64, longitude_deg: f64) -> OutlinePoint {
    OutlinePoint {
        latitude_deg,
        longitude_deg,
        ..OutlinePoint::default()
    }
}

/// A triangle to stay inside and a circle to stay outside, as the bridge says them.
fn outline(number: u64) -> Vec<BridgeOutline> {
    let piece = |piece, kind: OutlineKind| BridgeOutline {
        number,
        piece,
        pieces: 3,
        kind: kind.code(),
        ..BridgeOutline::default()
    };
    let mut triangle = BridgeOutline {
        count: 3,
        total: 3,
        inclusion: 1,
        name: BridgeOutline::name_bytes("field"),
        ..piece(1, OutlineKind::Area)
    };
    for (place, corner) in triangle.points.iter_mut().zip([
        point(37.1, -6.0),
        point(37.2, -6.0),
        point(37.2, -6.1234567),
    ]) {
        *place = corner;
    }
    let mut circle = BridgeOutline {
        area: 1,
        count: 1,
        total: 1,
        radius_m: 12.5,
        name: BridgeOutline::name_bytes("mast"),
        ..piece(2, OutlineKind::Area)
    };
    circle.points[0] = point(37.15, -6.05);
    let fence = BridgeOutline {
        area: 2,
        ..piece(0, OutlineKind::Fence)
    };
    vec![fence, triangle, circle]
}

/// With this fence in force.
fn fenced() -> World {
    let mut world = World::with_station();
    for piece in outline(7) {
        world.gateway.outline(&piece);
    }
    world.state.outline = 7;
    world.tick(20);
    world.sent();
    world
}

fn ask(world: &mut World, by: Station, message: Message) -> Vec<Sent> {
    world.receive(by, &by.frame(&message.u8(1).u8(1).u8(FENCE)));
    world.sent()
}

fn list(world: &mut World, by: Station) -> Vec<Sent> {
    ask(world, by, Message::new(MISSION_REQUEST_LIST))
}

fn item(world: &mut World, by: Station, sequence: u16) -> Vec<Sent> {
    let request = Message::new(MISSION_REQUEST_INT).u16(sequence);
    ask(world, by, request)
}

/// MISSION_ACK: result and type.
fn ack(sent: &[Sent]) -> [u8; 2] {
    let ack = sent.iter().find(|one| one.kind == MISSION_ACK);
    ack.expect("it is answered").bytes(2)
}

#[test]
fn what_the_bridge_has_in_force_is_read_item_by_item() {
    let mut world = fenced();
    let sent = list(&mut world, QGC);
    let [count] = &sent[..] else {
        panic!("{sent:?}")
    };
    assert_eq!(count.kind, MISSION_COUNT);
    assert_eq!(count.bytes::<5>(0), [4, 0, QGC.system, 190, FENCE]);
    let expected = [
        (5001, 3.0, 371_000_000, -60_000_000),
        (5001, 3.0, 372_000_000, -60_000_000),
        (5001, 3.0, 372_000_000, -61_234_567),
        (5004, 12.5, 371_500_000, -60_500_000),
    ];
    for (sequence, expected) in (0..).zip(expected) {
        let sent = item(&mut world, QGC, sequence);
        let [item] = &sent[..] else {
            panic!("{sent:?}")
        };
        assert_eq!(item.kind, MISSION_ITEM_INT);
        let number = |at| i32::from_le_bytes(item.bytes(at));
        let read = (
            u16::from_le_bytes(item.bytes(30)),
            f32::from_le_bytes(item.bytes(0)),
            number(16),
            number(20),
        );
        assert_eq!(read, expected);
        assert_eq!(item.bytes::<2>(28), sequence.to_le_bytes());
        assert_eq!(item.bytes::<1>(37), [FENCE]);
    }
    assert_eq!(ack(&item(&mut world, QGC, 4)), [13, FENCE]);
    // One that was not asked for as a list.
    let other = Station { port: 9, system: 7 };
    assert_eq!(ack(&item(&mut world, other, 0)), [13, FENCE]);
}

#[test]
fn a_fence_that_is_not_known_is_not_shown_as_none() {
    let mut world = World::with_station();
    assert_eq!(ack(&list(&mut world, QGC)), [1, FENCE]);
    // That of before does not hold any more.
    let mut world = fenced();
    world.state.outline = 8;
    world.tick(20);
    world.sent();
    let sent = list(&mut world, QGC);
    assert_eq!(ack(&sent), [1, FENCE]);
    // What a station has begun to read stays whole.
    let mut world = fenced();
    list(&mut world, QGC);
    world.state.outline = 8;
    world.tick(20);
    world.sent();
    assert_eq!(item(&mut world, QGC, 3)[0].kind, MISSION_ITEM_INT);
}

#[test]
fn nothing_takes_a_fence_away() {
    let mut world = fenced();
    let sent = ask(&mut world, QGC, Message::new(MISSION_CLEAR_ALL));
    assert_eq!(ack(&sent), [14, FENCE]);
    assert!(texts(&sent)[0].1.contains("never removed"));
    let sent = ask(&mut world, QGC, Message::new(MISSION_COUNT).u16(3));
    assert_eq!(ack(&sent), [14, FENCE]);
    assert!(texts(&sent)[0].1.contains("ril plan fly --fence"));
    assert_eq!(world.kinds(), []);
    // There is none to remove.
    let mut world = World::with_station();
    world.gateway.outline(&BridgeOutline {
        number: 9,
        pieces: 1,
        kind: OutlineKind::Fence.code(),
        ..BridgeOutline::default()
    });
    world.state.outline = 9;
    world.tick(20);
    world.sent();
    let sent = ask(&mut world, QGC, Message::new(MISSION_CLEAR_ALL));
    assert_eq!(ack(&sent), [0, FENCE]);
    assert_eq!(list(&mut world, QGC)[0].bytes::<2>(0), [0, 0]);
}
