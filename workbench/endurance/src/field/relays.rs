//! Relays over bad links: a mission typed at the station, requests through loss, outages and restarts of everything,
//! how soon a station is connected, and what comes after outages.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::time::Duration;

use fastrand::Rng;
use ipc_types::code::{ControlCommand, Reason, RelayLinkState, Stage};
use ipc_types::payload::{
    HeroTelemetry, ModuleControl, MovementData, RelayLink, RequestReport, WaypointPosition,
};
use ipc_types::{Client, MonotonicNs, RobotId, SendError, Wake, fresh_request_id};
use ril_tests::process::{Finished, Stream};
use ril_tests::relayed::{BridgeLog, says};
use ril_tests::{Process, Rig, Sandbox};

use super::networks::{AHEAD_S, Networks};
use crate::listener::{Heard, Listener};
use crate::site::{Site, require_done};
use measure::{Outcome, Times};

/// Starts both networks, or says why this machine cannot.
fn networks(site: &Site, protocol: &str, usual_loss: u8, one_way: Duration) -> Option<Networks> {
    let networks = Networks::start(site, protocol, usual_loss, one_way);
    networks.inspect_err(|why| site.skip(why)).ok()
}

/// The one protocol of a measurement that takes one.
fn protocol(site: &Site) -> &str {
    site.plan.over.as_deref().unwrap_or("tcp")
}

/// A mission typed at the station: start, take-off, a path of four waypoints, landing and stop.
pub fn mission(site: &Site) {
    let Some(mut networks) = networks(site, protocol(site), 10, Duration::ZERO) else {
        return;
    };
    let station = &networks.rig.station;
    let path = format!("goto {}", Rig::square(networks.rig.place(), 5.0));
    let verbs = ["start", "takeoff --altitude 5", &path, "land", "stop"];
    let mut outcome = Outcome::default();
    let (mut done, mut is_path_done) = (0, false);
    for verb in verbs {
        let finished = station.finish(verb);
        is_path_done |= says(&finished.stdout, "goto: done, 4 of 4 waypoints sent");
        done += u32::from(require_done(&mut outcome, verb, &finished));
    }
    let link = station.subscribe::<RelayLink>(1).next_sample();
    let [bridge, sim] = networks.end();
    // A landing that follows at once may empty the DSP's path buffer before the last waypoint: the bridge's box is
    // larger.
    let are_flown = is_path_done && says(&sim.stderr, "waypoints_taken=4");
    let sent = link.samples_received + link.samples_lost_on_air;
    let lost_percent = link.samples_lost_on_air as f64 / sent.max(1) as f64 * 100.0;
    outcome.cell("packets lost, %", networks.loss * 100.0);
    outcome.cell("verbs done", done);
    outcome.none(
        "executed twice",
        BridgeLog::of([&bridge]).executed_twice().len(),
    );
    outcome.cell("all waypoints flown", are_flown);
    outcome.cell("samples lost, %", format!("{lost_percent:.1}"));
    outcome.cell("outages", link.outages);
    outcome.require(are_flown, "not all waypoints flown");
    site.show(outcome);
}

/// From one request to the next.
const PERIOD: Duration = Duration::from_millis(150);

/// From one disturbance to the next, in the middle.
const BETWEEN: Duration = Duration::from_secs(8);

/// How long an outage lasts.
const OUTAGE: Duration = Duration::from_secs(10);

/// How long the end of a request is waited for after all disturbances. A relay gives a request up after a minute.
const LAST_WAIT: Duration = Duration::from_secs(150);

/// Both clients, and the reports that they got.
struct Requests {
    movements: Client<MovementData>,
    controls: Client<ModuleControl>,
    open: BTreeSet<u64>,
    /// Final reports.
    ended: BTreeMap<u64, RequestReport>,
    repeated: usize,
    place: WaypointPosition,
    count: u32,
}

