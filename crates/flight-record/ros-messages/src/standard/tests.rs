use std::f64::consts::{FRAC_PI_2, PI};

use ipc_types::MonotonicNs;
use ipc_types::payload::{
    HeroAcceleration, HeroAttitude, HeroGeodetic, HeroSupply, HeroVelocity, SharedStruct,
};
use proptest::prelude::*;

use super::*;
use crate::header::stamp;

/// Unix time minus monotonic time.
const OFFSET: UnixOffset = UnixOffset(1_700_000_000_000_000_000);

fn telemetry(groups: &[TelemetryGroup]) -> HeroTelemetry {
    HeroTelemetry {
        received_ns: 3_250_000_001,
        valid_groups: groups.iter().map(|group| u32::from(group.bit())).sum(),
        gps_quality: 4,
        geodetic: HeroGeodetic {
            latitude_rad: -PI / 6.0,
            longitude_rad: PI / 4.0,
            altitude_m: 120.5,
        },
        velocity: HeroVelocity {
            north_mps: 3.0,
            east_mps: 4.0,
            up_mps: -1.5,
            ..HeroVelocity::ZERO
        },
        acceleration: HeroAcceleration {
            forward_mps2: 0.5,
            right_mps2: 0.25,
            down_mps2: -9.75,
        },
        angular_rate: HeroAngularRate {
            forward_radps: 0.5,
            right_radps: 0.25,
            down_radps: 0.125,
        },
        supply: HeroSupply {
            battery_v: 12.5,
            ..HeroSupply::ZERO
        },
        ..HeroTelemetry::ZERO
    }
}

fn write(message: StandardMessage, groups: &[TelemetryGroup]) -> Vec<u8> {
    let message = message.write(&telemetry(groups), RobotId::DEFAULT, OFFSET);
    message.expect("all that is needed is valid")
}

/// The doubles from `offset` behind the header on.
fn doubles(message: &[u8], offset: usize, count: usize) -> Vec<f64> {
    let (doubles, _) = message[4 + offset..].as_chunks::<8>();
    let doubles = doubles.iter().take(count);
    doubles.map(|bytes| f64::from_le_bytes(*bytes)).collect()
}

/// Length of the header of a message in the frame of the body: time, length, `robot1/base_link` and its zero.
const BODY_HEADER: usize = 4 + 4 + 4 + 17;

/// Where numbers begin behind it that are aligned to 4 or 8.
const BODY: usize = BODY_HEADER + 3;

#[test]
fn a_header_has_unix_time_and_the_robots_frame() {
    let message = write(StandardMessage::BatteryState, &[TelemetryGroup::Supply]);
    let mut expected = vec![0, 1, 0, 0];
    expected.extend(1_700_000_003_i32.to_le_bytes());
    expected.extend(250_000_001_u32.to_le_bytes());
    expected.extend(17_u32.to_le_bytes());
    expected.extend(b"robot1/base_link\0");
    assert_eq!(message[..4 + BODY_HEADER], expected);
}

#[test]
fn times_beyond_the_range_stay_at_its_end() {
    let mut writer = Writer::with_capacity(0);
    stamp(&mut writer, i64::MAX);
    stamp(&mut writer, -1);
    let bytes = writer.finish();
    assert_eq!(bytes[4..8], i32::MAX.to_le_bytes());
    assert_eq!(bytes[12..16], (-1_i32).to_le_bytes());
    assert_eq!(bytes[16..20], 999_999_999_u32.to_le_bytes());
    let offset = UnixOffset(i64::MAX);
    assert_eq!(offset.unix_ns(MonotonicNs(u64::MAX)), i64::MAX);
}

#[test]
fn no_message_is_made_of_groups_that_are_not_valid() {
    for message in StandardMessage::ALL {
        for missing in message.needs() {
            let groups: Vec<_> = TelemetryGroup::ALL
                .into_iter()
                .filter(|group| group != missing)
                .collect();
            let made = message.write(&telemetry(&groups), RobotId::DEFAULT, OFFSET);
            assert_eq!(made, None, "{message:?} without {missing:?}");
        }
        write(message, message.needs());
    }
}

#[test]
fn a_fix_is_in_degrees_with_the_status_of_its_quality() {
    let groups = [TelemetryGroup::Geographic, TelemetryGroup::GpsQuality];
    let message = write(StandardMessage::NavSatFix, &groups);
    let status = &message[4 + BODY_HEADER..][..3];
    assert_eq!(status, [2, 1, 0]);
    let values = doubles(&message, BODY, 12);
    assert!((values[0] + 30.0).abs() < 1e-12 && (values[1] - 45.0).abs() < 1e-12);
    assert_eq!(values[2], 120.5);
}

#[test]
fn the_covariance_of_a_position_is_that_of_the_kind_of_its_fix() {
    let covariance = |quality: Option<u32>| {
        let mut groups = vec![TelemetryGroup::Geographic];
        groups.extend(quality.map(|_| TelemetryGroup::GpsQuality));
        let telemetry = HeroTelemetry {
            gps_quality: quality.unwrap_or_default(),
            ..telemetry(&groups)
        };
        let fix = StandardMessage::NavSatFix;
        let message = fix.write(&telemetry, RobotId::DEFAULT, OFFSET).unwrap();
        let matrix = doubles(&message, BODY + 3 * 8, 9);
        assert!([1, 2, 3, 5, 6, 7].iter().all(|index| matrix[*index] == 0.0));
        let kind = message[4 + BODY + 12 * 8];
        (kind, [0, 4, 8].map(|index| matrix[index].sqrt()))
    };
    for (quality, kind, error_m) in [
        (None, 0, 0.0),
        (Some(0), 0, 0.0),
        (Some(1), 1, 3.0),
        (Some(2), 1, 1.0),
        (Some(3), 1, 3.0),
        (Some(4), 1, 0.02),
        (Some(5), 1, 0.5),
        (Some(6), 0, 0.0),
        (Some(8), 0, 0.0),
    ] {
        let (found, errors) = covariance(quality);
        assert_eq!(found, kind, "{quality:?}");
        for (found, expected) in errors.into_iter().zip([error_m, error_m, 2.0 * error_m]) {
            assert!((found - expected).abs() < 1e-12, "{quality:?}: {found}");
        }
    }
}

