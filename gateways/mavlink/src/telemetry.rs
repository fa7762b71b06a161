//! The helicopter in messages: units, frames, and what stands for a value that is not known.
//!
//! A message whose group of telemetry is not valid is not sent; where a message has a mark for "not known", that is sent instead.

use ipc_types::code::{Functionality, LinkState, SafetyAction, SafetyRule};
use ipc_types::payload::HeroTelemetry;
use ipc_types::{MonotonicNs, TelemetryGroup};

use crate::home::Home;
use crate::message::{AUTOPILOT_VERSION, AVAILABLE_MODES};
use crate::mode::Mode;
use crate::number::{AUTOPILOT_PX4, TYPE_HELICOPTER};
use crate::streams::Stream;
use crate::vehicle::Known;
use crate::wire::Message;

/// `base_mode`: armed.
const ARMED: u8 = 128;
/// `base_mode`: not a flight. A recorded one must not look like one.
const SIMULATED: u8 = 32;

/// MAV_SYS_STATUS_SENSOR.
mod sensor {
    pub const GYRO: u32 = 1;
    pub const ACCELEROMETER: u32 = 2;
    pub const MAGNETOMETER: u32 = 4;
    pub const PRESSURE: u32 = 8;
    pub const GPS: u32 = 0x20;
    pub const ALTITUDE_CONTROL: u32 = 0x2000;
    pub const POSITION_CONTROL: u32 = 0x4000;
    pub const RC_RECEIVER: u32 = 0x1_0000;
    pub const GEOFENCE: u32 = 0x10_0000;
    pub const AHRS: u32 = 0x20_0000;
    pub const BATTERY: u32 = 0x200_0000;
    pub const PREARM_CHECK: u32 = 0x1000_0000;
}

/// What messages are made of.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    pub known: Known<'a>,
    pub home: &'a Home,
    pub mode: Mode,
    pub zero_above_sea_m: f64,
}

/// What a station must see at once when it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signature {
    mode: Mode,
    base: u8,
    status: u8,
    landed: u8,
    home: Option<(u64, u64, u64)>,
}

