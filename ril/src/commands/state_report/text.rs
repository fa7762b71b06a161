//! The report as text: a title and a few lines for each part.

use std::fmt;
use std::time::Duration;

use runtime::duration::Shown;

use crate::messages::count;

use super::{
    DspErrorCount, DspErrors, Link, Module, Movement, Refused, Safety, StateReport, StatusState,
};

impl fmt::Display for StateReport {
    /// Lines with a title each; the last without its end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "robot       {}", self.robot)?;
        match &self.relay {
            Some(link) => writeln!(f, "relay       {}", link.in_short())?,
            None if self.relayed => {
                writeln!(f, "relay       relayed over an unknown link: no sample")?
            }
            None => {}
        }
        writeln!(f, "module      {}", self.module)?;
        match &self.status {
            Some(status) => writeln!(f, "status      {status}")?,
            None => writeln!(f, "status      no sample")?,
        }
        match &self.movement {
            Some(movement) => writeln!(f, "movement    {movement}")?,
            None => writeln!(f, "movement    none yet")?,
        }
        writeln!(f, "link        {}", self.link)?;
        writeln!(
            f,
            "DSP path    {}; when the bridge is gone: {}",
            self.link.dsp_path,
            without_bridge(self.link.pc_timeout_supported)
        )?;
        writeln!(f, "safety      {}", self.safety)?;
        writeln!(f, "refused     {}", self.refused)?;
        writeln!(f, "DSP errors  {}", self.dsp_errors)?;
        for (title, sample) in [("dsp", self.dsp), ("hero", self.hero)] {
            match sample {
                Some(sample) => writeln!(f, "{title:<12}{sample}")?,
                None => writeln!(f, "{title:<12}no sample")?,
            }
        }
        Ok(())
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
                count(self.waypoints_total.into(), "waypoint"),
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
            count(self.port_openings.into(), "time"),
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
            count(self.telemetry_published.into(), "sample"),
            self.telemetry_incoherent
        )?;
        write!(
            f,
            "            {} acknowledged, {} repeated, {} failed, {} unmatched\n            {} sent, {} of them again, delivery {}",
            count(self.commands_acknowledged.into(), "command"),
            self.commands_repeated,
            self.commands_failed,
            count(self.acks_unmatched.into(), "ack"),
            count(self.waypoints_sent.into(), "waypoint"),
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
