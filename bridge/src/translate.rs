//! The one seam between the wire and shared memory: a status message becomes a [`DspTelemetry`].
//!
//! Every struct of the wire is taken apart without `..`, so that a new field does not compile until it is translated
//! here. A group that was not transmitted, or was withdrawn as implausible, is zero and its validity bit is not set.

use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};
use dsp_protocol::{Group, Status, StatusMask};
use ipc_types::payload::{
    DspAcceleration, DspAngularRate, DspAttitude, DspErrorCounters, DspGeographic, DspGpsVelocity,
    DspPanTilt, DspReferences, DspServoPulses, DspSupply, DspTelemetry, DspXy,
};

use crate::link::Sample;

/// Writes `sample` into `out`: everything but `sequence` and `epoch_ns`, which belong to the publisher.
pub fn dsp_telemetry(
    sample: &Sample,
    dsp_boots: u32,
    errors: &DspErrorCounters,
    out: &mut DspTelemetry,
) {
    let Sample { status, received } = sample;
    let Status {
        flying,
        time_ms,
        geographic,
        xy,
        gps_velocity,
        gps_quality,
        attitude,
        acceleration,
        angular_rate,
        pilot_pwm,
        sonar_adc,
        supply,
        pan_tilt,
        rotor_rpm,
        barometer_adc,
        actuation,
        references,
    } = status;
    let mut valid = StatusMask::NONE;
    *out = DspTelemetry {
        sequence: out.sequence,
        epoch_ns: out.epoch_ns,
        received_ns: received.0,
        dsp_time_ms: take(&mut valid, Group::Time, time_ms, |time_ms| *time_ms),
        flying: u8::from(*flying),
        gps_quality: take(&mut valid, Group::GpsQuality, gps_quality, |quality| {
            *quality
        }),
        dsp_boots,
        dsp_errors: errors.total,
        last_dsp_error_code: errors.last_code,
        rotor_rpm: take(&mut valid, Group::RotorSpeed, rotor_rpm, |rpm| {
            u32::from(*rpm)
        }),
        geographic: take(&mut valid, Group::Geographic, geographic, position),
        xy: take(&mut valid, Group::Xy, xy, flat_position),
        gps_velocity: take(&mut valid, Group::GpsVelocity, gps_velocity, velocity),
        attitude: take(&mut valid, Group::Attitude, attitude, attitude_of),
        acceleration: take(
            &mut valid,
            Group::Acceleration,
            acceleration,
            acceleration_of,
        ),
        angular_rate: take(&mut valid, Group::AngularRate, angular_rate, rate),
        pilot_pwm: take(&mut valid, Group::PilotPwm, pilot_pwm, pulses),
        actuation: take(&mut valid, Group::Actuation, actuation, pulses),
        sonar_adc: take(&mut valid, Group::Sonar, sonar_adc, |adc| u32::from(*adc)),
        barometer_adc: take(&mut valid, Group::Barometer, barometer_adc, |adc| {
            u32::from(*adc)
        }),
        supply: take(&mut valid, Group::Supply, supply, supply_of),
        pan_tilt: take(&mut valid, Group::PanTilt, pan_tilt, pan_tilt_of),
        references: take(&mut valid, Group::References, references, references_of),
        valid_groups: 0,
    };
    out.valid_groups = valid.0;
}

/// Translates a group if it is there, and marks it valid.
fn take<W, S: Default>(
    valid: &mut StatusMask,
    group: Group,
    wire: &Option<W>,
    translate: impl FnOnce(&W) -> S,
) -> S {
    match wire {
        Some(wire) => {
            *valid = valid.with(group);
            translate(wire)
        }
        None => S::default(),
    }
}

fn position(wire: &Geographic) -> DspGeographic {
    let Geographic {
        latitude_deg,
        longitude_deg,
        altitude_m,
    } = *wire;
    DspGeographic {
        latitude_deg,
        longitude_deg,
        altitude_m,
    }
}

fn flat_position(wire: &Xy) -> DspXy {
    let Xy { x_m, y_m } = *wire;
    DspXy { x_m, y_m }
}

fn velocity(wire: &GpsVelocity) -> DspGpsVelocity {
    let GpsVelocity {
        horizontal_speed_mps,
        vertical_speed_mps,
        heading_deg,
    } = *wire;
    DspGpsVelocity {
        horizontal_speed_mps,
        vertical_speed_mps,
        heading_deg,
    }
}

