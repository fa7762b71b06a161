//! The witness: takes what the bridge says in the place of shared memory, and checks what every consumer relies on.

use std::collections::BTreeMap;

use bridge::{Outputs, RequestKey};
use ipc_types::code::{Functionality, ImiCode, ModuleId, ModuleStatus, Reason, Stage};
use ipc_types::payload::{DspTelemetry, ModuleState, MovementEnd, RequestReport};
use ipc_types::{MonotonicNs, TelemetryGroup};

use crate::plausible::assert_plausible;

/// Longest time between two published states, with the default configuration.
const STATE_PERIOD_NS: u64 = 1_000_000_000;

/// Longest time between two samples on a sound line, by the DSP's clock.
const LONGEST_GAP_MS: u32 = 60_000;

/// The last word about a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    pub stage: Stage,
    pub reason: Reason,
    pub imi: ImiCode,
}

impl Outcome {
    pub const DONE: Outcome = Outcome {
        stage: Stage::Done,
        reason: Reason::None,
        imi: ImiCode(0),
    };

    pub fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }
}

/// Takes what the bridge publishes and reports, and checks what every consumer relies on.
pub struct Witness {
    /// The present; the world sets it before it gives the bridge anything.
    pub now: MonotonicNs,
    /// Samples that nobody has looked at yet.
    pub fresh: Vec<DspTelemetry>,
    /// Samples so far.
    pub samples: u64,
    /// What the module did: each pair once for as long as it lasts.
    pub phases: Vec<(ModuleStatus, Functionality)>,
    pub state: ModuleState,
    /// Samples of bridges that were killed.
    samples_before: u64,
    last: Option<DspTelemetry>,
    last_state: Option<MonotonicNs>,
    requests: BTreeMap<u64, Vec<RequestReport>>,
    /// Whether every message arrives: then the DSP's clock never seems to go back.
    is_sound: bool,
}

impl Witness {
    pub fn new(is_sound: bool) -> Witness {
        Witness {
            now: MonotonicNs(0),
            fresh: Vec::new(),
            samples: 0,
            phases: Vec::new(),
            state: ModuleState::default(),
            samples_before: 0,
            last: None,
            last_state: None,
            requests: BTreeMap::new(),
            is_sound,
        }
    }

    /// A request is about to be sent.
    pub fn expect(&mut self, request_id: u64) {
        self.requests.insert(request_id, Vec::new());
    }

    /// The bridge was killed, or nobody is there to take a request. A client's own side gives it its final report then;
    /// what the next bridge says begins anew.
    pub fn bridge_gone(&mut self) {
        for (request_id, words) in &mut self.requests {
            if !words.last().is_some_and(RequestReport::is_final) {
                words.push(RequestReport {
                    request_id: *request_id,
                    reported_ns: self.now.0,
                    ..RequestReport::new(Stage::Unknown, Reason::BridgeGone)
                });
            }
        }
        self.samples_before = self.samples;
        self.state = ModuleState::default();
        (self.last, self.last_state) = (None, None);
    }

    /// How many requests were sent.
    pub fn request_count(&self) -> u64 {
        self.requests.len() as u64
    }

    /// How many requests ended for this reason.
    pub fn count(&self, reason: Reason) -> u64 {
        let reports = self.requests.values().filter_map(|words| words.last());
        reports
            .filter(|report| report.is_final() && report.reason() == Some(reason))
            .count() as u64
    }

    /// All words about a request.
    pub fn words(&self, request_id: u64) -> &[RequestReport] {
        &self.requests[&request_id]
    }

    /// The final report about a request, if it has been said.
    pub fn outcome(&self, request_id: u64) -> Option<Outcome> {
        let last = self.words(request_id).last()?;
        last.is_final().then(|| Outcome {
            stage: last.stage().expect("a stage of the contract"),
            reason: last.reason().expect("a reason of the contract"),
            imi: last.imi_error(),
        })
    }

    /// The latest sample.
    pub fn latest(&self) -> Option<&DspTelemetry> {
        self.last.as_ref()
    }

    /// Every request has had its final report.
    pub fn assert_all_answered(&self) {
        let unanswered: Vec<_> = self
            .requests
            .iter()
            .filter(|(_, words)| !words.last().is_some_and(RequestReport::is_final))
            .collect();
        assert!(
            unanswered.is_empty(),
            "without a final report: {unanswered:?}"
        );
    }

