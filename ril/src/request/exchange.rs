//! The conversation of one command with the bridge: what to send when, what to wait for, when it is over.
//!
//! A pure value. A path is one conversation of several requests: each waypoint goes out when the one before it has been
//! accepted, and the first that is refused ends the conversation, because the bridge then discards the whole path.
//!
//! A waypoint before the last is `done` when the bridge has taken the next one. So at most two requests of a path are open,
//! and when a path is broken, the newest open waypoint is answered with the reason.

use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

use crate::render::messages::FinalReport;

/// When the conversation is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// With the final report.
    Final,
    /// As soon as the last request was accepted.
    Accepted,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Send the request of this index.
    Send(usize),
    /// Wait for a report, at most until then.
    Wait(Option<MonotonicNs>),
    /// Nothing; it is over.
    Over(Outcome),
}

/// How the conversation ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The last request was accepted, which was all that was asked for.
    Accepted,
    /// The final report.
    Final(FinalReport),
    /// The bridge did not answer the request of this index in time.
    NoAnswer(usize),
}

/// How far the conversation is, for a command that must end early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The bridge has not taken all requests, and without their sender it never will.
    Incomplete,
    /// The bridge has taken them and goes on with them.
    Taken,
}

/// See the module's documentation.
#[derive(Debug)]
pub struct Exchange {
    requests: Vec<State>,
    sent: usize,
    until: Until,
    timeout: Duration,
    /// Until when the awaited report must have come.
    due: MonotonicNs,
}

/// What has been reported about a request.
#[derive(Clone, Copy, Debug)]
struct State {
    request_id: u64,
    is_answered: bool,
    end: Option<FinalReport>,
}

impl State {
    fn failed(&self) -> Option<FinalReport> {
        self.end.filter(|end| end.stage != Stage::Done)
    }
}

impl Exchange {
    /// The conversation about the requests with these ids, in this order. `timeout` bounds the first answer to each.
    pub fn new(
        request_ids: impl IntoIterator<Item = u64>,
        until: Until,
        timeout: Duration,
    ) -> Exchange {
        let state = |request_id| State {
            request_id,
            is_answered: false,
            end: None,
        };
        Exchange {
            requests: request_ids.into_iter().map(state).collect(),
            sent: 0,
            until,
            timeout,
            due: MonotonicNs(u64::MAX),
        }
    }

    /// The request that [`Next::Send`] named has been sent.
    pub fn sent(&mut self, now: MonotonicNs) {
        self.sent += 1;
        self.due = now + self.timeout;
    }

    /// Takes a report and gives the index of the request that it answers; `None` if it is none of these.
    pub fn take(&mut self, report: &RequestReport, now: MonotonicNs) -> Option<usize> {
        let index = self
            .requests
            .iter()
            .position(|request| request.request_id == report.request_id)?;
        let had_failed = self
            .requests
            .iter()
            .any(|request| request.failed().is_some());
        let request = &mut self.requests[index];
        request.is_answered = true;
        request.end = request.end.or(FinalReport::of(report));
        if !had_failed && request.failed().is_some() {
            // The final reports about the other waypoints of a broken path come together with the first one.
            self.due = now + self.timeout;
        }
        Some(index)
    }

    /// What to do at `now`.
    pub fn next(&self, now: MonotonicNs) -> Next {
        let (sent, unsent) = self.requests.split_at(self.sent.min(self.requests.len()));
        if let Some(culprit) = culprit(sent) {
            let all_answered = sent.iter().all(|request| request.end.is_some());
            return if all_answered || now >= self.due {
                Next::Over(Outcome::Final(culprit))
            } else {
                Next::Wait(Some(self.due))
            };
        }
        match (sent.last(), unsent.is_empty()) {
            (Some(last), _) if !last.is_answered => {
                if now >= self.due {
                    Next::Over(Outcome::NoAnswer(sent.len() - 1))
                } else {
                    Next::Wait(Some(self.due))
                }
            }
            (_, false) => Next::Send(sent.len()),
            (Some(last), true) => match last.end {
                Some(end) => Next::Over(Outcome::Final(end)),
                None if self.until == Until::Accepted => Next::Over(Outcome::Accepted),
                None => Next::Wait(None),
            },
            (None, true) => Next::Over(Outcome::Accepted),
        }
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        match self.requests.last() {
            Some(last) if !last.is_answered => Progress::Incomplete,
            _ => Progress::Taken,
        }
    }
}

