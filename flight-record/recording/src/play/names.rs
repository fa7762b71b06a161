//! Which service a topic of a recording is.

use ipc_types::service::is_key;
use ipc_types::{RobotId, ServiceId};

/// The robot and the key of the service that was recorded as `topic`: of `/robot7/dsp/telemetry` 7 and `dsp_telemetry`. Nothing
/// when it is no name of a robot's topic.
pub fn key_of(topic: &str) -> Option<(RobotId, &str)> {
    let (number, name) = topic.strip_prefix("/robot")?.split_once('/')?;
    let robot = RobotId::new(number.parse().ok()?)?;
    let key = match name {
        "dsp/telemetry" => ServiceId::DspTelemetry.key(),
        "hero/telemetry" => ServiceId::HeroTelemetry.key(),
        "bridge/state" => ServiceId::ModuleState.key(),
        _ => name,
    };
    is_key(key).then_some((robot, key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_services_of_a_robot() {
        for (topic, expected) in [
            ("/robot7/dsp/telemetry", Some((7, "dsp_telemetry"))),
            ("/robot1/hero/telemetry", Some((1, "hero_telemetry"))),
            ("/robot1/bridge/state", Some((1, "module_state"))),
            ("/robot2/status/state", Some((2, "status/state"))),
            ("/robot0/status/state", None),
            ("/robot1/Bad Name", None),
            ("/robot1", None),
            ("/tf", None),
            ("", None),
        ] {
            let found = key_of(topic).map(|(robot, key)| (robot.get(), key));
            assert_eq!(found, expected, "{topic}");
        }
    }
}