    fn check_order(&self, sample: &DspTelemetry) {
        let Some(last) = &self.last else {
            return;
        };
        assert!(
            sample.received_ns >= last.received_ns,
            "{sample:?} after {last:?}"
        );
        assert!(
            sample.dsp_boots >= last.dsp_boots,
            "{sample:?} after {last:?}"
        );
        let both_timed = sample.valid(TelemetryGroup::Time) && last.valid(TelemetryGroup::Time);
        if self.is_sound && both_timed && sample.dsp_boots == last.dsp_boots {
            // The clock wraps after 49.7 days.
            let passed_ms = sample.dsp_time_ms.wrapping_sub(last.dsp_time_ms);
            assert!(
                (1..=LONGEST_GAP_MS).contains(&passed_ms),
                "{sample:?} after {last:?}"
            );
        }
    }
}

impl Outputs for Witness {
    fn notice(&mut self, _: &bridge::outputs::Notice) {}

    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut sample = DspTelemetry::default();
        fill(&mut sample);
        assert_eq!(
            (sample.sequence, sample.epoch_ns),
            (0, 0),
            "the publisher's"
        );
        self.samples += 1;
        sample.sequence = self.samples;
        assert_plausible(&sample);
        assert!(
            sample.received_ns <= self.now.0,
            "received in the future: {sample:?}"
        );
        self.check_order(&sample);
        self.last = Some(sample);
        self.fresh.push(sample);
    }

    fn state(&mut self, state: &ModuleState) {
        let last = self.last_state.replace(self.now).unwrap_or(self.now);
        let age_ns = self.now.0 - last.0;
        assert!(age_ns <= STATE_PERIOD_NS, "no state for {age_ns} ns");
        assert_consistent(state);
        let before = &self.state;
        assert!(state.link.telemetry_published >= before.link.telemetry_published);
        assert_eq!(
            u64::from(state.link.telemetry_published),
            self.samples - self.samples_before
        );
        assert!(state.refused.requests >= before.refused.requests);
        if let Some(report) =
            (self.requests.get(&state.last_end.request_id)).and_then(|words| words.last())
        {
            assert_eq!(
                state.last_end,
                end_of(report, &state.last_end),
                "{report:?}"
            );
        }
        assert!(state.dsp_errors.total >= before.dsp_errors.total);
        let phase = (
            state.status().expect("a status of the contract"),
            state.functionality().expect("one of the contract"),
        );
        if self.phases.last() != Some(&phase) {
            self.phases.push(phase);
        }
        self.state = *state;
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        let (RequestKey::Control(id) | RequestKey::Movement(id) | RequestKey::Parameter(id)) = to;
        assert_eq!(id, report.request_id, "a report for another request");
        assert_eq!(report.reported_ns, self.now.0, "{report:?}");
        let Some(words) = self.requests.get_mut(&id) else {
            panic!("nobody sent the request of {report:?}");
        };
        let stage = report.stage().expect("a stage of the contract");
        assert!(report.reason().is_some(), "{report:?}");
        assert!(
            report.waypoints_sent <= report.waypoints_total,
            "{report:?}"
        );
        assert!(
            report.waypoints_reached <= report.waypoints_sent,
            "{report:?}"
        );
        match words.last() {
            None => assert_ne!(
                stage,
                Stage::Progress,
                "progress before acceptance: {report:?}"
            ),
            Some(last) => {
                assert!(!last.is_final(), "{report:?} after the final {last:?}");
                assert!(
                    !matches!(stage, Stage::Accepted | Stage::Refused),
                    "{report:?} after {last:?}"
                );
                assert!(
                    report.waypoints_sent >= last.waypoints_sent,
                    "{report:?} after {last:?}"
                );
                assert!(
                    report.waypoints_reached >= last.waypoints_reached,
                    "{report:?} after {last:?}"
                );
            }
        }
        words.push(*report);
    }
}

/// How the movement of this final report ended, as everybody is told.
fn end_of(report: &RequestReport, end: &MovementEnd) -> MovementEnd {
    assert!(report.is_final(), "{report:?}");
    MovementEnd {
        ended_ns: report.reported_ns,
        request_id: report.request_id,
        stage: report.stage,
        reason: report.reason,
        waypoints_reached: report.waypoints_reached,
        ..*end
    }
}

