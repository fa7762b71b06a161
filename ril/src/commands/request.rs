//! `ril start | stop | takeoff | land | hold | goto | fence reload`: makes the requests of one command.
//!
//! A conversation sends and follows them, and [`messages`](crate::messages) has the texts and exit codes.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::time::Duration;

use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, MovementData, WaypointPosition};
use ipc_types::{MonotonicNs, Request, fresh_request_id};
use runtime::exit::Failure;

use super::conversation::{Conversation, Format};
use super::exchange::Until;
use super::position::ground_altitude_m;
use super::robot::refuse_to_guess;
use super::{Session, configuration};
use crate::cli::{
    self, ControlArgs, FenceCommand, GotoArgs, Height, LandArgs, RequestArgs, RobotChoice,
    TakeoffArgs, Target,
};
use crate::messages::Verb;
use crate::verbs::check::preflight;

/// Longest file of waypoints: more than twenty times the bytes of the longest path that the bridge takes.
const MAX_FILE_BYTES: u64 = 1024 * 1024;

/// `ril start`; standard error says before what [`preflight`] finds, which never keeps the module from starting.
///
/// # Errors
///
/// As all requests: see [`messages::exit_code`](crate::messages::exit_code); code 2 when several robots are alive and none
/// was named, 3 when there is no bridge, 4 when it does not answer, 7 when a signal ends the command before the final
/// report.
pub fn start(args: &ControlArgs, choice: RobotChoice) -> Result<(), Failure> {
    control_of(Verb::Start, ControlCommand::Start, args, choice)
}

/// `ril stop`
///
/// # Errors
///
/// As [`start`].
pub fn stop(args: &ControlArgs, choice: RobotChoice) -> Result<(), Failure> {
    control_of(Verb::Stop, ControlCommand::Stop, args, choice)
}

/// `ril fence …`
///
/// # Errors
///
/// As [`start`].
pub fn fence(command: &FenceCommand, choice: RobotChoice) -> Result<(), Failure> {
    match command {
        FenceCommand::Reload(args) => control(
            Verb::ReloadFence,
            ControlCommand::ReloadFence,
            ModuleControl::KEY,
            args,
            choice,
        ),
    }
}

/// `ril takeoff`
///
/// # Errors
///
/// As [`start`].
pub fn take_off(args: &TakeoffArgs, choice: RobotChoice) -> Result<(), Failure> {
    let request = MovementData::take_off(fresh_request_id(), args.height_m());
    movement(Verb::TakeOff, request, false, &args.request, choice)
}

/// `ril land`
///
/// # Errors
///
/// As [`start`].
pub fn land(args: &LandArgs, choice: RobotChoice) -> Result<(), Failure> {
    let request = MovementData::land(fresh_request_id());
    movement(Verb::Land, request, args.preempt, &args.request, choice)
}

/// `ril hold`, which always replaces a path that is under way.
///
/// # Errors
///
/// As [`start`].
pub fn hold(args: &RequestArgs, choice: RobotChoice) -> Result<(), Failure> {
    let request = MovementData::hold(fresh_request_id());
    movement(Verb::Hold, request, true, args, choice)
}

/// `ril goto`
///
/// # Errors
///
/// As [`start`]; code 2 also when the file of waypoints cannot be read or is wrong.
pub fn go_to(args: &GotoArgs, choice: RobotChoice) -> Result<(), Failure> {
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
        choice,
        |session, timeout, deadline_ms| {
            let waypoints = absolute(&targets, session, timeout)?;
            let path = MovementData::path(fresh_request_id(), &waypoints, fresh_request_id);
            Ok(path
                .map(|request| MovementData {
                    issued_ns,
                    ..request
                })
                .map(|request| complete(request, args.preempt, deadline_ms))
                .collect())
        },
    )
}

