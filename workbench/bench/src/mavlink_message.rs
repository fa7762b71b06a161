//! The MAVLink message that says the most of what a sample of telemetry says: `ODOMETRY`, 230 bytes of payload, which is
//! pose, velocity, rates and their covariances. A sample has 272 bytes.

use ipc_types::payload::HeroTelemetry;
use mavlink::dialects::common::{MavFrame, MavMessage, ODOMETRY_DATA};

use crate::peers::ends::Mark;

/// The element of the covariance that carries the bits of the index.
const INDEX: usize = 20;

/// `sample` as a message.
pub fn to_message(sample: &HeroTelemetry) -> MavMessage {
    let mut pose_covariance = [1e-3; 21];
    pose_covariance[INDEX] = f32::from_bits(sample.source_sequence as u32);
    let (attitude, rate) = (&sample.attitude, &sample.angular_rate);
    MavMessage::ODOMETRY(ODOMETRY_DATA {
        // Nanoseconds, because nobody but this program reads it.
        time_usec: sample.published_ns,
        x: sample.local.north_m as f32,
        y: sample.local.east_m as f32,
        z: -sample.geodetic.altitude_m as f32,
        q: [1.0, attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad],
        vx: sample.velocity.north_mps,
        vy: sample.velocity.east_mps,
        vz: -sample.velocity.up_mps,
        rollspeed: rate.forward_radps,
        pitchspeed: rate.right_radps,
        yawspeed: rate.down_radps,
        pose_covariance,
        velocity_covariance: [1e-3; 21],
        frame_id: MavFrame::MAV_FRAME_LOCAL_NED,
        child_frame_id: MavFrame::MAV_FRAME_BODY_FRD,
    })
}

/// The mark of a message of [`to_message`].
pub fn mark(message: &MavMessage) -> Option<Mark> {
    match message {
        MavMessage::ODOMETRY(odometry) => Some(Mark {
            index: odometry.pose_covariance[INDEX].to_bits().into(),
            sent_ns: odometry.time_usec,
        }),
        _ => None,
    }
}
