//! Both ends of a relay: robots that publish as bridge and status do, and consumers on a station's machine.
//!
//! A relay translates the moments of a sample. So the sample carries the moment of its publishing once more, in a field that
//! no relay changes: `dsp_time_s`, in seconds of `CLOCK_MONOTONIC`, which both ends share because they are on one machine.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{
    Domain, Ipc, MonotonicNs, Publisher, RobotId, SchedulingRole, Subscriber, request_slice,
};
use runtime::signal::Termination;
use serde::{Deserialize, Serialize};

use crate::latency::{Recorder, Series};
use crate::pace::{Pace, sleep_until};
use crate::peers::{Mark, PATIENCE};
use crate::stream::telemetry;

/// What carries the samples of one robot: shared memory, or plain Zenoh beside it.
pub trait Outlet {
    /// Publishes what the bridge and status publish of one frame of the DSP: both kinds of telemetry.
    fn telemetry(&mut self, dsp: &DspTelemetry, hero: &HeroTelemetry) -> Result<()>;

    /// Publishes the state of the bridge.
    fn state(&mut self, state: &ModuleState) -> Result<()>;
}

/// Publishes telemetry at `rate_hz` and the bridge's state once a second, until `termination`. Begins `delay` late, so that
/// several robots do not publish all at once.
pub fn publish(
    mut outlet: impl Outlet,
    rate_hz: u32,
    delay: Duration,
    termination: &Termination,
) -> Result<()> {
    sleep_until(MonotonicNs::now() + delay)?;
    let mut pace = Pace::new(rate_hz);
    let dsp = DspTelemetry {
        valid_groups: u16::MAX,
        flying: 1,
        ..DspTelemetry::default()
    };
    let mut hero = telemetry();
    while !termination.requested() {
        pace.wait()?;
        hero.source_sequence += 1;
        let now = MonotonicNs::now();
        hero.received_ns = now.0;
        hero.published_ns = now.0;
        hero.dsp_time_s = now.0 as f64 * 1e-9;
        outlet.telemetry(&dsp, &hero)?;
        if hero.source_sequence % u64::from(rate_hz) == 1 {
            outlet.state(&ModuleState {
                published_ns: now.0,
                ..ModuleState::default()
            })?;
        }
    }
    Ok(())
}

/// What a consumer has read of one robot.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Reading {
    /// From publishing to reading.
    pub series: Series,
    /// Meanwhile, and of all topics: what the robot's relay has sent and the station's relay did not get.
    pub lost_on_air: u64,
    /// Meanwhile, and of all topics: what the robot's relay did not read in time.
    pub lost_in_relay: u64,
}

/// The mark of a sample that may have been relayed.
pub fn mark(sample: &HeroTelemetry) -> Mark {
    Mark {
        index: sample.source_sequence,
        sent_ns: (sample.dsp_time_s * 1e9).round() as u64,
    }
}

/// The services of one robot.
struct Robot {
    dsp: Publisher<DspTelemetry>,
    hero: Publisher<HeroTelemetry>,
    state: Publisher<ModuleState>,
}

impl Robot {
    fn new(domain: &Domain, number: NonZeroU32) -> Result<Robot> {
        let ipc = Ipc::join(domain, RobotId::from(number), "bench-robot")?;
        Ok(Robot {
            dsp: ipc.publisher()?,
            hero: ipc.publisher()?,
            state: ipc.publisher()?,
        })
    }
}

impl Outlet for Robot {
    fn telemetry(&mut self, dsp: &DspTelemetry, hero: &HeroTelemetry) -> Result<()> {
        self.dsp.publish(|slot| *slot = *dsp)?;
        self.hero.publish(|slot| *slot = *hero)?;
        Ok(())
    }

    fn state(&mut self, state: &ModuleState) -> Result<()> {
        self.state.publish(|slot| *slot = *state)?;
        Ok(())
    }
}

/// Is robot 1 in the first of these domains, robot 2 in the second and so on, each in a thread of its own.
pub fn be_robots(
    rate_hz: u32,
    roots: &[PathBuf],
    ready: impl FnOnce() -> Result<()>,
) -> Result<()> {
    let termination = Termination::install()?;
    let mut robots = Vec::new();
    for (number, root) in numbers().zip(roots) {
        robots.push(Robot::new(&Domain::new(root)?, number)?);
    }
    ready()?;
    let period = Duration::from_secs(1) / rate_hz;
    let count = robots.len() as u32;
    thread::scope(|scope| {
        let threads: Vec<_> = (0..)
            .zip(robots)
            .map(|(place, robot)| {
                let (delay, termination) = (period * place / count, &termination);
                scope.spawn(move || publish(robot, rate_hz, delay, termination))
            })
            .collect();
        join(threads).map(drop)
    })
}

