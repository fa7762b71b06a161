//! `ril doctor` and `ril preflight`: what is wrong with a machine, whether a robot is ready to take off, and what to
//! do.
//!
//! `gather` looks up [`facts`]; what they mean is pure: [`diagnosis`] judges the machine for the doctor, with `domain`,
//! `services`, `serial`, `realtime` and `gateways`; for the preflight `robot`, `helicopter` and `machine` judge the
//! rest. All of them give [findings](runtime::finding).

pub mod diagnosis;
pub mod doctor;
mod domain;
pub mod facts;
mod gateways;
pub(crate) mod gather;
mod helicopter;
mod machine;
pub mod preflight;
mod realtime;
mod robot;
mod serial;
mod services;

#[cfg(test)]
mod tests;

use std::io::IsTerminal;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use operator::options::{EXIT_CODES, duration};
use operator::render::terminal::Size;
use runtime::args::CommonArgs;

/// Width of the name of a check or a subject, and the space behind it.
const HEADING: usize = 16;

/// How wide text on `out` may be: a file has no width.
fn width(out: &(impl AsFd + IsTerminal)) -> usize {
    match out.is_terminal() {
        true => Size::of(out).columns,
        false => usize::MAX,
    }
}

/// What the checks are judged by, for the end of the help.
const NOTES: &str = "\
It changes nothing. `[preflight]` of ril.toml has the limits. The exit code is 0
when no check failed, and 8 when one did.";

/// What both verbs look at.
#[derive(Args, Clone, Debug)]
pub struct MachineArgs {
    /// What every process takes; the configuration is that of the operator's commands.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Configuration of the bridge [default: that of the live bridge; without one bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Configuration of status [default: the file of the live status; without one status.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub status: Option<PathBuf>,

    /// Serial port, instead of `serial.port` of the bridge's configuration
    #[arg(long, value_name = "PATH", env = "RIL_PORT")]
    pub port: Option<PathBuf>,
}

/// `ril doctor`
///
/// Without --repair nothing is changed, and nothing is joined but the topic of a relay's link and the journal of the
/// bridge, which says its configuration. The serial port is not opened in any case.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct DoctorArgs {
    /// What is looked at.
    #[command(flatten)]
    pub machine: MachineArgs,

    /// Configuration of the simulator [default: dsp-sim.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub sim: Option<PathBuf>,

    /// Configuration of the view [default: view.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub view: Option<PathBuf>,

    /// Configuration of the gateway to MAVLink [default: mavlink.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub mavlink: Option<PathBuf>,

    /// Remove what dead processes left, then examine
    #[arg(long)]
    pub repair: bool,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril preflight`
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{NOTES}\n\n{EXIT_CODES}"))]
pub struct PreflightArgs {
    /// What is looked at.
    #[command(flatten)]
    pub machine: MachineArgs,

    /// End with exit code 8 also when there are only warnings
    #[arg(long)]
    pub strict: bool,

    /// How long to wait for samples, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}
