//! What processes cost: the time on processors and the memory, as the kernel counts them.

use std::collections::BTreeMap;
use std::fs;
use std::time::Duration;

use rustix::param::clock_ticks_per_second;

/// What one process has used so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Time on processors, its own and the kernel's for it.
    pub busy: Duration,
    /// Memory, bytes; what several processes share counts for each in part.
    pub memory_bytes: u64,
}

/// Of the process with this number; `None` when it has ended, or may not be looked at.
pub fn of(process: u32) -> Option<Usage> {
    let read = |file: &str| fs::read_to_string(format!("/proc/{process}/{file}")).ok();
    Some(Usage {
        busy: busy(&read("stat")?, clock_ticks_per_second())?,
        memory_bytes: memory_bytes(&read("smaps_rollup")?)?,
    })
}

/// From `/proc/N/stat`: the name of the program may have blanks and parentheses, and ends with the last of those.
fn busy(stat: &str, ticks_per_second: u64) -> Option<Duration> {
    let (_, behind_name) = stat.rsplit_once(')')?;
    let mut fields = behind_name.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<u64>().ok();
    let ticks = next()? + next()?;
    Some(Duration::from_secs_f64(
        ticks as f64 / ticks_per_second as f64,
    ))
}

/// From `/proc/N/smaps_rollup`.
fn memory_bytes(rollup: &str) -> Option<u64> {
    let line = rollup.lines().find_map(|line| line.strip_prefix("Pss:"))?;
    let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib * 1024)
}

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

/// The average of each kind between two looks, `elapsed` after one another. Each process stands with its kind and its number; one
/// that is in one of them alone is left out.
pub fn shares(
    before: &BTreeMap<(&'static str, u32), Usage>,
    after: &BTreeMap<(&'static str, u32), Usage>,
    elapsed: Duration,
) -> BTreeMap<&'static str, Share> {
    let mut sums: BTreeMap<&'static str, (u32, Duration, u64)> = BTreeMap::new();
    for (process, later) in after {
        if let Some(earlier) = before.get(process) {
            let (count, busy, memory) = sums.entry(process.0).or_default();
            *count += 1;
            *busy += later.busy.saturating_sub(earlier.busy);
            *memory += later.memory_bytes;
        }
    }
    let share = |(count, busy, memory): (u32, Duration, u64)| Share {
        processor_percent: 100.0 * busy.as_secs_f64() / (elapsed.as_secs_f64() * f64::from(count)),
        memory_mib: memory as f64 / f64::from(count) / f64::from(1 << 20),
    };
    sums.into_iter()
        .map(|(kind, sum)| (kind, share(sum)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_memory_are_those_of_the_kernel() {
        let stat = "42 (a b) c) S 1 42 42 0 -1 4194560 900 0 0 0 250 50 0 0 20 0 1 0 7 8 9";
        assert_eq!(busy(stat, 100), Some(Duration::from_secs(3)));
        assert_eq!(busy("42 (a", 100), None);
        let rollup = "00-7f ---p 00 00:00 0 [rollup]\nRss: 900 kB\nPss:  12 kB\nPss_Dirty: 1 kB\n";
        assert_eq!(memory_bytes(rollup), Some(12 * 1024));
        assert_eq!(memory_bytes(""), None);
        let own = of(std::process::id()).expect("this process");
        assert!(own.memory_bytes > 0);
        assert_eq!(of(u32::MAX), None);
    }

    #[test]
    fn a_kind_costs_the_average_of_those_that_lived_all_the_time() {
        let usage = |seconds, mib: u64| Usage {
            busy: Duration::from_secs(seconds),
            memory_bytes: mib << 20,
        };
        let before = [(("bridge", 1), usage(1, 1)), (("bridge", 2), usage(1, 1))];
        let mut after =
            BTreeMap::from([(("bridge", 1), usage(2, 10)), (("bridge", 2), usage(4, 20))]);
        after.insert(("bridge", 3), usage(100, 100));
        let shares = shares(&before.into(), &after, Duration::from_secs(10));
        let expected = Share {
            processor_percent: 20.0,
            memory_mib: 15.0,
        };
        assert_eq!(shares, BTreeMap::from([("bridge", expected)]));
        let twice = expected.and(expected);
        assert_eq!((twice.processor_percent, twice.memory_mib), (40.0, 30.0));
    }
}