impl Scene<'_> {
    pub fn signature(&self) -> Signature {
        let home = self.home.shown().map(|home| {
            (
                home.latitude_deg.to_bits(),
                home.longitude_deg.to_bits(),
                home.altitude_m.to_bits(),
            )
        });
        Signature {
            mode: self.mode,
            base: self.base_mode(),
            status: self.system_status(),
            landed: self.landed_state(),
            // On the ground home follows every sample.
            home: home.filter(|_| self.known.is_flying()),
        }
    }

    /// The message of a stream; `None` if what it says is not known.
    pub fn message(&self, stream: Stream) -> Option<Message> {
        let message = Message::new(stream.kind());
        match stream {
            Stream::Heartbeat => Some(self.heartbeat(message)),
            Stream::CurrentMode => {
                let custom = self.mode.custom();
                Some(message.u32(custom).u32(custom).u8(self.mode.standard()))
            }
            Stream::SysStatus => Some(self.sys_status(message)),
            Stream::ExtendedSysState => Some(message.u8(0).u8(self.landed_state())),
            Stream::GlobalPosition => self.global_position(message),
            Stream::Attitude => self.attitude(message),
            Stream::AttitudeQuaternion => self.quaternion(message),
            Stream::LocalPosition => self.local_position(message),
            Stream::VfrHud => self.hud(message),
            Stream::Altitude => Some(self.altitudes(message)),
            Stream::GpsRaw => Some(self.gps(message)),
            Stream::Battery => Some(self.battery(message)),
            Stream::Home => self.home(message),
        }
    }

    fn telemetry(&self) -> &HeroTelemetry {
        self.known.telemetry
    }

    /// When it was measured, ms, on the base that TIMESYNC answers with.
    fn boot_ms(&self) -> u32 {
        (self.telemetry().received_ns / 1_000_000) as u32
    }

    fn boot_us(&self) -> u64 {
        self.telemetry().received_ns / 1_000
    }

    fn base_mode(&self) -> u8 {
        let armed = if self.known.is_armed() { ARMED } else { 0 };
        let simulated = match self.known.state.is_replayed() {
            true => SIMULATED,
            false => 0,
        };
        self.mode.base() | armed | simulated
    }

    /// MAV_STATE.
    fn system_status(&self) -> u8 {
        let state = self.known.state;
        match state.safety.action() {
            Some(SafetyAction::Land) => 6,
            Some(SafetyAction::Refuse | SafetyAction::Hold) => 5,
            _ if self.known.is_flying() && !state.imi_error().is_none() => 5,
            _ if self.known.is_flying() => 4,
            _ => 3,
        }
    }

    /// MAV_LANDED_STATE.
    fn landed_state(&self) -> u8 {
        match self.known.state.functionality() {
            _ if !self.known.is_flying() => 1,
            Some(Functionality::TakingOff) => 3,
            Some(Functionality::Landing) => 4,
            _ => 2,
        }
    }

    fn heartbeat(&self, message: Message) -> Message {
        message
            .u32(self.mode.custom())
            .u8(TYPE_HELICOPTER)
            .u8(AUTOPILOT_PX4)
            .u8(self.base_mode())
            .u8(self.system_status())
            .u8(3)
    }

    fn sys_status(&self, message: Message) -> Message {
        let (present, enabled, healthy) = self.sensors();
        let state = self.known.state;
        let errors = state.refused.pieces().min(u64::from(u16::MAX)) as u16;
        message
            .u32(present)
            .u32(enabled)
            .u32(healthy)
            .u16(0)
            .u16(self.battery_mv())
            .i16(-1)
            .u16(0)
            .u16(errors)
            .u16s(0, 4)
            .i8(-1)
    }

    /// Which sensors there are, are used and are well.
    fn sensors(&self) -> (u32, u32, u32) {
        use TelemetryGroup as Group;
        let (known, state) = (&self.known, self.known.state);
        let has = |group| known.has(group);
        let rule = state.safety.rule();
        let is_fence = matches!(
            rule,
            Some(
                SafetyRule::FenceInclusion
                    | SafetyRule::FenceExclusion
                    | SafetyRule::FenceFloor
                    | SafetyRule::FenceCeiling
                    | SafetyRule::FenceUnjudgeable
            )
        );
        let is_supply = matches!(rule, Some(SafetyRule::Battery | SafetyRule::Fuel));
        let is_up = state.link.state() == Some(LinkState::Up) && !known.is_manual();
        let has_fence = state.safety.fence_areas > 0;
        // A magnetometer stands for "the heading is known".
        let rows = [
            (sensor::GYRO, true, has(Group::AngularRate)),
            (sensor::ACCELEROMETER, true, has(Group::Acceleration)),
            (sensor::MAGNETOMETER, true, has(Group::Attitude)),
            (sensor::AHRS, true, has(Group::Attitude)),
            (sensor::PRESSURE, has(Group::Barometer), true),
            (sensor::GPS, true, has(Group::Geographic) && self.fix() >= 3),
            (sensor::RC_RECEIVER, true, has(Group::PilotPwm)),
            (sensor::GEOFENCE, has_fence, !is_fence),
            (sensor::BATTERY, true, has(Group::Supply) && !is_supply),
            (sensor::POSITION_CONTROL, true, is_up),
            (sensor::ALTITUDE_CONTROL, true, is_up),
            (sensor::PREARM_CHECK, true, known.not_ready().is_none()),
        ];
        let bits = |keep: fn(bool, bool) -> bool| {
            let kept = rows.iter().filter(|row| keep(row.1, row.2));
            kept.fold(0, |bits, row| bits | row.0)
        };
        let control = sensor::POSITION_CONTROL | sensor::ALTITUDE_CONTROL;
        let present = bits(|is_there, _| is_there);
        let off = if known.is_manual() { control } else { 0 };
        (
            present,
            present & !off,
            bits(|is_there, is_well| is_there && is_well),
        )
    }

    fn battery_mv(&self) -> u16 {
        match self.known.has(TelemetryGroup::Supply) {
            true => (self.telemetry().supply.battery_v * 1000.0).round() as u16,
            false => u16::MAX,
        }
    }

    /// GPS_FIX_TYPE of an NMEA quality.
    fn fix(&self) -> u8 {
        if !self.known.has(TelemetryGroup::GpsQuality) {
            return 1;
        }
        match self.telemetry().gps_quality {
            2 => 4,
            4 => 6,
            5 => 5,
            1 | 3 | 7 | 8 => 3,
            _ => 1,
        }
    }

    /// Latitude, longitude, 10⁻⁷ degrees, and altitude above sea, mm.
    fn place(&self) -> Option<(i32, i32, i32)> {
        let position = self.known.position()?;
        Some((
            (position.latitude_deg * 1e7).round() as i32,
            (position.longitude_deg * 1e7).round() as i32,
            self.above_sea_mm(position.altitude_m),
        ))
    }

    fn above_sea_mm(&self, altitude_m: f64) -> i32 {
        ((altitude_m + self.zero_above_sea_m) * 1e3).round() as i32
    }

    /// Height over home, m.
    fn over_home_m(&self) -> Option<f64> {
        let home = self.home.shown()?;
        Some(self.known.position()?.altitude_m - home.altitude_m)
    }

    /// Heading, hundredths of a degree.
    fn heading(&self) -> Option<u16> {
        let yaw = self.telemetry().attitude.yaw_rad;
        self.known
            .has(TelemetryGroup::Attitude)
            .then(|| hundredths(yaw))
    }

    fn global_position(&self, message: Message) -> Option<Message> {
        let (latitude, longitude, altitude) = self.place()?;
        let velocity = match self.known.has(TelemetryGroup::GpsVelocity) {
            true => self.telemetry().velocity,
            // The message has no mark for it.
            false => Default::default(),
        };
        let speed = |mps: f32| (mps * 100.0).round() as i16;
        let relative_mm = (self.over_home_m().unwrap_or(0.0) * 1e3).round() as i32;
        let message = message
            .u32(self.boot_ms())
            .i32(latitude)
            .i32(longitude)
            .i32(altitude)
            .i32(relative_mm);
        Some(
            message
                .i16(speed(velocity.north_mps))
                .i16(speed(velocity.east_mps))
                .i16(speed(-velocity.up_mps))
                .u16(self.heading().unwrap_or(u16::MAX)),
        )
    }

    /// Rates about the axes; not a number if they are not known.
    fn rates(&self, message: Message) -> Message {
        let rate = self.telemetry().angular_rate;
        match self.known.has(TelemetryGroup::AngularRate) {
            true => message
                .f32(rate.forward_radps)
                .f32(rate.right_radps)
                .f32(rate.down_radps),
            false => message.f32s(f32::NAN, 3),
        }
    }

    fn attitude(&self, message: Message) -> Option<Message> {
        let attitude = self.telemetry().attitude;
        let message = message
            .u32(self.boot_ms())
            .f32(attitude.roll_rad)
            .f32(attitude.pitch_rad)
            .f32(attitude.yaw_rad);
        self.known
            .has(TelemetryGroup::Attitude)
            .then(|| self.rates(message))
    }

    fn quaternion(&self, message: Message) -> Option<Message> {
        let attitude = self.telemetry().attitude;
        let half = |angle: f32| (angle / 2.0).sin_cos();
        let (sr, cr) = half(attitude.roll_rad);
        let (sp, cp) = half(attitude.pitch_rad);
        let (sy, cy) = half(attitude.yaw_rad);
        let message = message
            .u32(self.boot_ms())
            .f32(cr * cp * cy + sr * sp * sy)
            .f32(sr * cp * cy - cr * sp * sy)
            .f32(cr * sp * cy + sr * cp * sy)
            .f32(cr * cp * sy - sr * sp * cy);
        self.known
            .has(TelemetryGroup::Attitude)
            .then(|| self.rates(message))
    }

    fn local_position(&self, message: Message) -> Option<Message> {
        let telemetry = self.telemetry();
        let is_known =
            self.known.has(TelemetryGroup::Xy) && self.known.has(TelemetryGroup::GpsVelocity);
        let height_m = self.over_home_m().filter(|_| is_known)?;
        let (local, velocity) = (telemetry.local, telemetry.velocity);
        Some(
            message
                .u32(self.boot_ms())
                .f32(local.north_m as f32)
                .f32(local.east_m as f32)
                .f32(-height_m as f32)
                .f32(velocity.north_mps)
                .f32(velocity.east_mps)
                .f32(-velocity.up_mps),
        )
    }

    fn hud(&self, message: Message) -> Option<Message> {
        let telemetry = self.telemetry();
        let position = self.known.position()?;
        let velocity = telemetry.velocity;
        let is_known = self.known.has(TelemetryGroup::GpsVelocity);
        let heading = self.heading().filter(|_| is_known)?;
        let throttle = match self.known.has(TelemetryGroup::Actuation) {
            true => ((telemetry.actuation.collective + 1.0) * 50.0).round() as u16,
            false => 0,
        };
        Some(
            message
                .f32(f32::NAN)
                .f32(velocity.ground_speed_mps)
                .f32((position.altitude_m + self.zero_above_sea_m) as f32)
                .f32(velocity.up_mps)
                .i16((heading / 100) as i16)
                .u16(throttle.min(100)),
        )
    }

    fn altitudes(&self, message: Message) -> Message {
        let altitude_m = self.known.position().map(|position| position.altitude_m);
        let or_nan = |value: Option<f64>| value.map_or(f32::NAN, |value| value as f32);
        // A relative height is unknown until home is.
        let relative_m = self.home.known().and(self.over_home_m());
        let sonar_m = match self.known.has(TelemetryGroup::Sonar) {
            true => self.telemetry().sonar_height_m,
            false => f32::NAN,
        };
        message
            .u64(self.boot_us())
            .f32(f32::NAN)
            .f32(or_nan(altitude_m.map(|m| m + self.zero_above_sea_m)))
            .f32(f32::NAN)
            .f32(or_nan(relative_m))
            .f32(f32::NAN)
            .f32(sonar_m)
    }

    fn gps(&self, message: Message) -> Message {
        let place = self.place();
        let (latitude, longitude, altitude) = place.unwrap_or_default();
        let fix = if place.is_some() { self.fix() } else { 1 };
        let velocity = self.telemetry().velocity;
        let (speed, course) = match self.known.has(TelemetryGroup::GpsVelocity) {
            true => (
                (velocity.ground_speed_mps * 100.0).round() as u16,
                hundredths(velocity.course_rad),
            ),
            false => (u16::MAX, u16::MAX),
        };
        message
            .u64(self.boot_us())
            .i32(latitude)
            .i32(longitude)
            .i32(altitude)
            .u16s(u16::MAX, 2)
            .u16(speed)
            .u16(course)
            .u8(fix)
            .u8(u8::MAX)
    }

    fn battery(&self, message: Message) -> Message {
        let safety = &self.known.state.safety;
        let charge = match (safety.rule(), safety.action()) {
            _ if !self.known.has(TelemetryGroup::Supply) => 0,
            (Some(SafetyRule::Battery), Some(SafetyAction::Land)) => 4,
            (Some(SafetyRule::Battery), Some(SafetyAction::Hold | SafetyAction::Refuse)) => 3,
            (Some(SafetyRule::Battery), _) => 2,
            _ => 1,
        };
        message
            .i32(-1)
            .i32(-1)
            .i16(i16::MAX)
            .u16(self.battery_mv())
            .u16s(u16::MAX, 9)
            .i16(-1)
            .u8(0)
            .u8(0)
            .u8(0)
            .i8(-1)
            .i32(0)
            .u8(charge)
    }

    fn home(&self, message: Message) -> Option<Message> {
        let home = self.home.shown()?;
        Some(
            message
                .i32((home.latitude_deg * 1e7).round() as i32)
                .i32((home.longitude_deg * 1e7).round() as i32)
                .i32(self.above_sea_mm(home.altitude_m))
                .f32s(0.0, 3)
                .f32s(f32::NAN, 4)
                .f32s(f32::NAN, 3)
                .u64(self.boot_us()),
        )
    }

    /// Of which sample the streams are.
    pub fn sample(&self) -> MonotonicNs {
        self.telemetry().received()
    }
}

