//! What `ril relay status` shows, as a value made of samples and the time: as text for people, as JSON for programs. It reads no clock
//! and no port.

use std::fmt;

use ipc_types::payload::{RelayLink, RelayStation, RelayStations};
use ipc_types::{MonotonicNs, RobotId};
use runtime::exit::ExitCode;
use serde::ser::{Serialize, Serializer};

use crate::render::fields::{JsonLine, Tree};
use crate::render::words::count;
use crate::robot::relay_link::{
    LinkReport, STALE_AFTER, STATIONS_STALE_AFTER, UNREADABLE, ago, heard_ms, refusal_name, shown,
    since_ms,
};
use crate::robot::sample_age::SampleAge;

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

    /// How the command ends.
    pub fn exit_code(&self) -> ExitCode {
        match self.is_up() {
            true => ExitCode::Ok,
            false => ExitCode::LinkDown,
        }
    }

    /// Why the command ends with another code than 0, and what to do; `None` if it ends with 0.
    pub fn trouble(&self) -> Option<(String, String)> {
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
                write_station(f, one, self.now)?;
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
            let all = all.map(|one| station(one, self.now)).collect();
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

fn station(station: &RelayStation, now: MonotonicNs) -> Tree {
    Tree::nested([
        ("name", station.name().into()),
        ("up", (station.is_up != 0).into()),
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
    now: MonotonicNs,
) -> fmt::Result {
    let state = if station.is_up != 0 { "up" } else { "down" };
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
