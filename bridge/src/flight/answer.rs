//! Answers to requests: each gets one final report, and none is executed twice (requirement D15).

use ipc_types::MonotonicNs;
use ipc_types::code::{ImiError, Reason, Stage};
use ipc_types::payload::{MovementState, RequestReport};

use super::issue_order::Mark;
use super::report::{Refusal, Verdict, in_time};
use super::request::RequestHeader;
use super::{Context, Flight};
use crate::outputs::Outputs;

impl Flight {
    pub(super) fn progress<O: Outputs>(&mut self, cx: &mut Context<'_, O>) {
        self.is_changed = true;
        if let Some(requester) = self.motion.requester().copied() {
            self.report(&requester, &Verdict::PROGRESS, cx);
        }
    }

    pub(super) fn refuse<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        refusal: &Refusal,
        cx: &mut Context<'_, O>,
    ) {
        self.refused_requests = self.refused_requests.saturating_add(1);
        if refusal.error != ImiError::None {
            self.refusal = refusal.error;
        }
        self.is_changed = true;
        self.report(header, &refusal.verdict(), cx);
    }

    pub(super) fn report<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        verdict: &Verdict,
        cx: &mut Context<'_, O>,
    ) {
        if verdict.stage == Stage::Accepted {
            self.refusal = ImiError::None;
        }
        // The counts belong to the movement of this request, or to the path that its waypoint lies in.
        let own = header.request_id == self.movement.request_id
            && header.path_id == self.movement.path_id;
        let counts = if own {
            self.movement
        } else {
            MovementState {
                waypoints_total: self.assembler.waypoints().len() as u32,
                ..MovementState::default()
            }
        };
        let mut report = RequestReport {
            request_id: header.request_id,
            path_id: header.path_id,
            reported_ns: cx.now.0,
            waypoints_total: counts.waypoints_total,
            waypoints_sent: counts.waypoints_sent,
            waypoints_reached: counts.waypoints_reached,
            ..RequestReport::default()
        };
        verdict.write(&mut report);
        if verdict.stage.is_final() {
            self.completed.note(&report);
        }
        cx.out.report(header.key, &report);
    }

    /// Whether a movement may be taken at `now`: as [`Flight::may_begin`], and it belongs to the path under assembly or was not
    /// issued before it.
    pub(super) fn may_be_taken(
        &self,
        header: &RequestHeader,
        now: MonotonicNs,
    ) -> Result<(), Refusal> {
        let mut mark = self.mark;
        if let Some(newest) = &self.newest_waypoint
            && newest.path_id != header.path_id
        {
            mark.take(&newest.issued);
        }
        judge(&mark, header, now)
    }

    /// Whether an order may begin at `now`, or begin on the DSP after it was accepted: no later order was taken, and its moment
    /// has not passed.
    pub(super) fn may_begin(
        &self,
        header: &RequestHeader,
        now: MonotonicNs,
    ) -> Result<(), Refusal> {
        judge(&self.mark, header, now)
    }

    /// Whether this request may be executed. One that was asked before is answered here, and never executed twice.
    pub(super) fn is_new<O: Outputs>(
        &mut self,
        header: &RequestHeader,
        cx: &mut Context<'_, O>,
    ) -> bool {
        if let Some(report) = self.completed.report_of(header.request_id) {
            let report = RequestReport {
                reported_ns: cx.now.0,
                ..*report
            };
            cx.out.report(header.key, &report);
            return false;
        }
        let refusal = if header.request_id == 0 {
            (Stage::Refused, Reason::InvalidRequest)
        } else if self.is_open(header.request_id) {
            (Stage::Refused, Reason::StillOpen)
        } else if header.repeat {
            (Stage::Unknown, Reason::NotRemembered)
        } else if self.is_ending {
            (Stage::Refused, Reason::BridgeEnding)
        } else {
            return true;
        };
        // Not remembered: this is not the final report of the request that was asked first.
        let report = RequestReport {
            request_id: header.request_id,
            path_id: header.path_id,
            reported_ns: cx.now.0,
            ..RequestReport::new(refusal.0, refusal.1)
        };
        self.refused_requests = self.refused_requests.saturating_add(1);
        cx.out.report(header.key, &report);
        false
    }

    /// Whether a request with this id has not had its final report.
    fn is_open(&self, request_id: u64) -> bool {
        self.newest_waypoint
            .iter()
            .chain(self.motion.requester())
            .chain(self.parameters.open())
            .any(|header| header.request_id == request_id)
    }
}

fn judge(mark: &Mark, header: &RequestHeader, now: MonotonicNs) -> Result<(), Refusal> {
    if mark.supersedes(&header.issued) {
        return Err(Reason::Superseded.into());
    }
    in_time(header, now)
}
