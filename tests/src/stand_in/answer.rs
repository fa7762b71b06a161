//! [`Answer`]: what a stand-in does with a request.

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

/// What to do with a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Report exactly this. Without a final stage at the end the request stays open.
    Reports(Vec<RequestReport>),
    /// Take it and report nothing: a bridge that hangs. [`StandInBridge::report`](crate::StandInBridge::report) may
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

    /// Accepted, and under way until [`StandInBridge::report`](crate::StandInBridge::report) or a movement that
    /// pre-empts it says otherwise.
    pub fn under_way() -> Answer {
        Answer::accepted_then(Vec::new())
    }

    /// Accepted, then one report for each of so many waypoints sent, one for each reached but the last, and done.
    pub fn progress(waypoints: u32) -> Answer {
        let counts = |sent: u32, reached: u32| RequestReport {
            waypoints_total: waypoints,
            waypoints_sent: sent,
            waypoints_reached: reached,
            ..report(Stage::Progress, Reason::None)
        };
        let sent = (1..=waypoints).map(|sent| counts(sent, 0));
        let reached = (1..waypoints).map(|reached| counts(waypoints, reached));
        let mut reports: Vec<_> = sent.chain(reached).collect();
        reports.push(RequestReport {
            stage: Stage::Done.code(),
            ..counts(waypoints, waypoints)
        });
        Answer::accepted_then(reports)
    }

    fn accepted_then(mut reports: Vec<RequestReport>) -> Answer {
        reports.insert(0, report(Stage::Accepted, Reason::None));
        Answer::Reports(reports)
    }
}

fn report(stage: Stage, reason: Reason) -> RequestReport {
    RequestReport::new(stage, reason)
}
