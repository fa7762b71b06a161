//! Messages from the DSP to the PC (`docs/protocol.md` section 4).

use crate::error_code::DspErrorCode;
use crate::frame::Frame;
use crate::mask::StatusMask;

/// One message from the DSP. Each variant carries only its own fields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Downlink {
    /// Periodic state of the helicopter (`ESTADOS`).
    Status(Status),
    /// May the next waypoint be sent (`CONTROLFLUJO`).
    FlowControl(FlowControl),
    /// A command arrived (`COMMANDACK`).
    Ack {
        /// Code of the command, 0 … 7.
        command: u8,
    },
    /// A 16-bit port was read (`COMMANDACK16`).
    Ack16 {
        /// Code of the command, 0 … 7.
        command: u8,
        /// Value of the port.
        value: u16,
    },
    /// A 32-bit port was read (`COMMANDACK32`).
    Ack32 {
        /// Code of the command, 0 … 7.
        command: u8,
        /// Value of the port.
        value: f32,
    },
    /// An error that the DSP noticed (`DSPERROR`).
    Error(DspErrorCode),
}

impl Downlink {
    /// The message as one frame.
    pub fn encode(&self) -> Frame {
        unimplemented!("{self:?}")
    }
}

/// The DSP's request for waypoints (`peticion_de_tx`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlowControl {
    /// The path buffer is full.
    Stop,
    /// One new waypoint may be sent.
    Send,
}

/// A status message: the flying flag and the groups that the DSP's mask selects.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Status {
    /// The helicopter is in the air (`heli_volando`).
    pub flying: bool,
    /// Milliseconds since the DSP's boot.
    pub time_ms: Option<u32>,
    /// Geographic position.
    pub geographic: Option<Geographic>,
    /// Flat position.
    pub xy: Option<Xy>,
    /// GPS velocity.
    pub gps_velocity: Option<GpsVelocity>,
    /// NMEA fix quality, 0 … 8.
    pub gps_quality: Option<u8>,
    /// IMU attitude.
    pub attitude: Option<Attitude>,
    /// IMU specific force.
    pub acceleration: Option<Acceleration>,
    /// IMU angular rate.
    pub angular_rate: Option<AngularRate>,
    /// Pilot's PWM signals.
    pub pilot_pwm: Option<ServoPulses>,
    /// Sonar, raw ADC.
    pub sonar_adc: Option<u16>,
    /// Battery, fuel, switch.
    pub supply: Option<Supply>,
    /// Pan and tilt potentiometers.
    pub pan_tilt: Option<PanTilt>,
    /// Main rotor speed, rpm.
    pub rotor_rpm: Option<u16>,
    /// Barometric altimeter, raw ADC.
    pub barometer_adc: Option<u16>,
    /// Actuation of the servos.
    pub actuation: Option<ServoPulses>,
    /// Controller references.
    pub references: Option<References>,
}

impl Status {
    /// The groups that the message carries.
    pub fn mask(&self) -> StatusMask {
        unimplemented!()
    }
}

/// Geographic position, WGS 84. Wire step: 10⁻⁷ ° and 1 mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Geographic {
    /// Latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Altitude, metres, up positive.
    pub altitude_m: f64,
}

/// Flat position around the first valid GPS fix. Wire step: 1 mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Xy {
    /// East of the origin, metres.
    pub x_m: f64,
    /// North of the origin, metres.
    pub y_m: f64,
}

/// GPS velocity. Wire step: 1 cm/s and 0.01 °.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GpsVelocity {
    /// Speed over ground, m/s, not negative.
    pub horizontal_speed_mps: f32,
    /// Climb speed, m/s, up positive.
    pub vertical_speed_mps: f32,
    /// Course over ground, degrees clockwise from true north, 0 … 360.
    pub heading_deg: f32,
}

/// IMU attitude. Wire step: 0.01 °.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attitude {
    /// Nose up positive, degrees.
    pub pitch_deg: f32,
    /// Right side down positive, degrees.
    pub roll_deg: f32,
    /// Clockwise from true north, degrees, −180 … 180.
    pub yaw_deg: f32,
}

/// IMU specific force in body axes (x forward, y right, z down). Wire step: 0.01 m/s².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Acceleration {
    /// Forward, m/s².
    pub x_mps2: f32,
    /// Right, m/s².
    pub y_mps2: f32,
    /// Down, m/s²; about −9.81 at rest.
    pub z_mps2: f32,
}

/// IMU angular rate in body axes. Wire step: 0.001 1/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AngularRate {
    /// About the forward axis, rad/s.
    pub x_radps: f32,
    /// About the right axis, rad/s.
    pub y_radps: f32,
    /// About the down axis, rad/s.
    pub z_radps: f32,
}

/// Pulse widths of the five servo channels. Wire step: 1 µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServoPulses {
    /// Collective pitch, µs.
    pub collective_us: u16,
    /// Lateral cyclic, µs.
    pub roll_us: u16,
    /// Longitudinal cyclic, µs.
    pub pitch_us: u16,
    /// Tail rotor, µs.
    pub tail_us: u16,
    /// Throttle, µs.
    pub throttle_us: u16,
}

/// Battery, fuel and the auto/manual switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Supply {
    /// Battery, millivolts.
    pub battery_mv: u16,
    /// Fuel, percent.
    pub fuel_percent: u8,
    /// 0 manual, 1 auto; other values are implausible.
    pub auto_switch: u8,
}

/// Pan and tilt potentiometers, raw ADC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PanTilt {
    /// Pan, raw ADC.
    pub pan_adc: u16,
    /// Tilt, raw ADC.
    pub tilt_adc: u16,
}

/// References of the DSP's controllers at this moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct References {
    /// Speed to the east, m/s. Wire step: 1 cm/s.
    pub x_speed_mps: f32,
    /// Speed to the north, m/s. Wire step: 1 cm/s.
    pub y_speed_mps: f32,
    /// Altitude, metres. Wire step: 1 mm.
    pub altitude_m: f64,
    /// Pitch, degrees. Wire step: 0.01 °.
    pub pitch_deg: f32,
    /// Roll, degrees. Wire step: 0.01 °.
    pub roll_deg: f32,
    /// Yaw, degrees. Wire step: 0.01 °.
    pub yaw_deg: f32,
}
