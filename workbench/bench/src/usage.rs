//! What the kernel says about a process: `/proc/PID`, all threads added up, and system calls as `strace` counts them.

use std::fs;
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result};
use ipc_types::MonotonicNs;
use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process};

use crate::machine::field;
use crate::pace::sleep_until;

/// Sums since the process began, over the threads that it has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Time on a processor, ns.
    pub cpu_ns: u64,
    /// How often it slept and was woken.
    pub wakes: u64,
    /// How often it was interrupted by another process.
    pub preemptions: u64,
}

impl Usage {
    /// What process `id` has used up to now.
    ///
    /// # Errors
    /// There is no such process.
    pub fn of(id: u32) -> Result<Usage> {
        let mut usage = Usage::default();
        let tasks = format!("/proc/{id}/task");
        for task in fs::read_dir(&tasks).context(tasks)? {
            let thread = task.and_then(|task| ThreadFiles::read(&task.path()));
            match thread {
                Ok(files) => usage.add(&files)?,
                // The thread has ended since it was listed.
                Err(error) if is_gone(&error) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(usage)
    }

    fn add(&mut self, thread: &ThreadFiles) -> Result<()> {
        // Time on a processor, time waiting for one, slices; ns.
        let cpu = thread.schedule.split_whitespace().next();
        self.cpu_ns += cpu
            .unwrap_or_default()
            .parse::<u64>()
            .context("schedstat")?;
        let count = |key| -> Result<u64> {
            let value = field(&thread.status, key).context(key)?;
            value.parse().context(key)
        };
        self.wakes += count("voluntary_ctxt_switches")?;
        self.preemptions += count("nonvoluntary_ctxt_switches")?;
        Ok(())
    }

    /// What was used since `earlier`.
    pub fn since(self, earlier: Usage) -> Usage {
        Usage {
            cpu_ns: self.cpu_ns.saturating_sub(earlier.cpu_ns),
            wakes: self.wakes.saturating_sub(earlier.wakes),
            preemptions: self.preemptions.saturating_sub(earlier.preemptions),
        }
    }
}

/// What the kernel says about one thread.
struct ThreadFiles {
    schedule: String,
    status: String,
}

impl ThreadFiles {
    fn read(task: &Path) -> io::Result<ThreadFiles> {
        Ok(ThreadFiles {
            schedule: fs::read_to_string(task.join("schedstat"))?,
            status: fs::read_to_string(task.join("status"))?,
        })
    }
}

/// Whether what was to be read has ended: before its file was opened, or between that and the reading.
fn is_gone(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::NotFound
        || error.raw_os_error() == Some(Errno::SRCH.raw_os_error())
}

/// The system calls of one process by name, most frequent first.
pub type Calls = Vec<(String, u64)>;

/// Counts the system calls of process `id`, all threads, for `duration`. Nothing when `strace` is not there or may not
/// attach. Times mean nothing while this runs.
pub fn count_calls(id: u32, duration: Duration, scratch: &Path) -> Result<Option<Calls>> {
    let file = scratch.join(format!("strace-{id}"));
    let spawned = Command::new("strace")
        .args(["-f", "-c", "-U", "calls,name", "-o"])
        .arg(&file)
        .args(["-p", &id.to_string()])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let Ok(mut strace) = spawned else {
        return Ok(None);
    };
    sleep_until(MonotonicNs::now() + duration)?;
    // It may have ended by itself, because it may not attach.
    let _ = kill_process(Pid::from_child(&strace), Signal::INT);
    strace.wait()?;
    let calls = parse_calls(&fs::read_to_string(&file).unwrap_or_default());
    Ok((!calls.is_empty()).then_some(calls))
}

/// Reads the table of `strace -c -U calls,name`.
fn parse_calls(table: &str) -> Calls {
    let mut calls: Calls = table
        .lines()
        .filter_map(|line| {
            let mut columns = line.split_whitespace();
            let count = columns.next()?.parse().ok()?;
            let name = columns.next()?.to_owned();
            (name != "total").then_some((name, count))
        })
        .collect();
    calls.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    calls
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;

    use super::*;

    #[test]
    fn a_process_that_works_uses_time() {
        let id = std::process::id();
        let before = Usage::of(id).unwrap();
        let mut sum = 0_u64;
        while Usage::of(id).unwrap().since(before).cpu_ns == 0 {
            sum = std::hint::black_box(sum + 1);
        }
        assert!(Usage::of(0).is_err());
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
            let usages: Vec<_> = (0..2000).map(|_| Usage::of(std::process::id())).collect();
            over.store(true, Ordering::Relaxed);
            for usage in usages {
                usage.unwrap();
            }
        });
    }

    #[test]
    fn a_table_of_calls_is_read_without_its_frame() {
        let table = "\
    calls syscall
--------- ----------------
       12 read
      300 epoll_wait
--------- ----------------
      312 total
";
        let expected = [("epoll_wait".to_owned(), 300), ("read".to_owned(), 12)];
        assert_eq!(parse_calls(table), expected);
        assert!(parse_calls("strace: attach: Operation not permitted\n").is_empty());
    }
}
