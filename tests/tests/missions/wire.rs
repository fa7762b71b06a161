//! The wire between bridge and DSP, as somebody with a probe sees it: what is said, checked against what may be said,
//! and what the wire does to it.

use std::collections::VecDeque;
use std::time::Duration;

use dsp_protocol::{Command, Decoded, Decoder, Downlink, FlowControl, Profile, Uplink, Waypoint};
use dsp_sim::random::Random;

/// Attempts of a command (requirement D2).
const ATTEMPTS: u32 = 3;

/// How far a waypoint on the wire may be from the one that was asked for, m (requirement C5).
const CODING_ERROR_M: f64 = 0.01;

/// Metres of a degree, rounded up.
const DEGREE_M: f64 = 111_700.0;

/// The waypoints that may be sent: those of the path that was closed last.
#[derive(Debug, Default)]
pub struct Allowed {
    /// Waypoints that have not been sent.
    waypoints: VecDeque<Waypoint>,
    /// The waypoint that was sent last: when it was lost it is sent again.
    sent: Option<Waypoint>,
}

/// Listens to both directions before the wire damages anything.
pub struct Probe {
    profile: Profile,
    uplink: Decoder<Uplink>,
    downlink: Decoder<Downlink>,
    allowed: Allowed,
    /// The command without an acknowledgement, and how often it was sent.
    outstanding: Option<(Command, u32)>,
    /// Grants that no waypoint has used.
    grants: u32,
    pub commands: Vec<Command>,
    /// How often *invalidate path* was sent.
    pub path_emptyings: usize,
    /// Paths of which the first waypoint was sent.
    pub paths: usize,
    pub waypoints: usize,
    /// Waypoints that had been sent before.
    pub repeated_waypoints: u64,
    /// How often flow control said stop.
    pub stops: u32,
    /// Whether every message arrives: then acknowledgements and grants can be counted.
    is_sound: bool,
    /// Whether points may be sent that lie on the way to a waypoint.
    divides_legs: bool,
}

impl Probe {
    pub fn new(profile: Profile, is_sound: bool) -> Probe {
        Probe {
            profile,
            uplink: Decoder::with_profile(profile),
            downlink: Decoder::with_profile(profile),
            allowed: Allowed::default(),
            outstanding: None,
            grants: 0,
            commands: Vec::new(),
            path_emptyings: 0,
            paths: 0,
            waypoints: 0,
            repeated_waypoints: 0,
            stops: 0,
            is_sound,
            divides_legs: false,
        }
    }

    /// Points may be sent that lie on the straight way to the next waypoint.
    pub fn allow_divided_legs(&mut self) {
        self.divides_legs = true;
    }

    /// A path is being closed: from now on its waypoints may be sent, and no others. Returns what might be sent until
    /// now.
    pub fn path_closes(&mut self, path: &[Waypoint]) -> Allowed {
        let allowed = Allowed {
            waypoints: path.iter().copied().collect(),
            sent: None,
        };
        std::mem::replace(&mut self.allowed, allowed)
    }

    /// The path was not closed: what might be sent before still may.
    pub fn path_goes_on(&mut self, allowed: Allowed) {
        self.allowed = allowed;
    }

    /// The port was closed: whatever was outstanding is not any more.
    pub fn interrupted(&mut self) {
        self.outstanding = None;
        self.grants = 0;
        self.uplink = Decoder::with_profile(self.profile);
    }

