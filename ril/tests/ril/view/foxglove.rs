//! What Foxglove clients get, and that they order nothing.

use std::collections::BTreeMap;
use std::time::{Instant, SystemTime};

use ipc_types::code::MovementKind;
use ipc_types::payload::{HeroTelemetry, ModuleState, SharedStruct};
use ril_tests::StandInBridge;
use ros_messages::cdr::Reader;
use serde_json::{Value, json};

use super::page::{Message, Page, WATCHDOG};
use super::{View, order};
use crate::common::{FOR_SLOW_MACHINES, end_all, movement, sandbox};

/// By how much the wall clock may be adjusted while a test runs.
const TOLERANCE_NS: u64 = 400_000_000;

/// A client, and what the server has said.
struct Client {
    page: Page,
    capabilities: Vec<String>,
    /// Channels by topic.
    channels: BTreeMap<String, Value>,
    /// Topics by the numbers of their subscriptions.
    subscriptions: BTreeMap<u32, String>,
}

impl Client {
    fn connect(view: &View, protocol: &str, token: Option<&str>) -> Client {
        let mut page = Page::foxglove(protocol, view.port, token).expect("an upgrade");
        let info = page.until("serverInfo", |message| message["op"] == "serverInfo");
        let capabilities = info["capabilities"].as_array().expect("a list");
        Client {
            page,
            capabilities: capabilities
                .iter()
                .map(|one| one.as_str().expect("a text").to_owned())
                .collect(),
            channels: BTreeMap::new(),
            subscriptions: BTreeMap::new(),
        }
    }

    fn can(&self, capability: &str) -> bool {
        self.capabilities.iter().any(|one| one == capability)
    }

    /// Reads until `take` makes something of a message.
    #[track_caller]
    fn until<T>(&mut self, what: &str, mut take: impl FnMut(&Client, &Message) -> Option<T>) -> T {
        let begin = Instant::now();
        while begin.elapsed() < WATCHDOG {
            let message = self.page.next_message();
            let message = message.unwrap_or_else(|| panic!("the server closed before {what}"));
            if let Message::Text(message) = &message {
                self.note(message);
            }
            if let Some(taken) = take(self, &message) {
                return taken;
            }
        }
        panic!("no {what} came");
    }

    fn note(&mut self, message: &Value) {
        for channel in message["channels"].as_array().into_iter().flatten() {
            let topic = channel["topic"].as_str().expect("a text").to_owned();
            self.channels.insert(topic, channel.clone());
        }
    }

    /// Reads until a topic is offered.
    #[track_caller]
    fn offered(&mut self, topic: &str) {
        if !self.channels.contains_key(topic) {
            self.until(topic, |client, _| {
                client.channels.contains_key(topic).then_some(())
            });
        }
    }

    /// Subscribes to a topic as soon as it is offered.
    #[track_caller]
    fn subscribe(&mut self, topic: &str) {
        self.offered(topic);
        let id = self.subscriptions.len() as u32 + 7;
        self.subscriptions.insert(id, topic.to_owned());
        let channel = &self.channels[topic]["id"];
        self.page
            .send(&json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": channel}]}));
    }

    /// The next message of a topic, its time and its bytes.
    #[track_caller]
    fn sample(&mut self, topic: &str) -> (u64, Vec<u8>) {
        self.until(topic, |client, message| {
            let Message::Binary(bytes) = message else {
                return None;
            };
            let (1, subscription) = (
                bytes[0],
                u32::from_le_bytes(bytes.get(1..5)?.try_into().ok()?),
            ) else {
                return None;
            };
            let is_it = client.subscriptions.get(&subscription)? == topic;
            let time = u64::from_le_bytes(bytes[5..13].try_into().ok()?);
            is_it.then(|| (time, bytes[13..].to_vec()))
        })
    }
}

#[test]
fn foxglove_has_every_topic_with_the_bytes_of_recordings() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 1);
    let view = View::start(&rig);
    for protocol in ["foxglove.websocket.v1", "foxglove.sdk.v1"] {
        let mut client = Client::connect(&view, protocol, None);
        assert!(client.can("time") && !client.can("services") && !client.can("parameters"));
        for topic in [
            "/robot1/dsp/telemetry",
            "/robot1/hero/telemetry",
            "/robot1/bridge/outline",
        ] {
            client.offered(topic);
        }
        client.subscribe("/robot1/bridge/state");
        let state = &client.channels["/robot1/bridge/state"];
        assert_eq!(
            (&state["encoding"], &state["schemaEncoding"]),
            (&json!("cdr"), &json!("ros2msg"))
        );
        assert_eq!(state["schemaName"], "hero_msgs/msg/ModuleState");
        let mut last = 0;
        for _ in 0..3 {
            let (time, bytes) = client.sample("/robot1/bridge/state");
            assert_eq!(bytes[..4], [0, 1, 0, 0], "CDR, little endian");
            let state = ModuleState::from_bytes(&bytes[4..]).expect("a state");
            assert!(state.sequence > last && state.published_ns > 0);
            // The time of day of the moment at which it was published.
            let unix_ns = || SystemTime::UNIX_EPOCH.elapsed().unwrap().as_nanos() as u64;
            let before = unix_ns();
            let age_ns = ipc_types::MonotonicNs::now().0 - state.published_ns;
            let possible = before - age_ns - TOLERANCE_NS..=unix_ns() - age_ns + TOLERANCE_NS;
            assert!(possible.contains(&time), "{time}, not in {possible:?}");
            last = state.sequence;
        }
    }
    view.end();
    robot.end();
}

