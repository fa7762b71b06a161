//! Many robots for a long time, in virtual time: each is the bridge's core and a simulated DSP with a helicopter, and
//! one operator flies all of them over and over. No report goes astray, no robot shows another one's place, and nothing
//! grows.
//!
//! The program `figures` flies them for longer:
//! `cargo run --release -p ril-tests --example figures -- fleet --robots 100 --hours 24`.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use bridge::outputs::Notice;
use bridge::{Bridge, BridgeConfig, Input, Outputs, RequestKey, Sender};
use dsp_sim::config::Config as SimulatorConfig;
use dsp_sim::simulator::Simulator;
use ipc_types::code::{ControlCommand, LinkState, Stage};
use ipc_types::payload::{
    DspTelemetry, ModuleControl, ModuleState, MovementData, RequestReport, WaypointPosition,
};
use ipc_types::{MonotonicNs, TelemetryGroup};

use crate::bytes::heap::Heap;
use crate::missions::seeds::sums;

/// The host's clock when the world begins.
const HOST_EPOCH: MonotonicNs = MonotonicNs(86_400_000_000_000);

/// How far the robots stand from each other, degrees of latitude.
const APART_DEG: f64 = 0.002;

/// How long each looks around on the ground between two missions.
const REST: Duration = Duration::from_secs(60);

/// How often the operator looks at all robots.
const LOOK: Duration = Duration::from_secs(1);

/// When memory is looked at first: each bridge then remembers as many requests that have ended as it ever does.
const WARM: Duration = Duration::from_secs(2 * 3600);

/// A request takes no longer than this.
const LONGEST: Duration = Duration::from_secs(300);

sums! {
    /// What became of the robots.
    pub struct Figures {
        /// How many flew.
        pub robots: u64,
        /// Landings.
        pub missions: u64,
        /// Requests that ended as done; every other end fails.
        pub requests: u64,
        /// Samples of telemetry.
        pub samples: u64,
        /// Bytes of memory at the end that were not there after [`WARM`].
        pub growth_bytes: i64,
    }
}

/// What the operator does next with a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Start,
    TakeOff,
    FlyOut,
    FlyBack,
    Land,
}

/// What a robot says.
#[derive(Default)]
struct Heard {
    home_latitude_deg: f64,
    samples: u64,
    is_up: bool,
    /// Reports since the operator looked last; a bridge has one movement at a time, so that they are few.
    reports: Vec<RequestReport>,
}

impl Outputs for Heard {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        self.samples += 1;
        if sample.valid(TelemetryGroup::Geographic) {
            let off = sample.geographic.latitude_deg - self.home_latitude_deg;
            assert!(
                off.abs() < APART_DEG / 2.0,
                "another robot's place: {off} °"
            );
        }
    }

    fn state(&mut self, state: &ModuleState) {
        self.is_up = state.link.state() == Some(LinkState::Up);
    }

    fn report(&mut self, _: RequestKey, report: &RequestReport) {
        self.reports.push(*report);
    }

    fn notice(&mut self, _: &Notice) {}
}

struct Robot {
    number: u32,
    bridge: Bridge,
    simulator: Simulator,
    heard: Heard,
    now: Duration,
    next: Step,
    /// The request that was given, and when.
    open: Option<(u64, Duration)>,
    resting_until: Duration,
    path_id: u64,
    figures: Figures,
    /// The line's bytes, kept so that nothing is allocated for them again.
    line: [Vec<u8>; 2],
}

impl Robot {
    fn new(number: u32) -> Robot {
        let latitude_deg = 37.0 + APART_DEG * f64::from(number);
        // A tank that is never empty; what the robots do differs by their winds.
        let toml = format!(
            "[home]\nlatitude_deg = {latitude_deg:.6}\n[noise]\nseed = {number}\n[energy]\ndrain_factor = 0\n"
        );
        let simulator: SimulatorConfig =
            runtime::config::parse(&toml, "a fleet").expect("the simulator's settings");
        let toml = "[parameters]\nstatus_period_ms = 200\n";
        let config: BridgeConfig =
            runtime::config::parse(toml, "a fleet").expect("the bridge's settings");
        let mut robot = Robot {
            number,
            bridge: Bridge::new(&config),
            simulator: Simulator::new(simulator.setup()),
            heard: Heard {
                home_latitude_deg: latitude_deg,
                ..Heard::default()
            },
            now: Duration::ZERO,
            next: Step::Start,
            open: None,
            resting_until: Duration::ZERO,
            path_id: 0,
            figures: Figures {
                robots: 1,
                ..Figures::default()
            },
            line: Default::default(),
        };
        robot.apply(Input::PortOpened(Default::default()));
        robot
    }

    fn host(&self) -> MonotonicNs {
        HOST_EPOCH + self.now
    }

    fn apply(&mut self, input: Input<'_>) {
        let now = self.host();
        self.bridge.apply(now, input, &mut self.heard);
    }

    /// Goes on to `end`, from deadline to deadline.
    fn advance(&mut self, end: Duration) {
        while self.now < end {
            let bridge = self.bridge.deadline().since(HOST_EPOCH);
            let next = [Some(bridge), self.simulator.next_deadline(), Some(end)];
            let next = next.into_iter().flatten().min().unwrap_or(end);
            self.now = next.max(self.now + Duration::from_micros(1)).min(end);
            self.simulator.advance(self.now);
            self.exchange();
            self.apply(Input::Advance);
            self.exchange();
        }
    }

