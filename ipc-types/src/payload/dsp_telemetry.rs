//! [`DspTelemetry`]: what the DSP reports, in the DSP's own units (`DSP_HERO_TELEMETRY`).

use super::number::{given, sent};
use crate::code::TelemetryGroup;
use crate::time::MonotonicNs;

shared_struct! {
    /// One status message of the DSP, in its own units. Service `dsp_telemetry`, written by the bridge.
    ///
    /// A group's values mean something only when its bit is set in `valid_groups`; the others are zero. These are the
    /// DSP's: groups 1 to 3 mean nothing either while group 4 says that the GPS has no fix. `HeroTelemetry` has that in
    /// its `valid_groups`.
    pub struct DspTelemetry("hero.DspTelemetry.v3") = 248 {
        /// Counts the samples of this publisher from 1; a gap is a loss.
        pub sequence: u64,
        /// When the publishing process began, host monotonic ns: another value means another publisher.
        pub epoch_ns: u64,
        /// When the last byte of the message was read, host monotonic ns.
        pub received_ns: u64,
        /// When the last byte of the message left the DSP, at the latest, host monotonic ns: by the speed of the line,
        /// what was read with it behind it left the DSP after it. 0 when nobody knows.
        pub sent_ns: u64,
        /// By how much earlier it may have left, s: for so long the serial adapter keeps bytes back at most. That a
        /// bridge was held up is not in it.
        pub sent_uncertainty_s: f64,
        /// Milliseconds since the DSP's boot (group 0, `tiempo_local`).
        pub dsp_time_ms: u32,
        /// Bit *k* is set when the DSP sent group *k* of the status mask, and its values are plausible.
        pub valid_groups: u16,
        /// 1 when the helicopter is in the air (`heli_volando`), else 0.
        pub flying: u8,
        /// NMEA fix quality, 0 … 8 (group 4, `qos_GPS`).
        pub gps_quality: u8,
        /// How often the DSP was seen to boot since `epoch_ns`.
        pub dsp_boots: u32,
        /// DSP errors received since `epoch_ns`.
        pub dsp_errors: u32,
        /// Code of the last DSP error as the DSP sent it, 0 … 65535; means something when `dsp_errors` is not 0.
        pub last_dsp_error_code: u32,
        /// Main rotor, rpm (group 12).
        pub rotor_rpm: u32,
        /// Geographic position (group 1).
        pub geographic: DspGeographic,
        /// XY position (group 2).
        pub xy: DspXy,
        /// GPS velocity (group 3).
        pub gps_velocity: DspGpsVelocity,
        /// IMU attitude (group 5).
        pub attitude: DspAttitude,
        /// IMU acceleration (group 6).
        pub acceleration: DspAcceleration,
        /// IMU angular rate (group 7).
        pub angular_rate: DspAngularRate,
        /// Pilot's PWM signals (group 8).
        pub pilot_pwm: DspServoPulses,
        /// Actuation of the servos (group 14).
        pub actuation: DspServoPulses,
        /// Sonar, raw ADC (group 9).
        pub sonar_adc: u32,
        /// Barometric altimeter, raw ADC (group 13).
        pub barometer_adc: u32,
        /// Battery, fuel, switch (group 10).
        pub supply: DspSupply,
        /// Pan and tilt potentiometers (group 11).
        pub pan_tilt: DspPanTilt,
        /// Controller references (group 15).
        pub references: DspReferences,
    }
}

shared_struct! {
    /// Geographic position, WGS 84.
    pub struct DspGeographic("hero.DspGeographic.v1") = 24 {
        /// Latitude, degrees, north positive.
        pub latitude_deg: f64,
        /// Longitude, degrees, east positive.
        pub longitude_deg: f64,
        /// Altitude, metres, up positive.
        pub altitude_m: f64,
    }
}

shared_struct! {
    /// The DSP's flat position; the origin is its first valid GPS fix.
    pub struct DspXy("hero.DspXy.v1") = 16 {
        /// East of the origin, metres.
        pub x_m: f64,
        /// North of the origin, metres.
        pub y_m: f64,
    }
}