impl Requests {
    /// Sends the next request: mostly a waypoint that takes the place of the one before, sometimes a start.
    fn send(&mut self) {
        let id = fresh_request_id();
        let start = ModuleControl::new(id, ControlCommand::Start);
        let sent = match self.count % 5 {
            0 => self.controls.send(&start),
            1 => self.movements.send(&MovementData::take_off(id, 5.0)),
            number => {
                let mut to = self.place;
                to.latitude_deg += f64::from(number) * 0.000_02;
                let mut waypoint = MovementData::path(id, &[to], || id).next().expect("one");
                waypoint.preempt = 1;
                self.movements.send(&waypoint)
            }
        };
        use SendError::{NoServer, ServerFull, TooManyOutstanding};
        match sent {
            Ok(_) => {
                self.count += 1;
                self.open.insert(id);
            }
            // It was not sent, and the program knows.
            Err(NoServer { .. } | TooManyOutstanding | ServerFull) => {}
            Err(error) => panic!("{error}"),
        }
    }

    fn drain(&mut self) {
        let (open, ended, repeated) = (&mut self.open, &mut self.ended, &mut self.repeated);
        let mut take = |report: &RequestReport| {
            if report.is_final() {
                match open.remove(&report.request_id) {
                    true => _ = ended.insert(report.request_id, *report),
                    false => *repeated += 1,
                }
            }
        };
        self.movements.drain(&mut take);
        self.controls.drain(&mut take);
    }

    /// Takes the reports that come in a period.
    fn wait(&mut self) {
        let end = MonotonicNs::now() + PERIOD;
        loop {
            self.drain();
            let left = end.since(MonotonicNs::now());
            if left.is_zero() {
                return;
            }
            self.movements.wait(left).expect("a wait");
        }
    }
}

/// What disturbs: an outage of the link, or an end of the relay of the robot, that of the station, or the bridge.
fn disturb(networks: &mut Networks, bridges: &mut Vec<Finished>, chance: &mut Rng) -> &'static str {
    let rig = &mut networks.rig;
    match chance.u8(..4) {
        0 => {
            networks.cut();
            "outages"
        }
        1 => {
            rig.kill_robot_relay();
            rig.start_robot_relay();
            "robot's relay"
        }
        2 => {
            rig.kill_station_relay();
            rig.start_station_relay();
            "station's relay"
        }
        _ => {
            bridges.push(rig.restart_bridge());
            "bridge"
        }
    }
}

/// Requests through loss, outages and restarts of everything: each ends once, and none is executed twice.
pub fn requests(site: &Site) {
    let Some(mut networks) = networks(site, protocol(site), 20, Duration::ZERO) else {
        return;
    };
    let [latitude_deg, longitude_deg, altitude_m] = networks.rig.place();
    let ipc = networks.rig.station.domain.join("operator");
    let mut requests = Requests {
        movements: ipc.client().expect("a client"),
        controls: ipc.client().expect("a client"),
        open: BTreeSet::new(),
        ended: BTreeMap::new(),
        repeated: 0,
        place: WaypointPosition {
            latitude_deg,
            longitude_deg,
            altitude_m: altitude_m + 6.0,
        },
        count: 0,
    };
    let mut bridges: Vec<Finished> = Vec::new();
    let mut disturbances = BTreeMap::<&str, u32>::new();
    let mut chance = site.chance(1);
    let mut next_disturbance = MonotonicNs::now() + BETWEEN;
    let mut fine_again: Option<MonotonicNs> = None;
    while requests.count < site.plan.count(1000) && site.goes_on() {
        requests.send();
        requests.wait();
        let now = MonotonicNs::now();
        if fine_again.take_if(|at| *at <= now).is_some() {
            networks.calm();
        }
        if now >= next_disturbance {
            let what = disturb(&mut networks, &mut bridges, &mut chance);
            *disturbances.entry(what).or_default() += 1;
            if what == "outages" {
                fine_again = Some(now + OUTAGE);
            }
            let pause = BETWEEN.mul_f64(0.25 + 1.5 * chance.f64());
            next_disturbance = MonotonicNs::now() + pause;
        }
    }
    networks.calm();
    let give_up = MonotonicNs::now() + LAST_WAIT;
    while !requests.open.is_empty() && MonotonicNs::now() < give_up && site.goes_on() {
        requests.wait();
    }
    let Requests {
        open,
        ended,
        repeated,
        ..
    } = requests;
    drop(ipc);
    let [last, _] = networks.end();
    bridges.push(last);
    let log = BridgeLog::of(&bridges);
    let executed = log.accepted();
    let mut finals = BTreeMap::<String, usize>::new();
    let mut untrue = 0;
    for (id, report) in &ended {
        let stage = report.stage().map_or("?", Stage::name);
        let reason = match report.reason() {
            None | Some(Reason::None) => String::new(),
            Some(reason) => format!(" ({})", reason.name()),
        };
        *finals.entry(format!("{stage}{reason}")).or_default() += 1;
        let is_refused = report.stage() == Some(Stage::Refused);
        untrue += usize::from(is_refused && executed.contains(id));
    }
    let mut outcome = Outcome::default();
    outcome.cell("packets lost, %", networks.loss * 100.0);
    outcome.cell("disturbances", format!("{disturbances:?}"));
    outcome.cell("requests", ended.len() + open.len());
    outcome.cell("executed", executed.len());
    outcome.none("without a final report", open.len());
    outcome.none("with two", repeated);
    outcome.none("executed twice", log.executed_twice().len());
    outcome.none("refused and executed all the same", untrue);
    let finals = finals.iter().map(|(end, count)| format!("{count} {end}"));
    outcome.cell("final reports", finals.collect::<Vec<_>>().join(", "));
    site.show(outcome);
}

