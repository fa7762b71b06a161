//! Events of a recording as messages in its files.

use ipc_types::{MonotonicNs, RobotId};
use ros_messages::cdr::{Reader, Writer};
use ros_messages::{OFFERED_QOS_PROFILES, Qos};

use crate::event::{Event, EventKind};
use crate::settings::Channel;

/// Name of the message type.
pub(crate) const TYPE_NAME: &str = "hero_ril_msgs/msg/RecordingEvent";

/// End of the topic's name.
pub(crate) const TOPIC_END: &str = "/recording/events";

/// Longest text of an event, bytes. What is longer is cut.
const MAX_TEXT_LEN: usize = 1024;

/// The definition of the message.
const DEFINITION: &str = "\
# Something that happened to the recording itself.

# When it was noticed, host monotonic ns. [ns]
uint64 at_ns
# When it began, host monotonic ns. [ns]
uint64 first_ns
# When it ended, host monotonic ns. [ns]
uint64 last_ns
# How many: messages that are missing, starts of a publisher, ends of a process.
uint64 count
# loss: the recorder dropped messages. gap: messages were lost before the recorder. late: messages were sent before the recorder joined.
# restart: a publisher began again. end: the process that publishes the topic has ended, between first_ns and last_ns.
# split: another file follows. disk: the disk did not take what it was given. clock: the wall clock was set. note: see the text.
# A word that a reader does not know is to be read as note.
string kind
# The topic that it concerns; empty when it is the whole recording.
string topic
# In words.
string text
";

/// The channel of a robot's events.
pub(crate) fn channel(robot: RobotId) -> Channel {
    Channel {
        topic: format!("/robot{robot}{TOPIC_END}"),
        schema_name: TYPE_NAME.to_owned(),
        schema_text: DEFINITION.to_owned(),
        metadata: [(
            OFFERED_QOS_PROFILES.to_owned(),
            Qos::STATE.offered_profiles(),
        )]
        .into(),
    }
}

/// The message in CDR.
pub(crate) fn write(event: &Event) -> Vec<u8> {
    let mut writer = Writer::with_capacity(128 + event.text.len());
    for time in [event.at, event.first, event.last] {
        writer.u64(time.0);
    }
    writer.u64(event.count);
    for text in [event.kind.name(), &event.topic, &event.text] {
        writer.string(cut(text));
    }
    writer.finish()
}

/// The event that a message has; `None` if it is another message.
pub(crate) fn read(cdr: &[u8]) -> Option<Event> {
    let mut body = Reader::new(cdr)?;
    let [at, first, last] = [body.u64()?, body.u64()?, body.u64()?].map(MonotonicNs);
    Some(Event {
        at,
        first,
        last,
        count: body.u64()?,
        kind: EventKind::of_name(body.string()?),
        topic: body.string()?.to_owned(),
        text: body.string()?.to_owned(),
    })
}

fn cut(text: &str) -> &str {
    match text
        .char_indices()
        .find(|(index, letter)| index + letter.len_utf8() > MAX_TEXT_LEN)
    {
        Some((index, _)) => &text[..index],
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(text: &str) -> Event {
        Event {
            at: MonotonicNs(5),
            kind: EventKind::Loss,
            topic: "/robot1/dsp_telemetry".to_owned(),
            count: 7,
            first: MonotonicNs(3),
            last: MonotonicNs(4),
            text: text.to_owned(),
        }
    }

    #[test]
    fn an_event_comes_back_as_it_was() {
        for text in ["", "a", "ab", "abc", "abcd", "née"] {
            assert_eq!(read(&write(&event(text))), Some(event(text)));
        }
    }

    #[test]
    fn a_long_text_is_cut_between_letters() {
        let long = "é".repeat(MAX_TEXT_LEN);
        let text = read(&write(&event(&long))).unwrap().text;
        assert_eq!(text, "é".repeat(MAX_TEXT_LEN / 2));
    }

    #[test]
    fn a_message_that_is_cut_anywhere_is_none() {
        let message = write(&event("text"));
        for len in 0..message.len() {
            assert_eq!(read(&message[..len]), None, "{len} bytes");
        }
        let mut hostile = message;
        hostile[36..40].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(read(&hostile), None);
    }
}
