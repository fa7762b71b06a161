//! How an operator's command begins: its configuration, the robot that it is for, its part in that robot's shared
//! memory, and its one wait.
//!
//! A command that moves a helicopter does not guess which robot is meant when several are alive. A robot is alive when
//! a process serves its movements, which is its bridge. The default stays robot 1 also when the only robot that is
//! alive is another one: a robot that was not named is never commanded in place of the default.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::io;
use std::os::fd::AsFd;
use std::path::Path;
use std::rc::Rc;
use std::sync::OnceLock;
use std::time::Duration;

use ipc_types::payload::{
    DspTelemetry, HeroTelemetry, ModuleState, MovementData, RelayLink, RelayStations,
};
use ipc_types::service::{ServiceId, own};
use ipc_types::{
    Descriptor, Domain, DomainError, Ipc, Module, MonotonicNs, Provider, RelayModule, Request,
    RobotId, SchedulingRole, Source, Subscriber, Topic, Waiter, allow_many_files, request_slice,
};
use runtime::args::CommonArgs;
use runtime::config::ConfigError;
use runtime::config::resulting::{Origin, Resulting, given};
use runtime::duration;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::Termination;

use crate::config::{Config, DEFAULT_FILE};
use crate::options::{AskArgs, SampleArgs, wants_json};
use crate::render::{json_line, note};

/// Most users that are named who have a domain.
const MAX_NAMED: usize = 4;

/// How long an order waits for its configuration: no disk that works takes so long, and no operator notices it.
const READ_LIMIT: Duration = Duration::from_millis(300);

/// How long a command that shows something does.
const SHOWN_LIMIT: Duration = Duration::from_secs(1);

/// Begins logging and reads the configuration. On a disk that hangs the command goes on with the built-in values.
///
/// # Errors
///
/// Code 78 when it is wrong; the quiet end when it was only to be checked, after it was printed.
pub fn configuration(common: &CommonArgs) -> Result<Config, Failure> {
    begin(common)?;
    Ok(configuration_or_built_in(
        "the command",
        common,
        SHOWN_LIMIT,
    )?)
}

/// Begins logging, and prints the configuration if that is all that was asked for. Reads nothing else.
fn begin(common: &CommonArgs) -> Result<(), Failure> {
    runtime::logging::init(common.verbosity())?;
    match common.settings.check_config {
        false => Ok(()),
        true => {
            print_configuration("ril", &resulting(common)?)?;
            Err(Failure::quiet_end())
        }
    }
}

fn configuration_within(common: &CommonArgs, limit: Duration) -> Result<Config, ConfigError> {
    let (file, default) = (common.settings.config.as_deref(), Path::new(DEFAULT_FILE));
    let loaded = runtime::config::load_within::<Config>(file, default, limit)?;
    tracing::debug!(file = ?loaded.file, config = ?loaded.value, "configuration");
    Ok(loaded.value)
}

/// The configuration, or the built-in values when the disk does not give it in time: `what` goes on with them.
fn configuration_or_built_in(
    what: &str,
    common: &CommonArgs,
    limit: Duration,
) -> Result<Config, ConfigError> {
    match configuration_within(common, limit) {
        Err(error @ ConfigError::NotInTime { .. }) => Ok(without_configuration(what, &error)),
        read => read,
    }
}

/// The built-in values in the place of a configuration, with a warning that says why.
fn without_configuration(what: &str, error: &ConfigError) -> Config {
    let chain = Failure::new(ExitCode::Configuration, error.to_string());
    note(format_args!(
        "warning: {}; {what} goes on with the built-in values",
        chain.chain().join(": ")
    ));
    Config::default()
}

/// What the operator's commands run with.
fn resulting(common: &CommonArgs) -> Result<Resulting, Failure> {
    let (file, default) = (common.settings.config.as_deref(), Path::new(DEFAULT_FILE));
    let resulting = Resulting::load::<Config>(file, default, include_str!("../ril.toml"))?;
    let timeout = given("--timeout", "RIL_TIMEOUT");
    let deadline = given("--deadline", "RIL_DEADLINE");
    let timeout = in_unit(timeout, |time| time.as_secs_f64().into());
    let deadline = in_unit(deadline, |time| (time.as_millis() as i64).into());
    Ok(resulting
        .with("request.timeout_s", timeout.clone())
        .with("request.deadline_ms", deadline)
        .with("observe.timeout_s", timeout))
}

