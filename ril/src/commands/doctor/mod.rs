//! `ril doctor`: looks at a robot's shared memory, configuration and serial port, and says what is wrong and what to do.
//!
//! [`facts`] are gathered, judged by [`findings`] and printed by [`report`]. Nothing is changed, unless `--repair` asks to
//! remove what is certainly dead. Nothing is joined but the topic of a live relay's link, and no other port is opened. Nothing
//! that stands in the way can hold it up for long.

pub mod facts;
pub mod findings;
mod gather;
pub mod report;

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use bridge::BridgeConfig;
use ipc_types::{Domain, DomainError, RobotId};
use runtime::exit::{ExitCode, Failure};

use self::facts::{Facts, FileFacts, PortFacts};
use self::report::Report;
use super::json_line;
use crate::cli::DoctorArgs;

/// `ril doctor`
///
/// # Errors
///
/// Code 78 when a configuration is wrong, 8 when something else is not in order, 6 when it is the serial port alone.
pub fn doctor(args: &DoctorArgs) -> Result<(), Failure> {
    runtime::logging::init(args.common.verbosity())?;
    let (files, bridge) = gather::files(args);
    let report = match args.common.check_config {
        true => Report::of_files(args.common.robot.get(), &files),
        false => Report::of(&examine(args, files, bridge)),
    };
    let mut out = io::stdout().lock();
    if args.json {
        json_line(&mut out, &report)?;
    } else {
        write!(out, "{report}").map_err(Failure::output)?;
    }
    match report.exit_code() {
        ExitCode::Ok => Ok(()),
        code => Err(Failure::new(code, report.verdict())),
    }
}

/// Everything that the doctor knows, for a command that judges more than that, with the bridge's configuration.
pub(super) fn facts(args: &DoctorArgs) -> (Facts, Option<BridgeConfig>) {
    let (files, bridge) = gather::files(args);
    (examine(args, files, bridge.clone()), bridge)
}

/// What there is of a domain.
pub(super) fn domain_facts(domain: &Domain) -> facts::DomainFacts {
    gather::domain(domain)
}

/// What `look` finds, given up like each look of the doctor when something keeps it waiting.
pub(super) fn look<T: Send + 'static>(look: impl FnOnce() -> T + Send + 'static) -> facts::Look<T> {
    gather::Looking::start(look).end(Instant::now(), gather::LOOK_PATIENCE)
}

/// Gathers all facts, after the repair if one is asked for.
fn examine(args: &DoctorArgs, files: Vec<FileFacts>, bridge: Option<BridgeConfig>) -> Facts {
    let robot = RobotId::from(args.common.robot);
    let domain = Domain::from_environment();
    let repair = match &domain {
        Ok(domain) if args.repair => Some(gather::repair(domain)),
        _ => None,
    };
    let place = domain.as_ref().ok().cloned();
    let domain = domain
        .map(|domain| gather::domain(&domain))
        .map_err(|error: DomainError| error.to_string());
    // Where no provider can be found, that is a finding of its own.
    let is_readable = domain.as_ref().is_ok_and(|facts| facts.providers.is_ok());
    let relay = place
        .filter(|_| is_readable)
        .and_then(|domain| gather::relay(&domain, robot));
    let bridge_process = domain
        .as_ref()
        .ok()
        .and_then(|domain| findings::bridge_pid(domain, robot.get()));
    Facts {
        robot: robot.get(),
        domain,
        relay,
        free_memory: gather::memory(),
        port: port(args, &files, bridge, bridge_process),
        files,
        repair,
    }
}

/// The serial port that the command line names, or else the bridge's configuration, if either does.
fn port(
    args: &DoctorArgs,
    files: &[FileFacts],
    bridge: Option<BridgeConfig>,
    process: Option<u32>,
) -> Option<PortFacts> {
    let (path, is_chosen): (PathBuf, bool) = match (&args.port, bridge) {
        (Some(port), _) => (port.clone(), true),
        (None, Some(config)) => {
            let is_default = config.serial.port == BridgeConfig::default().serial.port;
            let has_file = files.iter().any(|file| {
                file.command == Some("bridge") && file.content == Ok(facts::FileContent::Right)
            });
            (config.serial.port, has_file || !is_default)
        }
        (None, None) => return None,
    };
    Some(gather::port(path, is_chosen, process))
}
