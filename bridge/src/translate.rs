//! The one seam between the wire and shared memory: a status message becomes a [`DspTelemetry`].
//!
//! Every struct of the wire is taken apart without `..`, so that a new field does not compile until it is translated
//! here. A group that was not transmitted, or was withdrawn as implausible, is zero and its validity bit is not set.

use dsp_protocol::Status;
use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};
use ipc_types::payload::{
    DspAcceleration, DspAngularRate, DspAttitude, DspErrorCounters, DspGeographic, DspGpsVelocity,
    DspPanTilt, DspReferences, DspServoPulses, DspSupply, DspTelemetry, DspXy,
};

use crate::link::StatusSample;

/// Writes `sample` into `out`: everything but `sequence` and `epoch_ns`, which belong to the publisher.
pub fn dsp_telemetry(
    sample: &StatusSample,
    dsp_boots: u32,
    errors: &DspErrorCounters,
    out: &mut DspTelemetry,
) {
    let StatusSample {
        status,
        received,
        sent,
    } = sample;
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
    } = *status;
    *out = DspTelemetry {
        sequence: out.sequence,
        epoch_ns: out.epoch_ns,
        received_ns: received.0,
        sent_ns: sent.by.0,
        sent_uncertainty_s: sent.uncertainty.as_secs_f64(),
        dsp_time_ms: time_ms.unwrap_or_default(),
        // A group is valid when it is there.
        valid_groups: status.mask().0,
        flying: flying.into(),
        gps_quality: gps_quality.unwrap_or_default(),
        dsp_boots,
        dsp_errors: errors.total,
        last_dsp_error_code: errors.last_code,
        rotor_rpm: rotor_rpm.unwrap_or_default().into(),
        geographic: stored(geographic),
        xy: stored(xy),
        gps_velocity: stored(gps_velocity),
        attitude: stored(attitude),
        acceleration: stored(acceleration),
        angular_rate: stored(angular_rate),
        pilot_pwm: stored(pilot_pwm),
        actuation: stored(actuation),
        sonar_adc: sonar_adc.unwrap_or_default().into(),
        barometer_adc: barometer_adc.unwrap_or_default().into(),
        supply: stored(supply),
        pan_tilt: stored(pan_tilt),
        references: stored(references),
    };
}

/// A struct of the wire that has its counterpart in shared memory.
trait Stored {
    type Memory: Default;
    fn stored(self) -> Self::Memory;
}

/// A group as it stands in shared memory; zero when it was not transmitted.
fn stored<W: Stored>(group: Option<W>) -> W::Memory {
    group.map(W::stored).unwrap_or_default()
}

/// Structs whose fields have the same names on both sides. A field that either side has and the list has not does not
/// compile; `as` narrows, and what stands behind the `;` only the memory has.
macro_rules! same_fields {
    ($($wire:ident => $memory:ident {
        $($field:ident $(as $narrowed:ty)?),+ $(; $own:ident: $value:expr)?
    })+) => {$(
        impl Stored for $wire {
            type Memory = $memory;

            fn stored(self) -> $memory {
                let $wire { $($field),+ } = self;
                $memory {
                    $($field: ($field $(as $narrowed)?).into(),)+
                    $($own: $value,)?
                }
            }
        }
    )+};
}

same_fields! {
    Geographic => DspGeographic { latitude_deg, longitude_deg, altitude_m }
    Xy => DspXy { x_m, y_m }
    GpsVelocity => DspGpsVelocity { horizontal_speed_mps, vertical_speed_mps, heading_deg }
    Attitude => DspAttitude { pitch_deg, roll_deg, yaw_deg }
    Acceleration => DspAcceleration { x_mps2, y_mps2, z_mps2 }
    AngularRate => DspAngularRate { x_radps, y_radps, z_radps }
    ServoPulses => DspServoPulses { collective_us, roll_us, pitch_us, tail_us, throttle_us }
    Supply => DspSupply { battery_mv, fuel_percent, auto_switch }
    PanTilt => DspPanTilt { pan_adc, tilt_adc }
    References => DspReferences {
        x_speed_mps, y_speed_mps, altitude_m as f32, pitch_deg, roll_deg, yaw_deg; reserved: 0
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::time::Duration;

    use dsp_protocol::{Group, StatusMask};
    use ipc_types::{MonotonicNs, TelemetryGroup};

    use super::*;
    use crate::link::line::Sent;

    /// Has all groups, each with values of its own.
    pub(crate) fn full() -> Status {
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
        let sample = StatusSample {
            status,
            received: MonotonicNs(52),
            sent: Sent {
                by: MonotonicNs(49),
                uncertainty: Duration::from_millis(1),
            },
        };
        dsp_telemetry(&sample, 53, &errors, &mut out);
        out
    }

    #[test]
    fn every_value_finds_its_place() {
        let out = translate(full());
        assert_eq!((out.sequence, out.epoch_ns, out.received_ns), (50, 51, 52));
        assert_eq!((out.sent_ns, out.sent_uncertainty_s), (49, 0.001));
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