/// A duration that was given, in the unit that the key of the configuration names.
fn in_unit<V>(
    given: Option<(OsString, Origin)>,
    unit: impl FnOnce(Duration) -> V,
) -> Option<(V, Origin)> {
    let (text, origin) = given?;
    let read = |text: &OsStr| duration::parse(text.to_str()?).ok();
    Some((unit(read(&text)?), origin))
}

/// Prints the configuration of a process, or of the operator's commands, as text or as JSON.
pub fn print_configuration(of: &str, resulting: &Resulting) -> Result<(), Failure> {
    let args: Vec<OsString> = std::env::args_os().collect();
    match wants_json(&args) {
        true => json_line(&mut io::stdout().lock(), &resulting.object(of)),
        false => resulting.print(),
    }
}

/// The command's part in the robot's shared memory, and its one wait.
pub struct Session {
    /// Its ports are opened here.
    pub ipc: Ipc,
    waiter: Waiter,
    /// SIGINT and SIGTERM.
    pub termination: Rc<Termination>,
}

impl Session {
    /// Takes part. Signals no longer end the process by themselves from here on.
    pub fn join(common: &CommonArgs) -> Result<Session, Failure> {
        let termination = Termination::install().or_fail(ExitCode::Internal)?;
        request_slice(SchedulingRole::Consumer);
        Session::of(common.robot().into(), Rc::new(termination))
    }

    /// Takes part to show samples, for which it waits this long.
    pub fn for_samples(args: &SampleArgs) -> Result<(Session, Duration), Failure> {
        let config = configuration(&args.common)?;
        let timeout = args.timeout.unwrap_or_else(|| config.observe.timeout());
        Ok((Session::join(&args.common)?, timeout))
    }

    /// Takes part in the shared memory of each of these robots, however many they are.
    pub fn join_each(robots: impl IntoIterator<Item = RobotId>) -> Result<Vec<Session>, Failure> {
        allow_many_files();
        let termination = Rc::new(Termination::install().or_fail(ExitCode::Internal)?);
        request_slice(SchedulingRole::Consumer);
        let join = |robot| Session::of(robot, Rc::clone(&termination));
        robots.into_iter().map(join).collect()
    }

    /// Takes part in the shared memory of another robot as well.
    pub fn beside(&self, robot: RobotId) -> Result<Session, Failure> {
        Session::of(robot, Rc::clone(&self.termination))
    }

    fn of(robot: RobotId, termination: Rc<Termination>) -> Result<Session, Failure> {
        let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
        Ok(Session {
            ipc: Ipc::join(&domain, robot, "ril").or_fail(ExitCode::Internal)?,
            waiter: Waiter::new(),
            termination,
        })
    }

    /// Sleeps until a source has something, a signal comes or it is `until`; `None` is no limit.
    pub fn wait<'a>(
        &self,
        others: impl IntoIterator<Item = &'a mut dyn Source>,
        until: Option<MonotonicNs>,
    ) -> Result<(), Failure> {
        let mut signals = Descriptor::new(self.termination.as_fd());
        let mut sources: Vec<((), &mut dyn Source)> = vec![((), &mut signals)];
        for other in others {
            sources.push(((), other));
        }
        let timeout = until.map(|until| until.since(MonotonicNs::now()));
        let woken = self.waiter.wait_for_any(&mut sources, timeout);
        woken.or_fail(ExitCode::Internal).map(drop)
    }

    /// Takes what comes of `topics` until it is enough, or `give_up`, or a signal comes; says whether it was enough.
    pub fn gather<T: Topics>(
        &self,
        topics: &mut T,
        give_up: MonotonicNs,
        mut is_enough: impl FnMut(&mut T, MonotonicNs) -> Result<bool, Failure>,
    ) -> Result<bool, Failure> {
        loop {
            topics.drain();
            let now = MonotonicNs::now();
            if is_enough(topics, now)? {
                return Ok(true);
            }
            if now >= give_up || self.termination.requested() {
                return Ok(false);
            }
            self.wait(topics.ports(), Some(give_up))?;
        }
    }

    /// The live process that provides the service `key`.
    pub fn provider(&self, key: &str) -> Result<Option<Provider>, Failure> {
        self.ipc.provider(key).or_fail(ExitCode::Internal)
    }

    /// Whether a live process provides the service `key`.
    pub fn is_provided(&self, key: &str) -> Result<bool, Failure> {
        Ok(self.provider(key)?.is_some())
    }

    /// Whether the service `key`, which `provider` provides, comes from another machine. A station shows the stations
    /// of the robot's relay, and has a link itself.
    pub fn is_relayed(&self, key: &str, provider: &Provider) -> Result<bool, Failure> {
        let may_be_station = key == RelayStations::KEY && provider.process == RelayModule::NAME;
        Ok(is_relayed(key, provider) || may_be_station && self.is_provided(RelayLink::KEY)?)
    }
}

