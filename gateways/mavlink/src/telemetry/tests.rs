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
        mission: crate::mission::Missions::new().view(),
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
    telemetry.supply.fuel_fraction = 0.625;
    telemetry
}

fn home() -> Home {
    Home::Ground(WaypointPosition {
        latitude_deg: 37.0,
        longitude_deg: -6.0,
        altitude_m: 20.0,
    })
}

#[test]
fn units_and_frames_are_those_of_the_messages() {
    with(&full(), home(), |scene| {
        let message = scene.message(StreamId::GlobalPosition).unwrap();
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
        let gps = scene.message(StreamId::GpsRaw).unwrap();
        assert_eq!((gps.payload().u8(28), gps.payload().u64(0)), (6, 5_000_000));
        assert_eq!(gps.payload().u16(26), 35_427);
        let status = scene.message(StreamId::SysStatus).unwrap();
        assert_eq!(status.payload().u16(14), 24_500);
        let fuel = scene.message(StreamId::Fuel).unwrap();
        let levels = [0, 8].map(|at| fuel.payload().f32(at));
        assert_eq!((levels, fuel.payload().u8(25)), ([1.0, 0.625], 63));
        let altitudes = scene.message(StreamId::Altitude).unwrap();
        assert_eq!(altitudes.payload().f32(20), 10.25);
        let quaternion = scene.message(StreamId::AttitudeQuaternion).unwrap();
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
        for stream in StreamId::ALL {
            let is_sent = scene.message(stream).is_some();
            let expected = !matches!(
                stream,
                StreamId::GlobalPosition
                    | StreamId::Attitude
                    | StreamId::AttitudeQuaternion
                    | StreamId::LocalPosition
                    | StreamId::VfrHud
                    | StreamId::Fuel
                    | StreamId::Home
            );
            assert_eq!(is_sent, expected, "{stream:?}");
        }
        let gps = scene.message(StreamId::GpsRaw).unwrap();
        assert_eq!((gps.payload().u8(28), gps.payload().i32(8)), (1, 0));
        let altitudes = scene.message(StreamId::Altitude).unwrap();
        assert!(altitudes.payload().f32(12).is_nan());
        let status = scene.message(StreamId::SysStatus).unwrap();
        assert_eq!(status.payload().u16(14), u16::MAX);
        assert_eq!(status.payload().u32(8) & 0x20, 0);
    });
    // Without home there is no height over it.
    with(&full(), Home::Unknown, |scene| {
        let altitudes = scene.message(StreamId::Altitude).unwrap();
        assert!(altitudes.payload().f32(20).is_nan());
        assert!(scene.message(StreamId::Home).is_none());
    });
    // A velocity that is not known is not 0, 0, 0.
    let mut still = full();
    still.valid_groups &= !u32::from(TelemetryGroup::GpsVelocity.bit());
    with(&still, home(), |scene| {
        assert!(scene.message(StreamId::GlobalPosition).is_none());
        assert!(scene.message(StreamId::GpsRaw).is_some());
    });
}

#[test]
fn without_a_fix_stations_get_no_place_and_nobody_is_ready() {
    let (mut telemetry, prearm_check) = (full(), 0x1000_0000);
    with(&telemetry, home(), |scene| {
        let status = scene.message(StreamId::SysStatus).unwrap();
        assert_eq!(status.payload().u32(8) & prearm_check, prearm_check);
    });
    telemetry.gps_quality = 0;
    telemetry.geodetic = Default::default();
    telemetry.valid_groups &= !u32::from(TelemetryGroup::OF_A_FIX);
    with(&telemetry, Home::Unknown, |scene| {
        use StreamId::{GlobalPosition, GpsRaw, Home, LocalPosition, SysStatus};
        for stream in [GlobalPosition, LocalPosition, Home] {
            assert!(scene.message(stream).is_none(), "{stream:?}");
        }
        let status = scene.message(SysStatus).unwrap();
        assert_eq!(status.payload().u32(8) & (prearm_check | 0x20), 0);
        let gps = scene.message(GpsRaw).unwrap();
        assert_eq!(gps.payload().u8(28), 1, "no fix");
        assert_eq!(gps.payload().u16(24), u16::MAX, "no velocity");
    });
}

#[test]
fn no_message_is_longer_than_its_definition() {
    let lengths = [9, 9, 43, 2, 28, 28, 48, 28, 20, 32, 52, 54, 60];
    with(&full(), home(), |scene| {
        for (stream, most) in StreamId::ALL.into_iter().zip(lengths) {
            let message = scene.message(stream).unwrap();
            assert!(message.payload().0.len() <= most, "{stream:?}");
        }
    });
}
