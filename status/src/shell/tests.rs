//! The threads of the logs and the shell over disks that hang until the test lets them go on, and a thread that panics.

use std::fs::File;
use std::io::{self, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;

use ipc_types::{Domain, RobotId, Source, Waiter, Wake, files};

use super::*;
use crate::calibration::Calibration;
use crate::core::Event;
use crate::log::clock::ClockAnchor;
use crate::log::config::LogConfig;
use crate::log::event::{LogEvent, LogSummary, WriterEnd, Written};
use crate::log::file_name::FileKind;
use crate::log::groups::LogGroups;
use crate::log::queue::QUEUE_SAMPLES;
use crate::log::store::LogFile;
use crate::test_samples::sample;

/// Only a watchdog: no answer in this time is a failure.
const TIMEOUT: Duration = Duration::from_secs(20);

/// A temporary folder. Other tests of this program open ports meanwhile.
fn folder() -> tempfile::TempDir {
    files::while_no_port_opens(tempfile::tempdir).unwrap()
}

/// The real file system, whose `blocking_act`-th call, counted from 0, does not return until the test lets it, or
/// panics if the test does not listen.
#[derive(Clone)]
struct HangingStore {
    acts: Arc<AtomicUsize>,
    blocking_act: usize,
    /// Gets a message when the call blocks.
    blocked: Sender<Hang>,
}

/// A call that blocks. It goes on when this is dropped.
struct Hang {
    _sender: Sender<()>,
}

impl HangingStore {
    fn new(blocking_act: usize) -> (HangingStore, Receiver<Hang>) {
        let (blocked, hangs) = channel();
        let store = HangingStore {
            acts: Arc::default(),
            blocking_act,
            blocked,
        };
        (store, hangs)
    }

    fn act(&self) {
        if self.acts.fetch_add(1, Ordering::Relaxed) == self.blocking_act {
            let (sender, release) = channel();
            self.blocked.send(Hang { _sender: sender }).unwrap();
            // Ends with an error when the test lets go.
            let _ = release.recv();
        }
    }
}

impl Store for HangingStore {
    type File = HangingFile;

    fn clock(&self) -> ClockAnchor {
        FileStore.clock()
    }

    fn prepare(&mut self, directory: &Path) -> io::Result<()> {
        self.act();
        FileStore.prepare(directory)
    }

    fn free_bytes(&mut self, directory: &Path) -> io::Result<u64> {
        self.act();
        FileStore.free_bytes(directory)
    }

    fn list(
        &mut self,
        directory: &Path,
        wanted: &dyn Fn(&str) -> bool,
    ) -> io::Result<Vec<(String, u64)>> {
        self.act();
        FileStore.list(directory, wanted)
    }

    fn remove(&mut self, file: &Path) -> io::Result<()> {
        self.act();
        FileStore.remove(file)
    }

    fn truncate_partial_row(&mut self, file: &Path) -> io::Result<u64> {
        self.act();
        FileStore.truncate_partial_row(file)
    }

    fn create(
        &mut self,
        directory: &Path,
        stem: &str,
        kind: FileKind,
    ) -> io::Result<(PathBuf, HangingFile)> {
        self.act();
        let (path, file) = FileStore.create(directory, stem, kind)?;
        let store = self.clone();
        Ok((path, HangingFile { store, file }))
    }
}

struct HangingFile {
    store: HangingStore,
    file: File,
}

impl Write for HangingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.store.act();
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl LogFile for HangingFile {
    fn truncate(&mut self, bytes: u64) -> io::Result<()> {
        self.store.act();
        self.file.truncate(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.store.act();
        self.file.sync()
    }
}

fn config(directory: &Path) -> LogConfig {
    LogConfig {
        directory: directory.to_owned(),
        groups: LogGroups::ALL,
        // Whatever the test's machine has.
        min_free_mib: 0,
        ..LogConfig::default()
    }
}

/// The numbers of the samples in the one file of `directory`.
fn logged(directory: &Path) -> Vec<u64> {
    let mut files = std::fs::read_dir(directory).unwrap();
    let file = files.next().unwrap().unwrap().path();
    assert!(files.next().is_none(), "one file");
    let text = std::fs::read_to_string(file).unwrap();
    let rows = text.lines().skip(1);
    rows.map(|row| row.split('\t').nth(1).unwrap().parse().unwrap())
        .collect()
}

const BOUND: u64 = QUEUE_SAMPLES as u64;

/// A log in `directory` whose disk hangs at a call, behind the core.
fn start(directory: &Path, blocking_act: usize) -> (Status, LogThreads, Receiver<Hang>) {
    let (store, hangs) = HangingStore::new(blocking_act);
    let configs = [config(directory)];
    let (logs, threads) = LogThreads::start(&configs, RobotId::DEFAULT, || store.clone());
    (
        Status::new(Calibration::default(), logs, MonotonicNs(1)),
        threads,
        hangs,
    )
}

fn record(status: &mut Status, sequences: RangeInclusive<u64>) {
    for sequence in sequences {
        let dsp = sample(1, sequence);
        let now = MonotonicNs(sequence);
        let Some(Output::Telemetry(hero)) = status.apply(now, Input::Sample(dsp)) else {
            panic!("each sample is translated");
        };
        assert_eq!(hero.source_sequence, sequence);
        status.apply(now, Input::Published(Ok(())));
    }
}

#[test]
fn nothing_is_created_when_no_group_is_chosen() {
    let folder = folder();
    let directory = folder.path().join("log");
    let configs = [LogConfig {
        groups: LogGroups::default(),
        ..config(&directory)
    }];
    let (logs, threads) = LogThreads::start(&configs, RobotId::DEFAULT, || FileStore);
    assert!(threads.ends.is_empty(), "no thread");
    let mut status = Status::new(Calibration::default(), logs, MonotonicNs(1));
    record(&mut status, 1..=10);
    let summary = status.finish();
    assert_eq!((summary.published, summary.logs.len()), (10, 0));
    assert!(!directory.exists());
}

#[test]
fn wherever_the_disk_hangs_telemetry_goes_on_and_the_queue_is_bounded() {
    const HANGING: u64 = 3 * BOUND;
    // Looking for an earlier file, preparing, listing, creating, the first line, and the first batches.
    for blocking_act in 0..=7 {
        let folder = folder();
        let (mut status, threads, hangs) = start(folder.path(), blocking_act);
        // The queue has room for all of them, and they are enough for every one of those calls.
        record(&mut status, 1..=BOUND);
        let hang = hangs.recv_timeout(TIMEOUT).unwrap();
        record(&mut status, BOUND + 1..=BOUND + HANGING);
        let mut summary = status.finish();
        assert_eq!(summary.published, BOUND + HANGING);

        // Taken are those that the writer had before it hung, and then a queue full.
        let LogSummary {
            offered, refused, ..
        } = summary.logs[0];
        assert_eq!(offered, BOUND + HANGING);
        assert!((HANGING - BOUND..=HANGING).contains(&refused), "{refused}");
        if blocking_act <= 4 {
            assert_eq!(refused, HANGING, "the writer had none yet");
        }

        // The disk goes on, and so does the log: what was taken is there, and nothing else is lost.
        drop(hang);
        threads.end(&mut summary.logs, TIMEOUT);
        let rows = offered - refused;
        let expected = Written {
            files: 1,
            rows,
            ..Written::default()
        };
        let log = &summary.logs[0];
        assert_eq!(log.end, WriterEnd::Finished(expected), "{blocking_act}");
        assert_eq!(log.lost(), refused);
        assert!(logged(folder.path()).into_iter().eq(1..=rows));
    }
}

#[test]
fn a_disk_that_hangs_at_the_end_does_not_hold_the_process() {
    let folder = folder();
    let (mut status, threads, hangs) = start(folder.path(), 5);
    // Less than a batch, so that the first write of rows is the one at the end.
    record(&mut status, 1..=10);
    let mut summary = status.finish();
    let hang = hangs.recv_timeout(TIMEOUT).unwrap();
    threads.end(&mut summary.logs, Duration::ZERO);
    let log = &summary.logs[0];
    assert_eq!((log.offered, log.refused), (10, 0));
    assert_eq!(log.end, WriterEnd::DiskHangs);
    drop(hang);
}

#[test]
fn a_log_thread_that_panics_is_reported_as_such_and_telemetry_goes_on() {
    let folder = folder();
    let (store, hangs) = HangingStore::new(0);
    // The first call cannot report that it blocks, which is a panic.
    drop(hangs);
    let configs = [config(folder.path())];
    let (logs, threads) = LogThreads::start(&configs, RobotId::DEFAULT, || store.clone());
    let mut status = Status::new(Calibration::default(), logs, MonotonicNs(1));
    let end = threads.ends[0].recv_timeout(TIMEOUT);
    assert_eq!(end, Err(RecvTimeoutError::Disconnected));

    record(&mut status, 1..=3);
    status.apply(MonotonicNs(4), Input::Step(InputCounts::default()));
    let events = status.take_events();
    let failures = events
        .iter()
        .filter(|event| matches!(event, Event::Log(LogEvent::ThreadFailed { .. })));
    assert_eq!(failures.count(), 1, "{events:?}");
    let mut summary = status.finish();
    threads.end(&mut summary.logs, TIMEOUT);
    assert_eq!(summary.published, 3);
    let log = &summary.logs[0];
    assert_eq!((log.end, log.lost()), (WriterEnd::ThreadFailed, 3));
}

#[test]
fn one_log_that_hangs_is_no_trouble_for_another() {
    let (hanging, working) = (folder(), folder());
    let (store, hangs) = HangingStore::new(0);
    let configs = [config(hanging.path()), config(working.path())];
    let mut acts = [Arc::default(), Arc::new(AtomicUsize::new(1))].into_iter();
    // The second is past the call that would block.
    let stores = || HangingStore {
        acts: acts.next().unwrap(),
        ..store.clone()
    };
    let (logs, threads) = LogThreads::start(&configs, RobotId::DEFAULT, stores);
    let mut status = Status::new(Calibration::default(), logs, MonotonicNs(1));
    let hang = hangs.recv_timeout(TIMEOUT).unwrap();
    record(&mut status, 1..=100);
    status.finish();
    let written = threads.ends[1].recv_timeout(TIMEOUT).unwrap();
    assert_eq!(written.rows, 100);
    assert!(threads.ends[0].try_recv().is_err(), "it still hangs");
    assert!(logged(working.path()).into_iter().eq(1..=100));
    drop(hang);
}

#[test]
fn telemetry_flows_through_shared_memory_while_the_disk_hangs_and_the_process_ends() {
    const SAMPLES: u64 = 100;
    let folder = folder();
    let domain = Domain::isolated();
    let (termination, request) = Termination::by_hand().unwrap();
    let (store, hangs) = HangingStore::new(0);
    let (opened, is_open) = channel();
    let process = thread::spawn({
        let (domain, directory) = (domain.clone(), folder.path().to_owned());
        move || {
            let config = Config {
                log: vec![config(&directory)],
                ..Config::default()
            };
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "status").unwrap();
            let mut shell = Shell::open_with(ipc, &config, || store.clone()).unwrap();
            shell.end_timeout = Duration::ZERO;
            opened.send(()).unwrap();
            shell.run(&termination, &Notifier::from_env()).unwrap()
        }
    });
    is_open.recv_timeout(TIMEOUT).unwrap();
    let hang = hangs.recv_timeout(TIMEOUT).unwrap();

    let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
    let mut bridge: Publisher<DspTelemetry> = ipc.publisher().unwrap();
    let mut consumer: Subscriber<HeroTelemetry> = ipc.subscriber().unwrap();
    let waiter = Waiter::new();
    for expected in 1..=SAMPLES {
        assert_eq!(bridge.publish(|_| {}).unwrap(), expected);
        let mut seen = 0;
        while seen < expected {
            // Status may join only now: the bridge then gives it in the wait what it has published.
            let ports: &mut [((), &mut dyn Source)] = &mut [((), &mut consumer), ((), &mut bridge)];
            let wake = waiter.wait(ports, Some(TIMEOUT)).unwrap();
            assert_ne!(wake, Wake::TimedOut, "no telemetry came out");
            let see = |hero: &HeroTelemetry| seen = hero.source_sequence;
            consumer.drain(see).unwrap();
        }
    }
    request.request();
    let summary = process.join().unwrap();
    assert_eq!((summary.published, summary.lost), (SAMPLES, 0));
    let log = &summary.logs[0];
    assert_eq!((log.offered, log.refused), (SAMPLES, 0));
    assert_eq!(log.end, WriterEnd::DiskHangs);
    drop(hang);
}
