//! The processes that are measured, this program in roles and `ril`, and what they say to the one that measures.
//!
//! A child prints `ready` when it can be measured. Its result is a file of JSON, whose name it prints: a line has no
//! room for all samples.

use std::cell::Cell;
use std::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result};
use clap::ValueEnum;
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::peers::segment;

const READY: &str = "ready";
const RESULT: &str = "result ";

fn print(line: &str) -> Result<()> {
    println!("{line}");
    io::stdout().flush().context("standard output")
}

/// Says that this process, a child, can be measured.
///
/// # Errors
/// There is no listener.
pub fn report_ready() -> Result<()> {
    print(READY)
}

/// Says what this process, a child, has found.
///
/// # Errors
/// The folder cannot be written, or there is no listener.
pub fn report(result: &impl Serialize) -> Result<()> {
    let file = format!("{}.json", std::process::id());
    fs::write(&file, serde_json::to_vec(result)?)?;
    print(&format!("{RESULT}{file}"))
}

/// A measurement that takes longer hangs.
const LIMIT: Duration = Duration::from_secs(3600);

/// Where the processes of a measurement run. A wake-up on the processor of the one who wakes takes a few microseconds,
/// and one on another that sleeps several times that; where the scheduler puts a process changes from run to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Placement {
    /// All on one processor.
    SameProcessor,
    /// Each on another processor than the process that it listens to.
    OtherProcessor,
    /// Wherever the scheduler puts them.
    Free,
}

impl Placement {
    /// The processors of the process that is started as number `position` (from 0), out of those that are `allowed`;
    /// `None` for any of them. Each process listens to the one that was started before it, or is listened to by it.
    fn processors(self, position: usize, allowed: &CpuSet) -> Option<CpuSet> {
        let mut two = (0..CpuSet::MAX_CPU).filter(|cpu| allowed.is_set(*cpu));
        let first = two.next()?;
        let chosen = match self {
            Placement::Free => return None,
            Placement::OtherProcessor if position % 2 == 1 => two.next().unwrap_or(first),
            _ => first,
        };
        let mut set = CpuSet::new();
        set.set(chosen);
        Some(set)
    }
}

/// A rate at a placement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Samples or requests a second.
    pub rate_hz: u32,
    /// Where the processes run.
    pub placement: Placement,
}

impl Setting {
    /// Each rate at each placement.
    pub fn all(rates_hz: &[u32], placements: &[Placement]) -> Vec<Setting> {
        let of_rate = |rate_hz: &u32| {
            let rate_hz = *rate_hz;
            placements
                .iter()
                .map(move |&placement| Setting { rate_hz, placement })
        };
        rates_hz.iter().flat_map(of_rate).collect()
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = match self.placement {
            Placement::SameProcessor => "same processor",
            Placement::OtherProcessor => "other processor",
            Placement::Free => "any processor",
        };
        write!(f, "{} Hz, {place}", self.rate_hz)
    }
}

/// What is measured, at a setting.
#[derive(Clone, Copy, PartialEq)]
pub struct At<W> {
    /// What.
    pub way: W,
    /// At which rate and where.
    pub setting: Setting,
}

impl<W: Copy> At<W> {
    /// Each of `ways` at one setting.
    pub fn each(ways: &[W], setting: Setting) -> impl Iterator<Item = At<W>> {
        ways.iter().map(move |&way| At { way, setting })
    }
}

impl<W: fmt::Display> fmt::Display for At<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}", self.way, self.setting)
    }
}

/// What the processes of one measurement share, and no other process: a domain of shared memory and the folder that
/// they run in.
pub struct Site {
    sandbox: Sandbox,
    placement: Placement,
    started: Cell<usize>,
}

impl Site {
    /// A new one.
    pub fn new(placement: Placement) -> Result<Site> {
        let this = std::env::current_exe()?;
        let ril = [this.as_os_str(), "child".as_ref(), "ril".as_ref()];
        Ok(Site {
            sandbox: Sandbox::new(ril, "a measurement", LIMIT),
            placement,
            started: Cell::new(0),
        })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        self.sandbox.folder()
    }