/// The waypoints with telemetry altitudes. How high the ground of the take-off is, is asked once, and only if it matters.
fn absolute(
    targets: &[Target],
    session: &Session,
    timeout: Duration,
) -> Result<Vec<WaypointPosition>, Failure> {
    let is_relative = |target: &Target| matches!(target.altitude, Height::AboveTakeOff(_));
    let ground_m = match targets.iter().any(is_relative) {
        true => ground_altitude_m(session, timeout)?,
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
    let name = path.display();
    let mut text = String::new();
    // One byte more than allowed tells a file that is too long.
    let read = match path == Path::new("-") {
        true => io::stdin()
            .lock()
            .take(MAX_FILE_BYTES + 1)
            .read_to_string(&mut text),
        false => File::open(path)
            .and_then(|file| file.take(MAX_FILE_BYTES + 1).read_to_string(&mut text)),
    };
    match read {
        Err(error) => Err(Failure::usage(format!("{name}: cannot be read: {error}"))),
        Ok(_) if text.len() as u64 > MAX_FILE_BYTES => Err(Failure::usage(format!(
            "{name}: longer than {MAX_FILE_BYTES} bytes, which no path needs"
        ))),
        Ok(_) => {
            cli::waypoints(&text).map_err(|reason| Failure::usage(format!("{name}: {reason}")))
        }
    }
}

/// A start or a stop of the bridge, or of the module that `args` name.
fn control_of(
    verb: Verb,
    command: ControlCommand,
    args: &ControlArgs,
    choice: RobotChoice,
) -> Result<(), Failure> {
    let key = match &args.module {
        None => ModuleControl::KEY,
        // Once in the life of the process; the ports take keys that live as long as it.
        Some(module) => format!("{module}/control").leak(),
    };
    control(verb, command, key, &args.request, choice)
}

fn control(
    verb: Verb,
    command: ControlCommand,
    key: &'static str,
    args: &RequestArgs,
    choice: RobotChoice,
) -> Result<(), Failure> {
    run(verb, key, args, false, choice, |_, _, deadline_ms| {
        Ok(vec![control_request(command, deadline_ms)])
    })
}

/// A start, a stop or a reload, to be begun within `deadline_ms` of now.
pub(crate) fn control_request(command: ControlCommand, deadline_ms: u32) -> ModuleControl {
    let control = ModuleControl::new(fresh_request_id(), command);
    ModuleControl {
        begin_by_ns: begin_by_ns(control.issued_ns, deadline_ms),
        ..control
    }
}

/// Until when an order may begin that was issued at `issued_ns`; 0 leaves it to the bridge, as a deadline of 0 does.
pub(super) fn begin_by_ns(issued_ns: u64, deadline_ms: u32) -> u64 {
    match deadline_ms {
        0 => 0,
        ms => (MonotonicNs(issued_ns) + Duration::from_millis(ms.into())).0,
    }
}

/// `request` to be begun within `deadline_ms` of its issue; says also whether it replaces a path that is under way.
pub(crate) fn complete(request: MovementData, preempt: bool, deadline_ms: u32) -> MovementData {
    MovementData {
        begin_by_ns: begin_by_ns(request.issued_ns, deadline_ms),
        preempt: u16::from(preempt),
        ..request
    }
}

/// Sends a movement of one request.
fn movement(
    verb: Verb,
    request: MovementData,
    preempt: bool,
    args: &RequestArgs,
    choice: RobotChoice,
) -> Result<(), Failure> {
    run(
        verb,
        MovementData::KEY,
        args,
        false,
        choice,
        |_, _, deadline_ms| Ok(vec![complete(request, preempt, deadline_ms)]),
    )
}

/// Runs one command over the service `key`; `requests` gives its requests once the timeout and the deadline, ms, are known.
fn run<R: Request>(
    verb: Verb,
    key: &'static str,
    args: &RequestArgs,
    hold_on_exit: bool,
    choice: RobotChoice,
    requests: impl FnOnce(&Session, Duration, u32) -> Result<Vec<R>, Failure>,
) -> Result<(), Failure> {
    let ask = &args.ask;
    let Some(config) = configuration(&ask.common)? else {
        return Ok(());
    };
    refuse_to_guess(choice)?;
    let session = Session::join(&ask.common)?;
    if key == ModuleControl::KEY && verb == Verb::Start {
        preflight::warn(&session, &ask.common, &config)?;
    }
    let timeout = ask.timeout.unwrap_or_else(|| config.request.timeout());
    let deadline_ms = ask.deadline.unwrap_or(config.request.deadline_ms);
    let requests = requests(&session, timeout, deadline_ms)?;
    let until = match args.no_wait {
        true => Until::Accepted,
        false => Until::Final,
    };
    Conversation::open_at(&session, key, verb, timeout)?
        .hold_on_exit(hold_on_exit)
        .hold(&requests, until, Format::of(ask.json))?;
    Ok(())
}
