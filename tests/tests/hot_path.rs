//! From the bytes of the serial line to the sample of robot telemetry nothing is allocated, once the link is up: by the
//! real shells of bridge and status, on a pseudo-terminal and shared memory, while both journals are followed.
//!
//! iceoryx2 0.10 itself keeps a handle of 104 bytes on the heap from the loan of a sample to its sending;
//! `ipc-types/tests/allocation.rs` has it alone.

use std::fs::File;
use std::io::{Read, Write};
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use bridge::BridgeConfig;
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::configuration::{BridgeConfiguration, ConfigurationText, StatusConfiguration};
use ipc_types::payload::{BridgeJournal, DspTelemetry, HeroTelemetry, ModuleState, StatusJournal};
use ipc_types::{Ipc, StateOf, StatusModule, Subscriber, Topic};
use ril_tests::{TestDomain, pty};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use status::shell::Shell;

use crate::bytes::heap::Watched;

/// Bytes of what iceoryx2 allocates for a sample.
const HANDLE: usize = 104;

/// How much the simulated clock advances in a round, and how long a round waits for bytes.
const ROUND: Duration = Duration::from_millis(10);
const BYTES_COME: Timespec = Timespec {
    tv_sec: 0,
    tv_nsec: 2_000_000,
};

/// Samples until all buffers have their size, and samples of the measurement.
const WARM_UP: u64 = 500;
const SAMPLES: u64 = 1_000;

const ATTEMPTS: usize = 10;

static BRIDGE: Watched = Watched::new();
static STATUS: Watched = Watched::new();

/// A DSP at the other end of the line.
struct Dsp {
    simulator: Simulator,
    now: Duration,
    line: File,
}

impl Dsp {
    fn round(&mut self) {
        self.now += ROUND;
        self.simulator.advance(self.now);
        let mut line = &self.line;
        self.simulator
            .transmit(|bytes| line.write(bytes).expect("a terminal"));
        let mut ready = [PollFd::new(&self.line, PollFlags::IN)];
        if poll(&mut ready, Some(&BYTES_COME)) == Ok(1) {
            let mut bytes = [0; 4096];
            let count = line.read(&mut bytes).expect("a terminal");
            self.simulator.receive(self.now, &bytes[..count]);
        }
    }
}

/// All that bridge and status publish in a flight.
struct Consumer {
    dsp: Subscriber<DspTelemetry>,
    hero: Subscriber<HeroTelemetry>,
    bridge: (Subscriber<BridgeJournal>, Subscriber<ModuleState>),
    status: (Subscriber<StatusJournal>, Subscriber<StateOf<StatusModule>>),
    configurations: (
        Subscriber<BridgeConfiguration>,
        Subscriber<StatusConfiguration>,
    ),
    /// How often a journal had a snapshot, which is made when no sample waits for it.
    snapshots: u64,
}

impl Consumer {
    fn new(ipc: &Ipc) -> Consumer {
        fn subscribe<T: Topic>(ipc: &Ipc) -> Subscriber<T> {
            ipc.subscriber().expect("a subscriber")
        }
        Consumer {
            dsp: subscribe(ipc),
            hero: subscribe(ipc),
            bridge: (subscribe(ipc), subscribe(ipc)),
            status: (subscribe(ipc), subscribe(ipc)),
            configurations: (subscribe(ipc), subscribe(ipc)),
            snapshots: 0,
        }
    }

    /// Samples that were published so far: of robot telemetry, of the bridge, of status.
    fn drain(&mut self) -> [u64; 3] {
        fn drain<T: Topic>(from: &mut Subscriber<T>, mut sample: impl FnMut(&T)) -> u64 {
            from.drain(|it| sample(it)).expect("samples");
            let losses = from.losses();
            losses.received + losses.lost
        }
        let dsp = drain(&mut self.dsp, |_| {});
        let hero = drain(&mut self.hero, |_| {});
        let snapshots = &mut self.snapshots;
        let bridge = drain(&mut self.bridge.0, |piece| {
            *snapshots += u64::from(piece.begins != 0)
        }) + drain(&mut self.bridge.1, |_| {})
            + drain(&mut self.configurations.0, |_| {});
        let status = drain(&mut self.status.0, |piece| {
            *snapshots += u64::from(piece.begins != 0)
        }) + drain(&mut self.status.1, |_| {})
            + drain(&mut self.configurations.1, |_| {});
        [hero, dsp + bridge, hero + status]
    }
}

