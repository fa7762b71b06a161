//! Configuration, `relay.toml`: one file for robots, stations and routers, as it is written.
//!
//! Every value has a default; the annotated example `gateways/relay/relay.toml` shows them all and is tested to parse
//! to them.
//!
//! | file | what is in it |
//! |---|---|
//! | this one | every section but `[topics]`, and which side of the relay has which endpoints |
//! | `topics` | `[topics]`: which samples, how often |
//! | `names` | what is a name, and what is an address of the network |
//! | `check` | what no single value shows, as [`Fault`]s with their lines |

mod check;
mod names;
#[cfg(test)]
mod tests;
mod topics;

use std::collections::BTreeMap;
use std::net::SocketAddrV4;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use runtime::config::Fault;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

pub use names::{Endpoint, MAX_NAME, check_name, is_host_name};
pub use topics::{Priority, TopicPlan, TopicsConfig, check_pattern};

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "relay.toml";

runtime::ranged! {
    fn milliseconds(u64) in 50..=60_000;
    fn open_timeout_ms(u64) in 1000..=60_000;
    fn retry_ms(u64) in 20..=60_000;
    fn buffer_bytes(u32) in 4096..=16_777_216;
    fn deadline_ms(u32) in 100..=86_400_000;
    fn seconds(f64) in 0.5..=86_400.0;
    fn domain_id(u32) in 0..=232;
}

/// All of `relay.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// What both sides have.
    pub network: NetworkConfig,
    /// Certificates.
    pub security: SecurityConfig,
    /// The robot's side.
    pub robot: EndpointsConfig,
    /// The station's side.
    pub station: StationConfig,
    /// A router between them.
    pub router: EndpointsConfig,
    /// Which samples.
    pub topics: TopicsConfig,
    /// Which requests.
    pub commands: CommandsConfig,
    /// ROS 2.
    pub ros2: Ros2Config,
}

impl Config {
    /// The stations that are named, each once, and whether they may command.
    pub fn stations(&self) -> impl Iterator<Item = (&String, bool)> {
        let commanding = &self.commands.stations;
        let watching = self.security.stations.iter();
        let watching = watching.filter(|name| !commanding.contains(name));
        let commanding = commanding.iter().map(|name| (name, true));
        commanding.chain(watching.map(|name| (name, false)))
    }
}

/// Which side a relay is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Beside the robot.
    Robot,
    /// At a ground station.
    Station,
    /// Between robots and stations.
    Router,
}

impl Side {
    /// All sides.
    pub const ALL: [Side; 3] = [Side::Robot, Side::Station, Side::Router];

    /// Endpoints where this side listens, and those it connects to.
    pub fn endpoints(self, config: &Config) -> (&[String], &[String]) {
        match self {
            Side::Robot => (&config.robot.listen, &config.robot.connect),
            Side::Station => (&config.station.listen, &config.station.connect),
            Side::Router => (&config.router.listen, &config.router.connect),
        }
    }

    /// All of them, each with the key that names it.
    pub fn all_endpoints(
        self,
        config: &Config,
    ) -> impl Iterator<Item = (&String, &'static [&'static str])> {
        let (listen, connect) = self.endpoints(config);
        let lists = [listen, connect].into_iter().zip(self.keys());
        lists.flat_map(|(list, keys)| list.iter().map(move |endpoint| (endpoint, keys)))
    }

    /// The keys of the same, those where it listens first.
    pub const fn keys(self) -> [&'static [&'static str]; 2] {
        match self {
            Side::Robot => [&["robot", "listen"], &["robot", "connect"]],
            Side::Station => [&["station", "listen"], &["station", "connect"]],
            Side::Router => [&["router", "listen"], &["router", "connect"]],
        }
    }
}

/// `[network]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkConfig {
    /// Whom a relay connects to.
    pub through: Through,
    /// Whether others are found by multicast.
    pub discovery: bool,
    /// Group and port of the discovery.
    pub multicast: SocketAddrV4,
    /// How long an attempt to connect may take. Within it TCP and QUIC repeat what was lost after one, two and four
    /// seconds.
    #[serde(deserialize_with = "open_timeout_ms")]
    pub open_timeout_ms: u64,
    /// Pause before the second attempt to connect; the later ones are longer.
    #[serde(deserialize_with = "retry_ms")]
    pub retry_ms: u64,
    /// After how long without a byte a connection is closed.
    #[serde(deserialize_with = "milliseconds")]
    pub lease_ms: u64,
    /// Bytes that may wait in a connection over TCP or TLS.
    #[serde(deserialize_with = "buffer_bytes")]
    pub send_buffer_bytes: u32,
    /// After how long without an answer the link is down.
    #[serde(deserialize_with = "milliseconds")]
    pub silent_after_ms: u64,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        NetworkConfig {
            through: Through::Peers,
            discovery: false,
            multicast: SocketAddrV4::new([224, 0, 0, 224].into(), 7446),
            open_timeout_ms: 8000,
            retry_ms: 100,
            lease_ms: 3000,
            send_buffer_bytes: 16_384,
            silent_after_ms: 2500,
        }
    }
}

impl NetworkConfig {
    /// After how long without an answer the link is down.
    pub fn silent_after(&self) -> Duration {
        Duration::from_millis(self.silent_after_ms)
    }
}

