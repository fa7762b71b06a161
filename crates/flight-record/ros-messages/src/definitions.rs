//! Definitions of message types of ROS 2, as an MCAP file with the encoding `ros2msg` has them: the type, and behind it
//! each type that it contains.

use crate::diagnostics::DIAGNOSTIC_ARRAY;
use crate::geojson::GEO_JSON;
use crate::log::Log;
use crate::path::PATH;
use crate::pose::POSE_STAMPED;
use crate::standard::StandardMessage;
use crate::transform::TF_MESSAGE;

/// Stands before each type that another one contains.
const SEPARATOR: &str =
    "================================================================================";

/// Names of the types that messages of this crate have.
pub const TYPES: [&str; 10] = [
    StandardMessage::NavSatFix.type_name(),
    StandardMessage::Imu.type_name(),
    StandardMessage::BatteryState.type_name(),
    StandardMessage::TwistStamped.type_name(),
    POSE_STAMPED,
    PATH,
    Log::TYPE_NAME,
    TF_MESSAGE,
    DIAGNOSTIC_ARRAY,
    GEO_JSON,
];

/// The definition of one of [`TYPES`], with all that it contains; `None` for other names.
pub fn definition(type_name: &str) -> Option<String> {
    if !TYPES.contains(&type_name) {
        return None;
    }
    let (outer, contained) = own(type_name)?;
    let mut text = outer.to_owned();
    for name in contained {
        let (fields, _) = own(name)?;
        // In a definition, types are named without `/msg`.
        let name = name.replace("/msg/", "/");
        text.push_str(&format!("\n{SEPARATOR}\nMSG: {name}\n{fields}"));
    }
    Some(text)
}

