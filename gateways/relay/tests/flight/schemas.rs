//! A stranger's topic with the longest schema that there can be.

use std::path::Path;
use std::time::Duration;

use ipc_types::code::RelayLinkState;
use ipc_types::dynamic::{self, schema_of};
use ipc_types::payload::RelayLink;
use ipc_types::schema::MAX_TEXT_LEN;
use ipc_types::{DynamicPublisher, DynamicSubscriber, RobotId};
use ril_tests::chain::beside_or_skip;

use crate::machine::{Machine, end, free_endpoint};
use crate::rig::RELAY;

const KEY: &str = "stranger/all";

/// How long a sample is waited for until the next one is published.
const REPEAT_PERIOD: Duration = Duration::from_millis(200);

/// A schema of the greatest length: many fields, and a comment that fills it up. Its samples have some 9 KB.
fn longest_schema() -> String {
    let mut text = "# Layout: stranger.All.v1\n\nuint64 sequence\nuint64 epoch_ns\n".to_owned();
    for number in 0..9000 {
        text += &format!("uint8 field_{number}\n");
    }
    text += "# ";
    text += &"x".repeat(MAX_TEXT_LEN - text.len() - 1);
    text + "\n"
}

#[test]
fn a_stranger_s_topic_with_the_longest_schema_is_relayed() {
    let Some(ril) = beside_or_skip(Path::new(RELAY)) else {
        return;
    };
    let text = longest_schema();
    assert_eq!(text.len(), MAX_TEXT_LEN);
    let robot = Machine::new(&ril, "the longest schema");
    let station = Machine::new(&ril, "the longest schema");
    let ipc = robot.domain.join("stranger");
    let mut publisher = DynamicPublisher::open(&ipc, KEY, &text).expect("a topic");
    let endpoint = free_endpoint();
    let robot_relay = robot.start_ready(&format!("relay robot --listen {endpoint}"));
    let station_relay =
        station.start_ready(&format!("relay station --name gcs --connect {endpoint}"));
    let here = station.domain.join_as(RobotId::DEFAULT, "test");
    // The link is shown as up when all services of the robot are here.
    station
        .subscribe::<RelayLink>(1)
        .until("the link is up", |link| {
            link.state == RelayLinkState::Up.code()
        });
    let schema = schema_of(&here, KEY).expect("it is provided here");
    assert_eq!(schema, *publisher.schema());
    let facts = dynamic::topics(&here);
    assert!(
        facts.iter().any(|facts| facts.text == text),
        "to the letter"
    );
    let mut subscriber = DynamicSubscriber::open(&here, KEY, &schema).expect("a subscriber");
    let last = schema.size() - 1;
    // The test's watchdog ends it when none arrives.
    for value in (1..=u8::MAX).cycle() {
        publisher
            .publish(|sample| sample[last] = value)
            .expect("a sample");
        subscriber.wait(REPEAT_PERIOD).expect("a wait");
        let mut received = None;
        let drained = subscriber.drain(|sample| received = Some(sample[last]));
        drained.expect("samples");
        if received == Some(value) {
            break;
        }
    }
    end(station_relay);
    end(robot_relay);
}
