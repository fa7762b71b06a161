//! `ril relay`: starts the program `ril-relay` in its place, and shows how the links of a relay are.
//!
//! The relay is a program of its own, because its network library takes longer to build than all of the rest.

#[cfg(test)]
mod tests;

use std::ffi::OsString;
use std::fmt;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process;

use clap::{ArgAction, Args, Subcommand};
use ipc_types::payload::{RelayLink, RelayStation, RelayStations};
use ipc_types::{MonotonicNs, RobotId};
use operator::options::SampleArgs;
use operator::render::fields::{JsonLine, Tree};
use operator::render::print;
use operator::render::words::count;
use operator::robot::freshness::SampleAge;
use operator::robot::relay_link::{
    LinkReport, STALE_AFTER, STATIONS_STALE_AFTER, UNREADABLE, ago, heard_ms, refusal_name, shown,
    since_ms,
};
use operator::session::{Latest, Session, other_domains, others_alive};
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure};
use serde::ser::{Serialize, Serializer};

/// `ril relay`
///
/// Everything but `status` goes to the program `ril-relay` as it is, `--help` too.
#[derive(Args, Clone, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    disable_help_flag = true,
    disable_help_subcommand = true
)]
pub struct RelayArgs {
    /// What to do beside relaying.
    #[command(subcommand)]
    pub command: Option<RelayCommand>,

    /// Arguments of `ril-relay`; its --help lists them
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "ARGS"
    )]
    pub args: Vec<OsString>,
}

/// `ril relay …`
#[derive(Clone, Debug, Subcommand)]
pub enum RelayCommand {
    /// Show the links of the relay that runs on this machine, its clock, losses and orders
    Status(RelayStatusArgs),
}

/// `ril relay status`
///
/// On a station's machine it shows the link to the robot, and the stations that the robot's relay knows; on a robot's
/// machine these alone. It ends with exit code 0 when the link is up, or at least one station is, and with 6 when not.
#[derive(Args, Clone, Debug)]
pub struct RelayStatusArgs {
    /// What every command takes that shows samples.
    #[command(flatten)]
    pub samples: SampleArgs,

    /// Print help
    // That of `ril relay` is off, because it is the program's own, and with it those of all verbs below.
    #[arg(short, long, action = ArgAction::Help)]
    help: Option<bool>,
}

/// The relay's program.
const PROGRAM: &str = "ril-relay";

/// `ril relay`
///
/// # Errors
///
/// Code 1 when the program cannot be started; of `ril relay status` those of [`status()`]. It does not return when the
/// program was started: this process is then the relay.
pub fn relay(args: &RelayArgs) -> Result<(), Failure> {
    match &args.command {
        Some(RelayCommand::Status(args)) => status(args),
        None => {
            let program = program_beside(std::env::current_exe().ok().as_deref());
            let error = process::Command::new(&program).args(&args.args).exec();
            Err(Failure::internal(not_started(&program, &error)))
        }
    }
}

/// The relay's program beside this one; without it a bare name, for which the operating system looks in PATH.
fn program_beside(this: Option<&Path>) -> PathBuf {
    let beside = this.map(|this| this.with_file_name(PROGRAM));
    beside
        .filter(|path| path.is_file())
        .unwrap_or_else(|| PROGRAM.into())
}

fn not_started(program: &Path, error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound {
        format!(
            "there is no `{PROGRAM}`, neither beside `ril` nor in PATH: it is a program of its own, `cargo install --path gateways/relay` \
             builds and installs it"
        )
    } else {
        format!("{} cannot be started: {error}", program.display())
    }
}

