//! `ril run view`: its command line, what it runs with, and the process in the foreground.
//! The command line of `ril view` stands here as well.

use std::io::ErrorKind;
use std::num::NonZeroU32;
use std::path::Path;
use std::path::PathBuf;

use clap::Args;
use ipc_types::{Domain, RobotId, allow_many_files};
use module_kit::process;
use operator::options::EXIT_CODES;
use runtime::args::{SettingsArgs, robot};
use runtime::config::Loaded;
use runtime::config::resulting::{Resulting, given, value_of};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::config::{self, DEFAULT_FILE, EXAMPLE, ViewConfig};
use crate::page::{ReplayInfo, Role};
use crate::shell::ViewShell;
use crate::shell::files::{Files, Report, TileFolder};
use crate::shell::fleet::Fleet;
use crate::shell::peer::holder;
use crate::shell::run_file::{RunEntry, RunFile};
use crate::shell::sockets::Sockets;
use crate::shell::tls::Tls;
use crate::shell::token_key::{self, TokenKey, random_hex};
use crate::{Instance, Server, Settings, Token};

/// `ril view`
///
/// Starts `ril run view` in the background if no view of this user runs on the port, and opens its page in a browser.
/// With FILE, plays that recording in the page until it is interrupted.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct ViewArgs {
    /// Recording of a flight (MCAP) to be played; where the port is in use and --port does not name it, one of the next
    /// ports is taken
    #[arg(value_name = "FILE", conflicts_with_all = ["stop", "layout"])]
    pub file: Option<PathBuf>,

    /// What the server takes.
    #[command(flatten)]
    pub server: ServerArgs,

    /// Print the address of the page instead of opening it; the address contains the token, so anyone with it can give
    /// orders
    #[arg(long)]
    pub no_browser: bool,

    /// Print it as one JSON object instead of opening the page
    #[arg(long)]
    pub json: bool,

    /// Print the address of the page for another machine, with the token NAME of view.toml, and as a QR code; anyone
    /// with the address can do what the token allows
    #[arg(long, value_name = "NAME", conflicts_with_all = ["no_browser", "json"])]
    pub invite: Option<String>,

    /// End the view that runs on the port
    #[arg(long, conflicts_with_all = ["no_browser", "json", "invite"])]
    pub stop: bool,

    /// Print panels for a robot, which Foxglove and Lichtblick import as a layout
    #[arg(long, conflicts_with_all = ["no_browser", "json", "stop"])]
    pub layout: bool,
}

/// `ril run view`
///
/// The page is at http://127.0.0.1:PORT/; view.toml opens it to other machines.
#[derive(Args, Clone, Debug)]
pub struct RunViewArgs {
    /// What the server takes.
    #[command(flatten)]
    pub server: ServerArgs,

    /// Leave the session of the terminal: `ril view` starts it so
    #[arg(long, hide = true)]
    pub own_session: bool,
}

/// What the server takes, however it is started.
#[derive(Args, Clone, Debug)]
pub struct ServerArgs {
    /// Port [default: 8765, or view.toml]
    #[arg(long, value_name = "PORT", value_parser = clap::value_parser!(u16).range(1..))]
    pub port: Option<u16>,

    /// Which robot; can be given several times, or as 1,2,5 [default: all robots that are alive, those that come later
    /// included]
    #[arg(long = "robot", value_name = "N", env = "RIL_ROBOT", value_delimiter = ',', value_parser = robot)]
    pub robots: Vec<NonZeroU32>,

    /// Folder of imagery to be drawn under the map: files {zoom}/{x}/{y}.png, .jpg or .webp [default: view.toml;
    /// without any, a grid alone]
    #[arg(long, value_name = "FOLDER")]
    pub tiles: Option<PathBuf>,

    /// Rows of tiles are counted from the south (TMS), as `gdal2tiles.py` without --xyz writes them
    #[arg(long)]
    pub tiles_tms: bool,

    /// Configuration and log.
    #[command(flatten)]
    pub settings: SettingsArgs,
}

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
pub(crate) fn load(args: &ServerArgs) -> Result<Loaded<ViewConfig>, Failure> {
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
pub fn run(args: RunViewArgs) -> Result<(), Failure> {
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
    let token = own_token(&config, &root)?;
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

pub(crate) fn listen(config: &ViewConfig) -> Result<Sockets, Failure> {
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

/// The token of `ril view`, with which a page that is open goes on when the server was started again. Without a key it
/// changes with each start: that must not keep a server from starting.
fn own_token(config: &ViewConfig, domain: &Path) -> Result<String, Failure> {
    match token_key::path(config).and_then(|path| TokenKey::open(&path)) {
        Ok(key) => Ok(key.own_token(config.port, domain)),
        Err(failure) if config.tokens.is_empty() => {
            let text = "pages that are open now may only look after the next start of the view";
            tracing::warn!(chain = ?failure.chain(), "{text}");
            random_hex().or_fail(ExitCode::Internal)
        }
        Err(failure) => Err(failure),
    }
}

/// The token of `ril view`, and those of the configuration.
fn tokens(config: &ViewConfig, secret: String) -> Result<Vec<Token>, Failure> {
    let mut tokens = vec![Token {
        name: "ril view".to_owned(),
        role: Role::Command,
        secret,
        is_local: true,
    }];
    if !config.tokens.is_empty() {
        let key = TokenKey::open(&token_key::path(config)?)?;
        tokens.extend(config.tokens.iter().map(|(name, role)| Token {
            name: name.clone(),
            role: *role,
            secret: key.token(name),
            is_local: false,
        }));
    }
    Ok(tokens)
}

/// A server of robots that are live, or of a recording, and what reads its files if there are any.
pub(crate) fn server(
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
        has_report: replay.is_some(),
        replay,
        tiles: tiles.as_ref().map(|tiles| tiles.range),
    };
    let files = Files::start(tiles, report)?;
    Ok((Server::new(settings, instance), files))
}
