//! The bridge's core with an operator who asks for anything, and checks of what it says.

use std::time::Duration;

use bridge::{Bridge, BridgeConfig, Input, Outputs, RequestKey};
use dsp_protocol::Profile;
use ipc_types::MonotonicNs;
use ipc_types::code::{ControlCommand, MovementKind};
use ipc_types::payload::{DspTelemetry, ModuleControl, ModuleState, MovementData, RequestReport};

use super::obliging::Obliging;
use crate::plausible::assert_plausible;

/// Requests that may be open at once: a path of 64 waypoints, the movement under way, a stop and one being asked.
const MOST_OPEN: usize = 67;

/// Bytes of the DSP that may wait for the bridge; more are lost, as on a line that nobody reads. What answers one write
/// of the bridge's, which has at most 512 bytes, is less than that again.
const MOST_SAID: usize = 4096;

/// What is said is checked and forgotten.
struct Listener {
    /// Requests without a final report.
    open: Vec<RequestKey>,
    samples: u64,
    final_reports: u64,
}

impl Outputs for Listener {
    fn notice(&mut self, _: &bridge::outputs::Notice) {}

    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        assert_plausible(&sample);
        self.samples += 1;
    }

    fn state(&mut self, state: &ModuleState) {
        assert!(state.status().is_some() && state.functionality().is_some());
        assert!(state.movement.distance_to_go_m.is_finite());
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        let place = self.open.iter().position(|key| *key == to);
        let Some(place) = place else {
            panic!("a word after the final one, or to nobody: {report:?}");
        };
        if report.is_final() {
            self.open.swap_remove(place);
            self.final_reports += 1;
        }
    }
}

/// The bridge's core, an operator who asks for anything, and checks of what the core says.
pub struct Core {
    bridge: Bridge,
    listener: Listener,
    dsp: Obliging,
    now: MonotonicNs,
    requests: u64,
    /// What the DSP has said and the bridge not heard yet.
    said: Vec<u8>,
}

/// What has happened so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heard {
    /// Samples of telemetry.
    pub samples: u64,
    /// Waypoints that went to the DSP.
    pub waypoints: u64,
    /// Requests, each with one final report or still open.
    pub requests: u64,
}

impl Core {
    /// A bridge whose port is open and a DSP that has just booted.
    pub fn new(profile: Profile) -> Core {
        let mut config = BridgeConfig::default();
        config.link.profile = profile;
        let mut core = Core {
            bridge: Bridge::new(&config),
            listener: Listener {
                open: Vec::with_capacity(MOST_OPEN),
                samples: 0,
                final_reports: 0,
            },
            dsp: Obliging::new(profile),
            now: MonotonicNs(1_000_000_000),
            requests: 0,
            said: Vec::with_capacity(2 * MOST_SAID),
        };
        core.bridge.apply(
            core.now,
            Input::PortOpened(Default::default()),
            &mut core.listener,
        );
        core
    }