    /// Bytes from the bridge.
    pub fn hear_bridge(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let (used, decoded) = self.uplink.decode(bytes);
            bytes = &bytes[used..];
            match decoded {
                Decoded::Message(Uplink::Command(command)) => self.command(command),
                Decoded::Message(Uplink::Waypoint(waypoint)) => self.waypoint(&waypoint),
                Decoded::Incomplete => {}
                Decoded::Rejected(error) => panic!("the bridge sent bytes that are {error:?}"),
            }
        }
    }

    /// Bytes from the DSP.
    pub fn hear_dsp(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let (used, decoded) = self.downlink.decode(bytes);
            bytes = &bytes[used..];
            match decoded {
                Decoded::Message(
                    Downlink::Ack { command }
                    | Downlink::Ack16 { command, .. }
                    | Downlink::Ack32 { command, .. },
                ) if self
                    .outstanding
                    .is_some_and(|(sent, _)| sent.code() == command) =>
                {
                    self.outstanding = None;
                }
                Decoded::Message(Downlink::FlowControl(FlowControl::Send)) => self.grants += 1,
                Decoded::Message(Downlink::FlowControl(FlowControl::Stop)) => self.stops += 1,
                _ => {}
            }
        }
    }

    fn command(&mut self, command: Command) {
        self.commands.push(command);
        self.path_emptyings += usize::from(command == Command::InvalidatePath);
        if !self.is_sound {
            return;
        }
        let attempts = match self.outstanding {
            None => 1,
            Some((sent, attempts)) if sent == command => attempts + 1,
            Some((sent, _)) => panic!("{command:?} was sent while {sent:?} was outstanding"),
        };
        assert!(
            attempts <= ATTEMPTS,
            "{command:?} was sent {attempts} times"
        );
        self.outstanding = Some((command, attempts));
    }

    fn waypoint(&mut self, sent: &Waypoint) {
        self.waypoints += 1;
        if self.is_sound {
            assert!(self.grants > 0, "{sent:?} was sent without a grant");
        }
        self.grants = self.grants.saturating_sub(1);
        let is_repeated = self.allowed.sent == Some(*sent);
        if is_repeated && !self.is_sound {
            self.repeated_waypoints += 1;
            return;
        }
        self.paths += usize::from(self.allowed.sent.is_none());
        let before = self.allowed.sent.replace(*sent);
        let Some(asked) = self.allowed.waypoints.front() else {
            panic!("{sent:?} was sent, which is not of a closed path");
        };
        let error_m = distance_m(sent, asked);
        if error_m <= CODING_ERROR_M {
            self.allowed.waypoints.pop_front();
            return;
        }
        // Where the first leg begins is known to nobody here.
        let detour_m = before.map_or(0.0, |before| {
            distance_m(&before, sent) + error_m - distance_m(&before, asked)
        });
        assert!(
            self.divides_legs && detour_m <= CODING_ERROR_M,
            "{sent:?} instead of {asked:?}"
        );
    }
}

/// Metres between two waypoints that lie near each other.
fn distance_m(a: &Waypoint, b: &Waypoint) -> f64 {
    let longitude_deg = a.longitude_deg - b.longitude_deg;
    let east_m = longitude_deg * DEGREE_M * b.latitude_deg.to_radians().cos();
    let north_m = (a.latitude_deg - b.latitude_deg) * DEGREE_M;
    east_m.hypot(north_m).hypot(a.altitude_m - b.altitude_m)
}

/// A wire that damages bytes for some time.
pub struct Noise {
    random: Random,
    until: Duration,
    rate: f64,
}

impl Noise {
    /// A wire that damages nothing yet.
    pub fn new(seed: u64, stream: u64) -> Noise {
        Noise {
            random: Random::new(seed, stream),
            until: Duration::ZERO,
            rate: 0.0,
        }
    }

    /// Damages this share of all bytes from now until `until`.
    pub fn begin(&mut self, rate: f64, until: Duration) {
        self.rate = rate;
        self.until = until;
    }

    /// Whether nothing is damaged at `now`.
    pub fn is_over(&self, now: Duration) -> bool {
        now >= self.until
    }

