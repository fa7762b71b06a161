//! `ril start | stop | takeoff | land | hold | goto | rtl | fence | control`: makes the requests of one command.
//!
//! A conversation sends and follows them, and [`messages`](operator::render::messages) has the texts and exit codes.
//!
//! * `path`: goto and rtl, with `progress` beside; `fence`: the geofence that is in force; `control`: who commands.

mod control;
mod fence;
mod path;
mod progress;

use std::time::Duration;

use clap::{Args, Subcommand};
pub use control::{HolderArgs, control as command_of};
use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, MovementData};
use ipc_types::service::is_key;
use ipc_types::{MonotonicNs, Request, fresh_request_id};
use operator::config::Config;
use operator::options::{RequestArgs, SampleArgs, take_off_height};
use operator::render::messages::Verb;
use operator::request::{Conversation, Format, Until, ask, ask_at_once, complete, control_request};
use operator::session::{OrderContext, Session, UrgentContext, commandable_here, other_domains};
pub use path::{GotoArgs, RtlArgs, go_to, rtl};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure};

/// `ril start`, `ril stop`
#[derive(Args, Clone, Debug)]
pub struct ControlArgs {
    /// Name of a module with a control service of its own, such as battery_watch [default: the bridge]
    #[arg(long, value_name = "NAME", value_parser = module_name)]
    pub module: Option<String>,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// `ril takeoff`
#[derive(Args, Clone, Debug)]
pub struct TakeoffArgs {
    /// Height above take-off, such as 20m, 60ft, or 20 for metres
    #[arg(value_name = "ALTITUDE", required_unless_present = "altitude", conflicts_with = "altitude",
        allow_negative_numbers = true, value_parser = take_off_height)]
    pub to: Option<f64>,

    /// Height above take-off, as an option
    #[arg(long, value_name = "ALTITUDE", allow_hyphen_values = true, value_parser = take_off_height)]
    pub altitude: Option<f64>,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

impl TakeoffArgs {
    /// Height above take-off, m. clap makes sure that there is one.
    pub fn height_m(&self) -> f64 {
        self.to.or(self.altitude).unwrap_or_default()
    }
}

