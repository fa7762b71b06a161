//! `ril run mavlink`: its command line, what it runs with, and the process in the foreground.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use ipc_types::payload::MavlinkStations;
use ipc_types::{MonotonicNs, Topic};
use module_kit::{SetUp, process};
use runtime::args::CommonArgs;
use runtime::config::resulting::Resulting;
use runtime::datagrams::StampedSocket;
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::config::{self, DEFAULT_FILE, EXAMPLE, MavlinkConfig};
use crate::shell::fence;
use crate::shell::keeper::{Keeper, KeptFiles};
use crate::shell::key::read_key;
use crate::shell::ports::Ports;
use crate::shell::state::{
    MAX_TIMESTAMP_BYTES, StateError, StateFile, timestamp_of, warn_of_timestamp, write_timestamp,
};
use crate::shell::{MavlinkShell, OwnTopic};
use crate::{
    Gateway, KeptHome, KeptProgress, MAX_FILE_BYTES, MAX_HOME_BYTES, MAX_PROGRESS_BYTES, Mission,
    Signing, SigningKey,
};

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
    let (file, default) = (
        args.common.settings.config.as_deref(),
        Path::new(DEFAULT_FILE),
    );
    config::load(file)?;
    Ok(Resulting::load::<MavlinkConfig>(file, default, EXAMPLE)?)
}

/// Runs the process until SIGINT or SIGTERM.
///
/// # Errors
///
/// Code 1 when the port is in use or another gateway of the robot runs, 78 when the configuration is wrong.
pub fn run(args: MavlinkArgs) -> Result<(), Failure> {
    if args.common.settings.check_config {
        return check_config(&args)?.print();
    }
    let Some(set_up) = SetUp::<MavlinkConfig>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    config::load(args.common.settings.config.as_deref())?;
    let robot = set_up.robot;
    let settings = set_up.config.settings(robot)?;
    let key = set_up.config.key.as_deref();
    let key = key.map(read_key).transpose()?;
    let port = set_up.config.port_of(robot)?;
    let socket = bind(SocketAddr::new(set_up.config.listen, port))?;
    let address = socket.local_addr().or_fail(ExitCode::Internal)?;
    let ipc = set_up.join(MavlinkStations::PROVIDER)?;
    let topic = OwnTopic::open(&ipc)?;
    let ports = Ports::open(ipc, set_up.config.fence.bridge.clone())?;
    let system = settings.system;
    let mut gateway = Gateway::new(settings, robot.get());
    let folder = set_up.config.state_folder();
    let state = |what| StateFile::new(folder.as_deref(), robot, what);
    let files = KeptFiles {
        mission: state("mission"),
        home: state("home"),
        progress: state("progress"),
        timestamp: state("timestamp"),
    };
    if let Some(key) = key {
        gateway = signing(gateway, key, &files.timestamp)?;
    }
    restore(&mut gateway, &files, ports.bridge_run());
    if set_up.config.fence.accept
        && let Some(why) = fence::trouble(ports.bridge_file().find())
    {
        tracing::warn!("as it is, no fence of a station comes into force: {why}");
    }
    let keeper = Keeper::start(files).or_fail(ExitCode::Internal)?;
    let mut shell = MavlinkShell::new(socket, ports, topic, keeper, gateway);
    tracing::info!(%address, system, "ready");
    process::run(&mut shell, &set_up.termination, &set_up.supervisor)
        .or_fail(ExitCode::Internal)?;
    tracing::info!("ended");
    Ok(())
}

/// The gateway, which signs with `key` from the timestamp on that was kept. A place where none can be kept is an error
/// before anything is signed. A full disk is none: it ends no flight with a station.
fn signing(mut gateway: Gateway, key: SigningKey, file: &StateFile) -> Result<Gateway, Failure> {
    let unusable = |why: StateError| {
        let text = format!("the timestamp of signatures cannot be kept: {why}");
        Failure::new(ExitCode::Configuration, text)
    };
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
    let clock = crate::timestamp(since_1970.unwrap_or_default());
    let kept = file.read(MAX_TIMESTAMP_BYTES, timestamp_of);
    let kept = kept.map_err(unusable)?.unwrap_or(0);
    gateway = gateway.signing(Signing::new(key, clock, kept, MonotonicNs::now()));
    if let Some(first) = gateway.poll_timestamp() {
        match write_timestamp(file, first) {
            Err(error) if error.is_full() => warn_of_timestamp(&error),
            kept => kept.map_err(|error| {
                unusable(error).with_next_step(
                    "name a folder that this user may write by `state` of mavlink.toml",
                )
            })?,
        }
    }
    Ok(gateway)
}

/// Gives the gateway what one of before has kept. Without it the rest works. `bridge` numbers the bridge's run.
fn restore(gateway: &mut Gateway, files: &KeptFiles, bridge: Option<u64>) {
    let decode = |bytes: &[u8]| Mission::decode(bytes).map_err(str::to_owned);
    match files.mission.read(MAX_FILE_BYTES, decode) {
        Ok(Some(mission)) => gateway.restore(mission),
        Ok(None) | Err(StateError::NoFolder) => {}
        Err(why) => tracing::warn!("{why}; there is no mission"),
    }
    match files
        .progress
        .read(MAX_PROGRESS_BYTES, KeptProgress::decode)
    {
        Ok(Some(progress)) => gateway.restore_progress(progress),
        Ok(None) | Err(StateError::NoFolder) => {}
        Err(why) => tracing::warn!("{why}; the mission begins with its first item"),
    }
    let decode = |bytes: &[u8]| KeptHome::decode(bytes, bridge.unwrap_or(0));
    match files.home.read(MAX_HOME_BYTES, decode) {
        Ok(Some(Some(home))) => gateway.restore_home(home),
        Ok(_) | Err(StateError::NoFolder) => {}
        Err(why) => tracing::warn!("{why}; home is not known before it is seen"),
    }
}

fn bind(address: SocketAddr) -> Result<StampedSocket, Failure> {
    let port = address.port();
    StampedSocket::bind(address).map_err(|error| match error.kind() {
        ErrorKind::AddrInUse => Failure::internal(format!("UDP port {port} is in use"))
            .with_next_step("end the other process, or set `port` in mavlink.toml"),
        _ => Failure::internal(format!("{address} (UDP) cannot be used: {error}")),
    })
}
