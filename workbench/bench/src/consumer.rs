//! Who reads the telemetry in the end-to-end measurements, and what the kernel gives without us: `poll` and `read`.

use std::fs::OpenOptions;
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

use crate::peers::ours;
use crate::stream;

/// Length of a full status frame.
const FRAME_LEN: usize = MAX_CLASSIC_FRAME_LEN;

/// Which telemetry.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum Service {
    /// The bridge's.
    Dsp,
    /// Status'.
    Hero,
}

/// One sample, as it came.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Arrival {
    /// DSP time, which counts the frames from 1.
    pub index: u32,
    /// When the bridge had read it; 0 where there is no bridge.
    pub received_ns: u64,
    /// When status published it; 0 where there is no status.
    pub published_ns: u64,
    /// When the consumer could read it.
    pub arrived_ns: u64,
}

/// How a sample says which frame it was made of.
trait Indexed: Topic {
    fn arrival(&self) -> Arrival;
}

impl Indexed for DspTelemetry {
    fn arrival(&self) -> Arrival {
        Arrival {
            index: self.dsp_time_ms,
            received_ns: self.received_ns,
            published_ns: 0,
            arrived_ns: MonotonicNs::now().0,
        }
    }
}

impl Indexed for HeroTelemetry {
    fn arrival(&self) -> Arrival {
        Arrival {
            index: (self.dsp_time_s * 1000.0).round() as u32,
            received_ns: self.received_ns,
            published_ns: self.published_ns,
            arrived_ns: MonotonicNs::now().0,
        }
    }
}

/// Reads `count` samples of `service` and keeps their arrivals.
pub fn consume(
    service: Service,
    count: usize,
    ready: impl FnOnce() -> Result<()>,
) -> Result<Vec<Arrival>> {
    match service {
        Service::Dsp => consume_topic::<DspTelemetry>(count, ready),
        Service::Hero => consume_topic::<HeroTelemetry>(count, ready),
    }
}

fn consume_topic<T: Indexed>(
    count: usize,
    ready: impl FnOnce() -> Result<()>,
) -> Result<Vec<Arrival>> {
    let mut consumer = ours::Blocking::<T>::new()?;
    request_slice(SchedulingRole::Consumer);
    let mut arrivals = Vec::with_capacity(count + 64);
    ready()?;
    while arrivals.len() < count {
        consumer.wait_and_drain(|sample| arrivals.push(sample.arrival()))?;
    }
    Ok(arrivals)
}

/// A sample as it came to a consumer that watches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchedSample {
    /// DSP time, which counts the frames from 1.
    pub index: u32,
    /// When the bridge had read it.
    pub received_ns: u64,
    /// When the consumer could read it.
    pub arrived_ns: u64,
}

/// What came to a consumer that watches until it is ended. Kept as short numbers: all of them are told in one line, which has room
/// for some 40,000 samples.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Watched {
    /// When the first one came.
    since_ns: u64,
    /// Of each its index, when it came since the first, and how long the bridge had it by then.
    samples: Vec<(u32, u64, u64)>,
}

impl Watched {
    /// Adds the next one.
    pub fn add(&mut self, sample: WatchedSample) {
        if self.samples.is_empty() {
            self.since_ns = sample.arrived_ns;
        }
        self.samples.push((
            sample.index,
            sample.arrived_ns - self.since_ns,
            sample.arrived_ns.saturating_sub(sample.received_ns),
        ));
    }

    /// All of them, in order.
    pub fn samples(&self) -> impl Iterator<Item = WatchedSample> + '_ {
        self.samples.iter().map(|(index, since_first, since_read)| {
            let arrived_ns = self.since_ns + since_first;
            WatchedSample {
                index: *index,
                received_ns: arrived_ns.saturating_sub(*since_read),
                arrived_ns,
            }
        })
    }
}

/// Reads `HeroTelemetry` until `termination`, and keeps when each sample came.
pub fn watch(termination: &Termination, ready: impl FnOnce() -> Result<()>) -> Result<Watched> {
    let mut consumer = ours::Blocking::<HeroTelemetry>::new()?;
    request_slice(SchedulingRole::Consumer);
    let mut watched = Watched::default();
    ready()?;
    while !termination.requested() {
        consumer.wait_and_drain(|sample| {
            let Arrival {
                index,
                received_ns,
                arrived_ns,
                ..
            } = sample.arrival();
            watched.add(WatchedSample {
                index,
                received_ns,
                arrived_ns,
            });
        })?;
    }
    Ok(watched)
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
pub fn keep_up(duration: Duration, ready: impl FnOnce() -> Result<()>) -> Result<Kept> {
    let mut consumer = ours::Blocking::<HeroTelemetry>::new()?;
    request_slice(SchedulingRole::Consumer);
    ready()?;
    // The first sample begins the count: bridge and status are up by then.
    let (mut last, mut missing) = (None, 0_u64);
    consumer.wait_and_drain(|sample| last = Some(sample.arrival().index))?;
    let before = consumer.losses();
    let begin = MonotonicNs::now();
    while MonotonicNs::now().since(begin) < duration {
        consumer.wait_and_drain(|sample| {
            let index = sample.arrival().index;
            if let Some(last) = last.replace(index) {
                missing += u64::from(index.saturating_sub(last + 1));
            }
        })?;
    }
    let Losses { received, lost, .. } = consumer.losses();
    Ok(Kept {
        received: received - before.received,
        lost: lost - before.lost,
        missing,
        elapsed_ns: MonotonicNs::now().0 - begin.0,
    })
}

/// Reads at least `count` frames from the terminal at `path` with `poll` and `read`, as the kernel gives them.
pub fn read_raw(
    path: &Path,
    count: usize,
    ready: impl FnOnce() -> Result<()>,
) -> Result<Vec<Arrival>> {
    let mut terminal = OpenOptions::new().read(true).write(true).open(path)?;
    let mut settings = tcgetattr(&terminal)?;
    settings.make_raw();
    tcsetattr(&terminal, OptionalActions::Now, &settings)?;
    let mut arrivals = Vec::with_capacity(count + 64);
    let mut buffer = [0; 4096];
    let mut held = 0;
    ready()?;
    while arrivals.len() < count {
        poll(&mut [PollFd::new(&terminal, PollFlags::IN)], None)?;
        let len = terminal.read(&mut buffer[held..])?;
        let arrived_ns = MonotonicNs::now().0;
        ensure!(len > 0, "the terminal has hung up");
        held += len;
        let whole = held - held % FRAME_LEN;
        for frame in buffer[..whole].chunks(FRAME_LEN) {
            arrivals.push(Arrival {
                index: stream::time_ms_of(frame).context("no frame")?,
                received_ns: 0,
                published_ns: 0,
                arrived_ns,
            });
        }
        buffer.copy_within(whole..held, 0);
        held -= whole;
    }
    Ok(arrivals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_watched_is_told_as_it_came() {
        let samples = [(7, 100, 130), (8, 200, 260), (10, 400, 410)].map(
            |(index, received_ns, arrived_ns)| WatchedSample {
                index,
                received_ns,
                arrived_ns,
            },
        );
        let mut watched = Watched::default();
        for sample in samples {
            watched.add(sample);
        }
        let text = serde_json::to_string(&watched).unwrap();
        let told: Watched = serde_json::from_str(&text).unwrap();
        assert_eq!(told.samples().collect::<Vec<_>>(), samples);
    }
}
