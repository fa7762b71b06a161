//! Sets of telemetry groups: what is valid in a sample, and what a log is made of.

use std::fmt;

use ipc_types::TelemetryGroup;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// A set of [`TelemetryGroup`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct GroupSet(pub u16);

impl GroupSet {
    /// All sixteen groups.
    pub const ALL: GroupSet = GroupSet(u16::MAX);

    /// Whether `group` is in the set.
    pub const fn contains(self, group: TelemetryGroup) -> bool {
        self.0 & group.bit() != 0
    }

    /// Whether no group is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The groups that are in either set.
    #[must_use]
    pub const fn union(self, other: GroupSet) -> GroupSet {
        GroupSet(self.0 | other.0)
    }

    /// The groups that are in this set and not in `other`.
    #[must_use]
    pub const fn without(self, other: GroupSet) -> GroupSet {
        GroupSet(self.0 & !other.0)
    }

    /// The groups of the set in the order of their bits.
    pub fn groups(self) -> impl Iterator<Item = TelemetryGroup> {
        TelemetryGroup::in_mask(self.0)
    }
}

impl FromIterator<TelemetryGroup> for GroupSet {
    fn from_iter<I: IntoIterator<Item = TelemetryGroup>>(groups: I) -> Self {
        GroupSet(groups.into_iter().fold(0, |bits, group| bits | group.bit()))
    }
}

/// Names with commas between them.
impl fmt::Display for GroupSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, group) in self.groups().enumerate() {
            let comma = if index == 0 { "" } else { ", " };
            write!(f, "{comma}{}", group.name())?;
        }
        Ok(())
    }
}

/// A list of names, as in `groups = ["time", "attitude"]`; a name that is there twice counts once.
impl<'de> Deserialize<'de> for GroupSet {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let named = Vec::<Named>::deserialize(deserializer)?;
        Ok(named.into_iter().map(|Named(group)| group).collect())
    }
}

/// A group by its name.
struct Named(TelemetryGroup);

/// All names, for errors.
const NAMES: [&str; TelemetryGroup::ALL.len()] = {
    let mut names = [""; TelemetryGroup::ALL.len()];
    let mut index = 0;
    while index < names.len() {
        names[index] = TelemetryGroup::ALL[index].name();
        index += 1;
    }
    names
};

impl<'de> Deserialize<'de> for Named {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        TelemetryGroup::from_name(&name)
            .map(Named)
            .ok_or_else(|| D::Error::unknown_variant(&name, &NAMES))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_a_list_of_names() {
        #[derive(Deserialize)]
        struct Example {
            groups: GroupSet,
        }
        let parse = |list: &str| {
            let text = format!("groups = {list}");
            runtime::config::parse::<Example>(&text, "x.toml").map(|example| example.groups)
        };
        for group in TelemetryGroup::ALL {
            let groups = parse(&format!("['{}']", group.name())).unwrap();
            assert_eq!(groups, GroupSet(group.bit()), "{group}");
        }
        assert_eq!(parse("[]").unwrap(), GroupSet::default());
        let repeated = parse("['time', 'barometer', 'time']").unwrap();
        assert_eq!(repeated, GroupSet(0x2001));
        let error = parse("['sonnar']").unwrap_err().to_string();
        assert!(error.contains("did you mean `sonar`?"), "{error}");
    }

    #[test]
    fn sets_are_combined_and_shown() {
        let groups = [TelemetryGroup::Barometer, TelemetryGroup::Time];
        let set: GroupSet = groups.into_iter().collect();
        assert_eq!(set, GroupSet(0x2001));
        assert_eq!(set.to_string(), "time, barometer");
        assert_eq!(set.without(GroupSet(0x2000)), GroupSet(1));
        assert_eq!(set.union(GroupSet(2)), GroupSet(0x2003));
        assert!(GroupSet::default().is_empty() && !set.is_empty());
    }
}
