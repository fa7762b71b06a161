//! The geofence of the bridge, as stations ask for it.

use ipc_types::code::{Functionality, OutlineKind, Reason, Stage};
use ipc_types::payload::{BridgeOutline, OutlinePoint};
use mavlink_gateway::message::{
    MISSION_ACK, MISSION_CLEAR_ALL, MISSION_COUNT, MISSION_ITEM_INT, MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST,
};
use mavlink_gateway::number::{MissionRefusal, MissionResult};
use mavlink_gateway::wire::MessageWriter;
use mavlink_gateway::{Order, OrderKind, Settings, Task};

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

fn ask(world: &mut World, by: Station, message: MessageWriter) -> Vec<Sent> {
    world.receive(by, &by.frame(&message.u8(1).u8(1).u8(FENCE)));
    world.sent()
}

fn list(world: &mut World, by: Station) -> Vec<Sent> {
    ask(world, by, MessageWriter::new(MISSION_REQUEST_LIST))
}

fn item(world: &mut World, by: Station, sequence: u16) -> Vec<Sent> {
    let request = MessageWriter::new(MISSION_REQUEST_INT).u16(sequence);
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
    // The previous fence does not hold any more.
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
    let sent = ask(&mut world, QGC, MessageWriter::new(MISSION_CLEAR_ALL));
    assert_eq!(ack(&sent), [14, FENCE]);
    assert!(texts(&sent)[0].1.contains("never removed"));
    let sent = ask(&mut world, QGC, MessageWriter::new(MISSION_COUNT).u16(3));
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
    let sent = ask(&mut world, QGC, MessageWriter::new(MISSION_CLEAR_ALL));
    assert_eq!(ack(&sent), [0, FENCE]);
    assert_eq!(list(&mut world, QGC)[0].bytes::<2>(0), [0, 0]);
}

const DENIED: u8 = 14;

/// With the operator's circle in force, on the ground, where a fence of stations is accepted.
fn accepting() -> World {
    let mut world = World::new(Settings {
        accepts_fence: true,
        ..Settings::default()
    });
    world.heartbeat(QGC);
    in_force(&mut world, 7, &[]);
    world.sent();
    world
}

/// The bridge says that it has the operator's circle in force, and these circles of stations behind it.
fn in_force(world: &mut World, number: u64, radii: &[f32]) {
    let pieces = 2 + radii.len() as u32;
    let piece = |piece, kind: OutlineKind| BridgeOutline {
        number,
        piece,
        pieces,
        kind: kind.code(),
        ..BridgeOutline::default()
    };
    world.gateway.outline(&BridgeOutline {
        area: pieces - 1,
        ..piece(0, OutlineKind::Fence)
    });
    for (area, radius_m) in (0..).zip([5.0].iter().chain(radii)) {
        let name = match area {
            0 => "mast".to_owned(),
            _ => format!("plan: exclusion {area}"),
        };
        let mut circle = BridgeOutline {
            area,
            count: 1,
            total: 1,
            radius_m: (*radius_m).into(),
            name: BridgeOutline::name_bytes(&name),
            ..piece(1 + area, OutlineKind::Area)
        };
        circle.points[0] = point(37.15, -6.05);
        world.gateway.outline(&circle);
    }
    world.state.outline = number;
    world.tick(20);
}

fn count(world: &mut World, count: u16) -> Vec<Sent> {
    ask(world, QGC, MessageWriter::new(MISSION_COUNT).u16(count))
}

/// A circle to stay outside, or what this command means.
fn circle(world: &mut World, sequence: u16, command: u16, radius_m: f32) {
    let message = MessageWriter::new(MISSION_ITEM_INT)
        .f32(radius_m)
        .f32s(0.0, 3);
    let message = message.i32(371_500_000).i32(-60_500_000).f32(0.0);
    let message = message.u16(sequence).u16(command).u8(1).u8(1);
    let message = message.u8(5).u8(0).u8(1).u8(FENCE);
    world.receive(QGC, &QGC.frame(&message));
}

/// How far an upload of two circles has come: it has begun, it is written, the bridge is asked, the bridge has read it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
enum Far {
    Begun,
    Sent,
    Asked,
    Read,
}

