//! [`Stations`]: which stations send to the robot's relay, and what became of their requests. A pure value.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use ipc_types::payload::{MAX_STATIONS, RelayStation, ascii_bytes};

use crate::names;
use crate::orders::robot::OrderCounts;

/// One station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Station {
    /// Its name.
    pub name: String,
    /// Instance of its relay.
    pub instance: u64,
    /// When its last message came.
    pub last_message: MonotonicNs,
    /// Since when it is up, or is not.
    pub since: MonotonicNs,
    /// Whether a message of it has come of late.
    pub is_up: bool,
    /// Whether it may command.
    pub may_command: bool,
}

/// All stations, of which [`MAX_STATIONS`] are shown. One that is up makes room for no other, but for one that may
/// command when it may not itself. Of those that are not up the one goes that was silent longest, those that may not
/// command first. One that may not command never takes the place of one that may: its name may be made up.
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

    /// A message of a station has come. Says whether the station was not there before, or was restarted.
    pub fn note_message(
        &mut self,
        name: &str,
        instance: u64,
        may_command: bool,
        now: MonotonicNs,
    ) -> bool {
        if let Some(station) = self.list.iter_mut().find(|station| station.name == name) {
            let is_changed = !station.is_up || station.instance != instance;
            if is_changed {
                station.since = now;
            }
            station.instance = instance;
            station.last_message = now;
            station.is_up = true;
            return is_changed;
        }
        if self.list.len() == MAX_STATIONS {
            let Some(index) = self.least(may_command) else {
                return false;
            };
            self.list.remove(index);
        }
        self.list.push(Station {
            name: name.to_owned(),
            instance,
            last_message: now,
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
            .min_by_key(|(_, station)| (station.may_command, station.is_up, station.last_message));
        least.map(|(index, _)| index)
    }

    /// The time passes. Says which stations have fallen silent, by their names.
    pub fn tick(&mut self, now: MonotonicNs) -> Vec<String> {
        let mut gone = Vec::new();
        for station in &mut self.list {
            if station.is_up && now.since(station.last_message) >= self.silent_after {
                station.is_up = false;
                station.since = now;
                gone.push(station.name.clone());
            }
        }
        gone
    }

    /// Whether a station is up.
    pub fn is_any_up(&self) -> bool {
        self.list.iter().any(|station| station.is_up)
    }

    /// When a station has been silent for too long.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let up = self.list.iter().filter(|station| station.is_up);
        up.map(|station| station.last_message + self.silent_after)
            .min()
    }

    /// The stations as they are published. `samples_sent` went to all of them; `orders` says what became of those of an
    /// instance, `None` if it has no session.
    pub fn rows(
        &self,
        samples_sent: u64,
        orders: impl Fn(u64) -> Option<OrderCounts>,
    ) -> Vec<RelayStation> {
        let row = |station: &Station| {
            let counts = orders(station.instance);
            let refusal = match counts {
                _ if !station.may_command => Reason::RelayNotPermitted,
                None if station.is_up => Reason::RelayTooManyStations,
                _ => Reason::None,
            };
            let counts = counts.unwrap_or_default();
            RelayStation {
                name: ascii_bytes(&station.name),
                last_heard_ns: station.last_message.0,
                since_ns: station.since.0,
                last_order_ns: counts.last.0,
                orders_executed: counts.executed,
                orders_refused: counts.refused,
                samples_sent,
                may_command: station.may_command.into(),
                is_up: station.is_up.into(),
                orders_open: counts.open as u32,
                refusal: refusal.code(),
                origin: names::origin(station.instance),
                reserved: 0,
            }
        };
        self.list.iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::orders::message::NO_PLACE;
    use crate::orders::robot::{Config, INSTANCE_KEPT, RobotOrders, SESSIONS};

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn none(_: u64) -> Option<OrderCounts> {
        None
    }

    /// The names that are shown, and why their requests are refused.
    fn shown(rows: &[RelayStation]) -> Vec<(&str, Option<Reason>)> {
        let row = |row| -> (&str, Option<Reason>) {
            let row: &RelayStation = row;
            (row.name().unwrap(), row.refusal())
        };
        rows.iter().map(row).collect()
    }

    #[test]
    fn stations_come_fall_silent_and_come_again() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        assert!(stations.note_message("gcs", 1, true, at(0)));
        assert!(!stations.note_message("gcs", 1, true, at(500)));
        assert_eq!(stations.deadline(), Some(at(1500)));
        assert_eq!(stations.tick(at(1499)), Vec::<String>::new());
        assert_eq!(stations.tick(at(1500)), ["gcs"]);
        assert!(!stations.is_any_up() && stations.deadline().is_none());
        assert!(
            stations.note_message("gcs", 1, true, at(2000)),
            "it is back"
        );
        assert!(
            stations.note_message("gcs", 2, true, at(2100)),
            "it was restarted"
        );
    }

    #[test]
    fn of_the_stations_that_are_not_up_the_one_that_was_silent_longest_is_forgotten() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        for index in 0..MAX_STATIONS as u64 {
            stations.note_message(&format!("gcs-{index}"), index, false, at(index));
        }
        stations.tick(at(1002));
        assert!(stations.note_message("new", 99, false, at(1002)));
        let rows = stations.rows(0, none);
        assert_eq!(rows.len(), MAX_STATIONS);
        assert_eq!(rows[0].last_heard_ns, at(1).0);
    }

    #[test]
    fn stations_that_are_up_keep_their_rows_however_many_there_are() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        for ms in (0..60_000).step_by(500) {
            for index in 0..2 * MAX_STATIONS as u64 {
                let is_changed = stations.note_message(&format!("x{index}"), index, false, at(ms));
                let is_first = ms == 0 && index < MAX_STATIONS as u64;
                assert_eq!(is_changed, is_first, "{index} at {ms} ms");
            }
            assert_eq!(stations.tick(at(ms)), Vec::<String>::new());
        }
        assert!(
            stations.note_message("gcs", 99, true, at(60_000)),
            "it may command"
        );
        let rows = stations.rows(0, none);
        assert_eq!(rows.len(), MAX_STATIONS);
        assert_eq!(shown(&rows)[MAX_STATIONS - 1].0, "gcs");
    }

    #[test]
    fn a_made_up_name_takes_no_place_of_a_station_that_may_command() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        stations.note_message("gcs", 1, true, at(0));
        for index in 0..100 {
            stations.tick(at(2000 * index));
            stations.note_message(&format!("x{index}"), index, false, at(2000 * index));
        }
        let rows = stations.rows(0, none);
        assert_eq!(rows.len(), MAX_STATIONS);
        assert_eq!(rows[0].may_command, 1);
        let mut full = Stations::new(Duration::from_millis(1000));
        for index in 0..MAX_STATIONS as u64 {
            full.note_message(&format!("gcs-{index}"), index, true, at(index));
        }
        full.tick(at(5000));
        assert!(
            !full.note_message("x", 99, false, at(5000)),
            "there is no room"
        );
        assert!(full.note_message("gcs-new", 99, true, at(5000)));
    }

    /// What the robot's side does with a clock message: the session in its answer.
    fn pong(
        (stations, orders): (&mut Stations, &mut RobotOrders),
        instance: u64,
        now: MonotonicNs,
    ) -> u64 {
        let name = format!("gcs-{instance}");
        let _ = stations.note_message(&name, instance, true, now);
        orders.session_for(instance, &name, now, &mut Vec::new())
    }

    #[test]
    fn the_ninth_active_station_is_refused_and_shown_with_the_reason_until_a_place_is_free() {
        const ALL: u64 = SESSIONS as u64 + 1;
        let mut stations = Stations::new(Duration::from_millis(2500));
        let mut orders = RobotOrders::new(Config::default(), 1);
        let mut first = Vec::new();
        for ms in (0..60_000).step_by(500) {
            let mut sessions = Vec::new();
            for instance in 1..=ALL {
                let side = (&mut stations, &mut orders);
                sessions.push(pong(side, instance, at(ms)));
            }
            assert_eq!(sessions.last(), Some(&NO_PLACE));
            if first.is_empty() {
                first.clone_from(&sessions);
            }
            assert_eq!(sessions, first, "no session is ever lost");
        }
        let rows = stations.rows(0, |instance| orders.counts_of(instance));
        let shown_rows = shown(&rows);
        assert_eq!(shown_rows.len(), SESSIONS + 1);
        assert_eq!(shown_rows[0], ("gcs-1", Some(Reason::None)));
        let refused = ("gcs-9", Some(Reason::RelayTooManyStations));
        assert_eq!(shown_rows[SESSIONS], refused);
        assert_eq!(orders.name_of(ALL), None);
        // The first one ends.
        let free = at(59_500) + INSTANCE_KEPT;
        for instance in 2..ALL {
            pong((&mut stations, &mut orders), instance, free);
        }
        stations.tick(free);
        assert!(pong((&mut stations, &mut orders), ALL, free) > NO_PLACE);
        let rows = stations.rows(0, |instance| orders.counts_of(instance));
        let shown_rows = shown(&rows);
        assert_eq!(shown_rows[0], ("gcs-1", Some(Reason::None)), "it is silent");
        assert_eq!(shown_rows[SESSIONS], ("gcs-9", Some(Reason::None)));
        assert_eq!(
            (orders.name_of(1), orders.name_of(ALL)),
            (None, Some("gcs-9"))
        );
    }

    #[test]
    fn a_station_that_may_not_command_is_shown_with_that() {
        let mut stations = Stations::new(Duration::from_millis(1000));
        stations.note_message("viewer", 1, false, at(0));
        let rows = stations.rows(0, none);
        assert_eq!(shown(&rows), [("viewer", Some(Reason::RelayNotPermitted))]);
    }
}
