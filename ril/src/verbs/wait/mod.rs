//! `ril wait`: sleeps until a robot is as a script needs it.
//!
//! It wakes when a sample comes, a signal, or the time is over; [`condition`] judges.

pub mod condition;

use std::time::Duration;

use clap::Args;
use ipc_types::payload::{HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, Topic};
use operator::options::{EXIT_CODES, duration};
use operator::render::{Weight, json_text, tell};
use operator::robot::absence::absent;
use operator::session::{Latest, Session, alive_here, configuration, other_domains};
use runtime::args::CommonArgs;
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure};
use serde::Serialize;

use self::condition::{Condition, Newest, Standing};

/// What a condition is, for the end of the help.
const CONDITIONS: &str = "\
Conditions:
  up               the link to the DSP is up
  landed, flying   the helicopter is on the ground, or in the air
  hovering         in the air, without a movement, slower than 0.5 m/s
  FIELD OP VALUE   a number of the robot's telemetry (`ril topic info hero`);
                   OP is >, >=, <, <=, = or !=; quote it: \"altitude>20m\"
  Short names of fields, and their units:
    altitude m (telemetry altitude, as in `ril goto`), height m (sonar),
    speed m/s (over ground), climb m/s, battery V, fuel %, heading deg, fix
  An angle may be named in degrees: geodetic.latitude_deg";

/// `ril wait`
///
/// Several conditions must be fulfilled at the same time. A sample that is older than 1 s fulfils nothing.
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{CONDITIONS}\n\n{EXIT_CODES}"))]
pub struct WaitArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// What to wait for; when it is repeated, for all at the same time
    #[arg(long = "for", value_name = "CONDITION", required = true, value_parser = Condition::parse)]
    pub conditions: Vec<Condition>,

    /// All robots that are alive on this machine, whatever --robot says, at the same time
    #[arg(long)]
    pub all: bool,

    /// How long to wait at most
    #[arg(long, value_name = "DURATION", default_value = "30s", value_parser = duration)]
    pub timeout: Duration,

    /// Print one JSON object, with --all one a robot
    #[arg(long)]
    pub json: bool,
}

/// Name of the JSON object's layout.
const SCHEMA: &str = "ril.Wait.v1";

/// How it ended, for programs.
#[derive(Serialize)]
struct WaitObject {
    schema: &'static str,
    robot: u32,
    /// Whether all conditions were fulfilled at the same time.
    met: bool,
    after_s: f64,
    conditions: Vec<ConditionObject>,
}

#[derive(Serialize)]
struct ConditionObject {
    #[serde(rename = "for")]
    condition: String,
    met: bool,
    value: String,
}

