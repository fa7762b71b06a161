//! Texts for people, STATUSTEXT: in chunks, and an equal one not again for five seconds.

use std::collections::VecDeque;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::message::STATUSTEXT;
use crate::number::MavSeverity;
use crate::wire::MessageWriter;

/// Bytes of a chunk.
const CHUNK: usize = 50;

/// Most chunks of a text; the rest is cut off.
const MAX_CHUNKS: usize = 5;

/// For how long an equal text is not said again.
const PAUSE: Duration = Duration::from_secs(5);

/// Most texts that are remembered; of a further one the oldest goes, and may then be said again too soon.
const MAX_RECENT: usize = 16;

#[derive(Clone, Debug)]
struct Recent {
    text: String,
    said: MonotonicNs,
    withheld: u32,
}

/// Which texts were said of late.
#[derive(Clone, Debug, Default)]
pub struct Texts {
    recent: VecDeque<Recent>,
    /// Names the chunks of one text.
    id: u16,
}

impl Texts {
    /// The messages of a text; none if it was just said.
    pub fn say(
        &mut self,
        severity: MavSeverity,
        text: &str,
        now: MonotonicNs,
    ) -> Vec<MessageWriter> {
        let mut text = text.to_owned();
        let known = self.recent.iter().position(|one| one.text == text);
        if let Some(mut recent) = known.and_then(|index| self.recent.remove(index)) {
            let is_due = now.since(recent.said) >= PAUSE;
            if is_due {
                if recent.withheld > 0 {
                    text = format!("{text} ({} times more)", recent.withheld);
                }
                (recent.said, recent.withheld) = (now, 0);
            } else {
                recent.withheld += 1;
            }
            self.recent.push_back(recent);
            if !is_due {
                return Vec::new();
            }
        } else {
            if self.recent.len() == MAX_RECENT {
                self.recent.pop_front();
            }
            self.recent.push_back(Recent {
                text: text.clone(),
                said: now,
                withheld: 0,
            });
        }
        self.id = self.id.checked_add(1).unwrap_or(1);
        chunks(severity, &text, self.id)
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
        let short = texts.say(MavSeverity::Info, "take-off done", now);
        assert_eq!((said(&short).as_str(), short.len()), ("take-off done", 1));
        assert_eq!(short[0].payload().u16(51), 0);

        let long = "goto was refused: 12 m outside of the area field — press Pause first";
        let chunks = texts.say(MavSeverity::Error, long, now);
        assert_eq!(said(&chunks), long.replace('—', "?"));
        let numbers: Vec<_> = chunks
            .iter()
            .map(|chunk| (chunk.payload().u16(51), chunk.payload().u8(53)))
            .collect();
        assert_eq!(numbers, [(2, 0), (2, 1)]);
        let endless = texts.say(MavSeverity::Error, &"x".repeat(10_000), now);
        assert_eq!(endless.len(), MAX_CHUNKS);
    }

    #[test]
    fn an_equal_text_is_said_once_in_five_seconds_with_its_count() {
        let mut texts = Texts::default();
        let mut say = |text: &str, seconds: u64| {
            let now = MonotonicNs(seconds * 1_000_000_000);
            said(&texts.say(MavSeverity::Warning, text, now))
        };
        assert_eq!(say("low", 1), "low");
        assert_eq!(say("other", 1), "other");
        assert_eq!(say("low", 2), "");
        assert_eq!(say("low", 5), "");
        assert_eq!(say("low", 6), "low (2 times more)");
        assert_eq!(say("low", 20), "low");
    }
}
