//! What became of every request, and the rules that it must keep.

use std::collections::BTreeMap;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;

use super::bridge::Bridge;

/// One request of a client.
pub(super) struct Case {
    pub(super) slot: usize,
    /// The moment after which it must not be executed, in true time.
    pub(super) expires: u64,
    /// The client, or its station, is gone: it gets no report.
    pub(super) is_gone: bool,
    has_begun: bool,
    end: Option<(u32, u32)>,
}

/// How many requests ended in which way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) requests: u32,
    pub(super) done: u32,
    pub(super) aborted: u32,
    pub(super) refused_by_relay: u32,
    pub(super) refused_by_server: u32,
    pub(super) unknown: u32,
    pub(super) client_gone: u32,
    pub(super) executed: u32,
}

#[derive(Default)]
pub(super) struct Cases {
    pub(super) of: BTreeMap<u64, Case>,
}

impl Cases {
    pub(super) fn begin(&mut self, id: u64, slot: usize, expires: u64) {
        let case = Case {
            slot,
            expires,
            is_gone: false,
            has_begun: false,
            end: None,
        };
        assert!(self.of.insert(id, case).is_none(), "an id of its own");
    }

    /// The client gives its request up. False when that has ended.
    pub(super) fn give_up(&mut self, id: u64) -> bool {
        let case = self.of.get_mut(&id).expect("a request that was made");
        let is_open = case.end.is_none() && !case.is_gone;
        case.is_gone |= is_open;
        is_open
    }

    /// A station ends with all its clients.
    pub(super) fn station_gone(&mut self, slot: usize) {
        for case in self.of.values_mut() {
            case.is_gone |= case.slot == slot && case.end.is_none();
        }
    }

    pub(super) fn executed(&self, id: u64, now: u64) {
        let case = &self.of[&id];
        assert!(now <= case.expires, "{id} was executed after its deadline");
    }

    pub(super) fn report(&mut self, handle: u64, report: &RequestReport, bridge: &Bridge) {
        let id = report.request_id;
        assert_eq!((handle, report.path_id), (id, id + 1), "whose report it is");
        let case = self.of.get_mut(&id).expect("a request that was made");
        assert!(!case.is_gone, "{id}: a report to a client that is gone");
        assert_eq!(case.end, None, "{id}: a report after the final one");
        match report.stage().expect("a stage") {
            Stage::Accepted => assert!(!case.has_begun, "{id}: accepted twice"),
            Stage::Progress => assert!(case.has_begun, "{id}: progress before accepted"),
            Stage::Done | Stage::Aborted => {
                let end = bridge.ends.get(&id).copied();
                assert_eq!(end, Some((report.stage, report.reason)), "{id}: invented");
            }
            Stage::Refused | Stage::Unknown => {}
        }
        case.has_begun = true;
        if report.is_final() {
            case.end = Some((report.stage, report.reason));
        }
    }

    /// Everything has come to its end.
    pub(super) fn check(&self, bridge: &Bridge) -> Counts {
        for (id, executions) in &bridge.executions {
            assert_eq!(*executions, 1, "{id} was executed so often");
        }
        let mut counts = Counts::default();
        for (id, case) in &self.of {
            counts.requests += 1;
            let executions = bridge.executions.get(id).copied().unwrap_or(0);
            counts.executed += executions;
            if case.is_gone {
                counts.client_gone += 1;
                continue;
            }
            let (stage, reason) = case.end.unwrap_or_else(|| panic!("{id}: lost in silence"));
            let by_server = bridge.ends.get(id) == Some(&(stage, reason));
            match Stage::from_code(stage).expect("a stage") {
                Stage::Done => counts.done += 1,
                Stage::Aborted => counts.aborted += 1,
                Stage::Unknown => counts.unknown += 1,
                Stage::Refused => {
                    assert_eq!(executions, 0, "{id}: refused and executed");
                    assert!(by_server || is_of_relay(reason), "{id}: refused: {reason}");
                    if by_server {
                        counts.refused_by_server += 1;
                    } else {
                        counts.refused_by_relay += 1;
                    }
                }
                stage => panic!("{id}: {stage} is not final"),
            }
        }
        counts
    }
}

fn is_of_relay(reason: u32) -> bool {
    let reasons = [
        Reason::RelayLinkDown,
        Reason::RelayTooManyStations,
        Reason::TooManyRequests,
        Reason::TooLate,
        Reason::BridgeGone,
    ];
    reasons.iter().any(|known| known.code() == reason)
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Counts) {
        self.requests += other.requests;
        self.done += other.done;
        self.aborted += other.aborted;
        self.refused_by_relay += other.refused_by_relay;
        self.refused_by_server += other.refused_by_server;
        self.unknown += other.unknown;
        self.client_gone += other.client_gone;
        self.executed += other.executed;
    }
}
