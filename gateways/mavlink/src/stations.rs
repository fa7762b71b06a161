//! [`Stations`]: which ground stations and scripts there are, and where messages go.
//!
//! | a station | its heartbeat | something else of it | silence for `lost_after` | silence for 30 s |
//! |---|---|---|---|---|
//! | not known | → heard; while there are eight, only in the place of another one | not known | – | – |
//! | heard | heard | heard | → lost | – |
//! | lost | → heard | → heard | lost | → gone |
//!
//! A sender is an address with a system and a component: several may be behind one router. Telemetry goes once to each
//! address, answers go to that of the asker.
//!
//! While there are eight, a new one gets the place of one that has commanded nothing, the first that there is of
//!
//! 1. one that may not command, if the new one may;
//! 2. one that may command as little or as much as the new one, of the machine that has most of them, if it has more
//!    than the machine of the new one then has.
//!
//! Of these the station that has come last gives its place up. So a program that invents numbers takes the places of
//! its own machine, a station of another machine always finds one, and one that flies the helicopter keeps its own. A
//! *machine* is an IP address, and on this machine, where it is a program, an address with its port.

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::streams::Streams;

/// Most stations at a time: a further one gets no telemetry, and its commands are refused.
pub const MAX_STATIONS: usize = 8;

/// A station is gone when nothing of it came for so long.
pub const SILENCE: Duration = Duration::from_secs(30);

/// Who sends a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StationAddress {
    pub address: SocketAddr,
    pub system: u8,
    pub component: u8,
}

impl StationAddress {
    /// All stations at an address; no station has these numbers.
    pub fn all_at(address: SocketAddr) -> StationAddress {
        StationAddress {
            address,
            system: 0,
            component: 0,
        }
    }

    /// Where places are counted: a program of this machine, or another machine.
    fn machine(&self) -> (IpAddr, u16) {
        match self.address.ip() {
            ip if ip.is_loopback() => (ip, self.address.port()),
            ip => (ip, 0),
        }
    }
}

impl fmt::Display for StationAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "station {}/{}", self.system, self.component)
    }
}

/// What a heartbeat made of its sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeartbeatOutcome {
    /// It has come.
    New,
    /// It was there.
    Known,
    /// It has come, in the place of this one.
    Instead(StationAddress),
    /// There is no room for it.
    Full,
}

/// An address that messages go to.
#[derive(Clone, Debug)]
pub struct Route {
    pub address: SocketAddr,
    /// Counts the frames.
    sequence: u8,
    pub streams: Streams,
    /// Whether the operator has named it: it stays when no station is there.
    is_named: bool,
}

impl Route {
    /// The number of the next frame.
    pub fn next_sequence(&mut self) -> u8 {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        sequence
    }
}

/// The ground stations and scripts that were heard, and the routes by which messages go to them.
#[derive(Clone, Debug)]
pub struct Stations {
    heard: Vec<Station>,
    routes: Vec<Route>,
    lost_after: Duration,
}

/// A station that is there.
#[derive(Clone, Copy, Debug)]
pub struct Station {
    pub sender: StationAddress,
    /// When something of it came last.
    pub heard: MonotonicNs,
    /// Whether that was too long ago, and since when that is known.
    pub is_lost: bool,
    lost_at: MonotonicNs,
    /// Since when it is there.
    pub since: MonotonicNs,
    /// When its last command became an order.
    pub last_command: Option<MonotonicNs>,
    /// How many of its commands did.
    pub commands: u64,
    /// How many were answered with a refusal.
    pub refused: u64,
}

impl Stations {
    /// None yet, and the addresses that get a heartbeat unasked.
    pub fn new(named: &[SocketAddr], lost_after: Duration) -> Stations {
        let route = |address: &SocketAddr| Route {
            address: *address,
            sequence: 0,
            streams: Streams::heartbeat_alone(),
            is_named: true,
        };
        Stations {
            heard: Vec::new(),
            routes: named.iter().map(route).collect(),
            lost_after,
        }
    }

