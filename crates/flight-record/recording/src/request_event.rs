//! [`RequestEvent`]: the message that the recorder makes of a request in the bridge's journal, and of each report about
//! one.

use ros_messages::cdr::{Reader, Writer};

/// Type of [`RequestEvent`].
pub const REQUEST_EVENT: &str = "hero_msgs/msg/RequestEvent";

/// Its definition.
pub const REQUEST_EVENT_TEXT: &str = "\
# A request to the bridge, or what the bridge reports about it.

# When, host monotonic [ns].
uint64 at_ns
# Chosen by the sender; every report has it.
uint64 request_id
# Of a path, the same in all of its waypoints; else 0.
uint64 path_id
# Process that sent the request; 0 when that is not known.
uint32 sender_pid
# request, report or sender-gone
string event
# control, movement or parameter
string service
# Such as start, takeoff, goto, land, hold, write.
string command
# Of a report: accepted, progress, done, refused, aborted or unknown.
string stage
# Of a report that is no success: why.
string reason
# In words.
string text
# Waypoint of goto; NaN else [deg].
float64 latitude_deg
# Waypoint of goto; NaN else [deg].
float64 longitude_deg
# Telemetry altitude of the waypoint of goto; height above take-off of takeoff; NaN else [m].
float64 altitude_m
# Station whose order the relay handed on; empty when a program on the robot gave it, or it is not known.
string station
";

/// A request, or a report about one.
#[derive(Clone, Debug, PartialEq)]
pub struct RequestEvent<'a> {
    /// When, host monotonic ns.
    pub at_ns: u64,
    /// Its id.
    pub request_id: u64,
    /// Its path.
    pub path_id: u64,
    /// The process that sent it; 0 when that is not known.
    pub sender_pid: u32,
    /// `request`, `report` or `sender-gone`.
    pub event: &'a str,
    /// `control`, `movement` or `parameter`.
    pub service: &'a str,
    /// What is asked for.
    pub command: &'a str,
    /// Of a report.
    pub stage: &'a str,
    /// Of a report.
    pub reason: &'a str,
    /// In words.
    pub text: &'a str,
    /// Latitude, longitude (degrees), altitude (m); NaN where there is none.
    pub position: [f64; 3],
    /// The station whose order the relay handed on; empty if there is none, or the record does not say.
    pub station: &'a str,
}

impl RequestEvent<'_> {
    /// The message in CDR.
    pub fn write(&self) -> Vec<u8> {
        let mut writer = Writer::with_capacity(160 + self.text.len());
        writer.u64(self.at_ns);
        writer.u64(self.request_id);
        writer.u64(self.path_id);
        writer.u32(self.sender_pid);
        for text in [
            self.event,
            self.service,
            self.command,
            self.stage,
            self.reason,
            self.text,
        ] {
            writer.string(text);
        }
        writer.f64s(&self.position);
        writer.string(self.station);
        writer.finish()
    }
}

impl<'a> RequestEvent<'a> {
    /// The event that a message in CDR has; `None` if it is another message.
    pub fn read(cdr: &'a [u8]) -> Option<RequestEvent<'a>> {
        let mut body = Reader::new(cdr)?;
        Some(RequestEvent {
            at_ns: body.u64()?,
            request_id: body.u64()?,
            path_id: body.u64()?,
            sender_pid: body.u32()?,
            event: body.string()?,
            service: body.string()?,
            command: body.string()?,
            stage: body.string()?,
            reason: body.string()?,
            text: body.string()?,
            position: [body.f64()?, body.f64()?, body.f64()?],
            station: match body.is_at_end() {
                true => "",
                false => body.string()?,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_event_has_the_fields_of_its_definition_in_their_order() {
        let event = RequestEvent {
            at_ns: 1,
            request_id: 2,
            path_id: 3,
            sender_pid: 4,
            event: "request",
            service: "movement",
            command: "land",
            stage: "",
            reason: "",
            text: "land",
            position: [f64::NAN; 3],
            station: "gcs",
        };
        let bytes = event.write();
        assert_eq!(bytes[4..12], 1_u64.to_le_bytes());
        assert_eq!(bytes[20..28], 3_u64.to_le_bytes());
        assert_eq!(bytes[28..32], 4_u32.to_le_bytes());
        assert_eq!(bytes[32..44], *b"\x08\0\0\0request\0");
        let again = RequestEvent::read(&bytes).map(|event| event.write());
        assert_eq!(again.as_ref(), Some(&bytes));
        // A message of a recorder that writes no station ends before it.
        let without = bytes.len() - 8;
        for len in (0..bytes.len()).filter(|len| *len != without) {
            assert_eq!(RequestEvent::read(&bytes[..len]), None);
        }
        let event = RequestEvent::read(&bytes[..without]).unwrap();
        assert_eq!((event.text, event.station), ("land", ""));
        let fields = REQUEST_EVENT_TEXT.lines();
        let fields = fields.filter(|line| !line.starts_with('#') && !line.is_empty());
        assert_eq!(fields.count(), 14);
    }
}
