//! [`Checks`]: what a page asks before an order: a flight is judged at once, a take-off by `ril preflight` beside the
//! server.
//!
//! [`check_go_to`]: whether a flight to a place that was tapped would be taken: by the bridge's own code for fence and
//! limits, and that of `ril plan check`. A pure function of what is known of the robot. [`Preflight`]: a process of its
//! own, because the server must not wait for what the checks look at: files, the machine, the bridge's answer.

use std::io::{self, ErrorKind, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

use bridge::BridgeConfig;
use dsp_protocol::Waypoint;
use ipc_types::code::{Functionality, LinkState, ModuleStatus};
use ipc_types::payload::WaypointPosition;
use ipc_types::{MonotonicNs, RobotId};
use operator::config::RequestConfig;
use operator::request::ports::RobotOrder;
use operator::robot::freshness::named;
use operator::robot::model::{Process, WatchedRobot};
use plans::check::check;
use plans::flight::Flight;
use plans::model::{Action, Altitude, Item, Plan, Position};
use plans::site::{Endurance, HomeSource, Site, Start};
use plans::timeline::timeline;
use runtime::finding::{Finding, Severity};
use runtime::signal::WITH_PARENT;
use serde::Deserialize;

use super::fleet::{KnownRules, ShownRobot};
use crate::messages;
use crate::orders::{OrderPort, target};
use crate::{ViewerId, page};

/// Most preflights at a time, each a process. A further one is answered with a finding that says so.
pub(crate) const MAX_PREFLIGHTS: usize = 2;

/// A preflight that a page waits for.
struct PendingPreflight {
    viewer: ViewerId,
    order: String,
    robot: u32,
    preflight: Preflight,
}

/// Checks that pages have asked for before a take-off, while `ril preflight` runs.
#[derive(Default)]
pub(crate) struct Checks {
    asked: Vec<PendingPreflight>,
}

impl Checks {
    /// Begins what `check` asks for; gives the answer if it is there at once.
    pub fn take(
        &mut self,
        viewer: ViewerId,
        check: &page::CheckRequest,
        shown: &ShownRobot,
        now: MonotonicNs,
    ) -> Option<page::CheckResult> {
        match check.kind {
            page::CheckKind::Goto => Some(go_to(check, shown, now)),
            page::CheckKind::Takeoff => self.take_off(viewer, check, shown, now),
        }
    }

    fn take_off(
        &mut self,
        viewer: ViewerId,
        check: &page::CheckRequest,
        shown: &ShownRobot,
        now: MonotonicNs,
    ) -> Option<page::CheckResult> {
        // Of the same page only the newest question is worth an answer.
        self.asked.retain(|asked| asked.viewer != viewer);
        // What the bridge refuses whatever the checks say needs none.
        if let Some(finding) = of_take_off(&shown.robot, now) {
            return Some(page::CheckResult {
                findings: vec![messages::finding(&finding)],
                ..failed(&check.order, check.robot, "")
            });
        }
        if self.asked.len() >= MAX_PREFLIGHTS {
            let why = "other pages are being answered: ask again in some seconds";
            return Some(failed(&check.order, check.robot, why));
        }
        match Preflight::start(shown.robot.id, now) {
            Ok(preflight) => {
                self.asked.push(PendingPreflight {
                    viewer,
                    order: check.order.clone(),
                    robot: check.robot,
                    preflight,
                });
                None
            }
            Err(error) => {
                let why = format!("`ril preflight` cannot be started: {error}");
                Some(failed(&check.order, check.robot, &why))
            }
        }
    }

    /// The answers that are there now.
    pub fn answers(&mut self, now: MonotonicNs) -> Vec<(ViewerId, page::CheckResult)> {
        let mut answers = Vec::new();
        self.asked.retain_mut(|asked| {
            let Some(ended) = asked.preflight.take(now) else {
                return true;
            };
            let answer = match ended {
                Ok(checks) => of_preflight(&asked.order, asked.robot, &checks),
                Err(why) => failed(&asked.order, asked.robot, &why),
            };
            answers.push((asked.viewer, answer));
            false
        });
        answers
    }

    /// What to wait for, [`MAX_PREFLIGHTS`] at most.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        self.asked.iter().map(|asked| asked.preflight.descriptor())
    }

    /// When to look although nothing comes.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let deadlines = self.asked.iter().map(|asked| asked.preflight.deadline());
        deadlines.min()
    }
}

