//! Configuration of `ril run mavlink`, `mavlink.toml`.
//!
//! Every value has a default; the annotated example `gateways/mavlink/mavlink.toml` shows them all and is tested to
//! parse to them.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::RobotId;
use operator::user_files;
use runtime::config::{Fault, Loaded, in_range, load as load_file};
use runtime::exit::{ExitCode, Failure};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::{SILENCE, Settings, StationLost};

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "mavlink.toml";

/// The annotated example.
pub const EXAMPLE: &str = include_str!("../mavlink.toml");

/// Most stations that are sent a heartbeat unasked.
const MAX_STATIONS: usize = 4;

/// All of `mavlink.toml`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MavlinkConfig {
    /// Address at which stations reach the gateway.
    pub listen: IpAddr,
    /// Port of robot 1; 0 for a free one.
    pub port: u16,
    /// Stations that are sent a heartbeat unasked.
    #[serde(deserialize_with = "stations")]
    pub stations: Vec<SocketAddr>,
    /// The vehicle's number; that of the robot if it is not given.
    #[serde(deserialize_with = "system")]
    pub system: Option<u8>,
    /// How high telemetry's zero is above sea, m.
    #[serde(deserialize_with = "zero_above_sea_m")]
    pub zero_above_sea_m: Option<f64>,
    /// Height of a take-off whose command names none, m.
    #[serde(deserialize_with = "take_off_m")]
    pub take_off_m: f64,
    /// Age of the newest sample from which on the helicopter is not heard any more, s.
    #[serde(deserialize_with = "seconds")]
    pub lost_s: f64,
    /// How long the bridge has for its first answer, s.
    #[serde(deserialize_with = "seconds")]
    pub answer_s: f64,
    /// What becomes of a movement when the station that ordered it says nothing any more.
    pub station_lost: StationLost,
    /// When a station counts as lost, s.
    #[serde(deserialize_with = "station_lost_s")]
    pub station_lost_s: f64,
    /// File with the key of signatures; `None` if frames are not signed.
    pub key: Option<PathBuf>,
    /// Whether stations on other machines are taken that do not sign.
    pub insecure: bool,
    /// Folder of what is kept over restarts; that of this user if it is not given.
    pub state: Option<PathBuf>,
    /// Who may command.
    pub commands: CommandsConfig,
    /// Whether stations may send a geofence.
    pub fence: StationFenceConfig,
}

/// `[commands]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommandsConfig {
    /// Systems that may command; if it is empty, all on this machine and all that sign.
    pub systems: Vec<u8>,
}

/// `[fence]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StationFenceConfig {
    /// Whether a station's fence goes into the configuration of the bridge.
    pub accept: bool,
    /// The file of the bridge's configuration; if absent, the one that the live bridge was started with.
    pub bridge: Option<PathBuf>,
}

runtime::ranged! {
    fn take_off_m(f64) in 0.5..=200.0;
    fn seconds(f64) in 0.1..=600.0;
    // Stations send a heartbeat each second.
    fn station_lost_s(f64) in 2.0..=SILENCE.as_secs_f64();
}

fn system<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u8>, D::Error> {
    in_range(deserializer, 1..=250).map(Some)
}

fn zero_above_sea_m<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    in_range(deserializer, -1000.0..=10_000.0).map(Some)
}

fn stations<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<SocketAddr>, D::Error> {
    let texts = Vec::<String>::deserialize(deserializer)?;
    if texts.len() > MAX_STATIONS {
        let text = format!(
            "{} stations are named, and at most {MAX_STATIONS} may be",
            texts.len()
        );
        return Err(D::Error::custom(text));
    }
    let address = |text: &String| {
        let address = text.parse::<SocketAddr>().ok();
        let is_one = |address: &SocketAddr| address.port() > 0 && is_of_one_machine(address.ip());
        address.filter(is_one).ok_or_else(|| {
            D::Error::custom(format!(
                "`{text}` is no address of a station, such as 127.0.0.1:14550"
            ))
        })
    };
    texts.iter().map(address).collect()
}

