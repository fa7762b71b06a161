//! Completed requests: asking again with the same id never executes twice (requirement D15).
//!
//! | the id is | asked again |
//! |---|---|
//! | ended not long ago | gets the same final report once more |
//! | open | refused: still-open; the first stream goes on |
//! | unknown, and the request says that it is a repetition | unknown: a bridge that died may have carried it out |
//! | unknown, and the request is a first one | executed |

use std::collections::VecDeque;

use ipc_types::payload::RequestReport;
use serde::{Deserialize, Serialize};

/// The last final reports, oldest first. An older one is forgotten, and asking again for it as a repetition is answered with
/// `unknown`, which is true.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Completed {
    #[serde(with = "reports")]
    ended: VecDeque<RequestReport>,
    /// Not of a snapshot: after one, [`Completed::set_capacity`] says it.
    #[serde(skip)]
    capacity: usize,
}

impl Completed {
    /// Nothing remembered, and room for so many reports. All memory that it will ever need is taken here.
    pub fn with_capacity(capacity: usize) -> Self {
        Completed {
            ended: VecDeque::with_capacity(capacity),
            capacity,
        }
    }

    /// Makes room for so many reports, and forgets the oldest of those that have none: after a snapshot.
    pub fn set_capacity(&mut self, capacity: usize) {
        let surplus = self.ended.len().saturating_sub(capacity);
        self.ended.drain(..surplus);
        self.ended.reserve(capacity - self.ended.len());
        self.capacity = capacity;
    }

    /// Remembers a final report.
    pub fn note(&mut self, report: &RequestReport) {
        if self.ended.len() == self.capacity {
            self.ended.pop_front();
        }
        self.ended.push_back(*report);
    }

    /// The final report of this request, if it is remembered.
    pub fn report_of(&self, request_id: u64) -> Option<&RequestReport> {
        self.ended
            .iter()
            .rfind(|report| report.request_id == request_id)
    }
}

/// Reports as values of serde.
mod reports {
    use super::{Deserialize, RequestReport, VecDeque};
    use crate::journal::raw::Raw;
    use serde::{Deserializer, Serializer};

    pub fn serialize<S: Serializer>(
        reports: &VecDeque<RequestReport>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(reports.iter().map(|report| Raw(*report)))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<VecDeque<RequestReport>, D::Error> {
        let reports = VecDeque::<Raw<RequestReport>>::deserialize(from)?;
        Ok(reports.into_iter().map(|Raw(report)| report).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(request_id: u64, stage: u32) -> RequestReport {
        RequestReport {
            request_id,
            stage,
            ..RequestReport::default()
        }
    }

    #[test]
    fn the_last_final_reports_are_remembered_and_the_oldest_forgotten() {
        let mut completed = Completed::with_capacity(2);
        let capacity = completed.ended.capacity();
        for id in 1..=3 {
            completed.note(&report(id, 16));
        }
        assert_eq!(completed.report_of(1), None);
        assert_eq!(completed.report_of(2), Some(&report(2, 16)));
        assert_eq!(completed.ended.capacity(), capacity, "it never grows");
    }
}