/// The failure that says most: the newest that is not the mere consequence of another one, else the newest.
fn culprit(sent: &[State]) -> Option<FinalReport> {
    let failures = || sent.iter().rev().filter_map(State::failed);
    let is_cause =
        |end: &FinalReport| !matches!(end.reason, Reason::PathBroken | Reason::PathWithoutHead);
    failures().find(is_cause).or_else(|| failures().next())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_millis(100);

    /// Milliseconds.
    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// A conversation about requests with the ids 0, 1, 2 …
    struct Harness {
        exchange: Exchange,
        now: MonotonicNs,
    }

    impl Harness {
        fn new(requests: u64, until: Until) -> Harness {
            Harness {
                exchange: Exchange::new(0..requests, until, TIMEOUT),
                now: at(0),
            }
        }

        /// A path of three of which this many have been sent and accepted.
        fn accepted(count: usize) -> Harness {
            let mut harness = Harness::new(3, Until::Final);
            for index in 0..count {
                harness.sends(index);
                harness.says(index, Stage::Accepted, Reason::None);
            }
            harness
        }

        fn next(&self) -> Next {
            self.exchange.next(self.now)
        }

        fn sends(&mut self, index: usize) {
            assert_eq!(self.next(), Next::Send(index));
            self.exchange.sent(self.now);
        }

        fn says(&mut self, index: usize, stage: Stage, reason: Reason) {
            let report = RequestReport {
                request_id: index as u64,
                ..RequestReport::new(stage, reason)
            };
            assert_eq!(self.exchange.take(&report, self.now), Some(index));
        }

        fn is_over_with(&self, stage: Stage, reason: Reason) {
            let next = self.next();
            let Next::Over(Outcome::Final(end)) = next else {
                panic!("{next:?}");
            };
            assert_eq!((end.stage, end.reason), (stage, reason));
        }
    }

    #[test]
    fn a_single_request_is_followed_to_its_final_report() {
        let mut harness = Harness::new(1, Until::Final);
        harness.sends(0);
        assert_eq!(harness.next(), Next::Wait(Some(at(100))));
        harness.says(0, Stage::Accepted, Reason::None);
        harness.now = at(5_000_000);
        assert_eq!(
            harness.next(),
            Next::Wait(None),
            "a movement has its own limit of time"
        );
        harness.says(0, Stage::Progress, Reason::None);
        assert_eq!(harness.next(), Next::Wait(None));
        harness.says(0, Stage::Done, Reason::None);
        harness.is_over_with(Stage::Done, Reason::None);
    }

    #[test]
    fn a_command_that_does_not_wait_ends_when_it_is_accepted_but_learns_of_a_refusal() {
        let mut harness = Harness::new(1, Until::Accepted);
        harness.sends(0);
        harness.says(0, Stage::Accepted, Reason::None);
        assert_eq!(harness.next(), Next::Over(Outcome::Accepted));

        let mut harness = Harness::new(1, Until::Accepted);
        harness.sends(0);
        harness.says(0, Stage::Refused, Reason::Busy);
        harness.is_over_with(Stage::Refused, Reason::Busy);
    }

    #[test]
    fn a_path_goes_out_waypoint_by_waypoint_and_ends_with_the_last_one_s_report() {
        let mut harness = Harness::accepted(2);
        harness.sends(2);
        harness.says(0, Stage::Done, Reason::None);
        harness.says(1, Stage::Done, Reason::None);
        assert_eq!(harness.next(), Next::Wait(Some(at(100))));
        harness.says(2, Stage::Accepted, Reason::None);
        assert_eq!(harness.next(), Next::Wait(None));
        harness.says(2, Stage::Aborted, Reason::Stopped);
        harness.is_over_with(Stage::Aborted, Reason::Stopped);
    }

    /// A path of which each waypoint was taken, and the one before it done thereby.
    fn assembled(count: usize) -> Harness {
        let mut harness = Harness::new(count as u64, Until::Final);
        for index in 0..count {
            harness.sends(index);
            if index > 0 {
                harness.says(index - 1, Stage::Done, Reason::None);
            }
            if index + 1 < count {
                harness.says(index, Stage::Accepted, Reason::None);
            }
        }
        harness
    }

    #[test]
    fn a_waypoint_that_is_done_while_the_path_is_assembled_ends_nothing() {
        let mut harness = assembled(1024);
        assert_eq!(harness.next(), Next::Wait(Some(at(100))));
        harness.says(1023, Stage::Accepted, Reason::None);
        assert_eq!(harness.next(), Next::Wait(None));
        harness.says(1023, Stage::Done, Reason::None);
        harness.is_over_with(Stage::Done, Reason::None);
    }

    #[test]
    fn a_refused_waypoint_ends_an_assembly_whose_first_waypoints_are_done() {
        let mut harness = assembled(3);
        harness.says(2, Stage::Refused, Reason::FenceBreach);
        harness.is_over_with(Stage::Refused, Reason::FenceBreach);

        // The waypoint before it was still open.
        let mut harness = Harness::accepted(1);
        harness.sends(1);
        harness.says(1, Stage::Accepted, Reason::None);
        harness.says(0, Stage::Done, Reason::None);
        harness.sends(2);
        harness.says(1, Stage::Aborted, Reason::PathBroken);
        assert!(matches!(harness.next(), Next::Wait(Some(_))));
        harness.says(2, Stage::Refused, Reason::TooFar);
        harness.is_over_with(Stage::Refused, Reason::TooFar);
    }

    #[test]
    fn a_path_that_is_broken_while_a_waypoint_is_on_its_way_ends_with_the_cause() {
        for reason in [Reason::PathReplaced, Reason::Stopped] {
            let mut harness = Harness::accepted(2);
            harness.says(0, Stage::Done, Reason::None);
            harness.sends(2);
            harness.says(1, Stage::Aborted, reason);
            // The bridge knows nothing of the path any more when its last waypoint comes.
            harness.says(2, Stage::Refused, Reason::PathWithoutHead);
            harness.is_over_with(Stage::Aborted, reason);
        }
    }

    #[test]
    fn the_first_refusal_ends_a_path_and_nothing_follows() {
        let mut harness = Harness::accepted(1);
        harness.sends(1);
        // The bridge breaks the path before it refuses the waypoint that broke it.
        harness.says(0, Stage::Aborted, Reason::PathBroken);
        assert_eq!(
            harness.next(),
            Next::Wait(Some(at(100))),
            "the reason is still to come"
        );
        harness.says(1, Stage::Refused, Reason::TooFar);
        harness.is_over_with(Stage::Refused, Reason::TooFar);
    }

    #[test]
    fn a_path_that_is_broken_between_two_waypoints_is_over_with_the_reason() {
        for reason in [Reason::PathReplaced, Reason::TooLate] {
            let mut harness = Harness::accepted(2);
            harness.says(0, Stage::Aborted, reason);
            assert!(
                matches!(harness.next(), Next::Wait(Some(_))),
                "the other one follows"
            );
            harness.says(1, Stage::Aborted, reason);
            harness.is_over_with(Stage::Aborted, reason);
        }
    }

    #[test]
    fn a_bridge_that_breaks_a_path_and_then_hangs_is_not_waited_for() {
        let mut harness = Harness::accepted(1);
        harness.sends(1);
        harness.now = at(30);
        harness.says(0, Stage::Aborted, Reason::PathBroken);
        assert_eq!(harness.next(), Next::Wait(Some(at(130))));
        harness.now = at(130);
        harness.is_over_with(Stage::Aborted, Reason::PathBroken);
    }

    #[test]
    fn no_answer_in_time_is_reported_with_the_request() {
        for count in 0..3 {
            let mut harness = Harness::accepted(count);
            harness.sends(count);
            harness.now = at(99);
            assert_eq!(harness.next(), Next::Wait(Some(at(100))));
            harness.now = at(100);
            assert_eq!(harness.next(), Next::Over(Outcome::NoAnswer(count)));
        }
    }

    #[test]
    fn a_bridge_that_vanishes_leaves_the_outcome_unknown() {
        let mut harness = Harness::accepted(2);
        harness.sends(2);
        for index in 0..3 {
            harness.says(index, Stage::Unknown, Reason::BridgeGone);
        }
        harness.is_over_with(Stage::Unknown, Reason::BridgeGone);
    }

    #[test]
    fn until_the_last_request_is_answered_it_is_incomplete() {
        let mut harness = Harness::accepted(2);
        assert_eq!(harness.exchange.progress(), Progress::Incomplete);
        harness.sends(2);
        assert_eq!(harness.exchange.progress(), Progress::Incomplete);
        harness.says(2, Stage::Accepted, Reason::None);
        assert_eq!(harness.exchange.progress(), Progress::Taken);
    }

    #[test]
    fn a_report_about_another_s_request_and_a_second_final_report_change_nothing() {
        let mut harness = Harness::new(1, Until::Final);
        harness.sends(0);
        let stranger = RequestReport {
            request_id: 9,
            ..RequestReport::new(Stage::Done, Reason::None)
        };
        assert_eq!(harness.exchange.take(&stranger, harness.now), None);
        harness.says(0, Stage::Refused, Reason::Busy);
        harness.says(0, Stage::Done, Reason::None);
        harness.is_over_with(Stage::Refused, Reason::Busy);
    }
}
