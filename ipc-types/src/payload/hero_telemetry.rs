//! [`HeroTelemetry`]: the helicopter's state for the layers above, in SI units (`HERO_TELEMETRY`).

use super::number::{given, sent};
use crate::code::TelemetryGroup;
use crate::time::MonotonicNs;

shared_struct! {
    /// The state of the helicopter in SI units, angles in radians, axes named. Service `hero_telemetry`, written by
    /// status.
    ///
    /// A group's values mean something only when its bit is set in `valid_groups`, which has the bits of the DSP's
    /// status mask; the others are zero. While the GPS has no fix, groups 1 to 3 are not valid: there is no position
    /// and no velocity.
    pub struct HeroTelemetry("hero.HeroTelemetry.v3") = 320 {
        /// Counts the samples of this publisher from 1; a gap is a loss.
        pub sequence: u64,
        /// When the publishing process began, host monotonic ns.
        pub epoch_ns: u64,
        /// `sequence` of the [`DspTelemetry`](super::DspTelemetry) that this was made of.
        pub source_sequence: u64,
        /// `epoch_ns` of the [`DspTelemetry`](super::DspTelemetry) that this was made of.
        pub source_epoch_ns: u64,
        /// When the bridge read the message's last byte, host monotonic ns.
        pub received_ns: u64,
        /// When the last byte of the message left the DSP, at the latest, host monotonic ns: by the speed of the line,
        /// what was read with it behind it left the DSP after it. 0 when nobody knows.
        pub sent_ns: u64,
        /// By how much earlier it may have left, s: for so long the serial adapter keeps bytes back at most. That a
        /// bridge was held up is not in it.
        pub sent_uncertainty_s: f64,
        /// When status published this, host monotonic ns.
        pub published_ns: u64,
        /// Time since the DSP's boot, s (group 0).
        pub dsp_time_s: f64,
        /// Bit *k* is set when group *k* of the status mask is valid.
        pub valid_groups: u32,
        /// 1 when the helicopter is in the air, else 0.
        pub flying: u32,
        /// How often the DSP was seen to boot since `source_epoch_ns`.
        pub dsp_boots: u32,
        /// DSP errors received since `source_epoch_ns`.
        pub dsp_errors: u32,
        /// Code of the last DSP error as the DSP sent it, 0 … 65535; means something when `dsp_errors` is not 0.
        pub last_dsp_error_code: u32,
        /// NMEA fix quality, 0 … 8 (group 4).
        pub gps_quality: u32,
        /// WGS 84 position (group 1).
        pub geodetic: HeroGeodetic,
        /// Position in the local east-north plane (group 2).
        pub local: HeroLocal,
        /// Velocity over ground (group 3).
        pub velocity: HeroVelocity,
        /// Attitude of the body (forward, right, down) against north, east, down (group 5).
        pub attitude: HeroAttitude,
        /// Specific force along the body's axes (group 6).
        pub acceleration: HeroAcceleration,
        /// Angular rate about the body's axes (group 7).
        pub angular_rate: HeroAngularRate,
        /// Pilot's sticks, −1 … 1 at the ends of the servo's travel (group 8).
        pub pilot: HeroServos,
        /// Actuation of the servos, −1 … 1 at the ends of the servo's travel (group 14).
        pub actuation: HeroServos,
        /// Height over ground by sonar, m (group 9).
        pub sonar_height_m: f32,
        /// Barometric altitude, m (group 13).
        pub barometer_altitude_m: f32,
        /// Battery, fuel, switch (group 10).
        pub supply: HeroSupply,
        /// Camera's pan, rad, right positive (group 11).
        pub pan_rad: f32,
        /// Camera's tilt, rad, up positive (group 11).
        pub tilt_rad: f32,
        /// Main rotor, rad/s (group 12).
        pub rotor_radps: f32,
        /// Controller references (group 15).
        pub references: HeroReferences,
        /// What the estimator of status makes of several sensors; it is off by default.
        pub estimate: HeroEstimate,
    }
}

shared_struct! {
    /// WGS 84 position.
    pub struct HeroGeodetic("hero.HeroGeodetic.v1") = 24 {
        /// Latitude, rad, north positive.
        pub latitude_rad: f64,
        /// Longitude, rad, east positive.
        pub longitude_rad: f64,
        /// Altitude, m, up positive.
        pub altitude_m: f64,
    }
}

shared_struct! {
    /// Position in the plane that touches the Earth at the DSP's first valid GPS fix.
    pub struct HeroLocal("hero.HeroLocal.v1") = 16 {
        /// East, m.
        pub east_m: f64,
        /// North, m.
        pub north_m: f64,
    }
}

shared_struct! {
    /// Velocity over ground.
    pub struct HeroVelocity("hero.HeroVelocity.v1") = 20 {
        /// To the north, m/s.
        pub north_mps: f32,
        /// To the east, m/s.
        pub east_mps: f32,
        /// Upwards, m/s.
        pub up_mps: f32,
        /// Horizontal speed, m/s.
        pub ground_speed_mps: f32,
        /// Course over ground, rad clockwise from true north, −π … π.
        pub course_rad: f32,
    }
}

