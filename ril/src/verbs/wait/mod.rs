//! `ril wait`: sleeps until a robot is as a script needs it.
//!
//! It wakes when a sample comes, a signal, or the time is over; [`condition`] judges.

pub mod condition;

use std::io::{self, Write};
use std::time::Duration;

use clap::Args;
use ipc_types::payload::{HeroTelemetry, ModuleState};
use ipc_types::{MonotonicNs, Source, Topic};
use runtime::args::CommonArgs;
use runtime::duration::Shown;
use runtime::exit::{ExitCode, Failure};
use serde::Serialize;

use self::condition::{Condition, Newest, Standing};
use crate::options::{EXIT_CODES, duration};
use crate::render::json_line;
use crate::session::{Latest, Session, absent, configuration};

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
/// Code 4 when not all conditions were fulfilled in time, 3 when then a process does not run that they need, 7 when a signal ends
/// the command before.
pub fn wait(args: &WaitArgs) -> Result<(), Failure> {
    if configuration(&args.common)?.is_none() {
        return Ok(());
    }
    let session = Session::join(&args.common)?;
    let mut topics = Topics::open(&session, &args.conditions)?;
    let began = MonotonicNs::now();
    let give_up = began + args.timeout;
    let (standings, now) = loop {
        topics.drain();
        let now = MonotonicNs::now();
        let standings = topics.judge(&args.conditions, now);
        if standings.iter().all(|standing| standing.is_met) || now >= give_up {
            break (standings, now);
        }
        if session.termination.requested() {
            let text = format!("interrupted: {}", missing(&args.conditions, &standings));
            return Err(Failure::new(ExitCode::OutcomeUnknown, text));
        }
        session.wait(topics.ports(), Some(give_up))?;
    };
    let end = End {
        robot: session.ipc.robot().get(),
        is_met: standings.iter().all(|standing| standing.is_met),
        after_s: now.since(began).as_millis() as f64 / 1000.0,
        conditions: &args.conditions,
        standings: &standings,
    };
    end.print(args.json)?;
    if end.is_met {
        return Ok(());
    }
    topics.look_for_providers(&session)?;
    let missing = missing(&args.conditions, &standings);
    let text = format!("timed out after {}: {missing}", Shown(args.timeout));
    Err(Failure::new(ExitCode::Timeout, text))
}

/// How it ended.
struct End<'a> {
    robot: u32,
    is_met: bool,
    after_s: f64,
    conditions: &'a [Condition],
    standings: &'a [Standing],
}

impl End<'_> {
    fn print(&self, as_json: bool) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        let mut conditions = self.conditions.iter().zip(self.standings);
        if as_json {
            let object = WaitObject {
                schema: SCHEMA,
                robot: self.robot,
                met: self.is_met,
                after_s: self.after_s,
                conditions: conditions
                    .map(|(condition, standing)| ConditionObject {
                        condition: condition.to_string(),
                        met: standing.is_met,
                        value: standing.value.clone(),
                    })
                    .collect(),
            };
            return json_line(&mut out, &object);
        }
        if !self.is_met {
            return Ok(());
        }
        conditions.try_for_each(|(condition, standing)| {
            writeln!(out, "{condition}: {}", standing.value).map_err(Failure::output)
        })
    }
}

/// What is not as it should be, in words.
fn missing(conditions: &[Condition], standings: &[Standing]) -> String {
    let unmet = conditions.iter().zip(standings);
    let unmet = unmet.filter(|(_, standing)| !standing.is_met);
    let words: Vec<String> = unmet
        .map(|(condition, standing)| format!("{condition} ({})", standing.value))
        .collect();
    words.join(", ")
}

/// The topics that the conditions need.
struct Topics {
    state: Option<Latest<ModuleState>>,
    hero: Option<Latest<HeroTelemetry>>,
}

impl Topics {
    fn open(session: &Session, conditions: &[Condition]) -> Result<Topics, Failure> {
        let needs_state = conditions.iter().any(Condition::needs_state);
        let needs_telemetry = conditions.iter().any(Condition::needs_telemetry);
        Ok(Topics {
            state: needs_state
                .then(|| Latest::open(&session.ipc))
                .transpose()?,
            hero: needs_telemetry
                .then(|| Latest::open(&session.ipc))
                .transpose()?,
        })
    }

    fn ports(&mut self) -> impl Iterator<Item = &mut dyn Source> {
        let state = self
            .state
            .as_mut()
            .map(|state| &mut state.port as &mut dyn Source);
        let hero = self
            .hero
            .as_mut()
            .map(|hero| &mut hero.port as &mut dyn Source);
        state.into_iter().chain(hero)
    }

    fn drain(&mut self) {
        self.state.as_mut().map(Latest::drain);
        self.hero.as_mut().map(Latest::drain);
    }

    fn judge(&self, conditions: &[Condition], now: MonotonicNs) -> Vec<Standing> {
        let newest = Newest {
            state: self.state.as_ref().and_then(|state| state.sample.as_ref()),
            hero: self.hero.as_ref().and_then(|hero| hero.sample.as_ref()),
        };
        let standings = conditions.iter();
        standings
            .map(|condition| condition.judge(&newest, now))
            .collect()
    }

    /// Fails when no process provides what is waited for.
    fn look_for_providers(&self, session: &Session) -> Result<(), Failure> {
        let needed = [
            self.state.as_ref().map(|_| ModuleState::KEY),
            self.hero.as_ref().map(|_| HeroTelemetry::KEY),
        ];
        for key in needed.into_iter().flatten() {
            if !session.is_provided(key)? {
                return Err(absent(key, session.ipc.robot()));
            }
        }
        Ok(())
    }
}
