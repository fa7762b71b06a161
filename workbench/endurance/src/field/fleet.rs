//! Many robots and a station: what each relay costs, how old telemetry is at the station and how long orders take, and how that grows
//! with the number of robots, with a router between them and without.
//!
//! Each robot has shared memory and a relay of its own, as on a machine of its own. The first robots are whole: simulator, bridge and
//! status are processes. The others are *played*: a thread of this program publishes what their bridge and status would, and answers
//! requests; a machine that runs a hundred relays has no room for three times as many processes beside them. Every robot stands at a
//! place of its own, and an order has an id that no other one has: what comes from another robot is counted.

use std::net::Ipv4Addr;
use std::path::Path;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::code::{ControlCommand, LinkState, RelayLinkState, Stage};
use ipc_types::payload::{HeroTelemetry, ModuleControl, ModuleState, RelayLink};
use ipc_types::{
    Domain, Ipc, MonotonicNs, RobotId, TelemetryGroup, Waiter, allow_many_files, fresh_request_id,
};
use ril_tests::relayed::STATION;
use ril_tests::sandbox::{FOR_SLOW_MACHINES, Robot};
use ril_tests::{Process, Received, Sandbox, Script, StandInBridge, StandInStatus};
use runtime::usage::{Load, Usage};

use crate::outcome::{Outcome, Times};
use crate::usage::{Machine, usage_of};

/// How robots and station connect: with each other, or with a router.
pub const TOPOLOGIES: [&str; 2] = ["peers", "router"];

/// How far the robots stand from each other, degrees of latitude.
const APART_DEG: f64 = 0.002;

/// Where the first one stands, degrees of latitude.
const FIRST_DEG: f64 = 37.0;

/// From one order of a robot to the next.
const ORDER_PERIOD: Duration = Duration::from_secs(1);

/// A link that is not up by then, a sample that does not come for so long and an order that has no end hang.
const LONGEST: Duration = Duration::from_secs(90);

/// From the first sample of the last robot until measuring begins: each relay sends slowly at first.
const WARM_UP: Duration = Duration::from_secs(5);

/// When the player is so late, it leaves out what it is late by.
const MOST_BEHIND: Duration = Duration::from_secs(1);

/// Nothing but this program reaches the loopback interface's address that it takes.
const OPEN: &str = "[security]\ninsecure = true\n";

/// What is measured.
#[derive(Clone, Copy, Debug)]
pub struct Fleet<'a> {
    /// The program `ril`; the relay's lies beside it.
    pub ril: &'a Path,
    /// How many robots.
    pub robots: u32,
    /// How many of them are whole.
    pub whole: u32,
    /// Samples of each kind of telemetry a second, of each robot.
    pub rate_hz: u32,
    /// One of [`TOPOLOGIES`].
    pub through: &'a str,
    /// How many stations have all robots. The first one is observed and orders; the others watch.
    pub stations: u32,
    /// Robots of one relay of the station, which starts as many relays as it takes.
    pub per_relay: u32,
    /// For how long.
    pub duration: Duration,
    /// A measurement that takes longer hangs.
    pub limit: Duration,
}

