//! [`FlightStream`]: the messages of a flight one after the other, from any place of the file. In memory is one chunk
//! of it, however long it is.

use std::path::Path;

use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, RobotId, Schema};

use super::flight::{FlightError, anchor_of, flight_ns, key_of, latest};
use super::timeline::FlightNs;
use crate::read::{FileMark, Messages, ReadError, RecordFile, RecordedMessage, messages};
use crate::settings::Anchor;

/// The messages of a flight one after the other, from any place of the file; one chunk of it is in memory.
pub struct FlightStream {
    messages: Messages<'static>,
    robot: RobotId,
    anchor: Anchor,
    /// Of the last message: time never goes back.
    last: FlightNs,
}

/// A place between two messages of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlightMark {
    mark: FileMark,
    last: FlightNs,
}

impl FlightStream {
    /// Opens a file, of which robot N is what lies below `/robotN/`; if there are several robots, the one of the first
    /// message.
    ///
    /// # Errors
    /// See [`FlightError`]. A damaged file is read without what is damaged.
    pub fn open(path: &Path) -> Result<FlightStream, FlightError> {
        let file = RecordFile::open(path)?;
        let anchor = anchor_of(&file);
        let mut messages = messages(&file);
        let begin = messages.mark();
        let mut unsupported = None;
        let (robot, anchor) = loop {
            match messages.next() {
                None => return Err(unsupported.map_or(FlightError::NoSamples, FlightError::Read)),
                Some(Err(error @ ReadError::NotMcap)) => return Err(FlightError::Read(error)),
                Some(Err(error)) if error.is_unsupported() => unsupported = Some(error),
                Some(Err(_)) => {}
                Some(Ok(message)) => {
                    let robot = key_of(message.topic()).map(|(robot, _)| robot);
                    let anchor = anchor.or_else(|| anchor_in(&message));
                    if let Some(found) = robot.zip(anchor) {
                        break found;
                    }
                }
            }
        };
        messages.go_to(begin);
        Ok(FlightStream {
            messages,
            robot,
            anchor,
            last: FlightNs(0),
        })
    }

    /// The robot that was recorded.
    pub fn robot(&self) -> RobotId {
        self.robot
    }

    /// One moment by both clocks of then.
    pub fn anchor(&self) -> Anchor {
        self.anchor
    }

    /// The next message of the robot, or of none, with the moment at which it came; `None` at the end of the file. An
    /// error is damage, behind which it goes on.
    #[expect(
        clippy::should_implement_trait,
        reason = "it goes on after `None`, once it was led elsewhere"
    )]
    pub fn next(&mut self) -> Option<Result<(FlightNs, RecordedMessage), ReadError>> {
        let message = self.messages.find(|message| match message {
            Ok(message) => key_of(message.topic()).is_none_or(|(robot, _)| robot == self.robot),
            Err(_) => true,
        })?;
        Some(message.map(|message| {
            self.last = self.last.max(flight_ns(self.anchor, message.log_time_ns));
            (self.last, message)
        }))
    }

    /// Where it stands.
    pub fn mark(&self) -> FlightMark {
        FlightMark {
            mark: self.messages.mark(),
            last: self.last,
        }
    }

    /// Goes on where it stood before.
    pub fn go_to(&mut self, mark: FlightMark) {
        self.messages.go_to(mark.mark);
        self.last = mark.last;
    }
}

/// Of a sample in a file that does not say when it began: it was published at the latest moment in it.
fn anchor_in(message: &RecordedMessage) -> Option<Anchor> {
    let schema = Schema::parse(message.schema_text()).ok()?;
    let sample = message.data().strip_prefix(&CDR_HEADER)?;
    Some(Anchor {
        monotonic: MonotonicNs(latest(sample, &schema.moments(), u64::MAX)?),
        unix_ns: message.publish_time_ns,
    })
}
