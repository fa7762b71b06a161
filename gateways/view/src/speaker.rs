//! [`Speaker`]: which messages pages get, and when: values 20 times a second, words at changes and once a second,
//! events as they happen.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::MonotonicNs;
use operator::robot::clock::Clocks;
use operator::robot::model::WatchedRobot;

use crate::messages;
use crate::{Server, page};

/// How often words are sent again although they did not change.
const WORDS_PERIOD: Duration = Duration::from_secs(1);

/// How often values are sent again although no sample came: their ages grow.
const AGES_PERIOD: Duration = Duration::from_millis(500);

/// A robot that is shown, live or recorded.
#[derive(Clone, Copy)]
pub struct SpokenRobot<'a> {
    /// What is known of it.
    pub robot: &'a WatchedRobot,
    /// Whether something of it has come since the last look.
    pub has_news: bool,
}

/// The messages about a robot that were sent last.
#[derive(Default)]
struct Said {
    /// Number of the newest values.
    number: u64,
    values_at: MonotonicNs,
    /// Without what counts on by itself.
    words: Option<page::RobotStatus>,
    words_at: MonotonicNs,
    chart: Option<page::Chart>,
    /// Lines of its journal.
    lines: u64,
}

/// Says which messages pages get, and when.
#[derive(Default)]
pub struct Speaker {
    said: BTreeMap<u32, Said>,
    /// Without what counts on by itself.
    robots: Option<page::Robots>,
    robots_at: MonotonicNs,
}

impl Speaker {
    /// The next call of [`Speaker::speak`] sends everything about `robot` again, because a page has joined.
    pub fn joined(&mut self, robot: u32) {
        self.robots = None;
        if let Some(said) = self.said.get_mut(&robot) {
            (said.words, said.chart) = (None, None);
            said.values_at = MonotonicNs(0);
        }
    }

    /// A replay has jumped: the next call sends everything again. Events before that moment are in the `past` that
    /// pages get.
    pub fn moved<'a>(&mut self, robots: impl Iterator<Item = SpokenRobot<'a>>) {
        for seen in robots {
            let id = seen.robot.id.get();
            self.said.entry(id).or_default().lines = seen.robot.journal.added();
            self.joined(id);
        }
    }

    /// Sends what is due at `now`. In a replay, `clock` is the moment of the recording that is shown.
    pub fn speak<'a>(
        &mut self,
        robots: impl Iterator<Item = SpokenRobot<'a>>,
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
        let lasting = Some(messages::lasting_list(robots.clone()));
        if is_due || self.robots != lasting {
            server.send_robots(&robots);
            (self.robots, self.robots_at) = (lasting, now);
        }
    }
}

impl Said {
    fn speak(
        &mut self,
        seen: SpokenRobot<'_>,
        server: &mut Server,
        clock: Clocks,
        now: MonotonicNs,
    ) {
        let words = messages::robot(seen.robot, clock.now);
        let lasting = Some(messages::lasting(words.clone()));
        if now >= self.words_at + WORDS_PERIOD || self.words != lasting {
            server.robot(&words);
            (self.words, self.words_at) = (lasting, now);
        }
        let chart = messages::chart(seen.robot);
        let is_flying = seen.robot.pilot.flying == Some(true);
        let before = self.chart.as_ref();
        if before.is_none_or(|before| messages::is_another_chart(before, &chart, is_flying)) {
            server.chart(&chart);
            self.chart = Some(chart);
        }
        if seen.has_news || now >= self.values_at + AGES_PERIOD {
            self.number += 1;
            self.values_at = now;
            server.now(&messages::now(seen.robot, self.number, clock.now, now), now);
        }
    }

    /// Sends the events since the last call.
    fn events(&mut self, seen: SpokenRobot<'_>, server: &mut Server, clock: Clocks) {
        for line in seen.robot.journal.since(self.lines) {
            server.event(&messages::event(seen.robot, line, clock));
        }
        self.lines = seen.robot.journal.added();
    }
}
