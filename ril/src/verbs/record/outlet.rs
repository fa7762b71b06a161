//! [`Outlet`]: a topic that the recorder makes itself.

use ipc_types::{MonotonicNs, RobotId};
use recording::{Anchor, Channel, ChannelId, Recorder};
use ros_messages::{UnixOffset, definition};

use crate::recorded::topic;

/// What turns monotonic times into those of `anchor`.
pub fn offset_of(anchor: Anchor) -> UnixOffset {
    let offset_ns = i128::from(anchor.unix_ns) - i128::from(anchor.monotonic.0);
    // Neither clock comes near the ends of the range within three centuries.
    UnixOffset(i64::try_from(offset_ns).unwrap_or_default())
}

/// A topic that the recorder makes itself.
#[derive(Debug)]
pub struct Outlet {
    channel: Channel,
    id: Option<ChannelId>,
    sequence: u32,
}

impl Outlet {
    /// The topic `name` of `robot`, whose messages have the type `type_name` of the crate `ros-messages`. It is in the file
    /// once it has a message.
    pub fn new(robot: RobotId, name: &str, type_name: &str) -> Outlet {
        Outlet::with_text(
            robot,
            name,
            type_name,
            definition(type_name).unwrap_or_default(),
        )
    }

    /// The same with messages of a type that `schema_text` defines.
    pub fn with_text(robot: RobotId, name: &str, type_name: &str, schema_text: String) -> Outlet {
        Outlet {
            channel: Channel {
                topic: topic(robot, name),
                schema_name: type_name.to_owned(),
                schema_text,
                metadata: [("made_by".to_owned(), "recorder".to_owned())].into(),
            },
            id: None,
            sequence: 0,
        }
    }

    /// Records the next message, which says what was at `at`.
    pub fn add(&mut self, recorder: &mut Recorder, now: MonotonicNs, at: MonotonicNs, cdr: &[u8]) {
        if self.id.is_none() {
            self.id = recorder.channel(self.channel.clone());
        }
        if let Some(id) = self.id {
            self.sequence = self.sequence.wrapping_add(1);
            recorder.add(now, id, at, self.sequence, cdr);
        }
    }
}