/// What a link of 600 ms that loses a fifth is to need at most until it is up.
const GOAL: Duration = Duration::from_secs(15);

/// A station that is not connected by then is counted as such.
const GIVE_UP: Duration = Duration::from_secs(120);

/// How soon a station is connected over a bad link: from the start of its relay until the link is up, over each
/// protocol.
pub fn connect(site: &Site) {
    let one_way = site.plan.one_way(600);
    for protocol in site.plan.protocols(&["tcp", "quic"]) {
        let Some(mut networks) = networks(site, protocol, 20, one_way) else {
            return;
        };
        let (mut up_after, mut never) = (Times::default(), 0);
        for _ in 0..site.plan.count(12) {
            if !site.goes_on() {
                break;
            }
            networks.rig.kill_station_relay();
            let began = MonotonicNs::now();
            networks.rig.start_station_relay();
            match up_since(&networks.rig.station, began) {
                Some(at) => up_after.push(at.since(began)),
                None => never += 1,
            }
        }
        networks.end();
        let mut outcome = Outcome::default();
        outcome.cell("round trip, ms", 2 * one_way.as_millis());
        outcome.cell("packets lost each way, %", networks.loss * 100.0);
        outcome.cell("over", protocol);
        outcome.cell("connected", up_after.count());
        let within = up_after.0.iter().filter(|took| **took <= GOAL).count();
        outcome.cell("within 15 s", within);
        let times = up_after.quantiles_s(&[0.5, 0.9, 1.0]);
        outcome.cell("up after: p50, p90, worst, s", times);
        outcome.none("not in 120 s", never);
        site.show(outcome);
    }
}

/// When the link came up that was made after `began`.
fn up_since(station: &Sandbox, began: MonotonicNs) -> Option<MonotonicNs> {
    let mut links = station.subscribe::<RelayLink>(1).port;
    let give_up = began + GIVE_UP;
    loop {
        // What cannot be received now can be by the next call, says the subscriber.
        if let Ok(Some(link)) = links.latest()
            && link.state == RelayLinkState::Up.code()
            && link.since_ns >= began.0
        {
            return Some(MonotonicNs(link.published_ns));
        }
        let left = give_up.since(MonotonicNs::now());
        if left.is_zero() || links.wait(left).expect("a wait") == Wake::TimedOut {
            return None;
        }
    }
}

/// Fine weather between two outages.
const FINE: Duration = Duration::from_secs(3);

/// Number of a sample, and when it was received from the DSP, as the station shows it.
type Shown = (u64, MonotonicNs);