/// Skips a header, and gives its frame.
fn header<'a>(reader: &mut Reader<'a>) -> &'a str {
    reader.i32().expect("seconds");
    reader.u32().expect("nanoseconds");
    reader.string().expect("a frame")
}

#[test]
fn foxglove_has_a_place_in_space_on_the_map_alarms_and_events() {
    let rig = sandbox();
    let mast = "[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\ncentre = [37.4114, -6.001]\nradius_m = 10.0\n";
    rig.write("bridge.toml", &format!("{FOR_SLOW_MACHINES}\n{mast}"));
    let robot = rig.start_robot(1, 1);
    let view = View::start(&rig);
    let mut client = Client::connect(&view, "foxglove.sdk.v1", None);
    client.subscribe("/tf");
    let (_, bytes) = client.sample("/tf");
    let mut reader = Reader::new(&bytes).expect("CDR");
    assert_eq!(reader.u32(), Some(1));
    assert_eq!(header(&mut reader), "map");
    assert_eq!(reader.string(), Some("robot1/base_link"));

    // The fix is that of a sample of telemetry.
    client.subscribe("/robot1/fix");
    let (_, bytes) = client.sample("/robot1/fix");
    let mut reader = Reader::new(&bytes).expect("CDR");
    assert_eq!(header(&mut reader), "robot1/base_link");
    client.subscribe("/robot1/hero/telemetry");
    let (_, sample) = client.sample("/robot1/hero/telemetry");
    let sample = HeroTelemetry::from_bytes(&sample[4..]).expect("telemetry");
    // Status and services of the fix lie before it.
    reader.u8();
    reader.u8();
    reader.u8();
    let latitude_deg = reader.f64().expect("a latitude");
    assert!(
        (latitude_deg - sample.geodetic.latitude_rad.to_degrees()).abs() < 1e-3,
        "{latitude_deg}"
    );

    client.subscribe("/robot1/chart");
    assert_eq!(
        client.channels["/robot1/chart"]["schemaName"],
        "foxglove_msgs/msg/GeoJSON"
    );
    // What the bridge holds may come behind what is known without it.
    let chart = loop {
        let (_, bytes) = client.sample("/robot1/chart");
        let text = Reader::new(&bytes).and_then(|mut reader| reader.string());
        let chart: Value = serde_json::from_str(text.expect("a text")).expect("JSON");
        if chart["features"][0]["properties"]["name"] == "mast" {
            break chart;
        }
    };
    assert_eq!(chart["features"][0]["geometry"]["type"], "Polygon");

    // The first event, then that the bridge is gone.
    client.subscribe("/robot1/log");
    let (_, bytes) = client.sample("/robot1/log");
    let line = ros_messages::Log::read(&bytes).expect("a line");
    assert_eq!(line.process, "flight");
    let [bridge, sim, status] = [robot.bridge, robot.sim, robot.status];
    rig.kill(bridge);
    client.subscribe("/diagnostics");
    loop {
        let (_, bytes) = client.sample("/diagnostics");
        let mut reader = Reader::new(&bytes).expect("CDR");
        assert_eq!(header(&mut reader), "");
        let count = reader.u32().expect("a number");
        assert_eq!(
            (reader.u8().is_some(), reader.string()),
            (true, Some("robot1: phase"))
        );
        if count > 1 && String::from_utf8_lossy(&bytes).contains("robot1: bridge-gone") {
            break;
        }
    }
    view.end();
    end_all([sim, status]);
}

#[test]
fn a_foxglove_client_with_the_token_orders_and_sets_nothing() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish_state(&StandInBridge::idle_state());
    let view = View::start(&rig);
    let mut client = Client::connect(&view, "foxglove.websocket.v1", Some(&view.token));
    assert!(!client.can("services") && !client.can("parameters"));
    let parameter = json!({"name": "/robot1/cruise_speed_mps", "value": 4.5});
    client
        .page
        .send(&json!({"op": "setParameters", "parameters": [parameter], "id": "set"}));
    // A call of service 1 by the number 5, with a request in JSON.
    client
        .page
        .send_binary(b"\x02\x01\0\0\0\x05\0\0\0\x04\0\0\0json{}");
    for op in ["status", "serviceCallFailure"] {
        client.until(op, |_, message| match message {
            Message::Text(message) => (message["op"] == op).then_some(()),
            Message::Binary(_) => None,
        });
    }
    // The first request that reaches the bridge is that of a page.
    let mut page = view.page();
    page.until_type("robot");
    assert_eq!(page.order(&order("a1", "hold"))["stage"], "done");
    let request = movement(bridge.next_request());
    assert_eq!(request.kind(), Some(MovementKind::Hold));
    view.end();
    drop(bridge);
}
