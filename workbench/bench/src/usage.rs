//! What the kernel says about processes: `/proc/PID`, all threads added up.

use std::fs;
use std::io;
use std::path::Path;

use anyhow::{Context, Result};
use ipc_types::MonotonicNs;
use ril_tests::Process;
use rustix::io::Errno;

use crate::measured::Round;

/// Share of a processor.
pub const CPU: &str = "% of a core";
/// How often a process slept and was woken.
pub const WAKES: &str = "wake-ups a second";

/// Sums since a process began, over the threads that it has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// Time on a processor, ns.
    pub cpu_ns: u64,
    /// How often it slept and was woken.
    pub wakes: u64,
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
            match task.and_then(|task| read(&task.path())) {
                Ok((schedule, status)) => usage.add(&schedule, &status)?,
                // The thread has ended since it was listed.
                Err(error) if is_gone(&error) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(usage)
    }

    fn add(&mut self, schedule: &str, status: &str) -> Result<()> {
        // Time on a processor, time waiting for one, slices; ns.
        let cpu = schedule.split_whitespace().next().unwrap_or_default();
        self.cpu_ns += cpu.parse::<u64>().context("schedstat")?;
        self.wakes += field(status, "voluntary_ctxt_switches")?;
        Ok(())
    }
}

fn read(task: &Path) -> io::Result<(String, String)> {
    let read = |name| fs::read_to_string(task.join(name));
    Ok((read("schedstat")?, read("status")?))
}

/// Whether what was to be read has ended: before its file was opened, or between that and the reading.
fn is_gone(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::NotFound
        || error.raw_os_error() == Some(Errno::SRCH.raw_os_error())
}

/// The number in the first line `key : number`, which may have a unit.
fn field(text: &str, key: &'static str) -> Result<u64> {
    let found = text.lines().find_map(|line| {
        let (found, value) = line.split_once(':')?;
        (found.trim() == key).then(|| value.split_whitespace().next())?
    });
    found.context(key)?.parse().context(key)
}

/// Processes that are being watched.
pub struct Watch {
    begin: MonotonicNs,
    before: Vec<(&'static str, u32, Usage)>,
}

impl Watch {
    /// Begins now. Each has a name of its own.
    pub fn begin<'a>(
        processes: impl IntoIterator<Item = (&'static str, &'a Process)>,
    ) -> Result<Watch> {
        let usage = |(name, process): (&'static str, &Process)| -> Result<_> {
            let id = process.id();
            Ok((name, id, Usage::of(id)?))
        };
        Ok(Watch {
            before: processes.into_iter().map(usage).collect::<Result<_>>()?,
            begin: MonotonicNs::now(),
        })
    }

    /// When it began.
    pub fn since(&self) -> MonotonicNs {
        self.begin
    }

    /// Adds what each has used since the beginning to the figures of its name. Says how long that was, s.
    pub fn end(&self, round: &mut Round) -> Result<f64> {
        let elapsed_s = MonotonicNs::now().since(self.begin).as_secs_f64();
        let now: Vec<_> = self
            .before
            .iter()
            .map(|(_, id, _)| Usage::of(*id))
            .collect();
        for ((name, _, before), now) in self.before.iter().zip(now) {
            let now = now?;
            let cpu_ns = now.cpu_ns.saturating_sub(before.cpu_ns) as f64;
            let wakes = now.wakes.saturating_sub(before.wakes) as f64;
            round.add_figure(name, CPU, cpu_ns / 1e7 / elapsed_s);
            round.add_figure(name, WAKES, wakes / elapsed_s);
        }
        Ok(elapsed_s)
    }
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
        while Usage::of(id).unwrap().cpu_ns == before.cpu_ns {
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
    fn a_field_is_found_by_its_whole_name() {
        let text = "VmRSS:\t  12 kB\nvoluntary_ctxt_switches:\t7\nnonvoluntary_ctxt_switches:\t9\n";
        assert_eq!(field(text, "VmRSS").unwrap(), 12);
        assert_eq!(field(text, "voluntary_ctxt_switches").unwrap(), 7);
        assert!(field(text, "ctxt_switches").is_err());
    }
}