#[test]
fn the_status_of_a_fix_follows_nmea() {
    let statuses = [0, 1, 2, 3, 4, 5, 6, 7, 8, u32::MAX].map(|quality| fix_status(Some(quality)));
    assert_eq!(statuses, [-1, 0, 1, 0, 2, 2, -1, -1, -1, -1]);
    assert_eq!(fix_status(None), STATUS_UNKNOWN);
}

#[test]
fn an_imu_without_attitude_marks_the_orientation_as_absent() {
    let message = write(StandardMessage::Imu, StandardMessage::Imu.needs());
    let values = doubles(&message, BODY, 37);
    assert_eq!(values[..5], [0.0, 0.0, 0.0, 1.0, -1.0]);
    // At rest the specific force points up.
    assert_eq!(values[13..16], [0.5, -0.25, -0.125]);
    assert_eq!(values[25..28], [0.5, -0.25, 9.75]);
    assert_eq!(message.len(), 4 + BODY + 37 * 8);
}

#[test]
fn the_longest_message_has_the_capacity() {
    let telemetry = telemetry(&TelemetryGroup::ALL);
    let robot = RobotId::new(u32::MAX).unwrap();
    let messages = StandardMessage::ALL.map(|message| message.write(&telemetry, robot, OFFSET));
    let lengths = messages.map(|message| message.map_or(0, |message| message.len()));
    assert_eq!(lengths.into_iter().max(), Some(CAPACITY));
}

#[test]
fn a_battery_has_its_voltage_and_nothing_else_that_is_measured() {
    let message = write(StandardMessage::BatteryState, &[TelemetryGroup::Supply]);
    let body = &message[4 + BODY..];
    assert_eq!(body[..4], 12.5_f32.to_le_bytes());
    let (unmeasured, _) = body[4..28].as_chunks::<4>();
    assert!(
        unmeasured
            .iter()
            .all(|bytes| f32::from_le_bytes(*bytes).is_nan())
    );
    assert_eq!(body[28..32], [0, 0, 0, 1]);
    let strings = [
        0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0,
    ];
    assert_eq!(body[32..], strings);
}

#[test]
fn a_twist_is_to_the_east_the_north_and_up() {
    // Time, length, `map` and its zero.
    let header = 4 + 4 + 4 + 4;
    let message = write(
        StandardMessage::TwistStamped,
        &[TelemetryGroup::GpsVelocity],
    );
    let values = doubles(&message, header, 6);
    assert_eq!(values[..3], [4.0, 3.0, -1.5]);
    assert!(values[3..].iter().all(|value| value.is_nan()));
    // Level and to the north: forward is north, right is east.
    let groups = [
        TelemetryGroup::GpsVelocity,
        TelemetryGroup::Attitude,
        TelemetryGroup::AngularRate,
    ];
    let values = doubles(&write(StandardMessage::TwistStamped, &groups), header, 6);
    for (value, expected) in values[3..].iter().zip([0.25, 0.5, -0.125]) {
        assert!((value - expected).abs() < 1e-12, "{values:?}");
    }
}

#[test]
fn to_the_east_and_level_there_is_no_rotation() {
    let attitude = HeroAttitude {
        yaw_rad: FRAC_PI_2 as f32,
        ..HeroAttitude::ZERO
    };
    for (value, expected) in Quaternion::of(&attitude).0.iter().zip([0.0, 0.0, 0.0, 1.0]) {
        assert!((value - expected).abs() < 1e-7);
    }
}

proptest! {
    /// Against the other way: roll, pitch and yaw one after the other from the body (forward, right, down) to north,
    /// east, down, and axes exchanged before and after.
    #[test]
    fn an_orientation_is_the_attitude_in_other_axes(
        roll_rad in -PI as f32..PI as f32,
        pitch_rad in -1.5_f32..1.5,
        yaw_rad in -PI as f32..PI as f32,
        vector in prop::array::uniform3(-10.0..10.0),
    ) {
        let attitude = HeroAttitude { roll_rad, pitch_rad, yaw_rad };
        let rotated = Quaternion::of(&attitude).rotate(vector);
        let [forward, left, up] = vector;
        let (right, down) = (-left, -up);
        let (s, c) = f64::from(roll_rad).sin_cos();
        let (right, down) = (c * right - s * down, s * right + c * down);
        let (s, c) = f64::from(pitch_rad).sin_cos();
        let (forward, down) = (c * forward + s * down, -s * forward + c * down);
        let (s, c) = f64::from(yaw_rad).sin_cos();
        let (north, east) = (c * forward - s * right, s * forward + c * right);
        for (value, expected) in rotated.iter().zip([east, north, -down]) {
            prop_assert!((value - expected).abs() < 1e-9, "{rotated:?}");
        }
    }
}
