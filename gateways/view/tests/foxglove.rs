//! Foxglove clients: channels, samples and time; and that they order nothing.

use std::sync::Arc;

use serde_json::{Value, json};
use view::page::{ReplayAction, ReplayInfo, ReplayStatus};
use view::{Channel, ChannelId, Event, Settings};

use crate::common::{
    BINARY, CLOSE, Client, SECRET, TEXT, WATCH, World, frame, own, peer, replay, settings, upgrade,
};

fn world() -> World {
    World::new(settings())
}

fn client(world: &mut World, token: Option<&str>) -> Client {
    let path = token.map_or("/".to_owned(), |token| format!("/?token={token}"));
    world.viewer(own(), &path, "foxglove.sdk.v1")
}

fn channel(topic: &str) -> Channel {
    Channel {
        topic: topic.into(),
        encoding: "cdr".into(),
        schema_name: "hero/msg/T".into(),
        schema_encoding: "ros2msg".into(),
        schema: Arc::from("uint8 x"),
    }
}

/// The operations of the JSON messages that have come.
fn operations(world: &mut World, client: &mut Client) -> Vec<String> {
    let messages = world.messages(client);
    messages
        .iter()
        .map(|one| one["op"].as_str().unwrap().to_owned())
        .collect()
}

/// The binary messages that have come.
fn binaries(world: &mut World, client: &mut Client) -> Vec<Vec<u8>> {
    let frames = world.frames(client).into_iter();
    frames
        .filter(|(opcode, _)| *opcode == BINARY)
        .map(|(_, payload)| payload)
        .collect()
}

fn subscribe(world: &mut World, client: &Client, id: u32, channel: u32) {
    world.say(
        client,
        &json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": channel}]}),
    );
}

/// A sample as the protocol has it.
fn data(subscription: u32, time: u64, bytes: &[u8]) -> Vec<u8> {
    let mut data = vec![1];
    data.extend(subscription.to_le_bytes());
    data.extend(time.to_le_bytes());
    data.extend(bytes);
    data
}

fn number(world: &mut World, client: &mut Client, topic: &str) -> u32 {
    let messages = world.messages(client);
    let channels = messages
        .iter()
        .filter_map(|one| one["channels"].as_array())
        .flatten();
    let found = channels
        .into_iter()
        .find(|one| one["topic"] == topic)
        .expect("the topic");
    found["id"].as_u64().unwrap() as u32
}

#[test]
fn a_client_is_told_what_there_is() {
    let mut world = world();
    let mut none = client(&mut world, None);
    let messages = world.messages(&mut none);
    let info = json!({"op": "serverInfo", "name": "HERO RIL", "capabilities": ["time", "assets"], "sessionId": "life"});
    assert_eq!(messages, [info, json!({"op": "advertise", "channels": []})]);
    let id = world.server.channel(channel("/robot1/pose")).unwrap();
    let expected = json!({"op": "advertise", "channels": [{"id": 1, "topic": "/robot1/pose", "encoding": "cdr",
        "schemaName": "hero/msg/T", "schema": "uint8 x", "schemaEncoding": "ros2msg"}]});
    assert_eq!(world.messages(&mut none), [expected]);
    world.server.withdraw(id);
    assert_eq!(
        world.messages(&mut none),
        [json!({"op": "unadvertise", "channelIds": [1]})]
    );
    // Many come some at a time.
    for index in 0..20 {
        world.server.channel(channel(&format!("/{index}")));
    }
    let mut late = client(&mut world, None);
    assert_eq!(
        operations(&mut world, &mut late),
        ["serverInfo", "advertise", "advertise", "advertise"]
    );
    assert_eq!(
        operations(&mut world, &mut none),
        ["advertise", "advertise", "advertise"]
    );
    assert!(world.messages(&mut none).is_empty());
}

/// A replay of ten seconds whose time is known.
fn in_2023(settings: Settings) -> Settings {
    Settings {
        replay: Some(ReplayInfo {
            start_unix_ms: Some(1_700_000_000_000),
            ..replay()
        }),
        ..settings
    }
}

/// What a client wants of the recording.
fn control(command: u8, speed: f32, seek_ns: Option<u64>, id: &str) -> Vec<u8> {
    let mut bytes = vec![3, command];
    bytes.extend(speed.to_le_bytes());
    bytes.push(u8::from(seek_ns.is_some()));
    bytes.extend(seek_ns.unwrap_or(0).to_le_bytes());
    bytes.extend((id.len() as u32).to_le_bytes());
    bytes.extend(id.as_bytes());
    bytes
}

