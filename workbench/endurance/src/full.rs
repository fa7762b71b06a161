//! A `/dev/shm` in which nothing can be had any more: what flies must fly on, and must be landed.
//!
//! Runs in a `/dev/shm` of its own, see [`crate::memory`].

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;

use ril_tests::Process;
use ril_tests::process::{Signal, Stream};

use crate::memory;
use crate::outcome::Outcome;
use crate::site::Site;

/// Samples that each healthy consumer must get while nothing can be had: more than the buffers of the others hold, so that
/// their publishers use all of their memory.
const SAMPLES: usize = 300;

/// How long healthy consumers wait for a publisher that is gone, s.
const SILENCE_S: u32 = 10;

/// What there is no more of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lack {
    /// Bytes.
    Bytes,
    /// Files.
    Inodes,
}

impl Lack {
    /// Options of the file system that is to be filled.
    pub fn mount_options(self) -> &'static str {
        match self {
            Lack::Bytes => "size=64m",
            Lack::Inodes => "size=64m,nr_inodes=4000",
        }
    }
}

/// Flies while nothing is to be had.
///
/// # Panics
///
/// When this is not in a `/dev/shm` of its own, or when the chain does not start.
pub fn run(site: &Site, lack: Lack) -> Outcome {
    assert!(memory::is_own(), "it would fill the memory of everybody");
    let [sim, bridge, status] = site.start_flight();
    let args = format!("--json --field sequence --timeout {SILENCE_S}s");
    let echo = |topic: &str| {
        let mut echo = site.start(&format!("echo {topic} {args}"));
        echo.wait_for_line(|line| line.stream == Stream::Stdout);
        echo
    };
    let (mut raw, mut hero, stuck) = (echo("dsp"), echo("hero"), echo("dsp"));
    stuck.signal(Signal::STOP);
    let filler = Filler::fill(lack);
    let mut outcome = Outcome::default();
    outcome.cell("nothing left", format!("{lack:?}"));
    let mut samples = |heading, consumer: &mut Process| {
        let count = count_samples(consumer);
        outcome.cell(heading, count);
        let failure = format!("{heading}: {count} of {SAMPLES}");
        outcome.require(count == SAMPLES, failure);
    };
    samples("samples of the bridge", &mut raw);
    // Without the bridge, status is silent and its consumer waits.
    if bridge.is_running() {
        samples("of status", &mut hero);
        for request in ["land", "stop"] {
            let finished = site.finish(request);
            let (code, words) = (finished.code(), finished.stderr.join(", "));
            outcome.cell(request, format!("{code:?} {words}"));
            outcome.require(code == Some(0), format!("{request}: {code:?} {words}"));
        }
    }
    for (name, process) in [("bridge", &bridge), ("status", &status)] {
        outcome.require(process.is_running(), format!("{name} DIED"));
    }
    drop(filler);
    // They are killed; what they leave goes with the file system.
    drop((raw, hero, stuck, status, bridge, sim));
    site.domain.sweep();
    outcome
}

/// How many samples a consumer gets, up to [`SAMPLES`], before its publisher is gone for too long.
fn count_samples(consumer: &mut Process) -> usize {
    // At its end it prints a summary on standard error.
    (0..SAMPLES)
        .take_while(|_| consumer.wait_for_line(|_| true).stream == Stream::Stdout)
        .count()
}

/// What fills the file system, until it is dropped.
struct Filler(Vec<PathBuf>);

impl Filler {
    fn fill(lack: Lack) -> Filler {
        let mut files = Vec::new();
        let full = loop {
            let path = PathBuf::from(format!("/dev/shm/filler-{}", files.len()));
            let file = File::create_new(&path);
            files.push(path);
            match (file, lack) {
                (Err(error), _) => break error,
                (Ok(_), Lack::Inodes) => {}
                (Ok(mut file), Lack::Bytes) => break write_all_there_is(&mut file),
            }
        };
        assert_eq!(full.kind(), ErrorKind::StorageFull, "{full}");
        Filler(files)
    }
}

/// Writes until that is refused, and says why.
fn write_all_there_is(file: &mut File) -> io::Error {
    loop {
        if let Err(error) = file.write_all(&[1; 4096]) {
            return error;
        }
    }
}

impl Drop for Filler {
    fn drop(&mut self) {
        for file in &self.0 {
            let _ = fs::remove_file(file);
        }
    }
}
