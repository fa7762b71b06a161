//! Consumers of telemetry, and what the kernel gives without us: `poll` and `read`.

use std::fs::{File, OpenOptions};
use std::io::Read;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use clap::ValueEnum;
use dsp_protocol::MAX_CLASSIC_FRAME_LEN;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::{Losses, MonotonicNs, SchedulingRole, Topic, request_slice};
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use serde::{Deserialize, Serialize};

use crate::harness::report_ready;
use crate::measured::{Arrival, WARM_UP};
use crate::peers::{Receive, TIMEOUT, join};
use crate::stream;

/// Length of a full status frame.
const FRAME_LEN: usize = MAX_CLASSIC_FRAME_LEN;

/// Most arrivals for which there is room from the beginning.
const ROOM: usize = 1 << 17;

/// Which telemetry.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum Service {
    /// The bridge's.
    Dsp,
    /// Status'.
    Hero,
}

/// A sample that says which frame it was made of: the DSP time counts the frames from 1.
pub trait Indexed: Topic {
    /// It has just come.
    fn arrival(&self) -> Arrival;
}

impl Indexed for DspTelemetry {
    fn arrival(&self) -> Arrival {
        Arrival {
            index: self.dsp_time_ms.into(),
            received_ns: self.received_ns,
            arrived_ns: MonotonicNs::now().0,
            ..Arrival::default()
        }
    }
}

impl Indexed for HeroTelemetry {
    fn arrival(&self) -> Arrival {
        Arrival {
            index: (self.dsp_time_s * 1000.0).round() as u64,
            received_ns: self.received_ns,
            published_ns: self.published_ns,
            arrived_ns: MonotonicNs::now().0,
            ..Arrival::default()
        }
    }
}

/// Receives so many samples over a peer, behind those that do not count. `on_first` is called when the first one has
/// come.
pub fn receive(
    mut receive: Receive,
    samples: usize,
    on_first: impl FnOnce() -> Result<()>,
) -> Result<Vec<Arrival>> {
    let mut arrivals = Vec::with_capacity((WARM_UP + samples).min(ROOM));
    let mut on_first = Some(on_first);
    let mut last = MonotonicNs::now();
    while arrivals.len() < WARM_UP + samples {
        let before = arrivals.len();
        receive(&mut |mark| {
            arrivals.push(Arrival {
                index: mark.index,
                sent_ns: mark.sent_ns,
                arrived_ns: MonotonicNs::now().0,
                ..Arrival::default()
            });
        })?;
        if arrivals.len() > before {
            last = MonotonicNs::now();
            on_first.take().map_or(Ok(()), |on_first| on_first())?;
        }
        let is_late = MonotonicNs::now().since(last) >= TIMEOUT;
        ensure!(!is_late, "nothing comes");
    }
    Ok(arrivals.split_off(WARM_UP))
}

/// Reads `count` samples, or until it is asked to end.
pub fn consume<T: Indexed>(count: usize, end: &Termination) -> Result<Vec<Arrival>> {
    let mut subscriber = join("bench-receiver")?.subscriber::<T>()?;
    request_slice(SchedulingRole::Consumer);
    let mut arrivals = Vec::with_capacity(count.min(ROOM));
    report_ready()?;
    while arrivals.len() < count && !end.requested() {
        subscriber.wait(TIMEOUT)?;
        subscriber.drain(|sample| arrivals.push(sample.arrival()))?;
    }
    Ok(arrivals)
}

/// What a consumer counted that only keeps up.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Kept {
    /// Samples that came.
    pub received: u64,
    /// Samples that were published and did not come.
    pub lost: u64,
    /// Frames that were sent and of which nothing came, wherever they were lost.
    pub missing: u64,
    /// How long it took, ns.
    pub elapsed_ns: u64,
}

/// Reads `HeroTelemetry` for so long, and counts.
pub fn keep_up(duration: Duration) -> Result<Kept> {
    let mut subscriber = join("bench-receiver")?.subscriber::<HeroTelemetry>()?;
    request_slice(SchedulingRole::Consumer);
    report_ready()?;
    // The first sample begins the count: bridge and status are up by then.
    let (mut last, mut missing) = (None, 0_u64);
    subscriber.wait(TIMEOUT)?;
    subscriber.drain(|sample| last = Some(sample.arrival().index))?;
    let before = subscriber.losses();
    let begin = MonotonicNs::now();
    while MonotonicNs::now().since(begin) < duration {
        subscriber.wait(TIMEOUT)?;
        subscriber.drain(|sample| {
            let index = sample.arrival().index;
            if let Some(last) = last.replace(index) {
                missing += index.saturating_sub(last + 1);
            }
        })?;
    }
    let Losses { received, lost, .. } = subscriber.losses();
    Ok(Kept {
        received: received - before.received,
        lost: lost - before.lost,
        missing,
        elapsed_ns: MonotonicNs::now().0 - begin.0,
    })
}

/// Opens the terminal at `path`, which hands on every byte as it comes.
pub fn raw_terminal(path: &Path) -> Result<File> {
    let terminal = OpenOptions::new().read(true).write(true).open(path)?;
    let mut settings = tcgetattr(&terminal)?;
    settings.make_raw();
    tcsetattr(&terminal, OptionalActions::Now, &settings)?;
    Ok(terminal)
}

/// Reads at least `count` frames from the terminal at `path` with `poll` and `read`, as the kernel gives them.
pub fn read_raw(path: &Path, count: usize) -> Result<Vec<Arrival>> {
    let mut terminal = raw_terminal(path)?;
    let mut arrivals = Vec::with_capacity(count + 64);
    let mut buffer = [0; 4096];
    let mut held = 0;
    report_ready()?;
    while arrivals.len() < count {
        poll(&mut [PollFd::new(&terminal, PollFlags::IN)], None)?;
        let len = terminal.read(&mut buffer[held..])?;
        let arrived_ns = MonotonicNs::now().0;
        ensure!(len > 0, "the terminal has hung up");
        held += len;
        let whole = held - held % FRAME_LEN;
        for frame in buffer[..whole].chunks(FRAME_LEN) {
            arrivals.push(Arrival {
                index: stream::time_ms_of(frame).context("no frame")?.into(),
                arrived_ns,
                ..Arrival::default()
            });
        }
        buffer.copy_within(whole..held, 0);
        held -= whole;
    }
    Ok(arrivals)
}
