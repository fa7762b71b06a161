//! `geometry_msgs/msg/PoseStamped`: where the robot is and how it is turned, for viewers that draw it.

use ipc_types::TelemetryGroup;
use ipc_types::payload::HeroTelemetry;

use crate::attitude::{Quaternion, orientation};
use crate::cdr::Writer;
use crate::header::{MAP, header};
use crate::time::UnixOffset;

/// Name of the type in ROS 2.
pub const POSE_STAMPED: &str = "geometry_msgs/msg/PoseStamped";

/// Length of the message, bytes: header of CDR, time, frame with its length and zero, seven numbers.
const LEN: usize = 4 + 8 + 8 + 7 * 8;

/// The pose in CDR, in the frame `map` (east, north, up), stamped with the time at which the bridge received the
/// telemetry. Nothing without the groups `xy` and `attitude`.
pub fn pose_stamped(telemetry: &HeroTelemetry, offset: UnixOffset) -> Option<Vec<u8>> {
    let pose = pose(telemetry)?;
    let mut writer = Writer::with_capacity(LEN);
    header(&mut writer, offset.unix_ns(telemetry.received()), MAP);
    writer.f64s(&pose);
    Some(writer.finish())
}

/// East, north, up in metres, and the quaternion, all in the frame `map`.
pub(crate) fn pose(telemetry: &HeroTelemetry) -> Option<[f64; 7]> {
    let Quaternion([x, y, z, w]) = orientation(telemetry)?;
    let [east_m, north_m, up_m] = position(telemetry)?;
    Some([east_m, north_m, up_m, x, y, z, w])
}

/// East, north, up in metres in the frame `map`; `None` without the group `xy`.
///
/// The height is the altitude of the group `geographic`, 0 when that is not valid.
pub fn position(telemetry: &HeroTelemetry) -> Option<[f64; 3]> {
    if !telemetry.valid(TelemetryGroup::Xy) {
        return None;
    }
    let has_altitude = telemetry.valid(TelemetryGroup::Geographic);
    let up_m = if has_altitude {
        telemetry.geodetic.altitude_m
    } else {
        0.0
    };
    let local = &telemetry.local;
    Some([local.east_m, local.north_m, up_m])
}

#[cfg(test)]
pub(crate) mod tests {
    use ipc_types::payload::{HeroAttitude, HeroGeodetic, HeroLocal, SharedStruct};

    use super::*;

    /// To the east of `map`'s origin, level.
    pub(crate) fn telemetry(groups: &[TelemetryGroup]) -> HeroTelemetry {
        HeroTelemetry {
            received_ns: 2_000_000_003,
            valid_groups: groups.iter().map(|group| u32::from(group.bit())).sum(),
            geodetic: HeroGeodetic {
                altitude_m: 30.5,
                ..HeroGeodetic::ZERO
            },
            local: HeroLocal {
                east_m: 1.5,
                north_m: -2.5,
            },
            // To the east, so that nothing is turned.
            attitude: HeroAttitude {
                yaw_rad: std::f32::consts::FRAC_PI_2,
                ..HeroAttitude::ZERO
            },
            ..HeroTelemetry::ZERO
        }
    }

    #[test]
    fn a_pose_is_in_east_north_up() {
        use TelemetryGroup::{Attitude, Geographic, Xy};
        for (groups, up_m) in [
            (vec![Geographic, Xy, Attitude], 30.5),
            (vec![Xy, Attitude], 0.0),
        ] {
            let message = pose_stamped(&telemetry(&groups), UnixOffset(1_000_000_000)).unwrap();
            assert_eq!(message.len(), LEN);
            let header = [3, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, b'm', b'a', b'p', 0];
            assert_eq!(message[4..20], header);
            let (numbers, _) = message[20..].as_chunks::<8>();
            let numbers: Vec<_> = numbers
                .iter()
                .map(|bytes| f64::from_le_bytes(*bytes))
                .collect();
            assert_eq!(numbers[..3], [1.5, -2.5, up_m]);
            for (value, expected) in numbers[3..].iter().zip([0.0, 0.0, 0.0, 1.0]) {
                assert!((value - expected).abs() < 1e-7, "{numbers:?}");
            }
        }
    }

    #[test]
    fn there_is_no_pose_without_position_or_attitude() {
        for groups in [
            vec![TelemetryGroup::Xy],
            vec![TelemetryGroup::Attitude],
            vec![],
        ] {
            assert_eq!(pose_stamped(&telemetry(&groups), UnixOffset(0)), None);
        }
    }
}
