//! What reports say of every sample: how old it is, whether it is too old, and the names of its codes.

use std::fmt;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::render::fields::Tree;

/// A sample older than this is marked stale: the state comes at least once a second, telemetry far more often.
pub const STALE_AFTER: Duration = Duration::from_secs(1);

/// A sample by its age.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleAge {
    sequence: u64,
    /// `None` if it is dated in the future: it counts as stale, because its age is unknown.
    age_ms: Option<u64>,
    stale: bool,
}

impl SampleAge {
    /// The sample `sequence` whose content was so at `time`.
    pub fn new(sequence: u64, time: MonotonicNs, now: MonotonicNs) -> SampleAge {
        SampleAge::with_limit(sequence, time, now, STALE_AFTER)
    }

    /// The same of a sample that is stale when it is older than `limit`.
    pub fn with_limit(
        sequence: u64,
        time: MonotonicNs,
        now: MonotonicNs,
        limit: Duration,
    ) -> SampleAge {
        SampleAge {
            sequence,
            age_ms: age_ms(time, now),
            stale: is_stale(time, now, limit),
        }
    }

    /// Its age, ms; `None` if it is dated in the future.
    pub fn age_ms(self) -> Option<u64> {
        self.age_ms
    }

    /// Whether it is too old to say how things are now.
    pub fn is_stale(self) -> bool {
        self.stale
    }

    /// As part of a JSON object.
    pub(crate) fn tree(self) -> Tree {
        Tree::nested([
            ("sequence", self.sequence.into()),
            ("age_ms", self.age_ms.into()),
            ("stale", self.stale.into()),
        ])
    }
}

impl fmt::Display for SampleAge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.age_ms {
            Some(age) => write!(f, "sample {}, {age} ms old", self.sequence)?,
            None => write!(f, "sample {}, of unknown age", self.sequence)?,
        }
        if self.stale {
            f.write_str(", STALE")?;
        }
        Ok(())
    }
}

/// Whether what was so at `time` says nothing of `now` any more. What is dated in the future is of unknown age, so it is stale.
pub(crate) fn is_stale(time: MonotonicNs, now: MonotonicNs, limit: Duration) -> bool {
    time > now || now.since(time) > limit
}

/// Whether what was so at `time` still says how things are at `now`.
pub(crate) fn is_present(time: MonotonicNs, now: MonotonicNs) -> bool {
    !is_stale(time, now, STALE_AFTER)
}

/// The name of a code, or a number that is not in the contract.
pub(crate) fn named(name: Option<impl fmt::Display>, number: u32) -> String {
    name.map_or_else(|| format!("unknown-{number}"), |name| name.to_string())
}

/// How long ago `time` was, in milliseconds, the unit of all ages. A time of the future, which only a faulty publisher gives,
/// must not look like the present.
pub(crate) fn age_ms(time: MonotonicNs, now: MonotonicNs) -> Option<u64> {
    let age = (time <= now).then(|| now.since(time))?;
    u64::try_from(age.as_millis()).ok()
}
