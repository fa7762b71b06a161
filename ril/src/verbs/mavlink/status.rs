//! `ril mavlink status`: which stations there are, what was not taken of them, and why nothing is sent.

use std::io::{self, Write};
use std::time::Duration;

use clap::Args;
use ipc_types::MonotonicNs;
use ipc_types::payload::MavlinkStations;
use runtime::args::CommonArgs;
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure};

use super::report::MavlinkReport;
use crate::options::{EXIT_CODES, duration};
use crate::render::json_line;
use crate::session::{Latest, Session, configuration, other_domains, others_alive};

/// `ril mavlink status`
///
/// It ends with exit code 0 when the helicopter is heard, so that telemetry is sent, and with 6 when not.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct MavlinkStatusArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for a sample, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// `ril mavlink status`
///
/// # Errors
///
/// Code 3 when there is no gateway, 4 when it publishes nothing, 6 when the helicopter is not heard.
pub fn status(args: &MavlinkStatusArgs) -> Result<(), Failure> {
    let Some(config) = configuration(&args.common)? else {
        return Ok(());
    };
    let timeout = args.timeout.unwrap_or_else(|| config.observe.timeout());
    let session = Session::join(&args.common)?;
    let robot = session.ipc.robot();
    let Some(mut topic) = Latest::<MavlinkStations>::open_if_provided(&session)? else {
        let text = format!(
            "no gateway to MAVLink of robot {robot} is running here{}{}",
            others_alive(robot),
            other_domains()
        );
        return Err(Failure::new(ExitCode::ServiceAbsent, text)
            .with_next_step("start `ril run mavlink`, and try again"));
    };
    let give_up = MonotonicNs::now() + timeout;
    let is_there = |topic: &mut Latest<MavlinkStations>, _| Ok(topic.sample.is_some());
    if !session.gather(&mut topic, give_up, is_there)? && session.termination.requested() {
        return Ok(());
    }
    let Some(sample) = &topic.sample else {
        let text = format!(
            "nothing came from the gateway of robot {robot} in {}, although it is running",
            DurationText(timeout)
        );
        return Err(Failure::new(ExitCode::Timeout, text).with_next_step(
            "`ril doctor` shows whether it is stopped; is the machine overloaded?",
        ));
    };
    let report = MavlinkReport::new(robot, sample, MonotonicNs::now());
    let mut out = io::stdout().lock();
    if args.json {
        json_line(&mut out, &report)?;
    } else {
        write!(out, "{report}").map_err(Failure::output)?;
    }
    match report.trouble() {
        None => Ok(()),
        Some((text, next_step)) => {
            Err(Failure::new(ExitCode::LinkDown, text).with_next_step(next_step))
        }
    }
}
