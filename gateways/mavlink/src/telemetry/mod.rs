//! The helicopter in messages: units, frames, and what stands for a value that is not known.
//!
//! A message whose group of telemetry is not valid is not sent; where a message has a mark for "not known", that is
//! sent instead.

mod sensors;

use ipc_types::code::{Functionality, SafetyAction};
use ipc_types::payload::HeroTelemetry;
use ipc_types::{MonotonicNs, TelemetryGroup};

use crate::home::Home;
use crate::mission::MissionView;
use crate::mode::Mode;
use crate::number::{AUTOPILOT_PX4, TYPE_HELICOPTER};
use crate::streams::StreamId;
use crate::vehicle::Known;
use crate::wire::MessageWriter;

/// `base_mode`: armed.
const ARMED: u8 = 128;
/// `base_mode`: not a flight. A recorded one must not look like one.
const SIMULATED: u8 = 32;

/// What messages are made of.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    pub known: Known<'a>,
    pub home: &'a Home,
    pub mode: Mode,
    pub mission: MissionView,
    pub zero_above_sea_m: f64,
}

/// What a station must see at once when it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signature {
    mode: Mode,
    base: u8,
    status: u8,
    landed: u8,
    mission: MissionView,
    home: Option<(u64, u64, u64)>,
}

impl Scene<'_> {
    pub fn signature(&self) -> Signature {
        let home = self.home.known().map(|home| {
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
            mission: self.mission,
            // On the ground home follows every sample, unless it was set.
            home: home.filter(|_| self.known.is_flying() || matches!(self.home, Home::Operator(_))),
        }
    }

    /// The message of a stream; `None` if what it says is not known.
    pub fn message(&self, stream: StreamId) -> Option<MessageWriter> {
        let message = MessageWriter::new(stream.kind());
        match stream {
            StreamId::Heartbeat => Some(self.heartbeat(message)),
            StreamId::CurrentMode => {
                let custom = self.mode.custom();
                Some(message.u32(custom).u32(custom).u8(self.mode.standard()))
            }
            StreamId::SysStatus => Some(self.sys_status(message)),
            StreamId::ExtendedSysState => Some(message.u8(0).u8(self.landed_state())),
            StreamId::GlobalPosition => self.global_position(message),
            StreamId::Attitude => self.attitude(message),
            StreamId::AttitudeQuaternion => self.quaternion(message),
            StreamId::LocalPosition => self.local_position(message),
            StreamId::VfrHud => self.hud(message),
            StreamId::Altitude => Some(self.altitudes(message)),
            StreamId::GpsRaw => Some(self.gps(message)),
            StreamId::Battery => Some(self.battery(message)),
            StreamId::Fuel => self.fuel(message),
            StreamId::Home => self.home(message),
            StreamId::Mission => Some(self.mission(message)),
        }
    }

    /// The item from 0; without a mission there is no count.
    fn mission(&self, message: MessageWriter) -> MessageWriter {
        let mission = self.mission;
        let total = match mission.total {
            0 => u16::MAX,
            total => total,
        };
        let mode = if mission.is_mode { 1 } else { 2 };
        let message = message.u16(mission.sequence).u16(total);
        message.u8(mission.state as u8).u8(mode).u32(mission.id)
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

    fn heartbeat(&self, message: MessageWriter) -> MessageWriter {
        message
            .u32(self.mode.custom())
            .u8(TYPE_HELICOPTER)
            .u8(AUTOPILOT_PX4)
            .u8(self.base_mode())
            .u8(self.system_status())
            .u8(3)
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
        let home = self.home.known()?;
        Some(self.known.position()?.altitude_m - home.altitude_m)
    }

    /// Heading, hundredths of a degree.
    fn heading(&self) -> Option<u16> {
        let yaw = self.telemetry().attitude.yaw_rad;
        self.known
            .has(TelemetryGroup::Attitude)
            .then(|| hundredths(yaw))
    }

    fn global_position(&self, message: MessageWriter) -> Option<MessageWriter> {
        let (latitude, longitude, altitude) = self.place()?;
        // The message has no mark for a velocity that is not known, and zeros would say that nothing moves. GPS_RAW_INT
        // has one.
        let is_known = self.known.has(TelemetryGroup::GpsVelocity);
        let velocity = is_known.then_some(self.telemetry().velocity)?;
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
    fn rates(&self, message: MessageWriter) -> MessageWriter {
        let rate = self.telemetry().angular_rate;
        match self.known.has(TelemetryGroup::AngularRate) {
            true => message
                .f32(rate.forward_radps)
                .f32(rate.right_radps)
                .f32(rate.down_radps),
            false => message.f32s(f32::NAN, 3),
        }
    }

    fn attitude(&self, message: MessageWriter) -> Option<MessageWriter> {
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

    fn quaternion(&self, message: MessageWriter) -> Option<MessageWriter> {
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

    fn local_position(&self, message: MessageWriter) -> Option<MessageWriter> {
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

    fn hud(&self, message: MessageWriter) -> Option<MessageWriter> {
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

    fn altitudes(&self, message: MessageWriter) -> MessageWriter {
        let altitude_m = self.known.position().map(|position| position.altitude_m);
        let or_nan = |value: Option<f64>| value.map_or(f32::NAN, |value| value as f32);
        // A relative height is unknown until home is.
        let relative_m = self.over_home_m();
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

    fn gps(&self, message: MessageWriter) -> MessageWriter {
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

    fn home(&self, message: MessageWriter) -> Option<MessageWriter> {
        let home = self.home.known()?;
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

#[cfg(test)]
mod tests;
