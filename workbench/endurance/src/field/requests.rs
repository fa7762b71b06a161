//! Requests through loss, outages and restarts of everything: each ends once, and none is executed twice.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{
    DspTelemetry, ModuleControl, MovementData, RequestReport, WaypointPosition,
};
use ipc_types::{Client, MonotonicNs, SendError, fresh_request_id};
use ril_tests::process::Finished;

use crate::air::{Air, Weather};
use crate::bridge_log::BridgeLog;
use crate::site::{Plan, Site};

/// From one request to the next.
const PERIOD: Duration = Duration::from_millis(150);

/// From one disturbance to the next, in the middle.
const BETWEEN: Duration = Duration::from_secs(8);

/// How long an outage lasts.
const OUTAGE: Duration = Duration::from_secs(10);

/// How long the end of a request is waited for after all disturbances. A relay gives a request up after a minute.
const PATIENCE: Duration = Duration::from_secs(150);

/// What disturbs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Disturbance {
    Outage,
    RobotRelay,
    StationRelay,
    Bridge,
}

const DISTURBANCES: [Disturbance; 4] = [
    Disturbance::Outage,
    Disturbance::RobotRelay,
    Disturbance::StationRelay,
    Disturbance::Bridge,
];

/// What came of it.
#[derive(Default)]
pub struct Outcome {
    loss: f64,
    sent: usize,
    disturbances: BTreeMap<Disturbance, u32>,
    /// Final reports by stage and reason.
    finals: BTreeMap<String, usize>,
    /// Requests without a final report.
    silent: usize,
    /// Final reports about requests that had one.
    repeated: usize,
    /// Requests that a bridge accepted.
    executed: usize,
    executed_twice: usize,
    /// Requests that were said to be refused or not to be known, of which a bridge carried out those of the first kind.
    untrue: usize,
}

impl Outcome {
    /// Whether every promise was kept.
    pub fn is_good(&self) -> bool {
        self.silent + self.repeated + self.executed_twice + self.untrue == 0
    }
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "requests through {:.0} % loss, {:?} | {} requests: {} without a final report, {} with two, {} executed, {} executed twice, {} \
             refused and executed all the same; ",
            self.loss * 100.0,
            self.disturbances,
            self.sent,
            self.silent,
            self.repeated,
            self.executed,
            self.executed_twice,
            self.untrue
        )?;
        let finals: Vec<String> = self
            .finals
            .iter()
            .map(|(end, count)| format!("{count} {end}"))
            .collect();
        write!(f, "{}", finals.join(", "))
    }
}

/// Both clients, and what they heard.
struct Operator {
    movements: Client<MovementData>,
    controls: Client<ModuleControl>,
    open: BTreeSet<u64>,
    /// Final reports.
    ended: BTreeMap<u64, RequestReport>,
    repeated: usize,
    place: WaypointPosition,
    count: u32,
}

impl Operator {
    /// Sends the next request: mostly a waypoint that takes the place of the one before, sometimes a start.
    fn send(&mut self) {
        let id = fresh_request_id();
        let sent = match self.count % 5 {
            0 => self
                .controls
                .send(&ModuleControl::new(id, ControlCommand::Start)),
            1 => self.movements.send(&MovementData::take_off(id, 5.0)),
            number => {
                let mut to = self.place;
                to.latitude_deg += f64::from(number) * 0.000_02;
                let mut waypoint = MovementData::path(id, &[to], || id).next().expect("one");
                waypoint.preempt = 1;
                self.movements.send(&waypoint)
            }
        };
        match sent {
            Ok(()) => {
                self.count += 1;
                self.open.insert(id);
            }
            // It was not sent, and the program knows.
            Err(
                SendError::NoServer { .. } | SendError::TooManyOutstanding | SendError::ServerFull,
            ) => {}
            Err(error) => panic!("{error}"),
        }
    }

    fn drain(&mut self) {
        let (open, ended, repeated) = (&mut self.open, &mut self.ended, &mut self.repeated);
        let mut take = |report: &RequestReport| {
            if !report.is_final() {
                return;
            }
            match open.remove(&report.request_id) {
                true => _ = ended.insert(report.request_id, *report),
                false => *repeated += 1,
            }
        };
        self.movements.drain(&mut take);
        self.controls.drain(&mut take);
    }