/// Reads `samples` samples of each of `robots` robots, each in a thread of its own. `ready` is called when each robot's first
/// sample has come.
pub fn consume(
    robots: u32,
    samples: usize,
    ready: impl FnOnce() -> Result<()> + Send,
) -> Result<Vec<Reading>> {
    let missing = AtomicU32::new(robots);
    let (first, all_are_here) = std::sync::mpsc::channel();
    thread::scope(|scope| {
        let threads: Vec<_> = numbers()
            .take(robots as usize)
            .map(|number| {
                let (missing, first) = (&missing, first.clone());
                scope.spawn(move || {
                    read(number, samples, || {
                        if missing.fetch_sub(1, Ordering::Relaxed) == 1 {
                            // The other end waits as long as this thread runs.
                            let _ = first.send(());
                        }
                    })
                })
            })
            .collect();
        drop(first);
        // An error when a thread has failed, which says more below.
        if all_are_here.recv().is_ok() {
            ready()?;
        }
        join(threads)
    })
}

fn read(number: NonZeroU32, samples: usize, first: impl FnOnce()) -> Result<Reading> {
    let domain = Domain::from_environment()?;
    let ipc = Ipc::join(&domain, RobotId::from(number), "bench-consumer")?;
    let mut subscriber = ipc.subscriber::<HeroTelemetry>()?;
    let mut link = LinkCounts::new(&ipc)?;
    request_slice(SchedulingRole::Consumer);
    let mut recorder = Recorder::new(samples);
    let mut first = Some(first);
    let mut last = MonotonicNs::now();
    while !recorder.is_complete() {
        subscriber.wait(PATIENCE)?;
        if subscriber.drain(|sample| recorder.take(mark(sample)))? > 0 {
            last = MonotonicNs::now();
            if let Some(first) = first.take() {
                first();
            }
        }
        ensure!(
            MonotonicNs::now().since(last) < PATIENCE,
            "nothing comes of robot {number}"
        );
        if !recorder.has_begun() {
            link.begin()?;
        }
    }
    let (lost_on_air, lost_in_relay) = link.end()?;
    Ok(Reading {
        series: recorder.finish(),
        lost_on_air,
        lost_in_relay,
    })
}

/// How often a relay publishes its counts at least.
const COUNTS_PERIOD: Duration = Duration::from_secs(1);

/// What the station's relay counts of the link to a robot. All zero where there is no relay.
struct LinkCounts {
    subscriber: Subscriber<RelayLink>,
    first: RelayLink,
}

impl LinkCounts {
    fn new(ipc: &Ipc) -> Result<LinkCounts> {
        Ok(LinkCounts {
            subscriber: ipc.subscriber()?,
            first: RelayLink::default(),
        })
    }

    /// What has been lost up to now does not count.
    fn begin(&mut self) -> Result<()> {
        self.subscriber.drain(|counts| self.first = *counts)?;
        Ok(())
    }

    /// What was lost on the air and in the robot's relay since the beginning.
    fn end(mut self) -> Result<(u64, u64)> {
        sleep_until(MonotonicNs::now() + COUNTS_PERIOD)?;
        let (first, mut last) = (self.first, self.first);
        self.subscriber.drain(|counts| last = *counts)?;
        let since = |of: fn(&RelayLink) -> u64| of(&last).saturating_sub(of(&first));
        Ok((
            since(|counts| counts.samples_lost_on_air),
            since(|counts| counts.samples_lost_in_relay),
        ))
    }
}

/// 1, 2, 3 …
fn numbers() -> impl Iterator<Item = NonZeroU32> {
    (1..).filter_map(NonZeroU32::new)
}

fn join<T>(threads: Vec<thread::ScopedJoinHandle<'_, Result<T>>>) -> Result<Vec<T>> {
    threads
        .into_iter()
        .map(|thread| thread.join().ok().context("a thread has failed")?)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moment_in_a_sample_is_right_to_two_nanoseconds_for_months() {
        for sent_ns in [1, 1_234_567_891, 90 * 86_400 * 1_000_000_000 + 1] {
            let sample = HeroTelemetry {
                source_sequence: 7,
                dsp_time_s: sent_ns as f64 * 1e-9,
                ..telemetry()
            };
            let mark = mark(&sample);
            assert!(mark.index == 7 && mark.sent_ns.abs_diff(sent_ns) <= 2);
        }
    }

    #[test]
    fn robots_are_counted_from_one() {
        let first: Vec<u32> = numbers().take(3).map(NonZeroU32::get).collect();
        assert_eq!(first, [1, 2, 3]);
    }
}