/// `ril relay status`
///
/// # Errors
///
/// Code 3 when there is no relay, 4 when it publishes nothing, 6 when the link to the robot is not up or two robots
/// answer, or on a robot's machine no station is up.
pub fn status(args: &RelayStatusArgs) -> Result<(), Failure> {
    let (session, timeout) = Session::for_samples(&args.samples)?;
    let mut topics = open(&session)?;
    let give_up = MonotonicNs::now() + timeout;
    let is_complete = |(link, stations): &mut Provided, _| {
        Ok(link.as_ref().is_none_or(|link| link.sample.is_some())
            && stations.as_ref().is_none_or(|one| one.sample.is_some()))
    };
    if !session.gather(&mut topics, give_up, is_complete)? && session.termination.requested() {
        return Ok(());
    }
    let link = topics.0.as_ref().and_then(|link| link.sample.as_ref());
    let stations = topics.1.as_ref().and_then(|one| one.sample.as_ref());
    if link.is_none() && stations.is_none() {
        let text = format!(
            "nothing came from the relay of robot {} in {}, although it is running",
            session.ipc.robot(),
            DurationText(timeout)
        );
        return Err(Failure::new(ExitCode::Timeout, text).with_next_step(
            "`ril doctor` shows whether it is stopped; is the machine overloaded?",
        ));
    }
    let report = RelayReport::new(session.ipc.robot(), link, stations, MonotonicNs::now());
    print(&report, args.samples.json)?;
    match report.trouble() {
        None => Ok(()),
        Some((text, next_step)) => {
            Err(Failure::new(ExitCode::LinkDown, text).with_next_step(next_step))
        }
    }
}

/// The topics that the relay here provides.
type Provided = (Option<Latest<RelayLink>>, Option<Latest<RelayStations>>);

fn open(session: &Session) -> Result<Provided, Failure> {
    let topics: Provided = (
        Latest::open_if_provided(session)?,
        Latest::open_if_provided(session)?,
    );
    if topics.0.is_none() && topics.1.is_none() {
        let robot = session.ipc.robot();
        let text = format!(
            "no relay of robot {robot} is running here{}{}",
            others_alive(robot),
            other_domains()
        );
        return Err(Failure::new(ExitCode::ServiceAbsent, text).with_next_step(
            "start `ril relay station` here, or `ril relay robot` beside the robot, and try again",
        ));
    }
    Ok(topics)
}

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Relay.v3";

/// Everything that `ril relay status` shows.
#[derive(Clone, Debug)]
pub struct RelayReport {
    robot: RobotId,
    /// The link to the robot; `None` on a robot's own machine.
    link: Option<LinkReport>,
    /// The stations that the robot is relayed to; on a station's machine as the robot's relay says now and then.
    stations: Option<RelayStations>,
    now: MonotonicNs,
}

impl RelayReport {
    /// What the relay's samples say at `now`.
    pub fn new(
        robot: RobotId,
        link: Option<&RelayLink>,
        stations: Option<&RelayStations>,
        now: MonotonicNs,
    ) -> RelayReport {
        RelayReport {
            robot,
            link: link.map(|link| LinkReport::new(link, now)),
            stations: stations.copied(),
            now,
        }
    }

    /// Whether the link is up, or on a robot's machine the link of at least one station.
    fn is_up(&self) -> bool {
        let is_any_up = |stations: &RelayStations| {
            !self.sample_of(stations).is_stale()
                && stations.stations().iter().any(|station| station.is_up != 0)
        };
        match &self.link {
            Some(link) => link.is_up(),
            None => self.stations.as_ref().is_some_and(is_any_up),
        }
    }

    fn sample_of(&self, stations: &RelayStations) -> SampleAge {
        SampleAge::with_limit(
            stations.sequence,
            stations.published(),
            self.now,
            match self.link {
                Some(_) => STATIONS_STALE_AFTER,
                None => STALE_AFTER,
            },
        )
    }

    /// Whether the stations are as `stations` says: not when that is old, or comes over a link that is not up.
    fn knows(&self, stations: &RelayStations) -> bool {
        let comes = self.link.as_ref().is_none_or(LinkReport::is_up);
        comes && !self.sample_of(stations).is_stale()
    }

    /// Why the command ends with another code than 0, and what to do; `None` if it ends with 0.
    pub fn trouble(&self) -> Option<(String, String)> {
        if let Some(two) = self.link.as_ref().and_then(LinkReport::two_robots) {
            return Some(two);
        }
        if self.is_up() {
            return None;
        }
        let no_station = || {
            let next_step =
                "is the relay on a station's machine running, and is the network there?";
            ("no station is up".to_owned(), next_step.to_owned())
        };
        let of_link = self.link.as_ref().and_then(LinkReport::trouble);
        Some(of_link.unwrap_or_else(no_station))
    }
}