    /// Sleeps until there may be a report, or this moment.
    fn wait_until(&mut self, end: MonotonicNs) {
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

/// Sends `count` requests, and disturbs everything meanwhile.
///
/// # Errors
///
/// Why this machine cannot do it.
pub fn run(
    plan: &Plan,
    count: u32,
    loss: f64,
    goes_on: &dyn Fn() -> bool,
) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    let place = site.station.subscribe::<DspTelemetry>(1).next().geographic;
    let ipc = site.station.domain.join("operator");
    let mut operator = Operator {
        movements: ipc.client().expect("a client"),
        controls: ipc.client().expect("a client"),
        open: BTreeSet::new(),
        ended: BTreeMap::new(),
        repeated: 0,
        place: WaypointPosition {
            latitude_deg: place.latitude_deg,
            longitude_deg: place.longitude_deg,
            altitude_m: place.altitude_m + 6.0,
        },
        count: 0,
    };
    site.air.set(Weather::loss(loss));
    let mut outcome = Outcome {
        loss,
        ..Outcome::default()
    };
    let mut killed_bridges: Vec<Finished> = Vec::new();
    let mut chance = Chance(plan.seed);
    let mut next_disturbance = MonotonicNs::now() + BETWEEN;
    let mut fine_again: Option<MonotonicNs> = None;
    while operator.count < count && goes_on() {
        operator.send();
        operator.wait_until(MonotonicNs::now() + PERIOD);
        let now = MonotonicNs::now();
        if fine_again.is_some_and(|at| at <= now) {
            site.air.set(Weather::loss(loss));
            fine_again = None;
        }
        if now >= next_disturbance {
            let disturbance = DISTURBANCES[chance.below(DISTURBANCES.len() as u64) as usize];
            *outcome.disturbances.entry(disturbance).or_default() += 1;
            match disturbance {
                Disturbance::Outage => {
                    site.air.set(Weather::OUTAGE);
                    fine_again = Some(now + OUTAGE);
                }
                Disturbance::RobotRelay => site.restart_robot_relay(),
                Disturbance::StationRelay => site.restart_station_relay(),
                Disturbance::Bridge => {
                    let crew = site.crew.as_mut().expect("it runs");
                    killed_bridges.push(crew.restart_bridge(&site.robot));
                }
            }
            let pause = BETWEEN.mul_f64(0.25 + chance.below(1000) as f64 / 666.0);
            next_disturbance = MonotonicNs::now() + pause;
        }
    }
    site.air.set(Weather::loss(loss));
    let give_up = MonotonicNs::now() + PATIENCE;
    while !operator.open.is_empty() && MonotonicNs::now() < give_up && goes_on() {
        operator.wait_until(MonotonicNs::now() + PERIOD);
    }
    let [last, _] = {
        outcome.sent = operator.ended.len() + operator.open.len();
        outcome.silent = operator.open.len();
        outcome.repeated = operator.repeated;
        drop((operator.movements, operator.controls, ipc));
        site.end()
    };
    killed_bridges.push(last);
    let log = BridgeLog::of(&killed_bridges);
    let executed = log.accepted();
    outcome.executed = executed.len();
    outcome.executed_twice = log.executed_twice().len();
    for (id, report) in &operator.ended {
        let stage = report.stage().map_or("?", Stage::name);
        let reason = match report.reason() {
            None | Some(Reason::None) => String::new(),
            Some(reason) => format!(" ({})", reason.name()),
        };
        *outcome
            .finals
            .entry(format!("{stage}{reason}"))
            .or_default() += 1;
        let is_refused = report.stage() == Some(Stage::Refused);
        outcome.untrue += usize::from(is_refused && executed.contains(id));
    }
    Ok(outcome)
}

/// Draws numbers, the same for the same seed.
struct Chance(u64);

impl Chance {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(1);
        (Air::new(self.0).share() * bound as f64) as u64
    }
}
