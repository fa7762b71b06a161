//! The processes that are measured: this program, started again in one of these roles.
//!
//! A child prints `ready` when it can be measured, and whoever measures prints `result` and JSON at the end. A role that
//! has no end of its own ends at SIGTERM.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result};
use clap::Subcommand;
use ipc_types::MonotonicNs;
use runtime::signal::Termination;
use rustix::process::{Signal, set_parent_process_death_signal};
use serde::Serialize;

use crate::consumer::{self, Service};
use crate::dsp::{Dsp, Rate};
use crate::latency::Recorder;
use crate::pace::Pace;
use crate::peers::Peer;
#[cfg(feature = "relay")]
use crate::plain_zenoh;
#[cfg(feature = "relay")]
use crate::relayed;
use crate::requests;
use crate::stream::telemetry;

/// What a child prints when it can be measured.
pub const READY: &str = "ready";
/// What the line of the result begins with.
pub const RESULT: &str = "result ";
/// What the line of the serial port begins with.
pub const PORT: &str = "port ";
/// What a child prints now and then that is quiet for long.
pub const ALIVE: &str = "alive";

/// How often a child says that it is alive: several times within the longest wait for a line.
const ALIVE_PERIOD: Duration = Duration::from_secs(30);

/// Which role.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    role: Role,
}

/// What a child does.
#[derive(Subcommand)]
enum Role {
    /// Sends samples over a peer until it is ended
    HopSend {
        peer: Peer,
        site: PathBuf,
        rate_hz: u32,
    },
    /// Receives samples over a peer
    HopReceive {
        peer: Peer,
        site: PathBuf,
        samples: usize,
    },
    /// Is the DSP until it is ended
    Dsp {
        #[arg(value_parser = rate)]
        rate: Rate,
    },
    /// Reads frames from a terminal
    ReadRaw { port: PathBuf, samples: usize },
    /// Reads telemetry
    Consume { service: Service, samples: usize },
    /// Reads the telemetry of status until it is ended
    Watch,
    /// Reads telemetry for a time and counts
    KeepUp { seconds: f64 },
    /// Orders landings
    Land { count: usize, rate_hz: u32 },
    /// Answers requests over iceoryx2 alone
    ServeRaw,
    /// Sends requests over iceoryx2 alone
    AskRaw { count: usize, rate_hz: u32 },
    /// Is robots, one in each domain, until it is ended
    #[cfg(feature = "relay")]
    Robots { rate_hz: u32, roots: Vec<PathBuf> },
    /// Reads the telemetry of robots
    #[cfg(feature = "relay")]
    ConsumeRobots { robots: u32, samples: usize },
    /// Is a robot over plain Zenoh until it is ended
    #[cfg(feature = "relay")]
    ZenohRobot { endpoint: String, rate_hz: u32 },
    /// Reads its telemetry
    #[cfg(feature = "relay")]
    ConsumeZenoh { endpoint: String, samples: usize },
    /// The relay
    #[cfg(feature = "relay")]
    Relay {
        #[command(subcommand)]
        command: relay::cli::Command,
    },
    /// The bridge
    Bridge(bridge::cli::Args),
    /// Status
    Status(status::cli::Args),
    /// The operator's tool
    Ril {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        args: Vec<OsString>,
    },
}

/// Reads a rate as it stands on a command line.
fn rate(text: &str) -> Result<Rate, std::num::ParseIntError> {
    match text {
        "silent" => Ok(Rate::Silent),
        "flood" => Ok(Rate::Flood),
        hz => hz.parse().map(Rate::Hz),
    }
}

/// Plays the role.
pub fn run(args: Args) -> ExitCode {
    // A measurement that is killed leaves nothing behind that would disturb the next.
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
    match args.role {
        Role::Bridge(args) => runtime::exit::main_with(|| bridge::cli::run(args)),
        Role::Status(args) => runtime::exit::main_with(|| status::cli::run(args)),
        Role::Ril { args } => ril::main(std::iter::once("ril".into()).chain(args)),
        #[cfg(feature = "relay")]
        Role::Relay { command } => runtime::exit::main_with(|| relay::cli::run(command)),
        role => match play(role) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("{error:?}");
                ExitCode::FAILURE
            }
        },
    }
}