/// `ril wait`
///
/// # Errors
///
/// Code 4 when not all conditions were fulfilled in time, 3 when then a process does not run that they need, 7 when a
/// signal ends the command before.
pub fn wait(args: &WaitArgs) -> Result<(), Failure> {
    configuration(&args.common)?;
    let sessions = match args.all {
        true => Session::join_each(alive_here()?)?,
        false => vec![Session::join(&args.common)?],
    };
    let Some(first) = sessions.first() else {
        let text = format!("there is no robot to wait for{}", other_domains());
        return Err(Failure::new(ExitCode::ServiceAbsent, text));
    };
    let topics = sessions
        .iter()
        .map(|session| open(session, &args.conditions));
    let mut topics = topics.collect::<Result<Vec<Needed>, Failure>>()?;
    let began = MonotonicNs::now();
    let (mut standings, mut now) = (Vec::new(), began);
    first.gather(&mut topics, began + args.timeout, |topics, at| {
        let judged = topics.iter().map(|of| judge(of, &args.conditions, at));
        (standings, now) = (judged.collect::<Vec<_>>(), at);
        Ok(standings.iter().all(|standings| is_met(standings)))
    })?;
    let are_all_met = standings.iter().all(|standings| is_met(standings));
    let missing = || {
        let of_robots = sessions.iter().zip(&standings);
        let unmet = of_robots.filter(|(_, standings)| !is_met(standings));
        let words = unmet.map(|(session, standings)| {
            let missing = missing(&args.conditions, standings);
            match args.all {
                true => format!("robot {}: {missing}", session.ipc.robot()),
                false => missing,
            }
        });
        words.collect::<Vec<_>>().join("; ")
    };
    if !are_all_met && first.termination.requested() {
        let text = format!("interrupted: {}", missing());
        return Err(Failure::new(ExitCode::OutcomeUnknown, text));
    }
    let mut text = String::new();
    for (session, standings) in sessions.iter().zip(&standings) {
        let robot = session.ipc.robot().get();
        let object = WaitObject {
            schema: SCHEMA,
            robot,
            met: is_met(standings),
            after_s: now.since(began).as_millis() as f64 / 1000.0,
            conditions: objects(&args.conditions, standings),
        };
        if args.json {
            text += &json_text(&object)?;
        } else if are_all_met {
            let name = if args.all {
                format!("robot {robot}: ")
            } else {
                String::new()
            };
            for one in &object.conditions {
                text += &format!("{name}{}: {}\n", one.condition, one.value);
            }
        }
    }
    tell(Weight::Result, text)?;
    if are_all_met {
        return Ok(());
    }
    for (session, topics) in sessions.iter().zip(&topics) {
        look_for_providers(topics, session)?;
    }
    let text = format!(
        "timed out after {}; {}",
        DurationText(args.timeout),
        missing()
    );
    Err(Failure::new(ExitCode::Timeout, text))
}

fn is_met(standings: &[Standing]) -> bool {
    standings.iter().all(|standing| standing.is_met)
}

fn objects(conditions: &[Condition], standings: &[Standing]) -> Vec<ConditionObject> {
    let conditions = conditions.iter().zip(standings);
    conditions
        .map(|(condition, standing)| ConditionObject {
            condition: condition.to_string(),
            met: standing.is_met,
            value: standing.value.clone(),
        })
        .collect()
}

/// What is not as it should be, in words.
fn missing(conditions: &[Condition], standings: &[Standing]) -> String {
    let unmet = conditions.iter().zip(standings);
    let unmet = unmet.filter(|(_, standing)| !standing.is_met);
    let words: Vec<String> = unmet
        .map(|(condition, standing)| condition.unmet(standing))
        .collect();
    words.join(", ")
}

/// The topics that the conditions need.
type Needed = (Option<Latest<ModuleState>>, Option<Latest<HeroTelemetry>>);

fn open(session: &Session, conditions: &[Condition]) -> Result<Needed, Failure> {
    let needs_state = conditions.iter().any(Condition::needs_state);
    let needs_telemetry = conditions.iter().any(Condition::needs_telemetry);
    let state = needs_state.then(|| Latest::open(&session.ipc));
    let hero = needs_telemetry.then(|| Latest::open(&session.ipc));
    Ok((state.transpose()?, hero.transpose()?))
}

fn judge((state, hero): &Needed, conditions: &[Condition], now: MonotonicNs) -> Vec<Standing> {
    let newest = Newest {
        state: state.as_ref().and_then(|state| state.sample.as_ref()),
        hero: hero.as_ref().and_then(|hero| hero.sample.as_ref()),
    };
    let standings = conditions.iter();
    standings
        .map(|condition| condition.judge(&newest, now))
        .collect()
}

/// Fails when no process provides what is waited for.
fn look_for_providers((state, hero): &Needed, session: &Session) -> Result<(), Failure> {
    let needed = [
        state.as_ref().map(|_| ModuleState::KEY),
        hero.as_ref().map(|_| HeroTelemetry::KEY),
    ];
    for key in needed.into_iter().flatten() {
        if !session.is_provided(key)? {
            return Err(absent(session, key));
        }
    }
    Ok(())
}
