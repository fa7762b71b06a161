//! What a [`Gateway`](crate::Gateway) wants of the program around it.

use std::net::SocketAddr;

use ipc_types::MonotonicNs;
use ipc_types::payload::WaypointPosition;

use plans::model::FenceArea;

use crate::mission::store::Mission;

/// Bytes for a station.
#[derive(Clone, Debug, PartialEq)]
pub struct Datagram {
    /// Where to.
    pub to: SocketAddr,
    /// One frame.
    pub bytes: Vec<u8>,
    /// Whether it may be dropped when the socket is full: newer telemetry follows.
    pub is_telemetry: bool,
}

/// A request to the bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Names it in its reports.
    pub number: u64,
    /// What is wanted.
    pub kind: OrderKind,
    /// When the command came.
    pub issued: MonotonicNs,
    /// Until when it may begin; `None` leaves it to the bridge.
    pub begin_by: Option<MonotonicNs>,
    /// Whether it may replace a path that is under way.
    pub preempts: bool,
    /// The request to the bridge that was the step before, of a mission or of a command of two steps; 0 if it follows
    /// no other.
    pub after: u64,
}

/// What is wanted of the bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OrderKind {
    /// Start the module.
    Start,
    /// Stop the module, on the ground.
    Stop,
    /// Climb to this height above take-off, m.
    TakeOff(f64),
    /// Hover on the spot.
    Hold,
    /// Land on the spot.
    Land,
    /// Fly straight there.
    GoTo(WaypointPosition),
    /// Fly the path that [`Gateway::path`](crate::Gateway::path) has for the order.
    Path,
    /// Fly paths at this speed, m/s.
    Speed(f64),
    /// Read a port of the DSP.
    ReadPort(u16),
    /// Write a port of the DSP.
    WritePort(u16, f64),
    /// Read the geofence of the bridge's configuration file again.
    ReloadFence,
}

impl OrderKind {
    /// Whether it makes the flight safer, so that it is taken from every permitted station at every time.
    pub fn is_stop(self) -> bool {
        matches!(self, OrderKind::Hold | OrderKind::Land)
    }

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            OrderKind::Start => "arm",
            OrderKind::Stop => "disarm",
            OrderKind::TakeOff(_) => "take-off",
            OrderKind::Hold => "hold",
            OrderKind::Land => "land",
            OrderKind::GoTo(_) => "goto",
            OrderKind::Path => "path",
            OrderKind::Speed(_) => "speed",
            OrderKind::ReadPort(_) | OrderKind::WritePort(..) => "parameter",
            OrderKind::ReloadFence => "fence reload",
        }
    }
}

/// What the program around it does for a [`Gateway`](crate::Gateway) beside orders.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// Ask the bridge for its configuration, within a second, and give it to [`Gateway::rules`](crate::Gateway::rules).
    Rules,
    /// Keep a mission on disk, and say [`Gateway::saved`](crate::Gateway::saved) when it is there. Of several the last
    /// one counts.
    Save(Mission),
    /// Put these areas into the bridge's configuration file in place of those of the last fence of a station or plan,
    /// and say [`Gateway::fence_put`](crate::Gateway::fence_put).
    PutFence(Vec<FenceArea>),
    /// Make that file what it was before the last [`Task::PutFence`], and say
    /// [`Gateway::fence_restored`](crate::Gateway::fence_restored).
    RestoreFence,
}

/// Something for the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A station has come or gone, or the helicopter is heard again.
    Note(String),
    /// A command was given.
    Commanded(String),
    /// Something was refused or lost.
    Warning(String),
}
