//! `ril run view`: the server process in the foreground.

use std::io::ErrorKind;
use std::path::Path;

use ipc_types::{Domain, RobotId, allow_many_files};
use module_kit::process;
use runtime::config::Loaded;
use runtime::config::resulting::{Resulting, given, value_of};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use view::page::{ReplayInfo, Role};
use view::{Instance, Server, Settings, Token};

use super::files::{Files, Report, TileFolder};
use super::fleet::Fleet;
use super::options::{RunViewArgs, ServerArgs};
use super::shell::ViewShell;
use super::sockets::Sockets;
use super::tls::Tls;
use crate::view_setup::config::{self, DEFAULT_FILE, EXAMPLE, ViewConfig};
use crate::view_setup::peer::holder;
use crate::view_setup::run_file::{RunEntry, RunFile};
use crate::view_setup::token_key::{self, TokenKey, random_hex};

/// What the server would run with.
///
/// # Errors
///
/// Exit code 78 when the configuration is wrong.
pub fn check_config(args: &ServerArgs) -> Result<Resulting, Failure> {
    let (file, default) = (args.settings.config.as_deref(), Path::new(DEFAULT_FILE));
    let resulting = Resulting::load::<ViewConfig>(file, default, EXAMPLE)?;
    load(args)?;
    let port = given("--port", "").map(|(text, origin)| (value_of(&text), origin));
    let tiles = given("--tiles", "").map(|(text, origin)| (value_of(&text), origin));
    let tms = given("--tiles-tms", "").map(|(_, origin)| (true.into(), origin));
    let with = resulting.with("port", port).with("tiles", tiles);
    Ok(with.with("tiles_tms", tms))
}

/// The configuration with what the command line says.
pub(super) fn load(args: &ServerArgs) -> Result<Loaded<ViewConfig>, Failure> {
    let mut loaded = config::load(args.settings.config.as_deref())?;
    if let Some(port) = args.port {
        loaded.value.port = port;
    }
    if let Some(tiles) = &args.tiles {
        loaded.value.tiles = Some(tiles.clone());
    }
    loaded.value.tiles_tms |= args.tiles_tms;
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
    if args.settings.check_config {
        return check_config(args)?.print();
    }
    runtime::logging::init(args.settings.verbosity())?;
    // A robot takes some 110, a connection one.
    allow_many_files();
    let config = load(args)?.value;
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    let root = domain.root().to_owned();

    let mut run_file = RunFile::take(config.port)?;
    let sockets = listen(&config)?;
    let named: Vec<RobotId> = args.robots.iter().copied().map(RobotId::from).collect();
    let fleet = Fleet::join(domain, &named)?;
    let token = random_hex().or_fail(ExitCode::Internal)?;
    let running = RunEntry {
        pid: std::process::id(),
        port: config.port,
        domain: root,
        recording: None,
        token: token.clone(),
    };
    run_file.write(&running).or_fail(ExitCode::Internal)?;
    let (mut server, files) = server(&config, token, None)?;
    server.set_robots(fleet.ids());
    let mut shell = ViewShell::new(sockets, server, fleet, files, &config);
    tracing::info!(address = running.address(), "ready");
    let supervisor = Notifier::from_env();
    process::run(&mut shell, &termination, &supervisor).or_fail(ExitCode::Internal)?;
    tracing::info!("ended");
    Ok(())
}

pub(super) fn listen(config: &ViewConfig) -> Result<Sockets, Failure> {
    let tls = config.tls.as_ref().map(Tls::load).transpose()?;
    if config.is_open() && tls.is_none() {
        tracing::warn!(
            "other machines are served without TLS (`insecure`): anyone in the network can read along and take their tokens; none of them may order"
        );
    }
    let port = config.port;
    Sockets::listen(&config.addresses(), tls).map_err(|(address, error)| match error.kind() {
        ErrorKind::AddrInUse => {
            let by = holder(port).map_or_else(String::new, |holder| format!(" by {holder}"));
            Failure::internal(format!("port {port} is in use{by}")).with_next_step(format!(
                "take another one: `--port {}`",
                port.saturating_add(1)
            ))
        }
        _ => Failure::internal(format!("{address} cannot be used: {error}")),
    })
}

/// That of `ril view`, which is another one at each start, and those of the configuration.
fn tokens(config: &ViewConfig, secret: String) -> Result<Vec<Token>, Failure> {
    let mut tokens = vec![Token {
        name: "ril view".to_owned(),
        role: Role::Command,
        secret,
    }];
    if !config.tokens.is_empty() {
        let key = TokenKey::open(&token_key::path(config)?)?;
        tokens.extend(config.tokens.iter().map(|(name, role)| Token {
            name: name.clone(),
            role: *role,
            secret: key.token(name),
        }));
    }
    Ok(tokens)
}

/// A server of robots that are live, or of a recording, and what reads its files if there are any.
pub(super) fn server(
    config: &ViewConfig,
    secret: String,
    replay: Option<(ReplayInfo, Report)>,
) -> Result<(Server, Option<Files>), Failure> {
    let tiles = config.tiles.as_deref();
    let tiles = tiles.map(|folder| TileFolder::open(folder, config.tiles_tms));
    let tiles = tiles.transpose()?;
    let (replay, report) = replay.unzip();
    let instance = Instance(random_hex().or_fail(ExitCode::Internal)?);
    let settings = Settings {
        names: config.names.clone(),
        origins: config.origins.clone(),
        tokens: tokens(config, secret)?,
        foxglove_commands: config.commands.foxglove,
        foxglove_parameters: config.commands.foxglove && replay.is_none(),
        has_report: replay.is_some(),
        replay,
        tiles: tiles.as_ref().map(|tiles| tiles.range),
    };
    let files = Files::start(tiles, report)?;
    Ok((Server::new(settings, instance), files))
}
