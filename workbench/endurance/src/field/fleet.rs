//! Many robots and a station: what each relay costs, how old telemetry is at the station and how long orders take, and
//! how that grows with the number of robots, with a router between them and without.
//!
//! Each robot has shared memory and a relay of its own, as on a machine of its own. The first robots are whole:
//! simulator, bridge and status are processes. The others are *played*: a thread of this program publishes what their
//! bridge and status would, and answers requests; a machine that runs a hundred relays has no room for three times as
//! many processes beside them. Every robot stands at a place of its own, and an order has an id that no other one has:
//! what comes from another robot is counted.

use std::fs;
use std::net::Ipv4Addr;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::code::{LinkState, RelayLinkState, Stage};
use ipc_types::payload::{HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{Domain, MonotonicNs, RobotId, TelemetryGroup, allow_many_files};
use ril_tests::relayed::STATION;
use ril_tests::sandbox::{FOR_SLOW_MACHINES, Robot};
use ril_tests::{Process, Received, Sandbox, Script, StandInBridge, StandInStatus};
use runtime::usage::Usage;

use super::{OPEN, Operator, Ordered};
use crate::listener::Listener;
use crate::plan::{Plan, TOPOLOGIES};
use crate::site::{Site, usage_of};
use measure::{Outcome, Times};

/// How far the robots stand from each other, degrees of latitude.
const APART_DEG: f64 = 0.002;

/// Where the first one stands, degrees of latitude.
const FIRST_DEG: f64 = 37.0;

/// From one order of a robot to the next.
const ORDER_PERIOD: Duration = Duration::from_secs(1);

/// From the first sample of the last robot until measuring begins: each relay sends slowly at first.
const WARM_UP: Duration = Duration::from_secs(5);

/// When the player is so late, it leaves out what it is late by.
const MOST_BEHIND: Duration = Duration::from_secs(1);

/// Measures each number of robots that is planned, in each topology.
pub fn run(site: &Site) {
    // What is played, and the observers of all robots, are in this process.
    allow_many_files();
    let through = site.plan.through.as_deref();
    for topology in TOPOLOGIES
        .into_iter()
        .filter(|one| through.is_none_or(|chosen| chosen == *one))
    {
        for robots in &site.plan.robots {
            if site.goes_on() {
                measure(site, topology == "router", *robots);
            }
        }
    }
}

/// Starts everything, measures, and ends everything.
fn measure(site: &Site, has_router: bool, count: u32) {
    let plan = &site.plan;
    let network = Network::new(has_router);
    let began = MonotonicNs::now();
    let start = |number| OneRobot::start(site, &network, number);
    let mut robots: Vec<OneRobot> = (1..=count).map(start).collect();
    let stations: Vec<Sandbox> = (0..plan.stations).map(|_| site.machine([])).collect();
    let station = &stations[0];
    let mut processes: Vec<(&str, Process)> = Vec::new();
    if has_router {
        let listen = format!("{OPEN}[router]\nlisten = [\"{}\"]\n", network.relay(0));
        station.write("router.toml", &listen);
        let router = station.start_ready("relay router --config router.toml");
        processes.push(("router", router));
    }
    // All of them at once: each takes a moment.
    let relays = robots.iter().map(|robot| {
        let args = format!("relay robot --robot {}", robot.number);
        ("relay", robot.machine.start(&args))
    });
    let first = processes.len();
    processes.extend(relays.collect::<Vec<_>>());
    for (_, relay) in &mut processes[first..] {
        relay.wait_for_text("ready");
    }
    for (place, station) in stations.iter().enumerate() {
        start_station(plan, &network, station, place, count, &mut processes);
    }
    // After all processes: a process inherits what this one has open, and its files are counted.
    let player = Player::start(&robots, plan.rate_hz);
    (1..=count).for_each(|number| await_robot(station, number));
    let up_after = MonotonicNs::now().since(began);

    let begin = MonotonicNs::now() + WARM_UP;
    let end = begin + plan.duration(15);
    let observe = |number| Observer::start(&station.domain, number, begin, end);
    let observers: Vec<Observer> = (1..=count).map(observe).collect();
    thread::sleep(begin.since(MonotonicNs::now()));
    let links = || {
        (1..=count)
            .map(|number| link_of(station, number))
            .collect::<Vec<_>>()
    };
    let (links_before, machine_before) = (links(), Machine::now());
    let before = usage(&robots, &processes);
    let seen: Vec<Seen> = observers.into_iter().map(Observer::end).collect();
    let after = usage(&robots, &processes);
    let idle_percent = Machine::now().idle_percent(machine_before);
    let links_after = links();

    // The stations' relays end first, and a router last.
    processes
        .into_iter()
        .rev()
        .for_each(|(_, process)| drop(process.end()));
    let played = player.end();
    for whole in robots.iter_mut().filter_map(|robot| robot.whole.take()) {
        whole.end();
    }
    let mut outcome = Outcome::default();
    let whole = plan.whole.min(count);
    outcome.cell(
        "robots: whole, played",
        format!("{count}: {whole}, {}", count - whole),
    );
    outcome.cell("stations", plan.stations);
    outcome.cell("through", TOPOLOGIES[usize::from(has_router)]);
    report_usage(&mut outcome, &before, &after);
    report_seen(&mut outcome, &seen, &played, &links_before, &links_after);
    outcome.cell("all up after, s", format!("{:.0}", up_after.as_secs_f64()));
    outcome.cell("machine idle, %", format!("{idle_percent:.0}"));
    site.show(outcome);
}

fn report_seen(
    outcome: &mut Outcome,
    seen: &[Seen],
    played: &[(u32, Vec<u64>)],
    before: &[RelayLink],
    after: &[RelayLink],
) {
    let since = |of: fn(&RelayLink) -> u64| {
        let links = before.iter().zip(after);
        links.map(move |(before, after)| of(after).saturating_sub(of(before)))
    };
    let took_s = since(|link| link.published_ns).map(|ns| ns as f64 * 1e-9);
    let bytes = since(|link| link.bytes_received);
    let bytes_per_s: f64 = bytes
        .zip(took_s)
        .map(|(bytes, took_s)| bytes as f64 / took_s)
        .sum();
    let kb_per_s = bytes_per_s / seen.len() as f64 / 1e3;
    outcome.cell("kB/s of a robot", format!("{kb_per_s:.1}"));
    let ages: Times = seen.iter().flat_map(|one| &one.ages.0).copied().collect();
    let orders: Vec<&Ordered> = seen
        .iter()
        .flat_map(|one| one.orders.iter().flatten())
        .collect();
    let ended = orders.iter().filter(|order| order.end.is_some());
    let times: Times = ended.clone().map(|order| order.took).collect();
    outcome.cell("age: p50, p99, ms", ages.quantiles_ms(&[0.5, 0.99]));
    outcome.cell("order: p50, p99, ms", times.quantiles_ms(&[0.5, 0.99]));
    outcome.cell("samples", ages.count());
    outcome.cell("orders", times.count());
    let lost = [
        since(|link| link.samples_lost_on_air).sum::<u64>(),
        since(|link| link.samples_lost_in_relay).sum(),
        since(|link| link.samples_left_out).sum(),
    ];
    outcome.cell(
        "lost on the air, in a relay, left out",
        lost.map(|count| count.to_string()).join(", "),
    );
    let unsent = seen
        .iter()
        .flat_map(|one| &one.orders)
        .filter(|order| order.is_none())
        .count();
    let is_done = |order: &&&Ordered| {
        order
            .end
            .is_some_and(|end| end.stage() == Some(Stage::Done))
    };
    let refused = unsent + ended.clone().filter(|order| !is_done(order)).count();
    outcome.cell("orders refused", refused);
    let strays: usize = orders.iter().map(|order| order.strays).sum();
    // What a robot got that is played must be what was ordered of it, once, and nothing else.
    let strayed = played.iter().filter(|(number, got)| {
        let sent = seen[*number as usize - 1].orders.iter().flatten();
        !sent.map(|order| order.id).eq(got.iter().copied())
    });
    for (count, what) in [
        (
            seen.iter().map(|one| one.foreign).sum(),
            "samples of another robot",
        ),
        (
            orders.len() - times.count() + strays,
            "orders without a final report of their own",
        ),
        (
            strayed.count(),
            "robots got other orders than were given to them",
        ),
    ] {
        outcome.require(count == 0, format!("{count} {what}"));
    }
}

/// Where relays listen: at an address on loopback that belongs to this process, so that no other program has a port of
/// it.
struct Network {
    address: Ipv4Addr,
    has_router: bool,
}

impl Network {
    fn new(has_router: bool) -> Network {
        // The kernel numbers processes up to 2^22.
        let bits = 0x7f40_0000 | std::process::id() & 0x003f_ffff;
        Network {
            address: Ipv4Addr::from_bits(bits),
            has_router,
        }
    }

    /// The relay of a robot, or with 0 the router.
    fn relay(&self, number: u32) -> String {
        format!("tcp/{}:{}", self.address, 7447 + number)
    }

    /// The part of `relay.toml` that is the same for both sides.
    fn section(&self) -> String {
        let through = TOPOLOGIES[usize::from(self.has_router)];
        format!("{OPEN}[network]\nthrough = \"{through}\"\nsilent_after_ms = 20000\n")
    }

    fn robot_toml(&self, number: u32) -> String {
        let endpoints = match self.has_router {
            true => format!("listen = []\nconnect = [\"{}\"]", self.relay(0)),
            false => format!("listen = [\"{}\"]", self.relay(number)),
        };
        let section = self.section();
        format!("{section}[robot]\n{endpoints}\n[commands]\nstations = [\"{STATION}\"]\n")
    }

    fn station_toml(&self, name: &str, numbers: &[u32]) -> String {
        let connect: Vec<String> = match self.has_router {
            true => vec![self.relay(0)],
            false => numbers.iter().map(|number| self.relay(*number)).collect(),
        };
        let robots = numbers
            .iter()
            .map(|number| format!("{{ number = {number} }}"));
        let robots = robots.collect::<Vec<_>>().join(", ");
        let section = self.section();
        format!(
            "{section}[station]\nname = \"{name}\"\nconnect = {connect:?}\nrobots = [{robots}]\n"
        )
    }
}

/// Starts the relays of the station at this place, each with some of the robots.
fn start_station(
    plan: &Plan,
    network: &Network,
    station: &Sandbox,
    place: usize,
    robots: u32,
    processes: &mut Vec<(&str, Process)>,
) {
    let (kind, name) = match place {
        0 => ("station", STATION.to_owned()),
        _ => ("another station", format!("{STATION}-{place}")),
    };
    let numbers: Vec<u32> = (1..=robots).collect();
    for some in numbers.chunks(plan.per_relay as usize) {
        let file = format!("station-{}.toml", some[0]);
        station.write(&file, &network.station_toml(&name, some));
        let relay = station.start_ready(&format!("relay station --config {file}"));
        processes.push((kind, relay));
    }
}

/// A robot.
struct OneRobot {
    number: u32,
    /// `None` when it is played.
    whole: Option<Robot>,
    /// Last: dropping it asserts that nothing is left.
    machine: Sandbox,
}

impl OneRobot {
    /// Starts what is a process of its own, but for its relay.
    fn start(site: &Site, network: &Network, number: u32) -> OneRobot {
        let machine = site.machine([]);
        machine.write("relay.toml", &network.robot_toml(number));
        let whole = (number <= site.plan.whole).then(|| {
            let home = format!("[home]\nlatitude_deg = {:.6}\n", latitude_deg(number));
            machine.write("dsp-sim.toml", &home);
            let period_ms = 1000 / site.plan.rate_hz;
            let rate = format!("[parameters]\nstatus_period_ms = {period_ms}\n");
            machine.write("bridge.toml", &format!("{FOR_SLOW_MACHINES}{rate}"));
            machine.start_robot(number, 1)
        });
        OneRobot {
            number,
            whole,
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
    fn new(robot: &OneRobot) -> Played {
        let (domain, number) = (&robot.machine.domain, robot.number);
        Played {
            number,
            bridge: StandInBridge::start_lossy(domain, robot_id(number)),
            status: StandInStatus::start_lossy(domain, robot_id(number)),
            standing: Script::at(latitude_deg(number), -6.001, 10.0).stand(0.1),
        }
    }

    /// The robot, and the ids of the orders that it got, in order.
    fn end(self) -> (u32, Vec<u64>) {
        let ids = |request: &Received| match request {
            Received::Control(request) => Some(request.request_id),
            Received::Movement(_) | Received::Parameter(_) => None,
        };
        let requests = self.bridge.take_requests();
        (self.number, requests.iter().filter_map(ids).collect())
    }
}

/// Publishes for all robots that are played, on a thread of its own, one after the other within each period.
struct Player {
    end: mpsc::Sender<()>,
    thread: JoinHandle<Vec<(u32, Vec<u64>)>>,
}

impl Player {
    fn start(robots: &[OneRobot], rate_hz: u32) -> Player {
        let played = robots.iter().filter(|robot| robot.whole.is_none());
        let played: Vec<Played> = played.map(Played::new).collect();
        let (end, is_over) = mpsc::channel();
        let thread = thread::spawn(move || {
            play(&played, rate_hz, &is_over);
            played.into_iter().map(Played::end).collect()
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
        one.bridge.publish(&one.standing.dsp()[0]);
        one.status.publish(&one.standing.hero()[0]);
        if (count / played.len() as u32).is_multiple_of(rate_hz) {
            one.bridge.publish_state(&StandInBridge::idle_state());
        }
        // What a busy machine is late by is made up for.
        let now = MonotonicNs::now();
        next = match now.since(next) < MOST_BEHIND {
            true => next + turn,
            false => now,
        };
        if is_over.recv_timeout(next.since(now)) != Err(RecvTimeoutError::Timeout) {
            return;
        }
    }
}

/// Who reads a robot's telemetry at the station and orders.
struct Observer {
    number: u32,
    /// From when to when samples count.
    span: std::ops::Range<MonotonicNs>,
    telemetry: Listener<(MonotonicNs, Option<f64>)>,
    orders: JoinHandle<Vec<Option<Ordered>>>,
}

/// What an observer saw.
struct Seen {
    /// From the bridge to this observer.
    ages: Times,
    /// `None` of those that could not be sent.
    orders: Vec<Option<Ordered>>,
    /// Samples of a robot that stands somewhere else.
    foreign: usize,
}

impl Observer {
    fn start(domain: &Domain, number: u32, begin: MonotonicNs, end: MonotonicNs) -> Observer {
        let place = |sample: &HeroTelemetry| {
            let latitude_deg = sample.geodetic.latitude_rad.to_degrees();
            let is_known = sample.valid(TelemetryGroup::Geographic);
            (sample.received(), is_known.then_some(latitude_deg))
        };
        let telemetry = Listener::start(domain, robot_id(number), place);
        let mut operator = Operator::join(domain, robot_id(number));
        let orders = thread::spawn(move || {
            // All robots get orders, at moments of their own.
            let mut next = begin + ORDER_PERIOD.mul_f64(f64::from(number % 20) / 20.0);
            let mut orders = Vec::new();
            while next < end {
                thread::sleep(next.since(MonotonicNs::now()));
                orders.push(operator.order());
                next = next + ORDER_PERIOD;
            }
            orders
        });
        Observer {
            number,
            span: begin..end,
            telemetry,
            orders,
        }
    }

    /// Ends when the time is over and each order has its end.
    fn end(self) -> Seen {
        thread::sleep(self.span.end.since(MonotonicNs::now()));
        let orders = self.orders.join().expect("the station can be observed");
        let (mut heard, _) = self.telemetry.end();
        heard.retain(|heard| self.span.contains(&heard.at));
        let home_deg = latitude_deg(self.number);
        let is_foreign = |place_deg: f64| (place_deg - home_deg).abs() >= APART_DEG / 2.0;
        Seen {
            ages: heard
                .iter()
                .map(|heard| heard.at.since(heard.kept.0))
                .collect(),
            foreign: heard
                .iter()
                .filter(|heard| heard.kept.1.is_some_and(is_foreign))
                .count(),
            orders,
        }
    }
}

/// Waits until the link to a robot is up, its DSP is there and a sample has come.
fn await_robot(station: &Sandbox, number: u32) {
    let mut links = station.subscribe::<RelayLink>(number);
    links.until("the link is up", |link| {
        link.state() == Some(RelayLinkState::Up)
    });
    let mut states = station.subscribe::<ModuleState>(number);
    states.until("the DSP is there", |state| {
        state.link.state() == Some(LinkState::Up)
    });
    station
        .subscribe::<HeroTelemetry>(number)
        .until("telemetry", |_| true);
}

/// How the link to a robot is.
fn link_of(station: &Sandbox, number: u32) -> RelayLink {
    station.subscribe(number).until("a link", |_| true)
}

/// What the processes of each kind use and hold.
fn usage<'a>(robots: &[OneRobot], processes: &[(&'a str, Process)]) -> Vec<(&'a str, Usage)> {
    let whole = robots.iter().filter_map(|robot| robot.whole.as_ref());
    let whole = whole.flat_map(|robot| {
        [
            ("sim", &robot.sim),
            ("bridge", &robot.bridge),
            ("status", &robot.status),
        ]
    });
    let processes = processes.iter().map(|(kind, process)| (*kind, process));
    let all = whole.chain(processes);
    all.map(|(kind, process)| (kind, usage_of(process)))
        .collect()
}

fn report_usage(outcome: &mut Outcome, before: &[(&str, Usage)], after: &[(&str, Usage)]) {
    let of_kind = |kind: &str| {
        let both = before
            .iter()
            .zip(after)
            .filter(|((name, _), _)| *name == kind);
        let both = both.map(|((_, before), (_, after))| (after.since(before), after));
        both.collect::<Vec<_>>()
    };
    let sum = |kind: &str| {
        let all = of_kind(kind);
        let load: f64 = all.iter().map(|(load, _)| load.all_percent).sum();
        let memory: f64 = all.iter().map(|(_, usage)| usage.memory_mib).sum();
        let files: usize = all.iter().map(|(_, usage)| usage.files).sum();
        (all.len() as f64, load, memory, files as f64)
    };
    for (heading, kind) in [
        ("sim", "sim"),
        ("bridge", "bridge"),
        ("status", "status"),
        ("a robot's relay", "relay"),
        ("router", "router"),
    ] {
        let (count, load, memory, files) = sum(kind);
        let mean = || {
            let (load, memory, files) = (load / count, memory / count, files / count);
            format!("{load:.2} % {memory:.1} MiB {files:.0} files")
        };
        outcome.cell(
            heading,
            if count > 0.0 {
                mean()
            } else {
                "–".to_owned()
            },
        );
    }
    let (relays, load, memory, files) = sum("station");
    outcome.cell("relays of the station", relays);
    outcome.cell(
        "all together",
        format!("{load:.1} % {memory:.0} MiB {files} files"),
    );
    let busiest = of_kind("station")
        .iter()
        .map(|(load, _)| load.busiest_percent)
        .fold(0.0, f64::max);
    outcome.cell("busiest thread, %", format!("{busiest:.1}"));
}

/// Time on all processors of this machine so far, and how much of it nothing ran.
#[derive(Clone, Copy, Debug, Default)]
struct Machine {
    all: u64,
    idle: u64,
}

impl Machine {
    /// Both times at this moment.
    fn now() -> Machine {
        let stat = fs::read_to_string("/proc/stat").unwrap_or_default();
        let line = stat.lines().next().unwrap_or_default();
        // User, nice, system, idle, waiting for a disk, …
        let ticks = line.split_whitespace().skip(1).take(8);
        let ticks: Vec<u64> = ticks.filter_map(|ticks| ticks.parse().ok()).collect();
        Machine {
            all: ticks.iter().sum(),
            idle: ticks.iter().skip(3).take(2).sum(),
        }
    }

    /// The share of time since `before` in which nothing ran, percent.
    fn idle_percent(self, before: Machine) -> f64 {
        let all = self.all.saturating_sub(before.all).max(1);
        self.idle.saturating_sub(before.idle) as f64 / all as f64 * 100.0
    }
}
