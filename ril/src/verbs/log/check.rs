//! What a flight record has and what it lacks: [`FileCheck`], as text and as an object, of what
//! [`recording::read::check`] has found.

use std::collections::BTreeMap;
use std::fmt;

use operator::render::words::{count, duration_with_tenths};
use recording::EventKind;
use recording::read::{ReadError, RecordCheck, RecordedEvent};
use runtime::plain::plain_name;
use serde::Serialize;
use status::log::clock::IsoTime;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.LogCheck.v1";

/// Most events and errors that are printed for people; programs get all.
const MAX_SHOWN: usize = 20;

/// What a record has and lacks.
#[derive(Debug, Serialize)]
pub struct FileCheck {
    schema: &'static str,
    /// The file.
    pub file: String,
    /// Whether it has its end and nothing in it is damaged.
    pub complete: bool,
    /// Pieces of the file that are whole.
    pub whole_chunks: u64,
    /// Bytes behind the last one that could be read.
    pub bytes_behind: u64,
    /// What is damaged or was never written.
    pub errors: Vec<String>,
    /// What is not read although nothing is wrong with it.
    pub unsupported: Vec<String>,
    /// Time of the earliest message, UTC.
    pub start_utc: Option<String>,
    /// Time of the latest message, UTC.
    pub end_utc: Option<String>,
    /// From the one to the other, s.
    pub duration_s: f64,
    /// Messages of all topics.
    pub messages: u64,
    /// Missing messages of which no event of the record says anything.
    pub unexplained: u64,
    /// By topic.
    pub topics: BTreeMap<String, TopicCheck>,
    /// What happened to the recording.
    pub events: Vec<Event>,
    /// Records of metadata, by name.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Files within the file, with their lengths in bytes.
    pub attachments: BTreeMap<String, u64>,
}

/// What a record has of a topic.
#[derive(Debug, Serialize)]
pub struct TopicCheck {
    /// Type of the messages.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Messages.
    pub messages: u64,
    /// Messages that are missing between others, by their numbers.
    pub missing: u64,
    /// Of those, messages that the disk did not take.
    pub dropped: u64,
    /// Missing messages that no event explains.
    pub unexplained: u64,
    /// How often its publisher began again.
    pub restarts: u64,
}

/// Something that happened to the recording.
#[derive(Debug, Serialize)]
pub struct Event {
    /// When it was noticed.
    pub utc: String,
    /// `gap`, `loss`, `late`, `restart`, `split`, `disk`, `clock` or `note`.
    pub kind: &'static str,
    /// The topic; empty when it is about the whole recording.
    pub topic: String,
    /// How many messages are missing.
    pub count: u64,
    /// In words.
    pub text: String,
}

impl FileCheck {
    /// Of the file called `file`.
    pub fn new(file: String, check: RecordCheck) -> FileCheck {
        let explained = explained(&check.events);
        let topics: BTreeMap<String, TopicCheck> = check
            .topics
            .into_iter()
            .map(|(name, topic)| {
                let explained = explained.get(&name).copied().unwrap_or_default();
                let topic = TopicCheck {
                    type_name: topic.schema_name,
                    messages: topic.messages,
                    missing: topic.missing,
                    dropped: topic.dropped,
                    // What a publisher lost before its first sample is an event, and no gap between others.
                    unexplained: topic.missing.saturating_sub(explained),
                    restarts: topic.restarts,
                };
                (name, topic)
            })
            .collect();
        let (unsupported, errors): (Vec<_>, Vec<_>) = check
            .errors
            .iter()
            .partition(|error| error.is_unsupported());
        let texts = |errors: Vec<&ReadError>| errors.iter().map(ToString::to_string).collect();
        let span_ns = check.first_ns.zip(check.last_ns);
        FileCheck {
            schema: SCHEMA,
            file,
            complete: check.is_complete,
            whole_chunks: check.whole_chunks,
            bytes_behind: check.bytes_behind,
            errors: texts(errors),
            unsupported: texts(unsupported),
            start_utc: check.first_ns.map(utc),
            end_utc: check.last_ns.map(utc),
            duration_s: span_ns
                .map_or(0.0, |(first, last)| last.saturating_sub(first) as f64 / 1e9),
            messages: topics.values().map(|topic| topic.messages).sum(),
            unexplained: (topics.values().map(|topic| topic.unexplained))
                .fold(0, u64::saturating_add),
            topics,
            events: check.events.into_iter().map(Event::of).collect(),
            metadata: check.metadata.into_iter().collect(),
            attachments: check.attachments.into_iter().collect(),
        }
    }