/// The fields of a type, and the types that it contains, directly or not.
fn own(type_name: &str) -> Option<(&'static str, &'static [&'static str])> {
    Some(match type_name {
        "sensor_msgs/msg/NavSatFix" => (
            NAV_SAT_FIX,
            &[
                "std_msgs/msg/Header",
                "builtin_interfaces/msg/Time",
                "sensor_msgs/msg/NavSatStatus",
            ],
        ),
        "sensor_msgs/msg/Imu" => (
            IMU,
            &[
                "std_msgs/msg/Header",
                "builtin_interfaces/msg/Time",
                "geometry_msgs/msg/Quaternion",
                "geometry_msgs/msg/Vector3",
            ],
        ),
        "sensor_msgs/msg/BatteryState" => (
            BATTERY_STATE,
            &["std_msgs/msg/Header", "builtin_interfaces/msg/Time"],
        ),
        "geometry_msgs/msg/TwistStamped" => (
            "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
            &[
                "std_msgs/msg/Header",
                "builtin_interfaces/msg/Time",
                "geometry_msgs/msg/Twist",
                "geometry_msgs/msg/Vector3",
            ],
        ),
        "geometry_msgs/msg/PoseStamped" => (
            "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
            &[
                "std_msgs/msg/Header",
                "builtin_interfaces/msg/Time",
                "geometry_msgs/msg/Pose",
                "geometry_msgs/msg/Point",
                "geometry_msgs/msg/Quaternion",
            ],
        ),
        "nav_msgs/msg/Path" => (
            "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
            &[
                "std_msgs/msg/Header",
                "builtin_interfaces/msg/Time",
                "geometry_msgs/msg/PoseStamped",
                "geometry_msgs/msg/Pose",
                "geometry_msgs/msg/Point",
                "geometry_msgs/msg/Quaternion",
            ],
        ),
        "rcl_interfaces/msg/Log" => (LOG, &["builtin_interfaces/msg/Time"]),
        "tf2_msgs/msg/TFMessage" => (
            "geometry_msgs/TransformStamped[] transforms\n",
            &[
                "geometry_msgs/msg/TransformStamped",
                "std_msgs/msg/Header",
                "builtin_interfaces/msg/Time",
                "geometry_msgs/msg/Transform",
                "geometry_msgs/msg/Vector3",
                "geometry_msgs/msg/Quaternion",
            ],
        ),
        "diagnostic_msgs/msg/DiagnosticArray" => (
            "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
            &[
                "std_msgs/msg/Header",
                "builtin_interfaces/msg/Time",
                "diagnostic_msgs/msg/DiagnosticStatus",
                "diagnostic_msgs/msg/KeyValue",
            ],
        ),
        "foxglove_msgs/msg/GeoJSON" => ("string geojson\n", &[]),
        "std_msgs/msg/Header" => ("builtin_interfaces/Time stamp\nstring frame_id\n", &[]),
        "builtin_interfaces/msg/Time" => ("int32 sec\nuint32 nanosec\n", &[]),
        "sensor_msgs/msg/NavSatStatus" => (NAV_SAT_STATUS, &[]),
        "geometry_msgs/msg/Quaternion" => ("float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n", &[]),
        "geometry_msgs/msg/Vector3" | "geometry_msgs/msg/Point" => {
            ("float64 x\nfloat64 y\nfloat64 z\n", &[])
        }
        "geometry_msgs/msg/TransformStamped" => (TRANSFORM_STAMPED, &[]),
        "geometry_msgs/msg/Transform" => (
            "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
            &[],
        ),
        "diagnostic_msgs/msg/DiagnosticStatus" => (DIAGNOSTIC_STATUS, &[]),
        "diagnostic_msgs/msg/KeyValue" => ("string key\nstring value\n", &[]),
        "geometry_msgs/msg/Twist" => (
            "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
            &[],
        ),
        "geometry_msgs/msg/Pose" => (
            "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
            &[],
        ),
        _ => return None,
    })
}

const NAV_SAT_FIX: &str = "\
std_msgs/Header header
sensor_msgs/NavSatStatus status
# Positive is north of the equator. [deg]
float64 latitude
# Positive is east of the prime meridian. [deg]
float64 longitude
# [m]
float64 altitude
# [m^2]
float64[9] position_covariance
uint8 COVARIANCE_TYPE_UNKNOWN=0
uint8 COVARIANCE_TYPE_APPROXIMATED=1
uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2
uint8 COVARIANCE_TYPE_KNOWN=3
uint8 position_covariance_type
";

const NAV_SAT_STATUS: &str = "\
int8 STATUS_UNKNOWN=-2
int8 STATUS_NO_FIX=-1
int8 STATUS_FIX=0
int8 STATUS_SBAS_FIX=1
int8 STATUS_GBAS_FIX=2
int8 status
uint16 SERVICE_UNKNOWN=0
uint16 SERVICE_GPS=1
uint16 SERVICE_GLONASS=2
uint16 SERVICE_COMPASS=4
uint16 SERVICE_GALILEO=8
uint16 service
";

const IMU: &str = "\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
# [rad/s]
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
# [m/s^2]
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
";

const BATTERY_STATE: &str = "\
std_msgs/Header header
# [V]
float32 voltage
# [degC]
float32 temperature
# [A]
float32 current
# [Ah]
float32 charge
# [Ah]
float32 capacity
# [Ah]
float32 design_capacity
float32 percentage
uint8 power_supply_status
uint8 power_supply_health
uint8 power_supply_technology
bool present
# [V]
float32[] cell_voltage
# [degC]
float32[] cell_temperature
string location
string serial_number
";

const LOG: &str = "\
builtin_interfaces/Time stamp
uint8 DEBUG=10
uint8 INFO=20
uint8 WARN=30
uint8 ERROR=40
uint8 FATAL=50
uint8 level
# The process.
string name
string msg
string file
string function
uint32 line
";

const TRANSFORM_STAMPED: &str = "\
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
";

const DIAGNOSTIC_STATUS: &str = "\
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
diagnostic_msgs/KeyValue[] values
";

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Types of fields that are not messages.
    const PLAIN: [&str; 12] = [
        "bool", "byte", "int8", "uint8", "int16", "uint16", "int32", "uint32", "uint64", "float32",
        "float64", "string",
    ];

    /// Each definition has every type that its fields name, once, and no other.
    #[test]
    fn definitions_are_closed() {
        for type_name in TYPES {
            let text = definition(type_name).expect("a definition");
            let mut defined = BTreeSet::new();
            let mut used = BTreeSet::new();
            for line in text.lines() {
                if let Some(name) = line.strip_prefix("MSG: ") {
                    assert!(defined.insert(name), "{type_name}: {name} twice");
                    continue;
                }
                if line.is_empty() || line.starts_with(['#', '=']) {
                    continue;
                }
                let kind = line.split([' ', '[']).next().unwrap_or_default();
                if !PLAIN.contains(&kind) {
                    used.insert(kind);
                }
            }
            assert_eq!(defined, used, "{type_name}");
        }
        assert_eq!(definition("std_msgs/msg/Header"), None);
    }
}
