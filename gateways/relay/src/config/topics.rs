//! `[topics]`: which samples are relayed, how often, and which go first.

use std::time::Duration;

use ipc_types::Topic;
use ipc_types::configuration::{BridgeConfiguration, StatusConfiguration};
use ipc_types::payload::{BridgeJournal, BridgeOutline, RelayStations, StatusJournal};
use ipc_types::service::{MAX_KEY_LEN, is_key};
use serde::{Deserialize, Deserializer};

use crate::names::is_carried;
use crate::telemetry::Selection;

runtime::ranged! {
    fn rate_hz(f64) in 0.0..=10_000.0;
}

/// `[topics]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TopicsConfig {
    /// Keys of the topics that are relayed.
    pub include: Vec<String>,
    /// Keys of those that are not.
    pub exclude: Vec<String>,
    /// At most so many samples a second of each topic; 0 sends all.
    #[serde(deserialize_with = "rate_hz")]
    pub rate_hz: f64,
    /// Which samples go first when the link is too slow for all.
    pub priority: Priority,
    /// Rates and priorities of single topics.
    pub rules: Vec<Rule>,
}

impl Default for TopicsConfig {
    fn default() -> Self {
        TopicsConfig {
            include: vec!["*".to_owned()],
            exclude: Vec::new(),
            rate_hz: 0.0,
            priority: Priority::Data,
            rules: Vec::new(),
        }
    }
}

/// Rate and priority of some topics.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// Keys of the topics.
    pub key: String,
    /// At most so many samples a second; that of `[topics]` if `None`.
    #[serde(default, deserialize_with = "some_rate_hz")]
    pub rate_hz: Option<f64>,
    /// Priority of the samples; that of `[topics]` if `None`.
    #[serde(default)]
    pub priority: Option<Priority>,
}

/// Which samples go first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Priority {
    /// Before all others.
    RealTime,
    /// Before the usual ones.
    High,
    /// The usual one.
    Data,
    /// After the usual ones.
    Low,
    /// When nothing else is to be sent.
    Background,
}

/// How one topic is relayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TopicPlan {
    /// Which samples are sent.
    pub selection: Selection,
    /// Which go first.
    pub priority: Priority,
}

impl TopicsConfig {
    /// How the topic `key` is relayed. `None` if it is not.
    ///
    /// The relay's own topics are not, but for [the robot's stations](is_carried), now and then. Journals and
    /// configurations are not unless `include` has their whole key: they are for programs beside the robot. The
    /// journals have more bytes than all other topics together.
    pub fn plan(&self, key: &str) -> Option<TopicPlan> {
        let is_in = |keys: &[String]| keys.iter().any(|pattern| fits(pattern, key));
        if !is_carried(key) || !is_in(&self.include) || is_in(&self.exclude) {
            return None;
        }
        if is_for_its_machine(key) && !self.include.iter().any(|named| named == key) {
            return None;
        }
        let rule = self.rules.iter().find(|rule| fits(&rule.key, key));
        let rate_hz = rule.and_then(|rule| rule.rate_hz).unwrap_or(self.rate_hz);
        let rate_hz = match key == RelayStations::KEY {
            true if rate_hz == 0.0 => STATIONS_HZ,
            true => rate_hz.min(STATIONS_HZ),
            false => rate_hz,
        };
        let selection = match rate_hz > 0.0 {
            // No rate: one piece alone would be of no use.
            _ if PIECES.contains(&key) => Selection::Pieces,
            // Longer than a process lives is as good as for ever.
            true => Selection::Newest(
                Duration::try_from_secs_f64(1.0 / rate_hz).unwrap_or(Duration::MAX),
            ),
            false => Selection::All,
        };
        Some(TopicPlan {
            selection,
            priority: rule.and_then(|rule| rule.priority).unwrap_or(self.priority),
        })
    }
}

/// How often at most stations are sent who commands: 1.7 kB, of which a narrow radio must not be full.
const STATIONS_HZ: f64 = 0.5;

/// Topics whose samples are pieces of something larger.
const PIECES: [&str; 3] = [
    BridgeOutline::KEY,
    BridgeConfiguration::KEY,
    StatusConfiguration::KEY,
];

/// Whether it is the key of an input journal or of a configuration.
fn is_for_its_machine(key: &str) -> bool {
    [
        BridgeJournal::KEY,
        StatusJournal::KEY,
        BridgeConfiguration::KEY,
        StatusConfiguration::KEY,
    ]
    .contains(&key)
}

/// Whether a key fits a pattern, in which `*` at the end stands for anything.
fn fits(pattern: &str, key: &str) -> bool {
    match pattern.strip_suffix('*') {
        Some(begin) => key.starts_with(begin),
        None => key == pattern,
    }
}

/// Whether this can be a key of topics, or the beginning of some with `*` after it.
///
/// # Errors
///
/// What is wrong with it.
pub fn check_pattern(pattern: &str) -> Result<(), String> {
    let is_right = match pattern.strip_suffix('*') {
        Some(begin) => begin.len() <= MAX_KEY_LEN && is_begin_of_key(begin),
        None => is_key(pattern),
    };
    if is_right {
        return Ok(());
    }
    Err(format!(
        "`{pattern}` is no key of a topic: write one such as `battery_watch/charge`, or its beginning and `*`, such as `battery_watch/*`"
    ))
}

/// Whether something can follow that makes it a key.
fn is_begin_of_key(begin: &str) -> bool {
    // A letter goes on with any word, and begins one after `/`.
    let begin = begin.get(..begin.len().min(MAX_KEY_LEN - 1));
    begin.is_some_and(|begin| is_key(&format!("{begin}a")))
}

fn some_rate_hz<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    rate_hz(deserializer).map(Some)
}
