//! [`Pending`]: an order on its way.

use ipc_types::MonotonicNs;

use crate::commands::Key;
use crate::event::OrderKind;

/// An order that has no final report.
#[derive(Clone, Debug)]
pub struct Pending {
    pub number: u64,
    pub kind: OrderKind,
    pub key: Key,
    /// What follows when it is done.
    pub then: Option<OrderKind>,
    pub is_return: bool,
    pub issued: MonotonicNs,
    pub is_answered: bool,
    pub progress_at: MonotonicNs,
}

impl Pending {
    /// Whether it moves the helicopter to another place.
    pub fn is_movement(&self) -> bool {
        matches!(self.kind, OrderKind::GoTo(_) | OrderKind::TakeOff(_))
    }

    /// What people call it.
    pub fn name(&self) -> &'static str {
        match self.is_return {
            true => "return",
            false => self.kind.name(),
        }
    }
}
