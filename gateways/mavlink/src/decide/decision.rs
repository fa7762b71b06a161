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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_decision_has_a_name_and_says_what_it_does_to_a_flight() {
        use OrderKind::{GoTo, Hold, Land, Speed, Start, Stop, TakeOff};
        let home = WaypointPosition {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 9.0,
        };
        let then = |first, then, is_return| {
            Decision::Orders(OrderPair {
                first,
                then: Some(then),
                is_return,
            })
        };
        let back = Decision::Orders(OrderPair {
            is_return: true,
            ..OrderPair::of(GoTo(home))
        });
        let start = MissionAsk::Start {
            first: None,
            arms: true,
        };
        // Its name; whether it is a stop, ends something, and moves the helicopter.
        let table = [
            (OrderPair::one(Hold), Hold.name(), [true, true, false]),
            (OrderPair::one(Land), Land.name(), [true, true, false]),
            (OrderPair::one(Stop), Stop.name(), [false, true, false]),
            (OrderPair::one(Start), Start.name(), [false; 3]),
            (OrderPair::one(Speed(3.0)), "speed", [false; 3]),
            (OrderPair::one(GoTo(home)), "goto", [false, false, true]),
            (
                then(Start, TakeOff(9.0), false),
                "take-off",
                [false, false, true],
            ),
            (
                then(Start, GoTo(home), true),
                "return",
                [false, false, true],
            ),
            (back, "return", [false, false, true]),
            (Decision::SetHome(home), "home", [false; 3]),
            (
                Decision::Mission(start),
                "the mission",
                [false, false, true],
            ),
            (
                Decision::Mission(MissionAsk::SetCurrent(3)),
                "the mission",
                [false; 3],
            ),
            (accept(), "the command", [false; 3]),
        ];
        for (decision, name, does) in table {
            assert_eq!(decision.name(), name);
            let found = [
                decision.is_stop(),
                decision.ends_something(),
                decision.moves(),
            ];
            assert_eq!(found, does, "{decision:?}");
        }
    }
}
