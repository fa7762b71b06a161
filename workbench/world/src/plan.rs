//! A plan of `ril plan fly`: its steps, one after the other, by the values that the command has: [`Executor`],
//! [`Steps`] and [`Exchange`]. What must hold: its items are flown in order, each after its hover, and none after
//! something newer was accepted.

use std::time::Duration;

use dsp_protocol::Waypoint;
use ipc_types::MonotonicNs;
use ipc_types::code::Stage;
use ipc_types::payload::{MovementData, RequestReport};
use operator::request::{Exchange, Next, Outcome, Steps, Until};
use plans::executor::Executor;
use plans::steps::{PathPoint, Step};

use crate::judge::Ordered;
use crate::life::{MS, TICK_MS};
use crate::plant::Plant;
use crate::request::Request;
use crate::robot::Robot;
use crate::script::{Order, What};

/// How long the bridge has for its first answer.
const TIMEOUT: Duration = Duration::from_secs(2);

/// A path that is under way.
struct Open {
    exchange: Exchange,
    order: usize,
    requests: Vec<MovementData>,
}

/// A program that flies a plan.
pub struct PlanFlight {
    pub process: u32,
    plant: Plant,
    executor: Executor,
    steps: Steps,
    open: Option<Open>,
    /// The order that was the last step, its last request, and how long is hovered after it, ms.
    before: Option<(usize, u64, u64)>,
}

impl PlanFlight {
    /// It is to fly to these places, east and north of home, m, with a hover at each, ms.
    pub fn new(
        process: u32,
        places: &[(f64, f64, u64)],
        robot: &Robot,
        plant: Plant,
    ) -> PlanFlight {
        let mut steps: Vec<Step> = Vec::new();
        for (item, (east, north, hover_ms)) in (1..).zip(places) {
            let at = robot.waypoint(0, 0, (*east, *north));
            let waypoint = Waypoint {
                latitude_deg: at.latitude_deg,
                longitude_deg: at.longitude_deg,
                altitude_m: at.altitude_m,
            };
            let point = PathPoint { item, waypoint };
            match steps.last_mut() {
                Some(Step::Path(points)) => points.push(point),
                _ => steps.push(Step::Path(vec![point])),
            }
            if *hover_ms > 0 {
                let duration_s = *hover_ms as f64 / 1e3;
                steps.push(Step::Wait { item, duration_s });
            }
        }
        let mut executor = Executor::new(steps, 1);
        executor.begin();
        PlanFlight {
            process,
            plant,
            executor,
            steps: Steps::new(robot.host(), 0),
            open: None,
            before: None,
        }
    }

    /// The bridge has reported.
    pub fn report(&mut self, report: &RequestReport, robot: &mut Robot) {
        let now = robot.host();
        if let Some(open) = &mut self.open {
            let is_of_it = open.exchange.take(report, now).is_some();
            if is_of_it && report.stage() != Some(Stage::Refused) {
                self.executor.reached(report.waypoints_reached as usize);
            }
        }
    }

    /// It is awake: does the next step when it is time to.
    pub fn step(&mut self, robot: &mut Robot, next_id: &mut u64) {
        let now = robot.host();
        self.go_on(robot);
        self.executor.advance(now);
        if self.open.is_some() {
            return;
        }
        match self.executor.poll(now).cloned() {
            Some(Step::Path(points)) => self.begin(&points, robot, next_id),
            Some(Step::Wait { duration_s, .. }) => {
                if let Some((.., hover_ms)) = &mut self.before {
                    *hover_ms += (duration_s * 1e3) as u64;
                }
            }
            _ => {}
        }
    }

    fn begin(&mut self, points: &[PathPoint], robot: &mut Robot, next_id: &mut u64) {
        let now_ms = robot.now_ms;
        let number = robot.judge.orders.len();
        let what = What::Path(vec![(0.0, 0.0); points.len()]);
        let mut requests = robot.requests(&what, *next_id);
        *next_id += requests.len() as u64;
        let places: Vec<_> = points.iter().map(PathPoint::position).collect();
        robot.go_to(&mut requests, &places);
        let requests = requests.iter().filter_map(Request::movement);
        let issued_ns = robot.host().0;
        let requests = requests.map(|data| MovementData {
            issued_ns,
            preempt: 0,
            ..data
        });
        let requests = self.steps.next(requests);
        let (issued_ns, begin_by_ns) = (requests[0].issued_ns, requests[0].begin_by_ns);
        let true_ms = robot.judge.true_ms_of(MonotonicNs(issued_ns));
        robot.judge.ordered(Ordered {
            order: Order::at_once(usize::MAX, robot.index, what),
            ids: requests.iter().map(|request| request.request_id).collect(),
            after: self.before.map_or(0, |(_, request, _)| request),
            true_ms,
            issued_ms: true_ms,
            begin_by_ms: (begin_by_ns > 0).then(|| true_ms + (begin_by_ns - issued_ns) / MS),
            process: self.process,
            ..Ordered::default()
        });
        if let Some((before, _, hover_ms)) = self.before {
            let done_ms = robot.judge.done_ms(before);
            if done_ms.is_none_or(|done_ms| now_ms + 2 * TICK_MS < done_ms + hover_ms) {
                let text = format!("order {number} of a plan follows {before} too early");
                robot.judge.fail(text);
            }
        }
        robot.judge.ran.plan_paths += 1;
        let ids = requests.iter().map(|request| request.request_id);
        self.open = Some(Open {
            exchange: Exchange::new(ids, Until::Final, TIMEOUT),
            order: number,
            requests,
        });
        self.go_on(robot);
    }

    /// Sends what is to be sent, and ends what has ended.
    fn go_on(&mut self, robot: &mut Robot) {
        let now = robot.host();
        let Some(open) = &mut self.open else { return };
        let outcome = loop {
            match open.exchange.next(now) {
                Next::Wait(_) => return,
                Next::Send(index) => {
                    let mut request = open.requests[index];
                    if self.plant == Plant::PlanForgetsStep {
                        request.after = 0;
                    }
                    open.exchange.sent(now);
                    let request = Request::Movement(request);
                    robot.send(robot.now_ms, open.order, self.process, request);
                }
                Next::Over(outcome) => break outcome,
            }
        };
        match outcome {
            Outcome::Final(end) if end.stage == Stage::Done => {
                self.steps.done(&open.requests);
                let last = open.requests[open.requests.len() - 1].request_id;
                self.before = Some((open.order, last, 0));
                self.executor.step_done();
            }
            _ => self.executor.fail("its step ended otherwise than done"),
        }
        self.open = None;
    }
}
