//! [`Speaker`]: what is said to pages when: what flies 20 times a second, words when they change and once a second, events as they come.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::MonotonicNs;
use view::{Server, page};

use super::fleet::{Fleet, Shown};
use super::messages;
use crate::robot::clock::Clocks;

/// How often words are said anew although they did not change.
const WORDS_PERIOD: Duration = Duration::from_secs(1);

/// How often values are said anew although nothing came: their ages grow.
const AGES_PERIOD: Duration = Duration::from_millis(500);

/// What was said of a robot last.
#[derive(Default)]
struct Said {
    /// Number of the newest values.
    number: u64,
    values_at: MonotonicNs,
    words: Option<page::Robot>,
    words_at: MonotonicNs,
    chart: Option<page::Chart>,
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

    /// Says what is due.
    pub fn speak(&mut self, fleet: &mut Fleet, server: &mut Server, clock: Clocks) {
        let watched: Vec<u32> = server.watched().collect();
        for shown in fleet.iter_mut() {
            let robot = shown.robot.id.get();
            if watched.contains(&robot) {
                let said = self.said.entry(robot).or_default();
                said.speak(shown, server, clock);
            }
            events(shown, server, clock);
            shown.has_news = false;
        }
        if server.has_viewers() {
            self.list(fleet, server, clock.now);
        }
    }

    fn list(&mut self, fleet: &Fleet, server: &mut Server, now: MonotonicNs) {
        let robots = fleet.iter().map(|one| messages::summary(&one.robot, now));
        let robots = page::Robots {
            robots: robots.collect(),
        };
        let is_due = now >= self.robots_at + WORDS_PERIOD;
        if is_due || self.robots.as_ref() != Some(&robots) {
            server.robots(&robots);
            (self.robots, self.robots_at) = (Some(robots), now);
        }
    }
}

impl Said {
    fn speak(&mut self, shown: &Shown, server: &mut Server, clock: Clocks) {
        let now = clock.now;
        let words = messages::robot(&shown.robot, now);
        if now >= self.words_at + WORDS_PERIOD || self.words.as_ref() != Some(&words) {
            server.robot(&words);
            (self.words, self.words_at) = (Some(words), now);
        }
        let chart = messages::chart(&shown.robot, shown.ports.outline());
        if self.chart.as_ref() != Some(&chart) {
            server.chart(&chart);
            self.chart = Some(chart);
        }
        if shown.has_news || now >= self.values_at + AGES_PERIOD {
            self.number += 1;
            self.values_at = now;
            server.now(&messages::now(&shown.robot, self.number, now), now);
        }
    }
}

/// Says what happened since the last call.
fn events(shown: &mut Shown, server: &mut Server, clock: Clocks) {
    for line in shown.robot.journal.since(shown.said_lines) {
        server.event(&messages::event(&shown.robot, line, clock));
    }
    shown.said_lines = shown.robot.journal.added();
}
