//! Sets of telemetry groups: what is valid in a sample, and what a log is made of.

use std::fmt;

use ipc_types::TelemetryGroup;

/// A set of [`TelemetryGroup`]s.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
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

#[cfg(test)]
mod tests {
    use super::*;

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
