//! [`Comparison`]: what came of a verification.

use ipc_types::MonotonicNs;
use module_kit::journal::Break;

use crate::difference::Difference;

/// Differences, spans and breaks that are listed, of each the first so many; all are counted.
pub const MAX_LISTED: usize = 256;

/// What came of a verification.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Of the bridge.
    pub bridge: JournalVerdict,
    /// Of status.
    pub status: JournalVerdict,
}

/// What came of the verification of one journal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JournalVerdict {
    /// Pieces that were read.
    pub pieces: u64,
    /// Bytes of the journal that were read.
    pub bytes: u64,
    /// Pieces that are missing.
    pub pieces_lost: u64,
    /// Records that were read, by what they are.
    pub snapshots: u64,
    /// Calls of the core.
    pub inputs: u64,
    /// Samples that are the same.
    pub samples: u64,
    /// Of these, samples that the bridge received before `since`, of which the recording has nothing but the journal:
    /// that begins with its process, and waits for the first recorder.
    pub samples_before: u64,
    /// When the first sample of the recording was received; 0 if that is not known.
    pub since: MonotonicNs,
    /// States that are the same.
    pub states: u64,
    /// Reports that are the same.
    pub reports: u64,
    /// Bytes to the DSP that are the same.
    pub bytes_sent: u64,
    /// From when to when the core was driven without a break, in order; the first [`MAX_LISTED`].
    pub spans: Vec<JournalSpan>,
    /// Where the journal does not go on, in order; the first [`MAX_LISTED`].
    pub breaks: Vec<BreakAt>,
    /// How many there are.
    pub break_count: u64,
    /// Records that could not be read.
    pub damaged: u64,
    /// Snapshots that are none of this version.
    pub foreign: u64,
    /// Where the core differs, in order; the first [`MAX_LISTED`].
    pub differences: Vec<Difference>,
    /// How many there are.
    pub difference_count: u64,
}

/// From when to when, host monotonic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JournalSpan {
    /// The snapshot with which it begins.
    pub from: MonotonicNs,
    /// Its last record.
    pub to: MonotonicNs,
}

/// Where a journal does not go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BreakAt {
    /// The time of the last record before it; `None` if there is none.
    pub after: Option<MonotonicNs>,
    /// Why.
    pub cause: Break,
}

impl JournalVerdict {
    /// Whether something was verified, all of it could be read but for what is missing, and nothing differs.
    pub fn is_verified(&self) -> bool {
        !self.spans.is_empty()
            && self.difference_count == 0
            && self.damaged == 0
            && self.foreign == 0
    }

    /// Counts a sample that is the same.
    pub(crate) fn count_sample(&mut self, received_ns: u64) {
        self.samples += 1;
        self.samples_before += u64::from(received_ns < self.since.0);
    }

    /// Whether there is nothing of this journal.
    pub fn is_empty(&self) -> bool {
        self.pieces == 0
    }

    /// The first difference.
    pub fn difference(&self) -> Option<&Difference> {
        self.differences.first()
    }
}

impl Comparison {
    /// Whether each journal that is there is verified, and one is there.
    pub fn is_verified(&self) -> bool {
        let journals = [&self.bridge, &self.status];
        let mut present = journals.iter().filter(|journal| !journal.is_empty());
        journals.iter().any(|journal| !journal.is_empty())
            && present.all(|journal| journal.is_verified())
    }

    /// The first difference of both.
    pub fn difference(&self) -> Option<&Difference> {
        let first = [self.bridge.difference(), self.status.difference()];
        first
            .into_iter()
            .flatten()
            .min_by_key(|difference| difference.at)
    }
}
