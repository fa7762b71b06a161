//! What is in a flight record: how topics are called, and the messages that the recorder makes of the bridge's journal, with their
//! definitions (`ros2msg`) and their bytes (CDR). [`check`] says what is complete of a record; [`new_file`] writes one anew.

pub mod check;

use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use ipc_types::{RobotId, ServiceId};
use recording::read::ReadError;
use ros_messages::Level;
use ros_messages::cdr::{Reader, Writer};
use runtime::exit::Failure;

use crate::robot::changes::Weight;

/// In the place of a process: a line of the log that is made of what the robot publishes.
pub const FLIGHT: &str = "flight";

/// The level of ROS 2 that a weight has.
pub fn level(weight: Weight) -> Level {
    match weight {
        Weight::Note | Weight::Order => Level::Info,
        Weight::Warning => Level::Warn,
        Weight::Alarm => Level::Error,
    }
}

/// The topic in a file of the service `key` of `robot`: `/robot1/dsp/telemetry`, `/robot1/battery_watch/cell_voltages`.
pub fn topic_of(robot: RobotId, key: &str) -> String {
    topic(robot, name_of(key))
}

/// The name of the service `key` in files, without the robot. The robot's own topics are called by the process that publishes them, as
/// those of modules are.
pub fn name_of(key: &str) -> &str {
    match ipc_types::service::own(key) {
        Some(ServiceId::DspTelemetry) => "dsp/telemetry",
        Some(ServiceId::HeroTelemetry) => "hero/telemetry",
        Some(ServiceId::ModuleState) => "bridge/state",
        _ => key,
    }
}

/// The short names of the robot's own topics, and what they are.
pub(crate) const SHORT_NAMES: [(&str, ServiceId, &str); 3] = [
    (
        "dsp",
        ServiceId::DspTelemetry,
        "Telemetry as the DSP sends it",
    ),
    ("hero", ServiceId::HeroTelemetry, "Telemetry in SI units"),
    ("state", ServiceId::ModuleState, "State of the module"),
];

/// The key that the short name of a topic stands for, or its name in recordings; any other text is a key by itself.
pub(crate) fn key_of(name: &str) -> &str {
    let mut names = SHORT_NAMES.iter();
    let short = names.find(|(short, service, _)| *short == name || name_of(service.key()) == name);
    short.map_or(name, |(_, service, _)| service.key())
}

/// The topic `name` of `robot`, one that the recorder makes itself for example.
pub fn topic(robot: RobotId, name: &str) -> String {
    format!("/robot{robot}/{name}")
}

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
# Station whose order the relay handed on; empty when a program on the robot gave it, or it is not known.
string station
";

/// Writes a record anew: what `write` gives, onto the disk, into a file that only its owner may write and its group may read.
/// `next_step` is for a file that is there already.
///
/// # Errors
///
/// Code 2 when the file is there already or cannot be written; what was written of it is removed, because it would look like all.
pub fn new_file<T>(
    path: &Path,
    next_step: &str,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<T, ReadError>,
) -> Result<T, Failure> {
    let name = path.display();
    let mut options = File::options();
    let file = options.write(true).create_new(true).mode(0o640).open(path);
    let file = file.map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => {
            Failure::usage(format!("{name} exists already")).with_next_step(next_step)
        }
        _ => Failure::usage(format!("{name} cannot be written: {error}")),
    })?;
    let mut to = BufWriter::new(file);
    let written = write(&mut to).and_then(|written| {
        to.flush()?;
        to.get_ref().sync_all()?;
        Ok(written)
    });
    written.map_err(|error| {
        let _ = fs::remove_file(path);
        Failure::usage(error).context(name.to_string())
    })
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
    /// The station whose order the relay handed on; empty if there is none, or the record does not say.
    pub station: &'a str,
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
        writer.string(self.station);
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
            station: match body.is_at_end() {
                true => "",
                false => body.string()?,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            station: "gcs",
        };
        let bytes = event.write();
        assert_eq!(bytes[4..12], 1_u64.to_le_bytes());
        assert_eq!(bytes[20..28], 3_u64.to_le_bytes());
        assert_eq!(bytes[28..32], 4_u32.to_le_bytes());
        assert_eq!(bytes[32..44], *b"\x08\0\0\0request\0");
        let again = RequestEvent::read(&bytes).map(|event| event.write());
        assert_eq!(again.as_ref(), Some(&bytes));
        // A message of a recorder that writes no station ends before it.
        let without = bytes.len() - 8;
        for len in (0..bytes.len()).filter(|len| *len != without) {
            assert_eq!(RequestEvent::read(&bytes[..len]), None);
        }
        let event = RequestEvent::read(&bytes[..without]).unwrap();
        assert_eq!((event.text, event.station), ("land", ""));
        let fields = REQUEST_EVENT_TEXT.lines();
        let fields = fields.filter(|line| !line.starts_with('#') && !line.is_empty());
        assert_eq!(fields.count(), 14);
    }

    #[test]
    fn the_documents_name_topics_of_robot_1_as_its_files_do() {
        let robot = RobotId::DEFAULT;
        let ours =
            ["dsp_telemetry", "hero_telemetry", "module_state"].map(|key| topic_of(robot, key));
        for (file, document) in [
            ("recording.md", include_str!("../../docs/recording.md")),
            ("README.md", include_str!("../../bindings/python/README.md")),
        ] {
            let quoted = document.split('"').chain(document.split('`'));
            let named = quoted.filter(|word| word.starts_with("/robot1/"));
            let of_python = document.split("flight[\"").skip(1);
            let of_python = of_python.filter_map(|rest| rest.split('"').next());
            let named = named.map(str::to_owned);
            let named: Vec<String> = named
                .chain(of_python.map(|name| topic(robot, name)))
                .collect();
            assert!(!named.is_empty(), "{file}");
            for name in named {
                // That of a module is an example.
                let is_module = name.starts_with("/robot1/battery_watch/");
                assert!(is_module || ours.contains(&name), "{file}: {name}");
            }
        }
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