/// An angle as hundredths of a degree, 0 … 35999.
fn hundredths(angle_rad: f32) -> u16 {
    let hundredths = (f64::from(angle_rad).to_degrees() * 100.0).round();
    hundredths.rem_euclid(36_000.0) as u16
}

/// MAV_PROTOCOL_CAPABILITY: commands with integer coordinates, MAVLink 2. Missions, parameters and fences are not offered yet.
const CAPABILITIES: u64 = 8 | 8192;

/// AUTOPILOT_VERSION. The version is that of the PX4 of which the dialect of modes and commands is, of the type "development".
pub fn autopilot_version(robot: u32) -> Message {
    let own = env!("CARGO_PKG_VERSION");
    Message::new(AUTOPILOT_VERSION)
        .u64(CAPABILITIES)
        .u64(u64::from(robot))
        .u32(0x010f_0000)
        .u32(0)
        .u32(0)
        .u32(0)
        .u16(0)
        .u16(0)
        .text(own, 8)
}

/// AVAILABLE_MODES: one mode, by its place in the list.
pub fn available_mode(index: usize) -> Option<Message> {
    let mode = Mode::ALL.get(index)?;
    let not_selectable = if mode.is_selectable() { 0 } else { 2 };
    Some(
        Message::new(AVAILABLE_MODES)
            .u32(mode.custom())
            .u32(not_selectable)
            .u8(Mode::ALL.len() as u8)
            .u8(index as u8 + 1)
            .u8(mode.standard())
            .text(mode.name(), 35),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use ipc_types::payload::{ModuleState, WaypointPosition};

    fn with<R>(telemetry: &HeroTelemetry, home: Home, look: impl FnOnce(&Scene<'_>) -> R) -> R {
        let state = ModuleState::default();
        let scene = Scene {
            known: Known {
                telemetry,
                state: &state,
            },
            home: &home,
            mode: Mode::Hold,
            zero_above_sea_m: 100.0,
        };
        look(&scene)
    }

    fn full() -> HeroTelemetry {
        let mut telemetry = HeroTelemetry {
            valid_groups: 0xffff,
            received_ns: 5_000_000_000,
            gps_quality: 4,
            ..HeroTelemetry::default()
        };
        telemetry.geodetic.latitude_rad = 37.4112_f64.to_radians();
        telemetry.geodetic.longitude_rad = -6.001_f64.to_radians();
        telemetry.geodetic.altitude_m = 30.25;
        telemetry.velocity.north_mps = 3.5;
        telemetry.velocity.up_mps = 1.25;
        telemetry.velocity.course_rad = -0.1;
        telemetry.attitude.yaw_rad = -std::f32::consts::FRAC_PI_2;
        telemetry.supply.battery_v = 24.5;
        telemetry
    }

    fn home() -> Home {
        Home::TakeOff(WaypointPosition {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 20.0,
        })
    }

    #[test]
    fn units_and_frames_are_those_of_the_messages() {
        with(&full(), home(), |scene| {
            let message = scene.message(Stream::GlobalPosition).unwrap();
            let position = message.payload();
            assert_eq!(position.u32(0), 5_000);
            assert_eq!(
                (position.i32(4), position.i32(8)),
                (374_112_000, -60_010_000)
            );
            assert_eq!((position.i32(12), position.i32(16)), (130_250, 10_250));
            let speeds = [20, 22, 24].map(|at| position.u16(at) as i16);
            assert_eq!(speeds, [350, 0, -125]);
            assert_eq!(position.u16(26), 27_000);
            let gps = scene.message(Stream::GpsRaw).unwrap();
            assert_eq!((gps.payload().u8(28), gps.payload().u64(0)), (6, 5_000_000));
            assert_eq!(gps.payload().u16(26), 35_427);
            let status = scene.message(Stream::SysStatus).unwrap();
            assert_eq!(status.payload().u16(14), 24_500);
            let altitudes = scene.message(Stream::Altitude).unwrap();
            assert_eq!(altitudes.payload().f32(20), 10.25);
            let quaternion = scene.message(Stream::AttitudeQuaternion).unwrap();
            let half = std::f32::consts::FRAC_1_SQRT_2;
            assert!((quaternion.payload().f32(16) + half).abs() < 1e-6);
        });
    }

    #[test]
    fn what_is_not_valid_is_not_sent_or_marked() {
        let telemetry = HeroTelemetry {
            valid_groups: 0,
            ..full()
        };
        with(&telemetry, Home::Unknown, |scene| {
            for stream in Stream::ALL {
                let is_sent = scene.message(stream).is_some();
                let expected = !matches!(
                    stream,
                    Stream::GlobalPosition
                        | Stream::Attitude
                        | Stream::AttitudeQuaternion
                        | Stream::LocalPosition
                        | Stream::VfrHud
                        | Stream::Home
                );
                assert_eq!(is_sent, expected, "{stream:?}");
            }
            let gps = scene.message(Stream::GpsRaw).unwrap();
            assert_eq!((gps.payload().u8(28), gps.payload().i32(8)), (1, 0));
            let altitudes = scene.message(Stream::Altitude).unwrap();
            assert!(altitudes.payload().f32(12).is_nan());
            let status = scene.message(Stream::SysStatus).unwrap();
            assert_eq!(status.payload().u16(14), u16::MAX);
            assert_eq!(status.payload().u32(8) & sensor::GPS, 0);
        });
        // A helicopter that was first heard in the air has no height over home that could be relied on.
        let first = Home::FirstHeard(home().shown().unwrap());
        with(&full(), first, |scene| {
            let altitudes = scene.message(Stream::Altitude).unwrap();
            assert!(altitudes.payload().f32(20).is_nan());
            assert!(scene.message(Stream::Home).is_some());
        });
    }

    #[test]
    fn no_message_is_longer_than_its_definition() {
        let lengths = [9, 9, 43, 2, 28, 28, 48, 28, 20, 32, 52, 54, 60];
        with(&full(), home(), |scene| {
            for (stream, most) in Stream::ALL.into_iter().zip(lengths) {
                let message = scene.message(stream).unwrap();
                assert!(message.payload().0.len() <= most, "{stream:?}");
            }
        });
        assert_eq!(available_mode(0).unwrap().payload().0.len(), 46);
        assert!(available_mode(Mode::ALL.len()).is_none());
        assert_eq!(autopilot_version(1).payload().u64(8), 1);
    }
}
