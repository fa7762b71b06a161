//! How topics are called in a recording.

use ipc_types::{RobotId, ServiceId};

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

#[cfg(test)]
mod tests {
    use super::*;

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
