//! What is known when a plan is checked: the robot if it runs, the configurations, and what the operator says.

use std::path::Path;
use std::time::Duration;

use bridge::BridgeConfig;
use dsp_protocol::{Waypoint, port};
use ipc_types::Topic;
use ipc_types::code::{LinkState, SafetyAction};
use ipc_types::payload::{ModuleState, WaypointPosition};
use operator::config::PlanConfig;
use operator::request::cruise::read_mps;
use operator::robot::absence::nothing_came;
use operator::robot::chart::read_plan;
use operator::robot::position::{Present, newest_state, present_position};
use operator::robot::running::{self, ConfigOrigin};
use operator::session::Session;
use plans::Plan;
use plans::check::{check, configured};
use plans::finding::sort;
use plans::flight::Flight;
use plans::model::StatedAltitudes;
use plans::site::{Endurance, HomeSource, Site, Start};
use runtime::exit::Failure;
use runtime::finding::{Finding, Severity};
use runtime::plain::plain_path;

use super::options::{HomeArg, PlanFileArgs};

/// A plan with all that is known about it.
pub struct KnownPlan {
    /// The plan of the file, changed as the operator says.
    pub plan: Plan,
    /// What it is flown from.
    pub site: Site,
    /// What the helicopter does.
    pub flight: Flight,
    /// Speed and endurance.
    pub endurance: Endurance,
    /// The configuration of the bridge, and where it comes from.
    pub rules: Option<(BridgeConfig, ConfigOrigin)>,
    /// What the robot says, if it runs.
    pub robot: Option<KnownRobot>,
    /// All findings, the most severe first.
    pub findings: Vec<Finding>,
}

/// What a robot says of itself.
pub struct KnownRobot {
    /// The bridge's state.
    pub state: ModuleState,
    /// Where it is, if telemetry says so.
    pub present: Option<Present>,
    /// The DSP's cruise speed, m/s.
    pub cruise_speed_mps: Option<f64>,
}

/// Gathers it. Without a session no robot is asked. `is_for_flight` makes a robot necessary.
///
/// # Errors
///
/// Code 78 when `bridge.toml` is wrong; for a flight 3 and 4 when the robot says nothing.
pub fn gather(
    plan: Plan,
    args: &PlanFileArgs,
    config: &PlanConfig,
    session: Option<&Session>,
    timeout: Duration,
    is_for_flight: bool,
) -> Result<KnownPlan, Failure> {
    let rules = rules(args, session, timeout)?;
    let robot = match session {
        Some(session) => robot(session, timeout, is_for_flight)?,
        None => None,
    };
    let site = site(&plan, args, config, robot.as_ref(), is_for_flight);
    let endurance = endurance(
        config,
        robot.as_ref(),
        rules.as_ref().map(|(rules, _)| rules),
    );
    let flight = Flight::new(&plan, &site);
    let rules_in_force = rules.as_ref().map(|(rules, _)| rules);
    let mut findings = check(&plan, &flight, &site, rules_in_force, &endurance);
    if let Some(robot) = &robot {
        findings.extend(of_robot(robot, rules_in_force, is_for_flight));
    }
    sort(&mut findings);
    Ok(KnownPlan {
        plan,
        site,
        flight,
        endurance,
        rules,
        robot,
        findings,
    })
}

/// The configuration that the operator named, or that the live bridge runs with, or else that of the file here.
fn rules(
    args: &PlanFileArgs,
    session: Option<&Session>,
    timeout: Duration,
) -> Result<Option<(BridgeConfig, ConfigOrigin)>, Failure> {
    if let (None, Some(session)) = (&args.bridge, session)
        && let Some(config) = running::bridge(session, timeout)?
    {
        return Ok(Some((config, ConfigOrigin::Running)));
    }
    let default = Path::new(bridge::cli::DEFAULT_CONFIG_FILE);
    let loaded = runtime::config::load::<BridgeConfig>(args.bridge.as_deref(), default)?;
    let file = loaded.file.map(ConfigOrigin::File);
    Ok(file.map(|file| (loaded.value, file)))
}

/// Reads a plan, and says of it what the command line says.
pub fn read(args: &PlanFileArgs) -> Result<Plan, Failure> {
    let name = plain_path(&args.file);
    let mut plan = read_plan(&args.file)?;
    if args.from as usize > plan.items.len().max(1) {
        return Err(Failure::usage(format!(
            "--from {}: {name} has {} items; `ril plan show {name}` lists them",
            args.from,
            plan.items.len()
        )));
    }
    plan.state_altitudes(&StatedAltitudes {
        reference: args.altitude_is.map(|name| name.reference()),
        missing: args.altitude,
    });
    Ok(plan)
}

/// What the robot says; `None` if none runs and none is needed.
fn robot(
    session: &Session,
    timeout: Duration,
    is_needed: bool,
) -> Result<Option<KnownRobot>, Failure> {
    if !is_needed && !session.is_provided(ModuleState::KEY)? {
        return Ok(None);
    }
    let Some(state) = newest_state(session, timeout)? else {
        let failure = nothing_came(session, ModuleState::KEY, timeout)?;
        return if is_needed { Err(failure) } else { Ok(None) };
    };
    let is_up = state.link.state() == Some(LinkState::Up);
    let present = match present_position(session, timeout) {
        Ok(present) => Some(present),
        // A movement would be refused, with the reason.
        Err(failure) if is_needed && is_up => return Err(failure),
        Err(_) => None,
    };
    let cruise_speed_mps = match is_up {
        true => cruise_speed(session, timeout),
        false => None,
    };
    Ok(Some(KnownRobot {
        state,
        present,
        cruise_speed_mps,
    }))
}

