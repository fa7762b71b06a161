//! [`Paths`]: which requests of paths are open, and what a movement that comes does to them.
//!
//! A waypoint before the last is done when the next one of its path is accepted, and broken when that is refused. A path
//! that is under way is replaced by a movement that may pre-empt it; any other movement is busy, unless the test says
//! otherwise.

use ipc_types::code::{MovementKind, Reason, Stage};
use ipc_types::payload::{MovementData, RequestReport};

use super::answer::Answer;

/// See the module's documentation.
#[derive(Debug, Default)]
pub(super) struct Paths {
    /// The newest waypoint of the path that is being assembled, and the path.
    assembling: Option<(u64, u64)>,
    /// The request that closed the path under way.
    under_way: Option<u64>,
}

impl Paths {
    /// The request is not open any more.
    pub fn closed(&mut self, request_id: u64) {
        self.assembling = self.assembling.filter(|(id, _)| *id != request_id);
        self.under_way = self.under_way.filter(|id| *id != request_id);
    }

    /// How a movement is answered that the test says nothing about.
    pub fn usual_answer(&self, request: &MovementData) -> Answer {
        if !closes(request) {
            return Answer::Reports(vec![RequestReport::new(Stage::Accepted, Reason::None)]);
        }
        match self.under_way {
            Some(_) if !preempts(request) => Answer::refuse(Reason::Busy),
            _ => Answer::done(),
        }
    }

    /// Takes a movement that will be answered so. Returns the final reports about requests that it ends.
    pub fn take(&mut self, request: &MovementData, answer: &Answer) -> Vec<(u64, RequestReport)> {
        let first = match answer {
            Answer::Reports(reports) => reports.first().and_then(RequestReport::stage),
            Answer::Hang | Answer::Die => None,
        };
        let mut ended = Vec::new();
        if let Some((id, path_id)) = self.assembling
            && path_id == request.path_id
        {
            match first {
                Some(Stage::Refused) => {
                    ended.push((id, RequestReport::new(Stage::Aborted, Reason::PathBroken)));
                }
                Some(_) => ended.push((id, RequestReport::new(Stage::Done, Reason::None))),
                None => {}
            }
        }
        if first.is_some_and(|stage| stage != Stage::Refused) {
            if preempts(request)
                && let Some(id) = self.under_way
            {
                ended.push((id, RequestReport::new(Stage::Aborted, Reason::Replaced)));
            }
            self.note(request);
        }
        ended
    }

    fn note(&mut self, request: &MovementData) {
        if !closes(request) {
            self.assembling = Some((request.request_id, request.path_id));
        } else if request.kind() == Some(MovementKind::GoToWaypoint) {
            self.under_way = Some(request.request_id);
        }
    }
}

/// Whether the helicopter is to move when this was taken: all but a waypoint before the last.
fn closes(request: &MovementData) -> bool {
    request.kind() != Some(MovementKind::GoToWaypoint) || request.is_last() == Some(true)
}

/// Whether it replaces a path that is under way.
fn preempts(request: &MovementData) -> bool {
    request.kind() == Some(MovementKind::Hold) || (closes(request) && request.preempt == 1)
}
