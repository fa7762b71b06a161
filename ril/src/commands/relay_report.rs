//! What `ril relay status` shows, as a value made of samples and the time: as text for people, as JSON for programs.
//!
//! It reads no clock and no port. [`LinkReport`] is also what `ril status` shows of a robot on another machine.

#[cfg(test)]
mod tests;
mod text;

use std::time::Duration;

use ipc_types::code::{Reason, RelayLinkState};
use ipc_types::payload::{RelayLink, RelayStation, RelayStations};
use ipc_types::{MonotonicNs, RobotId};
use runtime::exit::ExitCode;
use serde::Serialize;

use super::sample_age::{Sample, age_ms, named};

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Relay.v2";

/// A sample of the relay older than this says nothing of the present: the relay publishes once a second, so this is three of them.
pub const STALE_AFTER: Duration = Duration::from_secs(3);

/// Everything that `ril relay status` shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RelayReport {
    schema: &'static str,
    robot: u32,
    /// Whether the link is up, or on a robot's machine the link of at least one station.
    up: bool,
    /// The link to the robot; nothing on a robot's own machine.
    link: Option<LinkReport>,
    /// The stations that the robot is relayed to; nothing on a station's machine.
    stations: Option<StationsReport>,
}

/// The link of this machine to a robot on another one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkReport {
    state: String,
    /// Whether the relay says that the link is up, and has said so lately.
    up: bool,
    state_since_ms: Option<u64>,
    /// Endpoint; nothing when it is not readable.
    over: Option<String>,
    station: Option<String>,
    /// Number of the robot on its own machine.
    robot_there: u32,
    /// Why the robot's relay takes no requests from this station; nothing when it takes them.
    refusal: Option<String>,
    /// Nothing before the first message, and for a time of the future.
    last_heard_age_ms: Option<u64>,
    outages: u32,
    /// Nothing before the first exchange of time stamps.
    clock: Option<ClockReport>,
    samples: SamplesReport,
    bytes_received: u64,
    bytes_sent: u64,
    orders: OrdersReport,
    sample: Sample,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct ClockReport {
    /// The robot's monotonic clock minus this machine's.
    offset_ns: i64,
    /// Nothing when the relay gives no number that can be.
    uncertainty_s: Option<f64>,
    round_trip_s: Option<f64>,
    drift_ppb: i32,
    resets: u32,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct SamplesReport {
    received: u64,
    lost_on_air: u64,
    /// Of those that the robot's relay sent; nothing when it sent none.
    lost_on_air_percent: Option<f64>,
    lost_in_relay: u64,
    left_out: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct OrdersReport {
    sent: u64,
    repeated: u64,
    open: u32,
    unknown: u64,
}

/// The stations that a robot is relayed to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StationsReport {
    stations: Vec<StationReport>,
    sample: Sample,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct StationReport {
    /// Nothing when it is not readable.
    name: Option<String>,
    up: bool,
    since_ms: Option<u64>,
    last_heard_age_ms: Option<u64>,
    may_command: bool,
    /// Why the relay takes no requests from the station; nothing when it takes them.
    refusal: Option<String>,
    orders_executed: u64,
    orders_refused: u64,
    orders_open: u32,
    samples_sent: u64,
}

impl RelayReport {
    /// What the relay's samples say at `now`.
    pub fn new(
        robot: RobotId,
        link: Option<&RelayLink>,
        stations: Option<&RelayStations>,
        now: MonotonicNs,
    ) -> RelayReport {
        let link = link.map(|link| LinkReport::new(link, now));
        let stations = stations.map(|stations| StationsReport::new(stations, now));
        let is_up = link.as_ref().is_some_and(|link| link.up)
            || stations.as_ref().is_some_and(StationsReport::is_any_up);
        RelayReport {
            schema: SCHEMA,
            robot: robot.get(),
            up: is_up,
            link,
            stations,
        }
    }

    /// How the command ends.
    pub fn exit_code(&self) -> ExitCode {
        match self.up {
            true => ExitCode::Ok,
            false => ExitCode::LinkDown,
        }
    }

    /// Why the command ends with another code than 0, and what to do.
    pub fn trouble(&self) -> &'static str {
        match (&self.link, &self.stations) {
            (Some(link), _) if link.sample.is_stale() => {
                "the relay runs and says nothing: is it stopped, or is the machine overloaded?"
            }
            (Some(_), _) => {
                "the link to the robot is not up: is the relay on the robot's machine running, and is the network there?"
            }
            _ => {
                "no station is up: is the relay on a station's machine running, and is the network there?"
            }
        }
    }
}

impl LinkReport {
    /// Whether the relay has said this too long ago to say how the link is now.
    pub fn is_stale(&self) -> bool {
        self.sample.is_stale()
    }

    /// Whether the relay says that the link is up, and has said so lately.
    pub fn is_up(&self) -> bool {
        self.up
    }

    /// What `link` says at `now`.
    pub fn new(link: &RelayLink, now: MonotonicNs) -> LinkReport {
        // Without `..`: a field that is added must be shown.
        let RelayLink {
            sequence,
            epoch_ns: _,
            published_ns,
            since_ns,
            last_heard_ns: _,
            clock_offset_ns,
            clock_uncertainty_s: _,
            round_trip_s: _,
            samples_received,
            samples_lost_on_air,
            samples_lost_in_relay,
            samples_left_out,
            bytes_received,
            bytes_sent,
            orders_sent,
            orders_repeated,
            orders_unknown,
            state,
            robot,
            clock_drift_ppb,
            clock_valid,
            clock_resets,
            outages,
            orders_open,
            refusal,
            link: _,
            station: _,
        } = *link;
        let sample = Sample::with_limit(sequence, MonotonicNs(published_ns), now, STALE_AFTER);
        let since = (since_ns > 0).then_some(MonotonicNs(since_ns));
        LinkReport {
            state: named(RelayLinkState::from_code(state), state),
            up: link.is_up() && !sample.is_stale(),
            state_since_ms: since.and_then(|time| age_ms(time, now)),
            over: link.link().map(str::to_owned),
            station: link.station().map(str::to_owned),
            robot_there: robot,
            refusal: refusal_name(refusal),
            last_heard_age_ms: link.last_heard().and_then(|time| age_ms(time, now)),
            outages,
            clock: (clock_valid != 0).then(|| ClockReport {
                offset_ns: clock_offset_ns,
                uncertainty_s: link.clock_uncertainty(),
                round_trip_s: link.round_trip(),
                drift_ppb: clock_drift_ppb,
                resets: clock_resets,
            }),
            samples: SamplesReport {
                received: samples_received,
                lost_on_air: samples_lost_on_air,
                lost_on_air_percent: link.lost_on_air().map(percent),
                lost_in_relay: samples_lost_in_relay,
                left_out: samples_left_out,
            },
            bytes_received,
            bytes_sent,
            orders: OrdersReport {
                sent: orders_sent,
                repeated: orders_repeated,
                open: orders_open,
                unknown: orders_unknown,
            },
            sample,
        }
    }
}

impl StationsReport {
    fn new(stations: &RelayStations, now: MonotonicNs) -> StationsReport {
        StationsReport {
            stations: stations
                .stations()
                .iter()
                .map(|station| StationReport::new(station, now))
                .collect(),
            sample: Sample::with_limit(stations.sequence, stations.published(), now, STALE_AFTER),
        }
    }

    fn is_any_up(&self) -> bool {
        !self.sample.is_stale() && self.stations.iter().any(|station| station.up)
    }
}

impl StationReport {
    fn new(station: &RelayStation, now: MonotonicNs) -> StationReport {
        // Without `..`: a field that is added must be shown.
        let RelayStation {
            name: _,
            last_heard_ns: _,
            since_ns,
            orders_executed,
            orders_refused,
            samples_sent,
            may_command,
            is_up,
            orders_open,
            refusal,
        } = *station;
        let since = (since_ns > 0).then_some(MonotonicNs(since_ns));
        StationReport {
            name: station.name().map(str::to_owned),
            up: is_up != 0,
            since_ms: since.and_then(|time| age_ms(time, now)),
            last_heard_age_ms: station.last_heard().and_then(|time| age_ms(time, now)),
            may_command: may_command != 0,
            refusal: refusal_name(refusal),
            orders_executed,
            orders_refused,
            orders_open,
            samples_sent,
        }
    }
}

/// The name of the reason for which requests are not taken; nothing when they are.
fn refusal_name(code: u32) -> Option<String> {
    (code != 0).then(|| named(Reason::from_code(code), code))
}

/// A part in percent, to the hundredth: more would be noise.
fn percent(part: f64) -> f64 {
    (part * 1e4).round() / 100.0
}
