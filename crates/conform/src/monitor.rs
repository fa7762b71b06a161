//! What is judged of every message of the whole run, whichever check is under way: frames, numbers and the place of
//! errors.

use std::collections::VecDeque;

use dsp_protocol::{DecodeError, Downlink, DspErrorCode, Profile, Sequence, header};

use crate::arrival::Arrival;
use crate::report::Line;

/// A sentence that holds for all messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Frames are whole, of known headers, and nothing lies between them.
    Frames,
    /// The check field is right.
    CheckField,
    /// Unused bits are zero.
    Padding,
    /// No field has a value that it cannot have.
    Values,
    /// All frames are of the profile.
    Profile,
    /// An error stands right behind a status, one for each.
    PlaceOfErrors,
    /// The DSP counts its messages.
    Numbers,
}

impl Rule {
    /// All of them.
    pub const ALL: [Rule; 7] = [
        Rule::Frames,
        Rule::CheckField,
        Rule::Padding,
        Rule::Values,
        Rule::Profile,
        Rule::PlaceOfErrors,
        Rule::Numbers,
    ];

    /// Whether it can break because the line damages bytes.
    pub const fn may_be_damage(self) -> bool {
        !matches!(self, Rule::Padding | Rule::Values)
    }
}

#[derive(Clone, Debug)]
struct Breach {
    found: String,
    dialogue: Vec<Line>,
}

/// Lines before a breach that are kept.
const MAX_LINES: usize = 24;

/// The watch over all messages.
#[derive(Clone, Debug)]
pub struct Monitor {
    profile: Profile,
    /// Messages that were right.
    messages: u64,
    /// The first breach of each rule, and the lines before it.
    breaches: [Option<Breach>; Rule::ALL.len()],
    /// Whether the message before was a status, or may have been one.
    after_status: bool,
    previous: Option<Sequence>,
    /// Whether the kit has sent a header of the other profile, whose error comes at any time.
    sent_other_profile: bool,
    own_errors: Vec<(u16, u32)>,
}

/// Codes of the DSP's own errors that are counted, each on its own: all that section 7 names and some unknown ones. A
/// further code is left out.
const MAX_OWN_ERRORS: usize = 64;

impl Monitor {
    /// A watch over messages of `profile`.
    pub fn new(profile: Profile) -> Monitor {
        Monitor {
            profile,
            messages: 0,
            breaches: Default::default(),
            after_status: true,
            previous: None,
            sent_other_profile: false,
            own_errors: Vec::new(),
        }
    }

    /// How many messages were right.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// The first breach of a rule; `None` if there was none.
    pub fn breach(&self, rule: Rule) -> Option<&str> {
        let breach = self.breaches.get(rule as usize)?.as_ref()?;
        Some(&breach.found)
    }

    /// The lines that led to the first breach of a rule; empty if there was none.
    pub fn dialogue(&self, rule: Rule) -> Vec<Line> {
        let breach = self.breaches.get(rule as usize).and_then(Option::as_ref);
        breach
            .map(|breach| breach.dialogue.clone())
            .unwrap_or_default()
    }

    /// Errors that the DSP reported about its own hardware.
    pub fn own_errors(&self) -> &[(u16, u32)] {
        &self.own_errors
    }

    /// The DSP was reset, or messages may be missing: what comes next follows on nothing.
    pub fn forget_order(&mut self) {
        self.previous = None;
        // Its first message may be the error behind a status that was lost.
        self.after_status = true;
    }

    /// The kit has sent bytes that are no right frame.
    pub fn sent_raw(&mut self, bytes: &[u8]) {
        self.sent_other_profile |= bytes.iter().any(|byte| match self.profile {
            Profile::Classic => *byte == header::EXTENDED_UPLINK,
            Profile::Extended => matches!(*byte, header::COMMAND | header::WAYPOINT),
        });
    }

    /// Something came; `lines` are the newest of the dialogue, with this one.
    pub fn saw(&mut self, arrival: &Arrival, lines: &VecDeque<Line>) {
        let message = match arrival.event {
            Ok(message) => message,
            Err(error) => return self.rejected(error, lines),
        };
        self.messages += 1;
        if let Some(sequence) = arrival.sequence {
            if let Some(previous) = self.previous
                && sequence != previous.next()
            {
                self.broke(
                    Rule::Numbers,
                    format!(
                        "number {} came behind number {}",
                        sequence.number(),
                        previous.number()
                    ),
                    lines,
                );
            }
            self.previous = Some(sequence);
        }
        if let Downlink::Error(DspErrorCode(code)) = message {
            let is_alarm = code == 100 && self.sent_other_profile;
            if !self.after_status && !is_alarm {
                self.broke(
                    Rule::PlaceOfErrors,
                    format!("error {code} did not come right behind a status"),
                    lines,
                );
            }
            if !matches!(code, 15 | 30 | 100 | 102) {
                self.count_own(code);
            }
            self.after_status = false;
        } else {
            self.after_status = matches!(message, Downlink::Status(_));
        }
    }

    fn rejected(&mut self, error: DecodeError, lines: &VecDeque<Line>) {
        // What comes before the first whole message may be the end of a frame that began before the port was opened.
        if self.messages == 0 && matches!(error, DecodeError::Stray | DecodeError::Truncated) {
            return;
        }
        let rule = match error {
            DecodeError::Stray | DecodeError::Truncated | DecodeError::UnknownHeader => {
                Rule::Frames
            }
            DecodeError::Checksum => Rule::CheckField,
            DecodeError::Padding => Rule::Padding,
            DecodeError::Value | DecodeError::UnknownCommand => Rule::Values,
            DecodeError::OtherProfile => Rule::Profile,
        };
        // The newest line is this frame, with the reason.
        let why = lines.back().map_or(error.name(), |line| &line.text);
        let found = format!("a frame of the DSP is {why}");
        self.broke(rule, found, lines);
        // A message is missing: the next number is not judged, nor is the place of the next error.
        self.forget_order();
    }

    fn broke(&mut self, rule: Rule, found: String, lines: &VecDeque<Line>) {
        if let Some(breach) = self.breaches.get_mut(rule as usize) {
            breach.get_or_insert_with(|| Breach {
                found,
                dialogue: lines.iter().rev().take(MAX_LINES).rev().cloned().collect(),
            });
        }
    }

    fn count_own(&mut self, code: u16) {
        if let Some((_, count)) = self.own_errors.iter_mut().find(|(own, _)| *own == code) {
            *count += 1;
        } else if self.own_errors.len() < MAX_OWN_ERRORS {
            self.own_errors.push((code, 1));
        }
    }
}
