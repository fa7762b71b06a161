//! Stations that sign, and those that do not.

use std::net::SocketAddr;

use ipc_types::MonotonicNs;
use ipc_types::code::ModuleStatus;
use ipc_types::payload::MavlinkStations;
use mavlink_gateway::message::HEARTBEAT;
use mavlink_gateway::wire::{MessageWriter, frames};
use mavlink_gateway::{OrderKind, Settings, Signing, SigningKey};

use crate::common::{QGC, World, acks, long};

const CLOCK: u64 = 1_000_000_000;

/// A station on another machine.
fn away() -> SocketAddr {
    ([10, 0, 0, 7], 14_550).into()
}

fn signing(key: &str, now: MonotonicNs) -> Signing {
    Signing::new(SigningKey::of(key), CLOCK, 0, now)
}

fn signed_world(settings: Settings) -> World {
    let mut world = World::new(settings);
    world.gateway = world.gateway.signing(signing("secret", world.now));
    world.tick(20);
    world.state.blocked = 0;
    world.state.status = ModuleStatus::Running.code();
    world.telemetry.flying = 1;
    world.tick(20);
    world
}

fn heartbeat() -> MessageWriter {
    MessageWriter::new(HEARTBEAT)
        .u32(0)
        .u8(6)
        .u8(8)
        .u8(0)
        .u8(4)
        .u8(3)
}

fn hold() -> MessageWriter {
    long(193, [0.0; 7])
}

fn send(world: &mut World, from: SocketAddr, bytes: &[u8]) {
    world.gateway.datagram(from, bytes, world.now, world.now);
    world.gateway.advance(world.now);
}

fn signed(station: &mut Signing, message: &MessageWriter, now: MonotonicNs) -> Vec<u8> {
    let mut frame = message.frame_to_sign(0, QGC.system, 190);
    station.sign(&mut frame, now);
    frame
}

/// Unsigned, of another key, replayed.
fn refused(world: &World) -> [u64; 3] {
    let mut sample = MavlinkStations::default();
    world.gateway.describe(&mut sample, world.now);
    assert_eq!(sample.is_signed, 1);
    [
        sample.refused_unsigned,
        sample.refused_signature,
        sample.refused_replayed,
    ]
}

#[test]
fn another_machine_s_frames_are_taken_with_a_signature_once() {
    let mut world = signed_world(Settings::default());
    let mut station = signing("secret", world.now);
    // Without one, and with that of another key.
    let unsigned = heartbeat().frame(0, QGC.system, 190);
    let forged = signed(&mut signing("other", world.now), &heartbeat(), world.now);
    for bytes in [unsigned, forged] {
        send(&mut world, away(), &bytes);
    }
    assert_eq!(refused(&world), [1, 1, 0]);
    world.tick(1_000);
    assert_eq!(world.sent(), [], "it is no station");
    let frame = signed(&mut station, &heartbeat(), world.now);
    send(&mut world, away(), &frame);
    world.tick(20);
    assert!(!world.sent().is_empty(), "it is one");
    // A command that somebody else sends again later is not carried out.
    let command = signed(&mut station, &hold(), world.now);
    send(&mut world, away(), &command);
    assert_eq!(world.kinds(), [OrderKind::Hold]);
    world.tick(5_000);
    world.sent();
    for _ in 0..3 {
        send(&mut world, away(), &command);
    }
    assert_eq!((world.kinds(), acks(&world.sent())), (vec![], vec![]));
    assert_eq!(refused(&world), [1, 1, 3]);
}

#[test]
fn what_is_sent_is_signed_with_rising_timestamps_for_each_station() {
    let mut world = signed_world(Settings::default());
    let mut stations: Vec<_> = (1..=2)
        .map(|port| (([10, 0, 0, 7], port).into(), 0_u64))
        .collect();
    let mut own = signing("secret", world.now);
    for (system, (address, _)) in (1_u8..).zip(&stations) {
        let mut frame = heartbeat().frame_to_sign(0, 100 + system, 190);
        own.sign(&mut frame, world.now);
        let address: SocketAddr = *address;
        send(&mut world, address, &frame);
    }
    let mut judge = signing("secret", world.now);
    let mut count = 0;
    for _ in 0..100 {
        world.tick(20);
        while let Some(datagram) = world.gateway.poll_datagram() {
            let frame = frames(&datagram.bytes).next().unwrap().unwrap();
            let signature = frame.signature.expect("all are signed");
            assert_eq!(judge.check((1, 1), &signature, world.now), Ok(()));
            let known = stations.iter_mut().find(|one| one.0 == datagram.to);
            let (_, newest) = known.expect("a station");
            assert!(signature.timestamp > *newest);
            *newest = signature.timestamp;
            count += 1;
        }
    }
    assert!(count > 50, "{count}");
    assert!(world.gateway.poll_timestamp().is_some());
    assert_eq!(world.gateway.poll_timestamp(), None, "a minute ahead");
}