/// Whether a topic other than `relay/stations`, which a robot's machine and a station's both have, comes from another
/// machine. The relay's own do not.
pub fn is_relayed(key: &str, provider: &Provider) -> bool {
    let is_own = key.split('/').next() == Some(RelayModule::NAME);
    provider.process == RelayModule::NAME && !is_own
}

/// The process that provides the service `key`; `None` if that is a module outside the RIL.
pub fn process_of(key: &str) -> Option<&'static str> {
    own(key).map(ServiceId::provider)
}

/// When the operator gave the command: the first call is at the beginning of the process, and later ones say the same.
pub fn began() -> MonotonicNs {
    static BEGAN: OnceLock<MonotonicNs> = OnceLock::new();
    *BEGAN.get_or_init(MonotonicNs::now)
}

/// What becomes of a command whose configuration is not read in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unread {
    /// It goes on with the built-in values, with a warning.
    LeftOut,
    /// It ends with code 78: what it does depends on values of the file.
    Refused,
}

/// What a command has that asks the bridge for something.
pub struct OrderContext {
    /// Where it takes part.
    pub session: Session,
    /// When the operator gave the command, however long it takes until its request goes out.
    pub issued: MonotonicNs,
    /// The file `ril.toml`.
    pub config: Config,
    /// How long the bridge has for its first answer.
    pub timeout: Duration,
    /// Until how long after its issue a request may begin; 0 leaves it to the bridge.
    pub deadline_ms: u32,
}

impl OrderContext {
    /// Of a command that changes something, which must not guess the robot.
    pub fn of(ask: &AskArgs) -> Result<OrderContext, Failure> {
        OrderContext::with(ask, Unread::LeftOut)
    }

    /// Of a command that changes something; says what becomes of it when its configuration is not read in time.
    pub fn with(ask: &AskArgs, unread: Unread) -> Result<OrderContext, Failure> {
        begin(&ask.common)?;
        let config = match unread {
            Unread::LeftOut => configuration_or_built_in("the order", &ask.common, READ_LIMIT),
            Unread::Refused => configuration_within(&ask.common, READ_LIMIT),
        }?;
        refuse_to_guess(&ask.common)?;
        OrderContext::new(ask, config)
    }

    /// Of a command that changes nothing.
    pub fn of_reader(ask: &AskArgs) -> Result<OrderContext, Failure> {
        OrderContext::new(ask, configuration(&ask.common)?)
    }

    fn new(ask: &AskArgs, config: Config) -> Result<OrderContext, Failure> {
        Ok(OrderContext {
            session: Session::join(&ask.common)?,
            issued: began(),
            timeout: ask.timeout.unwrap_or_else(|| config.request.timeout()),
            deadline_ms: ask.deadline.unwrap_or(config.request.deadline_ms),
            config,
        })
    }
}

/// What a command has whose order goes out before its configuration is read: one that makes the helicopter safer is not
/// kept by a disk.
pub struct UrgentContext<'a> {
    ask: &'a AskArgs,
    /// Where it takes part.
    pub session: Session,
    /// When the operator gave the command.
    pub issued: MonotonicNs,
}

