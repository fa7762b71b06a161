//! `ril view`: finds the view of this user that runs on the port, or starts one in the background, and opens its page,
//! or prints where that is. `ril view FILE` shows a recording until it is interrupted: it is a server of its own,
//! beside one of live robots.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Read, Write};
use std::num::NonZeroU32;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use ipc_types::{Domain, MonotonicNs, RobotId, allow_many_files, fresh_request_id};
use module_kit::process;
use operator::render::json_line;
use operator::session::print_configuration;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::output::standard_output;
use runtime::signal::{Termination, WITH_PARENT};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use serde::Serialize;

use crate::cli::{ServerArgs, ViewArgs};
use crate::config::ViewConfig;
use crate::replay::Playback;
use crate::shell::ViewShell;
use crate::shell::files::Report;
use crate::shell::fleet::Fleet;
use crate::shell::run_file::{self, RunEntry, RunFile};
use crate::shell::sockets::Sockets;
use crate::shell::token_key::random_hex;
use crate::{cli, invitation};

/// How long the server has to be ready, and to end. It takes a tenth of a second.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Most that is shown of the log of a server that did not start.
const MAX_LOG_BYTES: u64 = 4096;

/// `ril view`; `report` makes a page of a recording.
///
/// # Errors
///
/// Code 1 when the server cannot start, 2 when a layout is of several robots, 3 when there is none to stop, 78 when the
/// configuration is wrong.
pub fn view(args: &ViewArgs, report: fn(&Path) -> Result<String, Failure>) -> Result<(), Failure> {
    if args.server.settings.check_config {
        return print_configuration("view", &cli::check_config(&args.server)?);
    }
    if args.layout {
        return print_layout(&args.server.robots);
    }
    runtime::logging::init(args.server.settings.verbosity())?;
    if let Some(file) = &args.file {
        return view_file(args, file, report);
    }
    let config = cli::load(&args.server)?.value;
    if let Some(name) = &args.invite {
        return invitation::print(&config, name);
    }
    let port = config.port;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let running = run_file::find(port)?;
    if args.stop {
        return stop(port, running.as_ref());
    }
    let running = match running {
        Some(running) if running.domain == domain.root() && running.recording.is_none() => running,
        Some(other) => {
            let text = match &other.recording {
                Some(file) => format!("the view on port {port} shows {}", file.display()),
                None => format!(
                    "the view on port {port} shows another domain, {}",
                    other.domain.display()
                ),
            };
            let next_step = format!(
                "run another one: `ril view --port {}`",
                port.saturating_add(1)
            );
            return Err(Failure::internal(text).with_next_step(next_step));
        }
        None => start(port, &args.server)?,
    };
    show(&running, args)
}

/// Panels for one robot, by default robot 1.
fn print_layout(robots: &[NonZeroU32]) -> Result<(), Failure> {
    let robot = match robots {
        [] => RobotId::DEFAULT,
        [robot] => RobotId::from(*robot),
        _ => {
            return Err(Failure::usage(
                "a layout is of one robot: name one with --robot",
            ));
        }
    };
    let layout = ros_messages::layout(robot);
    io::stdout()
        .lock()
        .write_all(layout.as_bytes())
        .map_err(Failure::output)
}

/// Ends the server.
fn stop(port: u16, running: Option<&RunEntry>) -> Result<(), Failure> {
    let Some(running) = running else {
        let text = format!("no view of this user runs on port {port}");
        return Err(Failure::new(ExitCode::ServiceAbsent, text));
    };
    let unreachable = || Failure::internal(format!("process {} cannot be ended", running.pid));
    let pid = i32::try_from(running.pid).ok().and_then(Pid::from_raw);
    let process =
        pidfd_open(pid.ok_or_else(unreachable)?, PidfdFlags::empty()).map_err(|_| unreachable())?;
    pidfd_send_signal(&process, Signal::TERM).map_err(|_| unreachable())?;
    let mut ended = [PollFd::new(&process, PollFlags::IN)];
    let timeout = Timespec::try_from(TIMEOUT).ok();
    match poll(&mut ended, timeout.as_ref()) {
        Ok(1..) => Ok(()),
        _ => Err(Failure::new(
            ExitCode::Timeout,
            format!("process {} does not end", running.pid),
        )),
    }
}

