//! [`Answer`]: what a stand-in does with a request.

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

/// What to do with a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Report exactly this. Without a final stage at the end the request stays open.
    Reports(Vec<RequestReport>),
    /// Take it and report nothing: a server that hangs. [`StandInServer::report`](crate::StandInServer::report) may
    /// report something later.
    Hang,
    /// Die: close everything without a word. The sender's own port then says that the outcome is unknown.
    Die,
}

impl Answer {
    /// Accepted, then done.
    pub fn done() -> Answer {
        Answer::accepted_then(vec![report(Stage::Done, Reason::None)])
    }

    /// Refused.
    pub fn refuse(reason: Reason) -> Answer {
        Answer::Reports(vec![report(Stage::Refused, reason)])
    }

    /// Accepted, then ended early.
    pub fn abort(reason: Reason) -> Answer {
        Answer::accepted_then(vec![report(Stage::Aborted, reason)])
    }

    /// Accepted, and under way until [`StandInServer::report`](crate::StandInServer::report) says otherwise.
    pub fn under_way() -> Answer {
        Answer::accepted_then(Vec::new())
    }

    /// Accepted, then what these reports say.
    pub fn accepted_then(mut reports: Vec<RequestReport>) -> Answer {
        reports.insert(0, report(Stage::Accepted, Reason::None));
        Answer::Reports(reports)
    }
}

fn report(stage: Stage, reason: Reason) -> RequestReport {
    RequestReport::new(stage, reason)
}
