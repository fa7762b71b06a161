//! `ril robots`: all robots of this user, and how each of them is.
//!
//! What lives comes from the doctor's look at the domain; how a robot is, from its newest samples. A robot in which no
//! process is is not joined.

use std::collections::BTreeSet;
use std::fmt;
use std::io::{self, Write};

use clap::Args;
use ipc_types::code::{Functionality, LinkState, ModuleStatus};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Domain, Ipc, Module, MonotonicNs, RelayModule, RobotId, Source, Topic};
use operator::options::SampleArgs;
use operator::render::words::{module_words, or_dash};
use operator::render::{json_line, note};
use operator::robot::domain::{DomainFacts, Provided};
use operator::robot::freshness::{age_ms, is_present, named};
use operator::robot::pilot;
use operator::session::{Latest, Session, Topics, as_user, configuration, other_domains};
use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;

/// `ril robots`
///
/// A robot is live when a process of it lives. It lists all robots, whatever --robot says.
#[derive(Args, Clone, Debug)]
#[command(mut_arg("json", |json| json.help("Print each robot as a JSON object on a line")))]
pub struct RobotsArgs {
    /// What every command takes that shows samples.
    #[command(flatten)]
    pub samples: SampleArgs,
}

/// `ril robots`
///
/// # Errors
///
/// Code 1 when the shared memory cannot be read, that of another user included.
pub fn robots(RobotsArgs { samples: args }: &RobotsArgs) -> Result<(), Failure> {
    let config = configuration(&args.common)?;
    let timeout = args.timeout.unwrap_or_else(|| config.observe.timeout());
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let facts = DomainFacts::look(&domain);
    let unreadable = |trouble| {
        let text = format!(
            "looking at {} {trouble}; `ril doctor` says more",
            domain.root().display()
        );
        Failure::internal(text)
    };
    let inspection = facts.inspection.as_ref().map_err(unreadable)?;
    if let Some(root) = inspection.root.as_ref().filter(|root| !root.is_ours()) {
        let text = format!(
            "{} belongs to user {}: this user cannot see whether its robots live",
            root.path.display(),
            root.uid
        );
        return Err(Failure::internal(text).with_next_step(as_user(root.uid)));
    }
    let providers = facts.providers.as_ref().map_err(unreadable)?;
    let mut found: BTreeSet<RobotId> = providers.iter().map(|one| one.robot).collect();
    found.extend(inspection.robots.iter().map(|one| one.robot));
    let live: BTreeSet<RobotId> = providers.iter().map(|one| one.robot).collect();
    let sessions = Session::join_each(live)?;
    let live = sessions.iter().map(|session| Watched::open(&session.ipc));
    let mut live = live.collect::<Result<Vec<_>, _>>()?;
    if let Some(session) = sessions.first() {
        let give_up = MonotonicNs::now() + timeout;
        session.gather(&mut live, give_up, |live, _| {
            Ok(live.iter().all(|one| one.is_complete(providers)))
        })?;
    }
    let now = MonotonicNs::now();
    let robots: Vec<RobotSummary> = found
        .into_iter()
        .map(|id| {
            let watched = live.iter().find(|one| one.robot == id);
            describe(id, watched, &facts, providers, now)
        })
        .collect();
    let mut out = io::stdout().lock();
    if robots.is_empty() {
        note(format_args!(
            "no robot: `ril run bridge` and `ril run status` start the processes of one{}",
            other_domains()
        ));
    } else if !args.json {
        return write!(out, "{}", RobotTable(&robots)).map_err(Failure::output);
    }
    robots
        .iter()
        .try_for_each(|robot| json_line(&mut out, robot))
}

/// A live robot whose samples are waited for.
struct Watched {
    robot: RobotId,
    state: Latest<ModuleState>,
    hero: Latest<HeroTelemetry>,
    /// Says whether it flies while there is no status.
    dsp: Latest<DspTelemetry>,
}

impl Watched {
    fn open(ipc: &Ipc) -> Result<Watched, Failure> {
        Ok(Watched {
            robot: ipc.robot(),
            state: Latest::open(ipc)?,
            hero: Latest::open(ipc)?,
            dsp: Latest::open(ipc)?,
        })
    }

    /// Whether everything is there that can be expected.
    fn is_complete(&self, providers: &[Provided]) -> bool {
        let provides = |key: &str| {
            let mut providers = providers.iter();
            providers.any(|one| one.robot == self.robot && one.service.key() == key)
        };
        // A status whose DSP never sent anything publishes nothing.
        let is_silent = self.state.sample.as_ref();
        let is_silent = is_silent.is_some_and(|state| state.link.telemetry_published == 0);
        (self.state.sample.is_some() || !provides(ModuleState::KEY))
            && (self.hero.sample.is_some() || is_silent || !provides(HeroTelemetry::KEY))
            && (self.dsp.sample.is_some() || is_silent || !provides(DspTelemetry::KEY))
    }
}

impl Topics for Watched {
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        vec![
            &mut self.state.port,
            &mut self.hero.port,
            &mut self.dsp.port,
        ]
    }

    fn drain(&mut self) {
        self.state.drain();
        self.hero.drain();
        self.dsp.drain();
    }
}