fn go_to(check: &page::CheckRequest, shown: &ShownRobot, now: MonotonicNs) -> page::CheckResult {
    let target = match target(check.position, check.altitude_m) {
        Ok(target) => target,
        Err(why) => return failed(&check.order, check.robot, &why),
    };
    let checked = check_go_to(&shown.robot, shown.rules(), target, now);
    page::CheckResult {
        order: check.order.clone(),
        robot: check.robot,
        severity: checked
            .findings
            .iter()
            .map(messages::finding_severity)
            .max()
            .unwrap_or(page::Severity::Ok),
        findings: checked.findings.iter().map(messages::finding).collect(),
        distance_m: checked.distance_m,
        duration_s: checked.duration_s,
    }
}

/// All checks that did not pass; the others are counted.
fn of_preflight(order: &str, robot: u32, checks: &[PreflightCheck]) -> page::CheckResult {
    let mut findings = Vec::new();
    let mut passed = 0;
    for check in checks {
        let severity = match check.verdict.as_deref() {
            Some("pass") => {
                passed += 1;
                continue;
            }
            Some("warn") => page::Severity::Warning,
            _ => page::Severity::Alarm,
        };
        findings.push(page::Finding {
            severity,
            text: format!("{}: {}", check.id, check.value),
            next_step: check.next_step.clone(),
        });
    }
    findings.sort_by_key(|finding| finding.severity != page::Severity::Alarm);
    let severity = findings
        .first()
        .map_or(page::Severity::Ok, |worst| worst.severity);
    findings.push(page::Finding {
        severity: page::Severity::Note,
        text: format!(
            "{passed} of {} checks of the preflight passed",
            checks.len()
        ),
        next_step: None,
    });
    page::CheckResult {
        order: order.to_owned(),
        robot,
        severity,
        findings,
        distance_m: None,
        duration_s: None,
    }
}

