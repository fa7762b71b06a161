//! [`Mailbox`]: what stations ask and order, as far as it is admitted and can be read.

use std::num::NonZeroU32;

use ipc_types::MonotonicNs;
use serde::de::DeserializeOwned;

use super::admission::Admission;
use crate::config::Config;
use crate::message::{Ask, MAX_ASK_BYTES, MAX_ORDER_BYTES, Unreadable, decode};
use crate::names;
use crate::network::{Inbox, Network, NetworkError, Room};
use crate::orders::message::Order;

/// Messages that may wait: a station sends a few for each of its at most 32 open requests, and eight stations are served.
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
            let stations = config.commands.stations.iter();
            let stations = stations.chain(&config.security.stations);
            let named = stations.map(|name| key(robot, name)).collect();
            network.receive(&key(robot, "*"), named, room)
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
