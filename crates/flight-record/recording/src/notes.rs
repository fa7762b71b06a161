//! What a recorder says of itself in its files: events, and the metadata of a file.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};

use crate::event::{Event, EventKind};
use crate::queue::Loss;
use crate::settings::Anchor;

/// Name of the record of metadata that each file has of itself.
pub const FILE_METADATA: &str = "ril.file";

/// By how much the wall clock has to step to be an event. Reading both clocks one after the other differs by less.
const MIN_CLOCK_STEP: Duration = Duration::from_millis(100);

/// The disk does not take what it is given.
#[derive(Debug)]
pub(crate) struct Trouble {
    since: MonotonicNs,
    pub(crate) attempts: u32,
    /// When to try again; absent while a file that failed is being closed, and at the end.
    pub(crate) retry_at: Option<MonotonicNs>,
}

impl Trouble {
    /// Trouble that begins, and the event that says so. `unsynced` messages were written, but not forced onto the disk.
    pub(crate) fn begin(now: MonotonicNs, reason: &str, unsynced: u64) -> (Trouble, Event) {
        let trouble = Trouble {
            since: now,
            attempts: 1,
            retry_at: None,
        };
        let text = match unsynced {
            0 => reason.to_owned(),
            _ => format!("{reason}; of the messages before, {unsynced} may not be on the disk"),
        };
        (trouble, event(EventKind::Disk, now, now, unsynced, text))
    }

    /// The event that the trouble is over.
    pub(crate) fn end_event(&self, now: MonotonicNs) -> Event {
        let text = format!(
            "the disk takes messages again, after {:.1} s and {} attempts",
            now.since(self.since).as_secs_f64(),
            self.attempts + 1
        );
        event(EventKind::Disk, self.since, now, 0, text)
    }
}

/// The event that a channel lost messages.
pub(crate) fn loss_event(now: MonotonicNs, topic: &str, loss: Loss) -> Event {
    let text = "the disk was too slow: the recorder's queue was full".to_owned();
    Event {
        at: now,
        topic: topic.to_owned(),
        ..event(EventKind::Loss, loss.first, loss.last, loss.count, text)
    }
}

/// The event at a file's end that the file with this index follows.
pub(crate) fn split_event(now: MonotonicNs, next_index: u32) -> Event {
    let text = format!("the recording goes on in file {next_index}");
    event(EventKind::Split, now, now, u64::from(next_index), text)
}

/// The event that the wall clock was set between two readings of the clocks.
pub(crate) fn clock_event(now: MonotonicNs, before: Anchor, after: Anchor) -> Option<Event> {
    let expected_ns = before.unix_ns_of(after.monotonic);
    let step_ns = after.unix_ns.abs_diff(expected_ns);
    if u128::from(step_ns) < MIN_CLOCK_STEP.as_nanos() {
        return None;
    }
    let direction = if after.unix_ns > expected_ns {
        "forward"
    } else {
        "back"
    };
    let text = format!(
        "the wall clock was set {direction} by {:.3} s; the times in this file go on as before",
        Duration::from_nanos(step_ns).as_secs_f64()
    );
    Some(event(EventKind::Clock, before.monotonic, now, 0, text))
}

/// The record of metadata of a file: name, and texts by key.
pub(crate) fn file_metadata(
    robot: RobotId,
    index: u32,
    anchor: Anchor,
) -> (String, BTreeMap<String, String>) {
    let entries = [
        ("robot", robot.to_string()),
        ("index", index.to_string()),
        ("anchor_monotonic_ns", anchor.monotonic.0.to_string()),
        ("anchor_unix_ns", anchor.unix_ns.to_string()),
    ];
    let entries = entries.map(|(key, value)| (key.to_owned(), value));
    (FILE_METADATA.to_owned(), entries.into())
}

fn event(
    kind: EventKind,
    first: MonotonicNs,
    last: MonotonicNs,
    count: u64,
    text: String,
) -> Event {
    Event {
        at: last,
        kind,
        topic: String::new(),
        count,
        first,
        last,
        text,
    }
}