    /// Carries bytes both ways until neither side has any.
    fn exchange(&mut self) {
        let [mut from_dsp, mut to_dsp] = std::mem::take(&mut self.line);
        loop {
            from_dsp.clear();
            self.simulator.transmit(|bytes| {
                from_dsp.extend_from_slice(bytes);
                bytes.len()
            });
            let now = self.host();
            self.bridge.take_discard_unsent();
            to_dsp.clear();
            to_dsp.extend_from_slice(self.bridge.transmit(now));
            if from_dsp.is_empty() && to_dsp.is_empty() {
                break;
            }
            if !to_dsp.is_empty() {
                self.apply(Input::Transmitted(to_dsp.len()));
                assert_eq!(self.simulator.receive(self.now, &to_dsp), to_dsp.len());
            }
            self.apply(Input::Received(&from_dsp));
        }
        self.line = [from_dsp, to_dsp];
    }

    /// Lets the operator look: takes the reports, and gives the next request when the last one has ended.
    fn operate(&mut self, ids: &AtomicU64) {
        for report in std::mem::take(&mut self.heard.reports) {
            let (id, since) = self.open.expect("a report without a request");
            let stage = report.stage();
            assert_eq!(
                report.request_id, id,
                "robot {}: another request",
                self.number
            );
            if report.is_final() {
                let (reason, took) = (report.reason(), self.now - since);
                assert_eq!(
                    stage,
                    Some(Stage::Done),
                    "{} {:?} {reason:?}",
                    self.number,
                    self.next
                );
                assert!(took < LONGEST, "{took:?}");
                self.open = None;
                self.figures.requests += 1;
                self.turn();
            }
        }
        if let Some((id, since)) = self.open {
            let waits = self.now - since;
            assert!(
                waits < LONGEST,
                "robot {}: request {id} has no end",
                self.number
            );
        } else if self.heard.is_up && self.now >= self.resting_until {
            let id = ids.fetch_add(1, Ordering::Relaxed);
            self.open = Some((id, self.now));
            self.request(id);
            self.exchange();
        }
    }

    /// What comes after the step that is done.
    fn turn(&mut self) {
        self.next = match self.next {
            Step::Start => Step::TakeOff,
            Step::TakeOff => Step::FlyOut,
            Step::FlyOut => Step::FlyBack,
            Step::FlyBack => Step::Land,
            Step::Land => {
                self.figures.missions += 1;
                self.resting_until = self.now + REST;
                Step::TakeOff
            }
        };
    }

    fn request(&mut self, id: u64) {
        let (sender, issued_ns) = (Sender::default(), self.host().0);
        let movement = match self.next {
            Step::Start => {
                let request = ModuleControl {
                    issued_ns,
                    ..ModuleControl::new(id, ControlCommand::Start)
                };
                let key = RequestKey::Control(id);
                return self.apply(Input::Control {
                    key,
                    sender,
                    request,
                });
            }
            Step::TakeOff => MovementData::take_off(id, 6.0),
            Step::FlyOut => self.waypoint(id, 0.000_2),
            Step::FlyBack => self.waypoint(id, 0.0),
            Step::Land => MovementData::land(id),
        };
        let request = MovementData {
            issued_ns,
            ..movement
        };
        let key = RequestKey::Movement(id);
        self.apply(Input::Movement {
            key,
            sender,
            request,
        });
    }

    /// A path of one waypoint, so far to the north of home.
    fn waypoint(&mut self, id: u64, north_deg: f64) -> MovementData {
        self.path_id += 1;
        let place = WaypointPosition {
            latitude_deg: self.heard.home_latitude_deg + north_deg,
            longitude_deg: -6.001,
            altitude_m: 18.0,
        };
        MovementData::waypoint(id, self.path_id, place, true, true)
    }
}

/// Flies these robots for so long, and says what became of them. What is wrong panics.
fn fly_some(numbers: &[u32], time: Duration, ids: &AtomicU64) -> Figures {
    let mut robots: Vec<Robot> = numbers.iter().map(|number| Robot::new(*number)).collect();
    let (mut now, mut warm) = (Duration::ZERO, None);
    while now < time {
        now += LOOK;
        for robot in &mut robots {
            robot.advance(now);
            robot.operate(ids);
        }
        if now >= WARM && warm.is_none() {
            warm = Some(Heap::now());
        }
    }
    let grown = warm.map_or(0, |warm| warm.since().live_bytes);
    let mut sum = Figures {
        growth_bytes: grown,
        ..Figures::default()
    };
    for robot in robots {
        sum += Figures {
            samples: robot.heard.samples,
            ..robot.figures
        };
    }
    sum
}

/// Flies `robots` for `time` on all cores, by one operator. What is wrong panics.
pub fn fly(robots: u32, time: Duration) -> Figures {
    let ids = AtomicU64::new(1);
    let cores = thread::available_parallelism().map_or(1, usize::from) as u32;
    let mut hands: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    (0..robots).for_each(|number| hands.entry(number % cores).or_default().push(number));
    thread::scope(|scope| {
        let workers: Vec<_> = hands
            .values()
            .map(|numbers| scope.spawn(|| fly_some(numbers, time, &ids)))
            .collect();
        let mut sum = Figures::default();
        for worker in workers {
            match worker.join() {
                Ok(part) => sum += part,
                Err(reason) => std::panic::resume_unwind(reason),
            }
        }
        sum
    })
}

#[test]
fn many_robots_fly_over_and_over_and_nothing_grows() {
    let hours = 3;
    let figures = fly(4, Duration::from_secs(3600 * hours));
    assert_eq!(figures.robots, 4);
    assert!(figures.missions > 4 * hours * 30, "{figures:?}");
    assert_eq!(figures.growth_bytes, 0, "{figures:?}");
}
