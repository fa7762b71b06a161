//! Messages from the DSP to the PC (`docs/protocol.md` section 4).

use crate::decoder::{Direction, Extent, Refusal, sealed};
use crate::error_code::DspErrorCode;
use crate::frame::{Frame, Reader, Writer};
use crate::header;
use crate::layout::Layout;
use crate::mask::{Group, StatusMask};
use crate::profile::{Profile, Sequence};

/// Bytes of a status' payload from which its mask, and so its length, can be read.
const STATUS_MASK_LEN: usize = 3;
/// The greatest code of a command, hence of an acknowledgement.
const MAX_COMMAND_CODE: u8 = 7;
/// The flying flag in the flags of a status.
const FLYING: u8 = 1;

/// One message from the DSP. Each variant carries only its own fields.
#[expect(
    clippy::large_enum_variant,
    reason = "most messages are a status, and a box would allocate for each"
)]
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
    /// The message as one frame of the classic profile.
    pub fn encode(&self) -> Frame {
        self.encode_in(Profile::Classic, Sequence::FIRST, Sequence::FIRST)
    }

    /// The message as one frame of `profile`, with its own number `sequence`. An acknowledgement also carries the number
    /// of the command that it `acknowledges`; other messages leave it out, and the classic profile both.
    pub fn encode_in(&self, profile: Profile, sequence: Sequence, acknowledges: Sequence) -> Frame {
        profile.encode(self, sequence, acknowledges)
    }
}

impl Direction for Downlink {}

impl sealed::Message for Downlink {
    const EXTENDED_HEADER: u8 = header::EXTENDED_DOWNLINK;

    fn header(&self) -> u8 {
        match self {
            Downlink::Status(_) => header::STATUS,
            Downlink::FlowControl(_) => header::FLOW_CONTROL,
            Downlink::Ack { .. } => header::ACK,
            Downlink::Ack16 { .. } => header::ACK_16,
            Downlink::Ack32 { .. } => header::ACK_32,
            Downlink::Error(_) => header::ERROR,
        }
    }

    fn write(&self, writer: &mut Writer) {
        match *self {
            Downlink::Status(ref status) => status.write(writer),
            Downlink::FlowControl(FlowControl::Stop) => writer.u7(0),
            Downlink::FlowControl(FlowControl::Send) => writer.u7(1),
            Downlink::Ack { command } => writer.u7(command),
            Downlink::Ack16 { command, value } => {
                writer.u7(command);
                writer.u16(value);
            }
            Downlink::Ack32 { command, value } => {
                writer.u7(command);
                writer.f32(value);
            }
            Downlink::Error(DspErrorCode(code)) => writer.u16(code),
        }
    }

    fn payload_extent(header: u8, payload: &[u8]) -> Extent {
        match (header, payload) {
            (header::STATUS, [high, middle, low, ..]) => {
                Extent::Exactly(mask_of([*high, *middle, *low]).status_payload_len())
            }
            (header::STATUS, _) => Extent::AtLeast(STATUS_MASK_LEN),
            (header::FLOW_CONTROL | header::ACK, _) => Extent::Exactly(1),
            (header::ERROR, _) => Extent::Exactly(3),
            (header::ACK_16, _) => Extent::Exactly(4),
            (header::ACK_32, _) => Extent::Exactly(6),
            _ => Extent::Unknown(Refusal::UnknownHeader),
        }
    }

    fn read(header: u8, mut reader: Reader<'_>) -> Result<Self, Refusal> {
        // The fields of a struct expression are evaluated in the order in which they are written: that of the wire.
        let message = match header {
            header::STATUS => return Status::parse(reader).map(Downlink::Status),
            header::FLOW_CONTROL => return FlowControl::parse(reader).map(Downlink::FlowControl),
            header::ACK => Downlink::Ack {
                command: reader.u7(),
            },
            header::ACK_16 => Downlink::Ack16 {
                command: reader.u7(),
                value: reader.u16(),
            },
            header::ACK_32 => Downlink::Ack32 {
                command: reader.u7(),
                value: reader.f32(),
            },
            header::ERROR => Downlink::Error(DspErrorCode(reader.u16())),
            _ => return Err(Refusal::UnknownHeader),
        };
        reader.finish()?;
        match message {
            Downlink::Ack { command }
            | Downlink::Ack16 { command, .. }
            | Downlink::Ack32 { command, .. }
                if command > MAX_COMMAND_CODE =>
            {
                Err(Refusal::Value)
            }
            _ => Ok(message),
        }
    }
}

/// The mask in the first bytes of a status' payload. Its unused bits do not count here: the length follows from the 16 bits of the
/// mask, and the frame is refused for its padding once its checksum is known to be right.
fn mask_of([high, middle, low]: [u8; 3]) -> StatusMask {
    StatusMask(u16::from(high) << 14 | u16::from(middle) << 7 | u16::from(low))
}

/// The DSP's request for waypoints (`peticion_de_tx`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlowControl {
    /// The path buffer is full.
    Stop,
    /// One new waypoint may be sent.
    Send,
}