    /// A heartbeat has come. `may_command` says it of each station.
    pub fn heartbeat(
        &mut self,
        sender: StationAddress,
        may_command: impl Fn(StationAddress) -> bool,
        now: MonotonicNs,
    ) -> HeartbeatOutcome {
        if self.touch(sender, now) {
            return HeartbeatOutcome::Known;
        }
        let mut outcome = HeartbeatOutcome::New;
        if self.heard.len() == MAX_STATIONS {
            let Some(place) = self.place_for(sender, may_command) else {
                return HeartbeatOutcome::Full;
            };
            outcome = HeartbeatOutcome::Instead(self.heard.remove(place).sender);
            self.forget_routes();
        }
        let is_first = !self.is_heard(sender.address);
        self.heard.push(Station {
            sender,
            heard: now,
            is_lost: false,
            lost_at: now,
            since: now,
            last_command: None,
            commands: 0,
            refused: 0,
        });
        match self.route(sender.address) {
            // What the new station has not seen is sent at once.
            Some(route) if is_first => route.streams = Streams::new(now),
            Some(_) => {}
            None => self.routes.push(Route {
                address: sender.address,
                sequence: 0,
                streams: Streams::new(now),
                is_named: false,
            }),
        }
        outcome
    }

    /// Whose place a new station gets.
    fn place_for(
        &self,
        sender: StationAddress,
        may_command: impl Fn(StationAddress) -> bool,
    ) -> Option<usize> {
        let of_machine = |sender: StationAddress| {
            let own = self.heard.iter().map(|one| one.sender.machine());
            own.filter(|machine| *machine == sender.machine()).count()
        };
        let (may, own) = (may_command(sender), of_machine(sender));
        let rank = |one: &Station| {
            let (its_may, its) = (may_command(one.sender), of_machine(one.sender));
            let gives_way = may && !its_may || may == its_may && its > own + 1;
            let is_free = one.last_command.is_none();
            (is_free && gives_way).then_some((!its_may, its, one.since))
        };
        let ranked = self.heard.iter().enumerate();
        let ranked = ranked.filter_map(|(place, one)| Some((rank(one)?, place)));
        ranked.max().map(|(_, place)| place)
    }

    /// Something else came at this moment; whether its sender is a station. What has waited to be read since before the
    /// station was found to be lost says nothing of now.
    pub fn touch(&mut self, sender: StationAddress, came: MonotonicNs) -> bool {
        let known = self.heard.iter_mut().find(|one| one.sender == sender);
        let touch = |one: &mut Station| {
            one.heard = one.heard.max(came);
            one.is_lost &= came < one.lost_at;
        };
        known.map(touch).is_some()
    }

    /// A command of a station became an order, or a hold is done already.
    pub fn count_command(&mut self, sender: StationAddress, now: MonotonicNs) {
        if let Some(one) = self.heard.iter_mut().find(|one| one.sender == sender) {
            one.commands += 1;
            one.last_command = Some(now);
        }
    }

    /// A command of a station was refused.
    pub fn count_refusal(&mut self, sender: StationAddress) {
        if let Some(one) = self.heard.iter_mut().find(|one| one.sender == sender) {
            one.refused += 1;
        }
    }

    /// All that are there.
    pub fn all(&self) -> &[Station] {
        &self.heard
    }

    /// The stations that were lost since the last call.
    pub fn take_lost(&mut self, now: MonotonicNs) -> Vec<StationAddress> {
        let limit = self.lost_after;
        let is_late = |one: &&mut Station| !one.is_lost && now.since(one.heard) >= limit;
        let late = self.heard.iter_mut().filter(is_late);
        late.map(|one| {
            (one.is_lost, one.lost_at) = (true, now);
            one.sender
        })
        .collect()
    }

