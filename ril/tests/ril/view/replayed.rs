//! `ril view FILE`: a recording in the page and for Foxglove, beside what the live view said of the flight.

use std::collections::BTreeSet;

use ipc_types::code::LinkState;
use ipc_types::payload::{ModuleState, SharedStruct};
use ril_tests::StandInBridge;
use ril_tests::process::Signal;
use ril_tests::sandbox::free_port;
use serde_json::{Value, json};

use super::page::{Message, Page, request};
use super::{View, order, ril, run_file};
use crate::common::{end, sandbox};
use crate::record::feed::{only_file, until_publishers, words};
use crate::replay::made::record;

/// The next sample that a Foxglove client gets: its time and its bytes.
fn sample(client: &mut Page) -> (u64, Vec<u8>) {
    const MESSAGE_DATA: u8 = 1;
    loop {
        let message = client.next_message().expect("a server that goes on");
        if let Message::Binary(bytes) = message
            && bytes[0] == MESSAGE_DATA
        {
            let time = bytes[5..13].try_into().unwrap();
            return (u64::from_le_bytes(time), bytes[13..].to_vec());
        }
    }
}

fn replay(action: &str, position_s: Option<f64>, speed: Option<f64>) -> Value {
    json!({"type": "replay", "action": action, "position_s": position_s, "speed": speed})
}

fn is_replay(message: &Value) -> bool {
    message["type"] == "replay"
}

const SILENT: &str = "the bridge says nothing: is it stopped, or is the machine overloaded?";

/// The event of a replay was said at its time, by the clock of then: a machine that stalls makes either of them late.
#[track_caller]
fn assert_same_time(hello: &Value, event: &Value, live: &Value) {
    let start_s = hello["replay"]["start_unix_ms"].as_f64().unwrap() / 1000.0;
    let live_s = live["at_unix_ms"].as_f64().unwrap() / 1000.0;
    let apart_s = live_s - (start_s + event["at_s"].as_f64().unwrap());
    assert!(apart_s.abs() < 20.0, "{event} {live}");
}

/// What these events say of the link and of a bridge that is silent. On a machine that stalls something may be said
/// twice.
fn said<'a>(events: impl IntoIterator<Item = &'a Value>) -> BTreeSet<&'a str> {
    let texts = events
        .into_iter()
        .filter_map(|event| event["text"].as_str());
    texts
        .filter(|text| text.contains("link to the DSP") || text.contains(SILENT))
        .collect()
}

#[test]
fn the_replay_of_a_faulty_flight_has_the_alarms_of_the_live_view() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let view = View::start(&rig);
    let mut page = view.page();
    let mut recorder = rig.start(&words(""));
    recorder.wait_for_text("recorded topic=\"/robot1/bridge/state\"");
    let publish = |link: LinkState| {
        let mut state = StandInBridge::idle_state();
        state.link.state = link.code();
        bridge.publish_state(&state);
    };
    let mut live: Vec<Value> = Vec::new();
    // Reads until something is said; meanwhile a bridge with this link publishes twice a second, or none does.
    let mut until = |text: &str, link: Option<LinkState>| {
        page.until(text, |message| {
            if let Some(link) = link.filter(|_| message["type"] == "beat") {
                publish(link);
            }
            let is_event = message["type"] == "event";
            if is_event {
                live.push(message.clone());
            }
            is_event && message["text"] == text
        });
    };
    until("link to the DSP silent", Some(LinkState::Silent));
    until("over: link to the DSP silent", Some(LinkState::Up));
    until(SILENT, None);
    until(&format!("over: {SILENT}"), Some(LinkState::Up));
    // The replay looks up to 50 ms later than the live view did, and no longer than the recording.
    for _ in 0..3 {
        page.until_type("beat");
        publish(LinkState::Up);
    }
    end(recorder, Signal::TERM);
    view.end();
    drop(bridge);

    let file = only_file(&rig);
    let shown = View::of_file(&rig, file.to_str().unwrap());
    let mut page = shown.page();
    let hello = page.until_type("hello");
    let events = hello["replay"]["events"].as_array().unwrap();
    assert_eq!(said(events), said(&live), "{hello:#}");
    for text in said(&live) {
        let [event, same] =
            [events, &live].map(|all| all.iter().find(|event| event["text"] == text).unwrap());
        assert_same_time(&hello, event, same);
    }
    shown.end();
}

/// Words of the alarms that a process has ended.
const ENDED: [&str; 2] = ["`ril run status` has ended", "the bridge is gone"];

