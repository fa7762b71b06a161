//! Scripts of stations, of time and of the bridge, against the whole gateway: for the fuzz target `mavlink`, and for
//! the short play of its corpus in `chance`.
//!
//! A script is a row of steps, each of two bytes, what is done and how long the bytes are that follow for it:
//!
//! | first byte, low two bits | the step |
//! |---|---|
//! | 0 | these bytes come as a datagram |
//! | 1 | they come as a message with a right checksum; the first says which |
//! | 2 | time passes, 10 ms for the second byte's unit; with bit 2 samples come, with bit 3 the helicopter flies, with bit 4 it holds |
//! | 3 | the bridge reports on the oldest order: the second byte is the stage, by its place, and the reason; so many waypoints are reached |
//!
//! The bits 5 to 7 are the station's port.

use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, LinkState, Reason, Stage};
use ipc_types::payload::{HeroTelemetry, ModuleState, RequestReport};
use mavlink_gateway::message::{ALL, HEARTBEAT};
use mavlink_gateway::wire::{MAX_FRAME, MessageWriter, frames};
use mavlink_gateway::{Gateway, Mission, Order, Settings, Task};

struct Play {
    gateway: Gateway,
    now: MonotonicNs,
    orders: Vec<Order>,
    /// Whether a station may be there.
    has_heartbeat: bool,
}

/// Plays a script; panics where the gateway breaks a promise.
pub fn play(mut script: &[u8]) {
    let settings = Settings {
        stations: vec![address(7)],
        ..Settings::default()
    };
    let mut play = Play {
        gateway: Gateway::new(settings, 1),
        now: MonotonicNs(1_000_000_000_000),
        orders: Vec::new(),
        has_heartbeat: false,
    };
    play.samples(0);
    while let [what, length, rest @ ..] = script {
        let takes = what & 3 < 2;
        let length_taken = if takes {
            usize::from(*length).min(rest.len())
        } else {
            0
        };
        let (bytes, after) = rest.split_at(length_taken);
        script = after;
        play.step(*what, *length, bytes);
        play.look();
    }
}

fn address(port: u8) -> SocketAddr {
    ([127, 0, 0, 1], 1_000 + u16::from(port)).into()
}

impl Play {
    fn step(&mut self, what: u8, number: u8, bytes: &[u8]) {
        let from = address(what >> 5);
        match what & 3 {
            0 => self.datagram(from, bytes),
            1 => {
                let Some((kind, fields)) = bytes.split_first() else {
                    return;
                };
                let kind = ALL[usize::from(*kind) % ALL.len()];
                let message = fields
                    .iter()
                    .fold(MessageWriter::new(kind), |message, byte| message.u8(*byte));
                self.datagram(from, &message.frame(0, 255, what >> 5));
            }
            2 => {
                self.now = self.now + Duration::from_millis(10 * u64::from(number));
                if what & 4 != 0 {
                    self.samples(what);
                }
            }
            _ => self.report(number),
        }
    }

    fn datagram(&mut self, from: SocketAddr, bytes: &[u8]) {
        self.has_heartbeat |= frames(bytes).flatten().any(|frame| frame.kind == HEARTBEAT);
        self.gateway.datagram(from, bytes, self.now, self.now);
    }

    fn samples(&mut self, what: u8) {
        let functionality = match what & 16 {
            0 => Functionality::AtRest,
            _ => Functionality::Holding,
        };
        let mut state = ModuleState {
            published_ns: self.now.0,
            functionality: functionality.code(),
            ..ModuleState::default()
        };
        state.link.state = LinkState::Up.code();
        let telemetry = HeroTelemetry {
            received_ns: self.now.0,
            valid_groups: 0xffff,
            flying: u32::from(what & 8 != 0),
            ..HeroTelemetry::default()
        };
        self.gateway.state(&state, self.now);
        self.gateway.telemetry(&telemetry, self.now);
    }

    fn report(&mut self, number: u8) {
        let stage = Stage::ALL[usize::from(number) % Stage::ALL.len()];
        let reason = Reason::ALL[usize::from(number) % Reason::ALL.len()];
        let Some(order) = self.orders.first().copied() else {
            return;
        };
        if stage.is_final() {
            self.orders.remove(0);
        }
        let report = RequestReport {
            waypoints_reached: number.into(),
            ..RequestReport::new(stage, reason)
        };
        self.gateway
            .report(order.number, &report, "words", self.now);
    }

    /// What must hold after each step.
    fn look(&mut self) {
        self.gateway.advance(self.now);
        while let Some(task) = self.gateway.poll_task() {
            match task {
                // The default ones.
                Task::Rules => self.gateway.rules(None, self.now),
                Task::PutFence(_) | Task::RestoreFence => panic!("no fence was sent"),
                Task::Save(mission) => {
                    let kept = Mission::decode(&mission.encode()).expect("it is read again");
                    self.gateway.saved(kept, Ok(()), self.now);
                }
            }
        }
        self.gateway.advance(self.now);
        self.orders
            .extend(std::iter::from_fn(|| self.gateway.poll_order()));
        assert!(
            self.orders.is_empty() || self.has_heartbeat,
            "ordered by no station"
        );
        assert!(
            self.orders.len() <= 10,
            "{} orders are open",
            self.orders.len()
        );
        let mut sent = 0;
        while let Some(datagram) = self.gateway.poll_datagram() {
            sent += 1;
            assert!(datagram.bytes.len() <= MAX_FRAME);
            assert!(frames(&datagram.bytes).all(|frame| frame.is_ok()));
        }
        assert!(sent <= 256, "{sent} datagrams wait");
        while self.gateway.poll_event().is_some() {}
        self.gateway.poll_progress(self.now);
        let deadline = self.gateway.deadline();
        assert!(
            deadline.is_none_or(|deadline| deadline > self.now),
            "{deadline:?}"
        );
    }
}
