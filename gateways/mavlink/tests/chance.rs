//! Any bytes: nothing panics, nothing is ordered without a station, and what is sent is bounded. Any order of arrival:
//! n copies of a command are one request.

use fastrand::Rng;
use ipc_types::code::{Reason, Stage};
use mavlink_gateway::message::{self, MessageKind};
use mavlink_gateway::wire::{MAX_FRAME, MessageWriter};
use mavlink_gateway::{Order, OrderKind, Settings};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::common::{QGC, SCRIPT, Station, World, acks, long, reposition};
use crate::{mission_file, script};

/// A message of any kind, with any content.
fn any_message() -> impl Strategy<Value = Vec<u8>> {
    let fields = vec(
        prop_oneof![Just(0_u8), Just(1), Just(0xff), any::<u8>()],
        0..60,
    );
    let kind = prop::sample::select(message::ALL.to_vec());
    // Nothing but a heartbeat makes a station.
    let kind = kind.prop_filter("no heartbeat", |kind: &MessageKind| {
        *kind != message::HEARTBEAT
    });
    (kind, fields).prop_map(|(kind, fields)| {
        let message = fields
            .iter()
            .fold(MessageWriter::new(kind), |message, byte| message.u8(*byte));
        message.frame(0, 255, 190)
    })
}

/// Whole messages, changed ones, and anything.
fn datagram() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        4 => any_message(),
        1 => (any_message(), any_message()).prop_map(|(a, b)| [a, b].concat()),
        2 => (any_message(), any::<prop::sample::Index>(), any::<u8>()).prop_map(|(mut bytes, at, to)| {
            let at = at.index(bytes.len());
            bytes[at] = to;
            bytes
        }),
        1 => vec(any::<u8>(), 0..300),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_make_a_panic_or_a_request_without_a_station(
        datagrams in vec((datagram(), 0..400_u64, 0..4_u16), 1..80),
        is_flying: bool,
    ) {
        let mut world = if is_flying { World::flying() } else { World::with_station() };
        for (bytes, ms, port) in datagrams {
            // Another address than that of the station which is there.
            world.receive(Station { port: 1_000 + port, ..QGC }, &bytes);
            prop_assert_eq!(world.kinds(), vec![]);
            if ms % 3 == 0 {
                world.tick(ms);
            }
            for sent in world.sent() {
                prop_assert!(sent.payload.len() < MAX_FRAME);
            }
            let deadline = world.gateway.deadline();
            prop_assert!(deadline.is_none_or(|deadline| deadline > world.now));
            while world.gateway.poll_event().is_some() {}
        }
    }

    #[test]
    fn no_bytes_of_a_station_make_a_panic_or_more_orders_than_the_bridge_takes(
        datagrams in vec(datagram(), 1..200),
    ) {
        let mut world = World::flying();
        let mut orders = 0;
        for bytes in datagrams {
            world.receive(QGC, &bytes);
            orders += world.kinds().len();
            world.sent();
        }
        // None has a report, so none is over.
        prop_assert!(orders <= 8, "{orders}");
    }
}

/// What will happen, and when, ms.
enum Arrival {
    Copy(usize),
    Report(Order, Stage),
}

/// One random sequence: some commands to fly to a place or at a speed, each sent up to four times within 1.5 s, over a
/// line that loses, doubles and reorders, to a bridge that takes its time.
fn sequence(seed: u64) {
    let mut rng = Rng::with_seed(seed);
    let mut world = World::flying();
    world.heartbeat(SCRIPT);
    world.sent();
    // At most one of each kind for each station: what else of its kind comes in between makes a copy another command.
    let mut commands: Vec<(Station, MessageWriter)> = Vec::new();
    for (number, station) in [QGC, QGC, SCRIPT, SCRIPT].into_iter().enumerate() {
        let message = match number % 2 {
            0 => reposition(6, 374_200_000 + number as i32, -60_010_000, 30.0),
            _ => long(178, [1.0, 1.0 + number as f32, 0.0, 0.0, 0.0, 0.0, 0.0]),
        };
        if rng.bool() {
            commands.push((station, message));
        }
    }
    let count = commands.len();
    let mut arrivals: Vec<(u64, Arrival)> = Vec::new();
    let mut arrived = vec![false; count];
    for (index, has_arrived) in arrived.iter_mut().enumerate() {
        let begin = rng.u64(0..1_000);
        for copy in 0..rng.u64(1..=4) {
            for _ in 0..*rng.choice(&[0, 1, 1, 2]).unwrap_or(&1) {
                // The last one comes within the memory of an answer to the first.
                let at = begin + 500 * copy + rng.u64(0..900);
                arrivals.push((at, Arrival::Copy(index)));
                *has_arrived = true;
            }
        }
    }
    let begin = world.now;
    let mut ordered = 0;
    let mut answered = Vec::new();
    while !arrivals.is_empty() {
        let next = (0..arrivals.len())
            .min_by_key(|index| arrivals[*index].0)
            .unwrap_or(0);
        let (at, arrival) = arrivals.swap_remove(next);
        let passed = world.now.since(begin).as_millis() as u64;
        world.tick(at.saturating_sub(passed));
        match arrival {
            Arrival::Copy(index) => {
                let (station, message) = &commands[index];
                world.receive(*station, &station.frame(message));
            }
            Arrival::Report(order, stage) => world.report(&order, stage, Reason::None),
        }
        for order in world.orders() {
            ordered += 1;
            let mut at = at;
            let stages = match rng.bool() {
                true => &[Stage::Accepted, Stage::Progress, Stage::Done][..],
                false => &[Stage::Refused][..],
            };
            for stage in stages {
                at += rng.u64(0..700);
                arrivals.push((at, Arrival::Report(order, *stage)));
            }
        }
        answered.extend(acks(&world.sent()));
    }
    let expected = arrived.iter().filter(|one| **one).count();
    // Another station's copy of the same kind may come in between: then it is refused, and never carried out twice.
    assert_eq!(ordered, expected, "seed {seed}");
    assert!(answered.len() >= expected, "seed {seed}: {answered:?}");
}

