//! `std_msgs/msg/Header`: the time and the frame of a message.

use ipc_types::RobotId;

use crate::cdr::Writer;

/// Frame of the world.
pub(crate) const MAP: &str = "map";

/// Frame of the robot's body.
pub(crate) fn body_frame(robot: RobotId) -> String {
    format!("robot{robot}/base_link")
}

/// Appends a header: the time and the frame.
pub(crate) fn header(writer: &mut Writer, unix_ns: i64, frame: &str) {
    stamp(writer, unix_ns);
    writer.string(frame);
}

/// `builtin_interfaces/msg/Time`: seconds with 32 bits, which end in 2038. Later times stay there.
pub(crate) fn stamp(writer: &mut Writer, unix_ns: i64) {
    let unix_s = unix_ns.div_euclid(1_000_000_000);
    let seconds = unix_s.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
    writer.i32(seconds as i32);
    // Less than 1e9, so it fits.
    writer.u32(unix_ns.rem_euclid(1_000_000_000) as u32);
}