#[test]
fn a_recording_is_played_by_foxgloves_controls() {
    let mut world = World::new(in_2023(settings()));
    let mut one = client(&mut world, None);
    let mut other = client(&mut world, None);
    let info = &world.messages(&mut one)[0];
    assert_eq!(
        info["dataStartTime"],
        json!({"sec": 1_700_000_000, "nsec": 0})
    );
    assert_eq!(
        info["dataEndTime"],
        json!({"sec": 1_700_000_010, "nsec": 0})
    );
    world.messages(&mut other);
    let state = |position_s, playing, speed| ReplayStatus {
        position_s,
        playing,
        speed,
    };
    // Those that have not used the controls get no message that they may not know.
    world.server.replay(&state(1.0, true, 1.0));
    assert!(world.frames(&mut one).is_empty());

    let wanted = control(0, 2.0, Some(1_700_000_004_500_000_000), "r1");
    world.send(&one, &frame(0x82, &wanted));
    let requests: Vec<_> = world
        .events()
        .into_iter()
        .filter_map(|event| match event {
            Event::Replay { request, .. } => {
                Some((request.action, request.position_s, request.speed))
            }
            _ => None,
        })
        .collect();
    let expected = [
        (ReplayAction::Seek, Some(4.5), None),
        (ReplayAction::Speed, None, Some(2.0)),
        (ReplayAction::Play, None, None),
    ];
    assert_eq!(requests, expected);
    let answer = |status: u8, ns: u64, speed: f32, did_seek: u8, id: &str| {
        let mut bytes = vec![5, status];
        bytes.extend((1_700_000_000_000_000_000 + ns).to_le_bytes());
        bytes.extend(speed.to_le_bytes());
        bytes.push(did_seek);
        bytes.extend((id.len() as u32).to_le_bytes());
        bytes.extend(id.as_bytes());
        bytes
    };
    for (replay, expected) in [
        (
            state(4.5, true, 2.0),
            answer(0, 4_500_000_000, 2.0, 1, "r1"),
        ),
        // What another viewer does has no number.
        (state(5.5, false, 2.0), answer(1, 5_500_000_000, 2.0, 0, "")),
        (
            state(10.0, false, 0.5),
            answer(3, 10_000_000_000, 0.5, 0, ""),
        ),
    ] {
        world.server.replay(&replay);
        assert_eq!(binaries(&mut world, &mut one), [expected]);
    }
    assert!(world.frames(&mut other).is_empty());
    world.send(&other, &frame(0x82, &control(7, 1.0, None, "")));
    assert_eq!(world.close_code(&mut other), Some(1007));
}

#[test]
fn all_clients_can_the_same_and_others_need_a_token() {
    let recorded = Settings {
        replay: Some(replay()),
        ..settings()
    };
    for (settings, expected) in [
        (settings(), json!(["time", "assets"])),
        (recorded, json!(["time", "assets"])),
        (
            in_2023(settings()),
            json!(["time", "assets", "playbackControl"]),
        ),
    ] {
        for token in [None, Some(WATCH), Some(SECRET)] {
            let mut world = World::new(settings.clone());
            let mut one = client(&mut world, token);
            assert_eq!(world.messages(&mut one)[0]["capabilities"], expected);
        }
    }
    // Others need a token to look at all.
    for (token, status) in [
        ("", "401"),
        ("?token=wrong", "401"),
        ("?token=fedcba9876543210fedcba9876543210", "101"),
    ] {
        let mut world = world();
        let mut one = world.connect(peer("127.0.0.1:5", false));
        world.send(
            &one,
            &upgrade(&format!("/{token}"), "foxglove.websocket.v1", ""),
        );
        let answer = world.answer(&mut one);
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status} ")),
            "{token}: {answer}"
        );
    }
}

