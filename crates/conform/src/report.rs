//! What the kit found: a verdict for each sentence, and the bytes that led to it.

use std::fmt;
use std::fmt::Write as _;
use std::time::Duration;

use dsp_protocol::{DecodeError, Profile, checksum, crc32};

/// What became of a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The DSP keeps it.
    Kept,
    /// The DSP breaks it.
    Broken {
        /// What came, and what should have.
        found: String,
    },
    /// It could not be judged.
    NotJudged {
        /// Why not, and how it can be.
        why: String,
    },
}

impl Verdict {
    /// Its name in the report.
    pub const fn name(&self) -> &'static str {
        match self {
            Verdict::Kept => "kept",
            Verdict::Broken { .. } => "broken",
            Verdict::NotJudged { .. } => "not-judged",
        }
    }

    /// What came, or why it was not judged; `None` if the sentence is kept.
    pub fn text(&self) -> Option<&str> {
        match self {
            Verdict::Kept => None,
            Verdict::Broken { found } => Some(found),
            Verdict::NotJudged { why } => Some(why),
        }
    }
}

/// Which end sent a line of a dialogue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// PC → DSP.
    Pc,
    /// DSP → PC.
    Dsp,
}

/// One frame, or one run of bytes that is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// When: since the check began.
    pub at: Duration,
    /// From where.
    pub side: Side,
    /// What was on the line.
    pub bytes: Vec<u8>,
    /// What it is, in words.
    pub text: String,
}

/// The line in the format of `crates/dsp-protocol/vectors/dialogues/`.
impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = match self.side {
            Side::Pc => '>',
            Side::Dsp => '<',
        };
        let (at_ms, bytes) = (self.at.as_millis(), hex(&self.bytes));
        write!(f, "{at_ms:>6}  {side}   {bytes:<41} ; {}", self.text)
    }
}

/// One sentence and what became of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckReport {
    /// Its name, such as `8.2-ack-time`.
    pub id: String,
    /// The section of docs/protocol.md.
    pub section: &'static str,
    /// The words of docs/protocol.md.
    pub sentence: String,
    /// What the kit sends.
    pub sends: String,
    /// What must come back.
    pub expects: String,
    /// What became of it.
    pub verdict: Verdict,
    /// The last lines of the dialogue, oldest first; empty unless the sentence is broken.
    pub dialogue: Vec<Line>,
}

/// How many of each verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Sentences that the DSP keeps.
    pub kept: usize,
    /// Sentences that it breaks.
    pub broken: usize,
    /// Sentences that could not be judged.
    pub not_judged: usize,
}

/// What a run has found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The profile that both ends spoke.
    pub profile: Profile,
    /// In the order of the run.
    pub checks: Vec<CheckReport>,
    /// Errors that the DSP reported by itself, about its own hardware: code and how often.
    pub own_errors: Vec<(u16, u32)>,
    /// Why the run ended before its end; `None` if it did not.
    pub ended_early: Option<Ended>,
}

/// Why a run ended before its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// No byte came from the DSP.
    Silent,
    /// Bytes came, but no frame that the PC accepts.
    Garbled(Rejected),
    /// No status came: whether the helicopter flies is unknown.
    NoStatus,
    /// The helicopter flies, takes off or lands: the kit leaves it alone.
    Flies,
}

/// A frame of the DSP that the PC rejects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rejected {
    /// Why.
    pub error: DecodeError,
    /// Its bytes, at most [`Rejected::MAX_BYTES`].
    pub bytes: Vec<u8>,
}

impl Rejected {
    /// Bytes that are kept: more than the longest frame has.
    pub const MAX_BYTES: usize = 160;

    /// Why in words; of a wrong check field also what it should be.
    pub fn describe(&self, profile: Profile) -> String {
        let behind = match profile {
            Profile::Classic => 1,
            Profile::Extended => 5,
        };
        let name = self.error.name();
        let parts = self
            .bytes
            .len()
            .checked_sub(behind)
            .and_then(|at| self.bytes.split_at_checked(at));
        let Some((summed, check)) = parts.filter(|_| self.error == DecodeError::Checksum) else {
            return name.to_owned();
        };
        let sent = check
            .iter()
            .fold(0, |sum: u64, byte| (sum << 7) | u64::from(byte & 0x7F));
        match profile {
            Profile::Classic => {
                let sum = checksum(summed);
                format!("{name}: 0x{sent:02X} was sent, the sum of the bytes is 0x{sum:02X}")
            }
            Profile::Extended => {
                let crc = crc32(summed);
                format!("{name}: 0x{sent:08X} was sent, the CRC of the bytes is 0x{crc:08X}")
            }
        }
    }
}

impl Report {
    /// How many of each verdict.
    pub fn totals(&self) -> Totals {
        let count = |name| {
            let checks = self.checks.iter();
            checks.filter(|check| check.verdict.name() == name).count()
        };
        Totals {
            kept: count("kept"),
            broken: count("broken"),
            not_judged: count("not-judged"),
        }
    }

    /// Whether every sentence that was judged is kept, and at least one was.
    pub fn conforms(&self) -> bool {
        let totals = self.totals();
        self.ended_early.is_none() && totals.broken == 0 && totals.kept > 0
    }
}

impl CheckReport {
    /// The dialogue as a file in the format of `crates/dsp-protocol/vectors/dialogues/`, with what should have come in
    /// its first lines.
    pub fn vector(&self, profile: Profile) -> String {
        let mut text = format!(
            "# {} (section {}): {}\n# expected: {}\n",
            self.id, self.section, self.sentence, self.expects
        );
        if let Some(found) = self.verdict.text() {
            // Writing to a text cannot fail.
            let _ = writeln!(text, "# found: {found}");
        }
        let name = profile.name();
        let _ = writeln!(text, "dsp profile = {name}\npc profile = {name}\n");
        for line in &self.dialogue {
            let _ = writeln!(text, "{line}");
        }
        text
    }
}

/// Bytes as they stand in vectors: `F0 05 75`.
pub fn hex(bytes: &[u8]) -> String {
    let digits: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    digits.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vector_is_a_dialogue() {
        let check = CheckReport {
            id: "5.1-clear-errors".to_owned(),
            section: "5.1",
            sentence: "clear errors".to_owned(),
            sends: "clear errors".to_owned(),
            expects: "an acknowledgement".to_owned(),
            verdict: Verdict::Broken {
                found: "none".to_owned(),
            },
            dialogue: vec![
                Line {
                    at: Duration::from_millis(12),
                    side: Side::Pc,
                    bytes: vec![0xF0, 0x04, 0x74],
                    text: "clear errors".to_owned(),
                },
                Line {
                    at: Duration::from_millis(1_013),
                    side: Side::Dsp,
                    bytes: vec![0xC3],
                    text: "truncated".to_owned(),
                },
            ],
        };
        let expected = "\
# 5.1-clear-errors (section 5.1): clear errors
# expected: an acknowledgement
# found: none
dsp profile = classic
pc profile = classic

    12  >   F0 04 74                                  ; clear errors
  1013  <   C3                                        ; truncated
";
        assert_eq!(check.vector(Profile::Classic), expected);
    }
}
