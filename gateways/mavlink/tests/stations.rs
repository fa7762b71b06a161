//! Several stations, and a station that is lost.

use std::time::Duration;

use ipc_types::code::{Functionality, LinkState, MavlinkVehicle, Reason, Stage};
use ipc_types::payload::MavlinkStations;
use mavlink_gateway::{Order, OrderKind, Settings, StationLost};

use crate::common::{HERE, QGC, SCRIPT, Sent, Station, World, acks, reposition, request_of, texts};

/// In the air, with two stations.
fn flying(station_lost: StationLost) -> World {
    flying_with(Settings {
        station_lost,
        ..Settings::default()
    })
}

fn flying_with(settings: Settings) -> World {
    let mut world = World::new(settings);
    world.heartbeat(QGC);
    world.heartbeat(SCRIPT);
    world.state.blocked = 0;
    world.telemetry.flying = 1;
    world.tick(20);
    world.sent();
    world
}

fn go_to(world: &mut World, by: Station) -> Order {
    let (x, y) = ((HERE.0 * 1e7) as i32 + 10_000, (HERE.1 * 1e7) as i32);
    world.receive(by, &by.frame(&reposition(0, x, y, 60.0)));
    let order = world.orders()[0];
    assert!(matches!(order.kind, OrderKind::GoTo(_)));
    world.report(&order, Stage::Accepted, Reason::None);
    world.state.functionality = Functionality::FollowingPath.code();
    order
}

/// Seconds pass, in which this station alone says that it is there; the texts of them, each to which port.
fn silence_but_of(world: &mut World, there: Station, seconds: u32) -> Vec<(u16, String)> {
    let mut sent = Vec::new();
    for _ in 0..seconds {
        world.heartbeat(there);
        world.tick(1_000);
        sent.extend(world.sent());
    }
    told(&sent)
}

fn told(sent: &[Sent]) -> Vec<(u16, String)> {
    let of = |port| {
        let own: Vec<_> = sent
            .iter()
            .filter(|one| one.to.port() == port)
            .cloned()
            .collect();
        texts(&own).into_iter().map(move |(_, text)| (port, text))
    };
    of(QGC.port).chain(of(SCRIPT.port)).collect()
}

#[test]
fn the_path_of_a_lost_station_is_what_the_settings_say() {
    for (station_lost, expected, words) in [
        (StationLost::Continue, None, "its movement goes on"),
        (
            StationLost::Hold,
            Some(OrderKind::Hold),
            "the helicopter holds",
        ),
        (
            StationLost::Land,
            Some(OrderKind::Land),
            "the helicopter lands",
        ),
    ] {
        let mut world = flying(station_lost);
        let path = go_to(&mut world, SCRIPT);
        world.sent();
        silence_but_of(&mut world, QGC, 9);
        assert_eq!(world.kinds(), []);
        let told = silence_but_of(&mut world, QGC, 15);
        let orders = world.orders();
        let kinds: Vec<_> = orders.iter().map(|order| order.kind).collect();
        assert_eq!(kinds, Vec::from_iter(expected), "{station_lost:?}");
        let text = (QGC.port, format!("station 245/190 is lost: {words}"));
        assert_eq!(told, [text]);
        for order in orders {
            assert!(order.preempts);
            assert_eq!(order.begin_by, None);
            // Nothing newer is ended.
            assert_eq!(order.after, request_of(&path));
            world.report(&order, Stage::Accepted, Reason::None);
            assert_eq!(acks(&world.sent()), [], "no station waits for it");
        }
    }
}