/// Starts everything, measures, and ends everything.
pub fn run(fleet: &Fleet<'_>) -> Outcome {
    // What is played, and the observers of all robots, are in this process.
    allow_many_files();
    let network = Network::new(fleet);
    let began = MonotonicNs::now();
    let mut robots: Vec<OneRobot> = (1..=fleet.robots)
        .map(|number| OneRobot::start(fleet, &network, number))
        .collect();
    let stations: Vec<Sandbox> = (0..fleet.stations).map(|_| machine(fleet)).collect();
    let station = &stations[0];
    let router = network.has_router.then(|| {
        let text = format!("{OPEN}[router]\nlisten = [\"{}\"]\n", network.router());
        station.write("router.toml", &text);
        station.start_ready("relay router --config router.toml")
    });
    // All of them at once: each takes a moment.
    for robot in &mut robots {
        let args = format!("relay robot --robot {}", robot.number);
        robot.relay = Some(robot.machine.start(&args));
    }
    for relay in robots.iter_mut().filter_map(|robot| robot.relay.as_mut()) {
        relay.wait_for_text("ready");
    }
    let mut relays = Vec::new();
    for (place, station) in stations.iter().enumerate() {
        let kind = ["station", "another station"][place.min(1)];
        let some = start_station(fleet, &network, station, place);
        relays.extend(some.into_iter().map(|relay| (kind, relay)));
    }
    // After all processes: a process inherits what this one has open, and its files are counted.
    let player = Player::start(&robots, fleet.rate_hz);
    let observers: Vec<Observer> = robots
        .iter()
        .map(|robot| Observer::start(station, robot.number))
        .collect();
    observers.iter().for_each(Observer::await_ready);
    let up_after = MonotonicNs::now().since(began);

    let begin = MonotonicNs::now() + WARM_UP;
    for observer in &observers {
        observer.measure(begin, begin + fleet.duration);
    }
    thread::sleep(begin.since(MonotonicNs::now()));
    let machine_before = Machine::now();
    let before = Kinds::now(&robots, &relays, router.as_ref());
    let seen: Vec<Seen> = observers.into_iter().map(Observer::end).collect();
    let after = Kinds::now(&robots, &relays, router.as_ref());
    let idle_percent = Machine::now().idle_percent(machine_before);

    relays.into_iter().for_each(|(_, relay)| drop(relay.end()));
    let played = player.end();
    let relays_of_robots = robots.iter_mut().filter_map(|robot| robot.relay.take());
    relays_of_robots.for_each(|relay| drop(relay.end()));
    router.into_iter().for_each(|router| drop(router.end()));
    for robot in robots {
        if let Some(whole) = robot.whole {
            whole.end();
        }
    }
    report(
        fleet,
        &Measured {
            seen,
            played,
            before,
            after,
            up_after,
            idle_percent,
        },
    )
}

/// Everything that came of it.
struct Measured {
    seen: Vec<Seen>,
    /// Of each robot that is played, the ids of the orders that reached it.
    played: Vec<(u32, Vec<u64>)>,
    before: Kinds,
    after: Kinds,
    up_after: Duration,
    idle_percent: f64,
}

fn report(fleet: &Fleet<'_>, measured: &Measured) -> Outcome {
    let Measured { seen, played, .. } = measured;
    let (mut ages, mut orders) = (Times::default(), Times::default());
    let (mut foreign, mut unanswered, mut refused) = (0, 0, 0);
    let (mut lost_on_air, mut lost_in_relay, mut left_out) = (0, 0, 0);
    let mut bytes_per_s = 0.0;
    for one in seen {
        ages.0.extend(&one.ages.0);
        orders.0.extend(&one.orders.0);
        foreign += one.foreign;
        unanswered += one.unanswered;
        refused += one.refused;
        let [earlier, later] = &one.links;
        let since = |of: fn(&RelayLink) -> u64| of(later).saturating_sub(of(earlier));
        lost_on_air += since(|link| link.samples_lost_on_air);
        lost_in_relay += since(|link| link.samples_lost_in_relay);
        left_out += since(|link| link.samples_left_out);
        let took_s = since(|link| link.published_ns) as f64 * 1e-9;
        bytes_per_s += since(|link| link.bytes_received) as f64 / took_s;
    }
    // What a robot got that is played must be what was ordered of it, once, and nothing else.
    let strayed = played.iter().filter(|(number, got)| {
        let sent = &seen[*number as usize - 1].ids;
        *got != *sent
    });
    let strayed = strayed.count();
    let mut outcome = Outcome::default();
    outcome.cell(
        "robots: whole, played",
        format!(
            "{}: {}, {}",
            fleet.robots,
            fleet.whole.min(fleet.robots),
            fleet.robots.saturating_sub(fleet.whole)
        ),
    );
    outcome.cell("stations", fleet.stations);
    outcome.cell("through", fleet.through);
    measured.before.report(&measured.after, &mut outcome);
    let kb_per_s = bytes_per_s / f64::from(fleet.robots) / 1e3;
    outcome.cell("kB/s of a robot", format!("{kb_per_s:.1}"));
    outcome.cell("age: p50, p99, ms", quantiles(&ages));
    outcome.cell("order: p50, p99, ms", quantiles(&orders));
    outcome.cell("samples", ages.count());
    outcome.cell("orders", orders.count());
    outcome.cell(
        "lost on the air, in a relay, left out",
        format!("{lost_on_air}, {lost_in_relay}, {left_out}"),
    );
    outcome.cell("orders refused", refused);
    outcome.cell(
        "all up after, s",
        format!("{:.0}", measured.up_after.as_secs_f64()),
    );
    outcome.cell("machine idle, %", format!("{:.0}", measured.idle_percent));
    let failed = [
        (foreign, "samples of another robot"),
        (unanswered, "orders without a final report of their own"),
        (strayed, "robots got other orders than were given to them"),
    ];
    for (count, what) in failed {
        outcome.require(count == 0, format!("{count} {what}"));
    }
    outcome
}

