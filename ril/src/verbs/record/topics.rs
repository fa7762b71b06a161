//! [`Topics`]: every topic of the robot, those included that begin while it is recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use ipc_types::discovery::Discovery;
use ipc_types::dynamic::ServiceFacts;
use ipc_types::payload::{
    BridgeJournal, DspTelemetry, HeroTelemetry, ModuleState, SharedStruct, StatusJournal,
};
use ipc_types::schema::CDR_HEADER;
use ipc_types::service::Pattern;
use ipc_types::{
    DynamicSubscriber, Ipc, JournalPiece, Losses, MonotonicNs, PortSet, Schema, Topic as _,
};
use recording::{Channel, ChannelId, EventKind, Recorder};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::loss_events::LossEvents;
use super::sinks::Sinks;
use crate::recorded::topic_of;
use crate::render::stamps::StampReader;

/// When a service that could not be opened is tried again.
const RETRY_PERIOD: Duration = Duration::from_secs(1);

/// Most topics that cannot be opened and are named one by one.
const MAX_NAMED: usize = 5;

/// All topics, each with its subscriber.
pub(super) struct Topics {
    ipc: Ipc,
    /// When the recording began.
    begun: MonotonicNs,
    discovery: Discovery,
    /// What [`Ipc::generations`] was at the last look.
    seen: u32,
    /// Whether a publisher has come since that was last asked.
    has_news: bool,
    /// When to look again for what could not be opened.
    retry: Option<MonotonicNs>,
    /// Keys of what could not be opened: each is reported once.
    failing: BTreeSet<String>,
    ports: PortSet,
    topics: Vec<Topic>,
}

/// A topic that is recorded.
struct Topic {
    subscriber: DynamicSubscriber,
    channel: Channel,
    /// By what the recorder knows it; `None` before it is announced.
    id: Option<ChannelId>,
    stamps: StampReader,
    loss_events: LossEvents,
    content: Conversion,
    /// Of a journal: a second subscriber, because a journal has a snapshot when one comes. It goes when the snapshot is there.
    asks: Option<DynamicSubscriber>,
    /// The sample as a CDR message; kept, so that no sample allocates.
    cdr: Vec<u8>,
    is_failing: bool,
}

/// Whether publishers are to wake the recorder for what they publish next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wakes {
    /// The recorder will look by the time.
    Unneeded,
    /// The recorder may sleep until a sample comes.
    Needed,
}

/// What else is made of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Conversion {
    Dsp,
    Hero,
    State,
    BridgeJournal,
    StatusJournal,
    Other,
}

/// What became of a topic.
pub(super) struct TopicCounts {
    /// As it is called in the file.
    pub topic: String,
    /// What came and what did not.
    pub losses: Losses,
}

