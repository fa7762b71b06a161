//! What goes wrong in a world besides the simulator's script of faults, and when.

use std::time::Duration;

use bridge::Input;
use bridge::geodesy::{here, there};
use bridge::link::commands::ATTEMPTS;
use dsp_protocol::{Decoded, Decoder, Uplink};
use dsp_sim::helicopter::geodesy::LocalFrame;
use dsp_sim::helicopter::vector::Vector;

use super::{REOPENING, World, host};

/// Something that goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trouble {
    /// The DSP boots again.
    Reboot,
    /// The port goes and comes back after this time.
    PortGone(Duration),
    /// The bridge's process is killed, and started again after this time.
    BridgeDies(Duration),
    /// The bridge's process is asked to end, does so in order, and is started again after this time.
    BridgeEnds(Duration),
    /// Three of ten bytes are damaged in both directions for this time.
    Noise(Duration),
    /// One of a hundred is.
    FaintNoise(Duration),
}

/// A DSP that flies beside where it is told to, as one with a wrong frame of reference.
pub struct Beside {
    by_m: Vector,
    decoder: Decoder<Uplink>,
}

impl Beside {
    /// By so many metres to the east, to the north and up.
    pub fn new(by_m: Vector) -> Beside {
        Beside {
            by_m,
            decoder: Decoder::new(),
        }
    }

    /// What the DSP takes for what was said to it, in the classic profile.
    pub(super) fn bend(&mut self, bytes: &[u8], frame: &LocalFrame) -> Vec<u8> {
        let (mut rest, mut bent) = (bytes, Vec::new());
        while !rest.is_empty() {
            let (used, decoded) = self.decoder.receive(rest);
            rest = &rest[used..];
            let Decoded::Message(received) = decoded else {
                continue;
            };
            let message = match received.message {
                Uplink::Waypoint(waypoint) => {
                    let there = frame.to_flat(there(&waypoint)) + self.by_m;
                    Uplink::Waypoint(here(&frame.to_geographic(there)))
                }
                command => command,
            };
            bent.extend_from_slice(message.encode().as_bytes());
        }
        bent
    }
}

/// A trouble that waits for its moment.
pub(super) struct Plan {
    when: fn(&World) -> bool,
    trouble: Trouble,
}

/// A bridge that was asked to end.
#[derive(Clone, Copy)]
pub(super) struct Ending {
    /// When it ends, whether the DSP's path buffer is empty or not.
    pub(super) latest: Duration,
    /// How long it stays away.
    away: Duration,
}

impl World {
    /// Lets `trouble` happen as soon as `when` holds; once.
    pub fn plan(&mut self, trouble: Trouble, when: fn(&World) -> bool) {
        self.plan = Some(Plan { when, trouble });
    }

    /// Lets each trouble happen at its time.
    pub fn schedule(&mut self, mut agenda: Vec<(Duration, Trouble)>) {
        agenda.sort_by_key(|(when, _)| std::cmp::Reverse(*when));
        self.agenda = agenda;
    }

    /// Whether the planned trouble has begun.
    pub fn has_happened(&self) -> bool {
        self.plan.is_none()
    }

    /// Does to the port what the simulator's script of faults does to the device.
    pub(super) fn follow_device(&mut self) {
        let device = self.simulator.port();
        // A hang-up whose end has passed already is one all the same.
        if device.hang_ups != self.device.hang_ups {
            self.close_port(Duration::MAX);
        }
        if !device.is_gone && self.port_opens == Some(Duration::MAX) {
            let found = self.now + REOPENING;
            self.port_opens = self.bridge_starts.max(Some(found));
        }
        self.device = device;
    }

    /// The port is closed, and opens again at `opens`.
    fn close_port(&mut self, opens: Duration) {
        self.probe.interrupted();
        let was_open = self.port_opens.is_none();
        self.port_opens = self.port_opens.max(Some(opens));
        if was_open && self.is_alive() {
            self.bridge
                .apply(host(self.now), Input::PortClosed, &mut self.witness);
        }
    }

    /// The bridge's process is gone, and what it knew with it. Clients that have no final report yet are told by their
    /// own side.
    fn bridge_gone(&mut self, starts: Duration) {
        self.deaths += 1;
        self.ending = None;
        self.gone_since = Some(self.now);
        self.requests_of_the_dead = self.next_request;
        self.probe.interrupted();
        self.probe.path_closes(&[]);
        self.witness.bridge_gone();
        self.buffer.ended_early(self.simulator.held_waypoints());
        self.movement = None;
        self.recording.process_gone(self.bridge.writer());
        self.bridge = crate::missions::recording::bridge(&self.bridge_config, self.is_recorded);
        self.bridge_starts = Some(starts);
        self.port_opens = self.port_opens.max(Some(starts));
    }

    /// The bridge is asked to end: it empties the DSP's path buffer first, for as long as its shell gives it.
    fn end_bridge(&mut self, away: Duration) {
        if !self.is_alive() || self.ending.is_some() {
            return;
        }
        let within = 2 * ATTEMPTS * self.bridge_config.link.ack_timeout();
        self.ending = Some(Ending {
            latest: self.now + within,
            away,
        });
        self.bridge
            .apply(host(self.now), Input::WindDown, &mut self.witness);
        self.exchange();
        self.end_bridge_if_wound_down();
    }

    /// Ends a bridge that was asked to, as soon as it may.
    pub(super) fn end_bridge_if_wound_down(&mut self) {
        let Some(ending) = self.ending else {
            return;
        };
        if self.bridge.has_wound_down() || self.now >= ending.latest {
            self.bridge
                .apply(host(self.now), Input::Close, &mut self.witness);
            self.witness.assert_all_answered();
            self.look();
            self.bridge_gone(self.now + ending.away);
        }
    }

    /// Lets happen what is due.
    pub(super) fn trouble(&mut self) {
        while let Some((_, trouble)) = self.agenda.pop_if(|(when, _)| *when <= self.now) {
            self.happen(trouble);
        }
        let Some(plan) = self.plan.take() else {
            return;
        };
        if !(plan.when)(self) {
            self.plan = Some(plan);
            return;
        }
        self.happen(plan.trouble);
    }

    fn happen(&mut self, trouble: Trouble) {
        match trouble {
            Trouble::Reboot => {
                self.probe.interrupted();
                self.simulator.reboot();
            }
            Trouble::PortGone(time) => self.close_port(self.now + time),
            Trouble::BridgeDies(time) => self.bridge_gone(self.now + time),
            Trouble::BridgeEnds(time) => self.end_bridge(time),
            Trouble::Noise(time) => self.begin_noise(0.3, time),
            Trouble::FaintNoise(time) => self.begin_noise(0.01, time),
        }
    }

    fn begin_noise(&mut self, rate: f64, time: Duration) {
        let until = self.now + time;
        for noise in &mut self.noise {
            noise.begin(rate, until);
        }
    }
}
