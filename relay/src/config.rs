//! Configuration, `relay.toml`: one file for robots and stations.
//!
//! Every value has a default; the annotated example `relay/relay.toml` shows them all and is tested to parse to them.

use std::net::SocketAddrV4;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// The file that is read when none is named; it may be absent.
pub const DEFAULT_FILE: &str = "relay.toml";

/// Longest name of a station, bytes: it is shown in a field of 32 that ends with a zero.
pub const MAX_NAME: usize = 31;

/// Most robots of one station's relay. Each has about ten services of some 22 open files, together 7,040: the relay raises its limit
/// of 1,024 to what the system allows, which is 524,288 under systemd. One thread publishes the samples of all.
pub const MAX_ROBOTS: usize = 32;

/// All of `relay.toml`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// What both sides have.
    pub network: NetworkConfig,
    /// Certificates.
    pub security: SecurityConfig,
    /// The robot's side.
    pub robot: RobotConfig,
    /// The station's side.
    pub station: StationConfig,
    /// A router between them.
    pub router: RouterConfig,
    /// Which samples.
    pub topics: TopicsConfig,
    /// Which requests.
    pub commands: CommandsConfig,
    /// ROS 2.
    pub ros2: Ros2Config,
}

runtime::ranged! {
    fn milliseconds(u64) in 50..=60_000;
    fn retry_ms(u64) in 20..=60_000;
    fn buffer_bytes(u32) in 4096..=16_777_216;
    fn rate_hz(f64) in 0.0..=10_000.0;
    fn deadline_ms(u32) in 100..=86_400_000;
    fn seconds(f64) in 0.5..=86_400.0;
    fn domain_id(u32) in 0..=232;
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
    /// How long an attempt to connect may take.
    #[serde(deserialize_with = "milliseconds")]
    pub open_timeout_ms: u64,
    /// Pause between two attempts.
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
            open_timeout_ms: 1000,
            retry_ms: 250,
            lease_ms: 3000,
            send_buffer_bytes: 65_536,
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
    /// The other side.
    Peers,
    /// Zenoh routers, as a star.
    Router,
}

/// `[security]`: files in PEM. All or none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SecurityConfig {
    /// Certificate of the authority that has signed those of all relays.
    pub authority: Option<PathBuf>,
    /// Certificate of this machine.
    pub certificate: Option<PathBuf>,
    /// Its private key.
    pub key: Option<PathBuf>,
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
    /// The three files; nothing when security was not configured.
    ///
    /// # Errors
    ///
    /// When some of the three are missing: what is missing.
    pub fn certificates(&self) -> Result<Option<Certificates<'_>>, String> {
        match (&self.authority, &self.certificate, &self.key) {
            (None, None, None) => Ok(None),
            (Some(authority), Some(certificate), Some(key)) => Ok(Some(Certificates {
                authority,
                certificate,
                key,
            })),
            _ => Err(
                "`[security]` needs all of `authority`, `certificate` and `key`, or none of them"
                    .to_owned(),
            ),
        }
    }
}

/// `[robot]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotConfig {
    /// Endpoints of Zenoh where this relay is reached.
    pub listen: Vec<String>,
    /// Endpoints of Zenoh to connect to.
    pub connect: Vec<String>,
}

impl Default for RobotConfig {
    fn default() -> Self {
        RobotConfig {
            listen: vec!["tcp/127.0.0.1:7447".to_owned()],
            connect: Vec::new(),
        }
    }
}

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

/// `[router]`
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RouterConfig {
    /// Endpoints of Zenoh where robots and stations reach it.
    pub listen: Vec<String>,
    /// Endpoints of other routers.
    pub connect: Vec<String>,
}

impl Default for RouterConfig {
    fn default() -> Self {
        RouterConfig {
            listen: vec!["tcp/127.0.0.1:7447".to_owned()],
            connect: Vec::new(),
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

/// `[topics]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TopicsConfig {
    /// Keys of the topics that are relayed.
    pub include: Vec<String>,
    /// Keys of those that are not.
    pub exclude: Vec<String>,
    /// At most so many samples a second of each topic; 0 sends all.
    #[serde(deserialize_with = "rate_hz")]
    pub rate_hz: f64,
    /// Which samples go first when the link is too slow for all.
    pub priority: Priority,
    /// Other rates and priorities.
    pub rules: Vec<Rule>,
}

impl Default for TopicsConfig {
    fn default() -> Self {
        TopicsConfig {
            include: vec!["*".to_owned()],
            exclude: Vec::new(),
            rate_hz: 0.0,
            priority: Priority::Data,
            rules: Vec::new(),
        }
    }
}

/// Rate and priority of some topics.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// Keys of the topics.
    pub key: String,
    /// At most so many samples a second; that of `[topics]` when there is none.
    #[serde(default, deserialize_with = "some_rate_hz")]
    pub rate_hz: Option<f64>,
    /// That of `[topics]` when there is none.
    #[serde(default)]
    pub priority: Option<Priority>,
}

/// Which samples go first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Priority {
    /// Before all others.
    RealTime,
    /// Before the usual ones.
    High,
    /// The usual one.
    Data,
    /// After the usual ones.
    Low,
    /// When nothing else is to be sent.
    Background,
}

/// How one topic is relayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TopicPlan {
    /// Shortest time between two samples; nothing sends all.
    pub period: Option<Duration>,
    /// Which go first.
    pub priority: Priority,
}

