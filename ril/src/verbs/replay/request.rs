//! [`ReplayedRequest`]: a request, or what the bridge reported about one, as it was recorded in the topic `/robotN/requests`.

use std::fmt;
use std::time::Duration;

use serde::Serialize;

use crate::recorded::RequestEvent;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.ReplayedRequest.v1";

/// A request that passes in a replay, or a report about one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReplayedRequest {
    schema: &'static str,
    /// Time since the first message of the flight, ms.
    at_ms: u64,
    request_id: u64,
    path_id: u64,
    /// Process that sent it; 0 when that is not known.
    sender_pid: u32,
    /// Station whose order the relay handed on; empty when there is none.
    station: String,
    /// `request`, `report` or `sender-gone`.
    event: String,
    /// `control`, `movement` or `parameter`.
    service: String,
    command: String,
    stage: String,
    reason: String,
    text: String,
}

impl ReplayedRequest {
    /// Reads a message of the type `hero_msgs/msg/RequestEvent`, which passes at `at`; `None` if it is another message.
    pub fn read(message: &[u8], at: Duration) -> Option<ReplayedRequest> {
        let event = RequestEvent::read(message)?;
        // Without what a terminal would obey.
        let plain = |text: &str| text.replace(char::is_control, "?");
        Some(ReplayedRequest {
            schema: SCHEMA,
            at_ms: u64::try_from(at.as_millis()).unwrap_or(u64::MAX),
            request_id: event.request_id,
            path_id: event.path_id,
            sender_pid: event.sender_pid,
            station: plain(event.station),
            event: plain(event.event),
            service: plain(event.service),
            command: plain(event.command),
            stage: plain(event.stage),
            reason: plain(event.reason),
            text: plain(event.text),
        })
    }
}

impl fmt::Display for ReplayedRequest {
    /// One line, without its end: `12.300 s  request 7: takeoff, from process 812`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, ms) = (self.at_ms / 1000, self.at_ms % 1000);
        let (event, id, command) = (&self.event, self.request_id, &self.command);
        if self.text.starts_with(&format!("{command} requested")) {
            return write!(f, "{seconds}.{ms:03} s  {event} {id}: {}", self.text);
        }
        write!(f, "{seconds}.{ms:03} s  {event} {id}: {command}")?;
        let is_success = self.reason.is_empty() || self.reason == "none";
        match (self.stage.is_empty(), is_success) {
            (true, _) => {}
            (false, true) => write!(f, " {}", self.stage)?,
            (false, false) => write!(f, " {} ({})", self.stage, self.reason)?,
        }
        if !self.text.is_empty() && self.text != self.command {
            write!(f, ", {}", self.text)?;
        }
        match (self.station.as_str(), self.sender_pid) {
            ("", 0) => Ok(()),
            ("", pid) => write!(f, ", from process {pid}"),
            (station, _) => write!(f, ", from station {station}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::schema::CDR_HEADER;

    use super::*;

    /// As `ril record` writes it.
    fn message(texts: [&str; 6], sender_pid: u32, station: &str) -> Vec<u8> {
        let [event, service, command, stage, reason, text] = texts;
        let request = RequestEvent {
            at_ns: 1,
            request_id: 7,
            path_id: 0,
            sender_pid,
            event,
            service,
            command,
            stage,
            reason,
            text,
            position: [f64::NAN; 3],
            station,
        };
        request.write()
    }

    #[test]
    fn a_request_is_a_line() {
        #[rustfmt::skip]
        let cases = [
            (["request", "movement", "takeoff", "", "", "takeoff"], 812, "", "12.300 s  request 7: takeoff, from process 812"),
            (["request", "movement", "land", "", "", "land"], 812, "gcs", "12.300 s  request 7: land, from station gcs"),
            (["report", "movement", "goto", "refused", "busy", ""], 0, "", "12.300 s  report 7: goto refused (busy)"),
            (["report", "movement", "goto", "done", "none", "a\x1b[2J"], 0, "", "12.300 s  report 7: goto done, a?[2J"),
        ];
        for (texts, pid, station, line) in cases {
            let bytes = message(texts, pid, station);
            let request = ReplayedRequest::read(&bytes, Duration::from_millis(12_300)).unwrap();
            assert_eq!(request.to_string(), line);
            for len in 0..bytes.len() {
                let _ = ReplayedRequest::read(&bytes[..len], Duration::ZERO);
            }
            assert_eq!(ReplayedRequest::read(&bytes[..40], Duration::ZERO), None);
        }
    }

    #[test]
    fn the_names_of_a_recording_are_those_that_are_played() {
        use recording::play::{REQUEST_EVENT, key_of};
        assert_eq!(crate::recorded::REQUEST_EVENT, REQUEST_EVENT);
        let robot = ipc_types::RobotId::DEFAULT;
        for key in [
            "dsp_telemetry",
            "hero_telemetry",
            "module_state",
            "status/state",
        ] {
            let topic = crate::recorded::topic_of(robot, key);
            assert_eq!(key_of(&topic), Some((robot, key)));
        }
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_are_read(mut bytes: Vec<u8>) {
            bytes.splice(..0, CDR_HEADER);
            let _ = ReplayedRequest::read(&bytes, Duration::ZERO);
        }
    }
}
