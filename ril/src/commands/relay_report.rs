//! What `ril relay status` shows, as a value made of samples and the time: as text for people, as JSON for programs.
//!
//! It reads no clock and no port. [`LinkReport`] is also what `ril status` shows of a robot on another machine.

#[cfg(test)]
mod tests;
mod text;

use std::time::Duration;

use ipc_types::code::Reason;
use ipc_types::payload::{RelayLink, RelayStation, RelayStations};
use ipc_types::{MonotonicNs, RobotId};
use runtime::exit::ExitCode;
use serde::ser::{Serialize, Serializer};

use super::sample_age::{Sample, age_ms, named};
use crate::fields::{JsonLine, Tree};

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Relay.v2";

/// A sample of the relay older than this says nothing of the present: the relay publishes once a second, so this is three of them.
pub const STALE_AFTER: Duration = Duration::from_secs(3);

/// Everything that `ril relay status` shows.
#[derive(Clone, Debug)]
pub struct RelayReport {
    robot: RobotId,
    /// The link to the robot; `None` on a robot's own machine.
    link: Option<LinkReport>,
    /// The stations that the robot is relayed to; `None` on a station's machine.
    stations: Option<RelayStations>,
    now: MonotonicNs,
}

/// The link of this machine to a robot on another one.
#[derive(Clone, Debug)]
pub struct LinkReport {
    link: RelayLink,
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
        self.link.as_ref().is_some_and(LinkReport::is_up)
            || self.stations.as_ref().is_some_and(is_any_up)
    }

    fn sample_of(&self, stations: &RelayStations) -> Sample {
        Sample::with_limit(
            stations.sequence,
            stations.published(),
            self.now,
            STALE_AFTER,
        )
    }

    /// How the command ends.
    pub fn exit_code(&self) -> ExitCode {
        match self.is_up() {
            true => ExitCode::Ok,
            false => ExitCode::LinkDown,
        }
    }

    /// Why the command ends with another code than 0, and what to do.
    pub fn trouble(&self) -> &'static str {
        match &self.link {
            Some(link) if link.is_stale() => {
                "the relay runs and says nothing: is it stopped, or is the machine overloaded?"
            }
            Some(_) => {
                "the link to the robot is not up: is the relay on the robot's machine running, and is the network there?"
            }
            None => {
                "no station is up: is the relay on a station's machine running, and is the network there?"
            }
        }
    }
}

impl LinkReport {
    /// What `link` says at `now`.
    pub fn new(link: &RelayLink, now: MonotonicNs) -> LinkReport {
        LinkReport { link: *link, now }
    }

    fn sample(&self) -> Sample {
        let link = &self.link;
        Sample::with_limit(link.sequence, link.published(), self.now, STALE_AFTER)
    }

    /// Whether the relay has said this too long ago to say how the link is now.
    pub fn is_stale(&self) -> bool {
        self.sample().is_stale()
    }

    /// Whether the relay says that the link is up, and has said so lately.
    pub fn is_up(&self) -> bool {
        self.link.is_up() && !self.is_stale()
    }

    /// As part of a JSON object.
    pub(super) fn tree(&self) -> Tree {
        let link = &self.link;
        let clock = Tree::nested([
            ("offset_ns", link.clock_offset_ns.into()),
            ("uncertainty_s", link.clock_uncertainty().into()),
            ("round_trip_s", link.round_trip().into()),
            ("drift_ppb", link.clock_drift_ppb.into()),
            ("resets", link.clock_resets.into()),
        ]);
        let samples = Tree::nested([
            ("received", link.samples_received.into()),
            ("lost_on_air", link.samples_lost_on_air.into()),
            ("lost_on_air_percent", lost_percent(link).into()),
            ("lost_in_relay", link.samples_lost_in_relay.into()),
            ("left_out", link.samples_left_out.into()),
        ]);
        let orders = Tree::nested([
            ("sent", link.orders_sent.into()),
            ("repeated", link.orders_repeated.into()),
            ("open", link.orders_open.into()),
            ("unknown", link.orders_unknown.into()),
        ]);
        Tree::nested([
            ("state", named(link.state(), link.state).into()),
            ("up", self.is_up().into()),
            ("state_since_ms", since_ms(link.since_ns, self.now).into()),
            ("over", link.link().into()),
            ("station", link.station().into()),
            ("robot_there", link.robot.into()),
            ("refusal", refusal_name(link.refusal).into()),
            (
                "last_heard_age_ms",
                heard_ms(link.last_heard(), self.now).into(),
            ),
            ("outages", link.outages.into()),
            (
                "clock",
                if link.clock_valid != 0 {
                    clock
                } else {
                    Tree::NULL
                },
            ),
            ("samples", samples),
            ("bytes_received", link.bytes_received.into()),
            ("bytes_sent", link.bytes_sent.into()),
            ("orders", orders),
            ("sample", self.sample().tree()),
        ])
    }
}

impl Serialize for RelayReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stations = self.stations.as_ref().map(|stations| {
            let all = stations.stations().iter();
            let all = all.map(|one| station(one, self.now)).collect();
            Tree::nested([
                ("stations", Tree::List(all)),
                ("sample", self.sample_of(stations).tree()),
            ])
        });
        let tree = &Tree::nested([
            ("robot", self.robot.get().into()),
            ("up", self.is_up().into()),
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
        ("may_command", (station.may_command != 0).into()),
        ("refusal", refusal_name(station.refusal).into()),
        ("orders_executed", station.orders_executed.into()),
        ("orders_refused", station.orders_refused.into()),
        ("orders_open", station.orders_open.into()),
        ("samples_sent", station.samples_sent.into()),
    ])
}

/// ms since `since_ns`; `None` for 0, which stands for "never", and for a time in the future.
fn since_ms(since_ns: u64, now: MonotonicNs) -> Option<u64> {
    let since = (since_ns > 0).then_some(MonotonicNs(since_ns))?;
    age_ms(since, now)
}

/// ms since the last message; `None` before the first, and for a time in the future.
fn heard_ms(last: Option<MonotonicNs>, now: MonotonicNs) -> Option<u64> {
    age_ms(last?, now)
}

/// The name of the reason for which requests are refused; `None` if they are taken.
fn refusal_name(code: u32) -> Option<String> {
    (code != 0).then(|| named(Reason::from_code(code), code))
}

/// The part of the robot's samples that was lost on the air, to the hundredth of a percent, because more would be noise; `None` if
/// the robot's relay sent none.
fn lost_percent(link: &RelayLink) -> Option<f64> {
    let part = link.lost_on_air()?;
    Some((part * 1e4).round() / 100.0)
}
