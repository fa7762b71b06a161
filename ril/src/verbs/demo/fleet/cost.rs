//! What processes cost: the average of those of one kind.

use std::collections::BTreeMap;

use runtime::usage::Usage;

/// What the processes of one kind cost on average.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Of one processor, percent.
    pub processor_percent: f64,
    /// Memory, MiB.
    pub memory_mib: f64,
}

impl Share {
    /// The sum.
    pub fn and(self, other: Share) -> Share {
        Share {
            processor_percent: self.processor_percent + other.processor_percent,
            memory_mib: self.memory_mib + other.memory_mib,
        }
    }
}

/// Processes, each with its kind and its number.
pub type Usages = BTreeMap<(&'static str, u32), Usage>;

/// The average of each kind between two looks. A process that is in one of them alone is left out.
pub fn shares(before: &Usages, after: &Usages) -> BTreeMap<&'static str, Share> {
    let mut shares: BTreeMap<&'static str, Vec<Share>> = BTreeMap::new();
    for (process, later) in after {
        if let Some(earlier) = before.get(process) {
            shares.entry(process.0).or_default().push(Share {
                processor_percent: later.since(earlier).all_percent,
                memory_mib: later.memory_mib,
            });
        }
    }
    let average = |of_kind: Vec<Share>| {
        let count = of_kind.len() as f64;
        let sum = of_kind.into_iter().reduce(Share::and)?;
        Some(Share {
            processor_percent: sum.processor_percent / count,
            memory_mib: sum.memory_mib / count,
        })
    };
    let shares = shares.into_iter();
    shares
        .filter_map(|(kind, of_kind)| Some((kind, average(of_kind)?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use runtime::usage::ThreadUsage;

    use super::*;

    #[test]
    fn a_kind_costs_the_average_of_those_that_lived_all_the_time() {
        let begin = Instant::now();
        let usage = |at_s, busy_s, memory_mib| {
            let thread = ThreadUsage {
                busy: Duration::from_secs(busy_s),
                wakes: 0,
            };
            Usage {
                at: begin + Duration::from_secs(at_s),
                threads: [(1, thread)].into(),
                memory_mib,
                files: 3,
            }
        };
        let before = Usages::from([
            (("bridge", 1), usage(0, 1, 1.0)),
            (("bridge", 2), usage(0, 1, 1.0)),
            (("bridge", 4), usage(0, 1, 1.0)),
        ]);
        let after = Usages::from([
            (("bridge", 1), usage(10, 2, 10.0)),
            (("bridge", 2), usage(10, 4, 20.0)),
            (("bridge", 3), usage(10, 100, 100.0)),
        ]);
        let expected = Share {
            processor_percent: 20.0,
            memory_mib: 15.0,
        };
        let shares = shares(&before, &after);
        assert_eq!(shares, BTreeMap::from([("bridge", expected)]));
        let twice = expected.and(expected);
        assert_eq!((twice.processor_percent, twice.memory_mib), (40.0, 30.0));
    }
}
