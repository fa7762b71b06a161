//! How the topics of a file are called: by robot and process.

use ipc_types::{RobotId, ServiceId};

/// In the place of a process: a line of the log that is made of what the robot publishes.
pub const FLIGHT: &str = "flight";

/// The topic in a file of the service `key` of `robot`: `/robot1/dsp/telemetry`, `/robot1/battery_watch/cell_voltages`.
pub fn topic_of(robot: RobotId, key: &str) -> String {
    topic(robot, name_of(key))
}

/// The name of the service `key` in files, without the robot. The robot's own topics are called by the process that
/// publishes them, as those of modules are.
pub fn name_of(key: &str) -> &str {
    match ipc_types::service::own(key) {
        Some(ServiceId::DspTelemetry) => "dsp/telemetry",
        Some(ServiceId::HeroTelemetry) => "hero/telemetry",
        Some(ServiceId::ModuleState) => "bridge/state",
        _ => key,
    }
}

/// The topic `name` of `robot`, one that the recorder makes itself for example.
pub fn topic(robot: RobotId, name: &str) -> String {
    format!("/robot{robot}/{name}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documents_name_topics_of_robot_1_as_its_files_do() {
        let robot = RobotId::DEFAULT;
        let ours =
            ["dsp_telemetry", "hero_telemetry", "module_state"].map(|key| topic_of(robot, key));
        for (file, document) in [
            (
                "recording.md",
                include_str!("../../../../docs/recording.md"),
            ),
            (
                "README.md",
                include_str!("../../../../bindings/python/README.md"),
            ),
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
