//! What goes into the robot side's memory and comes out of it, besides messages.

use crate::orders::message::{Answer, UnknownSession};

/// Whether a kind of request can be asked for again without being executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Repeat {
    /// The request has a field `repeat`.
    Field,
    /// It has none: a request that may have been executed is not passed on again.
    None,
}

/// What is to be known of a request before it is handed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traits {
    /// How the server can be asked again.
    pub repeat: Repeat,
    /// It ends a movement, or makes the robot do nothing: a hold, a landing, a stop. It waits for no order before it.
    pub ends_movement: bool,
}

/// Why a request could not be sent to its server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSent {
    /// No process serves it.
    NoServer,
    /// The server, or this process's client port, has no room for one more request, or the port failed.
    Full,
}

/// What the robot side has to do.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Send a request to its server on the robot. If that fails, [`Robot::not_sent`](super::Robot::not_sent) has to be called.
    Send {
        /// Which service.
        topic: u64,
        /// Id of the request.
        request_id: u64,
        /// Set the request's field `repeat` to 1. Otherwise the request is sent as it is.
        is_repeat: bool,
        /// The request.
        request: Vec<u8>,
    },
    /// Drop the pending request.
    GiveUp {
        /// Which service.
        topic: u64,
        /// Id of the request.
        request_id: u64,
    },
    /// Send this to a station.
    Answer {
        /// Life of the station.
        station: u64,
        /// The message.
        answer: Answer,
    },
    /// Send this to the sender of the order. Only [`Robot::order`](super::Robot::order) puts this out.
    UnknownSession(UnknownSession),
    /// A station with an open order has been silent for the configured time. Once for each silence.
    LinkLost {
        /// Life of the station.
        station: u64,
    },
}
