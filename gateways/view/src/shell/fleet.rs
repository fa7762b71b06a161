//! [`Fleet`]: the robots that are shown, each with its ports, its model and its last minutes. Robots that come later
//! are joined.

use std::time::Duration;

use bridge::BridgeConfig;
use bridge::safety::fence::Fence;
use ipc_types::{Domain, MonotonicNs, RobotId, Source};
use operator::request::ports::{RobotPorts, Wakers};
use operator::robot::chart::fence_of;
use operator::robot::model::{HeldOutline, Process, WatchedRobot};
use operator::robot::pilot::request_under_way;
use operator::robot::running::RunningBridge;
use operator::session::{Topics, alive};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::speaker::SpokenRobot;

/// Most robots that are shown: as many as a relay carries. Those that come later are not joined, which is logged.
pub(crate) const MAX_ROBOTS: usize = 32;

/// How often robots that came are looked for.
const LOOK_PERIOD: Duration = Duration::from_secs(2);

/// What is known of the rules by which the bridge judges an order.
#[derive(Clone, Copy, Debug)]
pub(crate) enum KnownRules<'a> {
    /// All: the configuration that the bridge publishes.
    Running(&'a BridgeConfig),
    /// The fence that it holds, but not its margin nor the limits: a bridge behind a relay.
    Fence(&'a Fence),
    /// The bridge has published neither.
    Nothing,
}

/// A robot that is shown.
pub(crate) struct ShownRobot {
    pub robot: WatchedRobot,
    pub ports: RobotPorts,
    /// The fence that the bridge holds, and the number of its outline; none in the place of one that cannot be judged
    /// by.
    fence: Option<(u64, Option<Fence>)>,
    running: RunningBridge,
    /// What the bridge runs with; `None` if it does not publish it here, as one behind a relay.
    config: Option<BridgeConfig>,
    /// Whether something of it came at the last look.
    has_news: bool,
}

impl ShownRobot {
    /// What is known of the rules by which the bridge judges an order.
    pub fn rules(&self) -> KnownRules<'_> {
        if let Some(config) = &self.config {
            return KnownRules::Running(config);
        }
        let fence = self.fence.as_ref().and_then(|(_, fence)| fence.as_ref());
        match fence.filter(|_| !self.robot.is_held_outdated()) {
            Some(fence) => KnownRules::Fence(fence),
            None => KnownRules::Nothing,
        }
    }

    /// Takes the configuration that the bridge runs with.
    fn take_config(&mut self) {
        self.running.drain();
        if let Some(config) = self.running.take() {
            self.config = Some(config);
        }
    }

    fn take_fence(&mut self) {
        let Some(HeldOutline { outline: held, .. }) = &self.robot.held else {
            return;
        };
        if self.fence.as_ref().map(|(number, _)| *number) != Some(held.number) {
            let fence = fence_of(held)
                .inspect_err(|why| tracing::warn!(robot = %self.robot.id, why, "the fence"))
                .ok();
            self.fence = Some((held.number, fence));
        }
    }
}

/// The robots that are shown, each with its ports, its model and its last minutes.
pub(crate) struct Fleet {
    domain: Domain,
    shown: Vec<ShownRobot>,
    /// When to look for others; `None` if the operator named those that are shown.
    next_look: Option<MonotonicNs>,
    has_refused: bool,
}

impl Fleet {
    /// Joins the robots that are `named`, or else those that are alive.
    ///
    /// # Errors
    ///
    /// Code 2 when too many are named, 1 when shared memory cannot be joined.
    pub fn join(domain: Domain, named: &[RobotId]) -> Result<Fleet, Failure> {
        if named.len() > MAX_ROBOTS {
            let text = format!(
                "{} robots are named, and a view has {MAX_ROBOTS}",
                named.len()
            );
            return Err(Failure::usage(text));
        }
        let mut fleet = Fleet {
            domain,
            shown: Vec::new(),
            next_look: named.is_empty().then_some(MonotonicNs(0)),
            has_refused: false,
        };
        for robot in named {
            fleet.add(*robot)?;
        }
        fleet.look(MonotonicNs::now());
        if fleet.shown.is_empty() {
            // Robot 1 is the default of every command; the page shows what it lacks.
            fleet.add(RobotId::DEFAULT)?;
        }
        Ok(fleet)
    }