#[test]
fn a_replay_shows_processes_that_were_killed_as_gone_when_the_live_view_did() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 1);
    let view = View::start(&rig);
    let mut page = view.page();
    let mut recorder = rig.start(&words(""));
    page.until("telemetry", |message| {
        message["type"] == "now" && message["telemetry"]["freshness"] == "fresh"
    });
    // A process of which the recording has no sample was never there.
    for topic in ["/robot1/status/state", "/robot1/bridge/state"] {
        until_publishers(&rig, topic, 1);
    }
    let mut live: Vec<Value> = Vec::new();
    for (process, text) in [robot.status, robot.bridge].into_iter().zip(ENDED) {
        rig.kill(process);
        page.until(text, |message| {
            let is_event = message["type"] == "event";
            if is_event {
                live.push(message.clone());
            }
            is_event && message["text"].as_str().unwrap().contains(text)
        });
    }
    // The recorder finds both ends by itself; what came after the last message is in no file.
    for key in ["status/state", "bridge/state"] {
        recorder.wait_for_text(&format!("has ended topic=\"/robot1/{key}\""));
    }
    end(recorder, Signal::TERM);
    view.end();
    end(robot.sim, Signal::INT);

    let file = only_file(&rig);
    let shown = View::of_file(&rig, file.to_str().unwrap());
    let mut page = shown.page();
    let hello = page.until_type("hello");
    let events = hello["replay"]["events"].as_array().unwrap();
    for text in ENDED {
        let find = |events: &[Value]| {
            let mut events = events.iter();
            let found = events.find(|event| event["text"].as_str().unwrap().contains(text));
            found
                .unwrap_or_else(|| panic!("no event {text}: {hello:#}"))
                .clone()
        };
        let (event, same) = (find(events), find(&live));
        assert_eq!(
            (&event["text"], &event["severity"]),
            (&same["text"], &same["severity"])
        );
        assert_same_time(&hello, &event, &same);
    }
    // The last moment of the file has both alarms.
    page.send(&replay("seek", Some(1e6), None));
    page.until("both alarms", |message| {
        let alarms = message["alarms"].as_array();
        let has = |id: &str| alarms.is_some_and(|all| all.iter().any(|alarm| alarm["id"] == id));
        message["type"] == "robot" && has("bridge-gone") && has("status-gone")
    });
    shown.end();
}

#[test]
fn all_pages_share_one_playhead_and_order_nothing() {
    let rig = sandbox();
    let made = record(rig.folder());
    let shown = View::of_file(&rig, "flight.mcap");
    let mut page = shown.page();
    let hello = page.until_type("hello");
    let info = &hello["replay"];
    assert_eq!(
        (&info["file"], &info["duration_s"]),
        (&json!("flight.mcap"), &json!(7.1))
    );
    assert_eq!(
        (&hello["robots"], &info["start_unix_ms"]),
        (&json!([1]), &json!(1_700_000_000_000_u64))
    );
    // Its report is what `ril log report` makes of it.
    assert_eq!(hello["report"], true);
    let host = format!("127.0.0.1:{}", shown.port);
    let (status, report) = request(shown.port, "/report", &[("Host", &host)]);
    assert!(status.contains(" 200 "), "{status}");
    ril(&rig, "log report flight.mcap --output flight.html").exits(0);
    let written = std::fs::read_to_string(rig.path("flight.html")).unwrap();
    assert!(report == written, "another page");
    // It begins to play when the first page comes.
    page.until("that it plays", |message| {
        is_replay(message) && message["playing"] == true
    });
    page.send(&replay("pause", None, None));
    page.until("that it stands", |message| {
        is_replay(message) && message["playing"] == false
    });

    let mut other = shown.page();
    other.until_type("past");
    page.send(&replay("seek", Some(3.05), None));
    for page in [&mut page, &mut other] {
        page.until("the position", |message| {
            is_replay(message) && message["position_s"] == 3.05
        });
        let past = page.until_type("past");
        let times = past["t_s"].as_array().unwrap();
        assert!(
            times.len() >= 15 && times[0].as_f64().unwrap() <= -2.9,
            "{past}"
        );
        let now = page.until("the values there", |message| message["type"] == "now");
        assert_eq!(now["telemetry"]["freshness"], "fresh", "{now}");
        assert_eq!(
            now["altitude_m"].as_f64(),
            Some(made.hero[30].geodetic.altitude_m)
        );
    }
    // The values stay as old as they were then.
    for _ in 0..3 {
        let now = page.until_type("now");
        let age_ms = now["telemetry"]["age_ms"].as_u64().unwrap();
        assert!((50..=60).contains(&age_ms), "{now}");
    }
    assert_eq!(page.until_type("robot")["replayed"], true);

    // One page goes on faster; both are led there, up to the end, where it stands.
    page.send(&replay("speed", None, Some(10.0)));
    page.send(&replay("play", None, None));
    for page in [&mut page, &mut other] {
        let end = page.until("the end", |message| {
            is_replay(message) && message["position_s"] == 7.1
        });
        assert_eq!(
            (&end["playing"], &end["speed"]),
            (&json!(false), &json!(10.0))
        );
    }
    page.send(&replay("play", None, None));
    other.until("the beginning", |message| {
        is_replay(message) && message["position_s"].as_f64() < Some(7.0)
    });

    // Orders, and what makes no sense.
    for (number, kind) in [("a1", "hold"), ("a2", "land"), ("a3", "start")] {
        let report = page.order(&order(number, kind));
        assert_eq!(report["stage"], "not-sent", "{report}");
        assert!(
            report["text"].as_str().unwrap().contains("REPLAY"),
            "{report}"
        );
    }
    for (position_s, speed) in [
        (Some(-5.0), None),
        (Some(1e300), None),
        (None, Some(-1.0)),
        (None, None),
    ] {
        for action in ["seek", "speed"] {
            page.send(&replay(action, position_s, speed));
        }
    }
    page.send(&replay("seek", Some(1.0), None));
    page.until("where it is", |message| {
        is_replay(message) && message["position_s"].as_f64() < Some(2.0)
    });
    shown.end();
}

