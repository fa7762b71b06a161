//! [`RobotOrder`]: what a screen or a page orders, and the requests that it makes.

use ipc_types::code::ControlCommand;
use ipc_types::fresh_request_id;
use ipc_types::payload::{ModuleControl, MovementData, WaypointPosition};

use crate::render::messages::Verb;
use crate::request::{complete, control_request};

/// See the module's documentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RobotOrder {
    /// Hover on the spot; replaces a path, as `ril hold`.
    Hold,
    /// Land on the spot; replaces a path, as `ril land --preempt`.
    Land,
    /// As `ril start`.
    Start,
    /// As `ril stop`.
    Stop,
    /// As `ril control take`.
    TakeControl,
    /// As `ril control release`.
    ReleaseControl,
    /// Climb to this height above take-off, m, as `ril takeoff`.
    TakeOff(f64),
    /// Fly straight there; replaces a path, as `ril goto --preempt`.
    GoTo(WaypointPosition),
}

/// The request of an order, by the service that takes it.
pub(crate) enum OrderRequest {
    /// A movement.
    Movement(MovementData),
    /// A start or a stop.
    Control(ModuleControl),
}

impl RobotOrder {
    /// The verb that does the same.
    pub fn verb(self) -> Verb {
        match self {
            RobotOrder::Hold => Verb::Hold,
            RobotOrder::Land => Verb::Land,
            RobotOrder::Start => Verb::Start,
            RobotOrder::Stop => Verb::Stop,
            RobotOrder::TakeControl => Verb::TakeControl,
            RobotOrder::ReleaseControl => Verb::ReleaseControl,
            RobotOrder::TakeOff(_) => Verb::TakeOff,
            RobotOrder::GoTo(_) => Verb::GoTo,
        }
    }

    /// Its one request, to be begun within `deadline_ms` of now.
    pub(crate) fn request(self, deadline_ms: u32) -> OrderRequest {
        let id = fresh_request_id();
        let control = |command| OrderRequest::Control(control_request(command, deadline_ms));
        let movement = match self {
            RobotOrder::Start => return control(ControlCommand::Start),
            RobotOrder::Stop => return control(ControlCommand::Stop),
            RobotOrder::TakeControl => return control(ControlCommand::TakeControl),
            RobotOrder::ReleaseControl => return control(ControlCommand::ReleaseControl),
            RobotOrder::Hold => MovementData::hold(id),
            RobotOrder::Land => MovementData::land(id),
            RobotOrder::TakeOff(height_m) => MovementData::take_off(id, height_m),
            RobotOrder::GoTo(waypoint) => {
                MovementData::waypoint(id, fresh_request_id(), waypoint, true, true)
            }
        };
        let preempts = !matches!(self, RobotOrder::TakeOff(_));
        OrderRequest::Movement(complete(movement, preempts, deadline_ms))
    }
}
