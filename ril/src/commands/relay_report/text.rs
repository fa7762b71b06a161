//! The report as text: a title and a few lines for each part.

use std::fmt;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::payload::{RelayLink, RelayStation};
use runtime::duration::Shown;

use super::super::sample_age::named;
use super::{LinkReport, RelayReport, heard_ms, lost_percent, refusal_name, since_ms};
use crate::words::count;

/// Stands for a text of another process that is none.
const UNREADABLE: &str = "unreadable";

impl fmt::Display for RelayReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "robot       {}", self.robot)?;
        if let Some(link) = &self.link {
            write!(f, "{link}")?;
        }
        if let Some(stations) = &self.stations {
            if stations.stations().is_empty() {
                writeln!(f, "station     none")?;
            }
            for one in stations.stations() {
                write_station(f, one, self.now)?;
            }
            writeln!(f, "relay       {}", self.sample_of(stations))?;
        }
        Ok(())
    }
}

impl LinkReport {
    /// In a few words, for a report about something else.
    pub fn in_short(&self) -> String {
        let link = &self.link;
        let round_trip = match link.round_trip() {
            Some(seconds) => format!("round trip {}", milliseconds(seconds)),
            None => "round trip unknown".to_owned(),
        };
        let lost = match lost_percent(link) {
            Some(percent) => format!("{percent:.2} % lost on the air"),
            None => "no samples yet".to_owned(),
        };
        format!(
            "relayed over {}, link {}, {round_trip}, {lost}{}",
            link.link().unwrap_or(UNREADABLE),
            named(link.state(), link.state),
            if self.is_stale() { ", STALE" } else { "" }
        )
    }
}

impl fmt::Display for LinkReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let link = &self.link;
        write!(f, "link        {}", named(link.state(), link.state))?;
        match since_ms(link.since_ns, self.now) {
            Some(ms) => write!(f, " for {}", shown(ms))?,
            None => f.write_str(" since an unknown time")?,
        }
        writeln!(
            f,
            " over {}, last message {}; {}",
            link.link().unwrap_or(UNREADABLE),
            ago(heard_ms(link.last_heard(), self.now)),
            count(link.outages, "outage")
        )?;
        write!(
            f,
            "            robot {} on its own machine; this station is {}",
            link.robot,
            link.station().unwrap_or(UNREADABLE)
        )?;
        match refusal_name(link.refusal) {
            Some(reason) => writeln!(f, ", and its requests are refused ({reason})")?,
            None => writeln!(f)?,
        }
        writeln!(f, "clock       {}", clock(link))?;
        let percent = lost_percent(link);
        writeln!(
            f,
            "samples     {} received, {} lost on the air{}, {} lost in the robot's relay, {} left out on purpose",
            link.samples_received,
            link.samples_lost_on_air,
            percent.map_or_else(String::new, |percent| format!(" ({percent:.2} %)")),
            link.samples_lost_in_relay,
            link.samples_left_out
        )?;
        writeln!(
            f,
            "bytes       {} received, {} sent",
            link.bytes_received, link.bytes_sent
        )?;
        writeln!(
            f,
            "orders      {} sent, {} repeated, {} open, {} of unknown outcome",
            link.orders_sent,
            count(link.orders_repeated, "message"),
            link.orders_open,
            link.orders_unknown
        )?;
        writeln!(f, "relay       {}", self.sample())
    }
}

/// How the robot's clock is to this machine's.
fn clock(link: &RelayLink) -> String {
    if link.clock_valid == 0 {
        return "not compared with the robot's yet".to_owned();
    }
    let relation = match link.clock_offset_ns < 0 {
        true => "behind",
        false => "ahead",
    };
    let seconds = link.clock_offset_ns.unsigned_abs() as f64 / 1e9;
    let truth = match link.clock_uncertainty() {
        Some(uncertainty) => format!("true within {}", milliseconds(uncertainty)),
        None => "of unknown truth".to_owned(),
    };
    let round_trip = match link.round_trip() {
        Some(round_trip) => milliseconds(round_trip),
        None => "unknown".to_owned(),
    };
    format!(
        "the robot's is {seconds:.6} s {relation}, {truth}; round trip {round_trip}, drift {:.3} ppm, {}",
        f64::from(link.clock_drift_ppb) / 1e3,
        count(link.clock_resets, "reset")
    )
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
        ", last message {}\n            \
         {} sent; {} executed, {} refused, {} open",
        ago(heard_ms(station.last_heard(), now)),
        count(station.samples_sent, "sample"),
        count(station.orders_executed, "order"),
        station.orders_refused,
        station.orders_open
    )
}

fn shown(ms: u64) -> Shown {
    Shown(Duration::from_millis(ms))
}

/// Seconds as milliseconds, with the digits that mean something.
fn milliseconds(seconds: f64) -> String {
    let milliseconds = seconds * 1e3;
    match milliseconds < 10.0 {
        true => format!("{milliseconds:.3} ms"),
        false => format!("{milliseconds:.1} ms"),
    }
}

fn ago(age: Option<u64>) -> String {
    age.map_or_else(|| "never".to_owned(), |age| format!("{age} ms ago"))
}