    /// Gives the bridge bytes as they are, and lets the DSP hear the answers.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.bridge
            .apply(self.now, Input::Received(bytes), &mut self.listener);
        self.transmit();
    }

    /// Lets time pass.
    pub fn advance(&mut self, time: Duration) {
        self.now = self.now + time;
        self.bridge
            .apply(self.now, Input::Advance, &mut self.listener);
        assert!(
            self.bridge.deadline() > self.now,
            "a deadline that was handled is over"
        );
        self.transmit();
    }

    /// What the DSP says in its next period, behind what it has answered. The bridge has not heard it yet.
    pub fn listen(&mut self, line: &mut Vec<u8>) {
        self.dsp.tick(&mut self.said);
        line.append(&mut self.said);
    }

    /// Does something that a byte chooses, with a value for what is needed.
    pub fn act(&mut self, choice: u8, value: u64) {
        let (now, out) = (self.now, &mut self.listener);
        match choice % 32 {
            0..=2 => self.control(ControlCommand::Start.code(), value),
            3 => self.control(ControlCommand::Stop.code(), value),
            4..=6 => self.movement(MovementData {
                issued_ns: 0,
                ..MovementData::take_off(0, (value % 50) as f64)
            }),
            7 => self.movement(MovementData {
                issued_ns: 0,
                ..MovementData::land(0)
            }),
            8..=10 => self.path(1 + (value % 12) as usize, value),
            11 => self.path(70, value),
            12..=15 => self.waypoint(value & 1 != 0, value & 2 != 0, value),
            16 => self.bridge.apply(now, Input::PortClosed, out),
            17 | 18 => self
                .bridge
                .apply(now, Input::PortOpened(Default::default()), out),
            19 => self.dsp.reboot(),
            20 => {
                let key = RequestKey::Movement(self.requests.saturating_sub(value % 64));
                self.bridge.apply(now, Input::SenderGone(key), out);
            }
            21 => self.any_movement(value),
            22 => self.control(value as u32, value >> 32),
            23 => self.advance(Duration::from_millis(value % 100_000)),
            _ => self.advance(Duration::from_micros(value % 1_000_000)),
        }
        self.transmit();
    }

    /// The bridge ends: every request must have had its final report.
    pub fn finish(mut self) -> Heard {
        let heard = self.heard();
        self.bridge
            .apply(self.now, Input::Close, &mut self.listener);
        assert_eq!(self.listener.open, [], "without a final report");
        assert_eq!(self.listener.final_reports, self.requests);
        heard
    }

    /// What has happened so far.
    pub fn heard(&self) -> Heard {
        Heard {
            samples: self.listener.samples,
            waypoints: u64::from(self.bridge.state().link.waypoints_sent),
            requests: self.requests,
        }
    }

    fn transmit(&mut self) {
        self.bridge.take_discard_unsent();
        let bytes = self.bridge.transmit(self.now);
        let count = bytes.len();
        self.dsp.hear(bytes, &mut self.said);
        let taken = Input::Transmitted(count);
        self.bridge.apply(self.now, taken, &mut self.listener);
        // A DSP that nobody listens to says nothing more.
        self.said.truncate(MOST_SAID);
    }

    fn next_key(&mut self) -> u64 {
        assert!(self.listener.open.len() < MOST_OPEN, "requests pile up");
        self.requests += 1;
        self.requests
    }

    fn control(&mut self, command: u32, value: u64) {
        let key = self.next_key();
        let request = ModuleControl {
            request_id: key,
            issued_ns: self.now.0,
            begin_by_ns: self.now.0 + value % 5000 * 1_000_000,
            command,
            ..ModuleControl::default()
        };
        let key = RequestKey::Control(key);
        self.listener.open.push(key);
        let input = Input::Control {
            key,
            sender: bridge::Sender::default(),
            request,
        };
        self.bridge.apply(self.now, input, &mut self.listener);
    }

    fn movement(&mut self, request: MovementData) {
        let key = self.next_key();
        let request_id = if request.request_id == 0 {
            key
        } else {
            request.request_id
        };
        let request = MovementData {
            request_id,
            issued_ns: self.now.0.saturating_sub(request.issued_ns),
            ..request
        };
        let key = RequestKey::Movement(key);
        self.listener.open.push(key);
        let input = Input::Movement {
            key,
            sender: bridge::Sender::default(),
            request,
        };
        self.bridge.apply(self.now, input, &mut self.listener);
    }

    /// A point within some metres of where the DSP is, of the one path that is ever built.
    fn waypoint(&mut self, first: bool, last: bool, value: u64) {
        let position = self.dsp.position();
        let away = |bits: u64| (bits % 64) as f64 * 1e-6 - 3e-5;
        self.movement(MovementData {
            path_id: 1,
            kind: MovementKind::GoToWaypoint.code(),
            latitude_deg: position.latitude_deg + away(value >> 8),
            longitude_deg: position.longitude_deg + away(value >> 16),
            altitude_m: 20.0 + ((value >> 24) % 16) as f64,
            first: first.into(),
            last: last.into(),
            ..MovementData::default()
        });
    }

    fn path(&mut self, count: usize, value: u64) {
        for index in 0..count {
            let (first, last) = (index == 0, index + 1 == count);
            self.waypoint(first, last, value.rotate_left(8 * index as u32));
        }
    }

    /// A request with any bits in it.
    fn any_movement(&mut self, value: u64) {
        self.movement(MovementData {
            request_id: value >> 40,
            path_id: value & 3,
            kind: (value >> 8) as u32 & 7,
            latitude_deg: f64::from_bits(value.rotate_left(17)),
            longitude_deg: f64::from_bits(value.rotate_left(31)),
            altitude_m: f64::from_bits(value.rotate_left(47)),
            first: (value >> 3) as u16 & 3,
            last: (value >> 5) as u16 & 3,
            issued_ns: (value >> 21) & 0xFFFF_FFFF,
            begin_by_ns: self.now.0 + ((value >> 20) & 0xFFFF_FFFF),
            issued_within_ns: (value >> 9) as u32,
            origin: (value >> 13) as u32 & 3,
            repeat: (value >> 7) as u16 & 3,
            preempt: (value >> 11) as u16 & 3,
            after: (value >> 15) & 3,
            lease_ms: 0,
            sender_lost: (value >> 27) as u32 & 3,
            reserved: 0,
        });
    }
}
