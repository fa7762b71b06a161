//! [`RecordedTopics`]: every topic of the robot, those included that begin while it is recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use ipc_types::discovery::Discovery;
use ipc_types::dynamic::ServiceFacts;
use ipc_types::payload::{BridgeJournal, StatusJournal};
use ipc_types::schema::CDR_HEADER;
use ipc_types::service::Pattern;
use ipc_types::{DynamicSubscriber, Ipc, JournalPiece, Losses, MonotonicNs, PortSet, Schema};
use operator::render::stamps::StampReader;
use recording::topic_of;
use recording::{Channel, ChannelId, Event, EventKind, Recorder};
use ros_messages::{OFFERED_QOS_PROFILES, Qos};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::publisher::{LossEvents, Piece, ProcessWatch, Tail};
use crate::sinks::{SinkTopic, Sinks};

/// When a service that could not be opened is tried again.
const RETRY_PERIOD: Duration = Duration::from_secs(1);

/// Most topics that cannot be opened and are named one by one.
const MAX_NAMED: usize = 5;

/// All topics, each with its subscriber.
pub(crate) struct RecordedTopics {
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
    topics: Vec<TopicSubscription>,
}

/// A topic that is recorded.
struct TopicSubscription {
    subscriber: DynamicSubscriber,
    intake: Intake,
    /// Of a journal: a second subscriber, because a journal has a snapshot when one comes. It goes when the snapshot is
    /// there.
    asks: Option<DynamicSubscriber>,
    /// Of a topic by which a process shows that it lives.
    process: Option<ProcessWatch>,
    is_failing: bool,
}

/// What is made of a topic's samples.
struct Intake {
    channel: Channel,
    /// By what the recorder knows it; `None` before it is announced.
    id: Option<ChannelId>,
    stamps: StampReader,
    loss_events: LossEvents,
    /// What else is made of the samples.
    sink: Option<SinkTopic>,
    /// Of a journal: what its publisher leaves when it is killed.
    tail: Option<Tail>,
    /// A snapshot of a journal came.
    has_snapshot: bool,
    /// The sample as a CDR message; kept, so that no sample allocates.
    cdr: Vec<u8>,
}

/// Where the samples go, and when.
struct Destination<'a> {
    recorder: &'a mut Recorder,
    sinks: &'a mut Sinks,
    now: MonotonicNs,
}

/// Whether publishers are to wake the recorder for what they publish next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wakes {
    /// The recorder will look by the time.
    Unneeded,
    /// The recorder may sleep until a sample comes.
    Needed,
}

/// What became of a topic.
pub(crate) struct TopicCounts {
    /// The topic's name in the file.
    pub topic: String,
    /// What came and what did not.
    pub losses: Losses,
}

