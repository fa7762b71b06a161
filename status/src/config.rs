//! The configuration of the process, with complete defaults; `status.toml` shows and explains each value.

use runtime::realtime::RealtimeConfig;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::calibration::Calibration;
use crate::estimator::config::EstimatorConfig;
use crate::log::config::LogConfig;

/// Most logs at once: each field group in one of its own. More are refused.
pub const MAX_LOGS: usize = 16;

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "status.toml";

/// All of it.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// From raw numbers to SI units.
    pub calibration: Calibration,
    /// What estimates values that no single sensor measures well.
    pub estimator: EstimatorConfig,
    /// Logs, none by default. The journal does not have them.
    #[serde(deserialize_with = "logs", skip_serializing)]
    pub log: Vec<LogConfig>,
    /// What the loop asks of the system. The journal does not have it.
    #[serde(skip_serializing)]
    pub realtime: RealtimeConfig,
}

impl Config {
    /// All of it as `status.toml` has it, what the journal does not have included.
    pub fn to_toml(&self) -> String {
        let left_out = [
            ("log", toml::Value::try_from(&self.log)),
            ("realtime", toml::Value::try_from(&self.realtime)),
        ];
        runtime::config::to_toml(self, left_out)
    }
}

/// Reads the logs, at most [`MAX_LOGS`], and checks what concerns more than one value.
fn logs<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<LogConfig>, D::Error> {
    let logs = Vec::<LogConfig>::deserialize(deserializer)?;
    let count = logs.len();
    if count > MAX_LOGS {
        return Err(D::Error::custom(format_args!(
            "{count} logs are too many: at most {MAX_LOGS} can be written at once"
        )));
    }
    for (index, log) in logs.iter().enumerate() {
        let name = &log.name;
        // Each log recognises its old files by their names. Two paths may lead to the same directory, so names must
        // differ even in different ones.
        if logs[..index].iter().any(|other| other.name == *name) {
            return Err(D::Error::custom(format_args!(
                "two logs have the name `{name}`: give each a `name` of its own"
            )));
        }
        let (file, total) = (log.max_file_mib, log.max_total_mib);
        if total < 2 * file {
            return Err(D::Error::custom(format_args!(
                "the log `{name}` has max_total_mib = {total}: it must be at least twice max_file_mib, which is {file}"
            )));
        }
    }
    Ok(logs)
}

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup as Group;
    use runtime::config::parse;
    use runtime::config::proof::{assert_annotated, assert_refused};

    use super::*;
    use crate::group::GroupSet;
    use crate::log::groups::LogGroups;

    const EXAMPLE: &str = include_str!("../status.toml");

    #[test]
    fn the_annotated_example_is_the_default() {
        assert_annotated::<Config>(EXAMPLE, &[]);
    }

    #[test]
    fn the_examples_that_are_commented_out_work() {
        // In the example a comment is `# text`, a disabled setting `#setting`.
        let enable = |line: &str| match line.strip_prefix('#') {
            Some(setting) if !setting.starts_with(' ') => format!("{setting}\n"),
            _ => format!("{line}\n"),
        };
        let text: String = EXAMPLE.lines().map(enable).collect();
        let config: Config = parse(&text, "status.toml").unwrap();
        assert_eq!(config.log.len(), 2);
        // Everything is at its default but the groups.
        let all = LogConfig {
            groups: LogGroups::ALL,
            ..LogConfig::default()
        };
        assert_eq!(config.log[0], all);
        assert_eq!(config.log[1].name.as_str(), "imu");
        assert_eq!(
            parse::<Config>(&config.to_toml(), "status.toml").unwrap(),
            config
        );
        let imu = [
            Group::Time,
            Group::Attitude,
            Group::Acceleration,
            Group::AngularRate,
        ];
        assert_eq!(config.log[1].groups, GroupSet::from_iter(imu).into());
    }

    #[test]
    fn mistakes_are_reported_with_line_and_reason() {
        assert_refused::<Config>(
            r#"
            [calibration.servo]

            half_travel_us = 0 #! must be from 1.0 to 2000.0
            ---
            [calibration.pan]
            deg_per_step = nan #! NaN is out of range
            ---
            [estimator]
            kind = 'altitud' #! did you mean `altitude`?
            ---
            [estimator.altitude]
            sonar_m = 0 #! must be from 0.001 to 100
            ---
            [[log]]
            groups = ['time']
            [[log]]
            groups = ['altitude'] #! did you mean `attitude`?
            ---
            [[log]]
            max_file_mib = 0 #! must be from 1 to 4095
            ---
            [[log]]
            max_total_mib = 1 #! must be from 2 to 1048576
            ---
            [[log]]
            min_free_mib = -1 #! -1
            ---
            [[log]] #! must be at least twice max_file_mib, which is 64
            max_total_mib = 127
            ---
            [[log]] #! two logs have the name `a`
            name = 'a'
            [[log]]
            name = 'a'
            ---
            [[log]]
            name = '../x' #! is not a name for a log
            ---
            [[log]]
            name = 'aaaaaaaaaaaaaaaaaaaaaaaaa' #! up to 24 letters
            "#,
        );
        let others = "[[log]]\n".repeat(MAX_LOGS);
        assert_refused::<Config>(&format!("\n[[log]] #! 17 logs are too many\n{others}"));
    }
}
