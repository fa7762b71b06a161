//! [`Tally`]: counts and lists while a journal is verified, bounded.

use ipc_types::MonotonicNs;
use module_kit::journal::Break;

use crate::difference::{Difference, Values, of_bytes};
use crate::verdict::{BreakAt, JournalSpan, JournalVerdict, MAX_LISTED};

/// The verdict as far as it is known.
#[derive(Debug, Default)]
pub struct Tally {
    pub verdict: JournalVerdict,
    /// The span under way.
    span: Option<JournalSpan>,
    last: Option<MonotonicNs>,
}

impl Tally {
    /// A core was restored at `at`: a span begins, unless one goes on.
    fn begin(&mut self, at: MonotonicNs) {
        self.last = Some(at);
        self.span.get_or_insert(JournalSpan { from: at, to: at });
    }

    /// The core was driven up to `at`.
    pub fn reach(&mut self, at: MonotonicNs) {
        self.last = Some(at);
        if let Some(span) = &mut self.span {
            span.to = span.to.max(at);
        }
    }

    /// A snapshot was read; `replayed` is that of the core which was driven up to here, if it is to be the same.
    pub fn snapshot(
        &mut self,
        at: MonotonicNs,
        topic: &str,
        recorded: &[u8],
        replayed: Option<&[u8]>,
    ) {
        self.verdict.snapshots += 1;
        let Some(replayed) = replayed else { return };
        self.reach(at);
        if let Some(values) = of_bytes(recorded, replayed) {
            let field = format!("snapshot, {}", values.field);
            self.differs(at, topic, Values { field, ..values });
        }
    }

    /// A core was restored of a snapshot, or could not be.
    pub fn restored(&mut self, at: MonotonicNs, is_restored: bool) {
        if is_restored {
            self.begin(at);
        } else {
            self.verdict.foreign += 1;
            self.end();
        }
    }

    /// The core is not driven any more.
    pub fn end(&mut self) {
        if let Some(span) = self.span.take() {
            push(&mut self.verdict.spans, span);
        }
    }

    /// The journal does not go on.
    pub fn broken(&mut self, cause: Break) {
        self.end();
        self.verdict.break_count += 1;
        let after = self.last;
        push(&mut self.verdict.breaks, BreakAt { after, cause });
    }

    /// The core said something else.
    pub fn differs(&mut self, at: MonotonicNs, topic: &str, values: Values) {
        self.verdict.difference_count += 1;
        let Values {
            field,
            recorded,
            replayed,
        } = values;
        let difference = Difference {
            at,
            topic: topic.to_owned(),
            field,
            recorded,
            replayed,
        };
        push(&mut self.verdict.differences, difference);
    }
}

fn push<T>(list: &mut Vec<T>, item: T) {
    if list.len() < MAX_LISTED {
        list.push(item);
    }
}
