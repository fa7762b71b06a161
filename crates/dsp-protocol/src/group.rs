//! The sixteen groups of a status (`docs/protocol.md` sections 4.1 and 9), stated once, and sets of them.
//!
//! [`Group`], [`Status`](crate::Status), the structs of the groups, the lengths, encoding, decoding, the limits and the
//! names all follow from the tables of this file. A row that is changed here changes them all.

use core::fmt;

use crate::frame::{Layout, Limits, Reader, Steps, U7, U14, Writer, field_spec, is_within, record};

pub use crate::frame::FieldSpec;

// The limits of section 9: those of the helicopter and its sensors, not of the wire.

/// Any number of milliseconds may have passed.
const CLOCK: Limits = 0.0..=u32::MAX as f64;
pub(crate) const LATITUDE: Limits = -90.0..=90.0;
pub(crate) const LONGITUDE: Limits = -180.0..=180.0;
pub(crate) const ALTITUDE: Limits = -1000.0..=20_000.0;
const XY: Limits = -100_000.0..=100_000.0;
const SPEED: Limits = -100.0..=100.0;
const SPEED_OVER_GROUND: Limits = 0.0..=100.0;
const CLIMB: Limits = -50.0..=50.0;
const HEADING: Limits = 0.0..=360.0;
const FIX_QUALITY: Limits = 0.0..=8.0;
const PITCH: Limits = -90.0..=90.0;
const ROLL_YAW: Limits = -180.0..=180.0;
const ACCELERATION: Limits = -160.0..=160.0;
const ANGULAR_RATE: Limits = -20.0..=20.0;
const PULSE: Limits = 500.0..=2500.0;
/// A converter of 12 bits.
const ADC: Limits = 0.0..=4095.0;
const BATTERY: Limits = 0.0..=60_000.0;
const PERCENT: Limits = 0.0..=100.0;
const SWITCH: Limits = 0.0..=1.0;
const ROTOR: Limits = 0.0..=4000.0;

record! {
    /// Geographic position, WGS 84. Wire step: 10⁻⁷ ° and 1 mm.
    Geographic {
        /// Latitude, degrees, north positive.
        latitude_deg: f64 = Steps<i32, 10_000_000>, "°", LATITUDE;
        /// Longitude, degrees, east positive.
        longitude_deg: f64 = Steps<i32, 10_000_000>, "°", LONGITUDE;
        /// Altitude, metres, up positive.
        altitude_m: f64 = Steps<i32, 1000>, "m", ALTITUDE;
    }
}

record! {
    /// Flat position around the first valid GPS fix. Wire step: 1 mm.
    Xy {
        /// East of the origin, metres.
        x_m: f64 = Steps<i32, 1000>, "m", XY;
        /// North of the origin, metres.
        y_m: f64 = Steps<i32, 1000>, "m", XY;
    }
}

record! {
    /// GPS velocity. Wire step: 1 cm/s and 0.01 °.
    GpsVelocity {
        /// Speed over ground, m/s, not negative.
        horizontal_speed_mps: f32 = Steps<u16, 100>, "m/s", SPEED_OVER_GROUND;
        /// Climb speed, m/s, up positive.
        vertical_speed_mps: f32 = Steps<i16, 100>, "m/s", CLIMB;
        /// Course over ground, degrees clockwise from true north, 0 … 360.
        heading_deg: f32 = Steps<u16, 100>, "°", HEADING;
    }
}

record! {
    /// IMU attitude. Wire step: 0.01 °.
    Attitude {
        /// Nose up positive, degrees.
        pitch_deg: f32 = Steps<i16, 100>, "°", PITCH;
        /// Right side down positive, degrees.
        roll_deg: f32 = Steps<i16, 100>, "°", ROLL_YAW;
        /// Clockwise from true north, degrees, −180 … 180.
        yaw_deg: f32 = Steps<i16, 100>, "°", ROLL_YAW;
    }
}

record! {
    /// IMU specific force in body axes (x forward, y right, z down). Wire step: 0.01 m/s².
    Acceleration {
        /// Forward, m/s².
        x_mps2: f32 = Steps<i16, 100>, "m/s²", ACCELERATION;
        /// Right, m/s².
        y_mps2: f32 = Steps<i16, 100>, "m/s²", ACCELERATION;
        /// Down, m/s²; about −9.81 at rest.
        z_mps2: f32 = Steps<i16, 100>, "m/s²", ACCELERATION;
    }
}

