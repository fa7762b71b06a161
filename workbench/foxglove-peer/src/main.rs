//! Serves all topics of robot 1 to Foxglove by the crate `foxglove`: `endurance -- views --beside` measures it with the
//! same clients as `ril run view`.
//!
//! It does what the view does, so that the servers are compared and nothing else: the same names, layouts and bytes; it
//! looks for samples 20 times a second, and subscribes to a topic while a client does. It has the crate's default
//! settings.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result};
use foxglove::{ChannelBuilder, PartialMetadata, RawChannel, WebSocketServer};
use ipc_types::discovery::Discovery;
use ipc_types::dynamic::ServiceFacts;
use ipc_types::schema::CDR_HEADER;
use ipc_types::service::Pattern;
use ipc_types::{Domain, DynamicSubscriber, Ipc, RobotId, Schema};

/// Time between two looks for samples, that of the view while a client is connected.
const PERIOD: Duration = Duration::from_millis(50);

/// A topic that is offered.
struct Topic {
    channel: Arc<RawChannel>,
    schema: Schema,
    /// `None` while no client subscribes.
    subscriber: Option<DynamicSubscriber>,
}

fn main() -> Result<()> {
    let port = std::env::args().nth(1).context("usage: foxglove-peer PORT")?;
    let ipc = Ipc::join(&Domain::from_environment()?, RobotId::DEFAULT, "foxglove-peer")?;
    let server = WebSocketServer::new()
        .bind("127.0.0.1", port.parse().context("a port")?)
        .start_blocking()?;
    println!("ready on port {}", server.port());
    std::io::stdout().flush()?;
    let (mut discovery, mut seen) = (Discovery::default(), None);
    let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
    let mut cdr = Vec::new();
    loop {
        let generations = ipc.generations();
        if seen != Some(generations) {
            seen = Some(generations);
            discovery.look(&ipc, |pattern, facts| {
                if pattern == Pattern::PublishSubscribe && !topics.contains_key(&facts.key) {
                    match offer(&facts) {
                        Ok(topic) => _ = topics.insert(facts.key, topic),
                        Err(error) => eprintln!("{}: {error:#}", facts.key),
                    }
                }
                true
            });
        }
        for (key, topic) in &mut topics {
            if !topic.channel.has_sinks() {
                topic.subscriber = None;
                continue;
            }
            if topic.subscriber.is_none() {
                topic.subscriber = DynamicSubscriber::open(&ipc, key, &topic.schema).ok();
            }
            let Some(subscriber) = &mut topic.subscriber else {
                continue;
            };
            subscriber.drain(|sample: &[u8]| {
                cdr.clear();
                cdr.extend_from_slice(&CDR_HEADER);
                cdr.extend_from_slice(sample);
                topic.channel.log_with_meta(&cdr, PartialMetadata::with_log_time(unix_ns()));
            })?;
        }
        thread::sleep(PERIOD);
    }
}

/// The channel of a topic, with the name that it has in recordings.
fn offer(facts: &ServiceFacts) -> Result<Topic> {
    let name = match facts.key.as_str() {
        "dsp_telemetry" => "dsp/telemetry",
        "hero_telemetry" => "hero/telemetry",
        "module_state" => "bridge/state",
        key => key,
    };
    let text = facts.text.clone().into_bytes();
    let schema = foxglove::Schema::new(facts.schema.ros_resource_name(), "ros2msg", text);
    let channel = ChannelBuilder::new(format!("/robot1/{name}"))
        .message_encoding("cdr")
        .schema(schema)
        .build_raw()?;
    Ok(Topic {
        channel,
        schema: facts.schema.clone(),
        subscriber: None,
    })
}

fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| u64::try_from(since.as_nanos()).unwrap_or_default())
}
