//! Standard messages of ROS 2 made of a [`HeroTelemetry`], in the frames of REP-103 and REP-105.
//!
//! | here | in ROS 2 |
//! |---|---|
//! | body: forward, right, down | `robot1/base_link`: forward, left, up |
//! | world: north, east, down | `map`: east, north, up |
//! | yaw from north, clockwise | yaw from east, counter-clockwise |
//!
//! `map` names the directions of the axes; each robot's local plane has its origin at its own first GPS fix.
//!
//! Telemetry has no covariances: matrices are zero, which the messages define as *unknown*, but for the position, whose
//! typical error follows from the kind of the fix. The first element is −1 where there is no value at all.

use ipc_types::payload::{HeroAngularRate, HeroTelemetry};
use ipc_types::{RobotId, TelemetryGroup};

use crate::attitude::{Quaternion, orientation};
use crate::cdr::Writer;
use crate::header::{MAP, body_frame, header};
use crate::time::UnixOffset;

/// Elements of a matrix with unknown covariances.
const UNKNOWN: [f64; 9] = [0.0; 9];

/// `sensor_msgs/msg/NavSatFix`: nothing is known about the covariance.
const COVARIANCE_TYPE_UNKNOWN: u8 = 0;
/// It is an estimate, as from a dilution of precision.
const COVARIANCE_TYPE_APPROXIMATED: u8 = 1;

/// Elements of the matrix of a value that there is not.
const NO_VALUE: [f64; 9] = [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Room for the longest of the messages, bytes: an `Imu` with the longest frame id has 340.
const CAPACITY: usize = 340;

/// `sensor_msgs/msg/NavSatStatus`: nothing is known about the fix.
const STATUS_UNKNOWN: i8 = -2;
/// There is no fix.
const STATUS_NO_FIX: i8 = -1;
/// A fix without augmentation.
const STATUS_FIX: i8 = 0;
/// A fix with corrections by satellite.
const STATUS_SBAS_FIX: i8 = 1;
/// A fix with corrections by a station on the ground.
const STATUS_GBAS_FIX: i8 = 2;
/// The receiver uses GPS; of other systems nothing is known.
const SERVICE_GPS: u16 = 1;

/// A message type that every ROS 2 has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum StandardMessage {
    /// Position on the globe, by GPS. Needs the group `geographic`; `gps_quality` gives the status of the fix.
    ///
    /// The altitude is the telemetry's, which need not count from the ellipsoid.
    NavSatFix,
    /// Attitude of the body against east, north, up; angular rate and specific force along the body's axes. Needs the
    /// groups `acceleration` and `angular_rate`. Without the group `attitude` the orientation is marked as absent.
    Imu,
    /// The battery's voltage. Needs the group `supply`; whatever else the message could hold is not measured.
    BatteryState,
    /// Velocity over ground to the east, to the north and up, in the frame `map`. Needs the group `gps_velocity`. The
    /// angular velocity about the same axes needs the groups `attitude` and `angular_rate`, else it is NaN.
    TwistStamped,
}

impl StandardMessage {
    /// All of them.
    pub const ALL: [StandardMessage; 4] = [
        StandardMessage::NavSatFix,
        StandardMessage::Imu,
        StandardMessage::BatteryState,
        StandardMessage::TwistStamped,
    ];

    /// Name of the type in ROS 2.
    pub const fn type_name(self) -> &'static str {
        match self {
            StandardMessage::NavSatFix => "sensor_msgs/msg/NavSatFix",
            StandardMessage::Imu => "sensor_msgs/msg/Imu",
            StandardMessage::BatteryState => "sensor_msgs/msg/BatteryState",
            StandardMessage::TwistStamped => "geometry_msgs/msg/TwistStamped",
        }
    }

    /// Hash of the type, the same in all distributions since Iron, the first one with hashes.
    pub const fn type_hash(self) -> &'static str {
        match self {
            StandardMessage::NavSatFix => {
                "RIHS01_62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"
            }
            StandardMessage::Imu => {
                "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"
            }
            StandardMessage::BatteryState => {
                "RIHS01_4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741"
            }
            StandardMessage::TwistStamped => {
                "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
            }
        }
    }

    /// Name of the topic within the robot's namespace, as drivers in ROS 2 call it.
    pub const fn key(self) -> &'static str {
        match self {
            StandardMessage::NavSatFix => "fix",
            StandardMessage::Imu => "imu/data",
            StandardMessage::BatteryState => "battery_state",
            StandardMessage::TwistStamped => "velocity",
        }
    }

    /// The message whose topic has this name within the robot's namespace.
    pub fn of_key(key: &str) -> Option<StandardMessage> {
        let mut all = StandardMessage::ALL.into_iter();
        all.find(|message| message.key() == key)
    }

    /// The groups without which there is no message.
    pub const fn needs(self) -> &'static [TelemetryGroup] {
        match self {
            StandardMessage::NavSatFix => &[TelemetryGroup::Geographic],
            StandardMessage::Imu => &[TelemetryGroup::Acceleration, TelemetryGroup::AngularRate],
            StandardMessage::BatteryState => &[TelemetryGroup::Supply],
            StandardMessage::TwistStamped => &[TelemetryGroup::GpsVelocity],
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
        if !self.needs().iter().all(|group| telemetry.valid(*group)) {
            return None;
        }
        let mut writer = Writer::with_capacity(CAPACITY);
        let unix_ns = offset.unix_ns(telemetry.received());
        if self == StandardMessage::TwistStamped {
            header(&mut writer, unix_ns, MAP);
        } else {
            header(&mut writer, unix_ns, &body_frame(robot));
        }
        match self {
            StandardMessage::NavSatFix => nav_sat_fix(&mut writer, telemetry),
            StandardMessage::Imu => imu(&mut writer, telemetry),
            StandardMessage::BatteryState => battery_state(&mut writer, telemetry),
            StandardMessage::TwistStamped => twist(&mut writer, telemetry),
        }
        Some(writer.finish())
    }
}

