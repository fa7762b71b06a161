//! The report as text: a title and a few lines for each part.

use std::fmt;
use std::time::Duration;

use runtime::duration::Shown;

use crate::words::count;

use super::bridge::{DspErrorCount, DspErrors, Link, Module, Movement, Refused, Safety};
use super::{StateReport, StatusState};

impl fmt::Display for StateReport {
    /// Lines with a title each; the last without its end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "robot       {}", self.robot)?;
        if self.replayed {
            writeln!(
                f,
                "replay      a recorded flight, replayed by `ril replay`: no robot"
            )?;
        }
        self.write_flight(f)?;
        match &self.relay {
            Some(link) => writeln!(f, "relay       {}", link.in_short())?,
            None if self.relayed => {
                writeln!(f, "relay       relayed over an unknown link: no sample")?
            }
            None => {}
        }
        match &self.module {
            Some(module) => writeln!(f, "module      {module}")?,
            None => writeln!(f, "module      no sample")?,
        }
        match &self.status {
            Some(status) => writeln!(f, "status      {status}")?,
            None => writeln!(f, "status      no sample")?,
        }
        self.write_bridge(f)?;
        for (title, sample) in [("dsp", self.dsp), ("hero", self.hero)] {
            match sample {
                Some(sample) => writeln!(f, "{title:<12}{sample}")?,
                None => writeln!(f, "{title:<12}no sample")?,
            }
        }
        Ok(())
    }
}

impl StateReport {
    /// What a pilot asks first.
    fn write_flight(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flight = &self.flight;
        writeln!(f, "flight      {}", flight.in_words())?;
        if flight.flying.is_some() {
            writeln!(f, "altitude    {}", flight.altitude())?;
            writeln!(f, "position    {}", flight.position())?;
            writeln!(f, "speed       {}", flight.speed())?;
            writeln!(f, "supply      {}", flight.supply())?;
            writeln!(f, "GPS         {}", flight.fix())?;
        }
        let age = |age: Option<u64>| match age {
            Some(age) => format!("{age} ms old"),
            None => "of unknown age".to_owned(),
        };
        let stale = |is_stale: bool| if is_stale { ", STALE" } else { "" };
        match flight.stale {
            Some(is_stale) => write!(
                f,
                "data        telemetry {}{}",
                age(flight.age_ms),
                stale(is_stale)
            )?,
            None => write!(f, "data        no telemetry")?,
        }
        match &self.module {
            Some(module) => {
                let sample = module.sample;
                writeln!(
                    f,
                    "; bridge's state {}{}",
                    age(sample.age_ms()),
                    stale(sample.is_stale())
                )?;
            }
            None if self.processes.bridge => writeln!(f, "; no state of the bridge")?,
            None => writeln!(f, "; no bridge runs")?,
        }
        Ok(())
    }

    /// What the bridge says.
    fn write_bridge(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.movement, &self.module) {
            (Some(movement), _) => writeln!(f, "movement    {movement}")?,
            (None, Some(_)) => writeln!(f, "movement    none yet")?,
            (None, None) => {}
        }
        if let Some(link) = &self.link {
            writeln!(f, "link        {link}")?;
            let without = without_bridge(link.pc_timeout_supported);
            writeln!(
                f,
                "DSP path    {}; when the bridge is gone: {without}",
                link.dsp_path
            )?;
        }
        if let Some(safety) = &self.safety {
            writeln!(f, "safety      {safety}")?;
        }
        if let Some(refused) = &self.refused {
            writeln!(f, "refused     {refused}")?;
        }
        if let Some(errors) = &self.dsp_errors {
            writeln!(f, "DSP errors  {errors}")?;
        }
        Ok(())
    }

    /// All that `--watch` tells of in a line. Another text than before is a change; numbers that always change are not in it.
    pub fn situation(&self) -> String {
        let mut parts = vec![self.flight.in_words()];
        parts.extend(
            self.flight
                .pilot_switch
                .map(|switch| format!("switch {switch}")),
        );
        parts.extend(self.flight.gps_fix.map(|fix| format!("fix {fix}")));
        parts.extend(self.module.as_ref().map(|module| match module.blocked {
            true => format!("module {}, blocked", module.status),
            false => format!("module {}", module.status),
        }));
        parts.extend(
            self.link
                .as_ref()
                .map(|link| format!("link {}", link.state)),
        );
        if let Some(violation) = self
            .safety
            .as_ref()
            .and_then(|safety| safety.violation.as_ref())
        {
            parts.push(format!("{}: {}", violation.rule, violation.action));
        }
        parts.extend(self.trouble().map(|(_, trouble)| trouble));
        parts.join("; ")
    }

    /// The situation with the numbers of this moment.
    pub fn line(&self) -> String {
        let flight = &self.flight;
        let numbers = [
            flight
                .altitude_m
                .map(|altitude_m| format!("{altitude_m:.1} m")),
            flight
                .ground_speed_mps
                .map(|speed_mps| format!("{speed_mps:.1} m/s")),
            flight
                .battery_v
                .map(|battery_v| format!("{battery_v:.1} V")),
        ];
        let numbers: Vec<String> = numbers.into_iter().flatten().collect();
        match numbers.is_empty() {
            true => self.situation(),
            false => format!("{}; {}", self.situation(), numbers.join(", ")),
        }
    }
}

