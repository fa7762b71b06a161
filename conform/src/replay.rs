//! A dialogue that is played again: the lines of the PC at their times, and what the DSP says to them now.

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::Profile;

use crate::report::Line;
use crate::run::Player;
use crate::wire::{Setup, Wire};

/// How long the DSP is listened to after the last line of the PC, and as much longer as this computer may be late.
const LISTEN: Duration = Duration::from_secs(1);
/// Longest dialogue, in lines: forty times what the kit writes.
const MAX_LINES: usize = 16_384;

/// A dialogue cannot be played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReplayError {
    /// The line of the file, from 1; 0 if it is none of them.
    pub line: usize,
    /// What is wrong with it.
    pub what: &'static str,
}

/// A dialogue of `dsp-protocol/vectors/dialogues/`, or one that the kit has written: what the PC says in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dialogue {
    /// The profile of the PC.
    pub profile: Profile,
    /// Time since the beginning, and bytes.
    lines: Vec<(Duration, Vec<u8>)>,
}

impl Dialogue {
    /// Reads a dialogue. Lines of the DSP, events, and frames that the link loses (`>x`) are left out.
    ///
    /// # Errors
    /// A line of the PC has no time or no bytes, or there are too many; or the file names no profile.
    pub fn parse(text: &str) -> Result<Dialogue, ReplayError> {
        let (mut profile, mut lines) = (None, Vec::new());
        for (index, line) in text.lines().enumerate() {
            let error = |what| ReplayError {
                line: index + 1,
                what,
            };
            let line = line.split(';').next().unwrap_or_default().trim();
            if let Some(name) = line.strip_prefix("pc profile = ") {
                let known = Profile::from_name(name.trim());
                profile = Some(known.ok_or(error("the profile is `classic` or `extended`"))?);
                continue;
            }
            let mut words = line.split_whitespace();
            let (Some(time), Some(">")) = (words.next(), words.next()) else {
                continue;
            };
            let time = time
                .parse()
                .map_err(|_| error("a line begins with its time in ms"))?;
            let bytes: Result<Vec<u8>, _> =
                words.map(|word| u8::from_str_radix(word, 16)).collect();
            let bytes = bytes.map_err(|_| error("bytes are written as `F0 05 75`"))?;
            if lines.len() == MAX_LINES {
                return Err(error("the dialogue is too long"));
            }
            lines.push((Duration::from_millis(time), bytes));
        }
        let profile = profile.ok_or(ReplayError {
            line: 0,
            what: "a line `pc profile = classic`, or `extended`, is missing",
        })?;
        Ok(Dialogue { profile, lines })
    }
}

/// A dialogue that is being played.
pub struct Replay {
    wire: Wire,
    left: VecDeque<(Duration, Vec<u8>)>,
    until: Duration,
    now: Duration,
    /// A line that was not sent because it could move a rotor.
    refused: bool,
}

impl Replay {
    /// Begins at time 0 with the first line of the PC. With `may_move`, what moves a rotor is sent as well.
    pub fn new(dialogue: Dialogue, setup: Setup, may_move: bool) -> Replay {
        let first = dialogue.lines.first().map_or(Duration::ZERO, |line| line.0);
        let left: VecDeque<_> = dialogue
            .lines
            .into_iter()
            .map(|(at, bytes)| (at.saturating_sub(first), bytes))
            .collect();
        Replay {
            wire: Wire::new(setup, may_move),
            until: left.back().map_or(Duration::ZERO, |line| line.0) + LISTEN + setup.slack,
            left,
            now: Duration::ZERO,
            refused: false,
        }
    }

    /// Whether it ended because a line could move a rotor, which was not allowed.
    pub fn was_refused(&self) -> bool {
        self.refused
    }

    /// Both sides, as far as they are played.
    pub fn lines(&self) -> Vec<Line> {
        self.wire.lines()
    }
}

impl Player for Replay {
    fn step(&mut self, now: Duration, bytes: &[u8]) {
        self.now = now;
        self.wire.receive(now, bytes);
        while self.left.front().is_some_and(|(at, _)| *at <= now) {
            let Some((_, bytes)) = self.left.pop_front() else {
                break;
            };
            if self.wire.put(&bytes, "as recorded".to_owned()).is_err() {
                self.refused = true;
                self.left.clear();
            }
        }
    }

    fn take_outbox(&mut self) -> Vec<u8> {
        self.wire.take_outbox()
    }

    fn next_deadline(&self) -> Option<Duration> {
        let next = self.left.front().map(|(at, _)| *at);
        (!self.is_finished()).then(|| next.unwrap_or(self.until))
    }

    fn is_finished(&self) -> bool {
        self.refused || self.left.is_empty() && self.now >= self.until
    }
}
