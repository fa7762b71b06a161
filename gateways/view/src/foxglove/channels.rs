//! [`Offers`]: the channels and services that are offered, under numbers that stay the same as long as they do;
//! [`KnownOffers`]: what a client knows of them.
//!
//! Clients keep what they made of a schema by the number of its channel, so a number never means another one.
//!
//! [`ParameterSubscriptions`]: the values that clients are shown. They are kept here because Lichtblick asks for all
//! every 15 s, and a DSP's are read one after the other over its serial line.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde_json::Value;

use super::message::{Parameter, ServiceInfo, ServiceSide};
use crate::event::ChannelId;

/// Most channels that were ever offered, of 32 robots with 30 topics each and as many again. Further ones are not
/// offered.
pub const MAX_CHANNELS: usize = 2048;

/// A topic and its layout.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Channel {
    /// Its name in recordings.
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

/// What is offered, under numbers that never mean something else.
#[derive(Debug)]
pub(crate) struct Offers<T> {
    /// The numbers of all that was ever offered, at most `most`. What is more is not offered.
    ids: BTreeMap<T, u32>,
    most: usize,
    offered: BTreeMap<u32, T>,
    /// Grows when what is offered changes.
    version: u64,
}

impl<T: Clone + Ord> Offers<T> {
    /// Nothing is offered, and at most `most` different ones ever will be.
    pub fn new(most: usize) -> Offers<T> {
        Offers {
            ids: BTreeMap::new(),
            most,
            offered: BTreeMap::new(),
            version: 0,
        }
    }

    /// Offers one, and gives its number; `None` if there are too many. One that is offered already stays as it is.
    pub fn offer(&mut self, one: T) -> Option<u32> {
        let next = u32::try_from(self.ids.len()).ok()? + 1;
        let id = match self.ids.get(&one) {
            Some(id) => *id,
            None if self.ids.len() >= self.most => return None,
            None => next,
        };
        if !self.offered.contains_key(&id) {
            self.ids.insert(one.clone(), id);
            self.offered.insert(id, one);
            self.version += 1;
        }
        Some(id)
    }

    /// Offers one no more.
    pub fn withdraw(&mut self, id: u32) {
        if self.offered.remove(&id).is_some() {
            self.version += 1;
        }
    }

    /// Offers these and no others.
    pub fn set(&mut self, all: &[T]) {
        let gone = self.iter().filter(|(_, one)| !all.contains(one));
        let gone: Vec<u32> = gone.map(|(id, _)| id).collect();
        gone.into_iter().for_each(|id| self.withdraw(id));
        for one in all {
            self.offer(one.clone());
        }
    }

    /// One that is offered.
    pub fn get(&self, id: u32) -> Option<&T> {
        self.offered.get(&id)
    }

    /// All that are offered.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &T)> {
        self.offered.iter().map(|(id, one)| (*id, one))
    }
}

/// What a client knows of the offers.
#[derive(Debug, Default)]
pub(crate) struct KnownOffers {
    ids: BTreeSet<u32>,
    /// The version of the offers of which all is known; `None` before the first.
    version: Option<u64>,
}

impl KnownOffers {
    /// Whether all is known.
    pub fn is_current<T>(&self, offers: &Offers<T>) -> bool {
        self.version == Some(offers.version)
    }

    /// Takes those that are offered no more.
    pub fn take_gone<T: Clone + Ord>(&mut self, offers: &Offers<T>) -> Vec<u32> {
        let gone = self.ids.iter().copied();
        let gone: Vec<u32> = gone.filter(|id| offers.get(*id).is_none()).collect();
        self.ids.retain(|id| !gone.contains(id));
        gone
    }

    /// Takes those that are new, `most` at a time.
    pub fn take_new<'a, T: Clone + Ord>(
        &mut self,
        offers: &'a Offers<T>,
        most: usize,
    ) -> Vec<(u32, &'a T)> {
        let new = offers.iter().filter(|(id, _)| !self.ids.contains(id));
        let new: Vec<_> = new.take(most).collect();
        if new.len() < most {
            self.version = Some(offers.version);
        }
        self.ids.extend(new.iter().map(|(id, _)| *id));
        new
    }
}

/// Most parameters: 64 of 32 robots. Further ones are not kept.
pub const MAX_PARAMETERS: usize = 2048;

/// The values that clients are shown, by name.
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

    /// The parameters of these names, as far as there are some; all if no name is given.
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
pub(crate) const MAX_SERVICES: usize = 512;

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

impl OfferedService {
    /// The service in the form that clients get.
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
        let mut channels = Offers::new(MAX_CHANNELS);
        let first = channels.offer(channel("/a", "uint8 x")).unwrap();
        let version = channels.version;
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_eq!(channels.version, version);
        channels.withdraw(first);
        let other = channels.offer(channel("/a", "uint16 x")).unwrap();
        assert_ne!(other, first);
        assert_eq!(channels.offer(channel("/a", "uint8 x")), Some(first));
        assert_ne!(channels.version, version);
        channels.withdraw(99);
        assert_eq!(channels.iter().count(), 2);
    }

    #[test]
    fn there_is_a_bound_of_all_that_ever_were() {
        let mut channels = Offers::new(MAX_CHANNELS);
        for index in 0..MAX_CHANNELS {
            let id = channels.offer(channel(&index.to_string(), "")).unwrap();
            channels.withdraw(id);
        }
        assert_eq!(channels.offer(channel("more", "")), None);
        assert!(channels.offer(channel("0", "")).is_some());
    }

    #[test]
    fn a_client_learns_what_is_gone_and_what_is_new() {
        let mut services = Offers::new(3);
        let mut known = KnownOffers::default();
        services.set(&["a", "b"]);
        assert_eq!(known.take_new(&services, 1), [(1, &"a")]);
        assert!(!known.is_current(&services));
        assert_eq!(known.take_new(&services, 9), [(2, &"b")]);
        assert!(known.is_current(&services));
        services.set(&["b", "c", "d"]);
        assert!(!known.is_current(&services));
        assert_eq!(known.take_gone(&services), [1]);
        assert_eq!(known.take_new(&services, 9), [(3, &"c")], "room for three");
        services.set(&["b", "c"]);
        assert!(known.is_current(&services), "nothing has changed");
    }
}