/// Whether an address is neither one for many machines nor one for none.
fn is_of_one_machine(address: IpAddr) -> bool {
    let is_broadcast = matches!(address, IpAddr::V4(address) if address.is_broadcast());
    !is_broadcast && !address.is_multicast() && !address.is_unspecified()
}

impl Default for MavlinkConfig {
    fn default() -> Self {
        MavlinkConfig {
            listen: Ipv4Addr::LOCALHOST.into(),
            port: 14_580,
            stations: [14_550, 14_540]
                .map(|port| ([127, 0, 0, 1], port).into())
                .into(),
            system: None,
            zero_above_sea_m: None,
            take_off_m: 10.0,
            lost_s: 2.0,
            answer_s: 1.0,
            station_lost: StationLost::Continue,
            station_lost_s: 10.0,
            key: None,
            insecure: false,
            state: None,
            commands: CommandsConfig::default(),
            fence: StationFenceConfig::default(),
        }
    }
}

/// Reads the configuration, and checks it as a whole.
///
/// # Errors
///
/// Exit code 78 when it is wrong.
pub fn load(explicit: Option<&Path>) -> Result<Loaded<MavlinkConfig>, Failure> {
    let loaded = load_file::<MavlinkConfig>(explicit, Path::new(DEFAULT_FILE))?;
    match loaded.value.check() {
        Ok(()) => Ok(loaded),
        Err(fault) => Err(loaded.refuse(&fault).into()),
    }
}

impl MavlinkConfig {
    /// What no single value shows.
    fn check(&self) -> Result<(), Fault> {
        if self.insecure && self.key.is_some() {
            return Err(Fault::at(
                &["insecure"],
                "`key` is there and `insecure = true`: take one of them out",
            ));
        }
        let is_safe = self.insecure || self.key.is_some();
        if !is_safe && let Some(what) = self.is_open() {
            return Err(Fault::at(
                what,
                "MAVLink is not protected, so without signatures it does not leave this machine: name a file by `key`, or bring the robot \
                 to other machines by `ril relay`; or `insecure = true`",
            ));
        }
        if self.listen.is_multicast() {
            return Err(Fault::at(
                &["listen"],
                "that is an address of many machines",
            ));
        }
        let is_other = |one: &&SocketAddr| one.is_ipv4() != self.listen.is_ipv4();
        if let Some(other) = self.stations.iter().find(is_other) {
            let listen = self.listen;
            let text = format!("{other} cannot be reached from {listen}: one is IPv4, one IPv6");
            return Err(Fault::at(&["stations"], text));
        }
        let is_away = |one: &&SocketAddr| !one.ip().is_loopback() && self.listen.is_loopback();
        if let Some(away) = self.stations.iter().find(is_away) {
            let text = format!(
                "{away} cannot be reached from loopback: set `listen` to this machine's address, or to 0.0.0.0"
            );
            return Err(Fault::at(&["stations"], text));
        }
        Ok(())
    }

