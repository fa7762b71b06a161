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
use operator::session::{Latest, Session, configuration};
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

    /// How long to wait at most
    #[arg(long, value_name = "DURATION", default_value = "30s", value_parser = duration)]
    pub timeout: Duration,

    /// Print one JSON object
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
    let session = Session::join(&args.common)?;
    let mut topics = open(&session, &args.conditions)?;
    let began = MonotonicNs::now();
    let (mut standings, mut now) = (Vec::new(), began);
    session.gather(&mut topics, began + args.timeout, |topics, at| {
        (standings, now) = (judge(topics, &args.conditions, at), at);
        Ok(standings.iter().all(|standing| standing.is_met))
    })?;
    let is_met = standings.iter().all(|standing| standing.is_met);
    if !is_met && session.termination.requested() {
        let text = format!("interrupted: {}", missing(&args.conditions, &standings));
        return Err(Failure::new(ExitCode::OutcomeUnknown, text));
    }
    let conditions = args.conditions.iter().zip(&standings);
    let object = WaitObject {
        schema: SCHEMA,
        robot: session.ipc.robot().get(),
        met: is_met,
        after_s: now.since(began).as_millis() as f64 / 1000.0,
        conditions: conditions
            .map(|(condition, standing)| ConditionObject {
                condition: condition.to_string(),
                met: standing.is_met,
                value: standing.value.clone(),
            })
            .collect(),
    };
    let lines = object.conditions.iter().filter(|_| is_met);
    let text = lines.map(|one| format!("{}: {}\n", one.condition, one.value));
    let text = match args.json {
        true => json_text(&object)?,
        false => text.collect(),
    };
    tell(Weight::Result, text)?;
    if is_met {
        return Ok(());
    }
    look_for_providers(&topics, &session)?;
    let missing = missing(&args.conditions, &standings);
    let text = format!("timed out after {}; {missing}", DurationText(args.timeout));
    Err(Failure::new(ExitCode::Timeout, text))
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