impl FlowControl {
    fn parse(mut reader: Reader<'_>) -> Result<Self, Refusal> {
        let request = reader.u7();
        reader.finish()?;
        match request {
            0 => Ok(FlowControl::Stop),
            1 => Ok(FlowControl::Send),
            _ => Err(Refusal::Value),
        }
    }
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
        [
            (Group::Time, self.time_ms.is_some()),
            (Group::Geographic, self.geographic.is_some()),
            (Group::Xy, self.xy.is_some()),
            (Group::GpsVelocity, self.gps_velocity.is_some()),
            (Group::GpsQuality, self.gps_quality.is_some()),
            (Group::Attitude, self.attitude.is_some()),
            (Group::Acceleration, self.acceleration.is_some()),
            (Group::AngularRate, self.angular_rate.is_some()),
            (Group::PilotPwm, self.pilot_pwm.is_some()),
            (Group::Sonar, self.sonar_adc.is_some()),
            (Group::Supply, self.supply.is_some()),
            (Group::PanTilt, self.pan_tilt.is_some()),
            (Group::RotorSpeed, self.rotor_rpm.is_some()),
            (Group::Barometer, self.barometer_adc.is_some()),
            (Group::Actuation, self.actuation.is_some()),
            (Group::References, self.references.is_some()),
        ]
        .into_iter()
        .filter_map(|(group, carried)| carried.then_some(group))
        .collect()
    }

    /// Takes `groups` out of the message, as if they had not been sent.
    pub fn withdraw(&mut self, groups: StatusMask) {
        for group in groups.groups() {
            match group {
                Group::Time => self.time_ms = None,
                Group::Geographic => self.geographic = None,
                Group::Xy => self.xy = None,
                Group::GpsVelocity => self.gps_velocity = None,
                Group::GpsQuality => self.gps_quality = None,
                Group::Attitude => self.attitude = None,
                Group::Acceleration => self.acceleration = None,
                Group::AngularRate => self.angular_rate = None,
                Group::PilotPwm => self.pilot_pwm = None,
                Group::Sonar => self.sonar_adc = None,
                Group::Supply => self.supply = None,
                Group::PanTilt => self.pan_tilt = None,
                Group::RotorSpeed => self.rotor_rpm = None,
                Group::Barometer => self.barometer_adc = None,
                Group::Actuation => self.actuation = None,
                Group::References => self.references = None,
            }
        }
    }

    fn write(&self, writer: &mut Writer) {
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
        } = self;
        writer.u16(self.mask().0);
        writer.u7(if *flying { FLYING } else { 0 });
        if let Some(value) = time_ms {
            writer.u32(*value);
        }
        if let Some(value) = geographic {
            value.write(writer);
        }
        if let Some(value) = xy {
            value.write(writer);
        }
        if let Some(value) = gps_velocity {
            value.write(writer);
        }
        if let Some(value) = gps_quality {
            writer.u7(*value);
        }
        if let Some(value) = attitude {
            value.write(writer);
        }
        if let Some(value) = acceleration {
            value.write(writer);
        }
        if let Some(value) = angular_rate {
            value.write(writer);
        }
        if let Some(value) = pilot_pwm {
            value.write(writer);
        }
        if let Some(value) = sonar_adc {
            writer.u14(*value);
        }
        if let Some(value) = supply {
            value.write(writer);
        }
        if let Some(value) = pan_tilt {
            value.write(writer);
        }
        if let Some(value) = rotor_rpm {
            writer.u14(*value);
        }
        if let Some(value) = barometer_adc {
            writer.u14(*value);
        }
        if let Some(value) = actuation {
            value.write(writer);
        }
        if let Some(value) = references {
            value.write(writer);
        }
    }

    fn parse(mut reader: Reader<'_>) -> Result<Self, Refusal> {
        let mask = StatusMask(reader.u16());
        let flags = reader.u7();
        let carries = |group| mask.contains(group);
        // The fields of a struct expression are evaluated in the order in which they are written: that of the wire.
        let status = Status {
            flying: flags == FLYING,
            time_ms: carries(Group::Time).then(|| reader.u32()),
            geographic: carries(Group::Geographic).then(|| Layout::read(&mut reader)),
            xy: carries(Group::Xy).then(|| Layout::read(&mut reader)),
            gps_velocity: carries(Group::GpsVelocity).then(|| Layout::read(&mut reader)),
            gps_quality: carries(Group::GpsQuality).then(|| reader.u7()),
            attitude: carries(Group::Attitude).then(|| Layout::read(&mut reader)),
            acceleration: carries(Group::Acceleration).then(|| Layout::read(&mut reader)),
            angular_rate: carries(Group::AngularRate).then(|| Layout::read(&mut reader)),
            pilot_pwm: carries(Group::PilotPwm).then(|| Layout::read(&mut reader)),
            sonar_adc: carries(Group::Sonar).then(|| reader.u14()),
            supply: carries(Group::Supply).then(|| Layout::read(&mut reader)),
            pan_tilt: carries(Group::PanTilt).then(|| Layout::read(&mut reader)),
            rotor_rpm: carries(Group::RotorSpeed).then(|| reader.u14()),
            barometer_adc: carries(Group::Barometer).then(|| reader.u14()),
            actuation: carries(Group::Actuation).then(|| Layout::read(&mut reader)),
            references: carries(Group::References).then(|| Layout::read(&mut reader)),
        };
        reader.finish()?;
        if flags & !FLYING != 0 {
            return Err(Refusal::Value);
        }
        Ok(status)
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
