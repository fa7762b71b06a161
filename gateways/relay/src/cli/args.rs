//! What can stand on the command line of the relay.

use std::path::PathBuf;

use clap::{Args as ClapArgs, Subcommand};
use runtime::args::CommonArgs;

use crate::certify::Machine;

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

    /// Takes requests without certificates from other machines too, as `security.insecure`: every machine of the network can fly the robot
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