    /// What becomes of `bytes` at `now`: flipped bits, other bytes, lost and repeated ones.
    pub fn damage(&mut self, now: Duration, bytes: &mut Vec<u8>) {
        if now >= self.until {
            return;
        }
        let mut damaged = Vec::with_capacity(bytes.len());
        for byte in bytes.iter() {
            if self.random.uniform() >= self.rate {
                damaged.push(*byte);
                continue;
            }
            let bits = self.random.next_u64();
            match bits & 7 {
                0 => {}
                1 => damaged.extend([*byte, *byte]),
                2 => damaged.push((bits >> 8) as u8),
                _ => damaged.push(byte ^ (1 << ((bits >> 8) & 7))),
            }
        }
        *bytes = damaged;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missions::witness::assert_panics;

    const NORTH: Waypoint = Waypoint {
        latitude_deg: 37.0,
        longitude_deg: -6.0,
        altitude_m: 10.0,
    };

    fn granted(probe: &mut Probe) {
        let grant = Downlink::FlowControl(FlowControl::Send).encode();
        probe.hear_dsp(grant.as_bytes());
    }

    fn sends(probe: &mut Probe, message: Uplink) {
        probe.hear_bridge(message.encode().as_bytes());
    }

    #[test]
    fn what_is_not_allowed_is_noticed() {
        let waypoint = |probe: &mut Probe, latitude_deg| {
            let waypoint = Waypoint {
                latitude_deg,
                ..NORTH
            };
            sends(probe, Uplink::Waypoint(waypoint));
        };
        let command = |probe: &mut Probe, command| sends(probe, Uplink::Command(command));
        type Case<'a> = (&'a str, &'a dyn Fn(&mut Probe));
        let cases: [Case; 5] = [
            ("not of a closed path", &|probe| {
                granted(probe);
                waypoint(probe, 37.0);
            }),
            ("instead of", &|probe| {
                probe.path_closes(&[NORTH]);
                granted(probe);
                // Two centimetres off.
                waypoint(probe, 37.0 + 2e-7);
            }),
            ("without a grant", &|probe| {
                probe.path_closes(&[NORTH, NORTH]);
                granted(probe);
                waypoint(probe, 37.0);
                waypoint(probe, 37.0);
            }),
            ("while ClearErrors was outstanding", &|probe| {
                command(probe, Command::ClearErrors);
                command(probe, Command::InvalidatePath);
            }),
            ("was sent 4 times", &|probe| {
                (0..4).for_each(|_| command(probe, Command::ClearErrors));
            }),
        ];
        for (expected, act) in cases {
            let mut probe = Probe::new(Profile::Classic, true);
            assert_panics(expected, || act(&mut probe));
        }
    }

    #[test]
    fn a_point_on_the_way_to_a_waypoint_passes_where_legs_are_divided() {
        let at = |latitude_deg| Waypoint {
            latitude_deg,
            ..NORTH
        };
        let mut probe = Probe::new(Profile::Classic, true);
        probe.allow_divided_legs();
        probe.path_closes(&[NORTH, at(37.001)]);
        for waypoint in [NORTH, at(37.0004), at(37.001)] {
            granted(&mut probe);
            sends(&mut probe, Uplink::Waypoint(waypoint));
        }
        assert_eq!((probe.paths, probe.waypoints), (1, 3));
    }

    #[test]
    fn what_is_allowed_passes() {
        let mut probe = Probe::new(Profile::Classic, true);
        for command in [Command::ClearErrors, Command::ClearErrors] {
            sends(&mut probe, Uplink::Command(command));
        }
        let code = Command::ClearErrors.code();
        probe.hear_dsp(Downlink::Ack { command: code }.encode().as_bytes());
        sends(&mut probe, Uplink::Command(Command::InvalidatePath));
        probe.path_closes(&[NORTH]);
        granted(&mut probe);
        sends(&mut probe, Uplink::Waypoint(NORTH));
        assert_eq!((probe.commands.len(), probe.waypoints), (3, 1));
    }

    #[test]
    fn noise_damages_three_of_ten_bytes_and_ends() {
        let mut noise = Noise::new(1, 1);
        let end = Duration::from_secs(1);
        noise.begin(0.3, end);
        let sent = vec![0x55; 10_000];
        let mut heard = sent.clone();
        noise.damage(Duration::ZERO, &mut heard);
        let sound = heard.iter().filter(|byte| **byte == 0x55).count();
        // Seven of ten are left alone, and one of eight damaged ones comes twice.
        assert!((7_300..8_300).contains(&sound), "{sound}");
        let mut heard = sent.clone();
        noise.damage(end, &mut heard);
        assert_eq!(heard, sent);
    }
}
