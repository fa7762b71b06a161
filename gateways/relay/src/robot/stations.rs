//! [`Stations`]: which stations the robot's relay hears, and what became of their requests. A pure value.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use ipc_types::payload::{MAX_STATIONS, RelayStation, ascii_bytes};

use crate::orders::robot::OrderCounts;
use crate::orders::robot::places::{Heard, Places};

/// One station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Station {
    /// Its name.
    pub name: String,
    /// Life of its relay.
    pub life: u64,
    /// When it was heard last.
    pub heard: MonotonicNs,
    /// Since when it is heard, or is not.
    pub since: MonotonicNs,
    /// Whether it is heard.
    pub is_up: bool,
    /// Whether it may command.
    pub may_command: bool,
}

/// All stations, of which [`MAX_STATIONS`] are shown. One that is heard makes room for no other, but for one that may command when
/// it may not itself. Of those that are not heard the one goes that was silent longest, those that may not command first. One that
/// may not command never takes the place of one that may: its name may be made up.
#[derive(Clone, Debug)]
pub struct Stations {
    silent_after: Duration,
    list: Vec<Station>,
}

impl Stations {
    /// None yet.
    pub fn new(silent_after: Duration) -> Stations {
        Stations {
            silent_after,
            list: Vec::new(),
        }
    }

    /// A station has been heard. Says whether this is news.
    pub fn hear(&mut self, name: &str, life: u64, may_command: bool, now: MonotonicNs) -> bool {
        if let Some(station) = self.list.iter_mut().find(|station| station.name == name) {
            let is_news = !station.is_up || station.life != life;
            if is_news {
                station.since = now;
            }
            station.life = life;
            station.heard = now;
            station.is_up = true;
            return is_news;
        }
        if self.list.len() == MAX_STATIONS {
            let Some(index) = self.least(may_command) else {
                return false;
            };
            self.list.remove(index);
        }
        self.list.push(Station {
            name: name.to_owned(),
            life,
            heard: now,
            since: now,
            is_up: true,
            may_command,
        });
        true
    }

    /// Which station makes room for one that is new, and may or may not command.
    fn least(&self, may_command: bool) -> Option<usize> {
        let places = self.list.iter().enumerate();
        let gives_way = |station: &Station| match may_command {
            true => !station.is_up || !station.may_command,
            false => !station.is_up && !station.may_command,
        };
        let least = places
            .filter(|(_, station)| gives_way(station))
            .min_by_key(|(_, station)| (station.may_command, station.is_up, station.heard));
        least.map(|(index, _)| index)
    }

    /// The time passes. Says which stations are heard no more, by their names.
    pub fn pass(&mut self, now: MonotonicNs) -> Vec<String> {
        let mut gone = Vec::new();
        for station in &mut self.list {
            if station.is_up && now.since(station.heard) >= self.silent_after {
                station.is_up = false;
                station.since = now;
                gone.push(station.name.clone());
            }
        }
        gone
    }

    /// Whether a station is heard.
    pub fn is_any_up(&self) -> bool {
        self.list.iter().any(|station| station.is_up)
    }

    /// When a station is heard no more.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let up = self.list.iter().filter(|station| station.is_up);
        up.map(|station| station.heard + self.silent_after).min()
    }

    /// The stations as they are published. `samples_sent` went to all of them; `orders` says what became of those of a life, and
    /// nothing of one that has no session.
    pub fn rows(
        &self,
        samples_sent: u64,
        orders: impl Fn(u64) -> Option<OrderCounts>,
    ) -> Vec<RelayStation> {
        let row = |station: &Station| {
            let counts = orders(station.life);
            let refusal = match counts {
                _ if !station.may_command => Reason::RelayNotPermitted,
                None if station.is_up => Reason::RelayTooManyStations,
                _ => Reason::None,
            };
            let counts = counts.unwrap_or_default();
            RelayStation {
                name: ascii_bytes(&station.name),
                last_heard_ns: station.heard.0,
                since_ns: station.since.0,
                orders_executed: counts.executed,
                orders_refused: counts.refused,
                samples_sent,
                may_command: station.may_command.into(),
                is_up: station.is_up.into(),
                orders_open: counts.open as u32,
                refusal: refusal.code(),
            }
        };
        self.list.iter().map(row).collect()
    }
}

/// What the stations are called whose lives have a session. Its [places](Places) are those of the sessions, because it is given
/// the same clock messages.
#[derive(Clone, Debug, Default)]
pub struct Lives {
    names: Places<String>,
}

impl Lives {
    /// A clock message of a life has come from a station that may command. Says whether the station is to be given what the life
    /// has, a session or none: a life belongs to the station that has shown it first.
    pub fn admit(&mut self, life: u64, name: &str, now: MonotonicNs) -> bool {
        if self.name_of(life).is_some_and(|of_life| of_life != name) {
            return false;
        }
        if self.names.hear(life, now) == Heard::New {
            self.names.take(life, now, name.to_owned());
        }
        true
    }

    /// What the station of this life is called.
    pub fn name_of(&self, life: u64) -> Option<&str> {
        self.names.of(life).map(String::as_str)
    }
}

#[cfg(test)]
mod tests;
