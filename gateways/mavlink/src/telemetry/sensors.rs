//! Sensors, supply and readiness.

use ipc_types::TelemetryGroup;
use ipc_types::code::{LinkState, SafetyAction, SafetyRule};

use super::Scene;
use crate::wire::MessageWriter;

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

impl Scene<'_> {
    pub(super) fn sys_status(&self, message: MessageWriter) -> MessageWriter {
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
    pub(super) fn sensors(&self) -> (u32, u32, u32) {
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
                    | SafetyRule::FenceAhead
                    | SafetyRule::BelowTakeOff
            )
        );
        let is_lost = rule == Some(SafetyRule::PositionLost);
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
            (
                sensor::GPS,
                true,
                has(Group::Geographic) && self.fix() >= 3 && !is_lost,
            ),
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
            // Also of what there is not: stations take a fence that is not well for one that was left.
            bits(|_, is_well| is_well),
        )
    }

    pub(super) fn battery_mv(&self) -> u16 {
        match self.known.has(TelemetryGroup::Supply) {
            true => (self.telemetry().supply.battery_v * 1000.0).round() as u16,
            false => u16::MAX,
        }
    }

    /// GPS_FIX_TYPE of an NMEA quality.
    pub(super) fn fix(&self) -> u8 {
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

    /// Of a kind that is not known, so that its maximum is 1 and the rest counts by it.
    pub(super) fn fuel(&self, message: MessageWriter) -> Option<MessageWriter> {
        let fraction = self.telemetry().supply.fuel_fraction.clamp(0.0, 1.0);
        let is_known = self.known.has(TelemetryGroup::Supply) && !fraction.is_nan();
        let message = message.f32(1.0).f32(f32::NAN).f32(fraction);
        let message = message.f32(f32::NAN).f32(f32::NAN).u32(0).u8(0);
        is_known.then(|| message.u8((fraction * 100.0).round() as u8))
    }

    pub(super) fn battery(&self, message: MessageWriter) -> MessageWriter {
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
}