/// What the fields of a state say must fit together.
fn assert_consistent(state: &ModuleState) {
    use Functionality as F;
    use ModuleStatus as S;
    assert_eq!(state.module(), Some(ModuleId::HeroBridge));
    let status = state.status().expect("a status of the contract");
    let functionality = state.functionality().expect("one of the contract");
    let fits = match functionality {
        F::TakingOff | F::Landing => {
            status == S::Running && !state.is_blocked() && state.is_unable_to_abort()
        }
        F::FollowingPath | F::Holding => {
            status == S::Running && !state.is_blocked() && !state.is_unable_to_abort()
        }
        F::Stopping => state.is_blocked() && !state.is_unable_to_abort(),
        F::ReceivingPath => !state.is_blocked() && !state.is_unable_to_abort(),
        F::AtRest => {
            let must_block = matches!(status, S::WaitingDataToStart | S::Aborted);
            (!must_block || state.is_blocked()) && !state.is_unable_to_abort()
        }
    };
    assert!(fits, "{state:?}");
    assert!(status != S::Running || !state.is_blocked(), "{state:?}");
    let movement = &state.movement;
    assert!(
        movement.waypoints_reached <= movement.waypoints_sent,
        "{movement:?}"
    );
    assert!(
        movement.waypoints_sent <= movement.waypoints_total,
        "{movement:?}"
    );
    assert!(movement.distance_to_go_m.is_finite(), "{movement:?}");
}

/// Asserts that `act` panics with a message that contains `expected`.
#[cfg(test)]
#[track_caller]
pub fn assert_panics(expected: &str, act: impl FnOnce()) {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    let failure = catch_unwind(AssertUnwindSafe(act)).expect_err(expected);
    let text = failure.downcast_ref::<String>().cloned();
    let text = text.or_else(|| Some((*failure.downcast_ref::<&str>()?).to_owned()));
    assert!(
        text.as_ref().is_some_and(|text| text.contains(expected)),
        "{expected}: {text:?}"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    const REQUEST: RequestKey = RequestKey::Control(1);

    fn witness() -> Witness {
        let mut witness = Witness::new(true);
        witness.expect(1);
        witness
    }

    fn says(witness: &mut Witness, stages: &[Stage]) {
        for stage in stages {
            let report = RequestReport {
                request_id: 1,
                ..RequestReport::new(*stage, Reason::None)
            };
            witness.report(REQUEST, &report);
        }
    }

    #[test]
    fn what_is_wrong_is_noticed() {
        let at = |witness: &mut Witness, time_ms| {
            witness.telemetry(&mut |sample| {
                sample.valid_groups = TelemetryGroup::Time.bit();
                sample.dsp_time_ms = time_ms;
            });
        };
        type Case<'a> = (&'a str, &'a dyn Fn(&mut Witness));
        let cases: [Case; 8] = [
            ("after the final", &|witness| {
                says(witness, &[Stage::Accepted, Stage::Done, Stage::Aborted]);
            }),
            ("progress before acceptance", &|witness| {
                says(witness, &[Stage::Progress]);
            }),
            ("without a final report", &|witness| {
                says(witness, &[Stage::Accepted]);
                witness.assert_all_answered();
            }),
            ("nobody sent the request", &|_| {
                says(&mut Witness::new(true), &[Stage::Done]);
            }),
            ("Geographic of", &|witness| {
                witness.telemetry(&mut |sample| {
                    sample.valid_groups = TelemetryGroup::Geographic.bit();
                    sample.geographic.latitude_deg = 90.1;
                });
            }),
            ("a group that is not valid holds something", &|witness| {
                witness.telemetry(&mut |sample| sample.sonar_adc = 1);
            }),
            // A clock that stands still.
            ("after DspTelemetry", &|witness| {
                at(witness, 20);
                at(witness, 20);
            }),
            ("no state for", &|witness| {
                let state = ril_tests::StandInBridge::idle_state();
                witness.state(&state);
                witness.now = MonotonicNs(STATE_PERIOD_NS + 1);
                witness.state(&state);
            }),
        ];
        for (expected, act) in cases {
            let mut witness = witness();
            assert_panics(expected, || act(&mut witness));
        }
    }

    #[test]
    fn what_is_in_order_passes() {
        let mut witness = witness();
        says(
            &mut witness,
            &[
                Stage::Accepted,
                Stage::Progress,
                Stage::Progress,
                Stage::Done,
            ],
        );
        witness.assert_all_answered();
        assert!(witness.outcome(1).expect("a final report").is_done());
        for time in [20, 40] {
            witness.telemetry(&mut |sample| {
                sample.valid_groups = TelemetryGroup::Time.bit();
                sample.dsp_time_ms = time;
            });
        }
        assert_eq!(witness.samples, 2);
    }
}
