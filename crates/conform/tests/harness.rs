//! Plays a run of the kit against a DSP in virtual time.

use std::num::NonZeroU32;
use std::time::Duration;

use conform::permitted::{CONFIRMATION, RotorDisconnected};
use conform::report::Report;
use conform::run::{Conformance, Player, Settings};
use conform::wire::Setup;
use dsp_protocol::{Command, Profile, Sequence, Uplink, port};
use dsp_sim::simulator::Simulator;

/// The virtual time at which a run is taken for one that does not end.
const TIME_LIMIT: Duration = Duration::from_secs(6 * 3600);

/// A DSP at the other end of the line.
pub trait Peer {
    /// Takes bytes that the PC begins to send at `now`.
    fn receive(&mut self, now: Duration, bytes: &[u8]);
    /// Goes on to `now`.
    fn advance(&mut self, now: Duration);
    /// When it has something to do next.
    fn next_deadline(&self) -> Option<Duration>;
    /// The bytes that have come through the line.
    fn take_output(&mut self) -> Vec<u8>;
    /// Boots again.
    fn reset(&mut self, now: Duration);
}

impl Peer for Simulator {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        assert_eq!(Simulator::receive(self, now, bytes), bytes.len());
    }

    fn advance(&mut self, now: Duration) {
        Simulator::advance(self, now);
    }

    fn next_deadline(&self) -> Option<Duration> {
        Simulator::next_deadline(self)
    }

    fn take_output(&mut self) -> Vec<u8> {
        let mut output = Vec::new();
        self.transmit(|bytes| {
            output.extend_from_slice(bytes);
            bytes.len()
        });
        output
    }

    fn reset(&mut self, now: Duration) {
        Simulator::advance(self, now);
        self.reboot();
    }
}

/// Settings of a run with everything allowed.
pub fn everything(profile: Profile, baud: u32) -> Settings {
    Settings {
        setup: Setup {
            profile,
            baud: NonZeroU32::new(baud),
            slack: Duration::from_millis(4),
            first_number: Sequence::new(55),
            is_lossy: false,
        },
        can_reset: true,
        proof: RotorDisconnected::confirmed_by(CONFIRMATION),
        only: Vec::new(),
    }
}

/// A simulator that another PC has started up and ordered to take off.
pub fn in_a_climb(profile: Profile) -> Simulator {
    let mut peer = Simulator::new(dsp_sim::simulator::Setup {
        profile,
        ..dsp_sim::simulator::Setup::default()
    });
    let orders = [
        Command::Following { on: true },
        Command::Write16 {
            port: port::TAKE_OFF,
            value: 1,
        },
    ];
    for (number, order) in orders.into_iter().enumerate() {
        let sequence = Sequence::new(number as u8);
        let frame = Uplink::Command(order).encode_in(profile, sequence);
        Peer::receive(&mut peer, Duration::ZERO, frame.as_bytes());
    }
    Peer::take_output(&mut peer);
    peer
}

/// What a run gave.
pub struct Played {
    /// What the kit found.
    pub report: Report,
    /// All bytes that it sent.
    pub sent: Vec<u8>,
    /// How long it took in virtual time.
    pub took: Duration,
}

/// Plays a whole run.
pub fn play(peer: &mut impl Peer, settings: Settings) -> Played {
    let mut run = Conformance::new(settings);
    let (sent, took) = serve(&mut run, peer, |run, peer, now| {
        if run.wants_reset() {
            peer.reset(now);
            run.was_reset(now);
        }
    });
    Played {
        report: run.report(),
        sent,
        took,
    }
}

/// Serves a player until it is done; gives all bytes that it sent, and how long it took.
pub fn serve<R: Player, P: Peer>(
    run: &mut R,
    peer: &mut P,
    mut between: impl FnMut(&mut R, &mut P, Duration),
) -> (Vec<u8>, Duration) {
    let (mut now, mut sent) = (Duration::ZERO, Vec::new());
    let mut bytes = Vec::new();
    loop {
        run.step(now, &bytes);
        between(run, peer, now);
        let out = run.take_outbox();
        if !out.is_empty() {
            peer.receive(now, &out);
            sent.extend(out);
        }
        if run.is_finished() {
            return (sent, now);
        }
        bytes = peer.take_output();
        if bytes.is_empty() {
            let next = [run.next_deadline(), peer.next_deadline()];
            let next = next.into_iter().flatten().min().expect("something goes on");
            now = now.max(next);
            assert!(now < TIME_LIMIT, "the run does not end");
            peer.advance(now);
            bytes = peer.take_output();
        }
    }
}

/// The sentences that are broken, with what was found.
pub fn broken(report: &Report) -> Vec<String> {
    let broken = |check: &&conform::report::CheckReport| check.verdict.name() == "broken";
    let text = |check: &conform::report::CheckReport| {
        format!("{}: {}", check.id, check.verdict.text().unwrap_or_default())
    };
    report.checks.iter().filter(broken).map(text).collect()
}

/// The sentences that were not judged, with the reason.
pub fn not_judged(report: &Report) -> Vec<String> {
    let open = |check: &&conform::report::CheckReport| check.verdict.name() == "not-judged";
    let text = |check: &conform::report::CheckReport| {
        format!("{}: {}", check.id, check.verdict.text().unwrap_or_default())
    };
    report.checks.iter().filter(open).map(text).collect()
}

/// What happens to bytes with `rate` damaged: one bit of each of those is changed.
pub struct Damaged<P> {
    pub peer: P,
    pub random: fastrand::Rng,
    pub rate: f64,
}

impl<P> Damaged<P> {
    fn damage(&mut self, bytes: &mut [u8]) {
        for byte in bytes {
            if self.random.f64() < self.rate {
                *byte ^= 1 << self.random.u8(0..8);
            }
        }
    }
}

impl<P: Peer> Peer for Damaged<P> {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        self.damage(&mut bytes);
        self.peer.receive(now, &bytes);
    }

    fn advance(&mut self, now: Duration) {
        self.peer.advance(now);
    }

    fn next_deadline(&self) -> Option<Duration> {
        self.peer.next_deadline()
    }

    fn take_output(&mut self) -> Vec<u8> {
        let mut bytes = self.peer.take_output();
        self.damage(&mut bytes);
        bytes
    }

    fn reset(&mut self, now: Duration) {
        self.peer.reset(now);
    }
}
