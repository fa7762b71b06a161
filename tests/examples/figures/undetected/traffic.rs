//! What is on the line before it is damaged: messages of every kind with plausible values.

use std::fmt::Debug;

use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Supply, Xy,
};
use dsp_protocol::{
    Command, Direction, Downlink, DspErrorCode, FlowControl, Frame, Profile, Sequence, Status,
    StatusMask, Uplink, Waypoint,
};
use fastrand::Rng;

/// A direction whose messages can be made up.
pub trait Traffic: Direction + Copy + Debug + PartialEq {
    /// A message as it may be sent.
    fn random(random: &mut Rng) -> Self;

    /// The message as a frame, under random numbers.
    fn frame(&self, profile: Profile, random: &mut Rng) -> Frame;

    /// Whether section 9 of `docs/protocol.md` forbids one of its values.
    fn is_implausible(&self) -> bool;
}

impl Traffic for Downlink {
    fn random(random: &mut Rng) -> Self {
        let command = random.u8(..8);
        match random.usize(..10) {
            // Half of a line is status, in the usual mask, in all groups and in others.
            0..5 => Downlink::Status(status(random)),
            5 => Downlink::FlowControl(FlowControl::Send),
            6 => Downlink::Ack { command },
            7 => Downlink::Ack16 {
                command: 0,
                value: random.u16(..),
            },
            8 => Downlink::Ack32 {
                command: 2,
                value: random.i32(-1000..=1000) as f32 / 10.0,
            },
            _ => Downlink::Error(DspErrorCode(random.u16(..301))),
        }
    }

    fn frame(&self, profile: Profile, random: &mut Rng) -> Frame {
        let mut number = || Sequence::new(random.u8(..));
        self.encode_in(profile, number(), number())
    }

    fn is_implausible(&self) -> bool {
        match self {
            Downlink::Status(status) => status.implausible_groups() != StatusMask::NONE,
            _ => false,
        }
    }
}

impl Traffic for Uplink {
    fn random(random: &mut Rng) -> Self {
        let port = random
            .choice([10_000, 10_003, 10_121, 10_122, 20_000, 20_012])
            .unwrap();
        Uplink::Command(match random.usize(..16) {
            0 => Command::Read16 { port },
            1 => Command::Write16 {
                port,
                value: random.u16(..),
            },
            2 => Command::Read32 { port },
            3 => Command::Write32 {
                port,
                value: random.i32(1..=200) as f32 / 10.0,
            },
            4 => Command::ClearErrors,
            5 => Command::ActivateStatus,
            6 => Command::InvalidatePath,
            7 => Command::Following { on: random.bool() },
            _ => {
                let place = geographic(random);
                return Uplink::Waypoint(Waypoint {
                    latitude_deg: place.latitude_deg,
                    longitude_deg: place.longitude_deg,
                    altitude_m: place.altitude_m,
                });
            }
        })
    }

    fn frame(&self, profile: Profile, random: &mut Rng) -> Frame {
        self.encode_in(profile, Sequence::new(random.u8(..)))
    }

    fn is_implausible(&self) -> bool {
        match self {
            Uplink::Command(_) => false,
            // A waypoint has the limits of a geographic position.
            Uplink::Waypoint(waypoint) => {
                let status = Status {
                    geographic: Some(Geographic {
                        latitude_deg: waypoint.latitude_deg,
                        longitude_deg: waypoint.longitude_deg,
                        altitude_m: waypoint.altitude_m,
                    }),
                    ..Status::default()
                };
                status.implausible_groups() != StatusMask::NONE
            }
        }
    }
}

/// Time, both positions, velocity, quality, the IMU, supply and rotor speed: what a mission asks for.
const USUAL_MASK: StatusMask = StatusMask(0x14FF);

fn status(random: &mut Rng) -> Status {
    let mut status = every_group(random);
    let mask = match random.usize(..4) {
        0 => StatusMask::ALL,
        1 => StatusMask(random.u16(..)),
        _ => USUAL_MASK,
    };
    status.withdraw(StatusMask(!mask.0));
    status
}

fn geographic(random: &mut Rng) -> Geographic {
    Geographic {
        latitude_deg: f64::from(random.i32(-850_000_000..=850_000_000)) / 1e7,
        longitude_deg: f64::from(random.i32(-1_800_000_000..=1_800_000_000)) / 1e7,
        altitude_m: f64::from(random.i32(0..=1_000_000)) / 1e3,
    }
}

fn pulses(random: &mut Rng) -> ServoPulses {
    let mut pulse = || random.u16(900..=2100);
    ServoPulses {
        collective_us: pulse(),
        roll_us: pulse(),
        pitch_us: pulse(),
        tail_us: pulse(),
        throttle_us: pulse(),
    }
}

/// A helicopter in flight, somewhere.
fn every_group(random: &mut Rng) -> Status {
    let mut hundredths = |limit: i32| random.i32(-limit..=limit) as f32 / 100.0;
    let attitude = Attitude {
        pitch_deg: hundredths(3_000),
        roll_deg: hundredths(3_000),
        yaw_deg: hundredths(18_000),
    };
    let acceleration = Acceleration {
        x_mps2: hundredths(300),
        y_mps2: hundredths(300),
        z_mps2: hundredths(300) - 9.81,
    };
    let references = References {
        x_speed_mps: hundredths(500),
        y_speed_mps: hundredths(500),
        altitude_m: f64::from(hundredths(10_000)),
        pitch_deg: hundredths(3_000),
        roll_deg: hundredths(3_000),
        yaw_deg: hundredths(18_000),
    };
    let gps_velocity = GpsVelocity {
        horizontal_speed_mps: hundredths(2_000).abs(),
        vertical_speed_mps: hundredths(500),
        heading_deg: hundredths(18_000) + 180.0,
    };
    let mut thousandths = |limit: i32| random.i32(-limit..=limit) as f32 / 1000.0;
    let angular_rate = AngularRate {
        x_radps: thousandths(2_000),
        y_radps: thousandths(2_000),
        z_radps: thousandths(2_000),
    };
    let mut adc = || random.u16(..4096);
    let (sonar_adc, barometer_adc) = (adc(), adc());
    let pan_tilt = PanTilt {
        pan_adc: adc(),
        tilt_adc: adc(),
    };
    Status {
        flying: true,
        time_ms: Some(random.u32(..) >> 8),
        geographic: Some(geographic(random)),
        xy: Some(Xy {
            x_m: f64::from(random.i32(-2_000_000..=2_000_000)) / 1e3,
            y_m: f64::from(random.i32(-2_000_000..=2_000_000)) / 1e3,
        }),
        gps_velocity: Some(gps_velocity),
        gps_quality: Some(random.u8(..6)),
        attitude: Some(attitude),
        acceleration: Some(acceleration),
        angular_rate: Some(angular_rate),
        pilot_pwm: Some(pulses(random)),
        sonar_adc: Some(sonar_adc),
        supply: Some(Supply {
            battery_mv: random.u16(20_000..=26_000),
            fuel_percent: random.u8(..101),
            auto_switch: random.u8(..2),
        }),
        pan_tilt: Some(pan_tilt),
        rotor_rpm: Some(random.u16(1_300..=1_600)),
        barometer_adc: Some(barometer_adc),
        actuation: Some(pulses(random)),
        references: Some(references),
    }
}
