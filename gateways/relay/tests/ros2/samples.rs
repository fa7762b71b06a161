//! A sample of each topic of a robot.

use ipc_types::payload::{
    DspTelemetry, HeroAcceleration, HeroAngularRate, HeroAttitude, HeroGeodetic, HeroSupply,
    HeroTelemetry, HeroVelocity, ModuleState, SharedStruct,
};
use ipc_types::{RobotId, Schema};
use relay::ros2::{Publication, Qos, RosSession, StandardMessage, UnixOffset, message};
use serde_json::{Value, json};

/// Id of the session that publishes.
pub const ZENOH_ID: &str = "1f2e3d4c5b6a7988a1b2c3d4e5f60718";

/// One sample of a topic, and what a program in ROS 2 should see of it.
pub struct Sample {
    /// The topic.
    pub publication: Publication,
    /// The message.
    pub payload: Vec<u8>,
    /// Its fields, of some only those that matter.
    pub values: Value,
}

/// A sample of each topic of a robot.
pub fn samples() -> Vec<Sample> {
    let mut session = RosSession::new(0, ZENOH_ID);
    let robot = RobotId::DEFAULT;
    let node = session.node(robot);
    let telemetry = telemetry();
    let mut samples = Vec::new();
    let mut own = |key: &str, schema: Schema, bytes: &[u8], values: Value| {
        let publication = session.publish(&node, key, &schema, Qos::of_key(key));
        samples.push(Sample {
            publication,
            payload: message(bytes),
            values,
        });
    };
    let values = serde_json::to_value(telemetry).expect("JSON");
    let schema = Schema::of::<HeroTelemetry>();
    own("hero_telemetry", schema, telemetry.bytes(), values);
    let dsp = dsp();
    let values = serde_json::to_value(dsp).expect("JSON");
    own(
        "dsp_telemetry",
        Schema::of::<DspTelemetry>(),
        dsp.bytes(),
        values,
    );
    let state = state();
    let values = serde_json::to_value(state).expect("JSON");
    own(
        "module_state",
        Schema::of::<ModuleState>(),
        state.bytes(),
        values,
    );
    for standard in StandardMessage::ALL {
        let offset = UnixOffset(1_700_000_000_000_000_000);
        samples.push(Sample {
            publication: session.publish_standard(&node, standard),
            payload: standard
                .write(&telemetry, robot, offset)
                .expect("valid groups"),
            values: standard_values(standard),
        });
    }
    samples
}

/// A sample with all groups valid: level, to the north.
pub fn telemetry() -> HeroTelemetry {
    HeroTelemetry {
        sequence: 42,
        epoch_ns: u64::MAX,
        received_ns: 3_250_000_001,
        valid_groups: 0xffff,
        gps_quality: 4,
        geodetic: HeroGeodetic {
            latitude_rad: 0.75,
            longitude_rad: -0.1,
            altitude_m: 120.5,
        },
        velocity: HeroVelocity {
            north_mps: 3.0,
            east_mps: 4.1,
            up_mps: -1.5,
            ..HeroVelocity::ZERO
        },
        attitude: HeroAttitude::ZERO,
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
            battery_v: 12.3,
            ..HeroSupply::ZERO
        },
        ..HeroTelemetry::ZERO
    }
}

/// A sample of the DSP that flies.
pub fn dsp() -> DspTelemetry {
    DspTelemetry {
        sequence: 9,
        flying: 1,
        ..DspTelemetry::ZERO
    }
}

/// The state of the module 1.
pub fn state() -> ModuleState {
    ModuleState {
        sequence: 11,
        module_id: 1,
        ..ModuleState::ZERO
    }
}

/// What a standard message made of [`telemetry`] says.
fn standard_values(message: StandardMessage) -> Value {
    let header = |frame: &str| {
        json!({
            "stamp": { "sec": 1_700_000_003, "nanosec": 250_000_001 },
            "frame_id": frame,
        })
    };
    let unknown = [0.0; 9];
    match message {
        StandardMessage::NavSatFix => json!({
            "header": header("robot1/base_link"),
            "status": { "status": 2, "service": 1 },
            "latitude": 0.75_f64.to_degrees(),
            "longitude": (-0.1_f64).to_degrees(),
            "altitude": 120.5,
            "position_covariance_type": 1,
        }),
        StandardMessage::Imu => json!({
            "header": header("robot1/base_link"),
            "orientation": { "x": 0.0, "y": 0.0 },
            "orientation_covariance": unknown,
            "angular_velocity": { "x": 0.5, "y": -0.25, "z": -0.125 },
            "angular_velocity_covariance": unknown,
            "linear_acceleration": { "x": 0.5, "y": -0.25, "z": 9.75 },
            "linear_acceleration_covariance": unknown,
        }),
        StandardMessage::BatteryState => json!({
            "header": header("robot1/base_link"),
            "voltage": 12.3,
            "temperature": null,
            "current": null,
            "percentage": null,
            "power_supply_status": 0,
            "present": true,
            "cell_voltage": [],
            "location": "",
            "serial_number": "",
        }),
        StandardMessage::TwistStamped => json!({
            "header": header("map"),
            "twist": { "linear": { "x": 4.1, "y": 3.0, "z": -1.5 }, "angular": { "z": -0.125 } },
        }),
    }
}
