//! What is to be measured ([`Plan`]), and of which kind of process ([`Kind`]).

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::RangedU64ValueParser;
use clap::{Parser, ValueEnum};
use ril_tests::languages::{Compiler, python, skip};

/// How the robots of a fleet and its station connect: with each other, or with a router.
pub const TOPOLOGIES: [&str; 2] = ["peers", "router"];

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
    /// A consumer of telemetry in SI units, in C
    CConsumer,
    /// A consumer of telemetry in SI units, in Python
    PythonConsumer,
}

impl Kind {
    /// The kinds that need nothing but `ril`.
    pub const OF_RIL: [Kind; 4] = [Kind::Sim, Kind::Bridge, Kind::Status, Kind::Consumer];

    /// The name of the kind in the tables.
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

    /// The kinds that this machine can start; what it lacks for the others is printed. The first call may build a
    /// library,
    /// which can take minutes: call it before a site begins to watch the time.
    pub fn possible() -> Vec<Kind> {
        let all = Kind::value_variants().iter().copied();
        all.filter(|kind| kind.is_possible()).collect()
    }

    /// Whether this machine has what the process needs.
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

/// What to do, as it is read from a command line; the tests write theirs in the same words.
#[derive(Parser, Clone, Debug)]
pub struct Plan {
    /// Which process is killed [default: each, one after the other]
    #[arg(long, value_enum)]
    pub victim: Option<Kind>,
    /// How often, or how many; each measurement has a number of its own. Port no more than 256
    #[arg(long)]
    pub count: Option<u32>,
    /// How long subscribers disturb (120 s), processes crash (600 s), viewers and stations look (60 s) or a fleet flies
    /// (15 s)
    #[arg(long)]
    pub duration_s: Option<u64>,
    /// How many processes start, and crash, a second
    #[arg(long, default_value = "50", value_parser = at_least_one())]
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
    /// Relays: packets that are lost, percent [default: mission 10, requests and connect 20, outages and narrow 0]
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=90))]
    pub loss: Option<u8>,
    /// Relays: how long an outage lasts, s
    #[arg(long, default_value = "10")]
    pub outage_s: u64,
    /// Relays: protocol between them: tcp, udp, tls or quic, with certificates that are made for it [default: tcp;
    /// narrow, roam and connect take tcp and quic]
    #[arg(long)]
    pub over: Option<String>,
    /// Narrow: a link of this rate alone, kbit/s
    #[arg(long, value_parser = clap::value_parser!(u32).range(8..=100_000))]
    pub kbit_per_s: Option<u32>,
    /// Narrow with a rate, and connect: round trip of the link, ms [default: narrow 200, connect 600]
    #[arg(long, value_parser = clap::value_parser!(u32).range(..=10_000))]
    pub round_trip_ms: Option<u32>,
    /// Fleet: how many robots, one row for each number and topology
    #[arg(long, value_delimiter = ',', default_values_t = [1, 5, 10, 20, 50, 100],
          value_parser = clap::value_parser!(u32).range(1..=400))]
    pub robots: Vec<u32>,
    /// Fleet: how many of the robots are whole; the others are played by this program
    #[arg(long, default_value = "3")]
    pub whole: u32,
    /// Fleet: samples of each kind of telemetry a second, of each robot
    #[arg(long, default_value = "10", value_parser = clap::value_parser!(u32).range(1..=50))]
    pub rate_hz: u32,
    /// Fleet: how many stations have all robots. The first one is observed and orders; the others watch
    #[arg(long, default_value = "1", value_parser = clap::value_parser!(u32).range(1..=8))]
    pub stations: u32,
    /// Fleet: robots of one relay of a station, which starts as many relays as it takes
    #[arg(long, default_value = "32", value_parser = at_least_one())]
    pub per_relay: u32,
    /// Fleet: how robots and station connect [default: both, one after the other]
    #[arg(long, value_parser = TOPOLOGIES)]
    pub through: Option<String>,
    /// The short form, which the tests are: it runs where a machine may stall, and judges no times and nothing that
    /// takes minutes to show
    #[arg(skip)]
    pub is_short: bool,
    /// Whether a measurement is to end early, with what there is; `None` if it never is
    #[arg(skip)]
    pub is_over: Option<fn() -> bool>,
}

fn at_least_one() -> RangedU64ValueParser<u32> {
    RangedU64ValueParser::new().range(1..)
}

/// The whole path of a program that is there: it is started from another folder, after minutes.
fn program_there(path: &str) -> Result<PathBuf, String> {
    fs::canonicalize(path).map_err(|error| format!("{error}; build it first"))
}

impl Plan {
    /// The short form with these options, for the tests.
    pub fn short(options: &str) -> Plan {
        let words = "short --per-second 20 --period-ms 20 --speed 4 --seed 7".split(' ');
        Plan {
            is_short: true,
            ..Plan::parse_from(words.chain(options.split_whitespace()))
        }
    }

    /// How long it lasts.
    pub fn duration(&self, usual_s: u64) -> Duration {
        Duration::from_secs(self.duration_s.unwrap_or(usual_s))
    }

    /// How often, or how many.
    pub fn count(&self, usual: u32) -> u32 {
        self.count.unwrap_or(usual)
    }

    /// What the short form takes, or the long one.
    pub fn either<T>(&self, short: T, long: T) -> T {
        if self.is_short { short } else { long }
    }

    /// Share of the packets that is lost, 0 … 1.
    pub fn loss(&self, usual_percent: u8) -> f64 {
        f64::from(self.loss.unwrap_or(usual_percent)) / 100.0
    }

    /// One way of the link.
    pub fn one_way(&self, usual_round_trip_ms: u32) -> Duration {
        let round_trip_ms = self.round_trip_ms.unwrap_or(usual_round_trip_ms);
        Duration::from_millis(round_trip_ms.into()) / 2
    }

    /// The protocols that are measured, one after the other.
    pub fn protocols<'a>(&'a self, usual: &[&'a str]) -> Vec<&'a str> {
        match &self.over {
            Some(protocol) => vec![protocol],
            None => usual.to_vec(),
        }
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
