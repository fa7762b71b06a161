//! Simulator, bridge and status as they run in earnest, each on a thread of this process: real shared memory, a real
//! pseudo-terminal, the real loops. The operator is the test; what it checks is what a consumer sees.
//!
//! The same with one process for each is tried by the tests of the crate `ril`.

use std::os::fd::AsFd;
use std::path::PathBuf;
use std::sync::mpsc;
use std::thread::{self, JoinHandle};

use bridge::BridgeConfig;
use dsp_sim::pty::Pty;
use dsp_sim::simulator::{Setup, Simulator};
use ipc_types::code::{ControlCommand, LinkState, Reason, Stage};
use ipc_types::payload::{
    BridgeJournal, DspTelemetry, HeroTelemetry, ModuleControl, ModuleState, MovementData,
    RequestReport, StatusJournal, WaypointPosition,
};
use ipc_types::service::Request;
use ipc_types::{
    Client, Descriptor, Domain, Ipc, RobotId, SendError, Subscriber, TelemetryGroup, Topic, Waiter,
    fresh_request_id,
};
use replay::{Verdict, Verifier};
use ril_tests::TestDomain;
use ril_tests::process::WAIT_LIMIT;
use runtime::notify::Notifier;
use runtime::signal::{Termination, TerminationRequest};

/// How much faster than real the simulator's clock runs.
const SPEED: f64 = 5.0;

/// Patient, and with few samples: a machine that stalls for a second must not fail the test.
const BRIDGE_CONFIG: &str = "
[link]
ack_timeout_ms = 2000
pc_timeout_ms = 30000
silent_after_ms = 10000
[parameters]
status_period_ms = 60
";

/// A loop on a thread of its own, which ends when it is asked to, or dropped.
struct Running {
    request: Option<TerminationRequest>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    fn start(work: impl FnOnce(&Termination) + Send + 'static) -> Running {
        let (sender, receiver) = mpsc::channel();
        let thread = thread::spawn(move || {
            let (termination, request) = Termination::by_hand().expect("a socket");
            sender.send(request).expect("the test waits for it");
            work(&termination);
        });
        Running {
            request: receiver.recv().ok(),
            thread: Some(thread),
        }
    }

    /// Ends it in order; its failure is the test's.
    fn end(mut self) {
        self.request = None;
        let thread = self.thread.take().expect("it runs");
        thread.join().expect("it ends in order");
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Losing the request is one: the thread ends by itself when a test fails.
        self.request = None;
    }
}

fn simulator() -> (Running, PathBuf) {
    let mut pty = Pty::open().expect("a pty");
    let path = pty.path().to_owned();
    let running = Running::start(move |termination| {
        let mut simulator = Simulator::new(Setup::default());
        let notifier = Notifier::from_env();
        dsp_sim::shell::run(&mut simulator, &mut pty, SPEED, termination, &notifier)
            .expect("the simulator's loop");
    });
    (running, path)
}

fn join(domain: &Domain, process: &str) -> Ipc {
    Ipc::join(domain, RobotId::DEFAULT, process).expect("a part in the domain")
}

fn bridge(domain: &Domain, port: PathBuf) -> Running {
    let domain = domain.clone();
    Running::start(move |termination| {
        let mut config: BridgeConfig =
            runtime::config::parse(BRIDGE_CONFIG, "the test's").expect("a configuration");
        config.serial.port = port;
        let ipc = join(&domain, "bridge");
        let read_fence = || Ok(config.fence.clone());
        bridge::shell::run(
            &config,
            &read_fence,
            &ipc,
            termination,
            &Notifier::from_env(),
        )
        .expect("the bridge's loop");
    })
}

fn status(domain: &Domain) -> Running {
    let domain = domain.clone();
    Running::start(move |termination| {
        let config = status::config::Config::default();
        let shell = status::shell::Shell::open(join(&domain, "status"), &config);
        let summary = shell
            .expect("status")
            .run(termination, &Notifier::from_env())
            .expect("status' loop");
        assert_eq!(summary.lost, 0);
        assert_eq!(summary.published, summary.received);
    })
}

/// Sends a request and follows it to its final report.
fn ask<R: Request>(client: &mut Client<R>, request: &R) -> RequestReport {
    let mut handle = client.request(request).expect("a request that is taken");
    let result = handle.result_timeout(WAIT_LIMIT).expect("a wait");
    result.expect("a final report")
}

fn assert_done(what: &str, report: &RequestReport) {
    let word = (report.stage(), report.reason());
    assert_eq!(
        word,
        (Some(Stage::Done), Some(Reason::None)),
        "{what}: {report:?}"
    );
}

fn await_link(states: &mut Subscriber<ModuleState>) {
    let mut is_up = false;
    while !is_up {
        assert!(
            states.wait(WAIT_LIMIT).expect("a wait").is_ready(),
            "no state"
        );
        states
            .drain(|state| is_up = state.link.state() == Some(LinkState::Up))
            .expect("states");
    }
}