fn describe(
    id: RobotId,
    watched: Option<&Watched>,
    facts: &DomainFacts,
    providers: &[Provided],
    now: MonotonicNs,
) -> RobotSummary {
    let of_robot = providers.iter().filter(|one| one.robot == id);
    let is_state = |one: &Provided| one.service.key() == ModuleState::KEY;
    let is_without_bridge = of_robot.clone().next().is_some() && !of_robot.clone().any(is_state);
    let processes: BTreeSet<&str> = of_robot.map(|one| one.by.process.as_str()).collect();
    let inspection = facts.inspection.as_ref().ok();
    let inspected = inspection.and_then(|all| all.robots.iter().find(|one| one.robot == id));
    let state = watched.and_then(|one| one.state.sample.as_ref());
    let hero = watched.and_then(|one| one.hero.sample.as_ref());
    let phase = |state: &ModuleState| {
        let status = named(ModuleStatus::from_code(state.status), state.status);
        match Functionality::from_code(state.functionality) {
            Some(Functionality::AtRest) => status,
            doing => format!("{status}, {}", named(doing, state.functionality)),
        }
    };
    let dsp = watched.and_then(|one| one.dsp.sample.as_ref());
    let present = |received| is_present(received, now);
    let flying = hero
        .filter(|hero| present(hero.received()))
        .map(HeroTelemetry::is_flying)
        .or_else(|| {
            dsp.filter(|dsp| present(dsp.received()))
                .map(DspTelemetry::is_flying)
        });
    RobotSummary {
        schema: SCHEMA,
        robot: id.get(),
        live: !processes.is_empty() || inspected.is_some_and(|one| one.is_live),
        relayed: processes.contains(RelayModule::NAME),
        // Names that other processes chose: they must not command the terminal.
        processes: processes
            .into_iter()
            .map(|name| name.escape_debug().to_string())
            .collect(),
        link: state
            .filter(|state| is_present(state.published(), now))
            .map(|state| named(LinkState::from_code(state.link.state), state.link.state)),
        phase: state
            .filter(|state| is_present(state.published(), now))
            .map(phase),
        doing: state
            .filter(|state| is_present(state.published(), now))
            .map(|state| doing(state, flying))
            .or_else(|| is_without_bridge.then(|| "no bridge".to_owned())),
        flying,
        age_ms: state.and_then(|state| age_ms(MonotonicNs(state.published_ns), now)),
    }
}

/// What the robot does, or how its module stands while that does nothing, in a word or two for people.
fn doing(state: &ModuleState, flying: Option<bool>) -> String {
    match state.functionality() {
        Some(Functionality::AtRest) | None => {
            let status = ModuleStatus::from_code(state.status);
            let words = module_words(status, state.is_blocked());
            words.map_or_else(|| named(status, state.status), str::to_owned)
        }
        Some(doing) => pilot::activity(doing, flying).to_owned(),
    }
}

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Robot.v1";

/// A robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotSummary {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Its number.
    pub robot: u32,
    /// Whether a process of it lives.
    pub live: bool,
    /// The live processes that provide its services, by name, such as `bridge`.
    pub processes: Vec<String>,
    /// Whether it is on another machine.
    pub relayed: bool,
    /// State of the link to its DSP; `None` if that is not known.
    pub link: Option<String>,
    /// What its module does: status and functionality; `None` if that is not known.
    pub phase: Option<String>,
    /// What its module does, in words for people.
    #[serde(skip)]
    pub doing: Option<String>,
    /// Whether it flies; `None` if no telemetry of the present came.
    pub flying: Option<bool>,
    /// How old its state is, ms; `None` if none came.
    pub age_ms: Option<u64>,
}

/// Robots as a table.
pub struct RobotTable<'a>(pub &'a [RobotSummary]);

impl fmt::Display for RobotTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<6} {:<5} {:<10} {:<8} {:<22} PROCESSES",
            "ROBOT", "LIVE", "LINK", "FLYING", "PHASE"
        )?;
        for robot in self.0 {
            let live = if robot.live { "yes" } else { "no" };
            let flying = match robot.flying {
                Some(true) => "yes",
                Some(false) => "no",
                None => "-",
            };
            let mut processes = robot.processes.join(", ");
            if processes.is_empty() {
                processes = "-".to_owned();
            }
            writeln!(
                f,
                "{:<6} {live:<5} {:<10} {flying:<8} {:<22} {processes}",
                robot.robot,
                or_dash(robot.link.as_ref()),
                or_dash(robot.doing.as_ref()),
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_a_line_that_fits_the_terminal() {
        let live = RobotSummary {
            schema: SCHEMA,
            robot: 1,
            live: true,
            processes: vec!["bridge".to_owned(), "status".to_owned()],
            relayed: false,
            link: Some("up".to_owned()),
            phase: Some("running, taking-off".to_owned()),
            doing: Some("taking off".to_owned()),
            flying: Some(true),
            age_ms: Some(100),
        };
        let dead = RobotSummary {
            robot: 12,
            live: false,
            processes: Vec::new(),
            link: None,
            phase: None,
            doing: None,
            flying: None,
            age_ms: None,
            ..live.clone()
        };
        let text = RobotTable(&[live, dead]).to_string();
        let expected = "\
ROBOT  LIVE  LINK       FLYING   PHASE                  PROCESSES
1      yes   up         yes      taking off             bridge, status
12     no    -          -        -                      -
";
        assert_eq!(text, expected);
        assert!(text.lines().all(|line| line.len() <= 80));
    }

    #[test]
    fn people_read_how_a_module_stands_and_not_the_words_of_the_wire() {
        for (status, is_blocked, functionality, expected) in [
            (ModuleStatus::Ended, 0, Functionality::AtRest, "ready"),
            (ModuleStatus::Ended, 1, Functionality::AtRest, "stopped"),
            (
                ModuleStatus::Running,
                0,
                Functionality::FollowingPath,
                "flying the path",
            ),
        ] {
            let state = ModuleState {
                status: status.code(),
                blocked: is_blocked,
                functionality: functionality.code(),
                ..ModuleState::default()
            };
            assert_eq!(doing(&state, Some(true)), expected);
        }
    }
}
