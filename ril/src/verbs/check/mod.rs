//! `ril doctor` and `ril preflight`: what is wrong with a machine, whether a robot is ready to take off, and what to do.
//!
//! [`gather`] looks up [`facts`]; what they mean is pure: [`diagnosis`] judges the machine for the doctor, with [`domain`], [`services`],
//! [`serial`] and [`relay_link`]; for the preflight `robot`, `helicopter` and `machine` judge the rest. All of them give
//! [findings](crate::finding).

pub mod diagnosis;
pub mod doctor;
mod domain;
pub mod facts;
pub(crate) mod gather;
mod helicopter;
pub mod limits;
mod machine;
pub mod preflight;
mod relay_link;
mod robot;
mod serial;
mod services;
#[cfg(test)]
mod tests;

use std::io::IsTerminal;
use std::os::fd::AsFd;
use std::path::PathBuf;

use clap::Args;
use runtime::args::CommonArgs;

use crate::live::Size;

/// Width of the name of a check or a subject, and the space behind it.
const HEADING: usize = 16;

/// What both verbs look at.
#[derive(Args, Clone, Debug)]
pub struct MachineArgs {
    /// What every process takes; the configuration is that of the operator's commands.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Configuration of the bridge [default: bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Configuration of status [default: status.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub status: Option<PathBuf>,

    /// Serial port, instead of `serial.port` of the bridge's configuration
    #[arg(long, value_name = "PATH", env = "RIL_PORT")]
    pub port: Option<PathBuf>,
}

/// How wide text on `out` may be: a file has no width.
fn width(out: &(impl AsFd + IsTerminal)) -> usize {
    match out.is_terminal() {
        true => Size::of(out).columns,
        false => usize::MAX,
    }
}