impl fmt::Display for RelayReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "robot       {}", self.robot)?;
        if let Some(link) = &self.link {
            write!(f, "{link}")?;
        }
        if let Some(stations) = &self.stations
            && self.link.is_some()
        {
            let commanding = stations.commanding();
            let text = commanding.map_or("no station has yet".to_owned(), |station| {
                let name = station.name().unwrap_or(UNREADABLE);
                let last = ago(heard_ms(station.last_order(), self.now));
                format!("{name}, last order {last}")
            });
            writeln!(f, "commands    {text}")?;
            write_pace(f, stations)?;
        } else if let Some(stations) = &self.stations {
            if stations.stations().is_empty() {
                writeln!(f, "station     none")?;
            }
            for one in stations.stations() {
                write_station(f, one, self.knows(stations), self.now)?;
            }
            write_pace(f, stations)?;
            writeln!(f, "relay       {}", self.sample_of(stations))?;
        }
        Ok(())
    }
}

impl Serialize for RelayReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stations = self.stations.as_ref().map(|stations| {
            let all = stations.stations().iter();
            let is_known = self.knows(stations);
            let all = all.map(|one| station(one, is_known, self.now)).collect();
            Tree::nested([
                ("stations", Tree::List(all)),
                ("samples_bytes_per_s", stations.samples_rate().into()),
                ("sample", self.sample_of(stations).tree()),
            ])
        });
        let (trouble, next_step) = self.trouble().unzip();
        let tree = &Tree::nested([
            ("robot", self.robot.get().into()),
            ("up", self.is_up().into()),
            ("trouble", trouble.into()),
            ("next_step", next_step.into()),
            (
                "link",
                self.link.as_ref().map_or(Tree::NULL, LinkReport::tree),
            ),
            ("stations", stations.unwrap_or(Tree::NULL)),
        ]);
        let schema = SCHEMA;
        JsonLine { schema, tree }.serialize(serializer)
    }
}

fn station(station: &RelayStation, is_known: bool, now: MonotonicNs) -> Tree {
    Tree::nested([
        ("name", station.name().into()),
        ("up", is_known.then_some(station.is_up != 0).into()),
        ("since_ms", since_ms(station.since_ns, now).into()),
        (
            "last_heard_age_ms",
            heard_ms(station.last_heard(), now).into(),
        ),
        (
            "last_order_age_ms",
            heard_ms(station.last_order(), now).into(),
        ),
        ("may_command", (station.may_command != 0).into()),
        ("refusal", refusal_name(station.refusal).into()),
        ("orders_executed", station.orders_executed.into()),
        ("orders_refused", station.orders_refused.into()),
        ("orders_open", station.orders_open.into()),
        ("samples_sent", station.samples_sent.into()),
    ])
}

fn write_pace(f: &mut fmt::Formatter<'_>, stations: &RelayStations) -> fmt::Result {
    match stations.samples_rate() {
        Some(rate) => {
            let kilobytes = f64::from(rate) / 1000.0;
            writeln!(
                f,
                "pace        at most {kilobytes:.1} kB of samples a second go out, the newest of each topic"
            )
        }
        None => writeln!(f, "pace        all samples go out"),
    }
}

fn write_station(
    f: &mut fmt::Formatter<'_>,
    station: &RelayStation,
    is_known: bool,
    now: MonotonicNs,
) -> fmt::Result {
    let state = match (is_known, station.is_up != 0) {
        (true, true) => "up",
        (true, false) => "down",
        (false, _) => "unknown, last",
    };
    let name = station.name().unwrap_or(UNREADABLE);
    write!(f, "station     {name}: {state}")?;
    if let Some(ms) = since_ms(station.since_ns, now) {
        write!(f, " for {}", shown(ms))?;
    }
    match (refusal_name(station.refusal), station.may_command != 0) {
        (None, true) => f.write_str(", may command")?,
        (Some(reason), true) => write!(f, ", may command and is refused ({reason})")?,
        (_, false) => f.write_str(", may not command")?,
    }
    writeln!(
        f,
        ", last message {}, last order {}\n            \
         {} sent; {} executed, {} refused, {} open",
        ago(heard_ms(station.last_heard(), now)),
        ago(heard_ms(station.last_order(), now)),
        count(station.samples_sent, "sample"),
        count(station.orders_executed, "order"),
        station.orders_refused,
        station.orders_open
    )
}
