//! A `/dev/shm` in which nothing can be had any more: what flies must fly on, and must be landed.
//!
//! Runs in a `/dev/shm` of its own, see [`crate::memory`].

use std::fmt;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;

use ril_tests::Process;
use ril_tests::process::{Signal, Stream};

use crate::crew::{Site, ask, is_alive, start_chain};
use crate::memory;

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

/// What came of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What was lacking.
    pub lack: Lack,
    /// Whether the bridge lived to the end.
    pub bridge_lives: bool,
    /// Whether status did.
    pub status_lives: bool,
    /// How many samples healthy consumers of the bridge and of status got while nothing was to be had, of [`SAMPLES`].
    pub heard: [usize; 2],
    /// Exit codes of `land` and `stop`, and what they said.
    pub answers: Vec<(&'static str, Option<i32>, String)>,
}

impl Outcome {
    /// Whether telemetry went on.
    pub fn flies_on(&self) -> bool {
        self.bridge_lives && self.status_lives && self.heard == [SAMPLES; 2]
    }

    /// Whether the helicopter could be landed and stopped.
    pub fn is_landed(&self) -> bool {
        self.answers.iter().all(|(_, code, _)| *code == Some(0))
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [raw, hero] = self.heard;
        let life = |lives| if lives { "lives" } else { "DIED" };
        write!(
            f,
            "| {:?} | bridge {}, status {} | {raw} and {hero} of {SAMPLES} samples | ",
            self.lack,
            life(self.bridge_lives),
            life(self.status_lives),
        )?;
        for (request, code, words) in &self.answers {
            write!(f, "{request}: {code:?} {words}; ")?;
        }
        f.write_str("|")
    }
}

/// Flies while nothing is to be had.
///
/// # Panics
///
/// When this is not in a `/dev/shm` of its own, or when the chain does not start.
pub fn run(site: &Site, lack: Lack) -> Outcome {
    assert!(memory::is_own(), "it would fill the memory of everybody");
    let [sim, bridge, status] = start_chain(site);
    ask(site, "start");
    ask(site, "takeoff --altitude 5");
    let args = format!("--json --field sequence --timeout {SILENCE_S}s");
    let mut raw = site.start(&format!("echo dsp {args}"));
    let mut hero = site.start(&format!("echo hero {args}"));
    let mut stuck = site.start(&format!("echo dsp {args}"));
    for consumer in [&mut raw, &mut hero, &mut stuck] {
        consumer.wait_for_line(|line| line.stream == Stream::Stdout);
    }
    stuck.signal(Signal::STOP);
    let filler = Filler::fill(lack);
    let heard_raw = hear(&mut raw);
    // Without the bridge, status is silent and its consumer waits.
    let heard_hero = match heard_raw {
        SAMPLES => hear(&mut hero),
        _ => 0,
    };
    let (bridge_lives, status_lives) = (is_alive(bridge.id()), is_alive(status.id()));
    let answers = match bridge_lives {
        true => ["land", "stop"].map(|request| {
            let finished = site.run(request);
            (request, finished.code(), finished.stderr.join(", "))
        }),
        // There is nobody to answer.
        false => ["land", "stop"].map(|request| (request, None, "no bridge".to_owned())),
    };
    let outcome = Outcome {
        lack,
        bridge_lives: bridge_lives && is_alive(bridge.id()),
        status_lives: status_lives && is_alive(status.id()),
        heard: [heard_raw, heard_hero],
        answers: answers.into(),
    };
    drop(filler);
    // They are killed; what they leave goes with the file system.
    drop((raw, hero, stuck, status, bridge, sim));
    site.domain.sweep();
    outcome
}

/// How many samples a consumer gets, up to [`SAMPLES`], before its publisher is gone for too long.
fn hear(consumer: &mut Process) -> usize {
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