/// Outages: how soon something fresh comes after them, and how true its shown age is, by the robot's own stamps. The
/// station shows when a sample was received in its own clock, and how far that may be from the truth; the robot's clock
/// is ahead by a known time.
pub fn outages(site: &Site) {
    let Some(mut networks) = networks(site, protocol(site), 0, Duration::ZERO) else {
        return;
    };
    let outage = Duration::from_secs(site.plan.outage_s);
    let truth = Truth::start(&networks.rig.robot);
    let station = &networks.rig.station;
    let mut link = station.subscribe::<RelayLink>(1);
    let known = link.until("the clocks are known", |link| link.clock_valid == 1);
    drop(link);
    let uncertainty = |link: &RelayLink| link.clock_uncertainty_s;
    let links = Listener::start(&station.domain, RobotId::DEFAULT, uncertainty);
    let received = |sample: &HeroTelemetry| (sample.source_sequence, sample.received());
    let telemetry = Listener::start(&station.domain, RobotId::DEFAULT, received);
    let (mut shown, mut fresh_after) = (Vec::new(), Times::default());
    for number in 0..site.plan.count(20) {
        if !site.goes_on() {
            break;
        }
        shown.extend(telemetry.until(MonotonicNs::now() + FINE));
        networks.cut();
        // Ends in the middle of another attempt to connect each time.
        let longer = Duration::from_millis(u64::from(number) * 230 % 1500);
        shown.extend(telemetry.until(MonotonicNs::now() + outage + longer));
        networks.calm();
        let back = MonotonicNs::now();
        // From the end of the outage to the first sample that the DSP sent after it.
        loop {
            let heard = telemetry.next();
            shown.push(heard);
            if heard.kept.1 >= back {
                break fresh_after.push(heard.at.since(back));
            }
        }
    }
    telemetry.end();
    let (links, _) = links.end();
    let truth = truth.end(&networks.rig.robot);
    networks.end();
    let mut outcome = Outcome::default();
    outcome.cell("outages", format!("{} of {outage:?}", fresh_after.count()));
    outcome.cell("packets lost otherwise, %", networks.loss * 100.0);
    outcome.cell("first fresh sample after", fresh_after);
    let uncertainty_s = |at: MonotonicNs| {
        let before = links.partition_point(|link| link.at <= at).checked_sub(1);
        before.map_or(known.clock_uncertainty_s, |last| links[last].kept)
    };
    compare(&mut outcome, &shown, &truth, uncertainty_s);
    site.show(outcome);
}

/// Compares what was shown with the truth: no sample may be further from it than the uncertainty that was shown when it
/// came.
fn compare(
    outcome: &mut Outcome,
    shown: &[Heard<Shown>],
    truth: &HashMap<u64, MonotonicNs>,
    uncertainty_s: impl Fn(MonotonicNs) -> f64,
) {
    let (mut compared, mut untrue, mut most_error_s, mut most_uncertainty_s) =
        (0, 0, 0.0_f64, 0.0_f64);
    for Heard {
        at,
        kept: (number, received),
    } in shown
    {
        if let Some(truth) = truth.get(number) {
            let error_s = received.0.abs_diff(truth.0) as f64 * 1e-9;
            let uncertainty_s = uncertainty_s(*at);
            compared += 1;
            untrue += usize::from(error_s > uncertainty_s);
            most_error_s = most_error_s.max(error_s);
            most_uncertainty_s = most_uncertainty_s.max(uncertainty_s);
        }
    }
    outcome.cell("shown ages compared with the truth", compared);
    outcome.require(compared > 0, "nothing could be compared");
    outcome.none("beyond the shown uncertainty", untrue);
    outcome.cell("greatest error, ms", format!("{:.2}", most_error_s * 1e3));
    let uncertainty_ms = format!("{:.2}", most_uncertainty_s * 1e3);
    outcome.cell("greatest uncertainty, ms", uncertainty_ms);
}

/// Writes down when the robot received each sample.
struct Truth(Process);

impl Truth {
    fn start(robot: &Sandbox) -> Truth {
        let mut echo = robot.start("echo dsp --json --field sequence --field received_ns");
        echo.wait_for_line(|line| line.stream == Stream::Stdout);
        Truth(echo)
    }

    /// When each sample was received, in the station's clock.
    fn end(self, robot: &Sandbox) -> HashMap<u64, MonotonicNs> {
        let ahead_ns = AHEAD_S.unsigned_abs() * 1_000_000_000;
        let entry = |line: String| {
            let sample: serde_json::Value = serde_json::from_str(&line).ok()?;
            let received_ns = sample["received_ns"].as_u64()?;
            let received = MonotonicNs(received_ns.saturating_sub(ahead_ns));
            Some((sample["sequence"].as_u64()?, received))
        };
        robot
            .kill(self.0)
            .stdout
            .into_iter()
            .filter_map(entry)
            .collect()
    }
}
