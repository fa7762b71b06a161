//! The processes that are measured: this program, started again in one of these roles. They run in the folder of their
//! measurement, and say what the [`harness`](crate::harness) waits for. A role that has no end of its own ends at
//! SIGTERM.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Result;
use clap::Subcommand;
use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use runtime::signal::Termination;
use rustix::process::{Signal, set_parent_process_death_signal};

use crate::by_hand;
use crate::consumer::{self, Service};
use crate::dsp::{Dsp, Rate};
use crate::harness::{report, report_ready};
use crate::pace::Pace;
use crate::peers::{Mark, Peer};
#[cfg(feature = "peers")]
use crate::relayed;
use crate::requests;
use crate::stream::telemetry;

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
    HopSend { peer: Peer, rate_hz: u32 },
    /// Receives samples over a peer
    HopReceive { peer: Peer, samples: usize },
    /// Is the DSP until it is ended
    Dsp {
        #[arg(value_parser = rate)]
        rate: Rate,
    },
    /// Reads frames from a terminal
    ReadRaw { samples: usize },
    /// Reads telemetry until there are so many samples, or it is ended
    Consume { service: Service, samples: usize },
    /// Reads telemetry for a time and counts
    KeepUp { seconds: f64 },
    /// Orders landings
    Land { count: usize, rate_hz: u32 },
    /// Is a bridge by hand until it is ended
    BridgeByHand,
    /// Is a status by hand until it is ended
    StatusByHand,
    /// Reads its telemetry until there are so many samples, or it is ended
    ConsumeByHand { samples: usize },
    /// Answers requests over iceoryx2 alone
    ServeRaw,
    /// Sends requests over iceoryx2 alone
    AskRaw { count: usize, rate_hz: u32 },
    /// Is a robot until it is ended
    #[cfg(feature = "peers")]
    Robot { rate_hz: u32 },
    /// Reads its telemetry
    #[cfg(feature = "peers")]
    ConsumeRobot { samples: usize },
    /// Is a robot over plain Zenoh until it is ended
    #[cfg(feature = "peers")]
    ZenohRobot { endpoint: String, rate_hz: u32 },
    /// Reads its telemetry
    #[cfg(feature = "peers")]
    ConsumeZenoh { endpoint: String, samples: usize },
    /// The relay
    #[cfg(feature = "peers")]
    Relay {
        #[command(subcommand)]
        command: relay::cli::RelayCommand,
    },
    /// The RIL's processes and the operator's tool
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
        // They have exit codes of their own.
        Role::Ril { args } => ril::main(std::iter::once("ril".into()).chain(args)),
        #[cfg(feature = "peers")]
        Role::Relay { command } => runtime::exit::main_with(|| relay::cli::run(command)),
        role => match Termination::install()
            .map_err(Into::into)
            .and_then(|end| play(role, &end))
        {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("{error:?}");
                ExitCode::FAILURE
            }
        },
    }
}

fn play(role: Role, end: &Termination) -> Result<()> {
    match role {
        Role::HopSend { peer, rate_hz } => hop_send(peer, rate_hz, end),
        Role::HopReceive { peer, samples } => {
            let receive = peer.receiver()?;
            report_ready()?;
            report(&consumer::receive(receive, samples, || Ok(()))?)
        }
        Role::Dsp { rate } => {
            let dsp = Dsp::new()?;
            std::os::unix::fs::symlink(dsp.path(), "dsp")?;
            report_ready()?;
            report(&dsp.run(rate, end)?)
        }
        Role::ReadRaw { samples } => report(&consumer::read_raw("dsp".as_ref(), samples)?),
        Role::Consume { service, samples } => report(&match service {
            Service::Dsp => consumer::consume::<DspTelemetry>(samples, end)?,
            Service::Hero => consumer::consume::<HeroTelemetry>(samples, end)?,
        }),
        Role::KeepUp { seconds } => report(&consumer::keep_up(Duration::from_secs_f64(seconds))?),
        Role::Land { count, rate_hz } => report(&requests::land(count, rate_hz)?),
        Role::BridgeByHand => by_hand::bridge(end),
        Role::StatusByHand => by_hand::status(end),
        Role::ConsumeByHand { samples } => report(&by_hand::consume(samples, end)?),
        Role::ServeRaw => requests::serve_raw(end),
        Role::AskRaw { count, rate_hz } => report(&requests::ask_raw(count, rate_hz)?),
        #[cfg(feature = "peers")]
        Role::Robot { rate_hz } => relayed::be_robot(rate_hz, end),
        #[cfg(feature = "peers")]
        Role::ConsumeRobot { samples } => {
            let receive = Peer::Ours.receiver()?;
            report(&consumer::receive(receive, samples, report_ready)?)
        }
        #[cfg(feature = "peers")]
        Role::ZenohRobot { endpoint, rate_hz } => {
            relayed::publish_over_zenoh(&endpoint, rate_hz, end)
        }
        #[cfg(feature = "peers")]
        Role::ConsumeZenoh { endpoint, samples } => {
            let receive = relayed::zenoh_receiver(&endpoint)?;
            report(&consumer::receive(receive, samples, report_ready)?)
        }
        Role::Ril { .. } => Ok(()),
        #[cfg(feature = "peers")]
        Role::Relay { .. } => Ok(()),
    }
}

fn hop_send(peer: Peer, rate_hz: u32, end: &Termination) -> Result<()> {
    let mut send = peer.sender()?;
    let mut sample = telemetry();
    let mut pace = Pace::new(rate_hz);
    report_ready()?;
    for index in 1.. {
        pace.wait()?;
        if end.requested() {
            break;
        }
        let sent_ns = MonotonicNs::now().0;
        Mark { index, sent_ns }.stamp(&mut sample);
        send(&sample)?;
    }
    Ok(())
}
