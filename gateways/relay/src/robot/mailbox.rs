//! [`Mailbox`]: what stations ask and order, as far as [`Admission`] lets it be read.
//!
//! A station that is named in the configuration has budgets of its own; all others share one. So one that floods, or an
//! attacker with many names, takes nothing from a station that is named. Where no certificates are used an attacker can
//! take the name of a station, and with it its budgets.

use std::num::NonZeroU32;

use ipc_types::MonotonicNs;
use serde::de::DeserializeOwned;

use crate::budget::Budget;
use crate::config::{Config, check_name};
use crate::message::{Ask, MAX_ASK_BYTES, MAX_ORDER_BYTES, Unreadable, decode};
use crate::names;
use crate::network::{Inbox, Network, NetworkError, Room};
use crate::orders::message::Order;

/// Messages that may wait: a station sends a few for each of its at most 32 open requests, and eight stations are
/// served.
const INBOX: usize = 512;

/// Room for questions.
const ASK_ROOM: Room = Room {
    messages: INBOX,
    bytes: INBOX * MAX_ASK_BYTES,
    longest: MAX_ASK_BYTES,
};

/// Room for orders.
const ORDER_ROOM: Room = Room {
    messages: INBOX,
    bytes: ORDER_BYTES,
    longest: MAX_ORDER_BYTES,
};

/// Bytes of orders that may wait: as many of the longest as 256, of the robot's own as wait at all.
const ORDER_BYTES: usize = 256 * MAX_ORDER_BYTES;

/// What stations send.
pub struct Mailbox {
    asks: Inbox,
    orders: Inbox,
    unreadable: Unreadable,
}

/// A message of a station.
#[derive(Clone, Debug, PartialEq)]
pub struct Mail<M> {
    /// Name of the station.
    pub station: String,
    /// What it says.
    pub message: M,
    /// When it came.
    pub at: MonotonicNs,
}

impl Mailbox {
    /// Receives what stations ask and order from now on.
    ///
    /// # Errors
    ///
    /// When the network refuses it.
    pub fn open(
        network: &Network,
        robot: NonZeroU32,
        config: &Config,
    ) -> Result<Mailbox, NetworkError> {
        let receive = |key: fn(NonZeroU32, &str) -> String, room| {
            let named = config.stations().map(|(name, _)| key(robot, name));
            network.receive(&key(robot, "*"), named.collect(), room)
        };
        Ok(Mailbox {
            asks: receive(names::ask, ASK_ROOM)?,
            orders: receive(names::order, ORDER_ROOM)?,
            unreadable: Unreadable::default(),
        })
    }

    /// Takes the questions that have come.
    pub fn asks(&mut self, admission: &mut Admission, now: MonotonicNs) -> Vec<Mail<Ask>> {
        read(&self.asks, &mut self.unreadable, |key| {
            admission.asks(key, now)
        })
    }

    /// Takes the orders that have come.
    pub fn orders(&mut self, admission: &mut Admission, now: MonotonicNs) -> Vec<Mail<Order>> {
        read(&self.orders, &mut self.unreadable, |key| {
            admission.orders(key, now)
        })
    }
}

/// `admit` says whose the messages under a key are, when they are to be read.
fn read<M: DeserializeOwned>(
    inbox: &Inbox,
    unreadable: &mut Unreadable,
    mut admit: impl FnMut(&str) -> Option<&str>,
) -> Vec<Mail<M>> {
    let mut mail = Vec::new();
    inbox.drain(|incoming| {
        let Some(station) = admit(incoming.key) else {
            return;
        };
        match decode(incoming.payload) {
            Ok(message) => mail.push(Mail {
                station: station.to_owned(),
                message,
                at: incoming.at,
            }),
            Err(error) => unreadable.note(incoming.key, &error),
        }
    });
    mail
}

/// Messages a second of a station that is named, and at once. It sends at most five pings, and asks for
/// descriptions, of each of 128 services at once when they are short; for more parts it waits.
const ASKS: (u64, u64) = (50, 256);

/// Messages a second of all other stations together, and at once: eight stations.
const ASKS_OF_OTHERS: (u64, u64) = (100, 512);

/// Orders a second of a station that may command, and at once: 32 open ones, each a few times a second.
const ORDERS: (u64, u64) = (500, 512);

/// Bytes a second of descriptions of services, and at once: all that three stations ask for of twenty services, 3 kB
/// each, or one of the greatest length. One question of 14 bytes brings up to 4 KiB.
const DESCRIPTIONS: (u64, u64) = (65_536, 262_144);

/// Lines of the log a second about stations that come, and at once.
const LINES: (u64, u64) = (1, 20);

/// Which messages are read, and how many of each station.
#[derive(Clone, Debug)]
pub struct Admission {
    ask_prefix: String,
    order_prefix: String,
    named: Vec<Named>,
    asks_of_others: Budget,
    descriptions: Budget,
    lines: Budget,
}

#[derive(Clone, Debug)]
struct Named {
    name: String,
    may_command: bool,
    asks: Budget,
    orders: Budget,
}