fn attitude_of(wire: &Attitude) -> DspAttitude {
    let Attitude {
        pitch_deg,
        roll_deg,
        yaw_deg,
    } = *wire;
    DspAttitude {
        pitch_deg,
        roll_deg,
        yaw_deg,
    }
}

fn acceleration_of(wire: &Acceleration) -> DspAcceleration {
    let Acceleration {
        x_mps2,
        y_mps2,
        z_mps2,
    } = *wire;
    DspAcceleration {
        x_mps2,
        y_mps2,
        z_mps2,
    }
}

fn rate(wire: &AngularRate) -> DspAngularRate {
    let AngularRate {
        x_radps,
        y_radps,
        z_radps,
    } = *wire;
    DspAngularRate {
        x_radps,
        y_radps,
        z_radps,
    }
}

fn pulses(wire: &ServoPulses) -> DspServoPulses {
    let ServoPulses {
        collective_us,
        roll_us,
        pitch_us,
        tail_us,
        throttle_us,
    } = *wire;
    DspServoPulses {
        collective_us: collective_us.into(),
        roll_us: roll_us.into(),
        pitch_us: pitch_us.into(),
        tail_us: tail_us.into(),
        throttle_us: throttle_us.into(),
    }
}

fn supply_of(wire: &Supply) -> DspSupply {
    let Supply {
        battery_mv,
        fuel_percent,
        auto_switch,
    } = *wire;
    DspSupply {
        battery_mv: battery_mv.into(),
        fuel_percent: fuel_percent.into(),
        auto_switch: auto_switch.into(),
    }
}

fn pan_tilt_of(wire: &PanTilt) -> DspPanTilt {
    let PanTilt { pan_adc, tilt_adc } = *wire;
    DspPanTilt {
        pan_adc: pan_adc.into(),
        tilt_adc: tilt_adc.into(),
    }
}

fn references_of(wire: &References) -> DspReferences {
    let References {
        x_speed_mps,
        y_speed_mps,
        altitude_m,
        pitch_deg,
        roll_deg,
        yaw_deg,
    } = *wire;
    DspReferences {
        x_speed_mps,
        y_speed_mps,
        altitude_m: altitude_m as f32,
        pitch_deg,
        roll_deg,
        yaw_deg,
        reserved: 0,
    }
}

#[cfg(test)]
mod tests {
    use dsp_protocol::DspErrorCode;
    use ipc_types::payload::KNOWN_DSP_ERRORS;
    use ipc_types::{MonotonicNs, TelemetryGroup};

    use super::*;

    fn full() -> Status {
        Status {
            flying: true,
            time_ms: Some(1),
            geographic: Some(Geographic {
                latitude_deg: 2.0,
                longitude_deg: 3.0,
                altitude_m: 4.0,
            }),
            xy: Some(Xy { x_m: 5.0, y_m: 6.0 }),
            gps_velocity: Some(GpsVelocity {
                horizontal_speed_mps: 7.0,
                vertical_speed_mps: 8.0,
                heading_deg: 9.0,
            }),
            gps_quality: Some(4),
            attitude: Some(Attitude {
                pitch_deg: 10.0,
                roll_deg: 11.0,
                yaw_deg: 12.0,
            }),
            acceleration: Some(Acceleration {
                x_mps2: 13.0,
                y_mps2: 14.0,
                z_mps2: 15.0,
            }),
            angular_rate: Some(AngularRate {
                x_radps: 16.0,
                y_radps: 17.0,
                z_radps: 18.0,
            }),
            pilot_pwm: Some(ServoPulses {
                collective_us: 19,
                roll_us: 20,
                pitch_us: 21,
                tail_us: 22,
                throttle_us: 23,
            }),
            sonar_adc: Some(24),
            supply: Some(Supply {
                battery_mv: 25,
                fuel_percent: 26,
                auto_switch: 1,
            }),
            pan_tilt: Some(PanTilt {
                pan_adc: 27,
                tilt_adc: 28,
            }),
            rotor_rpm: Some(29),
            barometer_adc: Some(30),
            actuation: Some(ServoPulses {
                collective_us: 31,
                roll_us: 32,
                pitch_us: 33,
                tail_us: 34,
                throttle_us: 35,
            }),
            references: Some(References {
                x_speed_mps: 36.0,
                y_speed_mps: 37.0,
                altitude_m: 38.0,
                pitch_deg: 39.0,
                roll_deg: 40.0,
                yaw_deg: 41.0,
            }),
        }
    }