#[test]
fn the_movement_of_others_and_a_return_go_on() {
    // Of another station.
    let mut world = flying(StationLost::Land);
    go_to(&mut world, QGC);
    silence_but_of(&mut world, QGC, 15);
    assert_eq!(world.kinds(), []);
    // One that is over.
    let mut world = flying(StationLost::Land);
    let path = go_to(&mut world, SCRIPT);
    world.report(&path, Stage::Done, Reason::None);
    silence_but_of(&mut world, QGC, 15);
    assert_eq!(world.kinds(), []);
    // A return.
    let mut world = flying(StationLost::Hold);
    world.telemetry.flying = 0;
    world.tick(20);
    world.telemetry.flying = 1;
    world.tick(20);
    world.command(SCRIPT, 20, [0.0; 7]);
    let path = world.orders()[0];
    world.report(&path, Stage::Accepted, Reason::None);
    silence_but_of(&mut world, QGC, 15);
    assert_eq!(world.kinds(), []);
    world.report(&path, Stage::Done, Reason::None);
    assert_eq!(world.kinds(), [OrderKind::Land]);
}

#[test]
fn a_take_off_of_a_lost_station_ends_in_a_hover_or_a_landing() {
    for (station_lost, expected) in [
        (StationLost::Hold, None),
        (StationLost::Land, Some(OrderKind::Land)),
    ] {
        let mut world = flying(station_lost);
        world.telemetry.flying = 0;
        world.tick(20);
        world.command(SCRIPT, 22, [f32::NAN; 7]);
        let take_off = world.orders()[0];
        world.report(&take_off, Stage::Accepted, Reason::None);
        silence_but_of(&mut world, QGC, 15);
        assert_eq!(world.kinds(), [], "nothing interrupts it");
        world.sent();
        world.report(&take_off, Stage::Done, Reason::None);
        let orders = world.orders();
        let kinds: Vec<_> = orders.iter().map(|order| order.kind).collect();
        assert_eq!(kinds, Vec::from_iter(expected), "{station_lost:?}");
        if let Some(land) = orders.first() {
            assert_eq!(land.issued, world.now);
        }
    }
}

#[test]
fn a_take_off_that_waits_for_its_start_is_not_begun_when_its_station_is_lost() {
    let take_off = OrderKind::TakeOff(10.0);
    for (station_lost, expected) in [
        (StationLost::Continue, vec![take_off]),
        (StationLost::Hold, vec![]),
        (StationLost::Land, vec![]),
    ] {
        let mut world = flying_with(Settings {
            station_lost,
            // The start is awaited longer than the station.
            answer_within: Duration::from_secs(60),
            ..Settings::default()
        });
        world.telemetry.flying = 0;
        world.state.blocked = 1;
        world.tick(20);
        world.command(SCRIPT, 22, [f32::NAN; 7]);
        let start = world.orders()[0];
        assert_eq!(start.kind, OrderKind::Start);
        world.report(&start, Stage::Accepted, Reason::None);
        let told = silence_but_of(&mut world, QGC, 15);
        let is_begun = !expected.is_empty();
        let text = match is_begun {
            true => "its take-off goes on",
            false => "its take-off is not begun",
        };
        assert!(
            told.iter().any(|(_, told)| told.ends_with(text)),
            "{told:?}"
        );
        world.report(&start, Stage::Done, Reason::None);
        assert_eq!(world.kinds(), expected, "{station_lost:?}");
    }
}

#[test]
fn a_station_that_comes_back_is_lost_again_later_and_its_own_port_is_not_told() {
    let mut world = flying(StationLost::Continue);
    let told = silence_but_of(&mut world, QGC, 11);
    let lost = || {
        (
            QGC.port,
            "station 245/190 is lost: it had ordered no movement that is under way".to_owned(),
        )
    };
    assert_eq!(told, [lost()]);
    world.heartbeat(SCRIPT);
    assert_eq!(silence_but_of(&mut world, QGC, 11), [lost()]);
}