/// Starts the server in the background, and waits until it is ready.
fn start(port: u16, args: &ServerArgs) -> Result<RunEntry, Failure> {
    let (log, log_path) = run_file::log_file(port)?;
    let name = format!("ril-view-{}", fresh_request_id());
    let address = SocketAddr::from_abstract_name(&name).or_fail(ExitCode::Internal)?;
    let readiness = UnixDatagram::bind_addr(&address).or_fail(ExitCode::Internal)?;
    let program = std::env::current_exe().or_fail(ExitCode::Internal)?;
    let mut command = Command::new(program);
    command
        .args(["run", "view", "--own-session"])
        .args(arguments(port, args))
        .env("NOTIFY_SOCKET", format!("@{name}"))
        .env_remove(WITH_PARENT)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(log);
    let mut child = command
        .spawn()
        .map_err(|error| Failure::internal(format!("`ril run view` cannot be started: {error}")))?;
    await_readiness(&readiness, &mut child, &log_path)?;
    run_file::find(port)?.ok_or_else(|| {
        let text = format!(
            "`ril run view` ended again; {} says why",
            log_path.display()
        );
        Failure::internal(text)
    })
}

fn arguments(port: u16, args: &ServerArgs) -> Vec<OsString> {
    let mut words: Vec<OsString> = vec!["--port".into(), port.to_string().into()];
    for robot in &args.robots {
        words.extend(["--robot".into(), robot.to_string().into()]);
    }
    if let Some(tiles) = &args.tiles {
        // The server is started in this folder; an absolute path says the same to readers of its command line.
        let tiles = std::path::absolute(tiles).unwrap_or_else(|_| tiles.clone());
        words.extend(["--tiles".into(), tiles.into()]);
    }
    if args.tiles_tms {
        words.push("--tiles-tms".into());
    }
    let settings = &args.settings;
    if let Some(config) = &settings.config {
        words.extend(["--config".into(), config.into()]);
    }
    words.extend((0..settings.verbose).map(|_| "-v".into()));
    words.extend((0..settings.quiet).map(|_| "-q".into()));
    words
}

/// Waits for the server's word that it is ready, or for its end.
fn await_readiness(readiness: &UnixDatagram, child: &mut Child, log: &Path) -> Result<(), Failure> {
    let process = pidfd_open(Pid::from_child(child), PidfdFlags::empty());
    let process = process.or_fail(ExitCode::Internal)?;
    let give_up = MonotonicNs::now() + TIMEOUT;
    let mut message = [0; 256];
    loop {
        let mut sources = [
            PollFd::new(readiness, PollFlags::IN),
            PollFd::new(&process, PollFlags::IN),
        ];
        let left = give_up.since(MonotonicNs::now());
        let timeout = Timespec::try_from(left).ok();
        let count = poll(&mut sources, timeout.as_ref());
        let [says, ends] = sources.map(|source| !source.revents().is_empty());
        if says {
            let length = readiness.recv(&mut message).or_fail(ExitCode::Internal)?;
            if message[..length].starts_with(b"READY=1") {
                return Ok(());
            }
        } else if ends {
            let code = child.wait().ok().and_then(|status| status.code());
            return Err(not_started(code, log));
        } else if count == Ok(0) || left.is_zero() {
            let text = format!(
                "`ril run view` is not ready after {} s; {} has its log",
                TIMEOUT.as_secs(),
                log.display()
            );
            return Err(Failure::new(ExitCode::Timeout, text));
        }
    }
}

