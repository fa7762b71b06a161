//! The command line of the relay: what each of its commands takes and does.

use std::io::Write;
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::{Args, Subcommand};
use ipc_types::{WaitError, Wake, allow_many_files};
use module_kit::SetUp;
use module_kit::process::{self, Process, Sources};
use runtime::args::CommonArgs;
use runtime::config::Fault;
use runtime::config::resulting::{Origin, Resulting};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::wall_clock::WallClock;

use crate::access;
use crate::certificate_files;
use crate::certify::{CertifyArgs, certify};
use crate::config::{Config, DEFAULT_FILE, MAX_NAME, RemoteRobot, Side};
use crate::network::{self, Network, NetworkError};
use crate::robot::RobotSide;
use crate::ros2::write_packages;
use crate::station::StationSide;

/// What the relay is for.
#[derive(Subcommand, Clone, Debug)]
pub enum RelayCommand {
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
#[derive(Args, Clone, Debug)]
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

    /// Takes requests without certificates from other machines too, as `security.insecure`: every machine of the
    /// network can fly the robot
    #[arg(long)]
    pub insecure: bool,
}

/// Options of the station's side.
#[derive(Args, Clone, Debug)]
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
#[derive(Args, Clone, Debug)]
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

/// Options of the packages of ROS 2.
#[derive(Args, Clone, Debug)]
pub struct Ros2PackagesArgs {
    /// What every process takes. Of a robot or a station on this machine, the topics of its other modules are there
    /// too.
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
pub fn run(command: RelayCommand) -> Result<(), Failure> {
    if matches!(command, RelayCommand::Robot(_) | RelayCommand::Station(_)) {
        network::share_one_thread();
    }
    // Each service takes some 22.
    allow_many_files();
    match command {
        RelayCommand::Robot(args) => robot(args),
        RelayCommand::Station(args) => station(args),
        RelayCommand::Router(args) => router(args),
        RelayCommand::Certify(args) => {
            if !WallClock::look().was_set() {
                let reason = "the clock of this machine was never set: the certificates would hold in the past";
                return Err(Failure::new(ExitCode::NotInOrder, reason)
                    .with_next_step("set it, such as by `sudo date --set 'YYYY-MM-DD hh:mm'`, and repeat the command"));
            }
            let text = certify(&args, SystemTime::now().into())?;
            let written = std::io::stdout().write_all(text.as_bytes());
            written.map_err(Failure::output)
        }
        RelayCommand::Ros2Packages(args) => ros2_packages(&args),
    }
}

fn robot(args: RobotArgs) -> Result<(), Failure> {
    let given = [
        Given("robot.listen", "--listen", args.listen),
        Given("robot.connect", "--connect", args.connect),
        Given("commands.stations", "--may-command", args.may_command),
    ];
    let insecure = args.insecure;
    run_side(Side::Robot, &args.common, given, insecure, |set_up| {
        let end = set_up.termination.as_fd();
        let ipc = set_up.join("relay")?;
        opened(RobotSide::open(ipc, set_up.config.clone(), end))
    })
}

fn station(args: StationArgs) -> Result<(), Failure> {
    let given = [
        Given("station.listen", "--listen", args.listen),
        Given("station.connect", "--connect", args.connect),
        Given("station.name", "--name", Vec::from_iter(args.name)),
    ];
    let robot = args.common.robot();
    run_side(Side::Station, &args.common, given, false, |set_up| {
        let config = &set_up.config;
        let name = config.station.name.clone().unwrap_or_else(host_name);
        let mut robots = config.station.robots.clone();
        if robots.is_empty() {
            robots.push(RemoteRobot::of(robot));
        }
        tracing::info!(station = name, "for the robots of this station");
        let end = set_up.termination.as_fd();
        opened(StationSide::open(
            &set_up.domain,
            &robots,
            &name,
            config,
            end,
        ))
    })
}

fn router(args: RouterArgs) -> Result<(), Failure> {
    let given = [
        Given("router.listen", "--listen", args.listen),
        Given("router.connect", "--connect", args.connect),
    ];
    run_side(Side::Router, &args.common, given, false, |set_up| {
        let end = set_up.termination.as_fd();
        let network = Network::open(&set_up.config, Side::Router, end);
        let router = network.map(|network| Router { network });
        opened(router.map_err(crate::Failure::from))
    })
}

/// What the command line gives: the key of the configuration, the option, and the texts that the key has with it.
struct Given(&'static str, &'static str, Vec<String>);

impl Given {
    /// The command line has precedence over the file; the stations that may command are added to those of the file.
    fn apply(&mut self, config: &mut Config) {
        let Given(key, _, given) = self;
        if given.is_empty() {
            return;
        }
        let configured = match *key {
            "robot.listen" => &mut config.robot.listen,
            "robot.connect" => &mut config.robot.connect,
            "station.listen" => &mut config.station.listen,
            "station.connect" => &mut config.station.connect,
            "router.listen" => &mut config.router.listen,
            "router.connect" => &mut config.router.connect,
            "commands.stations" => {
                let configured = &mut config.commands.stations;
                for name in std::mem::replace(given, configured.clone()) {
                    if !given.contains(&name) {
                        given.push(name);
                    }
                }
                configured
            }
            _ => return config.station.name = given.first().cloned(),
        };
        configured.clone_from(given);
    }
}

/// Checks the configuration, prints it if that was asked for, and else runs what `open` opens until it is asked to end.
fn run_side<S: Process<Error = WaitError>, const N: usize>(
    side: Side,
    common: &CommonArgs,
    mut given: [Given; N],
    insecure: bool,
    open: impl FnOnce(&SetUp<Config>) -> Result<Option<S>, Failure>,
) -> Result<(), Failure> {
    let set_up = SetUp::<Config>::begin_with(common, DEFAULT_FILE, |config| {
        given.iter_mut().for_each(|given| given.apply(config));
        config.security.insecure |= insecure;
        check(config, side)
    })?;
    let Some(set_up) = set_up else {
        return print_configuration(common, &given);
    };
    let Some(mut side) = open(&set_up)? else {
        return Ok(());
    };
    tracing::info!("ready");
    process::run(&mut side, &set_up.termination, &set_up.supervisor).or_fail(ExitCode::Internal)
}

/// What was opened. `None` if the process was asked to end before.
fn opened<S>(side: Result<S, crate::Failure>) -> Result<Option<S>, Failure> {
    match side {
        Err(crate::Failure::Network(NetworkError::Ended)) => Ok(None),
        side => side.map(Some).or_fail(ExitCode::Internal),
    }
}

/// Prints the configuration that was checked, and where each value comes from.
fn print_configuration(common: &CommonArgs, given: &[Given]) -> Result<(), Failure> {
    let file = common.settings.config.as_deref();
    let example = include_str!("../relay.toml");
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
    let packages =
        write_packages(&args.folder, &ipc, &set_up.config.topics).or_fail(ExitCode::Internal)?;
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
    if config
        .security
        .certificates()
        .is_ok_and(|files| files.is_some())
        && !WallClock::look().was_set()
    {
        tracing::warn!(
            "the clock of this machine was never set: no certificate is taken until it is, and the link comes up by itself then"
        );
    }
    Ok(())
}

/// The host's name with what a station's name may have; `station` if it is empty.
fn host_name() -> String {
    let uname = rustix::system::uname();
    let name = uname.nodename().to_string_lossy();
    let is_of_name = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    let letters = name.chars().take(MAX_NAME);
    let name: String = letters
        .map(|letter| if is_of_name(letter) { letter } else { '-' })
        .collect();
    match name.is_empty() {
        true => "station".to_owned(),
        false => name,
    }
}

#[cfg(test)]
mod tests {
    use runtime::config::load;