    /// Whether nothing is to be done about the file.
    pub fn is_in_order(&self) -> bool {
        self.complete && self.unexplained == 0
    }
}

/// How many missing messages of each topic the record has events about.
fn explained(events: &[RecordedEvent]) -> BTreeMap<String, u64> {
    let mut explained = BTreeMap::new();
    for event in events {
        if matches!(event.kind, EventKind::Gap | EventKind::Loss) {
            let count: &mut u64 = explained.entry(event.topic.clone()).or_default();
            *count = count.saturating_add(event.count);
        }
    }
    explained
}

fn utc(unix_ns: u64) -> String {
    IsoTime::from_unix_ns(unix_ns).to_string()
}

impl Event {
    fn of(event: RecordedEvent) -> Event {
        Event {
            utc: utc(event.log_time_ns),
            kind: event.kind.name(),
            topic: event.topic,
            count: event.count,
            text: event.text,
        }
    }
}

impl fmt::Display for FileCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "file      {}", plain_name(&self.file))?;
        let is_whole = self.errors.is_empty();
        let state = match (self.complete, self.bytes_behind) {
            (true, _) => "complete".to_owned(),
            (false, _) if is_whole => "unknown: a part of it was not read".to_owned(),
            (false, 0) => "not complete: it has no end, or a part of it is damaged".to_owned(),
            (false, bytes) => {
                let bytes = count(bytes, "byte");
                format!("not complete: {bytes} behind the last part that is whole")
            }
        };
        writeln!(f, "state     {state}")?;
        let unknown = || "no message".to_owned();
        let (start, end) = (self.start_utc.clone(), self.end_utc.clone());
        writeln!(f, "start     {}", start.unwrap_or_else(unknown))?;
        writeln!(f, "end       {}", end.unwrap_or_else(unknown))?;
        let messages = count(self.messages, "message");
        let topics = count(self.topics.len() as u64, "topic");
        let seconds = duration_with_tenths(self.duration_s);
        writeln!(f, "messages  {messages} of {topics} in {seconds}")?;
        self.topics(f)?;
        shown(f, "damage", &self.errors)?;
        shown(f, "not read", &self.unsupported)?;
        let events: Vec<String> = self
            .events
            .iter()
            .map(|event| format!("{} {}: {}", event.utc, event.kind, event.text))
            .collect();
        shown(f, "event", &events)?;
        if self.unexplained > 0 {
            let missing = count(self.unexplained, "message");
            writeln!(f, "unexplained  {missing} of which the record says nothing")?;
        }
        Ok(())
    }
}

impl FileCheck {
    /// A line for each topic.
    fn topics(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.topics.keys().map(|name| plain_name(name));
        let width = names.map(|name| name.chars().count()).max();
        let width = width.unwrap_or_default().max("TOPIC".len());
        writeln!(
            f,
            "{:width$} {:>9} {:>8} {:>8} {:>8}",
            "TOPIC", "MESSAGES", "MISSING", "DROPPED", "RESTARTS"
        )?;
        for (name, topic) in &self.topics {
            writeln!(
                f,
                "{:width$} {:>9} {:>8} {:>8} {:>8}",
                plain_name(name),
                topic.messages,
                topic.missing,
                topic.dropped,
                topic.restarts
            )?;
        }
        Ok(())
    }
}