shared_struct! {
    /// GPS velocity.
    pub struct DspGpsVelocity("hero.DspGpsVelocity.v1") = 12 {
        /// Speed over ground, m/s.
        pub horizontal_speed_mps: f32,
        /// Climb speed, m/s, up positive.
        pub vertical_speed_mps: f32,
        /// Course over ground, degrees clockwise from true north, 0 … 360.
        pub heading_deg: f32,
    }
}

shared_struct! {
    /// IMU attitude of the body (x forward, y right, z down).
    pub struct DspAttitude("hero.DspAttitude.v1") = 12 {
        /// Nose up positive, degrees.
        pub pitch_deg: f32,
        /// Right side down positive, degrees.
        pub roll_deg: f32,
        /// Clockwise from true north, degrees, −180 … 180.
        pub yaw_deg: f32,
    }
}

shared_struct! {
    /// IMU specific force in body axes.
    pub struct DspAcceleration("hero.DspAcceleration.v1") = 12 {
        /// Forward, m/s².
        pub x_mps2: f32,
        /// Right, m/s².
        pub y_mps2: f32,
        /// Down, m/s²; about −9.81 at rest.
        pub z_mps2: f32,
    }
}

shared_struct! {
    /// IMU angular rate in body axes.
    pub struct DspAngularRate("hero.DspAngularRate.v1") = 12 {
        /// About the forward axis, 1/s.
        pub x_radps: f32,
        /// About the right axis, 1/s.
        pub y_radps: f32,
        /// About the down axis, 1/s.
        pub z_radps: f32,
    }
}

shared_struct! {
    /// Pulse widths of the five servo channels, µs.
    pub struct DspServoPulses("hero.DspServoPulses.v1") = 20 {
        /// Collective pitch, µs.
        pub collective_us: u32,
        /// Lateral cyclic, µs.
        pub roll_us: u32,
        /// Longitudinal cyclic, µs.
        pub pitch_us: u32,
        /// Tail rotor, µs.
        pub tail_us: u32,
        /// Throttle, µs.
        pub throttle_us: u32,
    }
}

shared_struct! {
    /// Battery, fuel, switch.
    pub struct DspSupply("hero.DspSupply.v1") = 12 {
        /// Battery, millivolts.
        pub battery_mv: u32,
        /// Fuel, percent.
        pub fuel_percent: u32,
        /// 0 manual, 1 auto.
        pub auto_switch: u32,
    }
}

shared_struct! {
    /// Pan and tilt potentiometers, raw ADC.
    pub struct DspPanTilt("hero.DspPanTilt.v1") = 8 {
        /// Pan, raw ADC.
        pub pan_adc: u32,
        /// Tilt, raw ADC.
        pub tilt_adc: u32,
    }
}

shared_struct! {
    /// References of the DSP's controllers.
    pub struct DspReferences("hero.DspReferences.v1") = 28 {
        /// Speed to the east, m/s.
        pub x_speed_mps: f32,
        /// Speed to the north, m/s.
        pub y_speed_mps: f32,
        /// Altitude, metres.
        pub altitude_m: f32,
        /// Pitch, degrees.
        pub pitch_deg: f32,
        /// Roll, degrees.
        pub roll_deg: f32,
        /// Yaw, degrees.
        pub yaw_deg: f32,
        /// Always zero; keeps the size of the sample a multiple of eight.
        pub reserved: u32,
    }
}

impl DspTelemetry {
    /// Whether the values of `group` mean something: the DSP sent them, and if the GPS measures them, it has a fix.
    pub const fn valid(&self, group: TelemetryGroup) -> bool {
        self.measured_groups() & group.bit() != 0
    }

    /// The bits of the groups whose values mean something. Without a fix the DSP sends groups of the GPS that were
    /// never measured.
    pub const fn measured_groups(&self) -> u16 {
        let says_quality = self.valid_groups & TelemetryGroup::GpsQuality.bit() != 0;
        match says_quality && self.gps_quality == 0 {
            true => self.valid_groups & !TelemetryGroup::OF_A_FIX,
            false => self.valid_groups,
        }
    }

    /// Whether the helicopter is in the air.
    pub const fn is_flying(&self) -> bool {
        self.flying != 0
    }

    /// When the message was read.
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
