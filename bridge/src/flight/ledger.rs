//! The memory for requests: asking again with the same id never executes twice (requirement D15).
//!
//! | the id is | asked again |
//! |---|---|
//! | ended not long ago | gets the same final word once more |
//! | open | refused: busy; the first stream goes on |
//! | unknown, and the request says that it is a repetition | unknown: a bridge that died may have carried it out |
//! | unknown, and the request is a first one | executed |

use std::collections::VecDeque;

use ipc_types::payload::RequestReport;

/// Final words that are remembered: of four whole paths of 64 waypoints. An older one is forgotten, and asking again
/// for it as a repetition is answered with `unknown`, which is true.
pub const REMEMBERED: usize = 256;

/// The last final words, oldest first.
#[derive(Clone, Debug)]
pub struct Ledger {
    ended: VecDeque<RequestReport>,
}

impl Ledger {
    /// Nothing remembered. All memory that it will ever need is taken here.
    pub fn new() -> Self {
        Ledger {
            ended: VecDeque::with_capacity(REMEMBERED),
        }
    }

    /// Remembers a final word.
    pub fn note(&mut self, report: &RequestReport) {
        if self.ended.len() == REMEMBERED {
            self.ended.pop_front();
        }
        self.ended.push_back(*report);
    }

    /// The final word of this request, if it is remembered.
    pub fn final_word(&self, request_id: u64) -> Option<&RequestReport> {
        self.ended
            .iter()
            .rfind(|report| report.request_id == request_id)
    }
}

impl Default for Ledger {
    fn default() -> Self {
        Ledger::new()
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
    fn the_last_final_words_are_remembered_and_the_oldest_forgotten() {
        let mut ledger = Ledger::new();
        let capacity = ledger.ended.capacity();
        for id in 1..=REMEMBERED as u64 + 1 {
            ledger.note(&report(id, 16));
        }
        assert_eq!(ledger.final_word(1), None);
        assert_eq!(ledger.final_word(2), Some(&report(2, 16)));
        assert_eq!(ledger.ended.capacity(), capacity, "it never grows");
    }
}