record! {
    /// IMU angular rate in body axes. Wire step: 0.001 1/s.
    AngularRate {
        /// About the forward axis, rad/s.
        x_radps: f32 = Steps<i16, 1000>, "1/s", ANGULAR_RATE;
        /// About the right axis, rad/s.
        y_radps: f32 = Steps<i16, 1000>, "1/s", ANGULAR_RATE;
        /// About the down axis, rad/s.
        z_radps: f32 = Steps<i16, 1000>, "1/s", ANGULAR_RATE;
    }
}

record! {
    /// Pulse widths of the five servo channels. Wire step: 1 µs.
    #[derive(Eq)]
    ServoPulses {
        /// Collective pitch, µs.
        collective_us: u16 = U14, "µs", PULSE;
        /// Lateral cyclic, µs.
        roll_us: u16 = U14, "µs", PULSE;
        /// Longitudinal cyclic, µs.
        pitch_us: u16 = U14, "µs", PULSE;
        /// Tail rotor, µs.
        tail_us: u16 = U14, "µs", PULSE;
        /// Throttle, µs.
        throttle_us: u16 = U14, "µs", PULSE;
    }
}

record! {
    /// Battery, fuel and the auto/manual switch.
    #[derive(Eq)]
    Supply {
        /// Battery, millivolts.
        battery_mv: u16 = u16, "mV", BATTERY;
        /// Fuel, percent.
        fuel_percent: u8 = U7, "%", PERCENT;
        /// 0 manual, 1 auto; other values are implausible.
        auto_switch: u8 = U7, "", SWITCH;
    }
}

record! {
    /// Pan and tilt potentiometers, raw ADC.
    #[derive(Eq)]
    PanTilt {
        /// Pan, raw ADC.
        pan_adc: u16 = U14, "", ADC;
        /// Tilt, raw ADC.
        tilt_adc: u16 = U14, "", ADC;
    }
}

record! {
    /// References of the DSP's controllers at this moment.
    References {
        /// Speed to the east, m/s. Wire step: 1 cm/s.
        x_speed_mps: f32 = Steps<i16, 100>, "m/s", SPEED;
        /// Speed to the north, m/s. Wire step: 1 cm/s.
        y_speed_mps: f32 = Steps<i16, 100>, "m/s", SPEED;
        /// Altitude, metres. Wire step: 1 mm.
        altitude_m: f64 = Steps<i32, 1000>, "m", ALTITUDE;
        /// Pitch, degrees. Wire step: 0.01 °.
        pitch_deg: f32 = Steps<i16, 100>, "°", PITCH;
        /// Roll, degrees. Wire step: 0.01 °.
        roll_deg: f32 = Steps<i16, 100>, "°", ROLL_YAW;
        /// Yaw, degrees. Wire step: 0.01 °.
        yaw_deg: f32 = Steps<i16, 100>, "°", ROLL_YAW;
    }
}

/// The table of the groups: hands its rows to the macro `$define`. Each is `Group = bit, name, field: type;`; a group
/// of a single value has `(wire type, unit, limits)` behind its type.
macro_rules! with_groups {
    ($define:ident) => {
        $define! {
            /// Milliseconds since the DSP's boot (`tiempo_local`).
            Time = 0, "time", time_ms: u32 (u32, "ms", CLOCK);
            /// Latitude, longitude, altitude.
            Geographic = 1, "geographic", geographic: Geographic;
            /// Flat position around the first valid GPS fix.
            Xy = 2, "xy", xy: Xy;
            /// GPS horizontal speed, vertical speed, heading.
            GpsVelocity = 3, "gps_velocity", gps_velocity: GpsVelocity;
            /// GPS quality (`qos_GPS`): the NMEA fix quality, 0 … 8.
            GpsQuality = 4, "gps_quality", gps_quality: u8 (U7, "", FIX_QUALITY);
            /// IMU pitch, roll, yaw.
            Attitude = 5, "attitude", attitude: Attitude;
            /// IMU linear acceleration: the specific force.
            Acceleration = 6, "acceleration", acceleration: Acceleration;
            /// IMU angular rate.
            AngularRate = 7, "angular_rate", angular_rate: AngularRate;
            /// PWM signals from the pilot.
            PilotPwm = 8, "pilot_pwm", pilot_pwm: ServoPulses;
            /// Sonar, raw ADC.
            Sonar = 9, "sonar", sonar_adc: u16 (U14, "", ADC);
            /// Battery level, fuel level, auto/manual switch.
            Supply = 10, "supply", supply: Supply;
            /// Pan and tilt potentiometers.
            PanTilt = 11, "pan_tilt", pan_tilt: PanTilt;
            /// Main rotor speed, rpm.
            RotorSpeed = 12, "rotor_speed", rotor_rpm: u16 (U14, "rpm", ROTOR);
            /// Barometric altimeter, raw ADC.
            Barometer = 13, "barometer", barometer_adc: u16 (U14, "", ADC);
            /// Actuation values to the servos.
            Actuation = 14, "actuation", actuation: ServoPulses;
            /// Controller references.
            References = 15, "references", references: References;
        }
    };
}
pub(crate) use with_groups;

