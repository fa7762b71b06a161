//! Configuration of `ril run mavlink`, `mavlink.toml`.
//!
//! Every value has a default; the annotated example `ril/mavlink.toml` shows them all and is tested to parse to them.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use ipc_types::RobotId;
use mavlink_gateway::Settings;
use runtime::config::in_range;
use runtime::exit::{ExitCode, Failure};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "mavlink.toml";

/// The annotated example.
pub(super) const EXAMPLE: &str = include_str!("../../../mavlink.toml");

/// Most stations that are sent a heartbeat unasked.
const MAX_STATIONS: usize = 4;

/// All of `mavlink.toml`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MavlinkConfig {
    /// Port on loopback of robot 1; 0 for a free one.
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
    /// Folder of what is kept over restarts; that of this user if it is not given.
    pub state: Option<PathBuf>,
    /// Who may command.
    pub commands: CommandsConfig,
}

/// `[commands]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommandsConfig {
    /// Systems that may command; all if it is empty.
    pub systems: Vec<u8>,
}

runtime::ranged! {
    fn take_off_m(f64) in 0.5..=200.0;
    fn seconds(f64) in 0.1..=600.0;
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
        let is_local = |address: &SocketAddr| address.is_ipv4() && address.ip().is_loopback();
        address.filter(is_local).filter(|address| address.port() > 0).ok_or_else(|| {
            D::Error::custom(format!(
                "`{text}` is no address on loopback, such as 127.0.0.1:14550: MAVLink is not protected, so it does not leave this \
                 machine; `ril relay` brings robots to others"
            ))
        })
    };
    texts.iter().map(address).collect()
}

impl Default for MavlinkConfig {
    fn default() -> Self {
        MavlinkConfig {
            port: 14_580,
            stations: [14_550, 14_540]
                .map(|port| ([127, 0, 0, 1], port).into())
                .into(),
            system: None,
            zero_above_sea_m: None,
            take_off_m: 10.0,
            lost_s: 2.0,
            answer_s: 1.0,
            state: None,
            commands: CommandsConfig::default(),
        }
    }
}

impl MavlinkConfig {
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

    /// Folder of what is kept over restarts; `None` if this user has no home.
    pub fn state_folder(&self) -> Option<PathBuf> {
        let folder = |name| std::env::var_os(name).filter(|path| !path.is_empty());
        let of_user = || {
            let state = folder("XDG_STATE_HOME").map(PathBuf::from);
            state.or_else(|| Some(PathBuf::from(folder("HOME")?).join(".local/state")))
        };
        let own = || of_user().map(|state| state.join("ril/mavlink"));
        self.state.clone().or_else(own)
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
            zero_above_sea_m: self.zero_above_sea_m,
            take_off_m: self.take_off_m,
            lost_after: Duration::from_secs_f64(self.lost_s),
            answer_within: Duration::from_secs_f64(self.answer_s),
        })
    }
}

fn wrong(text: String) -> Failure {
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
        assert_eq!(read(EXAMPLE).unwrap(), MavlinkConfig::default());
        for wrong in [
            "prot = 1",
            "system = 251",
            "system = 0",
            "answer_s = 0",
            "stations = ['192.168.0.7:14550']",
            "stations = ['0.0.0.0:14550']",
            "stations = ['127.0.0.1']",
            "stations = ['127.0.0.1:1', '127.0.0.1:2', '127.0.0.1:3', '127.0.0.1:4', '127.0.0.1:5']",
            "[commands]\nsystems = [300]",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
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
