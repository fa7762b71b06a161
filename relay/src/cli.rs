//! The command line of the relay.

use std::io::Write;
use std::path::PathBuf;

use std::os::fd::AsFd;

use clap::{Args as ClapArgs, Subcommand};
use ipc_types::{WaitError, Wake};
use module_kit::SetUp;
use module_kit::process::{self, Process, Sources};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure, OrFail};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::access;
use crate::certify::{Machine, Order, certify};
use crate::config::{Config, DEFAULT_FILE, RemoteRobot, check_name};
use crate::network::{self, Network, NetworkError, Side};
use crate::robot::RobotSide;
use crate::ros2_packages;
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
    /// Makes certificates, so that no stranger on the network reads or orders anything
    Certify(CertifyArgs),
    /// Writes the packages of ROS 2 with the messages of the robot's topics, and ends
    Ros2Packages(Ros2PackagesArgs),
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

    /// Takes requests without certificates from other machines too, as `security.insecure`: anyone there can fly the robot
    #[arg(long)]
    pub insecure: bool,
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

/// Options of `certify`.
#[derive(ClapArgs, Clone, Debug)]
#[command(
    after_help = "It prints the lines for relay.toml. Exit codes: 0 all was made, 2 a name makes no sense, \
    5 a file is there already, 8 the authority cannot be used, 1 anything else."
)]
pub struct CertifyArgs {
    /// Where the files are; an authority is made there (ca.pem, ca-key.pem) if there is none
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,

    /// Names of machines, each with the host names and addresses by which others connect to it: robot-1=10.0.0.2,robot.local
    #[arg(value_name = "NAME[=HOST,…]", required = true)]
    pub machines: Vec<Machine>,

    /// For how many days the certificates hold; never longer than the authority
    #[arg(long, value_name = "DAYS", default_value_t = 730, value_parser = clap::value_parser!(u32).range(1..=36_500))]
    pub days: u32,

    /// For how many days the authority holds, if it is made now
    #[arg(long, value_name = "DAYS", default_value_t = 3650, value_parser = clap::value_parser!(u32).range(1..=36_500))]
    pub authority_days: u32,
}

/// Options of the packages of ROS 2.
#[derive(ClapArgs, Clone, Debug)]
pub struct Ros2PackagesArgs {
    /// What every process takes. Of a robot or a station on this machine, the topics of its other modules are there too.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Where to put them, such as the folder `src` of a workspace; files of the same names are replaced
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
}

/// Runs the relay in the foreground until SIGINT or SIGTERM, or makes files and ends.
///
/// # Errors
/// Exit code 78 when the configuration is wrong, 1 when shared memory, the network or the folder cannot be used.
pub fn run(command: Command) -> Result<(), Failure> {
    if matches!(command, Command::Robot(_) | Command::Station(_)) {
        network::share_one_thread();
    }
    allow_many_files();
    match command {
        Command::Robot(args) => robot(args),
        Command::Station(args) => station(args),
        Command::Router(args) => router(args),
        Command::Certify(args) => make_certificates(args),
        Command::Ros2Packages(args) => ros2_packages(&args),
    }
}

fn make_certificates(args: CertifyArgs) -> Result<(), Failure> {
    let order = Order {
        folder: args.folder,
        machines: args.machines,
        days: args.days,
        authority_days: args.authority_days,
    };
    let text = certify(&order, std::time::SystemTime::now().into())?;
    std::io::stdout()
        .write_all(text.as_bytes())
        .map_err(Failure::output)
}

fn robot(args: RobotArgs) -> Result<(), Failure> {
    let Some(mut set_up) = SetUp::<Config>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let config = &mut set_up.config;
    replace(&mut config.robot.listen, args.listen);
    replace(&mut config.robot.connect, args.connect);
    config.commands.stations.extend(args.may_command);
    config.security.insecure |= args.insecure;
    check(config, Side::Robot)?;
    let ipc = set_up.join("relay")?;
    let side = RobotSide::open(ipc, set_up.config.clone(), set_up.termination.as_fd());
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
    check(config, Side::Station)?;
    let name = config.station.name.clone().unwrap_or_else(host_name);
    let mut robots = config.station.robots.clone();
    if robots.is_empty() {
        robots.push(RemoteRobot::of(args.common.robot));
    }
    tracing::info!(station = name, "for the robots of this station");
    let end = set_up.termination.as_fd();
    let side = StationSide::open(&set_up.domain, &robots, &name, config, end);
    go(side, &set_up)
}

fn router(args: RouterArgs) -> Result<(), Failure> {
    let Some(mut set_up) = SetUp::<Config>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let config = &mut set_up.config;
    replace(&mut config.router.listen, args.listen);
    replace(&mut config.router.connect, args.connect);
    check(config, Side::Router)?;
    let network = Network::open(config, Side::Router, set_up.termination.as_fd());
    let router = network.map(|network| Router { network });
    go(router.map_err(crate::Failure::from), &set_up)
}

fn ros2_packages(args: &Ros2PackagesArgs) -> Result<(), Failure> {
    let Some(set_up) = SetUp::<Config>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let ipc = set_up.join("ros2-packages")?;
    let packages = ros2_packages::write(&args.folder, &ipc, &set_up.config.topics)
        .or_fail(ExitCode::Internal)?;
    let mut out = std::io::stdout().lock();
    for (package, messages) in packages {
        let path = args.folder.join(package);
        writeln!(out, "{} ({messages} .msg)", path.display()).map_err(Failure::output)?;
    }
    Ok(())
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

/// Runs what was opened, if the process was not asked to end before.
fn go<S: Process<Error = WaitError>>(
    side: Result<S, crate::Failure>,
    set_up: &SetUp<Config>,
) -> Result<(), Failure> {
    let mut side = match side {
        Err(crate::Failure::Network(NetworkError::Ended)) => return Ok(()),
        side => side.or_fail(ExitCode::Internal)?,
    };
    tracing::info!("ready");
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

fn check(config: &Config, side: Side) -> Result<(), Failure> {
    let fail = |error: String| Failure::new(ExitCode::Configuration, error);
    config.check().map_err(fail)?;
    if let Some(warning) = access::check(config, side).map_err(fail)? {
        tracing::warn!("{warning}");
    }
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
