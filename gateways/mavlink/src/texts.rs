//! Texts for people, STATUSTEXT: in chunks, and an equal one to the same reader not again for five seconds.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::message::STATUSTEXT;
use crate::number::MavSeverity;
use crate::stations::StationAddress;
use crate::wire::MessageWriter;

/// Bytes of a chunk.
const CHUNK: usize = 50;

/// For how long one about something that comes many times in a second is not said again.
const LONG_PAUSE: Duration = Duration::from_secs(60);

/// Most chunks of a text; the rest is cut off.
const MAX_CHUNKS: usize = 5;

/// For how long an equal text is not said again.
const PAUSE: Duration = Duration::from_secs(5);

/// Most texts to stations that are remembered, and most in the log; of a further one the oldest goes, and may then be
/// said again too soon.
const MAX_SAID: usize = 128;
const MAX_LOGGED: usize = 16;

/// Which texts were said of late.
#[derive(Clone, Debug, Default)]
pub struct Texts {
    /// Each text with its station: a text that one station got is still sent to another one.
    said: Recent<(StationAddress, String), MAX_SAID>,
    logged: Recent<String, MAX_LOGGED>,
    /// Names the chunks of one text.
    id: u16,
}

impl Texts {
    /// The messages of a text; none if it was just said to this station.
    pub fn say(
        &mut self,
        to: StationAddress,
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) -> Vec<MessageWriter> {
        self.say_after(PAUSE, to, severity, text, now)
    }

    /// The messages of a text about something that comes many times in a second.
    pub fn say_rarely(
        &mut self,
        to: StationAddress,
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) -> Vec<MessageWriter> {
        self.say_after(LONG_PAUSE, to, severity, text, now)
    }

    /// The one message of a text for a station that speaks MAVLink 1, which has no chunks; `None` if it was just said.
    pub fn say_in_version_1(
        &mut self,
        to: StationAddress,
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) -> Option<MessageWriter> {
        self.said.take((to, text.to_owned()), PAUSE, now)?;
        let message = MessageWriter::new(STATUSTEXT).u8(severity as u8);
        Some(message.text(text, CHUNK))
    }

    fn say_after(
        &mut self,
        pause: Duration,
        to: StationAddress,
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) -> Vec<MessageWriter> {
        let text = match self.said.take((to, text.to_owned()), pause, now) {
            None => return Vec::new(),
            Some(0) => text.to_owned(),
            Some(withheld) => format!("{text} ({withheld} times more)"),
        };
        self.id = self.id.checked_add(1).unwrap_or(1);
        chunks(severity, &text, self.id)
    }

    /// Whether a text belongs into the log: not if it was just written there.
    pub fn is_news(&mut self, text: &str, now: MonotonicNs) -> bool {
        self.logged.take(text.to_owned(), PAUSE, now).is_some()
    }
}

/// What was said last, at most `MAX` things.
#[derive(Clone, Debug)]
struct Recent<T, const MAX: usize> {
    list: VecDeque<Said<T>>,
}

#[derive(Clone, Debug)]
struct Said<T> {
    what: T,
    at: MonotonicNs,
    withheld: u32,
}

impl<T: PartialEq, const MAX: usize> Recent<T, MAX> {
    /// Whether it may be said, and then how often it was withheld before.
    fn take(&mut self, what: T, pause: Duration, now: MonotonicNs) -> Option<u32> {
        let known = self.list.iter().position(|one| one.what == what);
        let mut said = known.and_then(|index| self.list.remove(index));
        let withheld = match &mut said {
            Some(said) if now.since(said.at) < pause => {
                said.withheld += 1;
                None
            }
            Some(said) => {
                said.at = now;
                Some(std::mem::take(&mut said.withheld))
            }
            None => Some(0),
        };
        if self.list.len() == MAX {
            self.list.pop_front();
        }
        self.list.push_back(said.unwrap_or(Said {
            what,
            at: now,
            withheld: 0,
        }));
        withheld
    }
}

impl<T, const MAX: usize> Default for Recent<T, MAX> {
    fn default() -> Self {
        let list = VecDeque::new();
        Recent { list }
    }
}

fn chunks(severity: MavSeverity, text: &str, id: u16) -> Vec<MessageWriter> {
    // A chunk may end within a letter of several bytes.
    let text: String = text
        .chars()
        .map(|letter| if letter.is_ascii() { letter } else { '?' })
        .collect();
    let pieces = text.as_bytes().chunks(CHUNK).take(MAX_CHUNKS);
    let id = if text.len() > CHUNK { id } else { 0 };
    let chunk = |(sequence, piece): (usize, &[u8])| {
        let piece = std::str::from_utf8(piece).unwrap_or_default();
        let message = MessageWriter::new(STATUSTEXT).u8(severity as u8);
        message.text(piece, CHUNK).u16(id).u8(sequence as u8)
    };
    pieces.enumerate().map(chunk).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn station(port: u16) -> StationAddress {
        StationAddress {
            address: ([127, 0, 0, 1], port).into(),
            system: 255,
            component: 190,
        }
    }

    fn said(messages: &[MessageWriter]) -> String {
        let text = |message: &MessageWriter| message.payload().0[1..51].to_vec();
        let bytes: Vec<u8> = messages.iter().flat_map(text).collect();
        let text = String::from_utf8(bytes).unwrap();
        text.trim_end_matches('\0').to_owned()
    }

    #[test]
    fn long_texts_come_in_chunks_with_one_id() {
        let mut texts = Texts::default();
        let now = MonotonicNs(0);
        let short = texts.say(station(1), MavSeverity::Info, "take-off done", now);
        assert_eq!((said(&short).as_str(), short.len()), ("take-off done", 1));
        assert_eq!(short[0].payload().u16(51), 0);

        let long = "goto was refused: 12 m outside of the area field — press Pause first";
        let chunks = texts.say(station(1), MavSeverity::Error, long, now);
        assert_eq!(said(&chunks), long.replace('—', "?"));
        let numbers: Vec<_> = chunks
            .iter()
            .map(|chunk| (chunk.payload().u16(51), chunk.payload().u8(53)))
            .collect();
        assert_eq!(numbers, [(2, 0), (2, 1)]);
        let endless = texts.say(station(1), MavSeverity::Error, &"x".repeat(10_000), now);
        assert_eq!(endless.len(), MAX_CHUNKS);
    }

    #[test]
    fn an_equal_text_is_said_once_in_five_seconds_with_its_count() {
        let mut texts = Texts::default();
        let mut logged = Vec::new();
        let mut say = |port: u16, text: &str, seconds: u64| {
            let now = MonotonicNs(seconds * 1_000_000_000);
            if texts.is_news(text, now) {
                logged.push(seconds);
            }
            said(&texts.say(station(port), MavSeverity::Warning, text, now))
        };
        assert_eq!(say(1, "low", 1), "low");
        assert_eq!(say(1, "low", 2), "");
        // Another station was not told.
        assert_eq!(say(2, "low", 3), "low");
        assert_eq!(say(1, "low", 5), "");
        assert_eq!(say(1, "low", 6), "low (2 times more)");
        assert_eq!(say(2, "low", 7), "");
        assert_eq!(say(1, "low", 20), "low");
        assert_eq!(logged, [1, 6, 20]);
    }
}
