//! [`Pending`]: an order on its way.

use ipc_types::MonotonicNs;
use ipc_types::payload::WaypointPosition;

use crate::commands::CommandKey;
use crate::event::OrderKind;

/// An order that has no final report.
#[derive(Clone, Debug)]
pub struct Pending {
    pub number: u64,
    pub kind: OrderKind,
    pub key: CommandKey,
    /// What follows when it is done.
    pub then: Option<OrderKind>,
    pub is_return: bool,
    /// Whether it is a step of the mission.
    pub is_mission: bool,
    /// The waypoints of [`OrderKind::Path`].
    pub path: Vec<WaypointPosition>,
    pub issued: MonotonicNs,
    /// Until when the bridge must have answered.
    pub answer_by: MonotonicNs,
    pub is_answered: bool,
    /// Whether the bridge has accepted it. An order that is answered may have had no word of the bridge.
    pub is_accepted: bool,
    /// The request that it is to the bridge; 0 before the first report.
    pub request_id: u64,
    /// The request that was the step before; 0 if it follows no other.
    pub after: u64,
}

impl Pending {
    /// Whether it moves the helicopter to another place.
    pub fn is_movement(&self) -> bool {
        matches!(
            self.kind,
            OrderKind::GoTo(_) | OrderKind::Path | OrderKind::TakeOff(_)
        )
    }

    /// What people call it.
    pub fn name(&self) -> &'static str {
        match (self.is_return, self.is_mission) {
            (true, _) => "return",
            (_, true) => "mission",
            _ => self.kind.name(),
        }
    }
}
