//! [`Viewers`]: position and attitude as messages of ROS 2, which viewers draw on a map and in space without knowing the robot's own.

use ipc_types::payload::HeroTelemetry;
use ipc_types::{MonotonicNs, RobotId};
use recording::{Anchor, Recorder};
use ros_messages::{POSE_STAMPED, StandardMessage, UnixOffset, pose_stamped};

use super::outlet::{Outlet, offset_of};

/// Makes messages for viewers out of the robot's telemetry.
#[derive(Debug)]
pub struct Viewers {
    robot: RobotId,
    offset: UnixOffset,
    fix: Outlet,
    pose: Outlet,
}

impl Viewers {
    /// Of `robot`, with times that count from `anchor`.
    pub fn new(robot: RobotId, anchor: Anchor) -> Viewers {
        let fix = StandardMessage::NavSatFix;
        Viewers {
            robot,
            offset: offset_of(anchor),
            fix: Outlet::new(robot, fix.key(), fix.type_name()),
            pose: Outlet::new(robot, "pose", POSE_STAMPED),
        }
    }

    /// Makes of a sample what its valid groups allow.
    pub fn take(&mut self, recorder: &mut Recorder, sample: &HeroTelemetry, now: MonotonicNs) {
        let at = sample.received();
        if let Some(fix) = StandardMessage::NavSatFix.write(sample, self.robot, self.offset) {
            self.fix.add(recorder, now, at, &fix);
        }
        if let Some(pose) = pose_stamped(sample, self.offset) {
            self.pose.add(recorder, now, at, &pose);
        }
    }
}