    /// Starts this program in a role, whose words are separated by spaces.
    pub fn spawn(&self, role: &str) -> Result<Process> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("child").args(role.split_whitespace());
        // A process inherits the processors of the one that starts it.
        let allowed = sched_getaffinity(None)?;
        let position = self.started.replace(self.started.get() + 1);
        if let Some(processors) = self.placement.processors(position, &allowed) {
            sched_setaffinity(None, &processors)?;
        }
        let process = self.sandbox.spawn(command);
        sched_setaffinity(None, &allowed)?;
        Ok(process)
    }

    /// Starts a process in a role, and waits until it is ready.
    pub fn start(&self, role: &str) -> Result<Process> {
        let mut process = self.spawn(role)?;
        process.wait_for_text(READY);
        Ok(process)
    }

    /// Waits until a child has its result.
    pub fn result<T: DeserializeOwned>(&self, child: &mut Process) -> Result<T> {
        let line = child.wait_for_line_within(LIMIT, |line| line.text.starts_with(RESULT));
        let file = self.folder().join(line.text.trim_start_matches(RESULT));
        Ok(serde_json::from_slice(&fs::read(file)?)?)
    }

    /// Waits until a child that ends by itself has its result.
    pub fn finish<T: DeserializeOwned>(&self, mut child: Process) -> Result<T> {
        let result = self.result(&mut child)?;
        child.wait_exit();
        Ok(result)
    }

    /// Asks a child to end and waits for its result.
    pub fn end<T: DeserializeOwned>(&self, child: Process) -> Result<T> {
        child.signal(Signal::TERM);
        self.finish(child)
    }
}

impl Drop for Site {
    fn drop(&mut self) {
        // Plain iceoryx2 leaves its folders in the root. What cannot be removed is reported, and is no reason to lose
        // the measurement.
        for folder in ["nodes", "services"] {
            let _ = fs::remove_dir_all(self.sandbox.domain.root().join(folder));
        }
        if let Err(error) = self.sandbox.domain.remove_if_dead() {
            eprintln!("the domain of a measurement is left behind: {error}");
        }
        let _ = fs::remove_file(segment(self.folder()));
        for path in self.sandbox.domain.residue() {
            eprintln!("left behind, and removed: {}", path.display());
            let _ = fs::remove_file(&path).or_else(|_| fs::remove_dir_all(&path));
        }
    }
}

/// The DSP and the RIL's own processes, or those by hand in their place.
pub struct Ril {
    /// Status, if it was started.
    pub status: Option<Process>,
    /// The bridge.
    pub bridge: Process,
    dsp: Process,
}

impl Ril {
    /// Starts the DSP, which sends `rate`, the bridge, and status if it is wanted; all are ready when this returns.
    pub fn start(site: &Site, rate: &str, has_status: bool) -> Result<Ril> {
        let status = has_status.then_some("ril run status");
        Ril::start_as(site, rate, "ril run bridge --port dsp", status)
    }

    /// Starts the DSP, which sends `rate`, and bridge and status by hand.
    pub fn by_hand(site: &Site, rate: &str, has_status: bool) -> Result<Ril> {
        let status = has_status.then_some("status-by-hand");
        Ril::start_as(site, rate, "bridge-by-hand", status)
    }

    fn start_as(site: &Site, rate: &str, bridge: &str, status: Option<&str>) -> Result<Ril> {
        Ok(Ril {
            dsp: site.start(&format!("dsp {rate}"))?,
            bridge: site.start(bridge)?,
            status: status.map(|role| site.start(role)).transpose()?,
        })
    }

    /// Ends all of them. When the DSP sent each of its first frames, ns.
    pub fn end(self, site: &Site) -> Result<Vec<u64>> {
        if let Some(status) = self.status {
            status.end();
        }
        self.bridge.end();
        site.end(self.dsp)
    }
}

/// What a recorder says at its end.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Recorded {
    /// Messages that the disk has.
    pub messages: u64,
    /// Messages that the disk did not take.
    pub dropped: u64,
    /// Samples that did not come to the recorder.
    pub lost: u64,
}

/// Starts `ril record` of all topics into the folder `name`; the first file is open when this returns.
pub fn start_recorder(site: &Site, name: &str) -> Result<Process> {
    let mut recorder = site.spawn(&format!("ril record --json --output {name}"))?;
    recorder.wait_for_text("recording");
    Ok(recorder)
}

/// Ends the recording, and says what became of it.
pub fn end_recorder(mut recorder: Process) -> Result<Recorded> {
    recorder.signal(Signal::TERM);
    let line = recorder.wait_for_text("ril.Record.v1");
    recorder.wait_exit();
    Ok(serde_json::from_str(&line.text)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(cpus: &[usize]) -> CpuSet {
        let mut set = CpuSet::new();
        cpus.iter().for_each(|cpu| set.set(*cpu));
        set
    }

    #[test]
    fn neighbours_share_a_processor_or_have_one_each() {
        use Placement::{Free, OtherProcessor, SameProcessor};
        let cases: [(_, &[usize], _); 4] = [
            (Free, &[3, 5, 6], [None, None, None]),
            (SameProcessor, &[3, 5, 6], [Some(3), Some(3), Some(3)]),
            (OtherProcessor, &[3, 5, 6], [Some(3), Some(5), Some(3)]),
            (OtherProcessor, &[0], [Some(0), Some(0), Some(0)]),
        ];
        for (placement, allowed, expected) in cases {
            let places = [0, 1, 2].map(|position| placement.processors(position, &set(allowed)));
            let expected = expected.map(|cpu| cpu.map(|cpu| set(&[cpu])));
            assert_eq!(places, expected, "{placement:?}");
        }
    }
}
