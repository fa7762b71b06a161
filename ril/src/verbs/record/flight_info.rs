//! What each file of a recording says of itself: versions, machine, clocks, layouts, and the configuration of the processes.

use std::collections::BTreeMap;

use ipc_types::RobotId;
use recording::{Anchor, Attachment, FlightInfo};

/// Name of the record with versions, robot, machine and the clocks at the start.
pub const FLIGHT: &str = "ril.flight";

/// Name of the record with the layout of each topic that was there when the record was written, by topic: type and hash.
pub const LAYOUTS: &str = "ril.layouts";

/// What is known of the robot at a moment.
#[derive(Clone, Debug, Default)]
pub struct Facts {
    /// Name of the machine.
    pub host: String,
    /// The machine's boot: monotonic times of two recordings can be compared only within one.
    pub boot_id: String,
    /// Live processes of the robot, by name: process id.
    pub processes: BTreeMap<String, u32>,
    /// Layout and hash by topic.
    pub layouts: BTreeMap<String, String>,
    /// Files that are recorded along, by name.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Facts {
    /// As the recorder writes it into each file.
    pub fn flight_info(self, robot: RobotId, start: Anchor) -> FlightInfo {
        let mut flight: BTreeMap<String, String> = [
            ("robot", robot.to_string()),
            ("ril_version", env!("CARGO_PKG_VERSION").to_owned()),
            ("host", self.host),
            ("boot_id", self.boot_id),
            ("start_monotonic_ns", start.monotonic.0.to_string()),
            ("start_unix_ns", start.unix_ns.to_string()),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into();
        for (process, pid) in self.processes {
            flight.insert(format!("pid.{process}"), pid.to_string());
        }
        let attachment = |(name, data): (String, Vec<u8>)| Attachment {
            media_type: "application/toml".to_owned(),
            name,
            data,
        };
        FlightInfo {
            robot,
            metadata: vec![
                (FLIGHT.to_owned(), flight),
                (LAYOUTS.to_owned(), self.layouts),
            ],
            attachments: self.files.into_iter().map(attachment).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::MonotonicNs;

    use super::*;

    #[test]
    fn a_file_says_which_robot_machine_and_version_it_is_of() {
        let facts = Facts {
            host: "field".to_owned(),
            processes: [("bridge".to_owned(), 812)].into(),
            files: [("bridge.toml".to_owned(), b"x = 1".to_vec())].into(),
            ..Facts::default()
        };
        let start = Anchor {
            monotonic: MonotonicNs(5),
            unix_ns: 7,
        };
        let info = facts.flight_info(RobotId::new(3).unwrap(), start);
        let (name, flight) = &info.metadata[0];
        assert_eq!(name, FLIGHT);
        for (key, expected) in [
            ("robot", "3"),
            ("ril_version", env!("CARGO_PKG_VERSION")),
            ("host", "field"),
            ("start_monotonic_ns", "5"),
            ("start_unix_ns", "7"),
            ("pid.bridge", "812"),
        ] {
            assert_eq!(flight.get(key).map(String::as_str), Some(expected), "{key}");
        }
        assert_eq!(info.attachments[0].name, "bridge.toml");
        assert_eq!(info.attachments[0].data, b"x = 1");
    }
}
