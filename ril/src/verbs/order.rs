//! `ril start | stop | takeoff | land | hold | goto | fence reload`: makes the requests of one command.
//!
//! A conversation sends and follows them, and [`messages`](crate::render::messages) has the texts and exit codes.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand};
use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, MovementData, WaypointPosition};
use ipc_types::service::is_key;
use ipc_types::{MonotonicNs, Request, fresh_request_id};
use runtime::args::CommonArgs;
use runtime::exit::Failure;

use crate::config::Config;
use crate::options::{Height, RequestArgs, Target, read_text, take_off_height, targets, waypoints};
use crate::render::messages::Verb;
use crate::request::{Conversation, Format, Until, complete, control_request};
use crate::robot::position::ground_altitude_m;
use crate::session::{Session, configuration, refuse_to_guess};

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

    /// The same as an option
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

/// `ril goto`
#[derive(Args, Clone, Debug)]
pub struct GotoArgs {
    /// Waypoints, each LAT,LON,ALT or LAT LON ALT: degrees, and a telemetry altitude (20m, 60ft, or 20 for metres) or a height
    /// above take-off (+20m), such as -37.5,-6.25,20m
    #[arg(
        required_unless_present = "file",
        value_name = "LAT,LON,ALT",
        allow_negative_numbers = true
    )]
    pub words: Vec<String>,

    /// Read the waypoints from a file, one LAT,LON,ALT a line; `#` begins a comment, - is standard input
    #[arg(long, value_name = "FILE", conflicts_with = "words")]
    pub file: Option<PathBuf>,

    /// Replace a path that is under way instead of being refused as busy
    #[arg(long)]
    pub preempt: bool,

    /// Hover instead of flying on when this command ends before the path: by Ctrl+C, by SIGTERM, with its terminal, or when
    /// the reader of its output ends. SIGKILL leaves no time for that
    #[arg(long, conflicts_with = "no_wait")]
    pub hold_on_exit: bool,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

impl GotoArgs {
    /// The waypoints of the command line.
    ///
    /// # Errors
    ///
    /// Words that are no waypoints together, as a clause.
    pub fn targets(&self) -> Result<Vec<Target>, String> {
        targets(&self.words)
    }
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
            None => look(asked.session, common, asked.config),
            Some(_) => Ok(()),
        },
    )
}

/// `ril stop`
///
/// # Errors
///
/// As all requests: see [`messages::exit_code`](crate::render::messages::exit_code); code 2 when several robots are alive and none
/// was named, 3 when there is no bridge, 4 when it does not answer, 7 when a signal ends the command before the final
/// report.
pub fn stop(args: &ControlArgs) -> Result<(), Failure> {
    control(Verb::Stop, ControlCommand::Stop, args, |_| Ok(()))
}

/// `ril fence …`
///
/// # Errors
///
/// As [`stop`].
pub fn fence(command: &FenceCommand) -> Result<(), Failure> {
    match command {
        FenceCommand::Reload(args) => {
            let key = ModuleControl::KEY;
            run(Verb::ReloadFence, key, args, false, |asked| {
                Ok(vec![control_request(
                    ControlCommand::ReloadFence,
                    asked.deadline_ms,
                )])
            })
        }
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
    movement(Verb::Land, request, args.preempt, &args.request)
}

/// `ril hold`, which always replaces a path that is under way.
///
/// # Errors
///
/// As [`stop`].
pub fn hold(args: &RequestArgs) -> Result<(), Failure> {
    let request = MovementData::hold(fresh_request_id());
    movement(Verb::Hold, request, true, args)
}

/// `ril goto`
///
/// # Errors
///
/// As [`stop`]; code 2 also when the file of waypoints cannot be read or is wrong.
pub fn go_to(args: &GotoArgs) -> Result<(), Failure> {
    let targets = match &args.file {
        Some(file) => read_waypoints(file)?,
        None => args.targets().map_err(Failure::usage)?,
    };
    // The other commands make their request first of all: one that is stopped meanwhile does not renew its order.
    let issued_ns = MonotonicNs::now().0;
    run(
        Verb::GoTo,
        MovementData::KEY,
        &args.request,
        args.hold_on_exit,
        |asked| {
            let waypoints = absolute(&targets, asked)?;
            let path = MovementData::path(fresh_request_id(), &waypoints, fresh_request_id);
            Ok(path
                .map(|request| MovementData {
                    issued_ns,
                    ..request
                })
                .map(|request| complete(request, args.preempt, asked.deadline_ms))
                .collect())
        },
    )
}

/// The waypoints with telemetry altitudes. How high the ground of the take-off is, is asked once, and only if it matters.
fn absolute(targets: &[Target], asked: &Asked) -> Result<Vec<WaypointPosition>, Failure> {
    let is_relative = |target: &Target| matches!(target.altitude, Height::AboveTakeOff(_));
    let ground_m = match targets.iter().any(is_relative) {
        true => ground_altitude_m(asked.session, asked.timeout)?,
        false => 0.0,
    };
    let waypoint = |target: &Target| WaypointPosition {
        latitude_deg: target.latitude_deg,
        longitude_deg: target.longitude_deg,
        altitude_m: target.altitude.from(ground_m),
    };
    Ok(targets.iter().map(waypoint).collect())
}

/// Reads a file of waypoints; `-` is standard input.
fn read_waypoints(path: &Path) -> Result<Vec<Target>, Failure> {
    let text = read_text(path)?;
    waypoints(&text).map_err(|reason| Failure::usage(format!("{}: {reason}", path.display())))
}

/// A start or a stop of the bridge, or of the module that `args` name; `before` comes first.
fn control(
    verb: Verb,
    command: ControlCommand,
    args: &ControlArgs,
    before: impl FnOnce(&Asked) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let key = match &args.module {
        None => ModuleControl::KEY,
        // Once in the life of the process; the ports take keys that live as long as it.
        Some(module) => format!("{module}/control").leak(),
    };
    run(verb, key, &args.request, false, |asked| {
        before(asked)?;
        Ok(vec![control_request(command, asked.deadline_ms)])
    })
}

/// Sends a movement of one request.
fn movement(
    verb: Verb,
    request: MovementData,
    preempt: bool,
    args: &RequestArgs,
) -> Result<(), Failure> {
    run(verb, MovementData::KEY, args, false, |asked| {
        Ok(vec![complete(request, preempt, asked.deadline_ms)])
    })
}

/// What a command has when it makes its requests.
struct Asked<'a> {
    session: &'a Session,
    config: &'a Config,
    timeout: Duration,
    deadline_ms: u32,
}

/// Runs one command over the service `key`, with what `requests` makes.
fn run<R: Request>(
    verb: Verb,
    key: &'static str,
    args: &RequestArgs,
    hold_on_exit: bool,
    requests: impl FnOnce(&Asked) -> Result<Vec<R>, Failure>,
) -> Result<(), Failure> {
    let ask = &args.ask;
    let Some(config) = configuration(&ask.common)? else {
        return Ok(());
    };
    refuse_to_guess(&ask.common)?;
    let session = Session::join(&ask.common)?;
    let asked = Asked {
        session: &session,
        config: &config,
        timeout: ask.timeout.unwrap_or_else(|| config.request.timeout()),
        deadline_ms: ask.deadline.unwrap_or(config.request.deadline_ms),
    };
    let requests = requests(&asked)?;
    let until = match args.no_wait {
        true => Until::Accepted,
        false => Until::Final,
    };
    Conversation::open_at(&session, key, verb, asked.timeout)?
        .hold_on_exit(hold_on_exit)
        .follow(&requests, until, Format::of(ask.json))?;
    Ok(())
}
