//! [`Channels`]: what can be subscribed to, under numbers that stay the same as long as topic and layout do.
//!
//! Clients keep what they made of a schema by the number of its channel, so a number never means another one.
//!
//! [`Services`]: what Foxglove clients can call, under numbers that stay the same as long as the service does.
//! [`ParameterSubscriptions`]: the values that clients are shown. They are kept here because Lichtblick asks for all every 15 s, and a DSP's
//! are read one after the other over its serial line.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

use super::message::{Parameter, ServiceInfo, ServiceSide};
use crate::event::ChannelId;

/// Most channels that were ever offered, of 32 robots with 30 topics each and as many again. Further ones are not offered.
pub const MAX_CHANNELS: usize = 2048;

/// A topic and its layout.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Channel {
    /// As in recordings.
    pub topic: String,
    /// Of the samples, such as `cdr`.
    pub encoding: String,
    /// Name of the layout.
    pub schema_name: String,
    /// Of the layout, such as `ros2msg`.
    pub schema_encoding: String,
    /// The layout.
    pub schema: Arc<str>,
}

/// A sample of a channel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sample {
    pub channel: ChannelId,
    pub log_time_unix_ns: u64,
    pub bytes: Arc<[u8]>,
    /// Whether it is a line of a log, of which none is replaced by a newer one.
    pub is_line: bool,
}

/// A channel that is offered now.
#[derive(Debug)]
pub(crate) struct Offered {
    pub channel: Channel,
    /// The newest sample, for later subscribers; `None` if there was none.
    pub latest: Option<Sample>,
}

/// See the module's documentation.
#[derive(Debug, Default)]
pub(crate) struct Channels {
    ids: BTreeMap<Channel, ChannelId>,
    offered: BTreeMap<ChannelId, Offered>,
    /// Grows when what is offered changes.
    version: u64,
}

impl Channels {
    /// Offers a channel; `None` if there are too many. One that is offered already stays as it is.
    pub fn offer(&mut self, channel: Channel) -> Option<ChannelId> {
        let next = ChannelId(u32::try_from(self.ids.len()).ok()? + 1);
        let id = match self.ids.get(&channel) {
            Some(id) => *id,
            None if self.ids.len() >= MAX_CHANNELS => return None,
            None => next,
        };
        if !self.offered.contains_key(&id) {
            self.ids.insert(channel.clone(), id);
            self.offered.insert(
                id,
                Offered {
                    channel,
                    latest: None,
                },
            );
            self.version += 1;
        }
        Some(id)
    }

    /// Offers a channel no more.
    pub fn withdraw(&mut self, id: ChannelId) {
        if self.offered.remove(&id).is_some() {
            self.version += 1;
        }
    }

    /// Keeps the newest sample. False if the channel is not offered.
    pub fn keep(&mut self, sample: &Sample) -> bool {
        let offered = self.offered.get_mut(&sample.channel);
        let is_offered = offered.is_some();
        if let Some(offered) = offered {
            offered.latest = Some(sample.clone());
        }
        is_offered
    }

    /// Keeps no sample of a channel any more.
    pub fn forget(&mut self, id: ChannelId) {
        if let Some(offered) = self.offered.get_mut(&id) {
            offered.latest = None;
        }
    }

    /// A channel that is offered.
    pub fn get(&self, id: ChannelId) -> Option<&Offered> {
        self.offered.get(&id)
    }

    /// All that are offered.
    pub fn iter(&self) -> impl Iterator<Item = (ChannelId, &Channel)> {
        self.offered
            .iter()
            .map(|(id, offered)| (*id, &offered.channel))
    }

    /// Another one when what is offered has changed.
    pub fn version(&self) -> u64 {
        self.version
    }
}

/// Most parameters: 64 of 32 robots. Further ones are not kept.
pub const MAX_PARAMETERS: usize = 2048;

/// See the module's documentation.
#[derive(Debug, Default)]
pub(crate) struct ParameterSubscriptions {
    values: BTreeMap<String, Value>,
}

impl ParameterSubscriptions {
    /// Takes a value; `None` for a parameter that is gone. False if it is what is known, or there are too many.
    pub fn set(&mut self, name: &str, value: Option<Value>) -> bool {
        let Some(value) = value else {
            return self.values.remove(name).is_some();
        };
        let is_known = self.values.contains_key(name);
        if !is_known && self.values.len() >= MAX_PARAMETERS {
            return false;
        }
        self.values.insert(name.to_owned(), value.clone()) != Some(value)
    }

