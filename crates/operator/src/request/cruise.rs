//! [`CruiseSpeed`]: the speed of one flight. It is a port of the DSP, which flies every path with what was written
//! last, so what was there before is written again at the end.

use std::time::Duration;

use dsp_protocol::port;
use ipc_types::fresh_request_id;
use ipc_types::payload::ParameterRequest;
use runtime::exit::{ExitCode, Failure};

use super::{Conversation, Format, Until, begin_by_ns};
use crate::render::messages::Verb;
use crate::render::note;
use crate::session::Session;

/// Reads a speed that the DSP's port takes, m/s.
pub fn speed_mps(text: &str) -> Result<f64, String> {
    let number = text.trim().trim_end_matches("m/s").trim_end();
    let speed_mps: f64 = number
        .parse()
        .map_err(|_| format!("the speed `{text}` is no number of m/s, such as 8"))?;
    match port::port32(port::CRUISE_SPEED_MPS) {
        Some(port) if !port.accepts(speed_mps as f32) => Err(format!(
            "the DSP takes a speed of {} to {} m/s",
            port.min, port.max
        )),
        _ => Ok(speed_mps),
    }
}

/// What the DSP's port has, m/s; `None` if it says no speed.
///
/// # Errors
///
/// As [`Conversation::follow`].
pub fn read_mps(session: &Session, timeout: Duration) -> Result<Option<f64>, Failure> {
    let request = ParameterRequest::read(fresh_request_id(), port::CRUISE_SPEED_MPS);
    let report = Conversation::open(session, Verb::GetParameter, timeout)?.follow(
        &[request],
        Until::Final,
        Format::Silent,
    )?;
    let value = report.and_then(|report| report.value());
    Ok(value.filter(|speed_mps| *speed_mps > 0.0))
}

/// The speed of one flight, written to the DSP before it; what was there before is written again at the end.
pub struct CruiseSpeed<'a> {
    session: &'a Session,
    timeout: Duration,
    deadline_ms: u32,
    format: Format,
    /// What the port had before.
    before_mps: Option<f64>,
    /// What was written last; `None` if nothing was.
    written_mps: Option<f64>,
}

impl<'a> CruiseSpeed<'a> {
    /// `before_mps` is what [`CruiseSpeed::restore`] writes, if it is known.
    pub fn new(
        session: &'a Session,
        (timeout, deadline_ms): (Duration, u32),
        format: Format,
        before_mps: Option<f64>,
    ) -> CruiseSpeed<'a> {
        CruiseSpeed {
            session,
            timeout,
            deadline_ms,
            format,
            before_mps,
            written_mps: None,
        }
    }

    /// Writes it, as the next step behind the request `before`, or 0.
    ///
    /// # Errors
    ///
    /// As [`Conversation::follow`]. The DSP may have taken the speed all the same.
    pub fn set(&mut self, speed_mps: f64, before: u64) -> Result<(), Failure> {
        let written = self.write(speed_mps, before);
        if !matches!(&written, Err(failure) if failure.code() == ExitCode::Refused) {
            self.written_mps = Some(speed_mps);
        }
        written
    }

    fn write(&self, speed_mps: f64, before: u64) -> Result<(), Failure> {
        let request =
            ParameterRequest::write(fresh_request_id(), port::CRUISE_SPEED_MPS, speed_mps);
        let request = ParameterRequest {
            begin_by_ns: begin_by_ns(request.issued_ns, self.deadline_ms),
            after: before,
            ..request
        };
        Conversation::<ParameterRequest>::open(self.session, Verb::SetParameter, self.timeout)?
            .follow(&[request], Until::Final, self.format)
            .map(drop)
    }

    /// Writes the speed from before, which would otherwise be lost, and says on standard error when that is not
    /// possible. After a signal the path goes on, and so does its speed. Another command may have written a speed of
    /// its own meanwhile, which stays.
    pub fn restore(&self) {
        let Some(written_mps) = self.written_mps else {
            return;
        };
        let is_interrupted = self.session.termination.requested();
        let restored = match self.before_mps {
            _ if is_interrupted => Err("the command was interrupted".to_owned()),
            None => Err("the speed from before is not known".to_owned()),
            Some(before_mps) => self
                .replace(written_mps, before_mps)
                .map_err(|failure| failure.chain().join(": ")),
        };
        if let Err(why) = restored {
            note(format_args!(
                "warning: the cruise speed stays as this command has set it: {why}. `ril param set cruise_speed_mps` changes it"
            ));
        }
    }

    fn replace(&self, written_mps: f64, before_mps: f64) -> Result<(), Failure> {
        match read_mps(self.session, self.timeout)? {
            // A port has 32 bits.
            Some(now_mps) if now_mps as f32 != written_mps as f32 => {
                note(format_args!(
                    "warning: another command has set a cruise speed of {now_mps} m/s meanwhile, which stays"
                ));
                Ok(())
            }
            _ => self.write(before_mps, 0),
        }
    }
}

/// Refuses a flight whose speed could not be restored.
///
/// # Errors
///
/// As [`read_mps`], and code 5 when the DSP says no speed.
pub fn known_mps(session: &Session, timeout: Duration) -> Result<f64, Failure> {
    read_mps(session, timeout)?.ok_or_else(|| {
        let text =
            "the DSP does not say its cruise speed, so it could not be restored; nothing was sent";
        Failure::new(ExitCode::Refused, text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_a_number_that_the_port_takes() {
        for (text, expected) in [("8", 8.0), ("0.5m/s", 0.5), (" 12 m/s ", 12.0)] {
            assert_eq!(speed_mps(text), Ok(expected), "{text}");
        }
        for (text, expected) in [
            ("fast", "no number of m/s"),
            ("8km/h", "no number of m/s"),
            ("0", "0.1 to 20 m/s"),
            ("-3", "0.1 to 20 m/s"),
            ("21", "0.1 to 20 m/s"),
            ("nan", "0.1 to 20 m/s"),
        ] {
            let refused = speed_mps(text).unwrap_err();
            assert!(refused.contains(expected), "{text}: {refused}");
        }
    }
}
