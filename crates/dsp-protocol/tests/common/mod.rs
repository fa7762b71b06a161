//! Messages for property tests. Scaled values lie on the grid of their wire step, so that they can be compared exactly.

use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Status, Supply, Xy,
};
use dsp_protocol::{
    Command, Decoded, Decoder, Direction, Downlink, DspErrorCode, FlowControl, Profile, Received,
    Uplink, Waypoint,
};
use proptest::option;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};

/// The cases do not change from run to run, so that a failure is the change's and not the day's.
pub fn config(cases: u32) -> Config {
    Config {
        cases,
        rng_seed: RngSeed::Fixed(0x4845_524F),
        failure_persistence: None,
        ..Config::default()
    }
}

fn grid_f64(steps_per_unit: f64) -> impl Strategy<Value = f64> {
    any::<i32>().prop_map(move |steps| f64::from(steps) / steps_per_unit)
}

fn grid_f32(steps_per_unit: f32) -> impl Strategy<Value = f32> {
    any::<i16>().prop_map(move |steps| f32::from(steps) / steps_per_unit)
}

fn unsigned_grid_f32(steps_per_unit: f32) -> impl Strategy<Value = f32> {
    any::<u16>().prop_map(move |steps| f32::from(steps) / steps_per_unit)
}

/// Any `f32` but NaN, which is not equal to itself.
fn number_f32() -> impl Strategy<Value = f32> {
    any::<f32>().prop_filter("comparable", |value| !value.is_nan())
}

fn u14() -> impl Strategy<Value = u16> {
    0..1u16 << 14
}

fn u7() -> impl Strategy<Value = u8> {
    0..1u8 << 7
}

fn geographic() -> impl Strategy<Value = Geographic> {
    (grid_f64(1e7), grid_f64(1e7), grid_f64(1e3)).prop_map(
        |(latitude_deg, longitude_deg, altitude_m)| Geographic {
            latitude_deg,
            longitude_deg,
            altitude_m,
        },
    )
}

fn gps_velocity() -> impl Strategy<Value = GpsVelocity> {
    (
        unsigned_grid_f32(100.0),
        grid_f32(100.0),
        unsigned_grid_f32(100.0),
    )
        .prop_map(
            |(horizontal_speed_mps, vertical_speed_mps, heading_deg)| GpsVelocity {
                horizontal_speed_mps,
                vertical_speed_mps,
                heading_deg,
            },
        )
}

fn attitude() -> impl Strategy<Value = Attitude> {
    (grid_f32(100.0), grid_f32(100.0), grid_f32(100.0)).prop_map(
        |(pitch_deg, roll_deg, yaw_deg)| Attitude {
            pitch_deg,
            roll_deg,
            yaw_deg,
        },
    )
}

fn acceleration() -> impl Strategy<Value = Acceleration> {
    (grid_f32(100.0), grid_f32(100.0), grid_f32(100.0)).prop_map(|(x_mps2, y_mps2, z_mps2)| {
        Acceleration {
            x_mps2,
            y_mps2,
            z_mps2,
        }
    })
}

fn angular_rate() -> impl Strategy<Value = AngularRate> {
    (grid_f32(1e3), grid_f32(1e3), grid_f32(1e3)).prop_map(|(x_radps, y_radps, z_radps)| {
        AngularRate {
            x_radps,
            y_radps,
            z_radps,
        }
    })
}

fn pulses() -> impl Strategy<Value = ServoPulses> {
    (u14(), u14(), u14(), u14(), u14()).prop_map(
        |(collective_us, roll_us, pitch_us, tail_us, throttle_us)| ServoPulses {
            collective_us,
            roll_us,
            pitch_us,
            tail_us,
            throttle_us,
        },
    )
}

fn supply() -> impl Strategy<Value = Supply> {
    (any::<u16>(), u7(), u7()).prop_map(|(battery_mv, fuel_percent, auto_switch)| Supply {
        battery_mv,
        fuel_percent,
        auto_switch,
    })
}

fn references() -> impl Strategy<Value = References> {
    (grid_f32(100.0), grid_f32(100.0), grid_f64(1e3), attitude()).prop_map(
        |(x_speed_mps, y_speed_mps, altitude_m, angles)| References {
            x_speed_mps,
            y_speed_mps,
            altitude_m,
            pitch_deg: angles.pitch_deg,
            roll_deg: angles.roll_deg,
            yaw_deg: angles.yaw_deg,
        },
    )
}

