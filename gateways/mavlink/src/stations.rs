//! [`Stations`]: which ground stations and scripts there are, and where messages go.
//!
//! | a station | its heartbeat | something else of it | silence for `lost_after` | silence for 30 s |
//! |---|---|---|---|---|
//! | not known | → heard; refused while there are eight | not known | – | – |
//! | heard | heard | heard | → lost | – |
//! | lost | → heard | → heard | lost | → gone |
//!
//! A sender is an address with a system and a component: several may be behind one router. Telemetry goes once to each address, answers
//! go to that of the asker.

use std::fmt;
use std::net::SocketAddr;
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

/// See the module's documentation.
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
    /// Whether that was too long ago.
    pub is_lost: bool,
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

    /// A heartbeat has come.
    pub fn heartbeat(&mut self, sender: StationAddress, now: MonotonicNs) -> HeartbeatOutcome {
        if self.touch(sender, now) {
            return HeartbeatOutcome::Known;
        }
        if self.heard.len() == MAX_STATIONS {
            return HeartbeatOutcome::Full;
        }
        let is_first = !self.is_heard(sender.address);
        self.heard.push(Station {
            sender,
            heard: now,
            is_lost: false,
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
        HeartbeatOutcome::New
    }

    /// Something else has come; whether its sender is a station.
    pub fn touch(&mut self, sender: StationAddress, now: MonotonicNs) -> bool {
        let known = self.heard.iter_mut().find(|one| one.sender == sender);
        let touch = |one: &mut Station| (one.heard, one.is_lost) = (now, false);
        known.map(touch).is_some()
    }

    /// A command of a station became an order.
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

    /// Those that are lost since the last call.
    pub fn take_lost(&mut self, now: MonotonicNs) -> Vec<StationAddress> {
        let limit = self.lost_after;
        let is_late = |one: &&mut Station| !one.is_lost && now.since(one.heard) >= limit;
        let late = self.heard.iter_mut().filter(is_late);
        late.map(|one| {
            one.is_lost = true;
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
            let heard = &self.heard;
            let is_heard =
                |route: &Route| heard.iter().any(|one| one.sender.address == route.address);
            self.routes
                .retain(|route| route.is_named || is_heard(route));
            for route in self.routes.iter_mut().filter(|route| !is_heard(route)) {
                route.streams = Streams::heartbeat_alone();
            }
        }
        gone
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

    #[test]
    fn a_station_comes_with_its_heartbeat_and_goes_with_silence() {
        let at = |seconds: u64| MonotonicNs(seconds * 1_000_000_000);
        let named = sender(1, 255);
        let mut stations = Stations::new(&[named.address], Duration::from_secs(10));
        assert!(!stations.touch(named, at(0)), "only a heartbeat opens it");
        assert_eq!(stations.heartbeat(named, at(0)), HeartbeatOutcome::New);
        assert_eq!(
            stations.heartbeat(sender(2, 1), at(0)),
            HeartbeatOutcome::New
        );
        assert_eq!(
            stations.heartbeat(sender(2, 2), at(5)),
            HeartbeatOutcome::New
        );
        assert_eq!(stations.routes.len(), 2, "one route for an address");
        assert_eq!(stations.heartbeat(named, at(20)), HeartbeatOutcome::Known);
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
                stations.heartbeat(sender(port, 255), now),
                HeartbeatOutcome::New
            );
        }
        assert_eq!(
            stations.heartbeat(sender(9, 255), now),
            HeartbeatOutcome::Full
        );
        assert_eq!(
            stations.heartbeat(sender(8, 255), now),
            HeartbeatOutcome::Known
        );
        assert_eq!(stations.routes.len(), 8);
    }
}
