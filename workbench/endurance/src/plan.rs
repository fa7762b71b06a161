//! What is to be measured ([`Plan`]), and of which kind of process ([`Kind`]).

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use ril_tests::languages::{Compiler, python, skip};

/// A process that can be killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// The simulator, with the serial port
    Sim,
    /// The bridge
    Bridge,
    /// Status
    Status,
    /// A consumer of telemetry in SI units, which prints it
    Consumer,
    /// The same in C
    CConsumer,
    /// The same in Python
    PythonConsumer,
}

impl Kind {
    /// All, in the order of the data.
    pub const ALL: [Kind; 6] = [
        Kind::Sim,
        Kind::Bridge,
        Kind::Status,
        Kind::Consumer,
        Kind::CConsumer,
        Kind::PythonConsumer,
    ];

    /// Those that need nothing but `ril`.
    pub const OF_RIL: [Kind; 4] = [Kind::Sim, Kind::Bridge, Kind::Status, Kind::Consumer];

    /// As it is named in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Sim => "sim",
            Kind::Bridge => "bridge",
            Kind::Status => "status",
            Kind::Consumer => "consumer",
            Kind::CConsumer => "c-consumer",
            Kind::PythonConsumer => "python-consumer",
        }
    }

    /// Whether other processes need nothing of it.
    pub fn is_consumer(self) -> bool {
        !matches!(self, Kind::Sim | Kind::Bridge | Kind::Status)
    }

    /// Whether this machine has what the process needs. What it has not is printed. The first call may build a library, which can take
    /// minutes: call it before a site begins to watch the time.
    pub fn is_possible(self) -> bool {
        let lack = match self {
            Kind::CConsumer => Compiler::c().err(),
            Kind::PythonConsumer => python().err().map(str::to_owned),
            _ => None,
        };
        if let Some(why) = &lack {
            skip(self.name(), why);
        }
        lack.is_none()
    }
}

/// What to do. The program reads it from its command line, the tests fill it in.
#[derive(Args, Clone, Debug)]
pub struct Plan {
    /// Which process is killed [default: each, one after the other]
    #[arg(long, value_enum)]
    pub victim: Option<Kind>,
    /// How often, or how many; each measurement has a number of its own. Port no more than 256
    #[arg(long)]
    pub count: Option<u32>,
    /// How long subscribers disturb (120 s), or processes crash (600 s)
    #[arg(long)]
    pub duration_s: Option<u64>,
    /// How many processes start, and crash, a second
    #[arg(long, default_value = "50", value_parser = clap::value_parser!(u32).range(1..))]
    pub per_second: u32,
    /// Period of telemetry [default: gap 20 ms, subscribers 2 ms]
    #[arg(long)]
    pub period_ms: Option<u16>,
    /// Simulated seconds for one of the host: records
    #[arg(long, default_value = "1", value_parser = clap::value_parser!(u32).range(1..=10))]
    pub speed: u32,
    /// Where the files of `records` go, to be opened with other programs; it must be there
    #[arg(long)]
    pub keep: Option<PathBuf>,
    /// A built `workbench/foxglove-peer`, which `views` measures with the same clients as the view
    #[arg(long, value_name = "PROGRAM", value_parser = program_there)]
    pub beside: Option<PathBuf>,
    /// Seed of all moments
    #[arg(long, default_value = "1")]
    pub seed: u64,
    /// The short form, which the tests are: it runs where a machine may stall, and judges no times and nothing that takes minutes to
    /// show
    #[arg(skip)]
    pub is_short: bool,
}

/// The whole path of a program that is there: it is started from another folder, after minutes.
fn program_there(path: &str) -> Result<PathBuf, String> {
    fs::canonicalize(path).map_err(|error| format!("{error}; build it first"))
}

impl Plan {
    /// The short form, `count` times: for the tests.
    pub fn short(count: u32) -> Plan {
        Plan {
            victim: None,
            count: Some(count),
            duration_s: None,
            per_second: 20,
            period_ms: Some(20),
            speed: 4,
            keep: None,
            beside: None,
            seed: 7,
            is_short: true,
        }
    }

    /// How long it lasts.
    pub fn duration(&self, usual_s: u64) -> Duration {
        Duration::from_secs(self.duration_s.unwrap_or(usual_s))
    }
}

#[cfg(test)]
mod tests {
    use super::program_there;

    #[test]
    fn a_program_is_found_from_another_folder_and_a_missing_one_is_told_at_the_start() {
        let found = program_there("src/main.rs").expect("it is there");
        assert!(found.is_absolute() && found.ends_with("src/main.rs"));
        let error = program_there("target/no-such-program").expect_err("nobody made it");
        assert!(error.ends_with("; build it first"), "{error}");
    }
}