/// Gives the pieces that have come to a verifier.
fn verify<P: Topic>(journal: &mut Subscriber<P>, verifier: &mut Verifier) {
    journal
        .drain(|piece| verifier.take(P::KEY, piece.bytes()))
        .expect("pieces");
}

/// A consumer on a thread of its own: it drains telemetry, and verifies the journals, until it is asked to end.
fn consumer(domain: &Domain) -> (Running, mpsc::Receiver<Seen>) {
    let (sender, receiver) = mpsc::channel();
    let domain = domain.clone();
    let running = Running::start(move |termination| {
        let ipc = join(&domain, "consumer");
        let mut raw = ipc.subscriber::<DspTelemetry>().expect("a subscriber");
        let mut hero = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
        let mut of_bridge = ipc.subscriber::<BridgeJournal>().expect("a subscriber");
        let mut of_status = ipc.subscriber::<StatusJournal>().expect("a subscriber");
        let mut verifier = Verifier::new();
        let waiter = Waiter::new();
        let mut seen = Seen::default();
        while !termination.requested() {
            let mut signals = Descriptor::new(termination.as_fd());
            waiter
                .wait(
                    &mut [
                        ((), &mut raw),
                        ((), &mut hero),
                        ((), &mut of_bridge),
                        ((), &mut of_status),
                        ((), &mut signals),
                    ],
                    None,
                )
                .expect("a wait");
            raw.drain(|sample| seen.raw.push(*sample)).expect("samples");
            hero.drain(|sample| seen.hero.push(*sample))
                .expect("samples");
            verify(&mut of_bridge, &mut verifier);
            verify(&mut of_status, &mut verifier);
        }
        seen.verdict = verifier.finish();
        let (raw, hero) = (raw.losses(), hero.losses());
        assert_eq!((raw.lost, hero.lost), (0, 0), "samples were lost");
        sender.send(seen).expect("the test waits for it");
    });
    (running, receiver)
}

#[derive(Default)]
struct Seen {
    raw: Vec<DspTelemetry>,
    hero: Vec<HeroTelemetry>,
    verdict: Verdict,
}

#[test]
fn a_mission_over_real_shared_memory_and_a_real_pty() {
    let domain = TestDomain::new();
    let (simulator, port) = simulator();
    let (consumer, seen) = consumer(&domain);
    let status = status(&domain);
    let bridge = bridge(&domain, port);
    {
        let ipc = domain.join("operator");
        let mut states = ipc.subscriber().expect("a subscriber");
        await_link(&mut states);
        let mut control = ipc.client::<ModuleControl>().expect("a client");
        let mut movement = ipc.client::<MovementData>().expect("a client");
        let start = ModuleControl::new(fresh_request_id(), ControlCommand::Start);
        assert_done("start", &ask(&mut control, &start));
        let take_off = MovementData::take_off(fresh_request_id(), 5.0);
        assert_done("take-off", &ask(&mut movement, &take_off));
        // A recorder that comes in flight.
        let mut late = ipc.subscriber::<BridgeJournal>().expect("a subscriber");
        let home = Setup::default().model.home;
        // 11 m to the north, then 9 m to the east, and up.
        let path = [(1e-4, 0.0, 7.0), (1e-4, 1e-4, 9.0), (0.0, 0.0, 6.0)].map(
            |(north_deg, east_deg, up_m)| WaypointPosition {
                latitude_deg: home.latitude_deg + north_deg,
                longitude_deg: home.longitude_deg + east_deg,
                altitude_m: home.altitude_m + up_m,
            },
        );
        let path_id = fresh_request_id();
        let requests: Vec<_> = MovementData::path(path_id, &path, fresh_request_id).collect();
        let (closing, others) = requests.split_last().expect("waypoints");
        for request in others {
            movement.send(request).expect("a request that is taken");
        }
        let flown = ask(&mut movement, closing);
        assert_done("path", &flown);
        // Of those that were reached while the machine stalled, the bridge may have seen nothing.
        assert_eq!((flown.waypoints_total, flown.waypoints_sent), (3, 3));
        let mut verifier = Verifier::new();
        verify(&mut late, &mut verifier);
        let in_flight = verifier.finish();
        assert!(in_flight.is_verified(), "{in_flight:?}");
        assert!(in_flight.bridge.samples > 50, "{in_flight:?}");
        assert_done(
            "landing",
            &ask(&mut movement, &MovementData::land(fresh_request_id())),
        );
        let stop = ModuleControl::new(fresh_request_id(), ControlCommand::Stop);
        assert_done("stop", &ask(&mut control, &stop));
    }
    // In the order in which nothing is published that nobody hears.
    bridge.end();
    status.end();
    consumer.end();
    simulator.end();
    check(&seen.recv().expect("what the consumer saw"));
    domain.assert_empty();
}

