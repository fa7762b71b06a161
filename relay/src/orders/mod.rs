//! Requests from a station to a robot: each is executed at most once and answered with exactly one final report, through loss,
//! repetition, reordering and delay of messages, outages, and restarts of either relay and of the bridge.
//!
//! [`station::Station`] runs on the ground, [`robot::Robot`] beside the bridge. Both are values without thread, socket and
//! clock. They exchange the three [messages](message).
//!
//! **The station asks, the robot remembers.** A station sends each open request as an order, again and again, until it has the
//! final report. The robot side passes an order on when it sees it for the first time, and answers every further copy with the
//! reports that it has. Reports are also sent at once when they come; when one is lost, the next copy of the order fetches it.
//!
//! **Sessions** tell a robot side that remembers from one that does not. The robot side gives each life of a station a random
//! session with the answers to its clock messages. When the robot side is restarted, or has forgotten the station, it answers
//! orders with [`UnknownSession`](message::UnknownSession). The station gets another session, and asks again for everything that
//! is open as a *repetition*, which is never executed anew: the server is asked what became of it.
//!
//! **Places** bound the sessions: there are eight, and a station that is active keeps its own whatever others come. The ninth is
//! told [`NO_PLACE`](message::NO_PLACE) in the place of a session and refuses requests with *relay-too-many-stations*; see
//! [`places`](robot::places).
//!
//! **Numbers** tell a copy that is late from an order that is new. Every order says up to which number all is settled at its
//! station, the *floor*. An order below the floor is ignored, all others are remembered. A station's numbers lie less than
//! [`WINDOW`] above its floor, which bounds the robot side's memory.
//!
//! An order at the robot side:
//!
//! | state | what happens | next state |
//! |---|---|---|
//! | not known, first copy, in time | passed on to the server | passed on |
//! | not known, first copy, too late | refused: deadline-expired | ended |
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
//! | wanted | no answer for a minute: the client is told *unknown, relay-link-lost* | given up |
//! | given up | no report is handed on; a final one settles the order | the same, or settled |
//! | any | another session: asked again under another number, as a repetition | the same |
//!
//! **What a request that was given up does.** The robot side drops the pending request, as any client on the robot that goes away:
//! a path of which waypoints are missing is discarded, and a movement that was accepted goes on to its end. That also holds for a
//! request whose client was told *unknown, relay-link-lost*. A client can ask the server for the true end with the same request
//! id and `repeat` = 1.

pub mod message;
pub mod robot;
pub mod station;
pub mod verdict;

#[cfg(test)]
mod tests;

/// Numbers that a station may use above its floor: twice what [`station::OPEN_ORDERS`] need when all of them move to another
/// number at once, 2 · (32 + 32). The robot side remembers so many orders of a session, about 600 bytes each. It ignores an order
/// above, which no station sends.
pub const WINDOW: u64 = 128;