    /// Which value lets other machines in; `None` if none does.
    pub fn is_open(&self) -> Option<&'static [&'static str]> {
        if !self.listen.is_loopback() {
            return Some(&["listen"]);
        }
        let is_away = |one: &SocketAddr| !one.ip().is_loopback();
        self.stations.iter().any(is_away).then_some(&["stations"])
    }

    /// Folder of what is kept over restarts; `None` if this user has no home.
    pub fn state_folder(&self) -> Option<PathBuf> {
        let own = || Some(user_files::state_folder()?.join("mavlink"));
        self.state.clone().or_else(own)
    }

    /// The port of `robot`.
    ///
    /// # Errors
    ///
    /// Exit code 78 when there is none.
    pub fn port_of(&self, robot: RobotId) -> Result<u16, Failure> {
        if self.port == 0 {
            return Ok(0);
        }
        let port = u32::from(self.port).saturating_add(robot.get() - 1);
        u16::try_from(port)
            .map_err(|_| wrong(format!("robot {robot} would have port {port}: set `port`")))
    }

    /// What the gateway of `robot` is given.
    ///
    /// # Errors
    ///
    /// Exit code 78 when the robot's number is none of a vehicle, and no other is set.
    pub fn settings(&self, robot: RobotId) -> Result<Settings, Failure> {
        let own = u8::try_from(robot.get())
            .ok()
            .filter(|number| *number <= 250);
        let system = self.system.or(own).ok_or_else(|| {
            wrong(format!(
                "robot {robot} has no number of a vehicle, 1 to 250: set `system`"
            ))
        })?;
        Ok(Settings {
            system,
            stations: self.stations.clone(),
            commanders: self.commands.systems.clone(),
            is_insecure: self.insecure,
            zero_above_sea_m: self.zero_above_sea_m,
            take_off_m: self.take_off_m,
            lost_after: Duration::from_secs_f64(self.lost_s),
            answer_within: Duration::from_secs_f64(self.answer_s),
            station_lost: self.station_lost,
            station_lost_after: Duration::from_secs_f64(self.station_lost_s),
            accepts_fence: self.fence.accept,
        })
    }
}

pub(crate) fn wrong(text: String) -> Failure {
    Failure::new(ExitCode::Configuration, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<MavlinkConfig, runtime::config::ConfigError> {
        runtime::config::parse(text, "mavlink.toml")
    }

    #[test]
    fn the_annotated_example_is_the_defaults() {
        runtime::config::proof::assert_annotated::<MavlinkConfig>(EXAMPLE, &[]);
        for wrong in [
            "prot = 1",
            "system = 251",
            "system = 0",
            "answer_s = 0",
            "station_lost = 'return'",
            "station_lost_s = 31",
            "stations = ['0.0.0.0:14550']",
            "stations = ['255.255.255.255:14550']",
            "stations = ['224.0.0.1:14550']",
            "stations = ['127.0.0.1']",
            "stations = ['127.0.0.1:1', '127.0.0.1:2', '127.0.0.1:3', '127.0.0.1:4', '127.0.0.1:5']",
            "[commands]\nsystems = [300]",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn other_machines_come_in_with_a_key_or_by_name_of_the_danger() {
        let fault = |text: &str| read(text).unwrap().check().err();
        let away = "listen = '0.0.0.0'\nstations = ['192.168.0.7:14550']\n";
        for open in [away, "listen = '10.0.0.1'", "listen = '0.0.0.0'"] {
            let why = fault(open).unwrap();
            assert!(why.reason().contains("not protected"), "{}", why.reason());
            assert!(fault(&format!("insecure = true\n{open}")).is_none());
            assert!(fault(&format!("key = 'mavlink.key'\n{open}")).is_none());
        }
        for wrong in [
            "insecure = true\nkey = 'mavlink.key'",
            "insecure = true\nlisten = '224.0.0.1'",
            "insecure = true\nstations = ['192.168.0.7:14550']",
            "insecure = true\nlisten = '::'\nstations = ['192.168.0.7:14550']",
        ] {
            assert!(fault(wrong).is_some(), "{wrong}");
        }
        assert!(fault("listen = '::1'\nstations = ['[::1]:14550']").is_none());
    }

    #[test]
    fn each_robot_has_its_own_port_and_number() {
        let robot = |number| RobotId::new(number).unwrap();
        let config = MavlinkConfig::default();
        assert_eq!(config.port_of(robot(3)).unwrap(), 14_582);
        assert_eq!(config.settings(robot(250)).unwrap().system, 250);
        assert!(config.settings(robot(251)).is_err() && config.port_of(robot(60_000)).is_err());
        let config = read("port = 0\nsystem = 7").unwrap();
        assert_eq!(config.port_of(robot(60_000)).unwrap(), 0);
        assert_eq!(config.settings(robot(251)).unwrap().system, 7);
    }
}