impl<'a> UrgentContext<'a> {
    /// Of a command for one robot, which must not guess it.
    pub fn of(ask: &'a AskArgs) -> Result<UrgentContext<'a>, Failure> {
        begin(&ask.common)?;
        refuse_to_guess(&ask.common)?;
        UrgentContext::join(ask)
    }

    /// Of a command for all robots.
    pub fn of_all(ask: &'a AskArgs) -> Result<UrgentContext<'a>, Failure> {
        begin(&ask.common)?;
        allow_many_files();
        UrgentContext::join(ask)
    }

    fn join(ask: &'a AskArgs) -> Result<UrgentContext<'a>, Failure> {
        Ok(UrgentContext {
            ask,
            session: Session::join(&ask.common)?,
            issued: began(),
        })
    }

    /// Until how long after its issue the order may begin, as command line or environment say; 0 leaves it to the
    /// bridge.
    pub fn deadline_ms(&self) -> u32 {
        self.ask.deadline.unwrap_or_default()
    }

    /// How long the bridge has for its first answer. To be called when the order is out: the configuration may say it,
    /// and what is wrong with that is a warning now.
    pub fn timeout(&self) -> Duration {
        let read = || match configuration_within(&self.ask.common, READ_LIMIT) {
            Ok(config) => config,
            Err(error) => without_configuration("the order", &error),
        };
        let given = self.ask.timeout;
        given.unwrap_or_else(|| read().request.timeout())
    }
}

/// The newest sample of a topic, and the port it comes from.
pub struct Latest<T: Topic> {
    /// What to wait for.
    pub port: Subscriber<T>,
    /// `None` before the first one.
    pub sample: Option<T>,
}

impl<T: Topic> Latest<T> {
    /// Subscribes to the topic.
    pub fn open(ipc: &Ipc) -> Result<Latest<T>, Failure> {
        Ok(Latest {
            port: ipc.subscriber().or_fail(ExitCode::Internal)?,
            sample: None,
        })
    }

    /// Subscribes to the topic; `None` if no process provides it.
    pub fn open_if_provided(session: &Session) -> Result<Option<Latest<T>>, Failure> {
        match session.is_provided(T::KEY)? {
            true => Latest::open(&session.ipc).map(Some),
            false => Ok(None),
        }
    }
}

/// Topics of which the newest samples are gathered.
pub trait Topics {
    /// What to wait for.
    fn ports(&mut self) -> Vec<&mut dyn Source>;

    /// Takes what came.
    fn drain(&mut self);
}

impl<T: Topic> Topics for Latest<T> {
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        vec![&mut self.port]
    }

    fn drain(&mut self) {
        match self.port.latest() {
            Ok(Some(sample)) => self.sample = Some(sample),
            Ok(None) => {}
            Err(error) => tracing::warn!(%error, "samples could not be received"),
        }
    }
}

impl<A: Topics> Topics for Option<A> {
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        self.as_mut().map(A::ports).unwrap_or_default()
    }

    fn drain(&mut self) {
        self.as_mut().map(A::drain);
    }
}

impl<A: Topics> Topics for Vec<A> {
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        self.iter_mut().flat_map(A::ports).collect()
    }

    fn drain(&mut self) {
        self.iter_mut().for_each(A::drain);
    }
}

impl<A: Topics, B: Topics> Topics for (A, B) {
    fn ports(&mut self) -> Vec<&mut dyn Source> {
        let mut ports = self.0.ports();
        ports.extend(self.1.ports());
        ports
    }

    fn drain(&mut self) {
        self.0.drain();
        self.1.drain();
    }
}

/// The robots of which a bridge, a status or a relay lives, in ascending order.
///
/// # Errors
///
/// When the domain's folder cannot be read.
pub fn alive(domain: &Domain) -> Result<Vec<RobotId>, DomainError> {
    let mut robots = BTreeSet::new();
    for key in [
        MovementData::KEY,
        ModuleState::KEY,
        DspTelemetry::KEY,
        HeroTelemetry::KEY,
    ] {
        robots.extend(domain.robots(key)?);
    }
    Ok(robots.into_iter().collect())
}

/// The robots that take movements, in ascending order: a bridge of theirs lives, here or beyond a relay.
///
/// # Errors
///
/// When the domain's folder cannot be read.
pub fn commandable(domain: &Domain) -> Result<Vec<RobotId>, DomainError> {
    domain.robots(MovementData::KEY)
}

/// Refuses the default robot, when none was named and several are alive.
///
/// # Errors
///
/// Code 2 with the robots that are alive; code 1 or 78 when the domain cannot be read.
fn refuse_to_guess(common: &CommonArgs) -> Result<(), Failure> {
    if common.robot.is_some() {
        return Ok(());
    }
    match ambiguity(&commandable_here()?) {
        Some(text) => {
            Err(Failure::usage(text).with_next_step("say which one with --robot N or RIL_ROBOT"))
        }
        None => Ok(()),
    }
}

/// Which other robots could be meant when the one that was asked for does not answer; empty when there is none.
pub fn others_alive(robot: RobotId) -> String {
    let mut others = commandable_here().unwrap_or_default();
    others.retain(|other| *other != robot);
    match others.as_slice() {
        [] => String::new(),
        [one] => format!("; robot {one} is alive: name it with --robot {one} if it is meant"),
        several => format!(
            "; robots {} are alive: name one with --robot if it is meant",
            list(several)
        ),
    }
}

