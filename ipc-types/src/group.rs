//! The groups of a telemetry sample: the bits of `valid_groups` in `DspTelemetry` and `HeroTelemetry`.
//!
//! They are those of the DSP's status mask (`docs/protocol.md` section 4.1), named the same.

/// One group of values in a telemetry sample; its discriminant is its bit in `valid_groups`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum TelemetryGroup {
    /// Time since the DSP's boot.
    Time = 0,
    /// Latitude, longitude, altitude.
    Geographic = 1,
    /// Flat position around the first valid GPS fix.
    Xy = 2,
    /// GPS velocity.
    GpsVelocity = 3,
    /// GPS quality.
    GpsQuality = 4,
    /// IMU attitude.
    Attitude = 5,
    /// IMU acceleration.
    Acceleration = 6,
    /// IMU angular rate.
    AngularRate = 7,
    /// Pilot's PWM signals.
    PilotPwm = 8,
    /// Sonar.
    Sonar = 9,
    /// Battery, fuel, auto/manual switch.
    Supply = 10,
    /// Pan and tilt.
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

impl TelemetryGroup {
    /// All groups in the order of their bits.
    pub const ALL: [TelemetryGroup; 16] = [
        TelemetryGroup::Time,
        TelemetryGroup::Geographic,
        TelemetryGroup::Xy,
        TelemetryGroup::GpsVelocity,
        TelemetryGroup::GpsQuality,
        TelemetryGroup::Attitude,
        TelemetryGroup::Acceleration,
        TelemetryGroup::AngularRate,
        TelemetryGroup::PilotPwm,
        TelemetryGroup::Sonar,
        TelemetryGroup::Supply,
        TelemetryGroup::PanTilt,
        TelemetryGroup::RotorSpeed,
        TelemetryGroup::Barometer,
        TelemetryGroup::Actuation,
        TelemetryGroup::References,
    ];

    /// The group's bit in `valid_groups`.
    pub const fn bit(self) -> u16 {
        1 << self as u8
    }

    /// The group's name in configuration files and logs.
    pub const fn name(self) -> &'static str {
        match self {
            TelemetryGroup::Time => "time",
            TelemetryGroup::Geographic => "geographic",
            TelemetryGroup::Xy => "xy",
            TelemetryGroup::GpsVelocity => "gps_velocity",
            TelemetryGroup::GpsQuality => "gps_quality",
            TelemetryGroup::Attitude => "attitude",
            TelemetryGroup::Acceleration => "acceleration",
            TelemetryGroup::AngularRate => "angular_rate",
            TelemetryGroup::PilotPwm => "pilot_pwm",
            TelemetryGroup::Sonar => "sonar",
            TelemetryGroup::Supply => "supply",
            TelemetryGroup::PanTilt => "pan_tilt",
            TelemetryGroup::RotorSpeed => "rotor_speed",
            TelemetryGroup::Barometer => "barometer",
            TelemetryGroup::Actuation => "actuation",
            TelemetryGroup::References => "references",
        }
    }

    /// The group with this name, or `None`.
    pub fn from_name(name: &str) -> Option<TelemetryGroup> {
        TelemetryGroup::ALL
            .into_iter()
            .find(|group| group.name() == name)
    }

    /// The groups whose bits are set in `mask`, in the order of their bits.
    pub fn in_mask(mask: u16) -> impl Iterator<Item = TelemetryGroup> {
        TelemetryGroup::ALL
            .into_iter()
            .filter(move |group| mask & group.bit() != 0)
    }
}

impl std::fmt::Display for TelemetryGroup {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_group_has_its_own_bit_and_name() {
        let mut mask = 0_u16;
        for (index, group) in TelemetryGroup::ALL.into_iter().enumerate() {
            assert_eq!(group.bit(), 1 << index);
            assert_eq!(TelemetryGroup::from_name(group.name()), Some(group));
            mask |= group.bit();
        }
        assert_eq!(mask, u16::MAX);
        assert_eq!(TelemetryGroup::from_name("position"), None);
    }

    #[test]
    fn a_mask_gives_its_groups_in_order() {
        let groups: Vec<_> = TelemetryGroup::in_mask(0b1000_0000_0000_0011).collect();
        assert_eq!(
            groups,
            [
                TelemetryGroup::Time,
                TelemetryGroup::Geographic,
                TelemetryGroup::References
            ]
        );
    }
}