#[test]
fn a_station_on_this_machine_need_not_sign_and_its_wrong_signature_is_none() {
    let mut world = signed_world(Settings::default());
    world.heartbeat(QGC);
    world.command(QGC, 193, [0.0; 7]);
    assert_eq!(world.kinds(), [OrderKind::Hold]);
    let forged = signed(&mut signing("other", world.now), &hold(), world.now);
    send(&mut world, QGC.address(), &forged);
    assert_eq!(world.kinds(), []);
    assert_eq!(refused(&world), [0, 1, 0]);
}

#[test]
fn without_signatures_another_machine_watches_and_commands_only_if_it_is_named() {
    for (commanders, expected) in [(vec![], 2), (vec![QGC.system], 0)] {
        let mut world = World::new(Settings {
            is_insecure: true,
            commanders,
            ..Settings::default()
        });
        world.state.blocked = 0;
        world.telemetry.flying = 1;
        world.tick(20);
        let frame = |message: MessageWriter| message.frame(0, QGC.system, 190);
        send(&mut world, away(), &frame(heartbeat()));
        world.tick(20);
        assert!(!world.sent().is_empty(), "it watches");
        send(&mut world, away(), &frame(hold()));
        for order in world.orders() {
            world.report(
                &order,
                ipc_types::code::Stage::Accepted,
                ipc_types::code::Reason::None,
            );
        }
        let answered: Vec<_> = acks(&world.sent()).iter().map(|ack| ack.1).collect();
        assert_eq!(answered, [expected]);
    }
    // Not even that without `insecure`.
    let mut world = World::new(Settings::default());
    send(&mut world, away(), &heartbeat().frame(0, QGC.system, 190));
    world.tick(1_000);
    assert_eq!(world.sent(), []);
}

#[test]
fn frames_of_before_a_restart_are_not_carried_out_from_another_address_and_their_station_goes_on() {
    let mut before = signed_world(Settings::default());
    let mut station = signing("secret", before.now);
    let recorded = [heartbeat(), hold()].map(|message| signed(&mut station, &message, before.now));
    for frame in &recorded {
        send(&mut before, away(), frame);
    }
    assert_eq!(before.kinds(), [OrderKind::Hold]);
    let kept = before.gateway.poll_timestamp().expect("it is kept");

    let mut world = World::flying();
    let again = Signing::new(SigningKey::of("secret"), CLOCK, kept, world.now);
    world.gateway = mavlink_gateway::Gateway::new(Settings::default(), 1).signing(again);
    world.tick(20);
    let other: SocketAddr = ([10, 0, 0, 9], 14_550).into();
    for frame in &recorded {
        send(&mut world, other, frame);
    }
    assert_eq!(world.kinds(), []);
    assert_eq!(refused(&world), [0, 0, 2]);
    // The station itself is told, takes over our timestamp, and is there.
    let late = signed(&mut station, &heartbeat(), world.now);
    world.tick(1_000);
    send(&mut world, away(), &late);
    let mut told = 0;
    while let Some(datagram) = world.gateway.poll_datagram() {
        for frame in frames(&datagram.bytes).flatten() {
            let signature = frame.signature.expect("all are signed");
            if datagram.to == away() {
                assert_eq!(station.check((1, 1), &signature, world.now), Ok(()));
                told += 1;
            }
        }
    }
    assert!(told > 0);
    for message in [heartbeat(), hold()] {
        let frame = signed(&mut station, &message, world.now);
        send(&mut world, away(), &frame);
    }
    assert_eq!(world.kinds(), [OrderKind::Hold]);
}
