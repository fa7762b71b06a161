//! [`Player`]: which message of a flight is due when. It has no clock; it is given the time.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use ipc_types::MonotonicNs;

use super::flight::PlayableFlight;
use super::timeline::{FlightNs, Timeline};

/// By how much a message may come late. After more, because the process was suspended or the machine is too slow for
/// the speed, the rest of the flight moves: what was missed comes at its pace, and not at once.
const MAX_LATE: Duration = Duration::from_millis(250);

/// Pause between the end of a section and its next beginning.
const LAP_PAUSE: Duration = Duration::from_millis(100);

/// What of a flight is played, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// How many times as fast as it was flown, greater than 0.
    pub speed: f64,
    /// Where it begins, since the first message.
    pub from: Duration,
    /// Where it ends, since the first message; at the last one when absent.
    pub to: Option<Duration>,
    /// Whether it begins again at its end, for ever.
    pub is_looped: bool,
}

impl Default for Section {
    /// All of it, once, as it was flown.
    fn default() -> Section {
        Section {
            speed: 1.0,
            from: Duration::ZERO,
            to: None,
            is_looped: false,
        }
    }
}

/// There is no message in the section.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no message in this section: the flight has {:.3} s", .length.as_secs_f64())]
pub struct EmptySection {
    /// Time from the first message of the flight to the last.
    pub length: Duration,
}

/// A message that is due.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Due {
    /// Its index in the flight.
    pub index: usize,
    /// What makes its moments those of now.
    pub timeline: Timeline,
}

/// Plays a flight. Consumers that read from its beginning get what they would from a robot that has flown for a while:
/// the latest sample of each topic before a section comes at its beginning.
#[derive(Debug)]
pub struct Player {
    flight: Arc<PlayableFlight>,
    section: Section,
    /// The messages of the section.
    first: usize,
    end: usize,
    /// The next one.
    next: usize,
    /// Messages that are due without a time of their own.
    at_once: VecDeque<usize>,
    timeline: Timeline,
    /// While it is paused: the moment of the flight at which it stands.
    paused: Option<FlightNs>,
    laps: u64,
}

impl Player {
    /// Plays a section of the flight from `now` on.
    ///
    /// # Errors
    /// When no message lies in the section.
    pub fn new(
        flight: Arc<PlayableFlight>,
        section: Section,
        now: MonotonicNs,
    ) -> Result<Player, EmptySection> {
        let start = flight.at(0).unwrap_or_default();
        let first = flight.before(later(start, section.from));
        // With what comes at that very moment.
        let after = |to| FlightNs(later(start, to).0.saturating_add(1));
        let end = section
            .to
            .map_or(flight.messages(), |to| flight.before(after(to)));
        if first >= end {
            let last = flight.at(flight.messages().saturating_sub(1));
            let length_ns = last.unwrap_or_default().0.saturating_sub(start.0);
            return Err(EmptySection {
                length: Duration::from_nanos(length_ns),
            });
        }
        let mut player = Player {
            timeline: Timeline::new(start, now, section.speed),
            flight,
            section,
            first,
            end,
            next: first,
            at_once: VecDeque::new(),
            paused: None,
            laps: 0,
        };
        player.begin(now);
        Ok(player)
    }

    /// The flight.
    pub fn flight(&self) -> &Arc<PlayableFlight> {
        &self.flight
    }

    /// The next message that is due at `now`, each once; `None` before the [`deadline`](Player::deadline).
    pub fn next(&mut self, now: MonotonicNs) -> Option<Due> {
        if let Some(index) = self.at_once.pop_front() {
            return Some(self.due(index));
        }
        if self.paused.is_some() {
            return None;
        }
        if self.next == self.end {
            let begin = self.lap_at().filter(|at| *at <= now)?;
            self.laps += 1;
            self.begin(begin);
            return self.next(now);
        }
        let at = self.flight.at(self.next)?;
        let due = self.timeline.live(at);
        if due > now {
            return None;
        }
        if now.since(due) > MAX_LATE {
            self.timeline = Timeline::new(at, now, self.section.speed);
        }
        self.next += 1;
        Some(self.due(self.next - 1))
    }