impl TopicsConfig {
    /// How the topic `key` is relayed; nothing when it is not.
    ///
    /// The relay's own topics never are: each machine has its own.
    pub fn plan(&self, key: &str) -> Option<TopicPlan> {
        let is_in = |keys: &[String]| keys.iter().any(|pattern| fits(pattern, key));
        if key.starts_with("relay/") || !is_in(&self.include) || is_in(&self.exclude) {
            return None;
        }
        let rule = self.rules.iter().find(|rule| fits(&rule.key, key));
        let rate_hz = rule.and_then(|rule| rule.rate_hz).unwrap_or(self.rate_hz);
        Some(TopicPlan {
            period: (rate_hz > 0.0).then(|| Duration::from_secs_f64(1.0 / rate_hz)),
            priority: rule.and_then(|rule| rule.priority).unwrap_or(self.priority),
        })
    }
}

/// Whether a key fits a pattern, in which `*` at the end stands for anything.
fn fits(pattern: &str, key: &str) -> bool {
    match pattern.strip_suffix('*') {
        Some(begin) => key.starts_with(begin),
        None => key == pattern,
    }
}

/// `[commands]`
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CommandsConfig {
    /// Names of the stations that may command.
    pub stations: Vec<String>,
    /// Deadline of a request that has none of its own, ms.
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
    /// Deadline of a request that has none of its own.
    pub fn deadline(&self) -> Duration {
        Duration::from_millis(self.deadline_ms.into())
    }

    /// After how long without any word about it a request ends as unknown.
    pub fn unknown_after(&self) -> Duration {
        Duration::from_secs_f64(self.unknown_after_s)
    }

    /// After how long a station that is silent counts as lost; nothing when this changes nothing.
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

impl Config {
    /// What no single value shows.
    ///
    /// # Errors
    ///
    /// What is wrong, and what to do about it.
    pub fn check(&self) -> Result<(), String> {
        let is_secured = self.security.certificates()?.is_some();
        let endpoints = [
            &self.robot.listen,
            &self.robot.connect,
            &self.station.listen,
            &self.station.connect,
            &self.router.listen,
            &self.router.connect,
        ];
        for endpoint in endpoints.into_iter().flatten() {
            check_endpoint(endpoint, is_secured)?;
        }
        for name in &self.commands.stations {
            check_name(name)?;
        }
        Ok(())
    }
}

/// Protocols of an endpoint, and whether they are encrypted.
const PROTOCOLS: [(&str, bool); 4] = [
    ("tcp", false),
    ("udp", false),
    ("tls", true),
    ("quic", true),
];

fn check_endpoint(endpoint: &str, is_secured: bool) -> Result<(), String> {
    let (protocol, address) = endpoint.split_once('/').unwrap_or((endpoint, ""));
    let known = PROTOCOLS.iter().find(|(name, _)| *name == protocol);
    let Some((_, is_encrypted)) = known.filter(|_| address.contains(':')) else {
        return Err(format!(
            "`{endpoint}` is no endpoint: write tcp/, udp/, tls/ or quic/, then address and port, such as tcp/10.0.0.2:7447"
        ));
    };
    if *is_encrypted && !is_secured {
        return Err(format!(
            "`{endpoint}` is encrypted, which takes certificates: name them in `[security]`, or let `ril relay certify` make them"
        ));
    }
    Ok(())
}

/// Whether this can be the name of a station.
///
/// # Errors
///
/// What is wrong with it.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_letter = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    if name.is_empty() || name.len() > MAX_NAME || !name.bytes().all(is_letter) {
        return Err(format!(
            "`{name}` is no name of a station: use 1 to {MAX_NAME} letters, digits, - and _"
        ));
    }
    Ok(())
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

fn some_rate_hz<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    rate_hz(deserializer).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Config, String> {
        runtime::config::parse(text, "relay.toml").map_err(|error| error.to_string())
    }

    #[test]
    fn the_annotated_example_has_the_defaults() {
        assert_eq!(
            parse(include_str!("../relay.toml")).unwrap(),
            Config::default()
        );
        assert_eq!(Config::default().check(), Ok(()));
    }

    #[test]
    fn rules_and_patterns_choose_what_is_relayed() {
        let config = parse(
            "[topics]\nexclude = [\"camera/*\"]\nrate_hz = 10\n\
             rules = [{ key = \"dsp*\", rate_hz = 0 }, { key = \"*\", priority = \"low\" }]\n",
        )
        .unwrap();
        let plan = |key| config.topics.plan(key);
        assert_eq!(plan("camera/picture"), None);
        assert_eq!(plan("relay/link"), None);
        let raw = plan("dsp_telemetry").unwrap();
        assert_eq!((raw.period, raw.priority), (None, Priority::Data));
        let other = plan("hero_telemetry").unwrap();
        assert_eq!(other.period, Some(Duration::from_millis(100)));
        assert_eq!(other.priority, Priority::Low);
    }

    #[test]
    fn what_cannot_be_is_refused_with_the_next_step() {
        for (text, excerpt) in [
            ("[network]\nlease_ms = 1\n", "relay.toml:2"),
            ("[commands]\nstations = \"all\"\n", "relay.toml:2"),
            ("[commands]\nlink_loss = \"crash\"\n", "relay.toml:2"),
            ("[station]\nname = \"a b\"\n", "no name of a station"),
            (
                "[station]\nrobots = [{ number = 1 }, { number = 2, here = 1 }]\n",
                "by `here`",
            ),
            ("[radio]\n", "relay.toml:1"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(excerpt), "{error}");
        }
        for (text, excerpt) in [
            ("[robot]\nlisten = [\"7447\"]\n", "is no endpoint"),
            (
                "[robot]\nlisten = [\"tls/0.0.0.0:7447\"]\n",
                "takes certificates",
            ),
            ("[security]\nkey = \"key.pem\"\n", "needs all of"),
            ("[commands]\nstations = [\"a/b\"]\n", "no name of a station"),
        ] {
            let error = parse(text).unwrap().check().unwrap_err();
            assert!(error.contains(excerpt), "{error}");
        }
    }
}