/// Whom a relay connects to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Through {
    /// The relay of the other side, directly.
    Peers,
    /// Zenoh routers, as a star.
    Router,
}

/// `[robot]` and `[router]`: where others reach the relay, and where it connects to.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EndpointsConfig {
    /// Endpoints of Zenoh where this relay is reached.
    pub listen: Vec<String>,
    /// Endpoints of Zenoh to connect to.
    pub connect: Vec<String>,
}

impl Default for EndpointsConfig {
    fn default() -> Self {
        EndpointsConfig {
            listen: vec!["tcp/127.0.0.1:7447".to_owned()],
            connect: Vec::new(),
        }
    }
}

/// Most robots of one station's relay: as many as were measured. Each takes some 200 open files, with the nine services
/// of a robot that has no modules of its own, together 12,800: the relay raises its limit of 1,024 to what the system
/// allows, which is 524,288 under systemd. One thread publishes the samples of all; docs/network.md has what that
/// costs.
pub const MAX_ROBOTS: usize = 64;

/// `[station]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StationConfig {
    /// Name of the station; the host's if `None`.
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
    /// Its number on the station's machine; the same if `None`.
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

/// `[security]`: files in PEM, all or none, and whose certificates may do what.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SecurityConfig {
    /// Certificate of the authority that has signed those of all relays.
    pub authority: Option<PathBuf>,
    /// Certificate of this machine.
    pub certificate: Option<PathBuf>,
    /// Its private key.
    pub key: Option<PathBuf>,
    /// Robots, by the common names of their certificates.
    pub robots: BTreeMap<String, NonZeroU32>,
    /// Common names of the certificates of routers.
    pub routers: Vec<String>,
    /// Common names of the certificates of stations that may watch, beside those that may command.
    pub stations: Vec<String>,
    /// Whether requests are taken over connections that are not encrypted, from other machines.
    pub insecure: bool,
}

/// The files of [`SecurityConfig`] when all are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Certificates<'a> {
    /// Certificate of the authority.
    pub authority: &'a PathBuf,
    /// Certificate of this machine.
    pub certificate: &'a PathBuf,
    /// Its private key.
    pub key: &'a PathBuf,
}

impl SecurityConfig {
    /// The three files. `None` if security was not configured.
    ///
    /// # Errors
    ///
    /// When some of the three are missing: what is missing.
    pub fn certificates(&self) -> Result<Option<Certificates<'_>>, Fault> {
        match (&self.authority, &self.certificate, &self.key) {
            (None, None, None) => Ok(None),
            (Some(authority), Some(certificate), Some(key)) => Ok(Some(Certificates {
                authority,
                certificate,
                key,
            })),
            _ => Err(Fault::at(
                &["security"],
                "`[security]` needs all of `authority`, `certificate` and `key`, or none of them",
            )),
        }
    }
}

/// `[commands]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommandsConfig {
    /// Names of the stations that may command.
    pub stations: Vec<String>,
    /// Deadline of a request that says neither when it was issued nor until when it may begin, ms.
    #[serde(deserialize_with = "deadline_ms")]
    pub deadline_ms: u32,
    /// After how long without any word about it a request ends as unknown, s.
    #[serde(deserialize_with = "seconds")]
    pub unknown_after_s: f64,
    /// What happens to a movement when the station that ordered it is lost.
    pub link_loss: LinkLoss,
    /// When a station counts as lost, s.
    #[serde(deserialize_with = "seconds")]
    pub link_loss_s: f64,
}

impl Default for CommandsConfig {
    fn default() -> Self {
        CommandsConfig {
            stations: Vec::new(),
            deadline_ms: 5000,
            unknown_after_s: 60.0,
            link_loss: LinkLoss::Continue,
            link_loss_s: 10.0,
        }
    }
}

impl CommandsConfig {
    /// Deadline of a request that says neither when it was issued nor until when it may begin.
    pub fn deadline(&self) -> Duration {
        Duration::from_millis(self.deadline_ms.into())
    }

    /// After how long without any word about it a request ends as unknown.
    pub fn unknown_after(&self) -> Duration {
        Duration::from_secs_f64(self.unknown_after_s)
    }

    /// After how long a station that is silent counts as lost. `None` if that changes nothing.
    pub fn lost_after(&self) -> Option<Duration> {
        match self.link_loss {
            LinkLoss::Continue => None,
            LinkLoss::Hold | LinkLoss::Land => Some(Duration::from_secs_f64(self.link_loss_s)),
        }
    }
}

/// What happens to a movement when the station that ordered it is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LinkLoss {
    /// It goes on to its end, as when a program on the robot dies that ordered it.
    Continue,
    /// The helicopter hovers.
    Hold,
    /// It lands.
    Land,
}

/// `[ros2]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ros2Config {
    /// Whether the topics are there in the form of ROS 2 too.
    pub enabled: bool,
    /// `ROS_DOMAIN_ID`.
    #[serde(deserialize_with = "domain_id")]
    pub domain_id: u32,
    /// Whether standard messages are made of `hero_telemetry`.
    pub standard_messages: bool,
}

impl Default for Ros2Config {
    fn default() -> Self {
        Ros2Config {
            enabled: false,
            domain_id: 0,
            standard_messages: true,
        }
    }
}
