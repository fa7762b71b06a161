//! Requests through loss, outages and restarts of everything: each ends once, and none is executed twice.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{ModuleControl, MovementData, RequestReport, WaypointPosition};
use ipc_types::{Client, MonotonicNs, SendError, fresh_request_id};
use ril_tests::process::Finished;
use ril_tests::relayed::BridgeLog;

use super::site::{Plan, Site};
use crate::outcome::Outcome;

/// From one request to the next.
const PERIOD: Duration = Duration::from_millis(150);

/// From one disturbance to the next, in the middle.
const BETWEEN: Duration = Duration::from_secs(8);

/// How long an outage lasts.
const OUTAGE: Duration = Duration::from_secs(10);

/// How long the end of a request is waited for after all disturbances. A relay gives a request up after a minute.
const LAST_WAIT: Duration = Duration::from_secs(150);

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

/// Both clients, and the reports that they got.
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
            Ok(_) => {
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
pub fn run(plan: &Plan, count: u32, goes_on: &dyn Fn() -> bool) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    let [latitude_deg, longitude_deg, altitude_m] = site.rig.place();
    let ipc = site.rig.station.domain.join("operator");
    let mut operator = Operator {
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
    let mut disturbances = BTreeMap::<Disturbance, u32>::new();
    let mut chance = Random::new(plan.seed, 1);
    let mut next_disturbance = MonotonicNs::now() + BETWEEN;
    let mut fine_again: Option<MonotonicNs> = None;
    while operator.count < count && goes_on() {
        operator.send();
        operator.wait_until(MonotonicNs::now() + PERIOD);
        let now = MonotonicNs::now();
        if fine_again.is_some_and(|at| at <= now) {
            site.tunnel.lose(plan.loss);
            fine_again = None;
        }
        if now >= next_disturbance {
            let disturbance = DISTURBANCES[chance.next_u64() as usize % DISTURBANCES.len()];
            *disturbances.entry(disturbance).or_default() += 1;
            match disturbance {
                Disturbance::Outage => {
                    site.tunnel.lose(1.0);
                    fine_again = Some(now + OUTAGE);
                }
                Disturbance::RobotRelay => {
                    site.rig.kill_robot_relay();
                    site.rig.start_robot_relay();
                }
                Disturbance::StationRelay => {
                    site.rig.kill_station_relay();
                    site.rig.start_station_relay();
                }
                Disturbance::Bridge => bridges.push(site.rig.restart_bridge()),
            }
            let pause = BETWEEN.mul_f64(0.25 + 1.5 * chance.uniform());
            next_disturbance = MonotonicNs::now() + pause;
        }
    }
    site.tunnel.lose(plan.loss);
    let give_up = MonotonicNs::now() + LAST_WAIT;
    while !operator.open.is_empty() && MonotonicNs::now() < give_up && goes_on() {
        operator.wait_until(MonotonicNs::now() + PERIOD);
    }
    let Operator {
        open,
        ended,
        repeated,
        ..
    } = operator;
    drop(ipc);
    let [last, _] = site.end();
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
    outcome.cell("packets lost, %", plan.loss * 100.0);
    outcome.cell("disturbances", format!("{disturbances:?}"));
    outcome.cell("requests", ended.len() + open.len());
    outcome.cell("executed", executed.len());
    for (heading, count) in [
        ("without a final report", open.len()),
        ("with two", repeated),
        ("executed twice", log.executed_twice().len()),
        ("refused and executed all the same", untrue),
    ] {
        outcome.cell(heading, count);
        outcome.require(count == 0, format!("{count} {heading}"));
    }
    let finals = finals.iter().map(|(end, count)| format!("{count} {end}"));
    outcome.cell("final reports", finals.collect::<Vec<_>>().join(", "));
    Ok(outcome)
}