/// A check that could not be made.
pub(crate) fn failed(order: &str, robot: u32, why: &str) -> page::CheckResult {
    page::CheckResult {
        order: order.to_owned(),
        robot,
        severity: messages::severity(Severity::Error),
        findings: vec![page::Finding {
            severity: messages::severity(Severity::Error),
            text: why.to_owned(),
            next_step: None,
        }],
        distance_m: None,
        duration_s: None,
    }
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Checked {
    /// The most severe first.
    pub findings: Vec<Finding>,
    /// How long the way is, climbs and descents included, m.
    pub distance_m: Option<f64>,
    /// How long it takes, s.
    pub duration_s: Option<f64>,
}

impl Checked {
    /// Why nothing may be sent; `None` if it may.
    pub fn refusal(&self) -> Option<&Finding> {
        self.findings.iter().find(|finding| finding.has_failed())
    }
}

impl OrderPort for ShownRobot {
    fn robot(&self) -> &WatchedRobot {
        &self.robot
    }

    fn drain(&mut self, now: MonotonicNs) {
        self.ports.drain(&mut self.robot, now);
    }

    fn refusal(&self, target: WaypointPosition, now: MonotonicNs) -> Option<String> {
        let checked = check_go_to(&self.robot, self.rules(), target, now);
        checked.refusal().map(|finding| finding.text.clone())
    }

    fn send(
        &mut self,
        order: RobotOrder,
        issued: MonotonicNs,
        config: &RequestConfig,
        now: MonotonicNs,
    ) -> Result<u64, String> {
        let robot = &mut self.robot;
        let sent = self.ports.send(order, issued, config, robot, now);
        sent.map_err(|failure| failure.chain().join(": "))?
    }
}

/// A flight of `robot` straight to `target`, by these `rules`.
pub(crate) fn check_go_to(
    robot: &WatchedRobot,
    rules: KnownRules<'_>,
    target: WaypointPosition,
    now: MonotonicNs,
) -> Checked {
    let nothing = |finding| Checked {
        findings: vec![finding],
        distance_m: None,
        duration_s: None,
    };
    let position = match Position::new(target.latitude_deg, target.longitude_deg) {
        Ok(position) if target.altitude_m.is_finite() => position,
        _ => {
            let text = "it is no place that can be flown to";
            return nothing(Finding::new(Severity::Error, "place", text));
        }
    };
    let Some(start) = start(robot, now) else {
        let text = "where the helicopter is, is not known now";
        return nothing(Finding::new(Severity::Error, "position", text));
    };
    let site = site(robot, start);
    let plan = plan(position, target.altitude_m - site.home.altitude_m);
    let flight = Flight::new(&plan, &site);
    let endurance = Endurance::default();
    let by_default;
    let config = match rules {
        KnownRules::Running(config) => config,
        KnownRules::Fence(fence) => {
            by_default = BridgeConfig {
                fence: fence.clone(),
                ..BridgeConfig::default()
            };
            &by_default
        }
        KnownRules::Nothing => {
            by_default = BridgeConfig::default();
            &by_default
        }
    };
    let is_known = matches!(rules, KnownRules::Running(_));
    let mut findings = check(&plan, &flight, &site, Some(config), &endurance);
    for finding in &mut findings {
        // Limits that are not known are taken to be the defaults. Whether one forbids it, the bridge decides, which
        // knows its own.
        if finding.has_failed() && !is_known && !finding.id.starts_with("fence") {
            finding.severity = Severity::Warning;
        }
    }
    findings.extend(of_robot(robot));
    findings.extend(of_movement(robot));
    if robot.pilot.flying == Some(false) {
        let finding = Finding::new(Severity::Error, "ground", "the helicopter is on the ground");
        findings.push(finding.with_next_step("a take-off comes first"));
    }
    if matches!(rules, KnownRules::Nothing) {
        findings.push(Finding::unchecked(
            "robot-rules",
            "the bridge has not published its geofence; it checks the order when it receives it",
        ));
    }
    // Battery and fuel are not checked: the view has no configuration of how long they last.
    findings.retain(|finding| !(finding.id == "endurance" && finding.is_unmade()));
    plans::finding::sort(&mut findings);
    let marks = timeline(&flight, &endurance);
    Checked {
        findings,
        distance_m: marks.last().map(|mark| mark.distance_m),
        duration_s: marks.last().and_then(|mark| mark.time_s),
    }
}

/// Where the helicopter is, if telemetry of the present says so.
fn start(robot: &WatchedRobot, now: MonotonicNs) -> Option<Start> {
    let view = &robot.pilot;
    let is_fresh = robot.telemetry_freshness(now).is_fresh();
    let place = view.place.filter(|_| is_fresh)?;
    let at = Waypoint {
        latitude_deg: place.latitude_deg,
        longitude_deg: place.longitude_deg,
        altitude_m: view.altitude_m?,
    };
    match view.flying? {
        true => Some(Start::Flying(at)),
        false => Some(Start::Ground(at)),
    }
}

fn site(robot: &WatchedRobot, start: Start) -> Site {
    let (Start::Flying(here) | Start::Ground(here)) = start;
    let ground_m = robot
        .state
        .as_ref()
        .and_then(|state| state.ground_altitude());
    let ground_m = ground_m.or(robot.home.map(|home| home.altitude_m));
    let place = robot.home.map(|home| home.place);
    Site {
        home: Waypoint {
            latitude_deg: place.map_or(here.latitude_deg, |place| place.latitude_deg),
            longitude_deg: place.map_or(here.longitude_deg, |place| place.longitude_deg),
            altitude_m: ground_m.unwrap_or(0.0),
        },
        // The place does not depend on home, and the altitude is that of telemetry.
        is_home_altitude_known: true,
        home_source: HomeSource::Robot,
        start,
        zero_above_sea_m: None,
        take_off_m: None,
        from: 1,
        is_for_flight: false,
    }
}

fn plan(position: Position, above_home_m: f64) -> Plan {
    let mut plan = Plan::empty(plans::format::PlanFormat::QgcPlan);
    plan.items.push(Item {
        number: 1,
        origin: "the place".to_owned(),
        label: String::new(),
        action: Action::Waypoint {
            position,
            altitude: Altitude::AboveTakeOff(above_home_m),
            hold_s: 0.0,
        },
        ignored: Vec::new(),
        mavlink: None,
    });
    plan
}

/// What is under way and lets no path begin.
fn of_movement(robot: &WatchedRobot) -> Option<Finding> {
    let doing = robot.state.as_ref()?.functionality()?;
    let (what, next_step) = match doing {
        Functionality::TakingOff => ("a take-off", "wait until it hovers"),
        Functionality::Landing => ("a landing", "wait until it has ended"),
        Functionality::Stopping => ("a stop", "wait until it has ended"),
        _ => return None,
    };
    let text = format!("{what} is under way, and no other movement begins meanwhile");
    Some(Finding::new(Severity::Error, "busy", text).with_next_step(next_step))
}

/// Why no take-off can begin; `None` if what is known of the present forbids none.
fn of_take_off(robot: &WatchedRobot, now: MonotonicNs) -> Option<Finding> {
    let is_known = robot.process(Process::Bridge, now).is_fresh();
    if let Some(finding) = of_movement(robot).filter(|_| is_known) {
        return Some(finding);
    }
    let is_fresh = robot.telemetry_freshness(now).is_fresh();
    (is_fresh && robot.pilot.flying == Some(true)).then(|| {
        Finding::new(
            Severity::Error,
            "air",
            "the helicopter is in the air already",
        )
        .with_next_step("to climb, go to where it is at another altitude")
    })
}

/// What the bridge says of itself that makes it refuse a movement.
fn of_robot(robot: &WatchedRobot) -> Vec<Finding> {
    let Some(state) = &robot.state else {
        let finding = Finding::new(Severity::Error, "bridge", "no bridge runs");
        return vec![finding];
    };
    let mut findings = Vec::new();
    if state.link.state() != Some(LinkState::Up) {
        let name = named(state.link.state(), state.link.state);
        let text = format!("link to the DSP {name}");
        findings.push(Finding::new(Severity::Error, "dsp-link", text));
    }
    if state.is_blocked() {
        findings.push(
            Finding::new(Severity::Error, "blocked", "movements are blocked")
                .with_next_step("start the module again"),
        );
    } else if state.status() == Some(ModuleStatus::WaitingDataToStart) {
        findings.push(
            Finding::new(Severity::Error, "module", "the module is not started")
                .with_next_step("start it"),
        );
    }
    if state.control.exclusive != 0
        && !robot.is_commanded_from_here()
        && let Some(commander) = robot.commander()
    {
        let text = format!("{commander} commands: only hold and land are taken from others");
        findings.push(
            Finding::new(Severity::Error, "control", text)
                .with_next_step("`ril control take` asks for control"),
        );
    }
    findings
}

/// Most that is taken of what it prints; the checks make a few kilobytes.
const MAX_BYTES: usize = 256 << 10;

/// How long it may take before it is killed: several of its own time limits.
const TIMEOUT: Duration = Duration::from_secs(20);

/// A check of the preflight.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(crate) struct PreflightCheck {
    /// Its name.
    pub id: String,
    /// `pass`, `warn` or `fail`; `None` if it could not be made, which is not ready either.
    pub verdict: Option<String>,
    /// What was found.
    pub value: String,
    /// What to do.
    pub next_step: Option<String>,
}

