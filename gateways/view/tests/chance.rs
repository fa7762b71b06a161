//! Any bytes in any pieces: nothing panics, nothing is ordered, and no more waits than may.

use proptest::collection::vec;
use proptest::prelude::*;
use serde_json::json;
use view::{Event, MAX_TEXTS};

use crate::common::{Client, SECRET, World, frame, open, order, own, settings, text, upgrade};

/// Bytes that a client might send: whole messages, parts of them, and anything.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    let message = prop_oneof![
        Just(open(None, None)),
        Just(open(Some(SECRET), Some(2))),
        Just(json!({"type": "seen", "n": u64::MAX})),
        Just(json!({"type": "hidden", "hidden": true})),
        Just(json!({"type": "lease", "robot": 1, "action": "take"})),
        Just(json!({"type": "replay", "action": "seek", "position_s": 1e300, "speed": -1.0})),
        Just(json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]})),
        Just(json!({"op": "getParameters", "parameterNames": []})),
        Just(json!({"op": "setParameters", "parameters": [{"name": "/p", "value": [1]}]})),
    ];
    let whole = prop_oneof![
        Just(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n".to_vec()),
        Just(upgrade("/", "hero.view.v1", "")),
        Just(upgrade("/", "foxglove.sdk.v1", "")),
        message.prop_map(|message| text(&message)),
        vec(any::<u8>(), 0..40).prop_map(|bytes| frame(0x82, &bytes)),
        (any::<u8>(), vec(any::<u8>(), 0..20)).prop_map(|(first, bytes)| frame(first, &bytes)),
    ];
    prop_oneof![
        4 => whole.clone(),
        2 => (whole, any::<prop::sample::Index>()).prop_map(|(mut bytes, at)| {
            bytes.truncate(at.index(bytes.len() + 1));
            bytes
        }),
        1 => vec(any::<u8>(), 0..200),
    ]
}

/// Does one thing with one of the clients.
fn act(world: &mut World, clients: &mut Vec<Client>, what: u8, bytes: &[u8], ms: u64) {
    let index = usize::from(what) % clients.len();
    match what % 8 {
        0 => {
            let gone = clients.swap_remove(index);
            world.server.closed(gone.id, world.now);
            clients.push(world.connect(own()));
        }
        1 => world.pass_ms(ms),
        2 => _ = world.write(&mut clients[index], usize::from(what) * 50),
        3 => _ = world.frames(&mut clients[index]),
        _ => world.send(&clients[index], bytes),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn nothing_panics_and_nothing_is_ordered(acts in vec((any::<u8>(), piece(), 0..4000_u64), 1..120)) {
        let mut world = World::new(settings());
        let channel = view::Channel {
            topic: "/a".into(),
            encoding: "cdr".into(),
            schema_name: "T".into(),
            schema_encoding: "ros2msg".into(),
            schema: "".into(),
        };
        let channel = world.server.channel(channel).unwrap();
        let mut clients: Vec<Client> = (0..3).map(|_| world.connect(own())).collect();
        for (n, (what, bytes, ms)) in acts.iter().enumerate() {
            act(&mut world, &mut clients, *what, bytes, *ms);
            world.say_now(1, n as u64);
            world.server.sample(channel, n as u64, vec![0; 100]);
            for event in world.events() {
                // None of the pieces is an order, and only chance could make one.
                prop_assert!(!matches!(event, Event::Order { .. }), "{event:?}");
            }
            let deadline = world.server.deadline();
            prop_assert!(deadline.is_none_or(|deadline| deadline > world.now), "{deadline:?} at {:?}", world.now);
        }
        for client in clients {
            world.server.closed(client.id, world.now);
        }
        prop_assert!(!world.server.has_viewers());
        prop_assert_eq!(world.server.deadline(), None);
    }

    #[test]
    fn a_conversation_means_the_same_in_any_pieces(cuts in vec(1..60_usize, 1..40)) {
        let mut bytes = upgrade("/", "hero.view.v1", "Origin: http://localhost:8765\r\n");
        bytes.extend(text(&open(Some(SECRET), Some(1))));
        bytes.extend(frame(0x89, b"ping"));
        bytes.extend(text(&json!({"type": "lease", "robot": 1, "action": "take"})));
        bytes.extend(text(&order("a", "land", 0)));
        bytes.extend(text(&order("b", "goto", 0)));
        bytes.extend(frame(0x88, b"\x03\xe8"));
        let talk = |cuts: &mut dyn Iterator<Item = usize>| {
            let mut world = World::new(settings());
            let mut client = world.connect(own());
            let mut rest = &bytes[..];
            while !rest.is_empty() {
                let (piece, behind) = rest.split_at(cuts.next().unwrap_or(rest.len()).min(rest.len()));
                world.send(&client, piece);
                rest = behind;
            }
            let events = world.events();
            (events, world.answer(&mut client))
        };
        let whole = talk(&mut std::iter::empty());
        prop_assert_eq!(whole.0.iter().filter(|event| matches!(event, Event::Order { .. })).count(), 1);
        prop_assert_eq!(talk(&mut cuts.into_iter()), whole);
    }

    #[test]
    fn a_client_that_reads_nothing_makes_no_memory_grow(pings in 1..40_usize) {
        let mut world = World::new(settings());
        let mut page = world.page(Some(SECRET), 1);
        world.messages(&mut page);
        for _ in 0..2 * MAX_TEXTS {
            for _ in 0..pings {
                world.send(&page, &frame(0x89, &[0; 125]));
            }
            world.say_now(1, 1);
            world.pass_ms(1000);
            if world.server.is_ended(page.id) {
                break;
            }
        }
        let waits = world.server.output(page.id).len();
        prop_assert!(waits <= (256 << 10) + 200, "{waits}");
    }
}
