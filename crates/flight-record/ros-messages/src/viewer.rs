//! [`ViewerMessage`]: what panels of Foxglove and Lichtblick understand, made of a robot's telemetry. Recordings and
//! the live view make the same, so that one layout of panels serves both.

use ipc_types::RobotId;
use ipc_types::payload::HeroTelemetry;

use crate::pose::{POSE_STAMPED, pose_stamped};
use crate::qos::Qos;
use crate::standard::StandardMessage;
use crate::time::UnixOffset;
use crate::transform::{TF_MESSAGE, tf_message};

/// A message that is made of a sample of telemetry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ViewerMessage {
    /// A message of sensors.
    Standard(StandardMessage),
    /// [`pose_stamped`].
    Pose,
    /// [`tf_message`].
    Transform,
}

impl ViewerMessage {
    /// All that are made.
    pub const ALL: [ViewerMessage; 5] = [
        ViewerMessage::Standard(StandardMessage::NavSatFix),
        ViewerMessage::Standard(StandardMessage::Imu),
        ViewerMessage::Standard(StandardMessage::BatteryState),
        ViewerMessage::Pose,
        ViewerMessage::Transform,
    ];

    /// The topic: `/tf`, which all robots share, or `/robot1/fix`.
    pub fn topic(self, robot: RobotId) -> String {
        let name = match self {
            ViewerMessage::Standard(standard) => standard.key(),
            ViewerMessage::Pose => "pose",
            ViewerMessage::Transform => return "/tf".to_owned(),
        };
        format!("/robot{robot}/{name}")
    }

    /// Name of the type in ROS 2.
    pub const fn type_name(self) -> &'static str {
        match self {
            ViewerMessage::Standard(standard) => standard.type_name(),
            ViewerMessage::Pose => POSE_STAMPED,
            ViewerMessage::Transform => TF_MESSAGE,
        }
    }

    /// How surely its messages arrive.
    pub const fn qos(self) -> Qos {
        match self {
            ViewerMessage::Transform => Qos::TRANSFORM,
            ViewerMessage::Standard(_) | ViewerMessage::Pose => Qos::SENSOR_DATA,
        }
    }

    /// The message in CDR, stamped with the time at which the bridge received the telemetry; `None` if a group is not
    /// valid that it needs.
    pub fn write(
        self,
        telemetry: &HeroTelemetry,
        robot: RobotId,
        offset: UnixOffset,
    ) -> Option<Vec<u8>> {
        match self {
            ViewerMessage::Standard(standard) => standard.write(telemetry, robot, offset),
            ViewerMessage::Pose => pose_stamped(telemetry, offset),
            ViewerMessage::Transform => tf_message(telemetry, robot, offset),
        }
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup;

    use super::*;

    #[test]
    fn without_a_fix_there_is_nothing_on_the_map_and_no_place_in_space() {
        let with_fix = HeroTelemetry {
            valid_groups: 0xffff,
            ..HeroTelemetry::default()
        };
        let without = HeroTelemetry {
            valid_groups: u32::from(!TelemetryGroup::OF_A_FIX),
            ..with_fix
        };
        for message in ViewerMessage::ALL {
            let is_made = |telemetry| {
                let message = message.write(telemetry, RobotId::DEFAULT, UnixOffset(0));
                message.is_some()
            };
            let is_of_the_body = matches!(
                message,
                ViewerMessage::Standard(StandardMessage::Imu | StandardMessage::BatteryState)
            );
            assert!(is_made(&with_fix), "{message:?}");
            assert_eq!(is_made(&without), is_of_the_body, "{message:?}");
        }
    }
}