/// Why the server ended at once: what it logged last, and its exit code.
fn not_started(code: Option<i32>, log: &Path) -> Failure {
    let mut text = String::new();
    let read = File::open(log).and_then(|file| file.take(MAX_LOG_BYTES).read_to_string(&mut text));
    if let Err(error) = read {
        tracing::debug!(%error, "the log cannot be read");
    }
    let said = text.lines().next().unwrap_or("it logged no reason");
    let said = said.strip_prefix("error: ").unwrap_or(said);
    let code = ExitCode::ALL
        .into_iter()
        .find(|known| Some(i32::from(known.code())) == code && *known != ExitCode::Ok);
    Failure::new(
        code.unwrap_or(ExitCode::Internal),
        format!("`ril run view` did not start: {said}"),
    )
}

/// Ports that are tried behind the wanted one, which the view of live robots may have.
const MORE_PORTS: u16 = 20;

/// Shows `file`; `report` makes a page of it.
///
/// # Errors
///
/// Code 1 when no port is free, 2 when the file cannot be read or is no recording, 78 when the configuration is wrong.
fn view_file(
    args: &ViewArgs,
    file: &Path,
    report: fn(&Path) -> Result<String, Failure>,
) -> Result<(), Failure> {
    let config = cli::load(&args.server)?.value;
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
    let (mut server, files) = cli::server(&config, token, Some(replay))?;
    playback.offer(&mut server);
    let mut shell = ViewShell::new(sockets, server, Fleet::none(domain), files, &config);
    shell.play(playback);
    tracing::info!(address = running.address(), "ready");
    show(&running, args)?;
    process::run(&mut shell, &termination, &Notifier::from_env()).or_fail(ExitCode::Internal)
}

/// The wanted port; if none was named on the command line, one behind it where that is in use.
fn listen(config: &ViewConfig, is_named: bool) -> Result<(RunFile, Sockets, u16), Failure> {
    let more = if is_named { 0 } else { MORE_PORTS };
    let ports = config.port..=config.port.saturating_add(more);
    let try_one = |port| {
        let run_file = RunFile::take(port)?;
        let sockets = cli::listen(&ViewConfig {
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

/// A view that runs, for programs.
#[derive(Serialize)]
struct ViewObject {
    schema: &'static str,
    pid: u32,
    port: u16,
    address: String,
    address_with_token: String,
}

impl ViewObject {
    fn of(running: &RunEntry) -> ViewObject {
        ViewObject {
            schema: "ril.View.v1",
            pid: running.pid,
            port: running.port,
            address: running.address(),
            address_with_token: running.address_with_token(),
        }
    }
}

/// Opens the page of a view, or prints where it is, as the command line wants it.
///
/// # Errors
///
/// Code 8 when no browser can be started.
fn show(running: &RunEntry, args: &ViewArgs) -> Result<(), Failure> {
    let mut out = standard_output();
    if args.json {
        return json_line(&mut out, &ViewObject::of(running));
    }
    if args.no_browser {
        out.print(format!("{}\n", running.address_with_token()));
        return Ok(());
    }
    out.print(format!("the view is at {}\n", running.address()));
    let file = run_file::write_opener(running)?;
    if open(&file) {
        return Ok(());
    }
    let text = "no browser could be started: neither $BROWSER nor xdg-open";
    Err(Failure::new(ExitCode::NotInOrder, text)
        .with_next_step("`ril view --no-browser` prints the address for a browser of your choice"))
}

/// Opens a file in the browser that the user prefers. The browser goes on by itself.
fn open(file: &Path) -> bool {
    let preferred = std::env::var_os("BROWSER").unwrap_or_default();
    let preferred = preferred.to_str().unwrap_or_default().split(':');
    let programs = preferred
        .filter(|program| !program.is_empty())
        .chain(["xdg-open"]);
    programs.into_iter().any(|program| {
        let mut words = program.split_whitespace();
        let Some(program) = words.next() else {
            return false;
        };
        let page: &OsStr = file.as_os_str();
        let opened = Command::new(program)
            .args(words.filter(|word| *word != "%s"))
            .arg(page)
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        opened.is_ok()
    })
}
