//! The command line of the relay.

use clap::{Args as ClapArgs, Subcommand};
use ipc_types::{WaitError, Wake};
use module_kit::SetUp;
use module_kit::process::{self, Process, Sources};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure, OrFail};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::config::{Config, DEFAULT_FILE, RemoteRobot, check_name};
use crate::network::{self, Network, Side};
use crate::robot::RobotSide;
use crate::station::StationSide;

/// What the relay is for.
#[derive(Subcommand, Clone, Debug)]
pub enum Command {
    /// Runs beside the robot: sends its telemetry, and takes requests from stations that may command
    Robot(RobotArgs),
    /// Runs at a ground station: provides the services of robots on this machine
    Station(StationArgs),
    /// Runs where robots and stations reach it: the centre of a star
    Router(RouterArgs),
}

/// Options of the robot's side.
#[derive(ClapArgs, Clone, Debug)]
pub struct RobotArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Where stations or routers reach this relay, such as tcp/0.0.0.0:7447, instead of `robot.listen`
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,

    /// Where to connect to, instead of `robot.connect`
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,

    /// A station that may command, beside those of `commands.stations`
    #[arg(long, value_name = "STATION")]
    pub may_command: Vec<String>,
}

/// Options of the station's side.
#[derive(ClapArgs, Clone, Debug)]
pub struct StationArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Where to connect to, such as tcp/10.0.0.2:7447, instead of `station.connect`
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,

    /// Where robots reach this relay, instead of `station.listen`
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,

    /// Name of this station, instead of `station.name` [default: the host's name]
    #[arg(long, value_name = "STATION")]
    pub name: Option<String>,
}

/// Options of a router.
#[derive(ClapArgs, Clone, Debug)]
pub struct RouterArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Where robots and stations reach this router, instead of `router.listen`
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Vec<String>,

    /// Other routers to connect to, instead of `router.connect`
    #[arg(long, value_name = "ENDPOINT")]
    pub connect: Vec<String>,
}

/// Runs the relay in the foreground until SIGINT or SIGTERM.
///
/// # Errors
/// Exit code 78 when the configuration is wrong, 1 when shared memory or the network cannot be used.
pub fn run(command: Command) -> Result<(), Failure> {
    if matches!(command, Command::Robot(_) | Command::Station(_)) {
        network::share_one_thread();
    }
    allow_many_files();
    match command {
        Command::Robot(args) => robot(args),
        Command::Station(args) => station(args),
        Command::Router(args) => router(args),
    }
}

fn robot(args: RobotArgs) -> Result<(), Failure> {
    let Some(mut set_up) = SetUp::<Config>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let config = &mut set_up.config;
    replace(&mut config.robot.listen, args.listen);
    replace(&mut config.robot.connect, args.connect);
    config.commands.stations.extend(args.may_command);
    check(config)?;
    let ipc = set_up.join("relay")?;
    let side = RobotSide::open(ipc, set_up.config.clone()).or_fail(ExitCode::Internal)?;
    go(side, &set_up)
}

fn station(args: StationArgs) -> Result<(), Failure> {
    let Some(mut set_up) = SetUp::<Config>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let config = &mut set_up.config;
    replace(&mut config.station.listen, args.listen);
    replace(&mut config.station.connect, args.connect);
    config.station.name = args.name.or(config.station.name.take());
    check(config)?;
    let name = config.station.name.clone().unwrap_or_else(host_name);
    let mut robots = config.station.robots.clone();
    if robots.is_empty() {
        robots.push(RemoteRobot::of(args.common.robot));
    }
    let side =
        StationSide::open(&set_up.domain, &robots, &name, config).or_fail(ExitCode::Internal)?;
    tracing::info!(station = name, "ready");
    go(side, &set_up)
}

fn router(args: RouterArgs) -> Result<(), Failure> {
    let Some(mut set_up) = SetUp::<Config>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let config = &mut set_up.config;
    replace(&mut config.router.listen, args.listen);
    replace(&mut config.router.connect, args.connect);
    check(config)?;
    let network = Network::open(config, Side::Router).or_fail(ExitCode::Internal)?;
    go(Router { network }, &set_up)
}

/// Zenoh does all the work of a router in threads of its own.
struct Router {
    network: Network,
}

impl Process for Router {
    type Error = WaitError;
    type Key = ();

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.descriptor((), self.network.descriptor());
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), WaitError> {
        self.network.drained();
        Ok(())
    }
}

fn go<S: Process<Error = WaitError>>(mut side: S, set_up: &SetUp<Config>) -> Result<(), Failure> {
    process::run(&mut side, &set_up.termination, &set_up.supervisor).or_fail(ExitCode::Internal)
}

/// Raises the limit of open files, usually 1,024, to what the system allows: each service takes some 22.
fn allow_many_files() {
    let maximum = getrlimit(Resource::Nofile).maximum;
    let limit = Rlimit {
        current: maximum,
        maximum,
    };
    if let Err(error) = setrlimit(Resource::Nofile, limit) {
        tracing::debug!(%error, "the limit of open files stays as it is");
    }
}

/// What the command line says rules.
fn replace(configured: &mut Vec<String>, given: Vec<String>) {
    if !given.is_empty() {
        *configured = given;
    }
}

fn check(config: &Config) -> Result<(), Failure> {
    let fail = |error: String| Failure::new(ExitCode::Configuration, error);
    config.check().map_err(fail)?;
    config
        .station
        .name
        .as_deref()
        .map_or(Ok(()), check_name)
        .map_err(fail)
}

/// The host's name with what a station's name may have, `station` when nothing is left of it.
fn host_name() -> String {
    let uname = rustix::system::uname();
    let name: String = uname
        .nodename()
        .to_string_lossy()
        .chars()
        .map(|letter| {
            if letter.is_ascii_alphanumeric() || letter == '_' {
                letter
            } else {
                '-'
            }
        })
        .take(crate::config::MAX_NAME)
        .collect();
    if name.is_empty() {
        "station".to_owned()
    } else {
        name
    }
}
