//! [`Starved`]: threads of a process that get next to no time of a processor.

use std::fs;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use ril_tests::Process;
use ril_tests::languages::run;
use rustix::thread::{CpuSet, Pid, gettid, sched_getaffinity, sched_setaffinity};

/// Threads that run only when their processor has nothing else to do, and a loop on that processor that never rests.
/// They are as before when this goes.
pub struct Starved {
    threads: Vec<Pid>,
    before: CpuSet,
    goes_on: Arc<AtomicBool>,
    busy: Option<JoinHandle<()>>,
}

impl Starved {
    /// The threads of the process with this name, or all of them.
    #[track_caller]
    pub fn threads_of(process: &Process, name: Option<&str>) -> Starved {
        let folder = format!("/proc/{}/task", process.id());
        let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
        let chosen = entries.filter(|entry| {
            let of_thread = fs::read_to_string(entry.path().join("comm")).unwrap();
            name.is_none_or(|name| of_thread.trim_end() == name)
        });
        let threads = chosen.map(|entry| {
            let number = entry.file_name().to_str().unwrap().parse().unwrap();
            Pid::from_raw(number).unwrap()
        });
        let threads: Vec<Pid> = threads.collect();
        assert!(!threads.is_empty(), "no thread {name:?}");
        let before = sched_getaffinity(None).unwrap();
        let mut one = CpuSet::new();
        one.set((0..).find(|cpu| before.is_set(*cpu)).unwrap());
        for thread in &threads {
            sched_setaffinity(Some(*thread), &one).unwrap();
            set_class(*thread, "--idle");
        }
        let goes_on = Arc::new(AtomicBool::new(true));
        let loops = Arc::clone(&goes_on);
        let busy = thread::spawn(move || {
            sched_setaffinity(None, &one).unwrap();
            set_class(gettid(), "--other");
            while loops.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        });
        Starved {
            threads,
            before,
            goes_on,
            busy: Some(busy),
        }
    }
}

/// Leaves the class as it is where that is not permitted.
fn set_class(thread: Pid, class: &str) {
    let number = thread.as_raw_nonzero().to_string();
    let _ = run(Command::new("chrt").args([class, "--pid", "0", &number]));
}

impl Drop for Starved {
    fn drop(&mut self) {
        self.goes_on.store(false, Ordering::Relaxed);
        for thread in &self.threads {
            // A thread that has ended needs nothing.
            let _ = sched_setaffinity(Some(*thread), &self.before);
            set_class(*thread, "--other");
        }
        self.busy.take().map(JoinHandle::join);
    }
}