/// What the preflight prints.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct PrintedReport {
    checks: Vec<PreflightCheck>,
}

/// A preflight that runs. One that is dropped is killed.
pub(crate) struct Preflight {
    child: Child,
    output: ChildStdout,
    text: Vec<u8>,
    give_up: MonotonicNs,
}

impl Preflight {
    /// Starts it for `robot`.
    pub fn start(robot: RobotId, now: MonotonicNs) -> io::Result<Preflight> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(["preflight", "--json", "--robot", &robot.to_string()])
            .env(WITH_PARENT, "1")
            .env_remove("RIL_CONFIG")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let output = child.stdout.take().ok_or(ErrorKind::BrokenPipe)?;
        rustix::io::ioctl_fionbio(&output, true)?;
        Ok(Preflight {
            child,
            output,
            text: Vec::new(),
            give_up: now + TIMEOUT,
        })
    }

    /// What to wait for.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.output.as_fd()
    }

    /// Takes what it has printed. When it has ended: its checks, or why there are none.
    pub fn take(&mut self, now: MonotonicNs) -> Option<Result<Vec<PreflightCheck>, String>> {
        let mut buffer = [0; 4096];
        loop {
            match self.output.read(&mut buffer) {
                Ok(0) => return Some(checks(&self.text)),
                Ok(count) if self.text.len() + count <= MAX_BYTES => {
                    self.text.extend_from_slice(&buffer[..count]);
                }
                Ok(_) => return Some(Err("`ril preflight` says too much".to_owned())),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Some(Err(format!("`ril preflight`: {error}"))),
            }
        }
        (now >= self.give_up).then(|| Err("`ril preflight` does not end".to_owned()))
    }

    /// When it is to be looked at although it prints nothing.
    pub fn deadline(&self) -> MonotonicNs {
        self.give_up
    }
}

