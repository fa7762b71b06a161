//! [`check`]: what a file has, and what it lacks.

use std::collections::{BTreeMap, HashMap};

use super::message::{ReadError, RecordedMessage};
use super::record::{self, AttachmentRecord};
use super::store::RecordSource;
use super::walk::{Walk, WalkItem};
use crate::event::EventKind;
use crate::event_message;

/// An event of a recording, as it was recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedEvent {
    /// Unix time at which it was noticed, ns.
    pub log_time_ns: u64,
    /// What it was.
    pub kind: EventKind,
    /// The topic that it concerns; empty when it is the whole recording.
    pub topic: String,
    /// How many.
    pub count: u64,
    /// When it began: Unix time, ns.
    pub first_ns: u64,
    /// When it ended: Unix time, ns.
    pub last_ns: u64,
    /// In words.
    pub text: String,
}

/// What a file has of one topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicCheck {
    /// Name of the message type.
    pub schema_name: String,
    /// How many messages there are.
    pub messages: u64,
    /// Unix time of the earliest message, ns; 0 without messages.
    pub first_ns: u64,
    /// Unix time of the latest message, ns; 0 without messages.
    pub last_ns: u64,
    /// Breaks in the sequence numbers.
    pub gaps: u64,
    /// Sequence numbers that are missing within those breaks. A sequence that goes back is a publisher's restart and
    /// not counted.
    pub missing: u64,
    /// How often the sequence went back.
    pub restarts: u64,
    /// Messages that the recorder dropped, by the events of the recording.
    pub dropped: u64,
}

/// What [`check`] has found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordCheck {
    /// Whether the file was finished and nothing in it is damaged.
    pub is_complete: bool,
    /// What is wrong, in the order of the file; empty when it is complete. At most 1000 are listed.
    pub errors: Vec<ReadError>,
    /// Chunks that were read.
    pub whole_chunks: u64,
    /// Bytes behind the last record that was read.
    pub bytes_behind: u64,
    /// By topic.
    pub topics: BTreeMap<String, TopicCheck>,
    /// Unix time of the earliest message, ns.
    pub first_ns: Option<u64>,
    /// Unix time of the latest message, ns.
    pub last_ns: Option<u64>,
    /// Events of the recording.
    pub events: Vec<RecordedEvent>,
    /// Records of metadata: name, and texts by key.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// Names of the files within the file, and their lengths in bytes.
    pub attachments: Vec<(String, u64)>,
}

/// Reads the whole file and says what is in it, and what is missing.
pub fn check<'a>(source: impl Into<RecordSource<'a>>) -> RecordCheck {
    check_with(source.into(), |_| {})
}

/// As [`check`], and gives the files within the file.
pub(super) fn check_with(
    source: RecordSource<'_>,
    mut attachment: impl FnMut(AttachmentRecord<'_>),
) -> RecordCheck {
    let mut check = RecordCheck::default();
    let mut sequences = HashMap::new();
    let mut walk = Walk::new(source);
    for item in walk.by_ref() {
        match item {
            WalkItem::Message(message, channel) => {
                let sequence = sequences.entry(channel).or_insert(None);
                check.message(&message, sequence);
            }
            WalkItem::Chunk => check.whole_chunks += 1,
            WalkItem::Metadata(name, entries) => check.metadata.push((name, entries)),
            WalkItem::Attachment(content) => {
                if let Some(file) = record::attachment(&content) {
                    let len = file.data.len() as u64;
                    check.attachments.push((file.name.to_owned(), len));
                    attachment(file);
                }
            }
            WalkItem::Error(error) => error.list(&mut check.errors),
        }
    }
    if ReadError::leave_room_for_unfinished(&check.errors) && !walk.is_finished() {
        ReadError::Unfinished.list(&mut check.errors);
    }
    check.is_complete = check.errors.is_empty();
    check.bytes_behind = walk.bytes_behind();
    for event in &check.events {
        if event.kind == EventKind::Loss
            && let Some(topic) = check.topics.get_mut(&event.topic)
        {
            topic.dropped = topic.dropped.saturating_add(event.count);
        }
    }
    check
}

impl RecordCheck {
    fn message(&mut self, message: &RecordedMessage, sequence: &mut Option<u32>) {
        let time_ns = message.log_time_ns;
        self.first_ns = Some(self.first_ns.map_or(time_ns, |first| first.min(time_ns)));
        self.last_ns = Some(self.last_ns.map_or(time_ns, |last| last.max(time_ns)));
        if !self.topics.contains_key(message.topic()) {
            let topic = TopicCheck::new(message.schema_name(), time_ns);
            self.topics.insert(message.topic().to_owned(), topic);
        }
        if let Some(topic) = self.topics.get_mut(message.topic()) {
            topic.message(message, sequence);
        }
        self.events.extend(RecordedEvent::of(message));
    }
}

impl TopicCheck {
    fn new(schema_name: &str, time_ns: u64) -> TopicCheck {
        TopicCheck {
            schema_name: schema_name.to_owned(),
            messages: 0,
            first_ns: time_ns,
            last_ns: time_ns,
            gaps: 0,
            missing: 0,
            restarts: 0,
            dropped: 0,
        }
    }

    fn message(&mut self, message: &RecordedMessage, sequence: &mut Option<u32>) {
        self.messages += 1;
        self.first_ns = self.first_ns.min(message.log_time_ns);
        self.last_ns = self.last_ns.max(message.log_time_ns);
        let Some(last) = sequence.replace(message.sequence) else {
            return;
        };
        match message.sequence.wrapping_sub(last) {
            1 => {}
            // Messages without a sequence have zeros.
            0 if last == 0 => {}
            ahead @ 2..=0x7fff_ffff => {
                self.gaps += 1;
                self.missing += u64::from(ahead - 1);
            }
            _ => self.restarts += 1,
        }
    }
}

impl RecordedEvent {
    /// The event that a message of a recording's own topic is; `None` for messages of other topics.
    pub fn of(message: &RecordedMessage) -> Option<RecordedEvent> {
        if message.schema_name() != event_message::TYPE_NAME {
            return None;
        }
        let event = event_message::read(message.data())?;
        let unix_ns = |at: ipc_types::MonotonicNs| {
            let ahead_ns = i128::from(at.0) - i128::from(event.at.0);
            let unix_ns = i128::from(message.publish_time_ns) + ahead_ns;
            u64::try_from(unix_ns.max(0)).unwrap_or(u64::MAX)
        };
        Some(RecordedEvent {
            log_time_ns: message.log_time_ns,
            kind: event.kind,
            count: event.count,
            first_ns: unix_ns(event.first),
            last_ns: unix_ns(event.last),
            topic: event.topic,
            text: event.text,
        })
    }
}