    /// Takes those that are gone.
    pub fn expire(&mut self, now: MonotonicNs) -> Vec<StationAddress> {
        let is_gone = |one: &Station| now.since(one.heard) >= SILENCE;
        let gone = self.heard.iter().filter(|one| is_gone(one));
        let gone: Vec<StationAddress> = gone.map(|one| one.sender).collect();
        if !gone.is_empty() {
            self.heard.retain(|one| !is_gone(one));
            self.forget_routes();
        }
        gone
    }

    /// Addresses without a station get nothing but the heartbeat, and that only when the operator has named them.
    fn forget_routes(&mut self) {
        let heard = &self.heard;
        let is_heard = |route: &Route| heard.iter().any(|one| one.sender.address == route.address);
        self.routes
            .retain(|route| route.is_named || is_heard(route));
        for route in self.routes.iter_mut().filter(|route| !is_heard(route)) {
            route.streams = Streams::heartbeat_alone();
        }
    }

    /// When the next one is lost or gone unless it sends something.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let limit = |one: &Station| match one.is_lost {
            true => SILENCE,
            false => self.lost_after,
        };
        self.heard.iter().map(|one| one.heard + limit(one)).min()
    }

    /// Whether a station is at this address.
    pub fn is_heard(&self, address: SocketAddr) -> bool {
        self.heard.iter().any(|one| one.sender.address == address)
    }

    /// Whether there is room for no other.
    pub fn is_full(&self) -> bool {
        self.heard.len() == MAX_STATIONS
    }

    /// Whether there is any.
    pub fn is_empty(&self) -> bool {
        self.heard.is_empty()
    }

    /// All addresses.
    pub fn routes(&mut self) -> impl Iterator<Item = &mut Route> {
        self.routes.iter_mut()
    }

    /// The addresses of stations that were heard.
    pub fn addresses(&self) -> Vec<SocketAddr> {
        let routes = self.routes.iter().map(|route| route.address);
        routes.filter(|address| self.is_heard(*address)).collect()
    }

    /// One address.
    pub fn route(&mut self, address: SocketAddr) -> Option<&mut Route> {
        self.routes
            .iter_mut()
            .find(|route| route.address == address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sender(port: u16, system: u8) -> StationAddress {
        StationAddress {
            address: ([127, 0, 0, 1], port).into(),
            system,
            component: 190,
        }
    }

    /// Who may command: all.
    fn all(_: StationAddress) -> bool {
        true
    }

    #[test]
    fn a_station_comes_with_its_heartbeat_and_goes_with_silence() {
        let at = |seconds: u64| MonotonicNs(seconds * 1_000_000_000);
        let named = sender(1, 255);
        let mut stations = Stations::new(&[named.address], Duration::from_secs(10));
        assert!(!stations.touch(named, at(0)), "only a heartbeat opens it");
        assert_eq!(stations.heartbeat(named, all, at(0)), HeartbeatOutcome::New);
        assert_eq!(
            stations.heartbeat(sender(2, 1), all, at(0)),
            HeartbeatOutcome::New
        );
        assert_eq!(
            stations.heartbeat(sender(2, 2), all, at(5)),
            HeartbeatOutcome::New
        );
        assert_eq!(stations.routes.len(), 2, "one route for an address");
        assert_eq!(
            stations.heartbeat(named, all, at(20)),
            HeartbeatOutcome::Known
        );
        assert_eq!(stations.deadline(), Some(at(10)));
        assert_eq!(stations.take_lost(at(10)), [sender(2, 1)]);
        assert_eq!(stations.take_lost(at(14)), [], "it is told once");
        assert_eq!(stations.take_lost(at(15)), [sender(2, 2)]);
        assert!(stations.touch(sender(2, 2), at(16)));
        assert_eq!(stations.take_lost(at(26)), [sender(2, 2)]);
        assert_eq!(stations.deadline(), Some(at(30)));
        assert_eq!(stations.expire(at(29)), []);
        assert_eq!(stations.expire(at(30)), [sender(2, 1)]);
        assert!(stations.is_heard(sender(2, 2).address));
        assert_eq!(stations.expire(at(60)), [named, sender(2, 2)]);
        // The named one stays.
        assert_eq!(stations.routes.len(), 1);
        assert!(stations.is_empty());
    }

    #[test]
    fn there_are_at_most_eight() {
        let mut stations = Stations::new(&[], Duration::from_secs(10));
        let now = MonotonicNs(0);
        for port in 1..=8 {
            assert_eq!(
                stations.heartbeat(sender(port, 255), all, now),
                HeartbeatOutcome::New
            );
        }
        assert_eq!(
            stations.heartbeat(sender(9, 255), all, now),
            HeartbeatOutcome::Full
        );
        assert_eq!(
            stations.heartbeat(sender(8, 255), all, now),
            HeartbeatOutcome::Known
        );
        assert_eq!(stations.routes.len(), 8);
    }

    /// Eight stations at these ports, in this order; those with odd systems may command. Which of them a further one
    /// displaces.
    #[track_caller]
    fn displaced(
        there: [(u16, u8); 8],
        commanded: &[u8],
        new: (u16, u8),
    ) -> Option<StationAddress> {
        let may = |one: StationAddress| one.system % 2 == 1;
        let mut stations = Stations::new(&[], Duration::from_secs(10));
        for (at, (port, system)) in there.into_iter().enumerate() {
            let came = stations.heartbeat(sender(port, system), may, MonotonicNs(at as u64));
            assert_eq!(came, HeartbeatOutcome::New);
            if commanded.contains(&system) {
                stations.count_command(sender(port, system), MonotonicNs(9));
            }
        }
        match stations.heartbeat(sender(new.0, new.1), may, MonotonicNs(10)) {
            HeartbeatOutcome::Instead(station) => {
                let is_heard =
                    |one: StationAddress| stations.heard.iter().any(|heard| heard.sender == one);
                assert!(is_heard(sender(new.0, new.1)) && !is_heard(station));
                Some(station)
            }
            HeartbeatOutcome::Full => None,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_ninth_gets_the_place_of_one_that_has_less_right_to_it() {
        let crowd = [
            (1, 11),
            (1, 13),
            (1, 15),
            (1, 17),
            (1, 19),
            (1, 21),
            (1, 23),
            (1, 25),
        ];
        // Of a machine with many, the last that has come and has commanded nothing.
        assert_eq!(displaced(crowd, &[], (2, 255)), Some(sender(1, 25)));
        assert_eq!(displaced(crowd, &[25, 23], (2, 255)), Some(sender(1, 21)));
        assert_eq!(displaced(crowd, &[], (1, 255)), None);
        assert_eq!(displaced(crowd, &[], (2, 254)), None, "it may not command");
        // Equally many stay.
        let halves = [
            (1, 11),
            (1, 13),
            (1, 15),
            (1, 17),
            (2, 19),
            (2, 21),
            (2, 23),
            (2, 25),
        ];
        assert_eq!(displaced(halves, &[], (1, 255)), None);
        assert_eq!(displaced(halves, &[], (3, 255)), Some(sender(2, 25)));
        // Who may not command gives way to who may, whatever the machine; the most crowded one first.
        let mixed = [
            (1, 11),
            (1, 12),
            (2, 14),
            (2, 16),
            (2, 18),
            (1, 13),
            (1, 15),
            (1, 17),
        ];
        assert_eq!(displaced(mixed, &[], (1, 255)), Some(sender(1, 12)));
        let mixed = [
            (1, 11),
            (1, 12),
            (2, 14),
            (2, 16),
            (2, 18),
            (2, 20),
            (1, 15),
            (1, 17),
        ];
        assert_eq!(displaced(mixed, &[], (1, 255)), Some(sender(2, 20)));
        assert_eq!(displaced(mixed, &[20], (1, 255)), Some(sender(2, 18)));
        // On another machine the port does not count.
        let far = |port| StationAddress {
            address: ([10, 0, 0, 1], port).into(),
            ..sender(port, 255)
        };
        assert_eq!(far(1).machine(), far(2).machine());
        assert_ne!(sender(1, 255).machine(), sender(2, 255).machine());
    }
}