impl Drop for Preflight {
    fn drop(&mut self) {
        // It has ended, or is of no use any more; a killed process is reaped at once.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The checks, in the first line of what was printed.
fn checks(text: &[u8]) -> Result<Vec<PreflightCheck>, String> {
    let line = text.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let report: PrintedReport = serde_json::from_slice(line)
        .map_err(|error| format!("`ril preflight` could not be run: {error}"))?;
    Ok(report.checks)
}

#[cfg(test)]
mod tests {
    use bridge::safety::fence::Fence;
    use ipc_types::RobotId;

    use super::*;
    use operator::robot::fixture::{at, fly};

    fn flown() -> WatchedRobot {
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        fly(&mut robot);
        robot
    }

    const NEAR: WaypointPosition = WaypointPosition {
        latitude_deg: 37.4113,
        longitude_deg: -6.0005,
        altitude_m: 25.0,
    };

    fn ids(checked: &Checked) -> Vec<&'static str> {
        checked.findings.iter().map(|finding| finding.id).collect()
    }

    #[test]
    fn a_place_is_judged_by_the_fence_by_the_ground_and_by_what_is_known() {
        let fence: Fence = runtime::config::parse(
            "[[area]]\nname = \"mast\"\nkind = \"exclusion\"\ncentre = [37.4113, -6.0005]\nradius_m = 6.0\n",
            "fence.toml",
        )
        .unwrap();
        let open = Fence::default();
        let far = WaypointPosition {
            latitude_deg: 40.0,
            ..NEAR
        };
        let low = WaypointPosition {
            altitude_m: 5.0,
            ..NEAR
        };
        let nowhere = WaypointPosition {
            latitude_deg: f64::NAN,
            ..NEAR
        };
        for (target, fence, ms, refused, expected) in [
            (NEAR, &open, 20_100, false, None),
            (NEAR, &fence, 20_100, true, Some("fence-exclusion")),
            (far, &open, 20_100, false, Some("max-distance")),
            // Whether one may fly below it is among the limits that are not known here.
            (low, &open, 20_100, false, Some("below-take-off")),
            (nowhere, &open, 20_100, true, Some("place")),
            (NEAR, &open, 29_000, true, Some("position")),
        ] {
            let checked = check_go_to(&flown(), KnownRules::Fence(fence), target, at(ms));
            assert_eq!(checked.refusal().is_some(), refused, "{checked:?}");
            if let Some(expected) = expected {
                assert!(ids(&checked).contains(&expected), "{checked:?}");
            }
        }
    }

    #[test]
    fn a_place_is_judged_by_the_limits_and_the_margin_that_the_bridge_runs_with() {
        let judged = |text: &str, target: WaypointPosition| {
            let config = runtime::config::parse(text, "a test").unwrap();
            check_go_to(&flown(), KnownRules::Running(&config), target, at(20_100))
        };
        let far = WaypointPosition {
            latitude_deg: 37.55,
            ..NEAR
        };
        let checked = judged("", far);
        assert_eq!(
            checked.refusal().map(|finding| finding.id),
            Some("max-distance")
        );
        assert!(
            judged("[movement]\nmax_distance_m = 20000.0\n", far)
                .refusal()
                .is_none()
        );
        // The place lies 15 m from the mast. That the margin holds above the ground, too, is not in question here.
        let mast = |margin_m: f64| {
            let fence = format!(
                "[safety]\nbelow_take_off = true\n[fence]\nmargin_m = {margin_m}\n[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\n\
                 centre = [37.411435, -6.0005]\nradius_m = 1.0\n"
            );
            judged(&fence, NEAR).refusal().map(|finding| finding.id)
        };
        assert_eq!(mast(2.0), None);
        assert_eq!(mast(20.0), Some("fence-ahead"));
    }

    #[test]
    fn the_way_is_measured_and_an_unknown_fence_is_said() {
        let checked = check_go_to(&flown(), KnownRules::Nothing, NEAR, at(20_100));
        assert!(
            checked
                .distance_m
                .is_some_and(|metres| (10.0..40.0).contains(&metres))
        );
        assert!(ids(&checked).contains(&"robot-rules"), "{checked:?}");
        assert!(checked.refusal().is_none(), "{checked:?}");
    }

    #[test]
    fn what_is_under_way_forbids_what_cannot_begin_meanwhile() {
        use Functionality::{AtRest, FollowingPath, Holding, Landing, Stopping, TakingOff};
        for (doing, is_flying, path, take_off) in [
            (AtRest, false, Some("ground"), None),
            (AtRest, true, None, Some("air")),
            (TakingOff, true, Some("busy"), Some("busy")),
            (TakingOff, false, Some("busy"), Some("busy")),
            (FollowingPath, true, None, Some("air")),
            (Holding, true, None, Some("air")),
            (Landing, true, Some("busy"), Some("busy")),
            (Stopping, true, Some("busy"), Some("busy")),
        ] {
            let mut robot = flown();
            robot.state.as_mut().unwrap().functionality = doing.code();
            robot.pilot.flying = Some(is_flying);
            let checked = check_go_to(&robot, KnownRules::Nothing, NEAR, at(20_100));
            let refused = checked.refusal().map(|finding| finding.id);
            assert_eq!(refused, path, "{doing:?} {is_flying}: {checked:?}");
            let refused = of_take_off(&robot, at(20_100)).map(|finding| finding.id);
            assert_eq!(refused, take_off, "{doing:?} {is_flying}");
            let later = of_take_off(&robot, at(30_000));
            assert_eq!(later, None, "it says nothing of the present any more");
        }
        let mut robot = flown();
        robot.state.as_mut().unwrap().link.state = LinkState::Silent.code();
        let checked = check_go_to(&robot, KnownRules::Nothing, NEAR, at(20_100));
        assert!(ids(&checked).contains(&"dsp-link"), "{checked:?}");
    }

    #[test]
    fn a_module_that_takes_no_movement_is_named() {
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        assert_eq!(
            ids(&check_go_to(&robot, KnownRules::Nothing, NEAR, at(0))),
            ["position"]
        );
        fly(&mut robot);
        let state = robot.state.as_mut().unwrap();
        state.status = ModuleStatus::WaitingDataToStart.code();
        let checked = check_go_to(&robot, KnownRules::Nothing, NEAR, at(20_100));
        assert!(ids(&checked).contains(&"module"), "{checked:?}");
    }
}

#[cfg(test)]
mod preflight_tests {
    use super::*;

    #[test]
    fn the_checks_are_read_and_what_is_none_says_why() {
        let text = br#"{"schema":"ril.Preflight.v1","checks":[{"id":"gps","verdict":"fail","checked":true,"value":"no fix","limit":null,"next_step":"wait"},{"id":"home","verdict":null,"value":"no telemetry came","next_step":null}]}
"#;
        let read = checks(text).unwrap();
        assert_eq!(read[0].verdict.as_deref(), Some("fail"));
        assert_eq!(
            (read[1].id.as_str(), read[1].verdict.as_deref()),
            ("home", None)
        );
        assert!(checks(b"").unwrap_err().contains("could not be run"));
    }
}
