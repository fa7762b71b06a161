//! [`Usage`]: what a process uses, as the kernel counts it in `/proc/PID`: time on processors, memory and open files.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

/// What a process has used up to a moment, and holds then. Threads that have ended before count no more.
#[derive(Clone, Debug)]
pub struct Usage {
    /// The moment.
    pub at: Instant,
    /// The threads that it has, by their numbers.
    pub threads: BTreeMap<u32, ThreadUsage>,
    /// Memory, MiB; what several processes share counts for each in part (PSS).
    pub memory_mib: f64,
    /// Open files.
    pub files: usize,
}

/// What a thread has used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ThreadUsage {
    /// Time on a processor, its own and the kernel's for it.
    pub busy: Duration,
    /// How often it slept and was woken.
    pub wakes: u64,
}

/// What a process has used between two moments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// All its threads, percent of one processor.
    pub all_percent: f64,
    /// The thread that has used most: at 100 the process can do no more, however many processors there are.
    pub busiest_percent: f64,
    /// How often its threads slept and were woken, a second.
    pub wakes_per_s: f64,
}

impl Usage {
    /// Of the process with this number.
    ///
    /// # Errors
    ///
    /// When it has ended or may not be looked at, or the kernel does not count.
    pub fn of(process: u32) -> io::Result<Usage> {
        let folder = Path::new("/proc").join(process.to_string());
        let mut threads = BTreeMap::new();
        for task in fs::read_dir(folder.join("task"))? {
            let folder = task?.path();
            // One that cannot be read has ended since it was listed.
            if let (Some(number), Some(usage)) = (number(&folder), ThreadUsage::of(&folder)) {
                threads.insert(number, usage);
            }
        }
        if threads.is_empty() {
            return Err(io::ErrorKind::NotFound.into());
        }
        let rollup = fs::read_to_string(folder.join("smaps_rollup"))?;
        Ok(Usage {
            at: Instant::now(),
            threads,
            memory_mib: field(&rollup, "Pss").ok_or(io::ErrorKind::InvalidData)? as f64 / 1024.0,
            files: fs::read_dir(folder.join("fd"))?.count(),
        })
    }

    /// What it has used since `before`, which is earlier.
    pub fn since(&self, before: &Usage) -> Load {
        let seconds = self.at.duration_since(before.at).as_secs_f64();
        let mut load = Load::default();
        for (number, thread) in &self.threads {
            let before = before.threads.get(number).copied().unwrap_or_default();
            let busy = thread.busy.saturating_sub(before.busy);
            let percent = busy.as_secs_f64() / seconds * 100.0;
            load.all_percent += percent;
            load.busiest_percent = load.busiest_percent.max(percent);
            load.wakes_per_s += thread.wakes.saturating_sub(before.wakes) as f64 / seconds;
        }
        load
    }
}

impl ThreadUsage {
    /// Of the thread that `/proc/PID/task/TID` describes.
    fn of(folder: &Path) -> Option<ThreadUsage> {
        let read = |name: &str| fs::read_to_string(folder.join(name)).ok();
        // Time on a processor, time waiting for one, slices; ns.
        let schedule = read("schedstat")?;
        let busy_ns = schedule.split_whitespace().next()?.parse().ok()?;
        Some(ThreadUsage {
            busy: Duration::from_nanos(busy_ns),
            wakes: field(&read("status")?, "voluntary_ctxt_switches")?,
        })
    }
}

fn number(folder: &Path) -> Option<u32> {
    folder.file_name()?.to_str()?.parse().ok()
}

/// The number in the first line `key: number`, which may have a unit.
fn field(text: &str, key: &str) -> Option<u64> {
    let mut values = text.lines().filter_map(|line| {
        let (found, value) = line.split_once(':')?;
        (found.trim() == key).then_some(value)
    });
    values.next()?.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;

    use super::*;

    #[test]
    fn a_process_that_works_uses_time_and_holds_something() {
        let own = || Usage::of(std::process::id()).unwrap();
        let before = own();
        let mut sum = 0_u64;
        let load = loop {
            sum = std::hint::black_box(sum + 1);
            let load = own().since(&before);
            if load.all_percent > 0.0 {
                break load;
            }
        };
        assert!(load.busiest_percent <= load.all_percent);
        assert!(before.memory_mib > 0.0 && before.files >= 3);
        assert!(Usage::of(0).is_err() && Usage::of(u32::MAX).is_err());
    }

    #[test]
    fn the_load_is_what_threads_have_used_meanwhile() {
        let thread = |ms, wakes| ThreadUsage {
            busy: Duration::from_millis(ms),
            wakes,
        };
        let before = Usage {
            at: Instant::now(),
            threads: [(1, thread(100, 10)), (2, thread(900, 90))].into(),
            memory_mib: 1.0,
            files: 3,
        };
        // One thread has ended, another one has begun.
        let after = Usage {
            at: before.at + Duration::from_secs(2),
            threads: [(1, thread(500, 30)), (3, thread(200, 4))].into(),
            ..before.clone()
        };
        let load = after.since(&before);
        assert!((load.all_percent - 30.0).abs() < 1e-9, "{load:?}");
        assert!((load.busiest_percent - 20.0).abs() < 1e-9, "{load:?}");
        assert!((load.wakes_per_s - 12.0).abs() < 1e-9, "{load:?}");
    }

    #[test]
    fn threads_that_end_meanwhile_are_no_error() {
        let over = AtomicBool::new(false);
        thread::scope(|scope| {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    thread::scope(|scope| [(); 8].map(|()| scope.spawn(|| {}).thread().id()));
                }
            });
            let usages: Vec<_> = (0..500).map(|_| Usage::of(std::process::id())).collect();
            over.store(true, Ordering::Relaxed);
            for usage in usages {
                usage.unwrap();
            }
        });
    }

    #[test]
    fn a_field_is_found_by_its_whole_name() {
        let text = "Pss_Dirty:\t 5 kB\nPss:\t  12 kB\nvoluntary_ctxt_switches:\t7\nnonvoluntary_ctxt_switches:\t9\n";
        assert_eq!(field(text, "Pss"), Some(12));
        assert_eq!(field(text, "voluntary_ctxt_switches"), Some(7));
        assert_eq!(field(text, "ctxt_switches"), None);
    }
}