fn play(role: Role) -> Result<()> {
    match role {
        Role::HopSend {
            peer,
            site,
            rate_hz,
        } => hop_send(peer, &site, rate_hz),
        Role::HopReceive {
            peer,
            site,
            samples,
        } => hop_receive(peer, &site, samples),
        Role::Dsp { rate } => be_dsp(rate),
        Role::ReadRaw { port, samples } => {
            tell_result(&consumer::read_raw(&port, samples, tell_ready)?)
        }
        Role::Consume { service, samples } => {
            tell_result(&consumer::consume(service, samples, tell_ready)?)
        }
        Role::Watch => {
            let termination = Termination::install()?;
            tell_result(&consumer::watch(&termination, tell_ready)?)
        }
        Role::KeepUp { seconds } => {
            tell_alive();
            let duration = Duration::from_secs_f64(seconds);
            tell_result(&consumer::keep_up(duration, tell_ready)?)
        }
        Role::Land { count, rate_hz } => tell_result(&requests::land(count, rate_hz, tell_ready)?),
        Role::ServeRaw => requests::serve_raw(&Termination::install()?, tell_ready),
        Role::AskRaw { count, rate_hz } => {
            tell_result(&requests::ask_raw(count, rate_hz, tell_ready)?)
        }
        #[cfg(feature = "relay")]
        Role::Robots { rate_hz, roots } => relayed::be_robots(rate_hz, &roots, tell_ready),
        #[cfg(feature = "relay")]
        Role::ConsumeRobots { robots, samples } => {
            tell_alive();
            tell_result(&relayed::consume(robots, samples, tell_ready)?)
        }
        #[cfg(feature = "relay")]
        Role::ZenohRobot { endpoint, rate_hz } => {
            plain_zenoh::publish(&endpoint, rate_hz, tell_ready)
        }
        #[cfg(feature = "relay")]
        Role::ConsumeZenoh { endpoint, samples } => {
            tell_result(&plain_zenoh::consume(&endpoint, samples, tell_ready)?)
        }
        // They have exit codes of their own.
        Role::Bridge(_) | Role::Status(_) | Role::Ril { .. } => Ok(()),
        #[cfg(feature = "relay")]
        Role::Relay { .. } => Ok(()),
    }
}

fn tell(line: &str) -> Result<()> {
    println!("{line}");
    std::io::stdout().flush().context("standard output")
}

fn tell_ready() -> Result<()> {
    tell(READY)
}

fn tell_result(result: &impl Serialize) -> Result<()> {
    tell(&format!("{RESULT}{}", serde_json::to_string(result)?))
}

/// Tells on a thread of its own, so that what is measured is not disturbed.
fn tell_alive() {
    std::thread::spawn(|| {
        loop {
            std::thread::sleep(ALIVE_PERIOD);
            // Nobody listens any more when this fails, and nobody waits then.
            let _ = tell(ALIVE);
        }
    });
}

fn hop_send(peer: Peer, site: &Path, rate_hz: u32) -> Result<()> {
    let termination = Termination::install()?;
    let mut sender = peer.sender(site)?;
    let mut sample = telemetry();
    let mut pace = Pace::new(rate_hz);
    tell_ready()?;
    while !termination.requested() {
        pace.wait()?;
        sample.source_sequence += 1;
        sample.published_ns = MonotonicNs::now().0;
        sender.send(&sample)?;
    }
    Ok(())
}

fn hop_receive(peer: Peer, site: &Path, samples: usize) -> Result<()> {
    let mut receiver = peer.receiver(site)?;
    let mut recorder = Recorder::new(samples);
    tell_ready()?;
    while !recorder.is_complete() {
        receiver.receive(&mut |mark| recorder.take(mark))?;
    }
    tell_result(&recorder.finish())
}

fn be_dsp(rate: Rate) -> Result<()> {
    let termination = Termination::install()?;
    let dsp = Dsp::new()?;
    tell(&format!("{PORT}{}", dsp.path().display()))?;
    tell_ready()?;
    tell_result(&dsp.run(rate, &termination)?)
}
