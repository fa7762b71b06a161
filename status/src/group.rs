//! The groups of the telemetry: what is valid in a sample, and what a log is made of.
//!
//! They are the bits of the status mask, as `valid_groups` of both telemetry structs carries them. Their names are those
//! of the bridge's configuration.

use std::fmt;

use serde::{Deserialize, Deserializer};

/// One group of telemetry fields; its discriminant is its bit in the mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Group {
    /// Time since the DSP's boot.
    Time = 0,
    /// Latitude, longitude, altitude.
    Geographic = 1,
    /// Flat position around the first valid GPS fix.
    Xy = 2,
    /// GPS speeds and heading.
    GpsVelocity = 3,
    /// GPS quality.
    GpsQuality = 4,
    /// IMU pitch, roll, yaw.
    Attitude = 5,
    /// IMU linear acceleration.
    Acceleration = 6,
    /// IMU angular rate.
    AngularRate = 7,
    /// PWM signals from the pilot.
    PilotPwm = 8,
    /// Sonar.
    Sonar = 9,
    /// Battery, fuel, auto/manual switch.
    Supply = 10,
    /// Pan and tilt of the camera.
    PanTilt = 11,
    /// Main rotor speed.
    RotorSpeed = 12,
    /// Barometric altimeter.
    Barometer = 13,
    /// Actuation of the servos.
    Actuation = 14,
    /// Controller references.
    References = 15,
}

impl Group {
    /// All groups in the order of their bits.
    pub const ALL: [Group; 16] = [
        Group::Time,
        Group::Geographic,
        Group::Xy,
        Group::GpsVelocity,
        Group::GpsQuality,
        Group::Attitude,
        Group::Acceleration,
        Group::AngularRate,
        Group::PilotPwm,
        Group::Sonar,
        Group::Supply,
        Group::PanTilt,
        Group::RotorSpeed,
        Group::Barometer,
        Group::Actuation,
        Group::References,
    ];

    /// The group's bit in the mask.
    pub const fn bit(self) -> u16 {
        1 << self as u8
    }

    /// The group's name in configuration files and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Group::Time => "time",
            Group::Geographic => "geographic",
            Group::Xy => "xy",
            Group::GpsVelocity => "gps_velocity",
            Group::GpsQuality => "gps_quality",
            Group::Attitude => "attitude",
            Group::Acceleration => "acceleration",
            Group::AngularRate => "angular_rate",
            Group::PilotPwm => "pilot_pwm",
            Group::Sonar => "sonar",
            Group::Supply => "supply",
            Group::PanTilt => "pan_tilt",
            Group::RotorSpeed => "rotor_speed",
            Group::Barometer => "barometer",
            Group::Actuation => "actuation",
            Group::References => "references",
        }
    }
}

/// A set of [`Group`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct GroupSet(pub u16);

impl GroupSet {
    /// All sixteen groups.
    pub const ALL: GroupSet = GroupSet(u16::MAX);

    /// Whether `group` is in the set.
    pub const fn contains(self, group: Group) -> bool {
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
    pub fn groups(self) -> impl Iterator<Item = Group> {
        Group::ALL
            .into_iter()
            .filter(move |group| self.contains(*group))
    }
}

impl FromIterator<Group> for GroupSet {
    fn from_iter<I: IntoIterator<Item = Group>>(groups: I) -> Self {
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
        Vec::<Group>::deserialize(deserializer).map(GroupSet::from_iter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_and_names_are_those_of_the_mask() {
        for (bit, group) in Group::ALL.into_iter().enumerate() {
            assert_eq!(group.bit(), 1 << bit);
            #[derive(Deserialize)]
            struct One {
                groups: GroupSet,
            }
            let text = format!("groups = ['{}']", group.name());
            let one: One = runtime::config::parse(&text, "x.toml").unwrap();
            assert_eq!(one.groups, GroupSet(1 << bit), "{text}");
        }
    }

    #[test]
    fn sets_are_combined_and_shown() {
        let set: GroupSet = [Group::Barometer, Group::Time, Group::Time]
            .into_iter()
            .collect();
        assert_eq!(set, GroupSet(0x2001));
        assert_eq!(set.to_string(), "time, barometer");
        assert_eq!(set.without(GroupSet(0x2000)), GroupSet(1));
        assert_eq!(set.union(GroupSet(2)), GroupSet(0x2003));
        assert!(GroupSet::default().is_empty() && !set.is_empty());
    }
}