    /// Whether there is one of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.values.contains_key(name)
    }

    /// One as clients get it; without a value if it is gone.
    pub fn get(&self, name: &str) -> Parameter {
        let value = self.values.get(name);
        // JavaScript writes 3.0 as 3: without this a client could not set the number with a fraction that it is.
        let is_fraction = value.is_some_and(Value::is_f64);
        Parameter {
            name: name.to_owned(),
            value: value.cloned(),
            kind: is_fraction.then(|| "float64".to_owned()),
        }
    }

    /// Those of these names that there are; all if no name is given.
    pub fn find(&self, names: &[String]) -> Vec<Parameter> {
        match names {
            [] => self.values.keys().map(|name| self.get(name)).collect(),
            names => names
                .iter()
                .filter(|name| self.contains(name))
                .map(|name| self.get(name))
                .collect(),
        }
    }
}

/// How requests and answers are written.
pub(crate) const ENCODING: &str = "json";

/// How their layout is written.
const SCHEMA_ENCODING: &str = "jsonschema";

/// Most services that were ever offered: 16 of 32 robots. Further ones are not offered.
const MAX_SERVICES: usize = 512;

/// A service: its request and its answer are JSON.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct OfferedService {
    /// Such as `/robot1/hold`.
    pub name: String,
    /// Name of its type, from which those of request and answer are made.
    pub kind: String,
    /// JSON Schema of the request.
    pub request: Arc<str>,
    /// JSON Schema of the answer.
    pub response: Arc<str>,
}

/// See the module's documentation.
#[derive(Debug, Default)]
pub(crate) struct Services {
    ids: BTreeMap<OfferedService, u32>,
    offered: BTreeMap<u32, OfferedService>,
    /// Grows when what is offered changes.
    version: u64,
}

impl Services {
    /// Offers these and no others.
    pub fn set(&mut self, services: &[OfferedService]) {
        let mut offered = BTreeMap::new();
        for service in services {
            let next = self.ids.len() as u32 + 1;
            if self.ids.len() < MAX_SERVICES || self.ids.contains_key(service) {
                let id = *self.ids.entry(service.clone()).or_insert(next);
                offered.insert(id, service.clone());
            }
        }
        if offered != self.offered {
            self.offered = offered;
            self.version += 1;
        }
    }

    /// One that is offered.
    pub fn get(&self, id: u32) -> Option<&OfferedService> {
        self.offered.get(&id)
    }

    /// The numbers of all that are offered.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.offered.keys().copied()
    }

    /// Another one when what is offered has changed.
    pub fn version(&self) -> u64 {
        self.version
    }
}

impl OfferedService {
    /// As clients get it.
    pub(crate) fn info(&self, id: u32) -> ServiceInfo<'_> {
        let side = |part: &str, schema| ServiceSide {
            encoding: ENCODING,
            schema_name: format!("{}_{part}", self.kind),
            schema_encoding: SCHEMA_ENCODING,
            schema,
        };
        ServiceInfo {
            id,
            name: &self.name,
            kind: &self.kind,
            request: side("Request", &self.request),
            response: side("Response", &self.response),
        }
    }
}

/// The answer of a service that was not called. It is a normal answer: some clients wait for ever when a call fails.
pub(crate) fn refused(text: &str) -> Vec<u8> {
    let answer = serde_json::json!({"accepted": false, "request_id": "", "text": text});
    answer.to_string().into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(topic: &str, schema: &str) -> Channel {
        Channel {
            topic: topic.into(),
            encoding: "cdr".into(),
            schema_name: "pkg/msg/Type".into(),
            schema_encoding: "ros2msg".into(),
            schema: Arc::from(schema),
        }
    }

    #[test]
    fn a_number_returns_only_with_the_same_topic_and_layout() {
        let mut channels = Channels::default();
        let first = channels.offer(channel("/a", "uint8 x")).unwrap();
        let version = channels.version();
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_eq!(channels.version(), version);
        channels.withdraw(first);
        let other = channels.offer(channel("/a", "uint16 x")).unwrap();
        assert_ne!(other, first);
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_ne!(channels.version(), version);
        channels.withdraw(ChannelId(99));
        assert_eq!(channels.iter().count(), 2);
    }

    #[test]
    fn there_is_a_bound_of_all_that_ever_were() {
        let mut channels = Channels::default();
        for index in 0..MAX_CHANNELS {
            let id = channels.offer(channel(&index.to_string(), "")).unwrap();
            channels.withdraw(id);
        }
        assert_eq!(channels.offer(channel("more", "")), None);
        assert!(channels.offer(channel("0", "")).is_some());
    }
}
