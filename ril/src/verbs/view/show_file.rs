//! `ril view FILE`: shows a recording until it is interrupted. It is a server of its own, beside one of live robots.

use std::io::Write;
use std::path::Path;

use ipc_types::{Domain, allow_many_files};
use module_kit::process;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;

use super::files::Report;
use super::fleet::Fleet;
use super::options::ViewArgs;
use super::replay::Playback;
use super::shell::ViewShell;
use super::sockets::Sockets;
use super::{opener, server};
use crate::view_setup::config::ViewConfig;
use crate::view_setup::run_file::{RunEntry, RunFile};
use crate::view_setup::token_key::random_hex;

/// Ports that are tried behind the wanted one, which the view of live robots may have.
const MORE_PORTS: u16 = 20;

/// Shows `file`; `report` makes a page of it.
///
/// # Errors
///
/// Code 1 when no port is free, 2 when the file cannot be read or is no recording, 78 when the configuration is wrong.
pub(super) fn view(
    args: &ViewArgs,
    file: &Path,
    report: fn(&Path) -> Result<String, Failure>,
) -> Result<(), Failure> {
    let config = server::load(&args.server)?.value;
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    allow_many_files();
    let (mut playback, info) = Playback::open(file)?;
    for event in info
        .events
        .iter()
        .filter(|event| event.text.starts_with("recording: "))
    {
        tracing::warn!(at_s = event.at_s, "{}", event.text);
    }
    let (mut run_file, sockets, port) = listen(&config, args.server.port.is_some())?;
    let token = random_hex().or_fail(ExitCode::Internal)?;
    let running = RunEntry {
        pid: std::process::id(),
        port,
        domain: domain.root().to_owned(),
        recording: Some(std::path::absolute(file).unwrap_or_else(|_| file.to_owned())),
        token: token.clone(),
    };
    run_file.write(&running).or_fail(ExitCode::Internal)?;
    let path = file.to_owned();
    let replay = (info, Box::new(move || report(&path)) as Report);
    let (mut server, files) = server::server(&config, token, Some(replay))?;
    playback.offer(&mut server);
    let mut shell = ViewShell::new(sockets, server, Fleet::none(domain), files, &config);
    shell.play(playback);
    tracing::info!(address = running.address(), "ready");
    opener::show(&running, args)?;
    std::io::stdout().flush().map_err(Failure::output)?;
    process::run(&mut shell, &termination, &Notifier::from_env()).or_fail(ExitCode::Internal)
}

/// The wanted port; if none was named on the command line, one behind it where that is in use.
fn listen(config: &ViewConfig, is_named: bool) -> Result<(RunFile, Sockets, u16), Failure> {
    let more = if is_named { 0 } else { MORE_PORTS };
    let ports = config.port..=config.port.saturating_add(more);
    let try_one = |port| {
        let run_file = RunFile::take(port)?;
        let sockets = server::listen(&ViewConfig {
            port,
            ..config.clone()
        })?;
        Ok((run_file, sockets, port))
    };
    let mut first = None;
    for port in ports {
        match try_one(port) {
            Ok(found) => return Ok(found),
            Err(failure) => _ = first.get_or_insert(failure),
        }
    }
    Err(first.unwrap_or_else(|| Failure::internal("there is no port")))
}
