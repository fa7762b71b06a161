//! Whether a flight to a place that was tapped would be taken: by the bridge's own code for fence and limits, and that of `ril plan check`.
//! A pure function of what is known of the robot.

use bridge::BridgeConfig;
use bridge::safety::fence::Fence;
use dsp_protocol::Waypoint;
use ipc_types::MonotonicNs;
use ipc_types::code::ModuleStatus;
use ipc_types::payload::WaypointPosition;
use plans::check::check;
use plans::flight::Flight;
use plans::model::{Action, Altitude, Item, Plan, Position};
use plans::site::{Endurance, HomeSource, Site, Start};
use plans::timeline::timeline;
use runtime::finding::{Finding, Severity};

use crate::robot::model::WatchedRobot;

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Checked {
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

/// A flight of `robot` straight to `target`, with `fence` in force; `None` if the bridge has not published it.
pub(super) fn go_to(
    robot: &WatchedRobot,
    fence: Option<&Fence>,
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
    let rules = BridgeConfig {
        fence: fence.cloned().unwrap_or_default(),
        ..BridgeConfig::default()
    };
    let mut findings = check(&plan, &flight, &site, Some(&rules), &endurance);
    for finding in &mut findings {
        // The limits are taken to be the defaults. Whether a limit forbids it, the bridge decides, which knows its own.
        if finding.has_failed() && !finding.id.starts_with("fence") {
            finding.severity = Severity::Warning;
        }
    }
    findings.extend(of_robot(robot));
    if fence.is_none() {
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

/// What the bridge says of itself that makes it refuse a movement.
fn of_robot(robot: &WatchedRobot) -> Vec<Finding> {
    let Some(state) = &robot.state else {
        let finding = Finding::new(Severity::Error, "bridge", "no bridge runs");
        return vec![finding];
    };
    let mut findings = Vec::new();
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

#[cfg(test)]
mod tests {
    use ipc_types::RobotId;

    use super::*;
    use crate::robot::fixture::{at, fly};

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
            (low, &open, 20_100, true, Some("fence-floor")),
            (nowhere, &open, 20_100, true, Some("place")),
            (NEAR, &open, 29_000, true, Some("position")),
        ] {
            let checked = go_to(&flown(), Some(fence), target, at(ms));
            assert_eq!(checked.refusal().is_some(), refused, "{checked:?}");
            if let Some(expected) = expected {
                assert!(ids(&checked).contains(&expected), "{checked:?}");
            }
        }
    }

    #[test]
    fn the_way_is_measured_and_an_unknown_fence_is_said() {
        let checked = go_to(&flown(), None, NEAR, at(20_100));
        assert!(
            checked
                .distance_m
                .is_some_and(|metres| (10.0..40.0).contains(&metres))
        );
        assert!(ids(&checked).contains(&"robot-rules"), "{checked:?}");
        assert!(checked.refusal().is_none(), "{checked:?}");
    }

    #[test]
    fn a_module_that_takes_no_movement_is_named() {
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        assert_eq!(ids(&go_to(&robot, None, NEAR, at(0))), ["position"]);
        fly(&mut robot);
        let state = robot.state.as_mut().unwrap();
        state.status = ModuleStatus::WaitingDataToStart.code();
        let checked = go_to(&robot, None, NEAR, at(20_100));
        assert!(ids(&checked).contains(&"module"), "{checked:?}");
    }
}