/// The median, and what 99 of 100 do not exceed, ms.
fn quantiles(times: &Times) -> String {
    let [median, most] = [0.5, 0.99].map(|share| times.quantile(share).as_secs_f64() * 1e3);
    format!("{median:.1}, {most:.1}")
}

fn machine(fleet: &Fleet<'_>) -> Sandbox {
    Sandbox::new([fleet.ril], "fleet", fleet.limit)
}

/// Where relays listen: at an address on loopback that belongs to this process, so that no other program has a port of it.
struct Network {
    address: Ipv4Addr,
    has_router: bool,
}

impl Network {
    fn new(fleet: &Fleet<'_>) -> Network {
        // The kernel numbers processes up to 2^22.
        let bits = 0x7f40_0000 | std::process::id() & 0x003f_ffff;
        Network {
            address: Ipv4Addr::from_bits(bits),
            has_router: fleet.through == "router",
        }
    }

    fn robot(&self, number: u32) -> String {
        format!("tcp/{}:{}", self.address, 7447 + number)
    }

    fn router(&self) -> String {
        format!("tcp/{}:7447", self.address)
    }

    /// The part of `relay.toml` that is the same for both sides.
    fn section(&self) -> String {
        let through = if self.has_router { "router" } else { "peers" };
        format!("{OPEN}[network]\nthrough = \"{through}\"\nsilent_after_ms = 20000\n")
    }

    fn robot_toml(&self, number: u32) -> String {
        let endpoints = match self.has_router {
            true => format!("listen = []\nconnect = [\"{}\"]", self.router()),
            false => format!("listen = [\"{}\"]", self.robot(number)),
        };
        let section = self.section();
        format!("{section}[robot]\n{endpoints}\n[commands]\nstations = [\"{STATION}\"]\n")
    }

    fn station_toml(&self, name: &str, numbers: &[u32]) -> String {
        let connect: Vec<String> = match self.has_router {
            true => vec![self.router()],
            false => numbers.iter().map(|number| self.robot(*number)).collect(),
        };
        let robots = numbers
            .iter()
            .map(|number| format!("{{ number = {number} }}"));
        let robots: Vec<String> = robots.collect();
        format!(
            "{}[station]\nname = \"{name}\"\nconnect = {connect:?}\nrobots = [{}]\n",
            self.section(),
            robots.join(", ")
        )
    }
}

/// Starts the relays of the station at this place, each with some of the robots.
fn start_station(
    fleet: &Fleet<'_>,
    network: &Network,
    station: &Sandbox,
    place: usize,
) -> Vec<Process> {
    let name = match place {
        0 => STATION.to_owned(),
        _ => format!("{STATION}-{place}"),
    };
    let numbers: Vec<u32> = (1..=fleet.robots).collect();
    let relays = numbers.chunks(fleet.per_relay as usize).map(|some| {
        let file = format!("station-{}.toml", some[0]);
        station.write(&file, &network.station_toml(&name, some));
        station.start_ready(&format!("relay station --config {file}"))
    });
    relays.collect()
}

/// A robot.
struct OneRobot {
    number: u32,
    /// `None` when it is played.
    whole: Option<Robot>,
    relay: Option<Process>,
    /// Last: dropping it asserts that nothing is left.
    machine: Sandbox,
}