/// `ril land`
#[derive(Args, Clone, Debug)]
pub struct LandArgs {
    /// Replace a path that is under way instead of being refused as busy
    #[arg(long)]
    pub preempt: bool,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// `ril hold`
#[derive(Args, Clone, Debug)]
pub struct HoldArgs {
    /// All robots that can be commanded from this machine, whatever --robot says
    #[arg(long)]
    pub all: bool,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// `ril fence`
#[derive(Args, Clone, Debug)]
pub struct FenceArgs {
    /// What to do with the geofence.
    #[command(subcommand)]
    pub command: FenceCommand,
}

/// `ril fence …`
#[derive(Clone, Debug, Subcommand)]
pub enum FenceCommand {
    /// Show the geofence that the running bridge has in force
    Show(SampleArgs),
    /// Read the geofence in bridge.toml again; the bridge checks a path that is under way against it
    Reload(RequestArgs),
}

/// Reads the name of a module.
fn module_name(text: &str) -> Result<String, String> {
    match is_key(text) && !text.contains('/') {
        true => Ok(text.to_owned()),
        false => Err("a module's name is one word in lower snake case".to_owned()),
    }
}

/// What a start of the bridge looks at first; it fails only when the robot's shared memory does.
pub(crate) type BeforeStart = fn(&Session, &CommonArgs, &Config) -> Result<(), Failure>;

/// `ril start`. `look` says on standard error what is not in order, which never keeps the module from starting.
///
/// # Errors
///
/// As [`stop`].
pub(crate) fn start(args: &ControlArgs, look: BeforeStart) -> Result<(), Failure> {
    let common = &args.request.ask.common;
    control(
        Verb::Start,
        ControlCommand::Start,
        args,
        |asked| match args.module {
            None => look(&asked.session, common, &asked.config),
            Some(_) => Ok(()),
        },
    )
}

/// `ril stop`
///
/// # Errors
///
/// As all requests: see [`messages::exit_code`](operator::render::messages::exit_code); code 2 when several robots are
/// alive and none was named, 3 when there is no bridge, 4 when it does not answer, 7 when a signal ends the command
/// before the final report.
pub fn stop(args: &ControlArgs) -> Result<(), Failure> {
    ask_at_once(Verb::Stop, control_key(args), &args.request, |asked| {
        control_request(ControlCommand::Stop, asked.issued, asked.deadline_ms())
    })
}

/// `ril fence …`
///
/// # Errors
///
/// As [`stop`].
pub fn fence(command: &FenceCommand) -> Result<(), Failure> {
    match command {
        FenceCommand::Show(args) => fence::show(args),
        FenceCommand::Reload(args) => fence::reload(args),
    }
}

/// `ril takeoff`
///
/// # Errors
///
/// As [`stop`].
pub fn take_off(args: &TakeoffArgs) -> Result<(), Failure> {
    let request = MovementData::take_off(fresh_request_id(), args.height_m());
    movement(Verb::TakeOff, request, false, &args.request)
}

/// `ril land`
///
/// # Errors
///
/// As [`stop`].
pub fn land(args: &LandArgs) -> Result<(), Failure> {
    let request = MovementData::land(fresh_request_id());
    urgent(Verb::Land, request, args.preempt, &args.request)
}

/// `ril hold`, which always replaces a path that is under way.
///
/// # Errors
///
/// As [`stop`]; with `--all` code 3 when no robot is alive, else that of the first robot that did not hold.
pub fn hold(args: &HoldArgs) -> Result<(), Failure> {
    match args.all {
        true => hold_all(&args.request),
        false => {
            let request = MovementData::hold(fresh_request_id());
            urgent(Verb::Hold, request, true, &args.request)
        }
    }
}

/// Every robot has its order before the outcome of one is waited for, and one that fails keeps no other from it.
fn hold_all(args: &RequestArgs) -> Result<(), Failure> {
    let ask = &args.ask;
    let own = UrgentContext::of_all(ask)?;
    let robots = commandable_here()?;
    if robots.is_empty() {
        let text = format!(
            "there is no robot to hold: no bridge is running{}",
            other_domains()
        );
        return Err(Failure::new(ExitCode::ServiceAbsent, text));
    }
    let mut failures = Vec::new();
    let mut sessions = Vec::new();
    for robot in robots {
        match own.session.beside(robot) {
            Ok(session) => sessions.push(session),
            Err(failure) => failures.push((robot, failure)),
        }
    }
    let mut begun = Vec::new();
    for session in &sessions {
        let request = issued(MovementData::hold(fresh_request_id()), own.issued);
        let requests = [complete(request, true, own.deadline_ms())];
        let sent = Conversation::open(session, Verb::Hold, Duration::ZERO).and_then(|bridge| {
            let mut bridge = bridge.name_robot();
            let exchange = bridge.begin(&requests, Until::of(args))?;
            Ok((bridge, exchange))
        });
        match sent {
            Ok((bridge, exchange)) => begun.push((session, bridge, exchange, requests)),
            Err(failure) => failures.push((session.ipc.robot(), failure)),
        }
    }
    let (timeout, now) = (own.timeout(), MonotonicNs::now());
    for (session, mut bridge, mut exchange, requests) in begun {
        exchange.await_for(timeout, now);
        let ended = bridge.follow_begun(exchange, &requests, Format::of(ask.json));
        if let Err(failure) = ended {
            failures.push((session.ipc.robot(), failure));
        }
    }
    let Some((_, first)) = failures.first() else {
        return Ok(());
    };
    let texts = failures
        .iter()
        .map(|(robot, failure)| format!("robot {robot}: {}", failure.chain().join(": ")));
    let text = texts.collect::<Vec<_>>().join("; ");
    Err(Failure::new(first.code(), text).with_next_step(first.next_step()))
}

/// The service of the bridge, or of the module that `args` name.
fn control_key(args: &ControlArgs) -> &'static str {
    match &args.module {
        None => ModuleControl::KEY,
        // Once in the life of the process; the ports take keys that live as long as it.
        Some(module) => format!("{module}/control").leak(),
    }
}

/// A start of the bridge, or of the module that `args` name; `before` comes first.
fn control(
    verb: Verb,
    command: ControlCommand,
    args: &ControlArgs,
    before: impl FnOnce(&OrderContext) -> Result<(), Failure>,
) -> Result<(), Failure> {
    ask(verb, control_key(args), &args.request, |asked| {
        before(asked)?;
        Ok(vec![control_request(
            command,
            asked.issued,
            asked.deadline_ms,
        )])
    })
}

/// Sends a movement of one request before anything else is read or printed.
fn urgent(
    verb: Verb,
    request: MovementData,
    preempt: bool,
    args: &RequestArgs,
) -> Result<(), Failure> {
    ask_at_once(verb, MovementData::KEY, args, |asked| {
        complete(issued(request, asked.issued), preempt, asked.deadline_ms())
    })
}

/// Sends a movement of one request.
fn movement(
    verb: Verb,
    request: MovementData,
    preempt: bool,
    args: &RequestArgs,
) -> Result<(), Failure> {
    ask(verb, MovementData::KEY, args, |asked| {
        let request = issued(request, asked.issued);
        Ok(vec![complete(request, preempt, asked.deadline_ms)])
    })
}

/// The request, ordered at this moment.
fn issued(request: MovementData, at: MonotonicNs) -> MovementData {
    MovementData {
        issued_ns: at.0,
        ..request
    }
}