    fn translate(status: Status) -> DspTelemetry {
        let errors = DspErrorCounters {
            total: 3,
            last_code: 240,
            ..DspErrorCounters::default()
        };
        let mut out = DspTelemetry {
            sequence: 50,
            epoch_ns: 51,
            // What an earlier sample left in the memory must not shine through.
            sonar_adc: 999,
            ..DspTelemetry::default()
        };
        let sample = Sample {
            status,
            received: MonotonicNs(52),
        };
        dsp_telemetry(&sample, 53, &errors, &mut out);
        out
    }

    #[test]
    fn every_value_finds_its_place() {
        let out = translate(full());
        assert_eq!((out.sequence, out.epoch_ns, out.received_ns), (50, 51, 52));
        assert_eq!(
            (out.dsp_boots, out.dsp_errors, out.last_dsp_error_code),
            (53, 3, 240)
        );
        assert_eq!(
            (out.flying, out.dsp_time_ms, out.gps_quality, out.rotor_rpm),
            (1, 1, 4, 29)
        );
        let g = out.geographic;
        assert_eq!(
            (g.latitude_deg, g.longitude_deg, g.altitude_m),
            (2.0, 3.0, 4.0)
        );
        assert_eq!((out.xy.x_m, out.xy.y_m), (5.0, 6.0));
        let v = out.gps_velocity;
        assert_eq!(
            (v.horizontal_speed_mps, v.vertical_speed_mps, v.heading_deg),
            (7.0, 8.0, 9.0)
        );
        let a = out.attitude;
        assert_eq!((a.pitch_deg, a.roll_deg, a.yaw_deg), (10.0, 11.0, 12.0));
        let a = out.acceleration;
        assert_eq!((a.x_mps2, a.y_mps2, a.z_mps2), (13.0, 14.0, 15.0));
        let r = out.angular_rate;
        assert_eq!((r.x_radps, r.y_radps, r.z_radps), (16.0, 17.0, 18.0));
        let p = out.pilot_pwm;
        assert_eq!(
            [
                p.collective_us,
                p.roll_us,
                p.pitch_us,
                p.tail_us,
                p.throttle_us
            ],
            [19, 20, 21, 22, 23]
        );
        let p = out.actuation;
        assert_eq!(
            [
                p.collective_us,
                p.roll_us,
                p.pitch_us,
                p.tail_us,
                p.throttle_us
            ],
            [31, 32, 33, 34, 35]
        );
        assert_eq!((out.sonar_adc, out.barometer_adc), (24, 30));
        let s = out.supply;
        assert_eq!((s.battery_mv, s.fuel_percent, s.auto_switch), (25, 26, 1));
        assert_eq!((out.pan_tilt.pan_adc, out.pan_tilt.tilt_adc), (27, 28));
        let r = out.references;
        assert_eq!(
            [
                r.x_speed_mps,
                r.y_speed_mps,
                r.altitude_m,
                r.pitch_deg,
                r.roll_deg,
                r.yaw_deg
            ],
            [36.0, 37.0, 38.0, 39.0, 40.0, 41.0]
        );
    }

    /// Wire and memory do not know each other; what both call a group is the same group all the same.
    #[test]
    fn groups_have_one_name_and_one_bit_on_both_sides() {
        for (wire, memory) in Group::ALL.into_iter().zip(TelemetryGroup::ALL) {
            assert_eq!((wire.name(), wire.bit()), (memory.name(), memory.bit()));
        }
        assert_eq!(DspErrorCode::KNOWN.len(), KNOWN_DSP_ERRORS);
    }

    #[test]
    fn validity_says_exactly_which_groups_were_there() {
        assert_eq!(translate(full()).valid_groups, u16::MAX);
        for group in Group::ALL {
            let mut without = full();
            without.withdraw(StatusMask::NONE.with(group));
            assert_eq!(
                translate(without).valid_groups,
                StatusMask::ALL.without(group).0
            );
        }
        let empty = translate(Status::default());
        assert_eq!((empty.valid_groups, empty.sonar_adc), (0, 0));
    }
}
