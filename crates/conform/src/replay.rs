//! A dialogue that is played again: the lines of the PC at their times, and what the DSP says to them now.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use dsp_protocol::{Profile, Sequence};

use crate::bench::Bench;
use crate::report::{Ended, Line};
use crate::run::{Player, look};
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

/// A dialogue of `crates/dsp-protocol/vectors/dialogues/`, or one that the kit has written: what the PC says in it.
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

/// Whether the helicopter stands; how the replay ends if not.
type GroundCheck = Pin<Box<dyn Future<Output = Result<(), Ended>>>>;

/// A dialogue that is being played. Before its first line the kit looks whether the helicopter stands, as a run does.
pub struct Replay {
    wire: Rc<RefCell<Wire>>,
    look: Option<GroundCheck>,
    ended_early: Option<Ended>,
    left: VecDeque<(Duration, Vec<u8>)>,
    /// How long after the first line of the PC the DSP is listened to.
    listen: Duration,
    /// When the first line was sent.
    began: Duration,
    now: Duration,
    /// A line that was not sent because it could move a rotor.
    refused: bool,
}

impl Replay {
    /// Begins at time 0 with the look. With `may_move`, what moves a rotor is sent as well.
    pub fn new(dialogue: Dialogue, mut setup: Setup, may_move: bool) -> Replay {
        let first = dialogue.lines.first().map_or(Duration::ZERO, |line| line.0);
        // The last command of the look must not have the number of the first line, which would be its copy.
        if let (Profile::Extended, Some((_, bytes))) = (dialogue.profile, dialogue.lines.first()) {
            let number = bytes.get(1).copied().unwrap_or(0);
            setup.first_number = Sequence::new((number & 0x7F) ^ 0x40);
        }
        let left: VecDeque<_> = dialogue
            .lines
            .into_iter()
            .map(|(at, bytes)| (at.saturating_sub(first), bytes))
            .collect();
        let wire = Rc::new(RefCell::new(Wire::new(setup, may_move)));
        let bench = Bench::new(Rc::clone(&wire));
        Replay {
            wire,
            look: Some(Box::pin(async move { look(&bench, !may_move).await })),
            ended_early: None,
            listen: left.back().map_or(Duration::ZERO, |line| line.0) + LISTEN + setup.slack,
            left,
            began: Duration::ZERO,
            now: Duration::ZERO,
            refused: false,
        }
    }

    /// Why nothing was played; `None` if the helicopter stands.
    pub fn ended_early(&self) -> Option<&Ended> {
        self.ended_early.as_ref()
    }

    /// Whether it ended because a line could move a rotor, which was not allowed.
    pub fn was_refused(&self) -> bool {
        self.refused
    }

    /// Both sides, as far as they are played.
    pub fn lines(&self) -> Vec<Line> {
        self.wire.borrow().lines()
    }

    /// Goes on with the look; true when it is over.
    fn has_looked(&mut self) -> bool {
        let Some(look) = &mut self.look else {
            return true;
        };
        let mut context = Context::from_waker(Waker::noop());
        let Poll::Ready(outcome) = look.as_mut().poll(&mut context) else {
            return false;
        };
        self.look = None;
        self.began = self.now;
        self.wire.borrow_mut().begin_check();
        if let Err(ended) = outcome {
            self.ended_early = Some(ended);
            self.left.clear();
        }
        true
    }
}

impl Player for Replay {
    fn step(&mut self, now: Duration, bytes: &[u8]) {
        self.now = now;
        self.wire.borrow_mut().receive(now, bytes);
        if !self.has_looked() {
            return;
        }
        let mut wire = self.wire.borrow_mut();
        let played = now.saturating_sub(self.began);
        while self.left.front().is_some_and(|(at, _)| *at <= played) {
            let Some((_, bytes)) = self.left.pop_front() else {
                break;
            };
            if wire.put(&bytes, "as recorded".to_owned()).is_err() {
                self.refused = true;
                self.left.clear();
            }
        }
    }

    fn take_outbox(&mut self) -> Vec<u8> {
        self.wire.borrow_mut().take_outbox()
    }

    fn next_deadline(&self) -> Option<Duration> {
        if self.look.is_some() {
            return self.wire.borrow().next_deadline();
        }
        let next = self.left.front().map_or(self.listen, |(at, _)| *at);
        (!self.is_finished()).then_some(self.began + next)
    }

    fn is_finished(&self) -> bool {
        let is_over = self.left.is_empty() && self.now >= self.began + self.listen;
        self.look.is_none() && (self.refused || self.ended_early.is_some() || is_over)
    }
}
