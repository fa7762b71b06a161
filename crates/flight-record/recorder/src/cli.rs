//! The arguments of `ril record`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use operator::options::{EXIT_CODES, duration};
use runtime::args::CommonArgs;

/// Longest file, MiB: one more would not fit onto memory cards' file systems.
const MAX_FILE_MIB: u64 = 4095;

/// Most for all files, MiB: a TiB.
const MAX_TOTAL_MIB: u64 = 1 << 20;

const MIB: u64 = 1 << 20;

/// What a recording is, for the end of the help.
const NOTES: &str = "\
It records every topic of the robot, those of modules included, until Ctrl+C or
SIGTERM, which end the file whole. It may be started before all other processes.
Files are in the format MCAP: `ril log check FILE` says whether one is complete.
The exit code is 0 when every message that came is in a file, and 8 when the disk
did not take all of them.";

/// `ril record`
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{NOTES}\n\n{EXIT_CODES}"))]
pub struct RecordArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Folder of the files; created if it is not there
    #[arg(long, value_name = "FOLDER", default_value = "log")]
    pub output: PathBuf,

    /// Begin another file after each landing, when the helicopter has stood on the ground for 5 s
    #[arg(long)]
    pub flights: bool,

    /// Begin another file after this time, such as 10m
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub split: Option<Duration>,

    /// End after this time, such as 1h
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub duration: Option<Duration>,

    /// Begin another file when one has so many MiB
    #[arg(long, value_name = "MIB", default_value = "2048",
        value_parser = clap::value_parser!(u64).range(1..=MAX_FILE_MIB))]
    pub size: u64,

    /// Most MiB for all recordings of this robot in the folder, at least twice --size: the oldest are removed, but
    /// never the one before the present one
    #[arg(long, value_name = "MIB", default_value = "16384",
        value_parser = clap::value_parser!(u64).range(2..=MAX_TOTAL_MIB))]
    pub max_total: u64,

    /// MiB of the disk that are left to other programs: if less is free, nothing is written
    #[arg(long, value_name = "MIB", default_value = "256",
        value_parser = clap::value_parser!(u64).range(0..=MAX_TOTAL_MIB))]
    pub min_free: u64,

    /// Configuration of the bridge, which is recorded too [default: bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Configuration of status, which is recorded too [default: status.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub status: Option<PathBuf>,

    /// Print an object when a file is complete, and one at the end, each on a line
    #[arg(long)]
    pub json: bool,
}

impl RecordArgs {
    /// Longest file, bytes.
    pub fn max_file_bytes(&self) -> u64 {
        self.size * MIB
    }

    /// Most for all files, bytes.
    ///
    /// # Errors
    ///
    /// When that is less than two files' worth: removing the oldest could then not make room for the next.
    pub fn max_total_bytes(&self) -> Result<u64, String> {
        match self.max_total >= 2 * self.size {
            true => Ok(self.max_total * MIB),
            false => Err(format!(
                "--max-total {} is less than twice --size {}: a file and its successor must have room",
                self.max_total, self.size
            )),
        }
    }

    /// Room that is left to other programs, bytes.
    pub fn min_free_bytes(&self) -> u64 {
        self.min_free * MIB
    }
}
