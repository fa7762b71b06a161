//! What a log is made of: groups of the status mask, and the DSP's errors.

use std::fmt;

use ipc_types::TelemetryGroup;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::group::GroupSet;

/// The name of the group of the DSP's errors, which is no group of the status mask.
const DSP_ERRORS: &str = "dsp_errors";

/// The groups of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LogGroups {
    /// Groups of the status mask.
    pub telemetry: GroupSet,
    /// Whether the DSP's errors are logged too.
    pub dsp_errors: bool,
}

impl LogGroups {
    /// Everything.
    pub const ALL: LogGroups = LogGroups {
        telemetry: GroupSet::ALL,
        dsp_errors: true,
    };

    /// Whether there is nothing to log.
    pub const fn is_empty(self) -> bool {
        self.telemetry.is_empty() && !self.dsp_errors
    }

    /// Adds the group of this name; gives false if there is none.
    fn add(&mut self, name: &str) -> bool {
        if name == DSP_ERRORS {
            self.dsp_errors = true;
            return true;
        }
        let group = TelemetryGroup::from_name(name);
        self.telemetry = self.telemetry.union(group.into_iter().collect());
        group.is_some()
    }
}

impl From<GroupSet> for LogGroups {
    fn from(telemetry: GroupSet) -> LogGroups {
        LogGroups {
            telemetry,
            dsp_errors: false,
        }
    }
}

/// The list of names that a configuration has.
impl Serialize for LogGroups {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let groups = self.telemetry.groups().map(TelemetryGroup::name);
        to.collect_seq(groups.chain(self.dsp_errors.then_some(DSP_ERRORS)))
    }
}

/// Names with commas between them.
impl fmt::Display for LogGroups {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.telemetry.fmt(f)?;
        if self.dsp_errors {
            let comma = if self.telemetry.is_empty() { "" } else { ", " };
            write!(f, "{comma}{DSP_ERRORS}")?;
        }
        Ok(())
    }
}

/// A list of names, as in `groups = ["time", "dsp_errors"]`; a name that is there twice counts once.
impl<'de> Deserialize<'de> for LogGroups {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let names = Vec::<Name>::deserialize(deserializer)?;
        let mut groups = LogGroups::default();
        for Name(name) in names {
            groups.add(&name);
        }
        Ok(groups)
    }
}

/// The name of a group that exists. It is checked where it is read, so that an error has its line.
struct Name(String);

/// All names, for errors.
const NAMES: [&str; TelemetryGroup::ALL.len() + 1] = {
    let mut names = [DSP_ERRORS; TelemetryGroup::ALL.len() + 1];
    let mut index = 0;
    while index < TelemetryGroup::ALL.len() {
        names[index] = TelemetryGroup::ALL[index].name();
        index += 1;
    }
    names
};

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        if LogGroups::default().add(&name) {
            Ok(Name(name))
        } else {
            Err(D::Error::unknown_variant(&name, &NAMES))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_a_list_of_names() {
        #[derive(Deserialize)]
        struct Example {
            groups: LogGroups,
        }
        let parse = |list: &str| {
            let text = format!("groups = {list}");
            runtime::config::parse::<Example>(&text, "x.toml").map(|example| example.groups)
        };
        for group in TelemetryGroup::ALL {
            let groups = parse(&format!("['{}']", group.name())).unwrap();
            assert_eq!(groups, GroupSet(group.bit()).into(), "{group}");
        }
        assert!(parse("[]").unwrap().is_empty());
        let repeated = parse("['time', 'barometer', 'time']").unwrap();
        assert_eq!(repeated, GroupSet(0x2001).into());
        let errors = parse("['dsp_errors']").unwrap();
        assert!(errors.dsp_errors && errors.telemetry.is_empty() && !errors.is_empty());
        for (wrong, meant) in [("sonnar", "sonar"), ("dsp_error", "dsp_errors")] {
            let error = parse(&format!("['{wrong}']")).unwrap_err().to_string();
            assert!(
                error.contains(&format!("did you mean `{meant}`?")),
                "{error}"
            );
        }
    }

    #[test]
    fn groups_are_shown_by_their_names() {
        let mut groups = LogGroups::from(GroupSet(0x2001));
        assert_eq!(groups.to_string(), "time, barometer");
        groups.dsp_errors = true;
        assert_eq!(groups.to_string(), "time, barometer, dsp_errors");
        groups.telemetry = GroupSet::default();
        assert_eq!(groups.to_string(), "dsp_errors");
    }
}
