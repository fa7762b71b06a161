//! [`Speaker`]: what is said to pages when: what flies 20 times a second, words when they change and once a second, events as they come.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::outline::Outline;
use view::{Server, page};

use super::messages;
use crate::robot::clock::Clocks;
use crate::robot::model::WatchedRobot;

/// How often words are said anew although they did not change.
const WORDS_PERIOD: Duration = Duration::from_secs(1);

/// How often values are said anew although nothing came: their ages grow.
const AGES_PERIOD: Duration = Duration::from_millis(500);

/// A robot that is shown, live or recorded.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub robot: &'a WatchedRobot,
    /// What its bridge holds; `None` if it has not said it.
    pub outline: Option<&'a Outline>,
    /// Whether something of it has come since the last look.
    pub has_news: bool,
}

/// What was said of a robot last.
#[derive(Default)]
struct Said {
    /// Number of the newest values.
    number: u64,
    values_at: MonotonicNs,
    words: Option<page::Robot>,
    words_at: MonotonicNs,
    chart: Option<page::Chart>,
    /// Lines of its journal.
    lines: u64,
}

/// See the module's documentation.
#[derive(Default)]
pub(super) struct Speaker {
    said: BTreeMap<u32, Said>,
    robots: Option<page::Robots>,
    robots_at: MonotonicNs,
}

impl Speaker {
    /// All is said anew at the next call of [`Speaker::speak`], because a page has come to `robot`.
    pub fn joined(&mut self, robot: u32) {
        self.robots = None;
        if let Some(said) = self.said.get_mut(&robot) {
            (said.words, said.chart) = (None, None);
            said.values_at = MonotonicNs(0);
        }
    }

    /// The robots are to be said as they are at another moment: what is in their journals is in the past that pages get.
    pub fn moved<'a>(&mut self, robots: impl Iterator<Item = Seen<'a>>) {
        for seen in robots {
            let id = seen.robot.id.get();
            self.said.entry(id).or_default().lines = seen.robot.journal.added();
            self.joined(id);
        }
    }

    /// Says what is due at `now`. The moment that the robots are shown at, `clock`, is another one in a replay.
    pub fn speak<'a>(
        &mut self,
        robots: impl Iterator<Item = Seen<'a>>,
        server: &mut Server,
        clock: Clocks,
        now: MonotonicNs,
    ) {
        let watched: Vec<u32> = server.watched().collect();
        let mut lines = Vec::new();
        for seen in robots {
            let robot = seen.robot.id.get();
            let said = self.said.entry(robot).or_default();
            if watched.contains(&robot) {
                said.speak(seen, server, clock, now);
            }
            said.events(seen, server, clock);
            lines.push(messages::summary(seen.robot, clock.now));
        }
        if server.has_viewers() {
            self.list(page::Robots { robots: lines }, server, now);
        }
    }

    fn list(&mut self, robots: page::Robots, server: &mut Server, now: MonotonicNs) {
        let is_due = now >= self.robots_at + WORDS_PERIOD;
        if is_due || self.robots.as_ref() != Some(&robots) {
            server.robots(&robots);
            (self.robots, self.robots_at) = (Some(robots), now);
        }
    }
}

impl Said {
    fn speak(&mut self, seen: Seen<'_>, server: &mut Server, clock: Clocks, now: MonotonicNs) {
        let words = messages::robot(seen.robot, clock.now);
        if now >= self.words_at + WORDS_PERIOD || self.words.as_ref() != Some(&words) {
            server.robot(&words);
            (self.words, self.words_at) = (Some(words), now);
        }
        let chart = messages::chart(seen.robot, seen.outline);
        if self.chart.as_ref() != Some(&chart) {
            server.chart(&chart);
            self.chart = Some(chart);
        }
        if seen.has_news || now >= self.values_at + AGES_PERIOD {
            self.number += 1;
            self.values_at = now;
            server.now(&messages::now(seen.robot, self.number, clock.now, now), now);
        }
    }

    /// Says what happened since the last call.
    fn events(&mut self, seen: Seen<'_>, server: &mut Server, clock: Clocks) {
        for line in seen.robot.journal.since(self.lines) {
            server.event(&messages::event(seen.robot, line, clock));
        }
        self.lines = seen.robot.journal.added();
    }
}