/// The type that lays a group out: the group's record, or a new one for a group of a single value.
macro_rules! layout_of {
    ($group:ident, $field:ident, $record:ident) => {
        pub(crate) use super::$record as $group;
    };
    ($group:ident, $field:ident, $type:ty, $wire:ty, $unit:literal, $limits:expr) => {
        pub(crate) enum $group {}

        impl Layout for $group {
            type Value = $type;

            const FIELDS: &'static [FieldSpec] =
                &[field_spec!($field, $type, $wire, $unit, $limits)];

            const LEN: usize = <$wire as WireType<$type>>::LEN;

            fn write(value: &$type, writer: &mut Writer) {
                <$wire as WireType<$type>>::write(*value, writer);
            }

            fn read(reader: &mut Reader<'_>) -> $type {
                <$wire as WireType<$type>>::read(reader)
            }

            fn is_plausible(value: &$type) -> bool {
                is_within(*value, &$limits)
            }
        }
    };
}

/// Defines [`Group`] and its layouts from the rows of [`with_groups!`].
macro_rules! groups {
    ($(
        $(#[$doc:meta])*
        $group:ident = $bit:literal, $name:literal, $field:ident: $type:ident
            $(($wire:ty, $unit:literal, $limits:expr))?;
    )+) => {
        /// One group of values in a status message; its discriminant is its bit in the mask.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum Group {
            $($(#[$doc])* $group = $bit,)+
        }

        impl Group {
            /// All groups in the order of their bits, which is their order on the wire.
            pub const ALL: [Group; 16] = [$(Group::$group),+];

            /// The group's name in configuration files and logs.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Group::$group => $name,)+
                }
            }

            /// Bytes that the group takes on the wire.
            pub const fn wire_len(self) -> usize {
                match self {
                    $(Group::$group => <layout::$group as Layout>::LEN,)+
                }
            }

            /// The group's fields in the order of the wire, with the limits of `docs/protocol.md` section 9.
            pub const fn limits(self) -> &'static [FieldSpec] {
                match self {
                    $(Group::$group => <layout::$group as Layout>::FIELDS,)+
                }
            }
        }

        /// How each group is laid out, by the group's name.
        pub(crate) mod layout {
            use super::*;
            use crate::frame::WireType;

            $(layout_of!($group, $field, $type $(, $wire, $unit, $limits)?);)+
        }
    };
}

with_groups!(groups);

impl Group {
    /// The group's bit in the mask.
    pub const fn bit(self) -> u16 {
        1 << self as u8
    }

    /// Whether `values`, one for each of [`Group::limits`] in its order, lie within the limits; NaN does not.
    pub fn accepts(self, values: &[f64]) -> bool {
        let fields = self.limits();
        values.len() == fields.len()
            && fields
                .iter()
                .zip(values)
                .all(|(field, value)| field.accepts(*value))
    }
}

/// A set of [`Group`]s: the 16-bit status mask (`mascara`).
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StatusMask(pub u16);

impl StatusMask {
    /// No group: a status that carries the flying flag alone.
    pub const NONE: StatusMask = StatusMask(0);
    /// All sixteen groups.
    pub const ALL: StatusMask = StatusMask(u16::MAX);

    /// Whether `group` is in the set.
    pub const fn contains(self, group: Group) -> bool {
        self.0 & group.bit() != 0
    }

    /// The set with `group` added.
    #[must_use]
    pub const fn with(self, group: Group) -> StatusMask {
        StatusMask(self.0 | group.bit())
    }

    /// The set with `group` taken out.
    #[must_use]
    pub const fn without(self, group: Group) -> StatusMask {
        StatusMask(self.0 & !group.bit())
    }