impl RecordedTopics {
    /// Opens what there is.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn open(ipc: Ipc) -> Result<RecordedTopics, Failure> {
        let mut topics = RecordedTopics {
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
                let channel = &topic.intake.channel;
                let metadata = &channel.metadata;
                let [layout, hash] = ["layout", "layout_hash"]
                    .map(|key| metadata.get(key).map(String::as_str).unwrap_or_default());
                (channel.topic.clone(), format!("{layout} {hash}"))
            })
            .collect()
    }

    /// What came of each topic, and what did not.
    pub fn counts(&self) -> impl Iterator<Item = TopicCounts> {
        let events = self.topics.iter().map(|topic| &topic.intake.loss_events);
        events.map(|events| TopicCounts {
            topic: events.topic().to_owned(),
            losses: events.losses(),
        })
    }

    /// Whether a publisher has come since the last call.
    pub fn take_news(&mut self) -> bool {
        std::mem::take(&mut self.has_news)
    }

    /// When [`drain`](RecordedTopics::drain) has to be called though no port is ready.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let processes = self.topics.iter().filter_map(|topic| {
            let process = topic.process.as_ref()?;
            process.deadline()
        });
        processes.chain(self.retry).min()
    }

    /// Opens topics that are new, announces them to `recorder`, and takes all samples that are there. Says how many
    /// those were of the topic that had most.
    pub fn drain(
        &mut self,
        recorder: &mut Recorder,
        sinks: &mut Sinks,
        now: MonotonicNs,
        wakes: Wakes,
    ) -> usize {
        let seen = self.ipc.generations();
        let is_changed = seen != self.seen;
        if is_changed || self.retry.is_some_and(|retry| retry <= now) {
            // What changes from here on is seen by the next look.
            self.seen = seen;
            // It began just now: what it has published so far belongs to the recording.
            self.look(DynamicSubscriber::open_with_history);
        }
        let mut to = Destination {
            recorder,
            sinks,
            now,
        };
        let topics = self.topics.iter_mut();
        let most = topics.map(|topic| topic.drain(&mut to, wakes)).max();
        if is_changed {
            self.take_rests(&mut to);
        }
        for topic in &mut self.topics {
            topic.look(&self.ipc, &mut to);
        }
        most.unwrap_or_default()
    }

    /// Takes all that is left after the last [`drain`](RecordedTopics::drain).
    pub fn finish(&mut self, recorder: &mut Recorder, sinks: &mut Sinks, now: MonotonicNs) {
        self.take_rests(&mut Destination {
            recorder,
            sinks,
            now,
        });
    }

    /// Takes what publishers of journals that were killed had not published.
    fn take_rests(&mut self, to: &mut Destination<'_>) {
        for TopicSubscription { intake, .. } in &mut self.topics {
            if let Some(rest) = intake.tail.as_mut().and_then(Tail::take_rest) {
                intake.record(&rest, to);
            }
        }
    }

    /// Asks the journals for snapshots: a file that has begun can then be verified without the one before.
    pub fn ask_for_snapshots(&mut self) {
        for topic in &mut self.topics {
            if matches!(
                topic.intake.sink,
                Some(SinkTopic::BridgeJournal | SinkTopic::StatusJournal)
            ) {
                let key = topic.subscriber.key();
                // It was parsed when the topic was found.
                let Ok(schema) = Schema::parse(&topic.intake.channel.schema_text) else {
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
        let (named, topics) = newly_failing(&failing, &self.failing);
        for (key, error) in named {
            tracing::warn!(key, error, "a topic is not recorded yet");
        }
        if topics > 0 {
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
        if former.is_some_and(|former| self.topics[former].intake.channel.schema_text == facts.text)
        {
            // Another life of its publisher, which the subscriber follows by itself.
            return Ok(());
        }
        let subscriber =
            open(&self.ipc, &facts.key, &facts.schema).map_err(|error| error.to_string())?;
        self.ports
            .add(subscriber.descriptor())
            .map_err(|error| error.to_string())?;
        let topic = TopicSubscription::new(subscriber, self, facts);
        tracing::info!(topic = topic.intake.channel.topic, "recorded");
        match former {
            // Its module was installed anew, with another struct.
            Some(former) => self.topics[former] = topic,
            None => self.topics.push(topic),
        }
        Ok(())
    }
}

impl TopicSubscription {
    fn new(
        subscriber: DynamicSubscriber,
        topics: &RecordedTopics,
        facts: &ServiceFacts,
    ) -> TopicSubscription {
        TopicSubscription {
            intake: Intake::new(topics, facts),
            asks: None,
            process: ProcessWatch::of_topic(&facts.key, MonotonicNs::now()),
            is_failing: false,
            subscriber,
        }
    }

    fn drain(&mut self, to: &mut Destination<'_>, wakes: Wakes) -> usize {
        let intake = &mut self.intake;
        if intake.id.is_none() {
            intake.id = to.recorder.channel(intake.channel.clone());
        }
        let take = |sample: &[u8]| intake.take(sample, to);
        let drained = match wakes {
            Wakes::Unneeded => self.subscriber.drain_quietly(take),
            Wakes::Needed => self.subscriber.drain(take),
        };
        if std::mem::take(&mut intake.has_snapshot) {
            self.asks = None;
        }
        let was_failing = std::mem::replace(&mut self.is_failing, drained.is_err());
        let count = drained.unwrap_or_else(|error| {
            if !was_failing {
                let topic = &self.intake.channel.topic;
                tracing::warn!(topic, %error, "a topic cannot be read");
            }
            0
        });
        if let Some(process) = self.process.as_mut().filter(|_| count > 0) {
            process.sample(to.now);
        }
        count
    }

    /// Looks for the process when that is due, and records that it has ended.
    fn look(&mut self, ipc: &Ipc, to: &mut Destination<'_>) {
        let now = to.now;
        let process = self.process.as_mut();
        let Some(process) = process.filter(|one| one.deadline().is_some_and(|due| due <= now))
        else {
            return;
        };
        let lives = match ipc.provider(self.subscriber.key()) {
            Ok(provider) => provider.is_some(),
            Err(error) => {
                tracing::debug!(%error, "the process cannot be looked for");
                true
            }
        };
        if let Some(first) = process.looked(lives, now) {
            let topic = &self.intake.channel.topic;
            tracing::info!(topic, "a process has ended");
            let event = Event {
                at: now,
                kind: EventKind::End,
                topic: topic.clone(),
                count: 1,
                first,
                last: now,
                text: format!("the process that publishes {topic} has ended"),
            };
            to.recorder.event(now, &event);
        }
    }
}

impl Intake {
    fn new(topics: &RecordedTopics, facts: &ServiceFacts) -> Intake {
        let name = topic_of(topics.ipc.robot(), &facts.key);
        let schema = &facts.schema;
        let metadata = [
            ("service", facts.key.clone()),
            ("layout", schema.type_name().to_owned()),
            ("layout_hash", format!("{:016x}", schema.layout_hash())),
            (
                OFFERED_QOS_PROFILES,
                Qos::of_key(&facts.key).offered_profiles(),
            ),
        ];
        let sink = SinkTopic::of(schema.type_name(), &facts.key);
        Intake {
            tail: match sink {
                Some(SinkTopic::BridgeJournal) => Some(Tail::of::<BridgeJournal>(&topics.ipc)),
                Some(SinkTopic::StatusJournal) => Some(Tail::of::<StatusJournal>(&topics.ipc)),
                _ => None,
            },
            sink,
            stamps: StampReader::of(schema),
            loss_events: LossEvents::new(name.clone(), topics.begun),
            channel: Channel {
                topic: name,
                schema_name: schema.ros_resource_name(),
                schema_text: facts.text.clone(),
                metadata: metadata.map(|(key, value)| (key.to_owned(), value)).into(),
            },
            id: None,
            has_snapshot: false,
            cdr: CDR_HEADER.to_vec(),
        }
    }

    fn take(&mut self, sample: &[u8], to: &mut Destination<'_>) {
        if let Some(tail) = &mut self.tail {
            let stamps = self.stamps.read(sample, to.now);
            let rest = tail.follow(Piece {
                epoch_ns: stamps.epoch_ns,
                sequence: stamps.sequence,
            });
            if let Some(rest) = rest {
                self.record(&rest, to);
            }
        }
        self.record(sample, to);
    }

    fn record(&mut self, sample: &[u8], to: &mut Destination<'_>) {
        // There are more topics than a recording can have: the further ones are left out.
        let Some(id) = self.id else { return };
        let Destination {
            recorder,
            sinks,
            now,
        } = to;
        let stamps = self.stamps.read(sample, *now);
        let latest = stamps
            .published
            .map_or(stamps.sent, |at| at.max(stamps.sent));
        let now = *now_after(latest, now, MonotonicNs::now);
        let at = match stamps.sent {
            MonotonicNs(0) => now,
            // The clocks of two machines never agree.
            sent => sent.min(now),
        };
        let number = (stamps.epoch_ns, stamps.sequence);
        for event in self.loss_events.take(number, at, now) {
            if event.kind == EventKind::Restart {
                tracing::info!(topic = event.topic, "a publisher began again");
            }
            recorder.event(now, &event);
        }
        self.cdr.truncate(CDR_HEADER.len());
        self.cdr.extend_from_slice(sample);
        // The lowest 32 bits are what the format has room for.
        recorder.add(now, id, at, stamps.sequence as u32, &self.cdr);
        let Some(sink) = self.sink else { return };
        self.has_snapshot |= match sink {
            SinkTopic::BridgeJournal => begins::<BridgeJournal>(sample),
            SinkTopic::StatusJournal => begins::<StatusJournal>(sample),
            _ => false,
        };
        sinks.take(sink, recorder, sample, now);
    }
}

/// Whether the piece has a snapshot.
fn begins<P: JournalPiece>(piece: &[u8]) -> bool {
    P::from_bytes(piece).is_some_and(|piece| piece.begins())
}

/// The time at which a sample of this moment came: `now`, read again when the sample is younger, because the process
/// was stopped since, or the sample came while others were taken.
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

/// The first topics that fail and did not before, with the reason, and how many more there are: anyone may make
/// thousands.
fn newly_failing<'a>(
    failing: &'a BTreeMap<String, String>,
    before: &BTreeSet<String>,
) -> (Vec<(&'a String, &'a String)>, usize) {
    let new = || failing.iter().filter(|(key, _)| !before.contains(*key));
    let named = new().take(MAX_NAMED).collect();
    (named, new().count().saturating_sub(MAX_NAMED))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_of_topics_that_cannot_be_recorded_are_a_few_lines_and_once() {
        let failing = |range: std::ops::Range<u32>| -> BTreeMap<String, String> {
            range
                .map(|number| (format!("foreign/{number:04}"), "no place".to_owned()))
                .collect()
        };
        let (first, more) = (failing(0..2000), failing(0..2001));
        let nothing = BTreeSet::new();
        let (named, further) = newly_failing(&first, &nothing);
        assert_eq!((named.len(), further), (MAX_NAMED, 2000 - MAX_NAMED));
        let known: BTreeSet<String> = first.into_keys().collect();
        let (named, further) = newly_failing(&more, &known);
        assert_eq!((named.len(), further), (1, 0));
        let few = failing(0..3);
        let (named, further) = newly_failing(&few, &nothing);
        assert_eq!((named.len(), further), (3, 0));
    }

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
