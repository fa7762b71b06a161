//! The processes that are measured: this program, started again in one of these roles.
//!
//! A child prints `ready` when it can be measured, and whoever measures prints `result` and JSON at the end. A role that
//! has no end of its own ends at SIGTERM.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Subcommand;
use ipc_types::MonotonicNs;
use ipc_types::payload::{HeroAttitude, HeroGeodetic, HeroTelemetry};
use ril_tests::Process;
use ril_tests::process::Signal;
use runtime::signal::Termination;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::latency::Recorder;
use crate::pace::Pace;
use crate::peers::Peer;
use crate::site::Site;

const READY: &str = "ready";
const RESULT: &str = "result ";

/// Which role.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    role: Role,
}

/// What a child does.
#[derive(Clone, Subcommand)]
pub enum Role {
    /// Sends samples over a peer until it is ended.
    HopSend {
        peer: Peer,
        site: PathBuf,
        rate_hz: u32,
    },
    /// Receives samples over a peer.
    HopReceive {
        peer: Peer,
        site: PathBuf,
        samples: usize,
    },
}

impl Role {
    /// The arguments that start this role.
    fn arguments(&self) -> Vec<OsString> {
        let mut arguments = vec![OsString::from("child")];
        match self {
            Role::HopSend {
                peer,
                site,
                rate_hz,
            } => {
                arguments.push("hop-send".into());
                arguments.extend([name(*peer), site.into(), rate_hz.to_string().into()]);
            }
            Role::HopReceive {
                peer,
                site,
                samples,
            } => {
                arguments.push("hop-receive".into());
                arguments.extend([name(*peer), site.into(), samples.to_string().into()]);
            }
        }
        arguments
    }
}

fn name(peer: Peer) -> OsString {
    use clap::ValueEnum;
    // Every variant has a name.
    let value = peer.to_possible_value().expect("a name");
    value.get_name().into()
}

/// A child from outside.
pub struct Child(Process);

impl Child {
    /// Starts a child in the domain of `site` and waits until it is ready.
    pub fn start(site: &Site, role: &Role) -> Result<Child> {
        let program = std::env::current_exe()?;
        let mut process = Process::start(site.domain(), program, role.arguments());
        process.wait_for_line(|line| line.text == READY);
        Ok(Child(process))
    }

    /// Waits for the child's result.
    pub fn result<T: DeserializeOwned>(&mut self) -> Result<T> {
        let line = self.0.wait_for_line(|line| line.text.starts_with(RESULT));
        Ok(serde_json::from_str(&line.text[RESULT.len()..])?)
    }

    /// Ends the child in order.
    pub fn end(mut self) {
        self.0.signal(Signal::TERM);
        self.0.wait_exit();
    }
}

/// Plays the role.
pub fn run(args: Args) -> Result<()> {
    match args.role {
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
    }
}

fn tell_ready() -> Result<()> {
    println!("{READY}");
    std::io::stdout().flush().context("standard output")
}

fn tell_result(result: &impl Serialize) -> Result<()> {
    println!("{RESULT}{}", serde_json::to_string(result)?);
    std::io::stdout().flush().context("standard output")
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

/// A sample as it may be in flight: numbers with all their digits, which is what text has to carry.
fn telemetry() -> HeroTelemetry {
    HeroTelemetry {
        valid_groups: 0xffff,
        flying: 1,
        dsp_time_s: 1234.567,
        geodetic: HeroGeodetic {
            latitude_rad: 0.652_853_912_345_678,
            longitude_rad: -0.104_512_345_678_9,
            altitude_m: 123.456,
        },
        attitude: HeroAttitude {
            roll_rad: 0.012_345_6,
            pitch_rad: -0.023_456_7,
            yaw_rad: 1.234_567_8,
        },
        ..HeroTelemetry::default()
    }
}