shared_struct! {
    /// Attitude: roll, pitch, yaw of the body (forward, right, down) against north, east, down.
    pub struct HeroAttitude("hero.HeroAttitude.v1") = 12 {
        /// Right side down positive, rad.
        pub roll_rad: f32,
        /// Nose up positive, rad.
        pub pitch_rad: f32,
        /// Clockwise from true north, rad, −π … π.
        pub yaw_rad: f32,
    }
}

shared_struct! {
    /// Specific force along the body's axes.
    pub struct HeroAcceleration("hero.HeroAcceleration.v1") = 12 {
        /// Forward, m/s².
        pub forward_mps2: f32,
        /// Right, m/s².
        pub right_mps2: f32,
        /// Down, m/s²; about −9.81 at rest.
        pub down_mps2: f32,
    }
}

shared_struct! {
    /// Angular rate about the body's axes.
    pub struct HeroAngularRate("hero.HeroAngularRate.v1") = 12 {
        /// About the forward axis, rad/s.
        pub forward_radps: f32,
        /// About the right axis, rad/s.
        pub right_radps: f32,
        /// About the down axis, rad/s.
        pub down_radps: f32,
    }
}

shared_struct! {
    /// Five servo channels, −1 … 1 at the ends of the travel.
    pub struct HeroServos("hero.HeroServos.v1") = 20 {
        /// Collective pitch.
        pub collective: f32,
        /// Lateral cyclic.
        pub roll: f32,
        /// Longitudinal cyclic.
        pub pitch: f32,
        /// Tail rotor.
        pub tail: f32,
        /// Throttle.
        pub throttle: f32,
    }
}

shared_struct! {
    /// Battery, fuel, switch.
    pub struct HeroSupply("hero.HeroSupply.v1") = 12 {
        /// Battery, volts.
        pub battery_v: f32,
        /// Fuel, 0 … 1.
        pub fuel_fraction: f32,
        /// 0 manual, 1 auto.
        pub auto_switch: u32,
    }
}

shared_struct! {
    /// References of the DSP's controllers.
    pub struct HeroReferences("hero.HeroReferences.v1") = 24 {
        /// Velocity to the north, m/s.
        pub north_mps: f32,
        /// Velocity to the east, m/s.
        pub east_mps: f32,
        /// Altitude, m.
        pub altitude_m: f32,
        /// Roll, rad.
        pub roll_rad: f32,
        /// Pitch, rad.
        pub pitch_rad: f32,
        /// Yaw, rad.
        pub yaw_rad: f32,
    }
}

shared_struct! {
    /// Output of the estimator of status. The values mean something when `valid` is 1; else all are zero.
    pub struct HeroEstimate("hero.HeroEstimate.v1") = 32 {
        /// Altitude, m, same zero as the GPS altitude.
        pub altitude_m: f64,
        /// Variance of `altitude_m`, m².
        pub altitude_variance_m2: f64,
        /// Climb speed, m/s, up positive.
        pub vertical_speed_mps: f64,
        /// Sensors that contributed to this sample: bit 0 GPS, bit 1 barometer, bit 2 sonar.
        pub inputs: u32,
        /// 1 when the values mean something.
        pub valid: u32,
    }
}

impl HeroTelemetry {
    /// Whether the values of `group` mean something.
    pub const fn valid(&self, group: TelemetryGroup) -> bool {
        self.valid_groups & group.bit() as u32 != 0
    }

    /// Whether the helicopter is in the air.
    pub const fn is_flying(&self) -> bool {
        self.flying != 0
    }

    /// When the bridge read the message that this was made of.
    pub const fn received(&self) -> MonotonicNs {
        MonotonicNs(self.received_ns)
    }

    /// When the message left the DSP, at the latest; when it was read, if nobody knows.
    pub const fn sent(&self) -> MonotonicNs {
        sent(self.sent_ns, self.received_ns)
    }

    /// Code of the last DSP error, or `None` if there was none.
    pub const fn last_dsp_error(&self) -> Option<u32> {
        given(self.dsp_errors != 0, self.last_dsp_error_code)
    }
}

#[cfg(test)]
mod tests {
    use super::super::DspTelemetry;
    use super::*;

    #[test]
    fn without_a_fix_the_gps_has_measured_nothing() {
        use TelemetryGroup::{Geographic, GpsQuality, GpsVelocity, Xy};
        for (gps_quality, says_it, expected) in [
            (0, true, false),
            (1, true, true),
            (8, true, true),
            (0, false, true),
        ] {
            let quality = if says_it { 0 } else { GpsQuality.bit() };
            let dsp = DspTelemetry {
                valid_groups: !quality,
                gps_quality,
                ..DspTelemetry::default()
            };
            for group in TelemetryGroup::ALL {
                let expected = match group {
                    Geographic | Xy | GpsVelocity => expected,
                    GpsQuality => says_it,
                    _ => true,
                };
                assert_eq!(
                    dsp.valid(group),
                    expected,
                    "{group:?} {gps_quality} {says_it}"
                );
            }
        }
    }

    #[test]
    fn validity_is_the_group_s_bit() {
        let dsp = DspTelemetry {
            valid_groups: 0b10,
            ..DspTelemetry::default()
        };
        let hero = HeroTelemetry {
            valid_groups: 0b10,
            ..HeroTelemetry::default()
        };
        for group in TelemetryGroup::ALL {
            let is_valid = group == TelemetryGroup::Geographic;
            assert_eq!((dsp.valid(group), hero.valid(group)), (is_valid, is_valid));
        }
    }
}