impl OneRobot {
    /// Starts what is a process of its own, but for its relay.
    fn start(fleet: &Fleet<'_>, network: &Network, number: u32) -> OneRobot {
        let machine = machine(fleet);
        let relay_toml = network.robot_toml(number);
        machine.write("relay.toml", &relay_toml);
        let is_whole = number <= fleet.whole;
        let whole = is_whole.then(|| {
            let home = format!("[home]\nlatitude_deg = {:.6}\n", latitude_deg(number));
            machine.write("dsp-sim.toml", &home);
            let period_ms = 1000 / fleet.rate_hz;
            let rate = format!("[parameters]\nstatus_period_ms = {period_ms}\n");
            machine.write("bridge.toml", &format!("{FOR_SLOW_MACHINES}{rate}"));
            machine.start_robot(number, 1)
        });
        OneRobot {
            number,
            whole,
            relay: None,
            machine,
        }
    }
}

fn latitude_deg(number: u32) -> f64 {
    FIRST_DEG + APART_DEG * f64::from(number)
}

fn robot_id(number: u32) -> RobotId {
    RobotId::new(number).expect("robots are counted from 1")
}

/// Bridge and status of a robot, played.
struct Played {
    number: u32,
    bridge: StandInBridge,
    status: StandInStatus,
    /// Where it stands, for ever.
    standing: Script,
}

impl Played {
    fn new(domain: &Domain, number: u32) -> Played {
        Played {
            number,
            bridge: StandInBridge::start_for(domain, robot_id(number)),
            status: StandInStatus::start_for(domain, robot_id(number)),
            standing: Script::at(latitude_deg(number), -6.001, 10.0).stand(0.1),
        }
    }

    fn publish(&self) {
        self.standing.dsp().iter().take(1).for_each(|sample| {
            self.bridge.publish(sample);
        });
        self.standing.hero().iter().take(1).for_each(|sample| {
            self.status.publish(sample);
        });
    }

    fn publish_state(&self) {
        self.bridge.publish_state(&StandInBridge::idle_state());
    }
}

/// Publishes for all robots that are played, on a thread of its own, one after the other within each period.
struct Player {
    end: Sender<()>,
    thread: JoinHandle<Vec<(u32, Vec<u64>)>>,
}

impl Player {
    fn start(robots: &[OneRobot], rate_hz: u32) -> Player {
        let played = robots.iter().filter(|robot| robot.whole.is_none());
        let played = played.map(|robot| Played::new(&robot.machine.domain, robot.number));
        let played: Vec<Played> = played.collect();
        let (end, is_over) = mpsc::channel();
        let thread = thread::spawn(move || {
            play(&played, rate_hz, &is_over);
            let ids = |one: Played| {
                let requests = one.bridge.take_requests();
                let ids = requests.iter().filter_map(|request| match request {
                    Received::Control(request) => Some(request.request_id),
                    Received::Movement(_) | Received::Parameter(_) => None,
                });
                (one.number, ids.collect())
            };
            played.into_iter().map(ids).collect()
        });
        Player { end, thread }
    }

    /// For each robot the ids of the orders that it got, in order.
    fn end(self) -> Vec<(u32, Vec<u64>)> {
        // It has ended where nothing is played.
        let _ = self.end.send(());
        self.thread.join().expect("robots can be played")
    }
}