/// What the DSP's port has; `None` if it cannot be read now, which changes no more than the times that are shown.
fn cruise_speed(session: &Session, timeout: Duration) -> Option<f64> {
    match read_mps(session, timeout) {
        Ok(speed_mps) => speed_mps,
        Err(failure) => {
            tracing::debug!(chain = ?failure.chain(), "the cruise speed cannot be read");
            None
        }
    }
}

fn site(
    plan: &Plan,
    args: &PlanFileArgs,
    config: &PlanConfig,
    robot: Option<&KnownRobot>,
    is_for_flight: bool,
) -> Site {
    let present = robot.and_then(|robot| robot.present);
    let zero_above_sea_m = config.zero_above_sea_m;
    let known = robot.and_then(|robot| robot.state.home());
    let (home, home_source) = home(
        plan,
        args.home,
        known,
        zero_above_sea_m,
        is_for_flight && present.is_some(),
    );
    let is_home_altitude_known = home.altitude_m.is_some();
    let home = Waypoint {
        latitude_deg: home.latitude_deg,
        longitude_deg: home.longitude_deg,
        altitude_m: home.altitude_m.unwrap_or(0.0),
    };
    Site {
        home,
        is_home_altitude_known,
        home_source,
        start: match present {
            Some(present) if present.is_flying => Start::Flying(present.at),
            Some(present) => Start::Ground(present.at),
            None => Start::Ground(home),
        },
        zero_above_sea_m,
        take_off_m: args.takeoff,
        from: args.from,
        is_for_flight,
    }
}

/// The point of take-off: what the operator says, what the bridge has seen, what the plan's author expected. Its
/// altitude is telemetry's, if that is known. `is_of_robot`: what the author expected is not enough, because a robot is
/// there.
fn home(
    plan: &Plan,
    asked: Option<HomeArg>,
    known: Option<WaypointPosition>,
    zero_above_sea_m: Option<f64>,
    is_of_robot: bool,
) -> (HomeArg, HomeSource) {
    let known = known.map(|home| HomeArg {
        latitude_deg: home.latitude_deg,
        longitude_deg: home.longitude_deg,
        altitude_m: Some(home.altitude_m),
    });
    let planned = plan.planned_home.map(|home| HomeArg {
        latitude_deg: home.position.latitude_deg,
        longitude_deg: home.position.longitude_deg,
        altitude_m: home
            .above_sea_m
            .zip(zero_above_sea_m)
            .map(|(above_sea_m, zero_m)| above_sea_m - zero_m),
    });
    if let Some(asked) = asked {
        let known = known.or(planned);
        let altitude_m = asked.altitude_m.or(known.and_then(|home| home.altitude_m));
        let home = HomeArg {
            altitude_m,
            ..asked
        };
        return (home, HomeSource::Operator);
    }
    if let Some(known) = known {
        return (known, HomeSource::Robot);
    }
    // The robot has taken off somewhere, and the plan does not know where.
    if let Some(planned) = planned.filter(|_| !is_of_robot) {
        return (planned, HomeSource::Plan);
    }
    let first = plan.items.iter().find_map(|item| item.action.position());
    let below_first = HomeArg {
        latitude_deg: first.map_or(0.0, |first| first.latitude_deg),
        longitude_deg: first.map_or(0.0, |first| first.longitude_deg),
        altitude_m: None,
    };
    (below_first, HomeSource::Assumed)
}

fn endurance(
    config: &PlanConfig,
    robot: Option<&KnownRobot>,
    rules: Option<&BridgeConfig>,
) -> Endurance {
    let of_rules = |port| rules.and_then(|rules| configured(rules, port));
    Endurance {
        cruise_speed_mps: config
            .cruise_speed_mps
            .or(robot.and_then(|robot| robot.cruise_speed_mps))
            .or_else(|| of_rules(port::CRUISE_SPEED_MPS)),
        climb_speed_mps: of_rules(port::CLIMB_SPEED_MPS),
        endurance_s: config.endurance_s,
        reserve_s: config.reserve_s,
    }
}

/// What the robot says against the flight: a rule that is broken now, and a fence that is not the one of the file.
fn of_robot(robot: &KnownRobot, rules: Option<&BridgeConfig>, is_for_flight: bool) -> Vec<Finding> {
    let mut findings = Vec::new();
    let safety = &robot.state.safety;
    let is_severe = safety
        .action()
        .is_some_and(|action| action != SafetyAction::Warn);
    if let Some(rule) = safety.rule().filter(|_| is_severe) {
        let severity = match is_for_flight {
            true => Severity::Error,
            false => Severity::Warning,
        };
        let text = format!("the robot breaks the safety rule {rule} now");
        findings.push(
            Finding::new(severity, "robot-safety", text).with_next_step("`ril status` shows it"),
        );
    }
    let areas = rules.map(|rules| rules.fence.areas() as u32);
    if areas.is_some_and(|areas| areas != safety.fence_areas) {
        let text = format!(
            "the robot's fence has {} areas in force, and the file that was read has {}",
            safety.fence_areas,
            areas.unwrap_or_default()
        );
        let remedy =
            "name the file that the robot's bridge reads (`--bridge FILE`), or `ril fence reload`";
        findings.push(Finding::unchecked("robot-fence", text).with_next_step(remedy));
    }
    if robot.present.is_none() {
        findings.push(
            Finding::unchecked(
                "robot-position",
                "the robot runs, but does not say where it is",
            )
            .with_next_step("`ril status` shows its link and its telemetry"),
        );
    }
    findings
}