/// A path of one station is not replaced by another; a hold and a landing are taken from each, and after the hold all
/// may go on.
#[test]
fn two_stations_share_the_helicopter() {
    let mut world = flying(StationLost::Continue);
    let path = go_to(&mut world, SCRIPT);
    world.tick(20);
    let (x, y) = ((HERE.0 * 1e7) as i32 - 10_000, (HERE.1 * 1e7) as i32);
    let there = reposition(0, x, y, 60.0);
    world.receive(QGC, &QGC.frame(&there));
    let orders = world.orders();
    assert!(!orders[0].preempts, "the bridge will say that it is busy");
    world.report(&orders[0], Stage::Refused, Reason::Busy);
    assert_eq!(acks(&world.sent()).last().expect("one").1, 1);
    // Its owner may.
    world.receive(SCRIPT, &SCRIPT.frame(&there));
    let own = world.orders();
    assert!(own[0].preempts);
    world.report(&path, Stage::Aborted, Reason::Replaced);
    world.report(&own[0], Stage::Accepted, Reason::None);
    // Each may hold.
    world.command(QGC, 193, [0.0; 7]);
    let hold = world.orders();
    assert_eq!((hold[0].kind, hold[0].preempts), (OrderKind::Hold, true));
    world.report(&own[0], Stage::Aborted, Reason::Replaced);
    world.report(&hold[0], Stage::Done, Reason::None);
    world.state.functionality = Functionality::Holding.code();
    world.tick(3_000);
    world.receive(QGC, &QGC.frame(&there));
    assert!(world.orders()[0].preempts, "a hold may be replaced by each");
}

#[test]
fn the_gateway_says_which_stations_there_are_and_what_it_did_not_take() {
    let mut world = flying(StationLost::Continue);
    let path = go_to(&mut world, SCRIPT);
    // A refusal, and what is no frame, no message of ours, and no right checksum.
    world.command(QGC, 400, [0.0; 7]);
    let mut unknown = QGC.frame(&reposition(0, 1, 1, 1.0));
    unknown[8] = 99;
    let mut wrong = QGC.frame(&reposition(0, 1, 1, 1.0));
    wrong[12] ^= 1;
    for bytes in [vec![0x55; 9], unknown, wrong] {
        world.receive(QGC, &bytes);
    }
    let mut sample = MavlinkStations {
        sequence: 7,
        ..MavlinkStations::default()
    };
    world.gateway.describe(&mut sample, world.now);
    assert_eq!(sample.sequence, 7, "that is the publisher's");
    assert!(sample.is_heard() && sample.frames_read > 3 && sample.datagrams_sent > 3);
    assert_eq!(
        [
            sample.refused_unreadable,
            sample.refused_unknown,
            sample.refused_checksum,
            sample.refused_full
        ],
        [1, 1, 1, 0]
    );
    let [qgc, script] = sample.stations() else {
        panic!("{:?}", sample.stations())
    };
    assert_eq!(qgc.address(), Some("127.0.0.1:14550"));
    assert_eq!((qgc.refused, qgc.commands, qgc.has_movement), (1, 0, 0));
    assert_eq!((script.commands, script.has_movement), (1, 1));
    assert_eq!(script.last_command(), Some(path.issued));
    world.report(&path, Stage::Done, Reason::None);
    silence_but_of(&mut world, QGC, 11);
    world.state.link.state = LinkState::Silent.code();
    world.tick(20);
    world.gateway.describe(&mut sample, world.now);
    assert_eq!(sample.vehicle(), Some(MavlinkVehicle::LinkDown));
    assert_eq!(sample.since_ns, world.now.0);
    let script = sample.stations()[1];
    assert_eq!((script.is_lost, script.has_movement), (1, 0));
}

#[test]
fn commands_of_strangers_fill_no_log() {
    let mut world = World::new(Settings {
        commanders: vec![QGC.system],
        ..Settings::default()
    });
    world.heartbeat(SCRIPT);
    world.sent();
    while world.gateway.poll_event().is_some() {}
    let mut lines = Vec::new();
    for number in 0..1_000 {
        let stranger = Station {
            port: 1_000 + number,
            system: 77,
        };
        // One that may not, and one that was never heard.
        world.command(SCRIPT, 22, [0.0; 7]);
        world.command(stranger, 22, [0.0; 7]);
        assert_eq!(acks(&world.sent()).len(), 2, "each is answered");
        world.tick(10);
        world.sent();
        lines.extend(std::iter::from_fn(|| world.gateway.poll_event()));
    }
    // Two reasons, at once and after five seconds.
    assert_eq!(lines.len(), 4, "{lines:?}");
}
