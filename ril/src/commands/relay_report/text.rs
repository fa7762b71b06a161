//! The report as text: a title and a few lines for each part.

use std::fmt;
use std::time::Duration;

use runtime::duration::Shown;

use super::{ClockReport, LinkReport, RelayReport, SamplesReport, StationReport};
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
            if stations.stations.is_empty() {
                writeln!(f, "station     none")?;
            }
            for station in &stations.stations {
                writeln!(f, "station     {station}")?;
            }
            writeln!(f, "relay       {}", stations.sample)?;
        }
        Ok(())
    }
}

impl LinkReport {
    /// In a few words, for a report about something else.
    pub fn in_short(&self) -> String {
        let clock = self.clock.as_ref();
        let round_trip = match clock.and_then(|clock| clock.round_trip_s) {
            Some(seconds) => format!("round trip {}", milliseconds(seconds)),
            None => "round trip unknown".to_owned(),
        };
        let lost = match self.samples.lost_on_air_percent {
            Some(percent) => format!("{percent:.2} % lost on the air"),
            None => "no samples yet".to_owned(),
        };
        let stale = if self.sample.is_stale() {
            ", STALE"
        } else {
            ""
        };
        format!(
            "relayed over {}, link {}, {round_trip}, {lost}{stale}",
            self.over.as_deref().unwrap_or(UNREADABLE),
            self.state
        )
    }
}

impl fmt::Display for LinkReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "link        {}", self.state)?;
        match self.state_since_ms {
            Some(ms) => write!(f, " for {}", shown(ms))?,
            None => f.write_str(" since an unknown time")?,
        }
        writeln!(
            f,
            " over {}, last message {}; {}",
            self.over.as_deref().unwrap_or(UNREADABLE),
            ago(self.last_heard_age_ms),
            count(self.outages, "outage")
        )?;
        write!(
            f,
            "            robot {} on its own machine; this station is {}",
            self.robot_there,
            self.station.as_deref().unwrap_or(UNREADABLE)
        )?;
        match &self.refusal {
            Some(reason) => writeln!(f, ", and its requests are refused ({reason})")?,
            None => writeln!(f)?,
        }
        match &self.clock {
            Some(clock) => writeln!(f, "clock       {clock}")?,
            None => writeln!(f, "clock       not compared with the robot's yet")?,
        }
        writeln!(f, "samples     {}", self.samples)?;
        writeln!(
            f,
            "bytes       {} received, {} sent",
            self.bytes_received, self.bytes_sent
        )?;
        writeln!(
            f,
            "orders      {} sent, {} repeated, {} open, {} of unknown outcome",
            self.orders.sent,
            count(self.orders.repeated, "message"),
            self.orders.open,
            self.orders.unknown
        )?;
        writeln!(f, "relay       {}", self.sample)
    }
}

impl fmt::Display for ClockReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let relation = if self.offset_ns < 0 {
            "behind"
        } else {
            "ahead"
        };
        let seconds = self.offset_ns.unsigned_abs() as f64 / 1e9;
        write!(f, "the robot's is {seconds:.6} s {relation}")?;
        match self.uncertainty_s {
            Some(uncertainty) => write!(f, ", true within {}", milliseconds(uncertainty))?,
            None => f.write_str(", of unknown truth")?,
        }
        match self.round_trip_s {
            Some(round_trip) => write!(f, "; round trip {}", milliseconds(round_trip))?,
            None => f.write_str("; round trip unknown")?,
        }
        write!(
            f,
            ", drift {:.3} ppm, {}",
            f64::from(self.drift_ppb) / 1e3,
            count(self.resets, "reset")
        )
    }
}

impl fmt::Display for SamplesReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} received, {} lost on the air",
            self.received, self.lost_on_air
        )?;
        if let Some(percent) = self.lost_on_air_percent {
            write!(f, " ({percent:.2} %)")?;
        }
        write!(
            f,
            ", {} lost in the robot's relay, {} left out on purpose",
            self.lost_in_relay, self.left_out
        )
    }
}

impl fmt::Display for StationReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = if self.up { "up" } else { "down" };
        let name = self.name.as_deref().unwrap_or(UNREADABLE);
        write!(f, "{name}: {state}")?;
        if let Some(ms) = self.since_ms {
            write!(f, " for {}", shown(ms))?;
        }
        match (&self.refusal, self.may_command) {
            (None, true) => f.write_str(", may command")?,
            (Some(reason), true) => write!(f, ", may command and is refused ({reason})")?,
            (_, false) => f.write_str(", may not command")?,
        }
        write!(
            f,
            ", last message {}\n            \
             {} sent; {} executed, {} refused, {} open",
            ago(self.last_heard_age_ms),
            count(self.samples_sent, "sample"),
            count(self.orders_executed, "order"),
            self.orders_refused,
            self.orders_open
        )
    }
}

fn shown(ms: u64) -> Shown {
    Shown(Duration::from_millis(ms))
}

/// Seconds as milliseconds, with the digits that mean something.
pub(in super::super) fn milliseconds(seconds: f64) -> String {
    let milliseconds = seconds * 1e3;
    match milliseconds < 10.0 {
        true => format!("{milliseconds:.3} ms"),
        false => format!("{milliseconds:.1} ms"),
    }
}

fn ago(age: Option<u64>) -> String {
    age.map_or_else(|| "never".to_owned(), |age| format!("{age} ms ago"))
}