fn play(played: &[Played], rate_hz: u32, is_over: &Receiver<()>) {
    let turns = rate_hz * played.len() as u32;
    if turns == 0 {
        return;
    }
    let turn = Duration::from_secs(1) / turns;
    let mut next = MonotonicNs::now();
    for (count, one) in (1_u32..).zip(played.iter().cycle()) {
        one.publish();
        if (count / played.len() as u32).is_multiple_of(rate_hz) {
            one.publish_state();
        }
        // What a busy machine is late by is made up for.
        let now = MonotonicNs::now();
        next = match now.since(next) < MOST_BEHIND {
            true => next + turn,
            false => now,
        };
        match is_over.recv_timeout(next.since(now)) {
            Err(RecvTimeoutError::Timeout) => {}
            Ok(()) | Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Who reads a robot's telemetry at the station and orders, on a thread of its own.
struct Observer {
    ready: Receiver<()>,
    /// From when to when it measures.
    span: Sender<(MonotonicNs, MonotonicNs)>,
    thread: JoinHandle<Seen>,
}

/// What an observer saw.
#[derive(Default)]
struct Seen {
    /// From the bridge to this observer.
    ages: Times,
    /// From an order to its final report.
    orders: Times,
    /// The orders, by their ids.
    ids: Vec<u64>,
    /// Final reports that are not *done*.
    refused: usize,
    unanswered: usize,
    /// Samples of a robot that stands somewhere else.
    foreign: usize,
    /// How the link was at the beginning and at the end.
    links: [RelayLink; 2],
}

impl Observer {
    fn start(station: &Sandbox, number: u32) -> Observer {
        let domain = station.domain.clone();
        let (readier, ready) = mpsc::channel();
        let (span, begins) = mpsc::channel();
        let thread = thread::spawn(move || {
            let mut ports = StationPorts::open(&domain, number);
            ports.await_link();
            // The other end may be gone after a failure.
            let _ = readier.send(());
            match begins.recv() {
                Ok((begin, end)) => ports.observe(begin, end),
                Err(_) => Seen::default(),
            }
        });
        Observer {
            ready,
            span,
            thread,
        }
    }

    /// Returns when telemetry of its robot has come.
    fn await_ready(&self) {
        self.ready.recv().expect("the robot is seen at the station");
    }

    fn measure(&self, begin: MonotonicNs, end: MonotonicNs) {
        self.span.send((begin, end)).expect("the observer waits");
    }

    fn end(self) -> Seen {
        self.thread.join().expect("the station can be observed")
    }
}

/// The ports of an observer.
struct StationPorts {
    number: u32,
    ipc: Ipc,
    telemetry: ipc_types::Subscriber<HeroTelemetry>,
    links: ipc_types::Subscriber<RelayLink>,
    /// The last one of them.
    link: RelayLink,
    waiter: Waiter,
}

impl StationPorts {
    fn open(domain: &Domain, number: u32) -> StationPorts {
        let ipc = Ipc::join(domain, robot_id(number), "observer").expect("a place");
        StationPorts {
            number,
            telemetry: ipc.subscriber().expect("a subscriber"),
            links: ipc.subscriber().expect("a subscriber"),
            link: RelayLink::default(),
            waiter: Waiter::new(),
            ipc,
        }
    }

    /// Waits until the link is up, the robot's DSP is there and a sample has come.
    fn await_link(&mut self) {
        let give_up = MonotonicNs::now() + LONGEST;
        let mut states = self.ipc.subscriber::<ModuleState>().expect("a subscriber");
        let (mut is_up, mut has_dsp, mut has_sample) = (false, false, false);
        while !(is_up && has_dsp && has_sample) {
            let left = give_up.since(MonotonicNs::now());
            assert!(
                !left.is_zero(),
                "robot {} is not seen at the station",
                self.number
            );
            let mut sources: [((), &mut dyn ipc_types::Source); 3] = [
                ((), &mut self.telemetry),
                ((), &mut self.links),
                ((), &mut states),
            ];
            self.waiter.wait(&mut sources, Some(left)).expect("a wait");
            // What cannot be received now can be by the next call, says the subscriber.
            let _ = self.links.drain(|link| self.link = *link);
            is_up = self.link.state() == Some(RelayLinkState::Up);
            let _ = states.drain(|state| has_dsp = state.link.state() == Some(LinkState::Up));
            let _ = self.telemetry.drain(|_| has_sample = true);
        }
    }

    fn observe(mut self, begin: MonotonicNs, end: MonotonicNs) -> Seen {
        let mut seen = Seen::default();
        let mut client = self.ipc.client::<ModuleControl>().expect("a client");
        let number = u64::from(self.number);
        // All robots get orders, at moments of their own.
        let mut next_order = begin + ORDER_PERIOD.mul_f64((number % 20) as f64 / 20.0);
        let mut open: Option<(u64, MonotonicNs)> = None;
        loop {
            let now = MonotonicNs::now();
            if now >= begin && seen.links[0].published_ns == 0 {
                seen.links[0] = self.link;
            }
            if now >= end && open.is_none() {
                break;
            }
            if open.is_some_and(|(_, sent)| now.since(sent) > LONGEST) {
                seen.unanswered += 1;
                break;
            }
            if open.is_none() && now >= next_order {
                let id = fresh_request_id();
                next_order = next_order + ORDER_PERIOD;
                match client.send(&ModuleControl::new(id, ControlCommand::Stop)) {
                    Ok(_) => {
                        open = Some((id, now));
                        seen.ids.push(id);
                    }
                    Err(_) => seen.refused += 1,
                }
            }
            let until = match open {
                Some((_, sent)) => sent + LONGEST,
                None => next_order.min(end),
            };
            let mut sources: [((), &mut dyn ipc_types::Source); 3] = [
                ((), &mut self.telemetry),
                ((), &mut self.links),
                ((), &mut client),
            ];
            let timeout = until.since(now) + Duration::from_millis(1);
            self.waiter
                .wait(&mut sources, Some(timeout))
                .expect("a wait");
            let now = MonotonicNs::now();
            client.drain(|report| match open {
                Some((id, sent)) if report.request_id == id => {
                    if report.is_final() {
                        seen.orders.push(now.since(sent));
                        seen.refused += usize::from(report.stage() != Some(Stage::Done));
                        open = None;
                    }
                }
                // It is no report of this client's order.
                _ => seen.unanswered += 1,
            });
            let _ = self.links.drain(|link| self.link = *link);
            let home_deg = latitude_deg(self.number);
            let _ = self.telemetry.drain(|sample| {
                if now < begin || now >= end {
                    return;
                }
                seen.ages.push(now.since(sample.received()));
                if sample.valid(TelemetryGroup::Geographic) {
                    let latitude_deg = sample.geodetic.latitude_rad.to_degrees();
                    let is_own = (latitude_deg - home_deg).abs() < APART_DEG / 2.0;
                    seen.foreign += usize::from(!is_own);
                }
            });
        }
        // The next one tells of all that was measured.
        let link = self.links.recv_timeout(LONGEST).expect("a wait");
        seen.links[1] = link.expect("the relay says how its link is");
        seen
    }
}

/// What the processes of each kind use and hold.
struct Kinds(Vec<(&'static str, Usage)>);

impl Kinds {
    fn now(
        robots: &[OneRobot],
        relays: &[(&'static str, Process)],
        router: Option<&Process>,
    ) -> Kinds {
        let mut kinds = Vec::new();
        for robot in robots {
            if let Some(whole) = &robot.whole {
                kinds.push(("sim", usage_of(&whole.sim)));
                kinds.push(("bridge", usage_of(&whole.bridge)));
                kinds.push(("status", usage_of(&whole.status)));
            }
            let relay = robot.relay.as_ref();
            kinds.extend(relay.map(|relay| ("relay", usage_of(relay))));
        }
        kinds.extend(relays.iter().map(|(kind, relay)| (*kind, usage_of(relay))));
        kinds.extend(router.map(|router| ("router", usage_of(router))));
        Kinds(kinds)
    }

    fn report(&self, after: &Kinds, outcome: &mut Outcome) {
        let sum = |kind: &str| {
            let (mut sum, mut count) = (Sum::default(), 0);
            for ((name, before), (_, after)) in self.0.iter().zip(&after.0) {
                if *name == kind {
                    count += 1;
                    let load = after.since(before);
                    sum.load.all_percent += load.all_percent;
                    sum.load.busiest_percent = sum.load.busiest_percent.max(load.busiest_percent);
                    sum.memory_mib += after.memory_mib;
                    sum.files += after.files;
                }
            }
            (sum, count)
        };
        let mean = |kind: &str| {
            let (sum, count) = sum(kind);
            match count {
                0 => "–".to_owned(),
                count => {
                    let count = f64::from(count);
                    let (load, memory) = (sum.load.all_percent / count, sum.memory_mib / count);
                    format!(
                        "{load:.2} % {memory:.1} MiB {:.0} files",
                        sum.files as f64 / count
                    )
                }
            }
        };
        outcome.cell("sim", mean("sim"));
        outcome.cell("bridge", mean("bridge"));
        outcome.cell("status", mean("status"));
        outcome.cell("a robot's relay", mean("relay"));
        let (station, relays) = sum("station");
        outcome.cell("relays of the station", relays);
        outcome.cell(
            "all together",
            format!(
                "{:.1} % {:.0} MiB {} files",
                station.load.all_percent, station.memory_mib, station.files
            ),
        );
        outcome.cell(
            "busiest thread, %",
            format!("{:.1}", station.load.busiest_percent),
        );
        outcome.cell("router", mean("router"));
    }
}

/// Of some processes.
#[derive(Default)]
struct Sum {
    load: Load,
    memory_mib: f64,
    files: usize,
}
