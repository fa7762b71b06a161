//! The command line of the relay: what each of its commands does.

mod args;

use std::io::Write;
use std::os::fd::AsFd;
use std::path::Path;

use ipc_types::{WaitError, Wake};
use module_kit::SetUp;
use module_kit::process::{self, Process, Sources};
use runtime::args::CommonArgs;
use runtime::config::Fault;
use runtime::config::resulting::{Origin, Resulting};
use runtime::exit::{ExitCode, Failure, OrFail};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::access;
use crate::certificate_files;
use crate::certify::{Order, certify};
use crate::config::{Config, DEFAULT_FILE, MAX_NAME, RemoteRobot, Side};
use crate::network::{self, Network, NetworkError};
use crate::robot::RobotSide;
use crate::ros2_packages;
use crate::station::StationSide;
pub use args::{CertifyArgs, Command, RobotArgs, Ros2PackagesArgs, RouterArgs, StationArgs};

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
    let common = args.common.clone();
    let mut given = vec![
        Given("robot.listen", "--listen", args.listen.clone()),
        Given("robot.connect", "--connect", args.connect.clone()),
        Given(
            "commands.stations",
            "--may-command",
            args.may_command.clone(),
        ),
    ];
    let set_up = SetUp::<Config>::begin_with(&common, DEFAULT_FILE, |config| {
        replace(&mut config.robot.listen, args.listen);
        replace(&mut config.robot.connect, args.connect);
        if !args.may_command.is_empty() {
            add(&mut config.commands.stations, args.may_command);
            let stations = config.commands.stations.clone();
            given.push(Given("commands.stations", "--may-command", stations));
        }
        config.security.insecure |= args.insecure;
        check(config, Side::Robot)
    })?;
    let Some(set_up) = set_up else {
        return print_configuration(&common, &given);
    };
    let ipc = set_up.join("relay")?;
    let side = RobotSide::open(ipc, set_up.config.clone(), set_up.termination.as_fd());
    go(side, &set_up)
}

fn station(args: StationArgs) -> Result<(), Failure> {
    let common = args.common.clone();
    let given = [
        Given("station.listen", "--listen", args.listen.clone()),
        Given("station.connect", "--connect", args.connect.clone()),
        Given(
            "station.name",
            "--name",
            args.name.iter().cloned().collect(),
        ),
    ];
    let set_up = SetUp::<Config>::begin_with(&common, DEFAULT_FILE, |config| {
        replace(&mut config.station.listen, args.listen);
        replace(&mut config.station.connect, args.connect);
        config.station.name = args.name.or(config.station.name.take());
        check(config, Side::Station)
    })?;
    let Some(set_up) = set_up else {
        return print_configuration(&common, &given);
    };
    let config = &set_up.config;
    let name = config.station.name.clone().unwrap_or_else(host_name);
    let mut robots = config.station.robots.clone();
    if robots.is_empty() {
        robots.push(RemoteRobot::of(common.robot));
    }
    tracing::info!(station = name, "for the robots of this station");
    let end = set_up.termination.as_fd();
    let side = StationSide::open(&set_up.domain, &robots, &name, config, end);
    go(side, &set_up)
}

fn router(args: RouterArgs) -> Result<(), Failure> {
    let common = args.common.clone();
    let given = [
        Given("router.listen", "--listen", args.listen.clone()),
        Given("router.connect", "--connect", args.connect.clone()),
    ];
    let set_up = SetUp::<Config>::begin_with(&common, DEFAULT_FILE, |config| {
        replace(&mut config.router.listen, args.listen);
        replace(&mut config.router.connect, args.connect);
        check(config, Side::Router)
    })?;
    let Some(set_up) = set_up else {
        return print_configuration(&common, &given);
    };
    let network = Network::open(&set_up.config, Side::Router, set_up.termination.as_fd());
    let router = network.map(|network| Router { network });
    go(router.map_err(crate::Failure::from), &set_up)
}

/// What the command line gives: the key of the configuration, the option, and the texts that the key has with it.
struct Given(&'static str, &'static str, Vec<String>);

/// Prints the configuration that was checked, and where each value comes from.
fn print_configuration(common: &CommonArgs, given: &[Given]) -> Result<(), Failure> {
    let file = common.config.as_deref();
    let example = include_str!("../../relay.toml");
    let mut resulting = Resulting::load::<Config>(file, Path::new(DEFAULT_FILE), example)?;
    for Given(key, option, texts) in given {
        let value =
            (!texts.is_empty()).then(|| (texts.clone().into(), Origin::CommandLine(option)));
        resulting = resulting.with(key, value);
    }
    resulting.print()
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

/// The same of names that are added: one that is there already is there once.
fn add(configured: &mut Vec<String>, given: Vec<String>) {
    for name in given {
        if !configured.contains(&name) {
            configured.push(name);
        }
    }
}

/// Everything that a start refuses, without opening the network or shared memory.
fn check(config: &Config, side: Side) -> Result<(), Fault> {
    config.check()?;
    config.check_side(side)?;
    let warning = access::check(config, side)?;
    network::check(config, side)?;
    certificate_files::check(&config.security)?;
    if let Some(warning) = warning {
        tracing::warn!("{warning}");
    }
    Ok(())
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
        .take(MAX_NAME)
        .collect();
    if name.is_empty() {
        "station".to_owned()
    } else {
        name
    }
}