impl Topics {
    /// Opens what there is.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn open(ipc: Ipc) -> Result<Topics, Failure> {
        let mut topics = Topics {
            begun: MonotonicNs::now(),
            discovery: Discovery::default(),
            seen: ipc.generations(),
            has_news: false,
            retry: None,
            failing: BTreeSet::new(),
            ports: PortSet::new().or_fail(ExitCode::Internal)?,
            topics: Vec::new(),
            ipc,
        };
        // Samples of long ago are none of this recording.
        topics.look(DynamicSubscriber::open);
        Ok(topics)
    }

    /// What to wait for.
    pub fn ports(&self) -> &PortSet {
        &self.ports
    }

    /// Names of the layouts, and their hashes, by topic.
    pub fn layouts(&self) -> BTreeMap<String, String> {
        let topics = self.topics.iter();
        topics
            .map(|topic| {
                let metadata = &topic.channel.metadata;
                let [layout, hash] = ["layout", "layout_hash"]
                    .map(|key| metadata.get(key).map(String::as_str).unwrap_or_default());
                (topic.channel.topic.clone(), format!("{layout} {hash}"))
            })
            .collect()
    }

    /// What came of each topic, and what did not.
    pub fn counts(&self) -> impl Iterator<Item = TopicCounts> {
        self.topics.iter().map(|topic| TopicCounts {
            topic: topic.loss_events.topic().to_owned(),
            losses: topic.loss_events.losses(),
        })
    }

    /// Whether a publisher has come since the last call.
    pub fn take_news(&mut self) -> bool {
        std::mem::take(&mut self.has_news)
    }

    /// When [`drain`](Topics::drain) has to be called though no port is ready.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.retry
    }

    /// Opens topics that are new, announces them to `recorder`, and takes all samples that are there. Says how many those were of the
    /// topic that had most.
    pub fn drain(
        &mut self,
        recorder: &mut Recorder,
        sinks: &mut Sinks,
        mut now: MonotonicNs,
        wakes: Wakes,
    ) -> usize {
        let seen = self.ipc.generations();
        if seen != self.seen || self.retry.is_some_and(|retry| retry <= now) {
            // What changes from here on is seen by the next look.
            self.seen = seen;
            // It began just now: what it has published so far belongs to the recording.
            self.look(DynamicSubscriber::open_with_history);
        }
        let topics = self.topics.iter_mut();
        topics
            .map(|topic| topic.drain(recorder, sinks, &mut now, wakes))
            .max()
            .unwrap_or_default()
    }

    /// Asks the journals for snapshots: a file that has begun can then be verified without the one before.
    pub fn ask_for_snapshots(&mut self) {
        for topic in &mut self.topics {
            if matches!(
                topic.content,
                Conversion::BridgeJournal | Conversion::StatusJournal
            ) {
                let key = topic.subscriber.key();
                // It was parsed when the topic was found.
                let Ok(schema) = Schema::parse(&topic.channel.schema_text) else {
                    continue;
                };
                let second = DynamicSubscriber::open(&self.ipc, key, &schema);
                topic.asks = second
                    .inspect_err(|error| tracing::debug!(%error, "no snapshot for the new file"))
                    .ok();
            }
        }
    }

    fn look(
        &mut self,
        open: fn(&Ipc, &str, &Schema) -> Result<DynamicSubscriber, ipc_types::DynamicError>,
    ) {
        let mut discovery = std::mem::take(&mut self.discovery);
        let mut failing = BTreeMap::new();
        discovery.look(&self.ipc.clone(), |pattern, facts| {
            let taken = match pattern {
                Pattern::PublishSubscribe => self.take(&facts, open),
                Pattern::RequestResponse => Ok(()),
            };
            let is_taken = taken.is_ok();
            self.has_news |= is_taken;
            if let Err(error) = taken {
                failing.insert(facts.key, error);
            }
            is_taken
        });
        self.discovery = discovery;
        let new = failing
            .iter()
            .filter(|(key, _)| !self.failing.contains(*key));
        let new: Vec<_> = new.collect();
        for (key, error) in new.iter().take(MAX_NAMED) {
            tracing::warn!(key, error, "a topic is not recorded yet");
        }
        if new.len() > MAX_NAMED {
            let topics = new.len() - MAX_NAMED;
            tracing::warn!(topics, "further topics are not recorded yet");
        }
        self.retry = (!failing.is_empty()).then(|| MonotonicNs::now() + RETRY_PERIOD);
        self.failing = failing.into_keys().collect();
    }

    fn take(
        &mut self,
        facts: &ServiceFacts,
        open: impl FnOnce(&Ipc, &str, &Schema) -> Result<DynamicSubscriber, ipc_types::DynamicError>,
    ) -> Result<(), String> {
        let former = self
            .topics
            .iter()
            .position(|topic| topic.subscriber.key() == facts.key);
        if former.is_some_and(|former| self.topics[former].channel.schema_text == facts.text) {
            // Another life of its publisher, which the subscriber follows by itself.
            return Ok(());
        }
        let subscriber =
            open(&self.ipc, &facts.key, &facts.schema).map_err(|error| error.to_string())?;
        self.ports
            .add(subscriber.descriptor())
            .map_err(|error| error.to_string())?;
        let topic = Topic::new(subscriber, self, facts);
        tracing::info!(topic = topic.channel.topic, "recorded");
        match former {
            // Its module was installed anew, with another struct.
            Some(former) => self.topics[former] = topic,
            None => self.topics.push(topic),
        }
        Ok(())
    }
}

