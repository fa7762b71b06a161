//! What the screen shows of a robot.

use ipc_types::module::State;
use ipc_types::payload::{ModuleState, RelayLink};
use ipc_types::{MonotonicNs, RobotId};

use super::super::alarms::Alarms;
use super::super::freshness::Freshness;
use super::super::history::History;
use super::super::journal::Journal;
use super::{Home, Process, Robot};
use crate::geo::Place;
use crate::pilot::PilotView;

impl Robot {
    /// The robot.
    pub fn id(&self) -> RobotId {
        self.id
    }

    /// The bridge's newest state.
    pub fn last_state(&self) -> Option<&ModuleState> {
        self.state.as_ref()
    }

    /// The newest state of the process status.
    pub fn last_status(&self) -> Option<&State> {
        self.status.as_ref()
    }

    /// The newest state of the relay's link; nothing when the robot is on this machine.
    pub fn last_relay(&self) -> Option<&RelayLink> {
        self.relay.as_ref().filter(|_| self.is_relayed)
    }

    /// Whether the robot's topics come from another machine.
    pub fn is_relayed(&self) -> bool {
        self.is_relayed
    }

    /// What the newest telemetry says.
    pub fn pilot(&self) -> &PilotView {
        &self.pilot
    }

    /// How `process` is.
    pub fn process(&self, process: Process, now: MonotonicNs) -> Freshness {
        self.feed(process).at(now)
    }

    /// How telemetry is.
    pub fn telemetry_freshness(&self, now: MonotonicNs) -> Freshness {
        self.telemetry_feed.at(now)
    }

    /// Where the robot was last seen on the ground.
    pub fn home(&self) -> Option<Home> {
        self.home
    }

    /// Height over the place of take-off, m.
    pub fn height_m(&self) -> Option<f64> {
        Some(self.pilot.altitude_m? - self.home?.altitude_m)
    }

    /// Where the robot was.
    pub fn track(&self) -> &[Place] {
        self.track.points()
    }

    /// Where it was when it reached the waypoints of the path under way, or of the last.
    pub fn reached(&self) -> &[Place] {
        &self.reached
    }

    /// Altitude over time.
    pub fn altitude(&self) -> &History {
        &self.altitude
    }

    /// Speed over ground over time.
    pub fn speed(&self) -> &History {
        &self.speed
    }

    /// Samples of telemetry that were lost between processes.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// What is wrong now.
    pub fn alarms(&self) -> &Alarms {
        &self.alarms
    }

    /// What happened.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }
}
