//! What is in a flight record: how topics are called, and the messages that the recorder makes of the bridge's journal, with their
//! definitions (`ros2msg`) and their bytes (CDR). [`check`] says what is complete of a record.

pub mod check;

use ipc_types::{RobotId, ServiceId};
use ros_messages::cdr::{Reader, Writer};

/// In the place of a process: a line of the log that is made of what the robot publishes.
pub const FLIGHT: &str = "flight";

/// The topic in a file of the service `key` of `robot`: `/robot1/dsp/telemetry`, `/robot1/battery_watch/cell_voltages`.
///
/// The robot's own topics are called by the process that publishes them, as those of modules are.
pub fn topic_of(robot: RobotId, key: &str) -> String {
    let name = match ipc_types::service::own(key) {
        Some(ServiceId::DspTelemetry) => "dsp/telemetry",
        Some(ServiceId::HeroTelemetry) => "hero/telemetry",
        Some(ServiceId::ModuleState) => "bridge/state",
        _ => key,
    };
    topic(robot, name)
}

/// The topic `name` of `robot`, one that the recorder makes itself for example.
pub fn topic(robot: RobotId, name: &str) -> String {
    format!("/robot{robot}/{name}")
}

/// Type of `SerialBytes`.
pub const SERIAL_BYTES: &str = "hero_msgs/msg/SerialBytes";

/// Its definition.
pub const SERIAL_BYTES_TEXT: &str = "\
# Bytes of the serial line between bridge and DSP, as they were read or written at once.

# When, host monotonic [ns].
uint64 at_ns
uint8[] data
";

/// Type of [`RequestEvent`].
pub const REQUEST_EVENT: &str = "hero_msgs/msg/RequestEvent";

/// Its definition.
pub const REQUEST_EVENT_TEXT: &str = "\
# A request to the bridge, or what the bridge reports about it.

# When, host monotonic [ns].
uint64 at_ns
# Chosen by the sender; every report has it.
uint64 request_id
# Of a path, the same in all of its waypoints; else 0.
uint64 path_id
# Process that sent the request; 0 when that is not known.
uint32 sender_pid
# request, report or sender-gone
string event
# control, movement or parameter
string service
# Such as start, takeoff, goto, land, hold, write.
string command
# Of a report: accepted, progress, done, refused, aborted or unknown.
string stage
# Of a report that is no success: why.
string reason
# In words.
string text
# Waypoint of goto; NaN else [deg].
float64 latitude_deg
# Waypoint of goto; NaN else [deg].
float64 longitude_deg
# Telemetry altitude of the waypoint of goto; height above take-off of takeoff; NaN else [m].
float64 altitude_m
";

/// Bytes of the serial line, in CDR.
pub fn serial_bytes(at_ns: u64, data: &[u8]) -> Vec<u8> {
    let mut writer = Writer::with_capacity(16 + data.len());
    writer.u64(at_ns);
    // The line carries far fewer at once.
    writer.u32(u32::try_from(data.len()).unwrap_or(u32::MAX));
    for byte in data {
        writer.u8(*byte);
    }
    writer.finish()
}

/// A request, or a report about one.
#[derive(Clone, Debug, PartialEq)]
pub struct RequestEvent<'a> {
    /// When, host monotonic ns.
    pub at_ns: u64,
    /// Its id.
    pub request_id: u64,
    /// Its path.
    pub path_id: u64,
    /// The process that sent it; 0 when that is not known.
    pub sender_pid: u32,
    /// `request`, `report` or `sender-gone`.
    pub event: &'a str,
    /// `control`, `movement` or `parameter`.
    pub service: &'a str,
    /// What is asked for.
    pub command: &'a str,
    /// Of a report.
    pub stage: &'a str,
    /// Of a report.
    pub reason: &'a str,
    /// In words.
    pub text: &'a str,
    /// Latitude, longitude (degrees), altitude (m); NaN where there is none.
    pub position: [f64; 3],
}

impl RequestEvent<'_> {
    /// The message in CDR.
    pub fn write(&self) -> Vec<u8> {
        let mut writer = Writer::with_capacity(160 + self.text.len());
        writer.u64(self.at_ns);
        writer.u64(self.request_id);
        writer.u64(self.path_id);
        writer.u32(self.sender_pid);
        for text in [
            self.event,
            self.service,
            self.command,
            self.stage,
            self.reason,
            self.text,
        ] {
            writer.string(text);
        }
        writer.f64s(&self.position);
        writer.finish()
    }
}

impl<'a> RequestEvent<'a> {
    /// The event that a message in CDR has; `None` if it is another message.
    pub fn read(cdr: &'a [u8]) -> Option<RequestEvent<'a>> {
        let mut body = Reader::new(cdr)?;
        Some(RequestEvent {
            at_ns: body.u64()?,
            request_id: body.u64()?,
            path_id: body.u64()?,
            sender_pid: body.u32()?,
            event: body.string()?,
            service: body.string()?,
            command: body.string()?,
            stage: body.string()?,
            reason: body.string()?,
            text: body.string()?,
            position: [body.f64()?, body.f64()?, body.f64()?],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_a_sequence_with_its_length() {
        let expected = [
            0, 1, 0, 0, // header
            7, 0, 0, 0, 0, 0, 0, 0, // at_ns
            2, 0, 0, 0, 0xaa, 0xbb,
        ];
        assert_eq!(serial_bytes(7, &[0xaa, 0xbb]), expected);
    }

    #[test]
    fn a_request_event_has_the_fields_of_its_definition_in_their_order() {
        let event = RequestEvent {
            at_ns: 1,
            request_id: 2,
            path_id: 3,
            sender_pid: 4,
            event: "request",
            service: "movement",
            command: "land",
            stage: "",
            reason: "",
            text: "land",
            position: [f64::NAN; 3],
        };
        let bytes = event.write();
        assert_eq!(bytes[4..12], 1_u64.to_le_bytes());
        assert_eq!(bytes[20..28], 3_u64.to_le_bytes());
        assert_eq!(bytes[28..32], 4_u32.to_le_bytes());
        assert_eq!(bytes[32..44], *b"\x08\0\0\0request\0");
        assert_eq!((bytes.len() - 4) % 8, 0);
        let again = RequestEvent::read(&bytes).map(|event| event.write());
        assert_eq!(again.as_ref(), Some(&bytes));
        for len in 0..bytes.len() {
            assert_eq!(RequestEvent::read(&bytes[..len]), None);
        }
        let fields = REQUEST_EVENT_TEXT.lines();
        let fields = fields.filter(|line| !line.starts_with('#') && !line.is_empty());
        assert_eq!(fields.count(), 13);
    }

    #[test]
    fn topics_are_called_by_robot_and_process() {
        let robot = RobotId::new(7).unwrap();
        for (key, expected) in [
            ("dsp_telemetry", "/robot7/dsp/telemetry"),
            ("hero_telemetry", "/robot7/hero/telemetry"),
            ("module_state", "/robot7/bridge/state"),
            ("status/state", "/robot7/status/state"),
            (
                "battery_watch/cell_voltages",
                "/robot7/battery_watch/cell_voltages",
            ),
        ] {
            assert_eq!(topic_of(robot, key), expected);
        }
    }
}
