//! `ril run mavlink`: the process in the foreground.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;

use mavlink_gateway::Gateway;
use module_kit::{SetUp, process};
use runtime::args::CommonArgs;
use runtime::config::resulting::Resulting;
use runtime::exit::{ExitCode, Failure, OrFail};

use super::config::{DEFAULT_FILE, EXAMPLE, MavlinkConfig};
use super::ports::Ports;
use super::shell::MavlinkShell;
use super::store::MissionFile;

/// `ril run mavlink`
///
/// QGroundControl, MAVSDK and pymavlink find the helicopter on loopback; docs/mavlink.md says what they can do.
#[derive(clap::Args, Clone, Debug)]
pub struct MavlinkArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What the process would run with.
///
/// # Errors
///
/// Exit code 78 when the configuration is wrong.
pub fn check_config(args: &MavlinkArgs) -> Result<Resulting, Failure> {
    let (file, default) = (args.common.config.as_deref(), Path::new(DEFAULT_FILE));
    Ok(Resulting::load::<MavlinkConfig>(file, default, EXAMPLE)?)
}

/// Runs the process until SIGINT or SIGTERM.
///
/// # Errors
///
/// Code 1 when the port is in use, 78 when the configuration is wrong.
pub fn run(args: &MavlinkArgs) -> Result<(), Failure> {
    if args.common.check_config {
        return check_config(args)?.print();
    }
    let Some(set_up) = SetUp::<MavlinkConfig>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let robot = set_up.robot;
    let settings = set_up.config.settings(robot)?;
    let socket = bind(set_up.config.port_of(robot)?)?;
    let address = socket.local_addr().or_fail(ExitCode::Internal)?;
    let ports = Ports::open(set_up.join("mavlink")?)?;
    let system = settings.system;
    let mut gateway = Gateway::new(settings, robot.get());
    let file = MissionFile::new(set_up.config.state_folder().as_deref(), robot);
    match file.read() {
        Ok(mission) => gateway.restore(mission),
        // Without a mission the rest works.
        Err(why) => tracing::warn!("{why}; there is no mission"),
    }
    let mut shell = MavlinkShell::new(socket, ports, gateway, file);
    tracing::info!(%address, system, "ready");
    process::run(&mut shell, &set_up.termination, &set_up.supervisor)
        .or_fail(ExitCode::Internal)?;
    tracing::info!("ended");
    Ok(())
}

fn bind(port: u16) -> Result<UdpSocket, Failure> {
    let bound = UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).and_then(|socket| {
        socket.set_nonblocking(true)?;
        Ok(socket)
    });
    bound.map_err(|error| match error.kind() {
        ErrorKind::AddrInUse => Failure::internal(format!("UDP port {port} is in use"))
            .with_next_step("end the other process, or set `port` in mavlink.toml"),
        _ => Failure::internal(format!("UDP port {port} cannot be used: {error}")),
    })
}
