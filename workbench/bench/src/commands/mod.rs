//! The commands: each measures, and makes one section of the report.

pub mod codec;
pub mod cost;
pub mod end_to_end;
pub mod hop;
pub mod record;
#[cfg(feature = "peers")]
pub mod relay;

use std::path::PathBuf;

use crate::measured::DEFAULT_ROUNDS;
use crate::report;

/// What every command takes.
#[derive(clap::Args, Clone, Debug)]
pub struct Common {
    /// Rounds; every case is measured once in each
    #[arg(long, default_value_t = DEFAULT_ROUNDS)]
    pub rounds: usize,

    /// Folder that the Markdown file and the plots are written to [default: docs of the repository]
    #[arg(long, value_name = "DIR", conflicts_with = "print_only")]
    out: Option<PathBuf>,

    /// Prints the tables and writes nothing
    #[arg(long)]
    print_only: bool,
}

impl Common {
    /// Where the results go, if anywhere.
    pub fn out(&self) -> Option<PathBuf> {
        let given = || self.out.clone().unwrap_or_else(report::default_folder);
        (!self.print_only).then(given)
    }
}
