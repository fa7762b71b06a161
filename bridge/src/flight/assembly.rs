//! Assembly of paths from single waypoints (requirement D4).
//!
//! Nothing of a path leaves this module until the path is closed.
//!
//! | state | (1,1) | (1,0) | (0,0) | (0,1) |
//! |---|---|---|---|---|
//! | no path | closed | opened | refused: without head | refused: without head |
//! | path open, same id | old one replaced, closed | old one replaced, opened | continued | closed |
//! | path open, other id | old one replaced, closed | old one replaced, opened | refused: without head | refused: without head |
//! | path open and full | as above | as above | whole path refused: too long | whole path refused: too long |
//!
//! A waypoint of an open path that is refused for any reason breaks the whole path: a path with a hole is never flown.

use dsp_protocol::Waypoint;
use ipc_types::code::Reason;
use serde::{Deserialize, Serialize};

use super::request::{RequestHeader, Segment};

/// Waypoints of one path. The bridge takes the memory for one path under assembly, one under way and one in the
/// trajectory generator when it starts: 3 × 1024 × 24 bytes. A waypoint more is refused as `path-too-long`.
pub const MAX_WAYPOINTS: usize = 1024;

/// A path under construction.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Assembler {
    path_id: Option<u64>,
    waypoints: Vec<Waypoint>,
    /// The request of the newest waypoint of the open path; those before it are done.
    newest: Option<RequestHeader>,
}

impl Assembler {
    /// No path. All memory that assembly will ever need is taken here.
    pub fn new() -> Self {
        Assembler {
            path_id: None,
            waypoints: Vec::with_capacity(MAX_WAYPOINTS),
            newest: None,
        }
    }

    /// The id of the open path.
    pub fn open_path(&self) -> Option<u64> {
        self.path_id
    }

    /// The request of the newest waypoint of the open path.
    pub fn newest(&self) -> Option<&RequestHeader> {
        self.newest.as_ref()
    }

    /// The request of the newest waypoint, which has its final report from now on.
    pub fn take_newest(&mut self) -> Option<RequestHeader> {
        self.newest.take()
    }

    /// A waypoint was added by this request, and the path is open.
    pub fn set_newest(&mut self, header: RequestHeader) {
        self.newest = Some(header);
    }

    /// Whether this waypoint goes on with the open path.
    pub fn continues(&self, segment: &Segment) -> bool {
        !segment.first && self.path_id == Some(segment.path_id)
    }

    /// Adds a waypoint; true when the path is closed.
    ///
    /// # Errors
    /// Why it is refused. An open path is as it was, unless it is full: then it is gone.
    pub fn add(&mut self, segment: &Segment) -> Result<bool, Reason> {
        if segment.first {
            self.clear();
            self.path_id = Some(segment.path_id);
        } else if self.path_id != Some(segment.path_id) {
            return Err(Reason::PathWithoutHead);
        } else if self.waypoints.len() == MAX_WAYPOINTS {
            self.clear();
            return Err(Reason::PathTooLong);
        }
        self.waypoints.push(segment.waypoint);
        if segment.last {
            self.path_id = None;
        }
        Ok(segment.last)
    }

    /// The waypoints collected so far, or those of the path just closed.
    pub fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    /// Discards the path.
    pub fn clear(&mut self) {
        self.path_id = None;
        self.waypoints.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(path_id: u64, first: u8, last: u8) -> Segment {
        Segment {
            path_id,
            first: first == 1,
            last: last == 1,
            waypoint: Waypoint {
                latitude_deg: path_id as f64,
                ..Waypoint::default()
            },
        }
    }

    const OPEN: Result<bool, Reason> = Ok(false);
    const CLOSED: Result<bool, Reason> = Ok(true);
    const HEADLESS: Result<bool, Reason> = Err(Reason::PathWithoutHead);
    const TOO_LONG: Result<bool, Reason> = Err(Reason::PathTooLong);

    /// State of the assembler before the event.
    #[derive(Clone, Copy, Debug)]
    enum Before {
        NoPath,
        Open,
        Full,
    }

    fn assembler(before: Before) -> Assembler {
        let mut assembler = Assembler::new();
        let count = match before {
            Before::NoPath => 0,
            Before::Open => 2,
            Before::Full => MAX_WAYPOINTS,
        };
        for index in 0..count {
            let first = u8::from(index == 0);
            assert_eq!(assembler.add(&segment(1, first, 0)), OPEN);
        }
        assembler
    }

    #[test]
    fn every_state_and_event() {
        use Before::{Full, NoPath, Open};
        // State, (first, last) and id of the waypoint, outcome, waypoints kept, id of the open path afterwards.
        let table = [
            (NoPath, (1, 1), 2, CLOSED, 1, None),
            (NoPath, (1, 0), 2, OPEN, 1, Some(2)),
            (NoPath, (0, 0), 2, HEADLESS, 0, None),
            (NoPath, (0, 1), 2, HEADLESS, 0, None),
            (Open, (1, 1), 2, CLOSED, 1, None),
            (Open, (1, 0), 2, OPEN, 1, Some(2)),
            (Open, (0, 0), 2, HEADLESS, 2, Some(1)),
            (Open, (0, 1), 2, HEADLESS, 2, Some(1)),
            (Open, (1, 1), 1, CLOSED, 1, None),
            (Open, (1, 0), 1, OPEN, 1, Some(1)),
            (Open, (0, 0), 1, OPEN, 3, Some(1)),
            (Open, (0, 1), 1, CLOSED, 3, None),
            (Full, (1, 1), 2, CLOSED, 1, None),
            (Full, (1, 0), 2, OPEN, 1, Some(2)),
            (Full, (0, 0), 2, HEADLESS, MAX_WAYPOINTS, Some(1)),
            (Full, (0, 1), 2, HEADLESS, MAX_WAYPOINTS, Some(1)),
            (Full, (0, 0), 1, TOO_LONG, 0, None),
            (Full, (0, 1), 1, TOO_LONG, 0, None),
        ];
        for (before, (first, last), id, outcome, kept, open) in table {
            let mut assembler = assembler(before);
            let event = segment(id, first, last);
            assert_eq!(
                assembler.add(&event),
                outcome,
                "{before:?} ({first},{last}) {id}"
            );
            assert_eq!(
                assembler.waypoints().len(),
                kept,
                "{before:?} ({first},{last}) {id}"
            );
            assert_eq!(
                assembler.open_path(),
                open,
                "{before:?} ({first},{last}) {id}"
            );
        }
    }

    #[test]
    fn the_longest_path_closes_and_nothing_is_reallocated() {
        let mut assembler = assembler(Before::NoPath);
        let capacity = assembler.waypoints.capacity();
        for index in 0..MAX_WAYPOINTS - 1 {
            let _ = assembler.add(&segment(1, u8::from(index == 0), 0));
        }
        assert_eq!(assembler.add(&segment(1, 0, 1)), CLOSED);
        assert_eq!(assembler.waypoints().len(), MAX_WAYPOINTS);
        assert_eq!(assembler.waypoints.capacity(), capacity);
    }
}