    /// No robots, and none that come later: a recording is shown.
    pub fn none(domain: Domain) -> Fleet {
        Fleet {
            domain,
            shown: Vec::new(),
            next_look: None,
            has_refused: false,
        }
    }

    /// Joins robots that have come, when it is time to look for some; says whether one has.
    pub fn look(&mut self, now: MonotonicNs) -> bool {
        if self.next_look.is_none_or(|next| now < next) {
            return false;
        }
        self.next_look = Some(now + LOOK_PERIOD);
        let alive = match alive(&self.domain) {
            Ok(alive) => alive,
            Err(error) => {
                tracing::warn!(%error, "robots cannot be looked for");
                return false;
            }
        };
        let mut has_come = false;
        for robot in alive {
            if self.shown.iter().any(|one| one.robot.id == robot) {
                continue;
            }
            if self.shown.len() == MAX_ROBOTS {
                if !self.has_refused {
                    tracing::warn!(%robot, "not shown: {MAX_ROBOTS} robots are");
                    self.has_refused = true;
                }
                continue;
            }
            match self.add(robot) {
                Ok(()) => has_come = true,
                Err(failure) => {
                    tracing::warn!(%robot, chain = ?failure.chain(), "the robot cannot be joined");
                }
            }
        }
        has_come
    }

    fn add(&mut self, robot: RobotId) -> Result<(), Failure> {
        if self.shown.iter().any(|one| one.robot.id == robot) {
            return Ok(());
        }
        let ports = RobotPorts::open(&self.domain, robot, true)?;
        let running = RunningBridge::open(ports.ipc()).or_fail(ExitCode::Internal)?;
        self.shown.push(ShownRobot {
            running,
            config: None,
            robot: WatchedRobot::new(robot),
            ports,
            fence: None,
            has_news: true,
        });
        self.shown.sort_by_key(|one| one.robot.id);
        Ok(())
    }

    /// Takes all that is there of all robots. Gives the moment after that, by which what was taken is to be judged:
    /// nothing of it is of later.
    pub fn drain(&mut self, clock: impl Fn() -> MonotonicNs) -> MonotonicNs {
        for one in &mut self.shown {
            let now = clock();
            one.has_news = one.ports.drain(&mut one.robot, now);
            one.has_news |= one.ports.look(&mut one.robot, now);
            one.take_fence();
            one.take_config();
            one.robot.judge(clock());
        }
        clock()
    }

    /// What is to wake the process of at most `most` robots: reports about orders. Those of further robots are taken at
    /// the next drain.
    pub fn sources(&mut self, most: usize) -> impl Iterator<Item = &mut dyn Source> {
        let now = MonotonicNs::now();
        let sources = self.shown.iter_mut().flat_map(move |one| {
            let status = one.robot.process(Process::Status, now);
            one.ports.sources(Wakers::Orders, status)
        });
        sources.take(most)
    }

    /// When an order of some robot is to be looked at.
    pub fn next_order(&self) -> Option<MonotonicNs> {
        self.shown.iter().filter_map(|one| one.ports.next()).min()
    }

    /// Each robot, with the request whose movement it carries out.
    pub fn under_way(&self) -> impl Iterator<Item = (u32, Option<u64>)> {
        self.shown.iter().map(|one| {
            let state = one.robot.state.as_ref();
            (one.robot.id.get(), state.and_then(request_under_way))
        })
    }

    pub fn ids(&self) -> Vec<u32> {
        self.shown.iter().map(|one| one.robot.id.get()).collect()
    }

    /// The robots as pages get them.
    pub fn seen(&self) -> impl Iterator<Item = SpokenRobot<'_>> {
        self.shown.iter().map(|one| SpokenRobot {
            robot: &one.robot,
            has_news: one.has_news,
        })
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut ShownRobot> {
        self.shown.iter_mut()
    }

    /// The robot of this number, if it is shown.
    pub fn get_mut(&mut self, robot: u32) -> Option<&mut ShownRobot> {
        self.shown
            .iter_mut()
            .find(|one| one.robot.id.get() == robot)
    }
}