/// What a process did in a measurement.
#[derive(Debug)]
struct Figures {
    allocations: u64,
    longest: usize,
    /// Samples of all its topics.
    published: u64,
}

impl Figures {
    /// Nothing but iceoryx2's handles was allocated.
    fn is_steady(&self) -> bool {
        self.allocations <= self.published && self.longest <= HANDLE
    }
}

/// Measures both processes, unless a journal has a snapshot meanwhile.
fn measure(dsp: &mut Dsp, consumer: &mut Consumer) -> Option<[(&'static str, Figures); 2]> {
    let processes = [("bridge", &BRIDGE), ("status", &STATUS)];
    let allocations = || processes.map(|(_, it)| it.allocations.load(Ordering::Relaxed));
    let before = (consumer.drain(), allocations(), consumer.snapshots);
    for (_, watched) in processes {
        watched.longest.store(0, Ordering::Relaxed);
    }
    let mut after = before.0;
    while after[0] < before.0[0] + SAMPLES {
        dsp.round();
        after = consumer.drain();
    }
    let allocated = allocations();
    // What was allocated just now may be for a sample that comes with the next round.
    dsp.round();
    after = consumer.drain();
    let figures = |index: usize| Figures {
        allocations: allocated[index] - before.1[index],
        longest: processes[index].1.longest.load(Ordering::Relaxed),
        published: after[index + 1] - before.0[index + 1],
    };
    let [bridge, status] = processes.map(|(name, _)| name);
    (consumer.snapshots == before.2).then(|| [(bridge, figures(0)), (status, figures(1))])
}

#[test]
fn nothing_is_allocated_between_the_line_and_the_consumer() {
    let domain = TestDomain::new();
    let (line, port) = pty::open();
    let mut config = BridgeConfig::default();
    config.serial.port = port;
    let (bridge_end, end_bridge) = Termination::by_hand().expect("a pair of sockets");
    let (status_end, end_status) = Termination::by_hand().expect("a pair of sockets");
    thread::scope(|scope| {
        scope.spawn(|| {
            BRIDGE.watch();
            let ipc = domain.join("bridge");
            let no_fence = || Err("there is no file".to_owned());
            let supervisor = Notifier::from_env();
            let text = ConfigurationText::new(config.to_toml());
            bridge::shell::run(&config, text, no_fence, &ipc, &bridge_end, &supervisor)
                .expect("a bridge");
        });
        scope.spawn(|| {
            STATUS.watch();
            let shell = Shell::open(domain.join("status"), &status::config::Config::default());
            let ended = shell.and_then(|shell| shell.run(&status_end, &Notifier::from_env()));
            ended.expect("a status");
        });
        // Both end with this, whatever fails.
        let (_end_bridge, _end_status) = (end_bridge, end_status);
        let mut consumer = Consumer::new(&domain.join("consumer"));
        let mut dsp = Dsp {
            simulator: Simulator::new(Setup::default()),
            now: Duration::ZERO,
            line,
        };
        let mut seen = [0; 3];
        while seen[0] < WARM_UP {
            dsp.round();
            seen = consumer.drain();
        }
        // A second consumer that joins makes both journals have a snapshot, after which no buffer may be a new one.
        let mut second = Consumer::new(&domain.join("consumer"));
        while second.drain()[0] < WARM_UP {
            dsp.round();
            consumer.drain();
        }
        // A process that was held up says so in its log, which allocates: what every attempt has is the rule.
        let is_steady = (0..ATTEMPTS).any(|_| {
            let measured = measure(&mut dsp, &mut consumer);
            second.drain();
            measured.is_some_and(|both| {
                both.iter()
                    .for_each(|(name, it)| println!("{name}: {it:?}"));
                both.iter().all(|(_, it)| it.is_steady())
            })
        });
        assert!(
            is_steady,
            "something beside the samples is allocated in every attempt"
        );
    });
}
