//! Requests from a station to a robot: each is executed at most once and answered with exactly one final report,
//! through loss, repetition, reordering and delay of messages, outages, and restarts of either relay and of the bridge.
//!
//! [`station::StationOrders`] runs on the ground, [`robot::RobotOrders`] beside the bridge. Both are values without
//! thread, socket and clock. They exchange [orders and answers](message).
//!
//! **The station asks, the robot remembers.** A station repeats each open request as an order until it has the
//! final report. The robot side passes an order on when it sees it for the first time, and answers every further copy
//! with the reports that it has. Reports are also sent at once when they come; when one is lost, the next copy of the
//! order fetches it.
//!
//! **Sessions** tell a robot side that remembers from one that does not. The robot side gives each instance of a
//! station a random session with the answers to its clock messages. When the robot side is restarted, or has forgotten
//! the station, it answers orders with [`UnknownSession`](crate::message::Reply::UnknownSession). The station gets
//! another session, and asks again for everything that is open as a *repetition*, which is never executed anew: the
//! server is asked what became of it.
//!
//! **Places** bound the sessions: there are eight, and a station that is active keeps its own whatever others come. The
//! ninth gets [`NO_PLACE`](message::NO_PLACE) in the place of a session and refuses requests with
//! *relay-too-many-stations*; see [`session_for`](robot::RobotOrders::session_for).
//!
//! **Numbers** tell a copy that is late from an order that is new. Every order says up to which number all is settled
//! at its station, the *floor*. An order below the floor is ignored, all others are remembered. A station's numbers lie
//! less than [`WINDOW`](message::WINDOW) above its floor, which bounds the robot side's memory.
//!
//! **Orders keep their order.** The robot side passes the orders of one session on in the order of their numbers: one
//! whose number is beyond a gap waits until the missing ones were here. The station has one timer for all that it asks
//! for again, oldest first, so a gap closes with the next round. What [ends a movement](robot::Traits::ends_movement)
//! never waits: an older movement that comes after it is refused by the bridge as superseded, because each request says
//! when it was issued.
//!
//! An order at the robot side:
//!
//! | state | what happens | next state |
//! |---|---|---|
//! | not known, first copy, in time, all before it were here | passed on to the server | passed on |
//! | not known, first copy, in time, one before it was not here | waits, unless it ends a movement | early |
//! | early | all before it were here: passed on, or refused as too-late | passed on, ended |
//! | early | the station gives it up, or the session is forgotten: never passed on | ended |
//! | not known, first copy, too late | refused: too-late | ended |
//! | not known, repetition, the request has a field `repeat` | passed on with `repeat` = 1 | passed on |
//! | not known, repetition, no such field | unknown: not-remembered | ended |
//! | not known, given up | never passed on; unknown: none | ended |
//! | passed on | the server takes no request now | waiting |
//! | passed on, repetition | the server says still-open | waiting |
//! | passed on | a report comes: remembered and sent | the same, or ended when it is final |
//! | passed on or waiting | the station gives it up: unknown: none | ended |
//! | waiting | passed on again after a while; ended when that takes too long | passed on, ended |
//! | ended | every copy gets the final report | forgotten below the floor |
//!
//! An order at the station:
//!
//! | state | what happens | next state |
//! |---|---|---|
//! | wanted | a report: handed on to the client; a final one settles the order | the same, or settled |
//! | wanted | the client is gone | given up |
//! | – | it is new, and the robot side has no place for the station: refused, relay-too-many-stations | settled |
//! | wanted | no answer for a minute: the client gets *unknown, relay-link-lost* | given up |
//! | given up | no report is handed on; a final one settles the order | the same, or settled |
//! | any | another session: asked again under another number, as a repetition | the same |
//!
//! **What a request that was given up does.** The robot side drops the pending request, as any client on the robot that
//! goes away: a path of which waypoints are missing is discarded, one that is flown ends as its `sender_lost` says, and
//! any other movement that was accepted goes on to its end.
//! That also holds for a request whose client got *unknown, relay-link-lost*. A client can ask the server for the true
//! end with the same request id and `repeat` = 1.

pub mod message;
pub mod robot;
pub mod station;

#[cfg(test)]
mod tests;
