//! Exchanges: what is sent when, and how they end.

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