/// The upload, and the order of the bridge.
fn uploaded(far: Far) -> (World, Option<Order>) {
    let mut world = accepting();
    let request = &count(&mut world, 2)[0];
    assert_eq!(
        (request.kind, request.bytes(4)),
        (MISSION_REQUEST_INT, [FENCE])
    );
    if far == Far::Begun {
        return (world, None);
    }
    circle(&mut world, 0, 5004, 20.0);
    circle(&mut world, 1, 5004, 30.5);
    if far == Far::Sent {
        return (world, None);
    }
    world.serve("");
    assert_eq!(
        world.put.as_deref(),
        Some(["exclusion 1".to_owned(), "exclusion 2".to_owned()].as_slice())
    );
    let orders = world.orders();
    assert_eq!(orders.len(), 1);
    assert_eq!(orders[0].kind, OrderKind::ReloadFence);
    if far == Far::Read {
        world.report(&orders[0], Stage::Done, Reason::None);
    }
    let acks = world.sent();
    assert!(
        acks.iter().all(|one| one.kind != MISSION_ACK),
        "not in force yet"
    );
    (world, Some(orders[0]))
}

#[test]
fn an_answer_comes_when_the_bridge_has_the_fence_in_force_or_has_refused_it() {
    use Far::{Asked, Begun, Read, Sent};
    type Event = fn(&mut World, Option<Order>);
    type Case = (&'static str, Event, [(Far, u8); 4]);
    // For each event: what the answer is, by how far the upload is; 99 is none.
    let table: [Case; 8] = [
        (
            "the fence is in force",
            |world, _| in_force(world, 8, &[20.0, 30.5]),
            [(Begun, 99), (Sent, 99), (Asked, 99), (Read, 0)],
        ),
        (
            "another fence is in force",
            |world, _| in_force(world, 8, &[20.0, 30.0]),
            [(Begun, 99), (Sent, 99), (Asked, 99), (Read, 99)],
        ),
        (
            "the same fence is in force without the operator's",
            |world, _| in_force(world, 8, &[20.0]),
            [(Begun, 99), (Sent, 99), (Asked, 99), (Read, 99)],
        ),
        (
            "the file cannot be written",
            |world, _| {
                let refusal = MissionRefusal {
                    result: MissionResult::Denied,
                    text: "it would be wider".to_owned(),
                };
                world.gateway.poll_task();
                world.gateway.fence_put(Err(refusal), world.now);
            },
            [(Begun, 99), (Sent, DENIED), (Asked, 99), (Read, 99)],
        ),
        (
            "the bridge refuses it",
            |world, order| {
                if let Some(order) = order {
                    world.report(&order, Stage::Refused, Reason::InvalidFence);
                }
            },
            [(Begun, 99), (Sent, 99), (Asked, 5), (Read, 99)],
        ),
        (
            "there is no bridge",
            |world, order| {
                if let Some(order) = order {
                    world.gateway.not_sent(order.number, "no bridge", world.now);
                }
            },
            [(Begun, 99), (Sent, 99), (Asked, 1), (Read, 99)],
        ),
        (
            "the station ends it",
            |world, _| {
                let end = MessageWriter::new(MISSION_ACK).u8(1).u8(1).u8(15).u8(FENCE);
                world.receive(QGC, &QGC.frame(&end));
                in_force(world, 8, &[20.0, 30.5]);
            },
            [(Begun, 99), (Sent, 99), (Asked, 99), (Read, 99)],
        ),
        (
            "its time has passed",
            |world, _| world.pass(4_000),
            [(Begun, 15), (Sent, 1), (Asked, 1), (Read, 1)],
        ),
    ];
    for (event, happens, expected) in table {
        for (far, answer) in expected {
            let (mut world, order) = uploaded(far);
            happens(&mut world, order);
            let sent = world.sent();
            let acks: Vec<u8> = sent
                .iter()
                .filter(|one| one.kind == MISSION_ACK)
                .map(|ack| ack.bytes::<1>(2)[0])
                .collect();
            let expected = match answer {
                99 => vec![],
                answer => vec![answer],
            };
            assert_eq!(acks, expected, "{far:?}: {event}");
            let said = texts(&sent);
            if answer == 0 {
                assert!(
                    said[0]
                        .1
                        .contains("is in force; its areas: 2, of bridge.toml: 1"),
                    "{said:?}"
                );
            } else if !acks.is_empty() {
                assert!(said.iter().any(|(severity, _)| *severity == 3), "{said:?}");
            }
            // What the bridge did not take is taken back, and read again.
            world.serve("");
            let is_back = matches!(answer, 1 | 5);
            let was_put = far != Begun && answer != DENIED;
            assert_eq!(world.put.is_some(), was_put && !is_back, "{far:?}: {event}");
            if is_back {
                assert_eq!(world.kinds(), [OrderKind::ReloadFence]);
            }
        }
    }
}

#[test]
fn a_station_s_areas_are_cleared_and_those_of_the_operator_stay() {
    let mut world = accepting();
    in_force(&mut world, 8, &[20.0]);
    let mut said = Vec::new();
    for message in [
        MessageWriter::new(MISSION_CLEAR_ALL),
        MessageWriter::new(MISSION_COUNT).u16(0),
    ] {
        world.sent();
        assert_eq!(ask(&mut world, QGC, message), []);
        world.serve("");
        assert_eq!(world.put, Some(vec![]));
        let order = world.orders()[0];
        world.report(&order, Stage::Done, Reason::None);
        in_force(&mut world, 9, &[]);
        let sent = world.sent();
        assert_eq!(ack(&sent), [0, FENCE]);
        // A text that was just said is not said again.
        said.extend(texts(&sent));
    }
    let text = "no fence of a station is in force; areas of bridge.toml: 1";
    assert_eq!(said[0].1, text);
}

#[test]
fn a_fence_is_refused_in_flight_of_strangers_and_with_what_is_none() {
    let accepting_in_flight = Settings {
        accepts_fence: true,
        ..Settings::default()
    };
    let mut world = World::flying_with(accepting_in_flight);
    let sent = count(&mut world, 2);
    assert_eq!(ack(&sent), [DENIED, FENCE]);
    assert!(texts(&sent)[0].1.contains("not in flight: land first"));
    // Another program has ordered a take-off, which has not left the ground.
    let mut world = accepting();
    world.state.functionality = Functionality::TakingOff.code();
    world.tick(20);
    world.sent();
    assert_eq!(ack(&count(&mut world, 2)), [DENIED, FENCE]);
    // It has taken off between the first item and the last.
    let (mut world, _) = uploaded(Far::Begun);
    circle(&mut world, 0, 5004, 20.0);
    world.telemetry.flying = 1;
    world.telemetry.geodetic.altitude_m += 20.0;
    world.tick(20);
    circle(&mut world, 1, 5004, 20.0);
    assert_eq!(ack(&world.sent()), [DENIED, FENCE]);
    // No heartbeat has come of it.
    let mut world = accepting();
    let stranger = Station { port: 9, system: 7 };
    world.sent();
    let sent = ask(
        &mut world,
        stranger,
        MessageWriter::new(MISSION_COUNT).u16(1),
    );
    assert_eq!(ack(&sent), [DENIED, FENCE]);
    // Too many; a waypoint; and a return point, which is left out.
    assert_eq!(ack(&count(&mut world, 5_000)), [4, FENCE]);
    count(&mut world, 1);
    circle(&mut world, 0, 16, 0.0);
    let sent = world.sent();
    assert_eq!(ack(&sent), [3, FENCE]);
    assert!(
        texts(&sent)[0]
            .1
            .contains("item 1: NAV_WAYPOINT (16) is none")
    );
    count(&mut world, 2);
    circle(&mut world, 0, 5000, 0.0);
    circle(&mut world, 1, 5004, 9.0);
    assert!(texts(&world.sent())[0].1.contains("return point"));
    world.serve("");
    assert_eq!(world.put.map(|areas| areas.len()), Some(1));
}

#[test]
fn a_fence_that_the_disk_takes_too_late_is_taken_back_and_so_is_one_that_a_take_off_has_overtaken()
{
    for is_late in [true, false] {
        let mut world = accepting();
        count(&mut world, 1);
        circle(&mut world, 0, 5004, 12.5);
        let task = world.gateway.poll_task();
        assert!(matches!(task, Some(Task::PutFence(_))), "{task:?}");
        world.sent();
        if is_late {
            world.pass(4_100);
            let sent = world.sent();
            assert_eq!(ack(&sent), [1, FENCE]);
            let is_told = |one: &(u8, String)| one.1.contains("the disk does not take it");
            assert!(texts(&sent).iter().any(is_told), "{sent:?}");
            assert_eq!(world.gateway.poll_task(), None, "nothing is written yet");
            // A second upload waits for the disk as well.
            world.heartbeat(QGC);
            world.tick(20);
            count(&mut world, 1);
            circle(&mut world, 0, 5004, 12.5);
            assert_eq!(ack(&world.sent()), [1, FENCE]);
        } else {
            world.telemetry.flying = 1;
            world.tick(20);
        }
        let now = world.now;
        world.gateway.fence_put(Ok(2), now);
        assert_eq!(world.gateway.poll_task(), Some(Task::RestoreFence));
        assert_eq!(world.kinds(), []);
        world.gateway.fence_restored(Ok(()), now);
        assert_eq!(world.kinds(), [OrderKind::ReloadFence]);
    }
}