/// The first of `lines`, each with its title, and how many more there are.
fn shown(f: &mut fmt::Formatter<'_>, title: &str, lines: &[String]) -> fmt::Result {
    for line in lines.iter().take(MAX_SHOWN) {
        writeln!(f, "{title:9} {}", plain_name(line))?;
    }
    match lines.len().saturating_sub(MAX_SHOWN) {
        0 => Ok(()),
        more => writeln!(f, "{title:9} … and {more} more; --json has all"),
    }
}

#[cfg(test)]
mod tests {
    use recording::read::TopicCheck;

    use super::*;

    fn event(kind: EventKind, topic: &str, count: u64) -> RecordedEvent {
        RecordedEvent {
            log_time_ns: 1_156_797_566_000_000_000,
            kind,
            topic: topic.to_owned(),
            count,
            first_ns: 0,
            last_ns: 0,
            text: format!("{count} of {topic}"),
        }
    }

    fn check(missing: u64, events: Vec<RecordedEvent>) -> FileCheck {
        let topic = TopicCheck {
            schema_name: "a_msgs/msg/A".to_owned(),
            messages: 10,
            first_ns: 1,
            last_ns: 2,
            gaps: 1,
            missing,
            restarts: 0,
            dropped: 0,
        };
        let check = RecordCheck {
            is_complete: true,
            topics: [("/robot1/a".to_owned(), topic)].into(),
            first_ns: Some(1_156_797_566_000_000_000),
            last_ns: Some(1_156_797_570_000_000_000),
            events,
            ..RecordCheck::default()
        };
        FileCheck::new("x.mcap".to_owned(), check)
    }

    #[test]
    fn what_is_missing_without_an_event_is_not_in_order() {
        let gap = || event(EventKind::Gap, "/robot1/a", 2);
        let loss = || event(EventKind::Loss, "/robot1/a", 3);
        let other = || event(EventKind::Gap, "/robot1/b", 5);
        let endless = || event(EventKind::Gap, "/robot1/a", u64::MAX);
        for (missing, events, unexplained) in [
            (0, vec![], 0),
            (5, vec![gap(), loss()], 0),
            (5, vec![gap(), other()], 3),
            (5, vec![], 5),
            // Some were lost before the first message.
            (1, vec![gap()], 0),
            // Of a publisher whose numbers are none.
            (u64::MAX, vec![endless(), endless()], 0),
            (u64::MAX, vec![other()], u64::MAX),
        ] {
            let check = check(missing, events);
            assert_eq!(check.unexplained, unexplained);
            assert_eq!(check.is_in_order(), unexplained == 0);
        }
    }

    #[test]
    fn no_name_in_a_file_commands_the_terminal() {
        let mut check = check(0, vec![event(EventKind::Note, "\u{1b}]0;x\u{7}", 1)]);
        let topic = check.topics.pop_first().unwrap().1;
        check
            .topics
            .insert("/robot1/\u{1b}[2J\u{202e}'é'".to_owned(), topic);
        let text = check.to_string();
        let is_plain = |letter: char| letter == '\n' || !letter.is_control();
        assert!(text.chars().all(is_plain), "{text:?}");
        assert!(text.contains("/robot1/\\u{1b}[2J\\u{202e}'é'"), "{text}");
    }

    #[test]
    fn a_check_is_a_line_for_each_thing() {
        let check = check(2, vec![event(EventKind::Gap, "/robot1/a", 2)]);
        let expected = "\
file      x.mcap
state     complete
start     2006-08-28T20:39:26.000000Z
end       2006-08-28T20:39:30.000000Z
messages  10 messages of 1 topic in 4.0s
TOPIC      MESSAGES  MISSING  DROPPED RESTARTS
/robot1/a        10        2        0        0
event     2006-08-28T20:39:26.000000Z gap: 2 of /robot1/a
";
        assert_eq!(check.to_string(), expected);
    }
}