/// `RIL_SEQUENCES=100000 cargo test -p mavlink-gateway copies` plays more, in about a minute.
#[test]
fn n_copies_of_a_command_are_one_request() {
    let most = std::env::var("RIL_SEQUENCES")
        .ok()
        .and_then(|text| text.parse().ok());
    for seed in 0..most.unwrap_or(3_000) {
        sequence(seed);
    }
}

#[test]
fn a_flood_of_a_station_s_frames_leaves_room_for_a_hold() {
    let mut world = World::new(Settings::default());
    world.heartbeat(QGC);
    world.tick(20);
    let mut rng = Rng::with_seed(1);
    for number in 0..10_000 {
        let (x, y) = (rng.i32(..), rng.i32(..));
        world.receive(QGC, &QGC.frame(&reposition(rng.u8(..), x, y, rng.f32())));
        if number % 100 == 0 {
            world.tick(1);
        }
        world.sent();
    }
    world.orders();
    world.receive(
        QGC,
        &QGC.frame(&reposition(0, i32::MAX, i32::MAX, f32::NAN)),
    );
    assert_eq!(world.kinds(), [OrderKind::Hold]);
}

/// What the fuzzer begins with.
const CORPUS: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../workbench/fuzz/corpus/mavlink"
);

#[test]
fn the_corpus_of_the_fuzz_target_passes() {
    let mut count = 0;
    for entry in std::fs::read_dir(CORPUS).expect("the corpus") {
        script::play(&std::fs::read(entry.expect("a file").path()).expect("its bytes"));
        count += 1;
    }
    assert!(count >= 5, "{count} files are no corpus");
}

/// Items whose numbers are of the kinds that plans have, in the middle of a flight.
#[test]
fn any_items_are_a_mission_that_is_checked() {
    let mut rng = Rng::with_seed(3);
    for _ in 0..500 {
        let mut bytes = Vec::new();
        for _ in 0..rng.usize(0..12) {
            for _ in 0..4 {
                bytes.extend(
                    rng.choice(&[0.0, 1.0, -1.0, 5.5, f32::NAN, 1e30])
                        .unwrap_or(&0.0)
                        .to_le_bytes(),
                );
            }
            for degrees in [37.411, -6.001] {
                let near = (degrees * 1e7) as i32 + rng.i32(-5_000..5_000);
                bytes.extend(
                    rng.choice(&[near, near, 0, i32::MAX])
                        .unwrap_or(&0)
                        .to_le_bytes(),
                );
            }
            bytes.extend(
                rng.choice(&[0.0, 15.0, 400.0, f32::INFINITY])
                    .unwrap_or(&0.0)
                    .to_le_bytes(),
            );
            bytes.extend(
                rng.choice(&[16_u16, 17, 19, 20, 21, 22, 93, 178, 206])
                    .unwrap_or(&16)
                    .to_le_bytes(),
            );
            bytes.extend([*rng.choice(&[0, 2, 3, 6, 10]).unwrap_or(&3), 0, 1]);
        }
        mission_file::check(&bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_a_mission_that_is_checked_or_none(data in vec(any::<u8>(), 0..400)) {
        mission_file::check(&data);
    }

    #[test]
    fn any_script_leaves_the_gateway_bounded(data in vec(any::<u8>(), 0..1500)) {
        script::play(&data);
    }
}