impl Topic {
    fn new(subscriber: DynamicSubscriber, topics: &Topics, facts: &ServiceFacts) -> Topic {
        let name = topic_of(topics.ipc.robot(), &facts.key);
        let schema = &facts.schema;
        let metadata = [
            ("service", facts.key.clone()),
            ("layout", schema.type_name().to_owned()),
            ("layout_hash", format!("{:016x}", schema.layout_hash())),
        ];
        Topic {
            content: match (schema.type_name(), facts.key.as_str()) {
                (DspTelemetry::TYPE_NAME, "dsp_telemetry") => Conversion::Dsp,
                (HeroTelemetry::TYPE_NAME, "hero_telemetry") => Conversion::Hero,
                (ModuleState::TYPE_NAME, "module_state") => Conversion::State,
                (BridgeJournal::TYPE_NAME, BridgeJournal::KEY) => Conversion::BridgeJournal,
                (StatusJournal::TYPE_NAME, StatusJournal::KEY) => Conversion::StatusJournal,
                _ => Conversion::Other,
            },
            stamps: StampReader::of(schema),
            loss_events: LossEvents::new(name.clone(), topics.begun),
            channel: Channel {
                topic: name,
                schema_name: schema.ros_resource_name(),
                schema_text: facts.text.clone(),
                metadata: metadata.map(|(key, value)| (key.to_owned(), value)).into(),
            },
            id: None,
            asks: None,
            cdr: CDR_HEADER.to_vec(),
            is_failing: false,
            subscriber,
        }
    }

    fn drain(
        &mut self,
        recorder: &mut Recorder,
        sinks: &mut Sinks,
        now: &mut MonotonicNs,
        wakes: Wakes,
    ) -> usize {
        if self.id.is_none() {
            self.id = recorder.channel(self.channel.clone());
        }
        // There are more topics than a recording can have: the further ones are left out.
        let Some(id) = self.id else { return 0 };
        let Topic {
            subscriber,
            stamps,
            loss_events,
            content,
            asks,
            cdr,
            ..
        } = self;
        let take = |sample: &[u8]| {
            let stamps = stamps.read(sample, *now);
            let latest = stamps
                .published
                .map_or(stamps.sent, |at| at.max(stamps.sent));
            let now = now_after(latest, now, MonotonicNs::now);
            let at = match stamps.sent {
                MonotonicNs(0) => *now,
                // The clocks of two machines never agree.
                sent => sent.min(*now),
            };
            for event in loss_events.take((stamps.epoch_ns, stamps.sequence), at, *now) {
                if event.kind == EventKind::Restart {
                    tracing::info!(topic = event.topic, "a publisher began again");
                }
                recorder.event(*now, &event);
            }
            cdr.truncate(CDR_HEADER.len());
            cdr.extend_from_slice(sample);
            // The lowest 32 bits are what the format has room for.
            recorder.add(*now, id, at, stamps.sequence as u32, cdr);
            match content {
                Conversion::Dsp => sinks.dsp(sample),
                Conversion::Hero => sinks.hero(recorder, sample, *now),
                Conversion::State => sinks.state(recorder, sample, *now),
                Conversion::BridgeJournal => {
                    take_answer::<BridgeJournal>(asks, sample);
                    sinks.journal(recorder, sample, *now);
                }
                Conversion::StatusJournal => {
                    take_answer::<StatusJournal>(asks, sample);
                    sinks.status_journal(recorder, sample, *now);
                }
                Conversion::Other => {}
            }
        };
        let drained = match wakes {
            Wakes::Unneeded => subscriber.drain_quietly(take),
            Wakes::Needed => subscriber.drain(take),
        };
        let was_failing = std::mem::replace(&mut self.is_failing, drained.is_err());
        drained.unwrap_or_else(|error| {
            if !was_failing {
                tracing::warn!(topic = self.channel.topic, %error, "a topic cannot be read");
            }
            0
        })
    }
}

/// Ends the question for a snapshot when the piece has one.
fn take_answer<P: JournalPiece>(asks: &mut Option<DynamicSubscriber>, piece: &[u8]) {
    if asks.is_some() && P::from_bytes(piece).is_some_and(|piece| piece.begins()) {
        *asks = None;
    }
}

/// The time at which a sample of this moment came: `now`, read again when the sample is younger, because the process was stopped since,
/// or the sample came while others were taken.
fn now_after(
    sample: MonotonicNs,
    now: &mut MonotonicNs,
    clock: impl Fn() -> MonotonicNs,
) -> &MonotonicNs {
    if sample > *now {
        *now = clock();
    }
    now
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_of_after_the_wake_came_later_than_the_wake() {
        let mut now = MonotonicNs(100);
        let clock = || MonotonicNs(4_000);
        assert_eq!(
            *now_after(MonotonicNs(90), &mut now, clock),
            MonotonicNs(100)
        );
        assert_eq!(
            *now_after(MonotonicNs(3_000), &mut now, clock),
            MonotonicNs(4_000)
        );
        assert_eq!(
            *now_after(MonotonicNs(3_500), &mut now, clock),
            MonotonicNs(4_000)
        );
    }
}
