//! A DSP that does at once whatever it is told: the quickest way to get the bridge through a flight.

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{
    Command, Decoded, Decoder, Downlink, FlowControl, Profile, Sequence, Status, Uplink, port,
};

/// Where it stands at first.
pub const HOME: Geographic = Geographic {
    latitude_deg: 37.4,
    longitude_deg: -6.0,
    altitude_m: 10.0,
};

/// Every so many statuses there is a flow control.
const FLOW_CONTROL_EACH: u32 = 5;
/// Milliseconds between two statuses.
pub const STATUS_PERIOD_MS: u32 = 20;

/// A DSP that does at once whatever it is told.
pub struct Obliging {
    profile: Profile,
    decoder: Decoder<Uplink>,
    number: Sequence,
    mask: u16,
    is_active: bool,
    taken: u16,
    climb_m: f32,
    time_ms: u32,
    flying: bool,
    position: Geographic,
}

impl Obliging {
    /// A DSP that has just booted.
    pub fn new(profile: Profile) -> Obliging {
        Obliging {
            profile,
            decoder: Decoder::with_profile(profile),
            number: Sequence::FIRST,
            mask: 0,
            is_active: false,
            taken: 0,
            climb_m: 10.0,
            time_ms: 0,
            flying: false,
            position: HOME,
        }
    }

    /// Boots again, wherever it is.
    pub fn reboot(&mut self) {
        *self = Obliging {
            position: self.position,
            flying: self.flying,
            ..Obliging::new(self.profile)
        };
    }

    /// Where it is.
    pub fn position(&self) -> Geographic {
        self.position
    }

    /// Does what `bytes` say, and puts its answers behind `out`.
    pub fn hear(&mut self, mut bytes: &[u8], out: &mut Vec<u8>) {
        while !bytes.is_empty() {
            let (used, decoded) = self.decoder.receive(bytes);
            bytes = &bytes[used..];
            let Decoded::Message(received) = decoded else {
                assert_eq!(decoded, Decoded::Incomplete, "the bridge sends no nonsense");
                continue;
            };
            match received.message {
                Uplink::Waypoint(waypoint) => {
                    self.taken = self.taken.wrapping_add(1);
                    self.position = Geographic {
                        latitude_deg: waypoint.latitude_deg,
                        longitude_deg: waypoint.longitude_deg,
                        altitude_m: waypoint.altitude_m,
                    };
                }
                Uplink::Command(command) => {
                    let answer = self.obey(command);
                    self.say(&answer, received.sequence.unwrap_or_default(), out);
                }
            }
        }
    }

    /// What it says in one status period.
    pub fn tick(&mut self, out: &mut Vec<u8>) {
        self.time_ms = self.time_ms.wrapping_add(STATUS_PERIOD_MS);
        if !self.is_active {
            return;
        }
        let status = Status {
            flying: self.flying,
            time_ms: Some(self.time_ms),
            geographic: Some(self.position),
            ..Status::default()
        };
        self.say(&Downlink::Status(status), Sequence::FIRST, out);
        if (self.time_ms / STATUS_PERIOD_MS).is_multiple_of(FLOW_CONTROL_EACH) {
            let request = if self.flying {
                FlowControl::Send
            } else {
                FlowControl::Stop
            };
            self.say(&Downlink::FlowControl(request), Sequence::FIRST, out);
        }
    }

    fn obey(&mut self, command: Command) -> Downlink {
        match command {
            Command::Read16 { port } => {
                return Downlink::Ack16 {
                    command: command.code(),
                    value: self.read(port),
                };
            }
            Command::Read32 { .. } => {
                return Downlink::Ack32 {
                    command: command.code(),
                    value: self.climb_m,
                };
            }
            Command::Write16 {
                port: port::STATUS_MASK,
                value,
            } => self.mask = value,
            Command::Write16 {
                port: port::TAKE_OFF,
                ..
            } if !self.flying => {
                self.flying = true;
                self.position.altitude_m += f64::from(self.climb_m);
            }
            Command::Write16 {
                port: port::LAND, ..
            } => {
                self.flying = false;
                self.position.altitude_m = HOME.altitude_m;
            }
            Command::Write32 {
                port: port::TAKE_OFF_ALTITUDE_M,
                value,
            } => self.climb_m = value,
            Command::ActivateStatus => self.is_active = true,
            _ => {}
        }
        Downlink::Ack {
            command: command.code(),
        }
    }

    fn read(&self, port: u16) -> u16 {
        match port {
            port::STATUS_MASK => self.mask,
            port::WAYPOINT_COUNT => 0x8000 | self.taken,
            port::TAKE_OFF | port::LAND => 1,
            _ => 0,
        }
    }

    fn say(&mut self, message: &Downlink, acknowledges: Sequence, out: &mut Vec<u8>) {
        let number = self.number;
        self.number = number.next();
        let frame = message.encode_in(self.profile, number, acknowledges);
        out.extend_from_slice(frame.as_bytes());
    }
}
