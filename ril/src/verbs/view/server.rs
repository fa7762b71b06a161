//! `ril run view`: the server process in the foreground.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;

use ipc_types::{Domain, RobotId, allow_many_files};
use module_kit::process;
use runtime::config::resulting::{Resulting, given, value_of};
use runtime::config::{Loaded, load as load_file};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use view::page::{ReplayInfo, Role};
use view::{Instance, Server, Settings, Token};

use super::config::{DEFAULT_FILE, EXAMPLE, ViewConfig};
use super::fleet::Fleet;
use super::options::{RunViewArgs, ServerArgs};
use super::peer::holder;
use super::run_file::{RunFile, Running};
use super::secret;
use super::shell::ViewShell;
use super::sockets::Sockets;

/// What the server would run with.
///
/// # Errors
///
/// Exit code 78 when the configuration is wrong.
pub fn check_config(args: &ServerArgs) -> Result<Resulting, Failure> {
    let (file, default) = (args.config.as_deref(), Path::new(DEFAULT_FILE));
    let resulting = Resulting::load::<ViewConfig>(file, default, EXAMPLE)?;
    let port = given("--port", "").map(|(text, origin)| (value_of(&text), origin));
    Ok(resulting.with("port", port))
}

/// The configuration with what the command line says.
pub(super) fn load(args: &ServerArgs) -> Result<Loaded<ViewConfig>, Failure> {
    let mut loaded = load_file::<ViewConfig>(args.config.as_deref(), Path::new(DEFAULT_FILE))?;
    if let Some(port) = args.port {
        loaded.value.port = port;
    }
    Ok(loaded)
}

/// Runs the server until SIGINT or SIGTERM.
///
/// # Errors
///
/// Code 1 when the port is in use, 2 when too many robots are named, 78 when the configuration is wrong.
pub fn run(args: &RunViewArgs) -> Result<(), Failure> {
    if args.own_session {
        // Orders from pages are not those of the terminal, and the terminal's end is not the server's.
        rustix::process::setsid().or_fail(ExitCode::Internal)?;
    }
    let args = &args.server;
    if args.check_config {
        return check_config(args)?.print();
    }
    runtime::logging::init(args.common().verbosity())?;
    // A robot takes some 110, a connection one.
    allow_many_files();
    let config = load(args)?.value;
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let root = domain.root().to_owned();

    let mut run_file = RunFile::take(config.port)?;
    let sockets = listen(config.port)?;
    let named: Vec<RobotId> = args.robots.iter().copied().map(RobotId::from).collect();
    let fleet = Fleet::join(domain, &named)?;
    let token = secret::random_hex().or_fail(ExitCode::Internal)?;
    let running = Running {
        pid: std::process::id(),
        port: config.port,
        domain: root,
        recording: None,
        token: token.clone(),
    };
    run_file.write(&running).or_fail(ExitCode::Internal)?;
    let mut server = server(&config, token, None)?;
    server.set_robots(fleet.ids());
    let mut shell = ViewShell::new(sockets, server, fleet, &config);
    tracing::info!(address = running.address(), "ready");
    let supervisor = Notifier::from_env();
    process::run(&mut shell, &termination, &supervisor).or_fail(ExitCode::Internal)?;
    tracing::info!("ended");
    Ok(())
}

pub(super) fn listen(port: u16) -> Result<Sockets, Failure> {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    Sockets::listen(address).map_err(|error| match error.kind() {
        ErrorKind::AddrInUse => {
            Failure::internal(format!("port {port} is in use{}", holder(port))).with_next_step(
                format!("take another one: `--port {}`", port.saturating_add(1)),
            )
        }
        _ => Failure::internal(format!("port {port} cannot be used: {error}")),
    })
}

/// A server of robots that are live, or of a recording.
pub(super) fn server(
    config: &ViewConfig,
    secret: String,
    replay: Option<ReplayInfo>,
) -> Result<Server, Failure> {
    let instance = Instance(secret::random_hex().or_fail(ExitCode::Internal)?);
    let own = Token {
        name: "ril view".to_owned(),
        role: Role::Command,
        secret,
    };
    let settings = Settings {
        names: config.names.clone(),
        origins: config.origins.clone(),
        tokens: vec![own],
        foxglove_commands: config.commands.foxglove,
        foxglove_parameters: config.commands.foxglove && replay.is_none(),
        replay,
        ..Settings::default()
    };
    Ok(Server::new(settings, instance))
}
