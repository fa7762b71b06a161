//! `nav_msgs/msg/Path`: a line of places in the frame `map`, such as the plan and the track that was flown.

use crate::attitude::Quaternion;
use crate::cdr::Writer;
use crate::header::{MAP, header};

/// Name of the type in ROS 2.
pub const PATH: &str = "nav_msgs/msg/Path";

/// Length of each pose, bytes: time, frame with its length and zero, seven numbers.
const POSE_LEN: usize = 8 + 8 + 7 * 8;

/// A place of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// When the robot is or was there, Unix time, ns; of a plan the time of the message.
    pub unix_ns: i64,
    /// Metres east, north, up.
    pub position: [f64; 3],
}

/// The message in CDR, stamped with `unix_ns`. A path says nothing about attitudes: no pose is turned.
pub fn path_message(unix_ns: i64, points: &[PathPoint]) -> Vec<u8> {
    let mut writer = Writer::with_capacity(24 + POSE_LEN * points.len());
    header(&mut writer, unix_ns, MAP);
    // Its points lie in memory, so there are less than 2³².
    writer.u32(u32::try_from(points.len()).unwrap_or(u32::MAX));
    for point in points {
        header(&mut writer, point.unix_ns, MAP);
        writer.f64s(&point.position);
        writer.f64s(&Quaternion::IDENTITY.0);
    }
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cdr::Reader;

    #[test]
    fn a_path_has_its_places_with_their_times() {
        let points = [[1.0, 2.0, 3.0], [-4.0, 5.5, 6.0]].map(|position| PathPoint {
            unix_ns: 2_000_000_003,
            position,
        });
        let message = path_message(1_000_000_002, &points);
        let mut reader = Reader::new(&message).unwrap();
        assert_eq!((reader.i32(), reader.u32()), (Some(1), Some(2)));
        assert_eq!((reader.string(), reader.u32()), (Some("map"), Some(2)));
        for point in points {
            assert_eq!((reader.i32(), reader.u32()), (Some(2), Some(3)));
            assert_eq!(reader.string(), Some("map"));
            let numbers = std::array::from_fn(|_| reader.f64().unwrap());
            let [x, y, z] = point.position;
            assert_eq!(numbers, [x, y, z, 0.0, 0.0, 0.0, 1.0]);
        }
        assert!(reader.is_at_end());
        let nothing = path_message(0, &[]);
        assert_eq!(nothing.len(), 4 + 8 + 8 + 4, "a path that is over");
    }
}