    use super::*;

    /// What a start says of this file.
    fn refused(folder: &Path, side: Side, text: &str) -> String {
        let file = folder.join("relay.toml");
        std::fs::write(&file, text).unwrap();
        match load::<Config>(Some(&file), Path::new(DEFAULT_FILE)) {
            Err(error) => error.to_string(),
            Ok(loaded) => {
                let fault = check(&loaded.value, side).unwrap_err();
                loaded.refuse(&fault).to_string()
            }
        }
    }

    #[test]
    fn every_wrong_configuration_is_refused_with_its_line_and_the_next_step() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let args = CertifyArgs {
            folder: path.to_owned(),
            machines: ["robot-1", "gcs"].map(|name| name.parse().unwrap()).into(),
            days: 10,
            authority_days: 10,
        };
        certify(&args, SystemTime::now().into()).unwrap();
        let secured = |more: &str| {
            let file = |name: &str| path.join(name);
            format!(
                "[security]\nauthority = {:?}\ncertificate = {:?}\nkey = {:?}\n{more}",
                file("ca.pem"),
                file("robot-1.pem"),
                file("robot-1-key.pem")
            )
        };
        #[rustfmt::skip]
        let cases = [
            // What cannot be read.
            (Side::Robot, "[robot]\nlisten = \n".to_owned(), "relay.toml:2", ""),
            (Side::Robot, "[robot]\nlisen = []\n".to_owned(), "relay.toml:2", "did you mean `listen`"),
            (Side::Router, "[network]\n\nlease_ms = 1\n".to_owned(), "relay.toml:3", "from 50 to 60000"),
            (Side::Station, "[station]\nrobots = [{ number = 1 }, { number = 1 }]\n".to_owned(), "relay.toml:2", "by `here`"),
            (Side::Robot, "[radio]\n".to_owned(), "relay.toml:1", ""),
            (Side::Robot, "[commands]\nlink_loss = \"crash\"\n".to_owned(), "relay.toml:2", ""),
            // Addresses.
            (Side::Robot, "[robot]\nlisten = [\n\"tcp/127.0.0.1:1\",\n\"tcp/10.0.0.2\",\n]\n".to_owned(), "relay.toml:4", "such as tcp/10.0.0.2:7447"),
            (Side::Robot, "[station]\nconnect = [\"tcp/10.0.0.256:1\"]\n".to_owned(), "relay.toml:2", "such as tcp/10.0.0.2:7447"),
            (Side::Robot, "[robot]\nlisten = [\"tcp/127.0.0.1:1\",\n\"tcp/127.0.0.1:1?\"]\n".to_owned(), "relay.toml:3", "take the sign out"),
            (Side::Station, "[station]\nconnect = [\"tcp/10.0.0.2:1#=eth0\"]\n".to_owned(), "relay.toml:2", "name=value"),
            (Side::Router, "[router]\nconnect = [\"tcp/10.0.0.2:1#iface=eth0?rel=1\"]\n".to_owned(), "relay.toml:2", "first those behind `?`"),
            (Side::Router, "[router]\nlisten = [\"tls/0.0.0.0:1\"]\n".to_owned(), "relay.toml:2", "ril relay certify"),
            (Side::Robot, "[network]\nmulticast = \"10.0.0.1:7446\"\n".to_owned(), "relay.toml:2", "such as 224.0.0.224:7446"),
            (Side::Robot, "[network]\nthrough = \"router\"\n".to_owned(), "relay.toml:2", "add the endpoint of a router"),
            // Commands that everyone on the network could give.
            (Side::Robot, "[robot]\nlisten = [\"tcp/0.0.0.0:1\"]\n[commands]\nstations = [\"gcs\"]\n".to_owned(), "relay.toml:2", "insecure = true"),
            (Side::Robot, "[network]\ndiscovery = true\n[commands]\nstations = [\"gcs\"]\n".to_owned(), "relay.toml:2", "insecure = true"),
            // Names.
            (Side::Robot, "[commands]\nstations = [\"gcs\",\n\"ground station\"]\n".to_owned(), "relay.toml:3", "letters, digits"),
            (Side::Station, "[station]\nname = \"a/b\"\n".to_owned(), "relay.toml:2", "letters, digits"),
            (Side::Robot, "[security]\nrobots = { a = 1 }\nrouters = [\"a\"]\n".to_owned(), "relay.toml:3", "its own name"),
            (Side::Robot, "[commands]\nstations = [\"gcs\", \"gcs\"]\n".to_owned(), "relay.toml:2", "take one out"),
            (Side::Station, "[security]\nrobots = { \"a/b\" = 1 }\n".to_owned(), "relay.toml:2", "letters, digits"),
            // Topics.
            (Side::Robot, "[topics]\ninclude = [\"*\",\n\"*/state\"]\n".to_owned(), "relay.toml:3", "such as `battery_watch/*`"),
            (Side::Robot, "[topics]\nexclude = [\"Camera\"]\n".to_owned(), "relay.toml:2", "such as `battery_watch/*`"),
            (Side::Robot, "[[topics.rules]]\nkey = \"a\"\n[[topics.rules]]\nkey = \"a b\"\n".to_owned(), "relay.toml:4", "such as `battery_watch/*`"),
            // Certificates.
            (Side::Robot, "[security]\nkey = \"robot-1-key.pem\"\n".to_owned(), "relay.toml:1", "needs all of"),
            (Side::Robot, secured("insecure = true\n"), "relay.toml:5", "take one of them out"),
            (Side::Robot, secured(""), "relay.toml:1", "name the certificates"),
            (Side::Robot, secured("stations = [\"gcs\"]\n[robot]\nlisten = [\"udp/224.0.0.9:1\"]\n"), "relay.toml:7", "take it out"),
            (Side::Robot, secured("stations = [\"gcs\"]\n").replace("ca.pem", "absent.pem"), "relay.toml:2", "let its user read it"),
            (Side::Station, secured("robots = { a = 1 }\n").replace("/robot-1.pem", "/gcs.pem"), "relay.toml:4", "made together"),
            (Side::Router, secured("robots = { a = 1 }\n").replace("/robot-1-key.pem", "/robot-1.pem"), "relay.toml:4", "BEGIN PRIVATE KEY"),
        ];
        for (side, text, line, next_step) in cases {
            let error = refused(path, side, &text);
            assert!(error.contains(line), "{text}{error}");
            assert!(error.contains(next_step), "{text}{error}");
        }
    }
}
