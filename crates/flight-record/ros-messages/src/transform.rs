//! `tf2_msgs/msg/TFMessage`: where the robot's body is in the frame `map`, for viewers that draw in three dimensions.

use ipc_types::RobotId;
use ipc_types::payload::HeroTelemetry;

use crate::cdr::Writer;
use crate::header::{MAP, body_frame, header};
use crate::pose::pose;
use crate::time::UnixOffset;

/// Name of the type in ROS 2.
pub const TF_MESSAGE: &str = "tf2_msgs/msg/TFMessage";

/// Room for the message with the longest name of a robot, bytes.
const CAPACITY: usize = 128;

/// The transform from `map` to the robot's body in CDR, with the values and under the conditions of
/// [`pose_stamped`](crate::pose_stamped).
pub fn tf_message(
    telemetry: &HeroTelemetry,
    robot: RobotId,
    offset: UnixOffset,
) -> Option<Vec<u8>> {
    let pose = pose(telemetry)?;
    let mut writer = Writer::with_capacity(CAPACITY);
    // One transform.
    writer.u32(1);
    header(&mut writer, offset.unix_ns(telemetry.received()), MAP);
    writer.string(&body_frame(robot));
    writer.f64s(&pose);
    Some(writer.finish())
}

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup;

    use super::*;
    use crate::cdr::Reader;
    use crate::pose::tests::telemetry;

    #[test]
    fn the_body_is_where_the_pose_is() {
        let groups = [TelemetryGroup::Xy, TelemetryGroup::Attitude];
        let message = tf_message(&telemetry(&groups), RobotId::DEFAULT, UnixOffset(0)).unwrap();
        let mut reader = Reader::new(&message).unwrap();
        assert_eq!(reader.u32(), Some(1));
        assert_eq!((reader.i32(), reader.u32()), (Some(2), Some(3)));
        assert_eq!(reader.string(), Some("map"));
        assert_eq!(reader.string(), Some("robot1/base_link"));
        let numbers: Vec<f64> = std::iter::from_fn(|| reader.f64()).collect();
        for (value, expected) in numbers.iter().zip([1.5, -2.5, 0.0, 0.0, 0.0, 0.0, 1.0]) {
            assert!((value - expected).abs() < 1e-7, "{numbers:?}");
        }
        assert_eq!((numbers.len(), reader.is_at_end()), (7, true));
        let groups = [TelemetryGroup::Xy];
        assert_eq!(
            tf_message(&telemetry(&groups), RobotId::DEFAULT, UnixOffset(0)),
            None
        );
    }
}
