//! `[station]`: a ground station, and its robots.

use std::num::NonZeroU32;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use super::name::check_name;

/// Most robots of one station's relay. Each takes some 210 open files, as was counted with the nine services of a robot that has no
/// modules of its own, together 6,720: the relay raises its limit of 1,024 to what the system allows, which is 524,288 under
/// systemd. One thread publishes the samples of all.
pub const MAX_ROBOTS: usize = 32;

/// `[station]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StationConfig {
    /// Name of the station; the host's when there is none.
    #[serde(deserialize_with = "name")]
    pub name: Option<String>,
    /// Endpoints of Zenoh where this relay is reached.
    pub listen: Vec<String>,
    /// Endpoints of Zenoh to connect to.
    pub connect: Vec<String>,
    /// Which robots; the one of `--robot` when there are none.
    #[serde(deserialize_with = "robots")]
    pub robots: Vec<RemoteRobot>,
}

impl Default for StationConfig {
    fn default() -> Self {
        StationConfig {
            name: None,
            listen: Vec::new(),
            connect: vec!["tcp/127.0.0.1:7447".to_owned()],
            robots: Vec::new(),
        }
    }
}

/// A robot of a station.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RemoteRobot {
    /// Its number on its own machine.
    pub number: NonZeroU32,
    /// Its number on the station's machine; the same when there is none.
    #[serde(default)]
    pub here: Option<NonZeroU32>,
    /// Whether its request services are there on the station's machine.
    #[serde(default = "yes")]
    pub command: bool,
}

impl RemoteRobot {
    /// The robot of this number, under the same number here.
    pub fn of(number: NonZeroU32) -> RemoteRobot {
        RemoteRobot {
            number,
            here: None,
            command: true,
        }
    }

    /// Its number on the station's machine.
    pub fn here(&self) -> NonZeroU32 {
        self.here.unwrap_or(self.number)
    }
}

const fn yes() -> bool {
    true
}

fn name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let name = String::deserialize(deserializer)?;
    check_name(&name).map_err(D::Error::custom)?;
    Ok(Some(name))
}

fn robots<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<RemoteRobot>, D::Error> {
    let robots = Vec::<RemoteRobot>::deserialize(deserializer)?;
    if robots.len() > MAX_ROBOTS {
        return Err(D::Error::custom(format_args!(
            "there are {} robots; one relay carries at most {MAX_ROBOTS}, start another one for the rest",
            robots.len()
        )));
    }
    for (index, robot) in robots.iter().enumerate() {
        if robots[..index]
            .iter()
            .any(|other| other.here() == robot.here())
        {
            return Err(D::Error::custom(format_args!(
                "two robots have the number {} on this machine: give one of them another by `here`",
                robot.here()
            )));
        }
    }
    Ok(robots)
}