/// Sends requests that are refused, as quickly as it can, until it is asked to end.
fn flooder(domain: &Domain, gives_up: bool) -> Running {
    let domain = domain.clone();
    Running::start(move |termination| {
        let ipc = join(&domain, "flooder");
        let mut client = ipc.client::<MovementData>().expect("a client");
        let (mut sent, mut refused) = (0, 0);
        while !termination.requested() {
            let too_high = MovementData::take_off(fresh_request_id(), 1e6);
            match client.send(&too_high) {
                Ok(()) => sent += 1,
                Err(SendError::TooManyOutstanding) if gives_up => client.give_up(),
                Err(SendError::TooManyOutstanding | SendError::ServerFull) => {
                    client.wait(WAIT_LIMIT).expect("a wait");
                }
                Err(error) => panic!("{error}"),
            }
            client.drain(|report| {
                assert_eq!(report.stage(), Some(Stage::Refused), "{report:?}");
                assert_eq!(report.reason(), Some(Reason::OutOfRange), "{report:?}");
                refused += 1;
            });
        }
        assert!(gives_up || refused + client.outstanding() == sent);
    })
}

#[test]
fn eight_clients_that_flood_keep_nobody_from_flying_a_mission() {
    let domain = TestDomain::new();
    let (simulator, port) = simulator();
    let bridge = bridge(&domain, port);
    {
        let ipc = domain.join("operator");
        let mut states = ipc.subscriber().expect("a subscriber");
        await_link(&mut states);
        // Before the operator, in places that are asked first.
        let flooders: Vec<_> = (0..8).map(|n| flooder(&domain, n % 4 == 0)).collect();
        let mut control = ipc.client::<ModuleControl>().expect("a client");
        let mut movement = ipc.client::<MovementData>().expect("a client");
        let start = ModuleControl::new(fresh_request_id(), ControlCommand::Start);
        assert_done("start", &ask(&mut control, &start));
        let take_off = MovementData::take_off(fresh_request_id(), 5.0);
        assert_done("take-off", &ask(&mut movement, &take_off));
        let home = Setup::default().model.home;
        let path = [1e-4, 0.0].map(|north_deg| WaypointPosition {
            latitude_deg: home.latitude_deg + north_deg,
            longitude_deg: home.longitude_deg,
            altitude_m: home.altitude_m + 6.0,
        });
        let path_id = fresh_request_id();
        for request in MovementData::path(path_id, &path, fresh_request_id) {
            if request.last == 0 {
                movement.send(&request).expect("a request that is taken");
            } else {
                assert_done("path", &ask(&mut movement, &request));
            }
        }
        let landing = MovementData::land(fresh_request_id());
        assert_done("landing", &ask(&mut movement, &landing));
        let stop = ModuleControl::new(fresh_request_id(), ControlCommand::Stop);
        assert_done("stop", &ask(&mut control, &stop));
        for flooder in flooders {
            flooder.end();
        }
    }
    bridge.end();
    simulator.end();
    domain.assert_empty();
}

/// Every sample came through the whole chain, in order, and says the same on both sides.
fn check(seen: &Seen) {
    let verdict = &seen.verdict;
    assert!(verdict.is_verified(), "{verdict:?}");
    assert_eq!(
        (verdict.bridge.pieces_lost, verdict.status.pieces_lost),
        (0, 0)
    );
    assert!(
        verdict.bridge.samples > 150 && verdict.status.samples > 150,
        "{verdict:?}"
    );
    // The recorder that came in flight broke nothing.
    assert!(verdict.bridge.reports > 8, "{verdict:?}");
    assert_eq!(verdict.bridge.spans.len(), 1, "{verdict:?}");
    assert!(seen.raw.len() > 150, "only {} samples", seen.raw.len());
    // Either side may have joined in the middle of the first sample.
    let translated: Vec<_> = seen
        .hero
        .iter()
        .map(|sample| sample.source_sequence)
        .collect();
    let first = *translated.first().expect("samples");
    let raw: Vec<_> = seen
        .raw
        .iter()
        .map(|sample| sample.sequence)
        .filter(|n| *n >= first)
        .collect();
    assert_eq!(translated, raw, "not every sample was translated");
    for pair in seen.raw.windows(2) {
        assert!(pair[0].dsp_time_ms < pair[1].dsp_time_ms);
        assert!(pair[0].received_ns <= pair[1].received_ns);
    }
    let highest_m = seen
        .hero
        .iter()
        .filter(|sample| sample.valid(TelemetryGroup::Geographic))
        .map(|sample| sample.geodetic.altitude_m)
        .fold(f64::MIN, f64::max);
    let ground_m = Setup::default().model.home.altitude_m;
    assert!((highest_m - ground_m - 9.0).abs() < 1.2, "{highest_m}");
    let has_flown: Vec<_> = seen.hero.iter().map(|sample| sample.is_flying()).collect();
    let changes = has_flown
        .windows(2)
        .filter(|pair| pair[0] != pair[1])
        .count();
    assert_eq!(changes, 2, "it took off once and landed once");
}