/// A status with any subset of the groups.
pub fn status() -> impl Strategy<Value = Status> {
    let positions = (
        any::<bool>(),
        option::of(any::<u32>()),
        option::of(geographic()),
        option::of((grid_f64(1e3), grid_f64(1e3)).prop_map(|(x_m, y_m)| Xy { x_m, y_m })),
        option::of(gps_velocity()),
        option::of(u7()),
    );
    let inertial = (
        option::of(attitude()),
        option::of(acceleration()),
        option::of(angular_rate()),
        option::of(pulses()),
        option::of(u14()),
        option::of(supply()),
    );
    let vehicle = (
        option::of((u14(), u14()).prop_map(|(pan_adc, tilt_adc)| PanTilt { pan_adc, tilt_adc })),
        option::of(u14()),
        option::of(u14()),
        option::of(pulses()),
        option::of(references()),
    );
    (positions, inertial, vehicle).prop_map(|(positions, inertial, vehicle)| Status {
        flying: positions.0,
        time_ms: positions.1,
        geographic: positions.2,
        xy: positions.3,
        gps_velocity: positions.4,
        gps_quality: positions.5,
        attitude: inertial.0,
        acceleration: inertial.1,
        angular_rate: inertial.2,
        pilot_pwm: inertial.3,
        sonar_adc: inertial.4,
        supply: inertial.5,
        pan_tilt: vehicle.0,
        rotor_rpm: vehicle.1,
        barometer_adc: vehicle.2,
        actuation: vehicle.3,
        references: vehicle.4,
    })
}

/// Any message from the DSP.
pub fn downlink() -> impl Strategy<Value = Downlink> {
    prop_oneof![
        4 => status().prop_map(Downlink::Status),
        1 => prop_oneof![Just(FlowControl::Stop), Just(FlowControl::Send)]
            .prop_map(Downlink::FlowControl),
        1 => (0..8u8).prop_map(|command| Downlink::Ack { command }),
        1 => (0..8u8, any::<u16>())
            .prop_map(|(command, value)| Downlink::Ack16 { command, value }),
        1 => (0..8u8, number_f32()).prop_map(|(command, value)| Downlink::Ack32 { command, value }),
        1 => any::<u16>().prop_map(|code| Downlink::Error(DspErrorCode(code))),
    ]
}

/// Any message from the PC.
pub fn uplink() -> impl Strategy<Value = Uplink> {
    let command = prop_oneof![
        any::<u16>().prop_map(|port| Command::Read16 { port }),
        (any::<u16>(), any::<u16>()).prop_map(|(port, value)| Command::Write16 { port, value }),
        any::<u16>().prop_map(|port| Command::Read32 { port }),
        (any::<u16>(), number_f32()).prop_map(|(port, value)| Command::Write32 { port, value }),
        Just(Command::ClearErrors),
        Just(Command::ActivateStatus),
        Just(Command::InvalidatePath),
        any::<bool>().prop_map(|on| Command::Following { on }),
    ];
    let waypoint = geographic().prop_map(|place| Waypoint {
        latitude_deg: place.latitude_deg,
        longitude_deg: place.longitude_deg,
        altitude_m: place.altitude_m,
    });
    prop_oneof![
        2 => command.prop_map(Uplink::Command),
        1 => waypoint.prop_map(Uplink::Waypoint),
    ]
}

/// All messages and rejections of a stream of `profile` that arrives in these slices, with the numbers of the messages.
pub fn receive_all<'a, M: Direction>(
    profile: Profile,
    slices: impl IntoIterator<Item = &'a [u8]>,
) -> Vec<Decoded<Received<M>>> {
    let mut decoder = Decoder::with_profile(profile);
    let mut found = Vec::new();
    for mut rest in slices {
        loop {
            let (taken, decoded) = decoder.receive(rest);
            rest = &rest[taken..];
            match decoded {
                Decoded::Incomplete => break,
                decoded => found.push(decoded),
            }
        }
        assert!(rest.is_empty(), "incomplete, but {} bytes left", rest.len());
    }
    found
}

/// Decodes everything in `slices`, and drops the numbers of messages.
pub fn decode_all<'a, M: Direction>(
    profile: Profile,
    slices: impl IntoIterator<Item = &'a [u8]>,
) -> Vec<Decoded<M>> {
    receive_all(profile, slices)
        .into_iter()
        .map(|decoded| match decoded {
            Decoded::Message(Received { message, .. }) => Decoded::Message(message),
            Decoded::Rejected(error) => Decoded::Rejected(error),
            Decoded::Incomplete => unreachable!("not collected"),
        })
        .collect()
}
