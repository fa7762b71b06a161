//! A robot in flight, for the tests of the model and of what shows it.

use ipc_types::code::{
    Functionality, LinkState, ModuleId, ModuleStatus, MovementKind, PilotSwitch,
};
use ipc_types::module::{State, doing_bytes};
use ipc_types::outline::{Outline, OutlineArea, OutlineShape};
use ipc_types::payload::{HeroTelemetry, ModuleState, WaypointPosition};
use ipc_types::{MonotonicNs, TelemetryGroup};

use crate::robot::model::{Process, WatchedRobot};

pub const fn at(ms: u64) -> MonotonicNs {
    MonotonicNs(1_000_000_000_000 + ms * 1_000_000)
}

pub fn state(functionality: Functionality, ms: u64) -> ModuleState {
    let mut state = ModuleState {
        sequence: ms,
        epoch_ns: 7,
        published_ns: at(ms).0,
        module_id: ModuleId::HeroBridge.code(),
        status: ModuleStatus::Running.code(),
        functionality: functionality.code(),
        ..ModuleState::default()
    };
    state.link.state = LinkState::Up.code();
    state.link.messages_received = ms;
    state.link.state_since_ns = at(0).0;
    state.link.last_message_ns = at(ms).0;
    state.link.telemetry_published = 1;
    state.safety.pilot_switch = PilotSwitch::Auto.code();
    (state.home_latitude_deg, state.home_longitude_deg) = (37.4112, -6.001);
    (state.ground_altitude_m, state.ground_valid) = (15.0, 1);
    state
}

/// On a path of three waypoints of which `reached` are reached.
pub fn on_path(reached: u32, ms: u64) -> ModuleState {
    let mut state = state(Functionality::FollowingPath, ms);
    state.movement.request_id = 5;
    state.movement.path_id = 6;
    state.movement.kind = MovementKind::GoToWaypoint.code();
    state.movement.waypoints_total = 3;
    state.movement.waypoints_reached = reached;
    state.movement.distance_to_go_m = 31.4;
    state.movement.distance_valid = 1;
    state
}

pub fn hero(east_m: f64, altitude_m: f64, ms: u64) -> HeroTelemetry {
    let mut hero = HeroTelemetry {
        sequence: ms,
        received_ns: at(ms).0,
        published_ns: at(ms).0,
        valid_groups: 0xffff,
        flying: u32::from(altitude_m > 15.0),
        gps_quality: 4,
        ..HeroTelemetry::default()
    };
    hero.geodetic.latitude_rad = 37.4112_f64.to_radians();
    hero.geodetic.longitude_rad = (-6.001 + east_m / 88_400.0).to_radians();
    hero.geodetic.altitude_m = altitude_m;
    hero.velocity.ground_speed_mps = 3.1;
    hero.velocity.up_mps = 0.2;
    hero.velocity.course_rad = 90_f32.to_radians();
    hero.attitude.yaw_rad = 90_f32.to_radians();
    hero.supply.battery_v = 24.1;
    hero.supply.fuel_fraction = 0.8;
    hero.supply.auto_switch = 1;
    hero
}

/// In flight, as status publishes what a GPS without a fix says.
pub fn without_fix(ms: u64) -> HeroTelemetry {
    lose_fix(hero(0.0, 25.0, ms))
}

/// A sample as status publishes it when the GPS has no fix.
pub fn lose_fix(hero: HeroTelemetry) -> HeroTelemetry {
    HeroTelemetry {
        gps_quality: 0,
        valid_groups: hero.valid_groups & !u32::from(TelemetryGroup::OF_A_FIX),
        geodetic: Default::default(),
        velocity: Default::default(),
        ..hero
    }
}

pub fn translating(ms: u64) -> State {
    State {
        published_ns: at(ms).0,
        status: ModuleStatus::Running.code(),
        module_id: ModuleId::HeroStatus.code(),
        doing: doing_bytes("translating telemetry"),
        ..State::default()
    }
}

/// `robot` takes off, flies to the east on a path of three waypoints, and has reached one; 20 s, of which the last
/// sample is of 20,000 ms.
pub fn fly(robot: &mut WatchedRobot) {
    for process in Process::ALL {
        robot.provider(process, process != Process::Relay, at(0));
    }
    for tick in 0..=80 {
        let ms = tick * 250;
        let now = at(ms);
        robot.status(&translating(ms), now);
        let seconds = ms as f64 / 1000.0;
        let bridge = match tick {
            0..8 => state(Functionality::AtRest, ms),
            8..32 => state(Functionality::TakingOff, ms),
            32..60 => on_path(0, ms),
            _ => on_path(1, ms),
        };
        let east_m = (seconds - 8.0).max(0.0) * 3.0;
        let climbed_m = ((seconds - 2.0) * 2.0).clamp(0.0, 10.0);
        robot.state(&bridge, now);
        robot.hero(&hero(east_m, 15.0 + climbed_m, ms), now);
        robot.judge(now);
    }
}

/// An area of every height.
pub fn area(name: &str, is_inclusion: bool, shape: OutlineShape) -> OutlineArea {
    OutlineArea {
        name: name.to_owned(),
        is_inclusion,
        floor_m: None,
        ceiling_m: None,
        shape,
    }
}

/// What a bridge holds: a fence of a rectangle with a mast in it, and the path of the flight.
pub fn outline() -> Outline {
    let field = vec![
        [37.4109, -6.0012],
        [37.4115, -6.0012],
        [37.4115, -6.0003],
        [37.4109, -6.0003],
    ];
    let mast = OutlineShape::Circle {
        centre: [37.4113, -6.0007],
        radius_m: 6.0,
    };
    let waypoint = |latitude_deg, longitude_deg| WaypointPosition {
        latitude_deg,
        longitude_deg,
        altitude_m: 25.0,
    };
    Outline {
        number: 0,
        floor_m: None,
        ceiling_m: Some(120.0),
        areas: vec![
            area("field", true, OutlineShape::Polygon(field)),
            area("mast", false, mast),
        ],
        path: vec![
            waypoint(37.4112, -6.0008),
            waypoint(37.4112, -6.0005),
            waypoint(37.4110, -6.0005),
        ],
    }
}