#[test]
fn samples_come_to_those_who_have_subscribed() {
    let mut world = world();
    let (a, b) = (
        world.server.channel(channel("/a")).unwrap(),
        world.server.channel(channel("/b")).unwrap(),
    );
    world.server.sample(a, 1, *b"old");
    let (mut one, mut two) = (client(&mut world, None), client(&mut world, None));
    let number_a = number(&mut world, &mut one, "/a");
    world.frames(&mut two);
    subscribe(&mut world, &one, 7, number_a);
    assert_eq!(world.events(), [Event::Subscribed(a)]);
    assert!(world.server.is_subscribed(a) && !world.server.is_subscribed(b));
    // The newest there is, at once; then all, after their time.
    assert_eq!(binaries(&mut world, &mut one), [data(7, 1, b"old")]);
    world.server.time(2);
    world.server.sample(a, 2, *b"x");
    world.server.sample(b, 2, *b"y");
    world.server.sample(a, 3, *b"z");
    let time = b"\x02\x02\0\0\0\0\0\0\0".to_vec();
    assert_eq!(
        binaries(&mut world, &mut one),
        [time.clone(), data(7, 2, b"x"), data(7, 3, b"z")]
    );
    assert_eq!(binaries(&mut world, &mut two), [time]);
    // Twice the same number, or the same channel twice, is nothing; nor is a channel that is not there.
    subscribe(&mut world, &one, 7, number_a + 1);
    subscribe(&mut world, &one, 8, number_a);
    subscribe(&mut world, &one, 9, 999);
    subscribe(&mut world, &two, 7, number_a);
    assert!(world.events().is_empty());
    world.server.closed(two.id, world.now);
    assert!(world.events().is_empty());
    world.say(
        &one,
        &json!({"op": "unsubscribe", "subscriptionIds": [7, 7, 8]}),
    );
    assert!(!world.server.is_subscribed(a));
    world.server.sample(a, 4, *b"w");
    assert!(binaries(&mut world, &mut one).is_empty());
    subscribe(&mut world, &one, 7, number_a);
    world.server.closed(one.id, world.now);
    assert_eq!(world.events(), [Event::Subscribed(a)]);
    assert!(!world.server.is_subscribed(a));
    // What was the newest when the last one went is old by now.
    let mut late = client(&mut world, None);
    world.frames(&mut late);
    subscribe(&mut world, &late, 7, number_a);
    assert!(binaries(&mut world, &mut late).is_empty());
}

#[test]
fn a_channel_that_comes_back_keeps_its_number_and_needs_a_new_subscription() {
    let mut world = world();
    let a = world.server.channel(channel("/a")).unwrap();
    let mut one = client(&mut world, None);
    let number_a = number(&mut world, &mut one, "/a");
    subscribe(&mut world, &one, 1, number_a);
    world.server.withdraw(a);
    assert_eq!(operations(&mut world, &mut one), ["unadvertise"]);
    world.server.sample(a, 1, *b"x");
    assert_eq!(world.server.channel(channel("/a")), Some(a));
    world.server.sample(a, 2, *b"y");
    assert_eq!(number(&mut world, &mut one, "/a"), number_a);
    subscribe(&mut world, &one, 1, number_a);
    assert_eq!(binaries(&mut world, &mut one), [data(1, 2, b"y")]);
}

#[test]
fn a_slow_client_gets_the_newest_of_each_channel_and_others_lose_nothing() {
    let mut world = world();
    let channels: Vec<ChannelId> = (0..4)
        .map(|index| world.server.channel(channel(&format!("/{index}"))).unwrap())
        .collect();
    let (mut slow, mut good) = (client(&mut world, None), client(&mut world, None));
    for one in [&mut slow, &mut good] {
        world.frames(one);
        for index in 1..=4 {
            subscribe(&mut world, one, index, index);
        }
    }
    // 50 Hz of each, for two seconds; the kernel takes nothing of the slow one's bytes.
    let mut got = 0;
    for number in 1..=100_u64 {
        for channel in &channels {
            world.server.sample(*channel, number, vec![0; 1000]);
        }
        got += binaries(&mut world, &mut good).len();
        world.write(&mut slow, 0);
        world.pass_ms(20);
    }
    assert_eq!(got, 400);
    let frames = world.frames(&mut slow);
    let (late, told): (Vec<_>, Vec<_>) = frames
        .into_iter()
        .partition(|(opcode, _)| *opcode == BINARY);
    let times: Vec<u64> = late
        .iter()
        .map(|(_, one)| u64::from_le_bytes(one[5..13].try_into().unwrap()))
        .collect();
    // What was ready, then the newest.
    assert!(times[..4].iter().all(|time| *time <= 4), "{times:?}");
    assert_eq!(times[times.len() - 4..], [100; 4], "{times:?}");
    assert!(times.len() <= 24, "{times:?}");
    // It gets the text once.
    let told: Vec<Value> = told
        .iter()
        .map(|(_, text)| serde_json::from_slice(text).unwrap())
        .collect();
    assert_eq!(
        (told.len(), &told[0]["op"], &told[0]["id"]),
        (1, &json!("status"), &json!("slow")),
        "{told:?}"
    );
    for number in 101..200 {
        world.server.sample(channels[0], number, vec![0; 40_000]);
        world.pass_ms(50);
    }
    assert!(
        world
            .frames(&mut slow)
            .iter()
            .all(|(opcode, _)| *opcode != TEXT)
    );
}

#[test]
fn answers_that_are_not_read_close_the_client() {
    let mut world = world();
    let mut one = client(&mut world, None);
    world.frames(&mut one);
    for number in 0..64 {
        world.send(&one, &call(1, number));
    }
    assert!(!world.server.is_ended(one.id));
    assert_eq!(world.messages(&mut one).len(), 64);
    for number in 0..65 {
        world.send(&one, &call(1, number));
    }
    assert_eq!(world.close_code(&mut one), Some(1008));
}

