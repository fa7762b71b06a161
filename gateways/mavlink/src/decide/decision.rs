//! [`Decision`]: what is to be done.

use ipc_types::code::Reason;
use ipc_types::payload::WaypointPosition;

use crate::event::OrderKind;
use crate::number::{MavResult, MavSeverity};
use crate::verdict::CommandAck;

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum Decision {
    /// Nothing; this is the answer.
    Answer(CommandAck, Option<(MavSeverity, String)>),
    /// Orders to the bridge.
    Orders(OrderPair),
    /// Home is there.
    SetHome(WaypointPosition),
    /// The mission begins, goes on, or goes elsewhere.
    Mission(MissionAsk),
}

/// What is asked of the mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MissionAsk {
    /// Begin with this item, or else go on with the next one.
    Start {
        /// From 0.
        first: Option<u16>,
        /// Whether the module is started for it on the ground; otherwise the mission waits for that.
        arms: bool,
    },
    /// Go on with this item, from 0.
    SetCurrent(u16),
}

/// One or two orders, the second of which follows when the first is done.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderPair {
    pub first: OrderKind,
    pub then: Option<OrderKind>,
    /// Whether the path is that of a return, at whose end the helicopter lands.
    pub is_return: bool,
}

impl OrderPair {
    pub fn of(first: OrderKind) -> OrderPair {
        OrderPair {
            first,
            then: None,
            is_return: false,
        }
    }

    pub fn one(kind: OrderKind) -> Decision {
        Decision::Orders(OrderPair::of(kind))
    }
}

impl Decision {
    /// Whether it makes the flight safer.
    pub fn is_stop(&self) -> bool {
        matches!(self, Decision::Orders(orders) if orders.first.is_stop())
    }

    /// Whether it stops the helicopter, or the module on the ground.
    pub fn ends_something(&self) -> bool {
        self.is_stop()
            || matches!(self, Decision::Orders(orders) if orders.first == OrderKind::Stop)
    }

    /// Whether the helicopter goes somewhere.
    pub fn moves(&self) -> bool {
        let is_movement =
            |kind: OrderKind| matches!(kind, OrderKind::GoTo(_) | OrderKind::TakeOff(_));
        match self {
            Decision::Orders(orders) => [Some(orders.first), orders.then]
                .into_iter()
                .flatten()
                .any(is_movement),
            Decision::Mission(asked) => matches!(asked, MissionAsk::Start { .. }),
            _ => false,
        }
    }

    /// What people call it.
    pub fn name(&self) -> &'static str {
        match self {
            Decision::Orders(orders) if orders.is_return => "return",
            Decision::Orders(orders) => orders.then.unwrap_or(orders.first).name(),
            Decision::Mission(_) => "the mission",
            Decision::SetHome(_) => "home",
            Decision::Answer(..) => "the command",
        }
    }
}

/// Nothing is done, for a reason of ours.
pub fn refuse(result: MavResult, text: impl Into<String>) -> Decision {
    refuse_for(result, Reason::None, text)
}

/// Nothing is done, for this reason of the bridge.
pub fn refuse_for(result: MavResult, reason: Reason, text: impl Into<String>) -> Decision {
    Decision::Answer(
        CommandAck { result, reason },
        Some((MavSeverity::Error, text.into())),
    )
}

/// It is so already.
pub fn accept() -> Decision {
    Decision::Answer(CommandAck::plain(MavResult::Accepted), None)
}
