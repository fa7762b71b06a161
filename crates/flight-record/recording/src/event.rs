//! What happened to a recording: events that lie between the messages, where they happened.

use ipc_types::MonotonicNs;

/// Something that the reader of a recording has to know, in its place among the messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When it was noticed.
    pub at: MonotonicNs,
    /// What it was.
    pub kind: EventKind,
    /// The topic that it concerns; empty when it is the whole recording.
    pub topic: String,
    /// How many: messages that are missing, starts of a publisher, ends of a process; 0 when there is nothing to count.
    pub count: u64,
    /// When it began, as for the first message that is missing.
    pub first: MonotonicNs,
    /// When it ended, as for the last message that is missing.
    pub last: MonotonicNs,
    /// In words; one line.
    pub text: String,
}

/// Kinds of [`Event`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum EventKind {
    /// Messages that the recorder dropped, because its queue was full. Made by the recorder.
    Loss,
    /// Messages that were lost before the recorder, by their sequence numbers.
    Gap,
    /// Messages that a publisher had sent before the recorder joined its topic, though it began after the recording.
    Late,
    /// A publisher began again.
    Restart,
    /// The process that publishes the topic has ended, killed or not: the topic has no sample until another process
    /// publishes it.
    End,
    /// Another file follows, or this one follows another. Made by the recorder.
    Split,
    /// The disk did not take what it was given. Made by the recorder.
    Disk,
    /// The wall clock was set. Made by the recorder.
    Clock,
    /// Something else.
    Note,
}

impl EventKind {
    /// All of them.
    pub const ALL: [EventKind; 9] = [
        EventKind::Loss,
        EventKind::Gap,
        EventKind::Late,
        EventKind::Restart,
        EventKind::End,
        EventKind::Split,
        EventKind::Disk,
        EventKind::Clock,
        EventKind::Note,
    ];

    /// The word for it in the file.
    pub const fn name(self) -> &'static str {
        match self {
            EventKind::Loss => "loss",
            EventKind::Gap => "gap",
            EventKind::Late => "late",
            EventKind::Restart => "restart",
            EventKind::End => "end",
            EventKind::Split => "split",
            EventKind::Disk => "disk",
            EventKind::Clock => "clock",
            EventKind::Note => "note",
        }
    }

    /// The kind with this word; [`Note`](EventKind::Note) for words of later versions.
    pub fn of_name(name: &str) -> EventKind {
        let found = EventKind::ALL.into_iter().find(|kind| kind.name() == name);
        found.unwrap_or(EventKind::Note)
    }
}
