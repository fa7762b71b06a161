//! What Foxglove clients get and order.

use std::collections::BTreeMap;
use std::time::{Instant, SystemTime};

use ipc_types::code::{MovementKind, Reason};
use ipc_types::payload::{HeroTelemetry, ModuleState, SharedStruct};
use ril_tests::process::Signal;
use ril_tests::{Answer, StandInBridge};
use ros_messages::cdr::Reader;
use serde_json::{Value, json};

use super::page::{Message, Page, WATCHDOG};
use super::{View, order};
use crate::common::{FOR_SLOW_MACHINES, end, end_all, movement, sandbox};

/// By how much the wall clock may be adjusted while a test runs.
const TOLERANCE_NS: u64 = 400_000_000;

/// `view.toml` of a view in which clients order, on a machine that stalls.
pub const COMMANDS: &str = "[commands]\nfoxglove = true\n[request]\ntimeout_s = 30\n";

/// A client, and what the server has said.
struct Client {
    page: Page,
    capabilities: Vec<String>,
    /// Channels by topic.
    channels: BTreeMap<String, Value>,
    /// Numbers of services.
    services: BTreeMap<String, u64>,
    /// Topics by the numbers of their subscriptions.
    subscriptions: BTreeMap<u32, String>,
    calls: u32,
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
            services: BTreeMap::new(),
            subscriptions: BTreeMap::new(),
            calls: 0,
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
        for service in message["services"].as_array().into_iter().flatten() {
            let name = service["name"].as_str().expect("a text").to_owned();
            self.services
                .insert(name, service["id"].as_u64().expect("a number"));
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

    /// Calls a service, and gives its answer.
    #[track_caller]
    fn call(&mut self, service: &str, request: &Value) -> Value {
        if !self.services.contains_key(service) {
            self.until(service, |client, _| {
                client.services.contains_key(service).then_some(())
            });
        }
        self.calls += 1;
        let head = [self.services[service] as u32, self.calls]
            .map(u32::to_le_bytes)
            .concat();
        let mut bytes = vec![2];
        bytes.extend(&head);
        bytes.extend(4_u32.to_le_bytes());
        bytes.extend(b"json");
        bytes.extend(request.to_string().as_bytes());
        self.page.send_binary(&bytes);
        self.until("the answer", |_, message| match message {
            Message::Binary(bytes) if bytes[0] == 3 && bytes[1..9] == head[..] => {
                assert_eq!(bytes[9..17], *b"\x04\0\0\0json");
                Some(serde_json::from_slice(&bytes[17..]).expect("JSON"))
            }
            _ => None,
        })
    }

    /// The parameters of an answer with this id.
    #[track_caller]
    fn parameters(&mut self, id: &str) -> BTreeMap<String, Value> {
        self.until("parameters", |_, message| match message {
            Message::Text(message) if message["op"] == "parameterValues" && message["id"] == id => {
                let all = message["parameters"].as_array().expect("a list").iter();
                Some(
                    all.map(|one| {
                        (
                            one["name"].as_str().expect("a text").to_owned(),
                            one["value"].clone(),
                        )
                    })
                    .collect(),
                )
            }
            _ => None,
        })
    }

    /// Sets a parameter, and gives the value that it has then.
    #[track_caller]
    fn set(&mut self, name: &str, value: &Value) -> Value {
        let parameter = json!({"name": name, "value": value});
        self.page
            .send(&json!({"op": "setParameters", "parameters": [parameter], "id": "set"}));
        self.parameters("set").remove(name).expect("the parameter")
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
fn foxglove_orders_with_the_token_where_it_may_and_is_answered_by_the_bridge() {
    let rig = sandbox();
    rig.write("view.toml", COMMANDS);
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish_state(&StandInBridge::idle_state());
    let view = View::start(&rig);
    let stranger = Client::connect(&view, "foxglove.sdk.v1", None);
    assert!(!stranger.can("services") && stranger.can("parameters"));
    let mut client = Client::connect(&view, "foxglove.websocket.v1", Some(&view.token));
    assert!(client.can("services"));
    let answer = client.call("/robot1/hold", &json!({}));
    assert_eq!(answer["accepted"], true, "{answer}");
    let request = movement(bridge.next_request());
    assert_eq!(request.kind(), Some(MovementKind::Hold));
    assert_eq!(answer["request_id"], request.request_id.to_string());

    bridge.answer_next(Answer::refuse(Reason::LinkDown));
    let answer = client.call("/robot1/land", &json!({}));
    assert_eq!(answer["accepted"], false, "{answer}");
    assert!(
        answer["text"].as_str().unwrap().contains("link-down"),
        "{answer}"
    );
    assert_eq!(
        movement(bridge.next_request()).kind(),
        Some(MovementKind::Land)
    );
    // What is wrong, or not known to be right, is not sent.
    for (service, request, why) in [
        ("take_off", json!({}), "needs a height"),
        ("take_off", json!({"height": 3}), "unknown field"),
        ("stop", json!({"confirm": "yes"}), "the word stop"),
    ] {
        let answer = client.call(&format!("/robot1/{service}"), &request);
        assert_eq!(
            (&answer["accepted"], &answer["request_id"]),
            (&json!(false), &json!("")),
            "{answer}"
        );
        assert!(answer["text"].as_str().unwrap().contains(why), "{answer}");
    }

    // Five calls were enough for this second.
    let mut client = Client::connect(&view, "foxglove.sdk.v1", Some(&view.token));
    let far = json!({"latitude_deg": 37.0, "longitude_deg": -6.0, "altitude_m": 20.0});
    let answer = client.call("/robot1/go_to", &far);
    assert!(
        answer["text"].as_str().unwrap().contains("not known"),
        "{answer}"
    );

    // A page that commands leaves it hold and land.
    let mut page = view.page();
    page.until_type("robot");
    page.send(&json!({"type": "lease", "robot": 1, "action": "take"}));
    page.until("the lease", |message| {
        message["type"] == "lease" && message["holder"] == "you"
    });
    let answer = client.call("/robot1/start", &json!({}));
    assert!(
        answer["text"].as_str().unwrap().contains("a page commands"),
        "{answer}"
    );
    assert_eq!(client.call("/robot1/hold", &json!({}))["accepted"], true);
    // A page sees these orders as it sees those of others.
    let report = page.until("the order", |message| {
        message["type"] == "order" && message["final"] == true
    });
    assert_eq!(report["kind"], "hold", "{report}");
    assert_eq!(page.order(&order("a1", "hold"))["stage"], "done");
    let finished = end(view.process, Signal::TERM);
    finished.err_says("foxglove");
    drop(bridge);
}

#[test]
fn foxglove_reads_parameters_and_sets_them_by_the_bridges_rules() {
    let rig = sandbox();
    rig.write("view.toml", COMMANDS);
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let robot = rig.start_robot(1, 1);
    let view = View::start(&rig);
    let mut client = Client::connect(&view, "foxglove.sdk.v1", Some(&view.token));
    let name = "/robot1/cruise_speed_mps";
    // They come one after the other.
    client
        .page
        .send(&json!({"op": "subscribeParameterUpdates", "parameterNames": []}));
    client
        .page
        .send(&json!({"op": "getParameters", "parameterNames": []}));
    let before = client.until(name, |_, message| match message {
        Message::Text(message) => {
            let mut parameters = message["parameters"].as_array()?.iter();
            let it = parameters.find(|one| one["name"] == name)?;
            Some(it["value"].clone())
        }
        Message::Binary(_) => None,
    });
    assert!(before.as_f64().is_some_and(|speed| speed > 0.0), "{before}");
    assert_eq!(client.set(name, &json!(4.5)), json!(4.5));
    rig.run("param get cruise_speed_mps", 0).out_says("4.5");
    // The bridge refuses what is out of range, and the value stays.
    assert_eq!(client.set(name, &json!(1e9)), json!(4.5));
    assert_eq!(client.set(name, &json!("fast")), json!(4.5));
    // Without the right to command nothing is set.
    let mut stranger = Client::connect(&view, "foxglove.sdk.v1", None);
    assert_eq!(stranger.set(name, &json!(2)), json!(4.5));
    view.end();
    robot.end();
}
