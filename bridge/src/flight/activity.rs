//! What the functionality is doing: one value that owns everything about the movement under way.

use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, MovementKind};

use super::request::Envelope;

/// The movement, or what else keeps the flight busy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Activity {
    /// Nothing; a path may be under assembly.
    AtRest,
    /// A take-off.
    TakingOff {
        /// Who wants it.
        order: Order,
        /// The altitude at which it ends, m.
        target_altitude_m: f64,
        /// The last position was there. The take-off is over when the DSP then asks for waypoints again.
        at_altitude: bool,
    },
    /// A closed path.
    Following {
        /// Who closed it.
        order: Order,
    },
    /// A landing.
    Landing {
        /// Who wants it.
        order: Order,
    },
    /// The DSP's buffers are being emptied.
    Stopping {
        /// Who asked for the stop; nobody after an error.
        requester: Option<Envelope>,
    },
}

/// A movement's request and its time limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// The request.
    pub envelope: Envelope,
    /// The movement has begun on the DSP: its command was acknowledged, or its first waypoint was sent.
    pub begun: bool,
    /// Until when it must have begun; once begun, until when it must have ended.
    pub deadline: MonotonicNs,
}

impl Activity {
    /// The order of the movement under way.
    pub fn order(&self) -> Option<&Order> {
        match self {
            Activity::TakingOff { order, .. }
            | Activity::Following { order }
            | Activity::Landing { order } => Some(order),
            Activity::AtRest | Activity::Stopping { .. } => None,
        }
    }

    /// The order of the movement under way, to change it.
    pub fn order_mut(&mut self) -> Option<&mut Order> {
        match self {
            Activity::TakingOff { order, .. }
            | Activity::Following { order }
            | Activity::Landing { order } => Some(order),
            Activity::AtRest | Activity::Stopping { .. } => None,
        }
    }

    /// Which movement it is.
    pub fn kind(&self) -> Option<MovementKind> {
        match self {
            Activity::TakingOff { .. } => Some(MovementKind::TakeOff),
            Activity::Following { .. } => Some(MovementKind::GoToWaypoint),
            Activity::Landing { .. } => Some(MovementKind::Land),
            Activity::AtRest | Activity::Stopping { .. } => None,
        }
    }

    /// Take-off and landing cannot be aborted (`unable2abort`).
    pub fn unable_to_abort(&self) -> bool {
        matches!(self, Activity::TakingOff { .. } | Activity::Landing { .. })
    }

    /// How it is published.
    pub fn functionality(&self, receiving_path: bool) -> Functionality {
        match self {
            Activity::AtRest if receiving_path => Functionality::ReceivingPath,
            Activity::AtRest => Functionality::AtRest,
            Activity::TakingOff { .. } => Functionality::TakingOff,
            Activity::Following { .. } => Functionality::FollowingPath,
            Activity::Landing { .. } => Functionality::Landing,
            Activity::Stopping { .. } => Functionality::Stopping,
        }
    }
}
