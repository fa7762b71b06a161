//! [`Twins`]: whether two robots answer under one number, as a card that was copied makes them behind a router. A pure
//! value.
//!
//! A ping goes to both, and each answers. A relay that was started again does not: the one before it answers no ping
//! that was sent after one that its successor has answered.
//!
//! | another instance answers | then |
//! |---|---|
//! | the first one has answered nothing for two pings, or its link is not up | it has taken its place |
//! | else | it is refused |
//! | and so does the first one, a ping that was sent no earlier | there are two robots: the other one is refused until one of them is silent |

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::message::{PING_PERIOD, Pong};

/// A robot that has not answered for so long does so no more: an operator has ended its relay, or given it another
/// number. Longer than an outage that a link makes by itself.
const GONE_AFTER: Duration = Duration::from_secs(10);

/// What answers beside the robot that the station has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Twins {
    /// When the first and the last ping were sent that the station's robot has answered.
    first_ns: u64,
    answered_ns: u64,
    other: Option<Other>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Other {
    instance: u64,
    /// When the first ping was sent that it has answered.
    first_ns: u64,
    last: MonotonicNs,
    /// The station's robot has answered a later one.
    is_twin: bool,
}

impl Twins {
    /// The robot that the station has answers a ping.
    pub fn note_own(&mut self, pong: &Pong) {
        self.answered_ns = self.answered_ns.max(pong.ping_sent_ns);
        let answered_ns = self.answered_ns;
        if let Some(other) = &mut self.other {
            other.is_twin |= answered_ns >= other.first_ns;
        }
    }

    /// Another instance answers a ping; says whether it takes the robot's place. `silent` is for how long the one that
    /// the station has did not answer; `None` if its link is not up.
    pub fn note_other(&mut self, pong: &Pong, silent: Option<Duration>, at: MonotonicNs) -> bool {
        if pong.ping_sent_ns < self.first_ns {
            // It comes late, of the one before.
            return false;
        }
        let is_it = |other: &Other| other.instance == pong.robot_instance;
        let known = self.other.filter(is_it);
        let is_twin = known.is_some_and(|other| other.is_twin);
        let has_gone = silent.is_none_or(|silent| !is_twin && silent >= 2 * PING_PERIOD);
        if has_gone {
            *self = Twins {
                first_ns: pong.ping_sent_ns,
                answered_ns: pong.ping_sent_ns,
                other: None,
            };
            return true;
        }
        let first_ns = known.map_or(pong.ping_sent_ns, |other| other.first_ns);
        self.other = Some(Other {
            instance: pong.robot_instance,
            first_ns,
            last: at,
            is_twin,
        });
        false
    }

    /// The time passes.
    pub fn tick(&mut self, now: MonotonicNs) {
        self.other = self
            .other
            .filter(|other| now.since(other.last) < GONE_AFTER);
    }

    /// The instance of the robot that answers beside the station's.
    pub fn twin(&self) -> Option<u64> {
        let twin = self.other.filter(|other| other.is_twin)?;
        Some(twin.instance)
    }
}