    /// The groups of the set in the order of their bits.
    pub fn groups(self) -> impl Iterator<Item = Group> {
        Group::ALL
            .into_iter()
            .filter(move |group| self.contains(*group))
    }

    /// Length of a whole status frame of the classic profile with this mask, header and checksum included.
    pub const fn status_frame_len(self) -> usize {
        CLASSIC_OVERHEAD_LEN + self.status_payload_len()
    }

    /// Length of the payload of a status with this mask, the same in both profiles.
    pub(crate) const fn status_payload_len(self) -> usize {
        let [low, high] = self.0.to_le_bytes();
        MASK_AND_FLAGS_LEN
            + LOW_GROUPS_LEN[low as usize] as usize
            + HIGH_GROUPS_LEN[high as usize] as usize
    }
}

impl FromIterator<Group> for StatusMask {
    fn from_iter<I: IntoIterator<Item = Group>>(groups: I) -> Self {
        groups.into_iter().fold(StatusMask::NONE, StatusMask::with)
    }
}

impl fmt::Debug for StatusMask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StatusMask({:#06x})", self.0)
    }
}

/// Header and checksum of a classic status.
const CLASSIC_OVERHEAD_LEN: usize = 2;
/// What every status has before its groups.
const MASK_AND_FLAGS_LEN: usize = 4;

// Summed once, since the decoder asks for the length of each frame.

/// Bytes of the groups 0 … 7, by the low half of a mask.
const LOW_GROUPS_LEN: [u8; 256] = groups_len(0);
/// Bytes of the groups 8 … 15, by the high half of a mask.
const HIGH_GROUPS_LEN: [u8; 256] = groups_len(8);

/// Bytes of eight groups from the group `first` on, for each subset of them.
const fn groups_len(first: usize) -> [u8; 256] {
    let mut lens = [0; 256];
    let mut subset = 1;
    while subset < lens.len() {
        // The subset without its lowest group has been summed already.
        let lowest = Group::ALL[first + subset.trailing_zeros() as usize];
        lens[subset] = lens[subset & (subset - 1)] + lowest.wire_len() as u8;
        subset += 1;
    }
    lens
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_is_accepted_when_each_of_its_values_is() {
        let middle = |field: &FieldSpec| (field.min + field.max) / 2.0;
        for group in Group::ALL {
            let fields = group.limits();
            let values: Vec<f64> = fields.iter().map(middle).collect();
            assert!(group.accepts(&values), "{group:?}");
            assert!(!group.accepts(&values[1..]), "{group:?} lacks a value");
            for (index, field) in fields.iter().enumerate() {
                for (value, is_plausible) in [
                    (field.min, true),
                    (field.max, true),
                    (field.min.next_down(), false),
                    (field.max.next_up(), false),
                    (f64::NAN, false),
                ] {
                    let mut values = values.clone();
                    values[index] = value;
                    assert_eq!(group.accepts(&values), is_plausible, "{field:?} {value}");
                }
            }
        }
    }

    #[test]
    fn groups_stand_in_the_order_of_their_bits_and_have_names_of_their_own() {
        for (bit, group) in Group::ALL.into_iter().enumerate() {
            assert_eq!(group.bit(), 1 << bit);
            for other in &Group::ALL[..bit] {
                assert_ne!(group.name(), other.name());
            }
        }
    }

    #[test]
    fn a_mask_is_the_set_of_its_groups() {
        for bits in 0..=u16::MAX {
            let mask = StatusMask(bits);
            assert_eq!(mask.groups().collect::<StatusMask>(), mask);
            assert_eq!(mask.groups().count(), bits.count_ones() as usize);
        }
        for group in Group::ALL {
            assert_eq!(StatusMask::NONE.with(group).0, group.bit());
            assert_eq!(StatusMask::ALL.without(group).0, !group.bit());
            assert!(!StatusMask::ALL.without(group).contains(group));
        }
    }

    #[test]
    fn the_length_of_a_status_is_that_of_its_groups() {
        for bits in 0..=u16::MAX {
            let mask = StatusMask(bits);
            let groups: usize = mask.groups().map(Group::wire_len).sum();
            assert_eq!(mask.status_frame_len(), 6 + groups, "{mask:?}");
        }
        assert_eq!(StatusMask::NONE.status_frame_len(), 6);
        assert_eq!(StatusMask::ALL.status_frame_len(), 128);
    }
}