/// What a helicopter on a path does when its bridge is gone.
fn without_bridge(pc_timeout_supported: Option<bool>) -> &'static str {
    match pc_timeout_supported {
        Some(true) => "the DSP stops the helicopter by itself",
        Some(false) => "the DSP flies on to the end of its path",
        None => "not known yet what the DSP does",
    }
}

impl fmt::Display for Safety {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.violation {
            None => f.write_str("no rule violated")?,
            Some(violation) => {
                f.write_str(&violation.rule)?;
                if let Some(by) = &violation.by {
                    write!(f, " {by}")?;
                }
                write!(f, ": {}", violation.action)?;
            }
        }
        write!(
            f,
            "; pilot's switch {}, {} fence areas, {} interventions",
            self.pilot_switch, self.fence_areas, self.interventions
        )
    }
}

impl fmt::Display for Module {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}, {}", self.id, self.status, self.functionality)?;
        if self.blocked {
            f.write_str(", blocked")?;
        }
        if self.unable_to_abort {
            f.write_str(", unable to abort")?;
        }
        write!(f, "; {}; {}", self.error, self.sample)
    }
}

impl fmt::Display for StatusState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Text of another process: it must not command the terminal.
        let doing = self.doing.escape_debug();
        write!(f, "{} {}, {doing}", self.id, self.status)?;
        if self.blocked {
            f.write_str(", blocked")?;
        }
        write!(f, "; {}; {}", self.error, self.sample)
    }
}

impl fmt::Display for Movement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.kind)?;
        if self.waypoints_total > 0 {
            write!(
                f,
                ", {}, {} sent, {} reached",
                count(self.waypoints_total, "waypoint"),
                self.waypoints_sent,
                self.waypoints_reached
            )?;
        }
        match self.distance_to_go_m {
            Some(distance) => write!(f, ", {distance:.1} m to go"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ago = |age: Option<u64>, ever: bool| match age {
            Some(age) => format!("{age} ms ago"),
            None if ever => "of unknown age".to_owned(),
            None => "never".to_owned(),
        };
        let since = match self.state_since_ms {
            Some(ms) => format!("for {}", Shown(Duration::from_millis(ms))),
            None => "since an unknown time".to_owned(),
        };
        writeln!(
            f,
            "{} {since}; port opened {}, DSP boots seen {}",
            self.state,
            count(self.port_openings, "time"),
            self.dsp_boots
        )?;
        writeln!(
            f,
            "            last message {}, last telemetry {}",
            ago(self.last_message_age_ms, self.messages_received > 0),
            ago(self.last_telemetry_age_ms, self.telemetry_published > 0)
        )?;
        writeln!(
            f,
            "            {}, {}; {} published, {} incoherent",
            count(self.bytes_received, "byte"),
            count(self.messages_received, "message"),
            count(self.telemetry_published, "sample"),
            self.telemetry_incoherent
        )?;
        write!(
            f,
            "            {} acknowledged, {} repeated, {} failed, {} unmatched\n            {} sent, {} of them again, delivery {}",
            count(self.commands_acknowledged, "command"),
            self.commands_repeated,
            self.commands_failed,
            count(self.acks_unmatched, "ack"),
            count(self.waypoints_sent, "waypoint"),
            self.waypoints_repeated,
            if self.delivery_verified {
                "verified"
            } else {
                "not verified"
            }
        )
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts: Vec<String> = self
            .counters()
            .into_iter()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{name} {count}"))
            .collect();
        if counts.is_empty() {
            return f.write_str("nothing");
        }
        f.write_str(&counts.join(", "))?;
        match self.implausible.as_slice() {
            [] => Ok(()),
            groups => write!(f, " (groups: {})", groups.join(", ")),
        }
    }
}

impl fmt::Display for DspErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(last) = &self.last else {
            return f.write_str("none");
        };
        write!(
            f,
            "{}, {} of them fatal; last {last}",
            self.total, self.escalated
        )?;
        for DspErrorCount { code, text, count } in &self.by_code {
            write!(f, "\n            {count} × {code}: {text}")?;
        }
        if self.unknown > 0 {
            write!(f, "\n            {} × unknown codes", self.unknown)?;
        }
        Ok(())
    }
}