impl Admission {
    /// To the relay of `robot`. `stations` are those that are named, and whether they may command.
    pub fn new<'a>(
        robot: NonZeroU32,
        stations: impl Iterator<Item = (&'a String, bool)>,
    ) -> Admission {
        Admission {
            // The rest of a key is the station's name.
            ask_prefix: names::ask(robot, ""),
            order_prefix: names::order(robot, ""),
            named: stations
                .map(|(name, may_command)| Named {
                    name: name.clone(),
                    may_command,
                    asks: Budget::new(ASKS.0, ASKS.1),
                    orders: Budget::new(ORDERS.0, ORDERS.1),
                })
                .collect(),
            asks_of_others: Budget::new(ASKS_OF_OTHERS.0, ASKS_OF_OTHERS.1),
            descriptions: Budget::new(DESCRIPTIONS.0, DESCRIPTIONS.1),
            lines: Budget::new(LINES.0, LINES.1),
        }
    }

    /// Whether this station may command.
    pub fn may_command(&self, station: &str) -> bool {
        let mut named = self.named.iter();
        named.any(|named| named.name == station && named.may_command)
    }

    /// The station whose question under this key is to be read.
    pub fn asks<'a>(&mut self, key: &'a str, now: MonotonicNs) -> Option<&'a str> {
        let name = key.strip_prefix(&self.ask_prefix)?;
        // A name is part of the key that is answered to: `*` would be all stations.
        check_name(name).ok()?;
        let named = self.named.iter_mut().find(|named| named.name == name);
        let budget = match named {
            Some(named) => &mut named.asks,
            None => &mut self.asks_of_others,
        };
        budget.grant(1, now).then_some(name)
    }

    /// The station whose order under this key is to be read: one that may command.
    pub fn orders<'a>(&mut self, key: &'a str, now: MonotonicNs) -> Option<&'a str> {
        let name = key.strip_prefix(&self.order_prefix)?;
        let mut named = self.named.iter_mut();
        let named = named.find(|named| named.name == name && named.may_command)?;
        named.orders.grant(1, now).then_some(name)
    }

    /// Whether a part of the descriptions of services may be sent, which has so many bytes.
    pub fn describes(&mut self, bytes: usize, now: MonotonicNs) -> bool {
        self.descriptions.grant(bytes as u64, now)
    }

    /// Whether a line about a station may be logged.
    pub fn logs(&mut self, now: MonotonicNs) -> bool {
        self.lines.grant(1, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: MonotonicNs = MonotonicNs(1_000_000_000);

    fn admission() -> Admission {
        let names = ["gcs", "viewer"].map(str::to_owned);
        Admission::new(NonZeroU32::MIN, names.iter().zip([true, false]))
    }

    #[test]
    fn a_flood_under_made_up_names_takes_nothing_from_those_that_are_named() {
        let mut admission = admission();
        let read = (0..100_000)
            .filter(|number| {
                admission
                    .asks(&format!("hero/1/ask/x{number}"), NOW)
                    .is_some()
            })
            .count();
        assert_eq!(read as u64, ASKS_OF_OTHERS.1);
        assert_eq!(admission.asks("hero/1/ask/gcs", NOW), Some("gcs"));
        assert_eq!(admission.asks("hero/1/ask/viewer", NOW), Some("viewer"));
        assert_eq!(admission.orders("hero/1/order/gcs", NOW), Some("gcs"));
    }

    #[test]
    fn a_station_that_floods_is_read_at_its_rate_and_the_others_as_ever() {
        let mut admission = admission();
        let orders = (0..100_000).filter(|_| admission.orders("hero/1/order/gcs", NOW).is_some());
        assert_eq!(orders.count() as u64, ORDERS.1);
        let asks = (0..100_000).filter(|_| admission.asks("hero/1/ask/gcs", NOW).is_some());
        assert_eq!(asks.count() as u64, ASKS.1);
        assert!(admission.asks("hero/1/ask/viewer", NOW).is_some());
    }

    #[test]
    fn names_that_are_none_and_keys_that_are_patterns_are_not_read() {
        let mut admission = admission();
        for name in [
            "*",
            "**",
            "a/b",
            "",
            "a*",
            "$*",
            "gcs/",
            "ä",
            &"x".repeat(32),
        ] {
            assert_eq!(
                admission.asks(&format!("hero/1/ask/{name}"), NOW),
                None,
                "{name}"
            );
            assert_eq!(admission.orders(&format!("hero/1/order/{name}"), NOW), None);
        }
        for key in [
            "hero/*/ask/gcs",
            "hero/1/*/gcs",
            "hero/**",
            "hero/2/ask/gcs",
            "**",
            "",
        ] {
            assert_eq!(admission.asks(key, NOW), None, "{key}");
            assert_eq!(admission.orders(key, NOW), None, "{key}");
        }
    }

    #[test]
    fn only_stations_that_may_command_order() {
        let mut admission = admission();
        for name in ["viewer", "stranger", "GCS", "gcs2"] {
            assert_eq!(admission.orders(&format!("hero/1/order/{name}"), NOW), None);
        }
    }
}