/// Which domain was looked at, when no robot is alive there, and which others there are; empty when a robot is alive
/// there.
pub fn other_domains() -> String {
    let Ok(domain) = Domain::from_environment() else {
        return String::new();
    };
    let has_robots = |domain: &Domain| !alive(domain).unwrap_or_default().is_empty();
    if has_robots(&domain) {
        return String::new();
    }
    let own = Some(Domain::of_user()).filter(|own| *own != domain && has_robots(own));
    let others = Domain::others();
    let others = others.iter().filter(|one| one.path != domain.root());
    let others: Vec<(u32, &Path)> = others.map(|one| (one.uid, one.path.as_path())).collect();
    elsewhere(domain.root(), own.as_ref().map(Domain::root), &others)
}

/// Where robots may be that are not in the domain at `root`: in the user's `own`, and in those of other users.
fn elsewhere(root: &Path, own: Option<&Path>, others: &[(u32, &Path)]) -> String {
    let mut text = format!("; no robot is alive in {}", root.display());
    if let Some(own) = own {
        text += &format!(
            "; robots are alive in {}: unset RIL_IPC_ROOT if they are meant",
            own.display()
        );
    }
    for (uid, path) in others.iter().take(MAX_NAMED) {
        text += &format!(
            "; user {uid} has a domain at {}: {}",
            path.display(),
            as_user(*uid)
        );
    }
    text
}

/// The way to the robots of another user. RIL_IPC_ROOT does not lead there: no process enters the folder of another
/// user.
pub fn as_user(uid: u32) -> String {
    format!("if its robots are meant, run as that user: `sudo -u '#{uid}' ril ...`")
}

/// What [`commandable`] finds in the domain of this process.
pub fn commandable_here() -> Result<Vec<RobotId>, Failure> {
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    commandable(&domain).or_fail(ExitCode::Internal)
}

/// What [`alive`] finds in the domain of this process.
pub fn alive_here() -> Result<Vec<RobotId>, Failure> {
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    alive(&domain).or_fail(ExitCode::Internal)
}

/// Why a default robot is refused; `None` if it is unambiguous.
fn ambiguity(alive: &[RobotId]) -> Option<String> {
    (alive.len() > 1).then(|| {
        format!(
            "several robots are alive ({}) and none was named",
            list(alive)
        )
    })
}

fn list(robots: &[RobotId]) -> String {
    let numbers: Vec<String> = robots.iter().map(RobotId::to_string).collect();
    numbers.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_relay_provides_comes_from_another_machine_but_for_its_own_topics() {
        let provider = |process: &str| Provider {
            pid: 7,
            process: process.to_owned(),
            since_ns: 1,
            pid_namespace: 4,
            time_namespace: 5,
        };
        for (key, process, expected) in [
            ("hero_telemetry", "relay", true),
            ("battery_watch/state", "relay", true),
            ("hero_telemetry", "status", false),
            ("relay/link", "relay", false),
            ("relay/state", "relay", false),
        ] {
            assert_eq!(
                is_relayed(key, &provider(process)),
                expected,
                "{key} of {process}"
            );
        }
    }

    #[test]
    fn the_domains_where_robots_may_be_are_named_with_the_way_there() {
        let root = Path::new("/dev/shm/hero0");
        let text = elsewhere(root, None, &[]);
        assert_eq!(text, "; no robot is alive in /dev/shm/hero0");
        let own = Path::new("/dev/shm/hero1000");
        let text = elsewhere(Path::new("/dev/shm/test"), Some(own), &[]);
        assert!(
            text.ends_with(
                "; robots are alive in /dev/shm/hero1000: unset RIL_IPC_ROOT if they are meant"
            ),
            "{text}"
        );
        let others: Vec<(u32, &Path)> = (0..20).map(|_| (1000, own)).collect();
        let text = elsewhere(root, None, &others);
        let way = "user 1000 has a domain at /dev/shm/hero1000: if its robots are meant, run as that user: `sudo -u '#1000' ril ...`";
        assert_eq!(text.matches(way).count(), MAX_NAMED);
    }

    #[test]
    fn only_several_robots_are_ambiguous() {
        let robots = |ids: &[u32]| -> Vec<RobotId> {
            ids.iter().map(|id| RobotId::new(*id).unwrap()).collect()
        };
        for unambiguous in [&[][..], &[1], &[7]] {
            assert_eq!(ambiguity(&robots(unambiguous)), None, "{unambiguous:?}");
        }
        let text = ambiguity(&robots(&[2, 7])).unwrap();
        assert!(text.contains("(2, 7)"), "{text}");
    }
}