    /// When the next message is due; `None` while it is paused, and at the end.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        if !self.at_once.is_empty() {
            return Some(MonotonicNs(0));
        }
        if self.paused.is_some() {
            return None;
        }
        match self.next == self.end {
            true => self.lap_at(),
            false => Some(self.timeline.live(self.flight.at(self.next)?)),
        }
    }

    /// Whether all was played.
    pub fn is_ended(&self) -> bool {
        self.next == self.end && self.at_once.is_empty() && !self.section.is_looped
    }

    /// Stands still at `now`, or goes on.
    pub fn toggle_pause(&mut self, now: MonotonicNs) {
        match self.paused.take() {
            None => self.paused = Some(self.moment(now)),
            Some(at) => self.timeline = Timeline::new(at, now, self.section.speed),
        }
    }

    /// Plays the next message at `now`, and stands still there. At the end of a section that is looped, that is its
    /// first one.
    pub fn step(&mut self, now: MonotonicNs) {
        if self.next == self.end {
            if !self.section.is_looped {
                return;
            }
            self.laps += 1;
            self.begin(now);
        }
        let at = self.flight.at(self.next).unwrap_or_default();
        self.timeline = Timeline::new(at, now, self.section.speed);
        self.paused = Some(at);
        self.at_once.push_back(self.next);
        self.next += 1;
    }

    /// Whether it stands still.
    pub fn is_paused(&self) -> bool {
        self.paused.is_some()
    }

    /// How often the section was begun again.
    pub fn laps(&self) -> u64 {
        self.laps
    }

    /// Where in the flight it is at `now`, since the first message.
    pub fn position(&self, now: MonotonicNs) -> Duration {
        self.since_start(self.moment(now))
    }

    /// Where in the flight the message with this index is, since the first message.
    pub fn position_of(&self, index: usize) -> Duration {
        self.since_start(self.flight.at(index).unwrap_or_default())
    }

    /// Where in the flight the next message is, since the first one; `None` at the end of the section.
    pub fn next_position(&self) -> Option<Duration> {
        (self.next < self.end).then(|| self.position_of(self.next))
    }

    /// Where the section ends, since the first message of the flight.
    pub fn end(&self) -> Duration {
        self.since_start(self.last())
    }

    /// Begins the section at `now`.
    fn begin(&mut self, now: MonotonicNs) {
        let start = self.flight.at(0).unwrap_or_default();
        let begin = later(start, self.section.from);
        self.timeline = Timeline::new(begin, now, self.section.speed);
        self.next = self.first;
        self.at_once = self.flight.latest_before(self.first).into();
    }

    fn due(&self, index: usize) -> Due {
        Due {
            index,
            timeline: self.timeline,
        }
    }

    /// When the section begins again.
    fn lap_at(&self) -> Option<MonotonicNs> {
        let end = self.timeline.live(self.last());
        self.section.is_looped.then_some(end + LAP_PAUSE)
    }

    /// The moment of the flight at `now`, within the section.
    fn moment(&self, now: MonotonicNs) -> FlightNs {
        let moment = self.paused.unwrap_or_else(|| self.timeline.flight(now));
        // What is due and not played yet lies ahead.
        let next = self.flight.at(self.next).unwrap_or(FlightNs(u64::MAX));
        moment.min(next).min(self.last())
    }

    fn last(&self) -> FlightNs {
        self.flight.at(self.end - 1).unwrap_or_default()
    }

    fn since_start(&self, at: FlightNs) -> Duration {
        let start = self.flight.at(0).unwrap_or_default();
        Duration::from_nanos(at.0.saturating_sub(start.0))
    }
}

fn later(at: FlightNs, by: Duration) -> FlightNs {
    let ns = u64::try_from(by.as_nanos()).unwrap_or(u64::MAX);
    FlightNs(at.0.saturating_add(ns))
}