/// A call of a service, with a request in JSON.
fn call(service: u32, call: u32) -> Vec<u8> {
    let mut bytes = vec![2];
    bytes.extend(service.to_le_bytes());
    bytes.extend(call.to_le_bytes());
    bytes.extend(b"\x04\0\0\0json{}");
    frame(0x82, &bytes)
}

#[test]
fn what_would_order_is_refused_without_effect_whatever_the_token() {
    for token in [None, Some(WATCH), Some(SECRET)] {
        let mut world = world();
        let mut one = client(&mut world, token);
        assert_eq!(
            operations(&mut world, &mut one),
            ["serverInfo", "advertise"]
        );
        for number in [5, 6] {
            world.send(&one, &call(1, number));
            let failure = json!({"op": "serviceCallFailure", "serviceId": 1, "callId": number,
                "message": "this server has no services: it shows, and takes no orders"});
            assert_eq!(world.messages(&mut one), [failure]);
        }
        for _ in 0..2 {
            let parameter = json!({"name": "/robot1/cruise_speed_mps", "value": 1});
            world.say(
                &one,
                &json!({"op": "setParameters", "parameters": [parameter], "id": "s"}),
            );
            world.send(&one, &frame(0x82, b"\x01\0\0\0\0data"));
            world.say(&one, &json!({"op": "advertise", "channels": []}));
        }
        world.say(
            &one,
            &json!({"op": "getParameters", "parameterNames": [], "id": "r"}),
        );
        let messages = world.messages(&mut one);
        let told: Vec<_> = messages
            .iter()
            .map(|one| (&one["op"], &one["id"]))
            .collect();
        assert_eq!(told, [(&json!("status"), &json!("only-shows"))], "once");
        assert!(world.events().is_empty() && !world.server.is_ended(one.id));
    }
}

#[test]
fn what_means_nothing_closes_with_its_code() {
    for (bytes, code) in [
        (frame(0x81, b"{"), 1007),
        (frame(0x81, b"{\"op\":\"subscribe\"}"), 1007),
        (frame(0x81, b"{\"no\":\"op\"}"), 1007),
        (frame(0x82, b""), 1007),
        (frame(0x82, b"\x02\x01"), 1007),
        (frame(0x82, b"\x63"), 1007),
        (frame(0xa1, b"{}"), 1002),
    ] {
        let mut world = world();
        let mut one = client(&mut world, Some(SECRET));
        world.send(&one, &bytes);
        assert_eq!(world.close_code(&mut one), Some(code), "{bytes:?}");
    }
    // What is not offered here is no fault.
    let mut world = world();
    let one = client(&mut world, None);
    for op in ["subscribeConnectionGraph", "fetchAsset", "unheardOf"] {
        world.say(&one, &json!({"op": op, "uri": "x", "requestId": 1}));
    }
    assert!(!world.server.is_ended(one.id));
}

#[test]
fn another_beginning_of_time_makes_clients_connect_anew() {
    let mut world = world();
    let (mut one, page) = (client(&mut world, None), world.page(None, 1));
    world.frames(&mut one);
    world.server.restart_foxglove("second".into());
    let frames = world.frames(&mut one);
    assert_eq!(
        (frames[0].0, &frames[0].1[..2]),
        (CLOSE, &1012_u16.to_be_bytes()[..])
    );
    assert!(world.server.is_ended(one.id) && !world.server.is_ended(page.id));
    let mut again = client(&mut world, None);
    assert_eq!(world.messages(&mut again)[0]["sessionId"], "second");
}

#[test]
fn files_are_those_of_the_program_and_no_others() {
    let mut world = world();
    let mut client = client(&mut world, None);
    world.frames(&mut client);
    let mut fetch = |uri: &str, request: u32| {
        let message = json!({"op": "fetchAsset", "uri": uri, "requestId": request});
        world.say(&client, &message);
        let mut frames = world.frames(&mut client);
        assert_eq!(frames.len(), 1, "{uri}");
        let (_, bytes) = frames.remove(0);
        assert_eq!((bytes[0], &bytes[1..5]), (4, &request.to_le_bytes()[..]));
        (bytes[5], bytes[6..].to_vec())
    };
    let (status, file) = fetch("package://hero_ril/helicopter.urdf", 3);
    assert_eq!((status, &file[..4]), (0, &[0; 4][..]));
    assert!(file[4..].starts_with(b"<?xml"));
    for uri in [
        "package://hero_ril/../helicopter.urdf",
        "file:///etc/passwd",
        "",
    ] {
        let (status, error) = fetch(uri, 4);
        assert_eq!(
            (status, &error[4..]),
            (1, &b"there is no such file"[..]),
            "{uri}"
        );
    }
}
