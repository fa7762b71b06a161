//! [`Mailbox`]: what stations ask and order, as far as it is admitted and can be read.

use std::num::NonZeroU32;

use ipc_types::MonotonicNs;
use serde::de::DeserializeOwned;

use super::admission::Admission;
use crate::config::Config;
use crate::message::{Ask, Command, MAX_ASK_BYTES, MAX_COMMAND_BYTES, NoMessage, decode};
use crate::names;
use crate::network::{Inbox, Network, NetworkError, Room};

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
    longest: MAX_COMMAND_BYTES,
};

/// Bytes of orders that may wait: as many of the longest as 256, of the robot's own as wait at all.
const ORDER_BYTES: usize = 256 * MAX_COMMAND_BYTES;

/// What stations send.
pub struct Mailbox {
    asks: Inbox,
    commands: Inbox,
    unreadable: u64,
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
            commands: receive(names::order, ORDER_ROOM)?,
            unreadable: 0,
        })
    }

    /// Takes the questions that have come.
    pub fn asks(&mut self, admission: &mut Admission, now: MonotonicNs) -> Vec<Mail<Ask>> {
        read(&self.asks, &mut self.unreadable, |key| {
            admission.asks(key, now)
        })
    }

    /// Takes the orders that have come.
    pub fn commands(&mut self, admission: &mut Admission, now: MonotonicNs) -> Vec<Mail<Command>> {
        read(&self.commands, &mut self.unreadable, |key| {
            admission.orders(key, now)
        })
    }
}

/// `admit` says whose the messages under a key are, when they are to be read.
fn read<M: DeserializeOwned>(
    inbox: &Inbox,
    unreadable: &mut u64,
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
            Err(error) => note_unreadable(unreadable, incoming.key, &error),
        }
    });
    mail
}

/// Said once, and then each time that their number has doubled.
fn note_unreadable(unreadable: &mut u64, key: &str, error: &NoMessage) {
    *unreadable += 1;
    if unreadable.is_power_of_two() {
        tracing::warn!(key, %error, count = unreadable, "messages that are none have come");
    }
}