/// Subscribes to the bridge's state, and gives its channel.
fn subscribe_to_state(client: &mut Page) -> Value {
    let offered = client.until("the channels", |message| message["op"] == "advertise");
    let channels = offered["channels"].as_array().unwrap();
    let channel = channels
        .iter()
        .find(|one| one["topic"] == "/robot1/bridge/state")
        .unwrap();
    client.send(
        &json!({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]}),
    );
    channel.clone()
}

#[test]
fn foxglove_gets_the_recorded_samples() {
    let rig = sandbox();
    let made = record(rig.folder());
    let shown = View::of_file(&rig, "flight.mcap");
    let mut client = Page::foxglove("foxglove.sdk.v1", shown.port, None).expect("an upgrade");
    let mut page = shown.page();
    page.until_type("hello");
    page.send(&replay("pause", None, None));
    page.send(&replay("seek", Some(2.5), None));
    page.until("the position", |message| {
        is_replay(message) && message["position_s"] == 2.5
    });
    let channel = subscribe_to_state(&mut client);
    assert_eq!(channel["schemaName"], "hero_msgs/msg/ModuleState");
    // The one that held there comes although it stands.
    let (time, bytes) = sample(&mut client);
    assert_eq!(time, 1_700_000_002_500_000_000);
    let state = ModuleState::from_bytes(&bytes[4..]).unwrap();
    assert_eq!(state.link.commands_acknowledged, 25);
    page.send(&replay("play", None, None));
    let (time, _) = sample(&mut client);
    assert_eq!(time, 1_700_000_003_000_000_000);

    // Its own controls: go to 5 s, and stand there.
    let mut wanted = vec![3, 1];
    wanted.extend(1_f32.to_le_bytes());
    wanted.push(1);
    wanted.extend(1_700_000_005_000_000_000_u64.to_le_bytes());
    wanted.extend(2_u32.to_le_bytes());
    wanted.extend(b"r1");
    client.send_binary(&wanted);
    let state = loop {
        let message = client.next_message().expect("a server that goes on");
        if let Message::Binary(bytes) = message
            && bytes[0] == 5
        {
            break bytes;
        }
    };
    assert_eq!((state[1], &state[19..]), (1, &b"r1"[..]), "paused");
    assert_eq!(state[2..10], 1_700_000_005_000_000_000_u64.to_le_bytes());
    page.until("the position", |message| {
        is_replay(message) && message["position_s"] == 5.0 && message["playing"] == false
    });
    assert!(made.file.exists());
    shown.end();
}

#[test]
fn a_foxglove_client_without_a_page_sees_the_recording_play() {
    let rig = sandbox();
    let _made = record(rig.folder());
    let shown = View::of_file(&rig, "flight.mcap");
    let mut client = Page::foxglove("foxglove.websocket.v1", shown.port, None).expect("an upgrade");
    subscribe_to_state(&mut client);
    let first = sample(&mut client).0;
    while sample(&mut client).0 == first {}
    shown.end();
}

#[test]
fn a_file_that_cannot_be_shown_is_named_with_the_reason_and_another_port_is_found() {
    let rig = sandbox();
    let made = record(rig.folder());
    rig.write("none.mcap", "no recording");
    for (args, code, expected) in [
        ("view none.mcap", 2, "not an MCAP file"),
        ("view missing.mcap", 2, "missing.mcap cannot be shown"),
        ("view /dev/null", 2, "it is no regular file"),
        ("view flight.mcap --stop", 2, "cannot be used with"),
    ] {
        ril(&rig, args).exits(code).err_says(expected);
    }
    // A recorder that was killed: what is whole is shown.
    let whole = std::fs::read(&made.file).unwrap();
    std::fs::write(rig.path("cut.mcap"), &whole[..whole.len() - 40]).unwrap();
    let port = free_port();
    rig.write("view.toml", &format!("port = {port}\n"));
    let mut first = ril(&rig, "view cut.mcap --json");
    first.wait_for_text("ready");
    first.wait_for_text("recording: the file");
    assert!(run_file(&rig, port).exists());
    // The port is in use: the next one is taken, unless it was named.
    let mut second = ril(&rig, "view flight.mcap --no-browser");
    second.wait_for_text("ready");
    ril(&rig, &format!("view flight.mcap --port {port}"))
        .exits(1)
        .err_says(format!("port {port}"));
    // The view of live robots is another one.
    ril(&rig, "view --no-browser").exits(1).err_says("cut.mcap");
    ril(&rig, "view --stop").exits(0);
    first.exits(0);
    end(second, Signal::TERM);
}
