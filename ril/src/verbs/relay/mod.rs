//! `ril relay`: starts the program `ril-relay` in its place, and shows how the links of a relay are.
//!
//! The relay is a program of its own, because its network library takes longer to build than all of the rest.

mod report;
#[cfg(test)]
mod tests;

use std::ffi::OsString;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process;

use clap::{ArgAction, Args, Subcommand};
use ipc_types::MonotonicNs;
use ipc_types::payload::{RelayLink, RelayStations};
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure};

use self::report::RelayReport;
use crate::options::SampleArgs;
use crate::render::print;
use crate::session::{Latest, Session, other_domains, others_alive};

/// `ril relay`
///
/// Everything but `status` goes to the program `ril-relay` as it is, `--help` too.
#[derive(Args, Clone, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    disable_help_flag = true,
    disable_help_subcommand = true
)]
pub struct RelayArgs {
    /// What to do beside relaying.
    #[command(subcommand)]
    pub command: Option<RelayCommand>,

    /// Arguments of `ril-relay`; its --help lists them
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "ARGS"
    )]
    pub args: Vec<OsString>,
}

/// `ril relay …`
#[derive(Clone, Debug, Subcommand)]
pub enum RelayCommand {
    /// Show the links of the relay that runs on this machine, its clock, losses and orders
    Status(RelayStatusArgs),
}

/// `ril relay status`
///
/// On a station's machine it shows the link to the robot, and the stations that the robot's relay knows; on a robot's machine these alone. It ends with exit code 0 when
/// the link is up, or at least one station is, and with 6 when not.
#[derive(Args, Clone, Debug)]
pub struct RelayStatusArgs {
    /// What every command takes that shows samples.
    #[command(flatten)]
    pub samples: SampleArgs,

    /// Print help
    // That of `ril relay` is off, because it is the program's own, and with it those of all verbs below.
    #[arg(short, long, action = ArgAction::Help)]
    help: Option<bool>,
}

/// The relay's program.
const PROGRAM: &str = "ril-relay";

/// `ril relay`
///
/// # Errors
///
/// Code 1 when the program cannot be started; of `ril relay status` those of [`status()`]. It does not return when the program
/// was started: this process is then the relay.
pub fn relay(args: &RelayArgs) -> Result<(), Failure> {
    match &args.command {
        Some(RelayCommand::Status(args)) => status(args),
        None => {
            let program = program_beside(std::env::current_exe().ok().as_deref());
            let error = process::Command::new(&program).args(&args.args).exec();
            Err(Failure::internal(not_started(&program, &error)))
        }
    }
}

/// The relay's program beside this one; without it a bare name, for which the operating system looks in PATH.
fn program_beside(this: Option<&Path>) -> PathBuf {
    let beside = this.map(|this| this.with_file_name(PROGRAM));
    beside
        .filter(|path| path.is_file())
        .unwrap_or_else(|| PROGRAM.into())
}

fn not_started(program: &Path, error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound {
        format!(
            "there is no `{PROGRAM}`, neither beside `ril` nor in PATH: it is a program of its own, `cargo install --path gateways/relay` \
             builds and installs it"
        )
    } else {
        format!("{} cannot be started: {error}", program.display())
    }
}

/// `ril relay status`
///
/// # Errors
///
/// Code 3 when there is no relay, 4 when it publishes nothing, 6 when the link to the robot is not up, or on a robot's machine
/// no station is.
pub fn status(args: &RelayStatusArgs) -> Result<(), Failure> {
    let (session, timeout) = Session::for_samples(&args.samples)?;
    let mut topics = open(&session)?;
    let give_up = MonotonicNs::now() + timeout;
    let is_complete = |(link, stations): &mut Provided, _| {
        Ok(link.as_ref().is_none_or(|link| link.sample.is_some())
            && stations.as_ref().is_none_or(|one| one.sample.is_some()))
    };
    if !session.gather(&mut topics, give_up, is_complete)? && session.termination.requested() {
        return Ok(());
    }
    let link = topics.0.as_ref().and_then(|link| link.sample.as_ref());
    let stations = topics.1.as_ref().and_then(|one| one.sample.as_ref());
    if link.is_none() && stations.is_none() {
        let text = format!(
            "nothing came from the relay of robot {} in {}, although it is running",
            session.ipc.robot(),
            DurationText(timeout)
        );
        return Err(Failure::new(ExitCode::Timeout, text).with_next_step(
            "`ril doctor` shows whether it is stopped; is the machine overloaded?",
        ));
    }
    let report = RelayReport::new(session.ipc.robot(), link, stations, MonotonicNs::now());
    print(&report, args.samples.json)?;
    match report.trouble() {
        None => Ok(()),
        Some((text, next_step)) => {
            Err(Failure::new(report.exit_code(), text).with_next_step(next_step))
        }
    }
}

/// The topics that the relay here provides.
type Provided = (Option<Latest<RelayLink>>, Option<Latest<RelayStations>>);

fn open(session: &Session) -> Result<Provided, Failure> {
    let topics: Provided = (
        Latest::open_if_provided(session)?,
        Latest::open_if_provided(session)?,
    );
    if topics.0.is_none() && topics.1.is_none() {
        let robot = session.ipc.robot();
        let text = format!(
            "no relay of robot {robot} is running here{}{}",
            others_alive(robot),
            other_domains()
        );
        return Err(Failure::new(ExitCode::ServiceAbsent, text).with_next_step(
            "start `ril relay station` here, or `ril relay robot` beside the robot, and try again",
        ));
    }
    Ok(topics)
}
