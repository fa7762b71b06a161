//! [`Stations`]: which stations the robot's relay hears, and what became of their requests. A pure value.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::{MAX_STATIONS, RelayStation, ascii_bytes};

use crate::orders::robot::{LIFE_KEPT, SESSIONS};

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
    /// Requests that were handed to the robot's processes.
    pub orders_executed: u64,
    /// Requests that the relay refused.
    pub orders_refused: u64,
}

/// All stations, of which [`MAX_STATIONS`] are remembered: the one that was not heard for the longest time goes. One that may not
/// command never takes the place of one that may: its name may be made up.
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
            if station.life != life {
                (station.orders_executed, station.orders_refused) = (0, 0);
            }
            if is_news {
                station.since = now;
            }
            station.life = life;
            station.heard = now;
            station.is_up = true;
            return is_news;
        }
        if self.list.len() == MAX_STATIONS {
            let places = self.list.iter().enumerate();
            let oldest = places
                .filter(|(_, station)| may_command || !station.may_command)
                .min_by_key(|(_, station)| (station.may_command, station.heard));
            let Some((index, _)) = oldest else {
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
            orders_executed: 0,
            orders_refused: 0,
        });
        true
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

    /// The stations as they are published. `samples_sent` went to all of them.
    pub fn rows(&self, samples_sent: u64, orders_open: impl Fn(u64) -> usize) -> Vec<RelayStation> {
        let row = |station: &Station| RelayStation {
            name: ascii_bytes(&station.name),
            last_heard_ns: station.heard.0,
            since_ns: station.since.0,
            orders_executed: station.orders_executed,
            orders_refused: station.orders_refused,
            samples_sent,
            may_command: station.may_command.into(),
            is_up: station.is_up.into(),
            orders_open: orders_open(station.life) as u32,
            reserved: 0,
        };
        self.list.iter().map(row).collect()
    }
}

/// The lives of stations that have a session, at most [`SESSIONS`], and what their stations are called.
#[derive(Clone, Debug, Default)]
pub struct Lives {
    list: Vec<(u64, String, MonotonicNs)>,
}

impl Lives {
    /// A station that may command has been heard. Says whether it may have a session: when all places are taken by lives that were
    /// heard within [`LIFE_KEPT`], another one has to wait. So strangers that make lives up push out no station that is there.
    pub fn admit(&mut self, life: u64, name: &str, now: MonotonicNs) -> bool {
        if let Some((_, of_life, heard)) = self.list.iter_mut().find(|entry| entry.0 == life) {
            *heard = now;
            // A life belongs to the station that has shown it first.
            return of_life == name;
        }
        if self.list.len() == SESSIONS {
            let silent = |entry: &(u64, String, MonotonicNs)| now.since(entry.2) >= LIFE_KEPT;
            let oldest = (0..self.list.len()).min_by_key(|index| self.list[*index].2);
            match oldest.filter(|index| silent(&self.list[*index])) {
                Some(index) => self.list.remove(index),
                None => return false,
            };
        }
        self.list.push((life, name.to_owned(), now));
        true
    }

    /// What the station of this life is called.
    pub fn name_of(&self, life: u64) -> Option<&str> {
        let entry = self.list.iter().find(|entry| entry.0 == life);
        entry.map(|(_, name, _)| name.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    #[test]
    fn stations_come_fall_silent_and_come_again() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        assert!(stations.hear("gcs", 1, true, at(0)));
        assert!(!stations.hear("gcs", 1, true, at(500)));
        assert_eq!(stations.deadline(), Some(at(1500)));
        assert_eq!(stations.pass(at(1499)), Vec::<String>::new());
        assert_eq!(stations.pass(at(1500)), ["gcs"]);
        assert!(!stations.is_any_up() && stations.deadline().is_none());
        assert!(stations.hear("gcs", 1, true, at(2000)), "it is back");
        assert!(stations.hear("gcs", 2, true, at(2100)), "it was restarted");
    }

    #[test]
    fn the_station_that_was_not_heard_for_the_longest_time_is_forgotten() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        for index in 0..=MAX_STATIONS as u64 {
            stations.hear(&format!("gcs-{index}"), index, false, at(index));
        }
        let rows = stations.rows(0, |_| 0);
        assert_eq!(rows.len(), MAX_STATIONS);
        assert_eq!(rows[0].last_heard_ns, at(1).0);
    }

    #[test]
    fn a_made_up_name_takes_no_place_of_a_station_that_may_command() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        stations.hear("gcs", 1, true, at(0));
        for index in 0..100 {
            stations.hear(&format!("x{index}"), index, false, at(index));
        }
        let rows = stations.rows(0, |_| 0);
        assert_eq!(rows.len(), MAX_STATIONS);
        assert_eq!(rows[0].may_command, 1);
        let mut full = Stations::new(Duration::from_millis(1000));
        for index in 0..MAX_STATIONS as u64 {
            full.hear(&format!("gcs-{index}"), index, true, at(index));
        }
        assert!(!full.hear("x", 99, false, at(100)), "there is no room");
        assert!(full.hear("gcs-9", 99, true, at(100)));
    }

    #[test]
    fn made_up_lives_push_out_no_life_that_is_heard() {
        let mut lives = Lives::default();
        assert!(lives.admit(1, "gcs", at(0)));
        let mut admitted = 0;
        for ms in 1..60_000 {
            if ms % 500 == 0 {
                assert!(lives.admit(1, "gcs", at(ms)), "{ms}");
            }
            admitted += u64::from(lives.admit(1000 + ms, "gcs", at(ms)));
        }
        // Seven places, each for three seconds.
        assert!(admitted <= 7 * 60 / 3 + 7, "{admitted}");
        assert_eq!(lives.name_of(1), Some("gcs"));
        assert!(lives.list.len() <= SESSIONS);
    }

    #[test]
    fn a_life_that_is_silent_makes_room_and_no_other_station_can_take_it_over() {
        let mut lives = Lives::default();
        for life in 1..=SESSIONS as u64 {
            assert!(lives.admit(life, "gcs", at(life)));
        }
        assert!(!lives.admit(99, "gcs", at(3000)));
        assert!(lives.admit(99, "gcs", at(3001)));
        assert_eq!(lives.name_of(1), None);
        assert!(!lives.admit(99, "other", at(3002)));
        assert_eq!(lives.name_of(99), Some("gcs"));
    }
}