fn nav_sat_fix(writer: &mut Writer, telemetry: &HeroTelemetry) {
    let quality = telemetry
        .valid(TelemetryGroup::GpsQuality)
        .then_some(telemetry.gps_quality);
    writer.i8(fix_status(quality));
    writer.u16(SERVICE_GPS);
    writer.f64(telemetry.geodetic.latitude_rad.to_degrees());
    writer.f64(telemetry.geodetic.longitude_rad.to_degrees());
    writer.f64(telemetry.geodetic.altitude_m);
    match quality.and_then(typical_error_m) {
        Some(error_m) => {
            writer.f64s(&position_covariance(error_m));
            writer.u8(COVARIANCE_TYPE_APPROXIMATED);
        }
        None => {
            writer.f64s(&UNKNOWN);
            writer.u8(COVARIANCE_TYPE_UNKNOWN);
        }
    }
}

/// The horizontal error (one sigma, m) that a fix of this NMEA quality typically has under an open sky; `None` if the
/// position does not come from satellites.
fn typical_error_m(quality: u32) -> Option<f64> {
    match quality {
        1 | 3 => Some(3.0),
        2 => Some(1.0),
        4 => Some(0.02),
        5 => Some(0.5),
        _ => None,
    }
}

/// The matrix of a horizontal error: east, north, up. Satellites are all above, so that the height is twice as
/// uncertain.
fn position_covariance(error_m: f64) -> [f64; 9] {
    let [horizontal, vertical] = [error_m.powi(2), (2.0 * error_m).powi(2)];
    [horizontal, 0., 0., 0., horizontal, 0., 0., 0., vertical]
}

/// The status of a fix by its NMEA quality. Estimated, typed in and simulated positions (6, 7, 8) do not come from
/// satellites.
fn fix_status(quality: Option<u32>) -> i8 {
    match quality {
        None => STATUS_UNKNOWN,
        Some(1 | 3) => STATUS_FIX,
        Some(2) => STATUS_SBAS_FIX,
        Some(4 | 5) => STATUS_GBAS_FIX,
        Some(_) => STATUS_NO_FIX,
    }
}

fn imu(writer: &mut Writer, telemetry: &HeroTelemetry) {
    match orientation(telemetry) {
        Some(orientation) => {
            writer.f64s(&orientation.0);
            writer.f64s(&UNKNOWN);
        }
        None => {
            writer.f64s(&Quaternion::IDENTITY.0);
            writer.f64s(&NO_VALUE);
        }
    }
    writer.f64s(&body_rates(&telemetry.angular_rate));
    writer.f64s(&UNKNOWN);
    // Specific force in both: at rest the axis that points up has +9.81.
    let force = telemetry.acceleration;
    let force = [force.forward_mps2, -force.right_mps2, -force.down_mps2];
    writer.f64s(&force.map(f64::from));
    writer.f64s(&UNKNOWN);
}

fn battery_state(writer: &mut Writer, telemetry: &HeroTelemetry) {
    writer.f32(telemetry.supply.battery_v);
    // Temperature, current, charge, capacity, design capacity, percentage: the fuel's fraction is not the battery's.
    for _ in 0..6 {
        writer.f32(f32::NAN);
    }
    // Status, health, technology: unknown.
    for _ in 0..3 {
        writer.u8(0);
    }
    // Present.
    writer.u8(1);
    // Voltages and temperatures of cells.
    writer.empty_sequence();
    writer.empty_sequence();
    // Location and serial number.
    writer.string("");
    writer.string("");
}

fn twist(writer: &mut Writer, telemetry: &HeroTelemetry) {
    let velocity = telemetry.velocity;
    let linear = [velocity.east_mps, velocity.north_mps, velocity.up_mps];
    writer.f64s(&linear.map(f64::from));
    let angular = match orientation(telemetry) {
        Some(orientation) if telemetry.valid(TelemetryGroup::AngularRate) => {
            orientation.rotate(body_rates(&telemetry.angular_rate))
        }
        _ => [f64::NAN; 3],
    };
    writer.f64s(&angular);
}

/// Angular rate about forward, left, up.
fn body_rates(rate: &HeroAngularRate) -> [f64; 3] {
    [rate.forward_radps, -rate.right_radps, -rate.down_radps].map(f64::from)
}

#[cfg(test)]
mod tests;
