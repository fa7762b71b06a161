//! Both ends of a relay, and of plain Zenoh beside it: robots that publish as bridge and status do, and consumers on a station's
//! machine.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{Domain, Ipc, MonotonicNs, RobotId, SchedulingRole, request_slice};
use runtime::signal::Termination;
use serde::{Deserialize, Serialize};

use crate::measured::{Arrival, WARM_UP};
use crate::pace::{Pace, sleep_until};
use crate::peers::network::{zenoh_publisher, zenoh_put, zenoh_session, zenoh_subscriber};
use crate::peers::{Mark, TIMEOUT};
use crate::stream::telemetry;

/// Key of the telemetry that is measured over plain Zenoh.
const HERO: &str = "bench/hero_telemetry";

/// How often a relay publishes its counts at least.
const COUNTS_PERIOD: Duration = Duration::from_secs(1);

/// What a robot publishes at one moment: both kinds of telemetry of a frame of the DSP, and once a second the state of the bridge.
type Outlet<'a> =
    Box<dyn FnMut(&DspTelemetry, &HeroTelemetry, Option<&ModuleState>) -> Result<()> + 'a>;

/// Publishes at `rate_hz` until `termination`. Begins `delay` late, so that several robots do not publish all at once.
fn publish(
    mut outlet: Outlet<'_>,
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
    for index in 1.. {
        pace.wait()?;
        if termination.requested() {
            break;
        }
        let now = MonotonicNs::now();
        (hero.received_ns, hero.published_ns) = (now.0, now.0);
        let sent_ns = now.0;
        Mark { index, sent_ns }.stamp(&mut hero);
        let state = ModuleState {
            published_ns: now.0,
            ..ModuleState::default()
        };
        let is_due = index % u64::from(rate_hz) == 1;
        outlet(&dsp, &hero, is_due.then_some(&state))?;
    }
    Ok(())
}

/// The services of one robot in shared memory.
fn robot(domain: &Domain, number: NonZeroU32) -> Result<Outlet<'static>> {
    let ipc = Ipc::join(domain, RobotId::from(number), "bench-robot")?;
    let mut dsp = ipc.publisher::<DspTelemetry>()?;
    let mut hero = ipc.publisher::<HeroTelemetry>()?;
    let mut state = ipc.publisher::<ModuleState>()?;
    Ok(Box::new(move |new_dsp, new_hero, new_state| {
        dsp.publish(|slot| *slot = *new_dsp)?;
        hero.publish(|slot| *slot = *new_hero)?;
        if let Some(new_state) = new_state {
            state.publish(|slot| *slot = *new_state)?;
        }
        Ok(())
    }))
}

/// Is robot 1 in the first of these domains, robot 2 in the second and so on, each in a thread of its own.
pub fn be_robots(
    rate_hz: u32,
    roots: &[PathBuf],
    termination: &Termination,
    ready: impl FnOnce() -> Result<()>,
) -> Result<()> {
    let period = Duration::from_secs(1) / rate_hz;
    let count = roots.len() as u32;
    let (sender, started) = std::sync::mpsc::channel();
    thread::scope(|scope| {
        let threads: Vec<_> = (0..)
            .zip(numbers().zip(roots))
            .map(|(place, (number, root))| {
                let sender = sender.clone();
                scope.spawn(move || {
                    let outlet = robot(&Domain::new(root)?, number)?;
                    // The other end waits as long as this thread runs.
                    let _ = sender.send(());
                    publish(outlet, rate_hz, period * place / count, termination)
                })
            })
            .collect();
        drop(sender);
        if started.iter().take(roots.len()).count() == roots.len() {
            ready()?;
        }
        join(threads).map(drop)
    })
}

/// What a consumer has read of one robot.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Reading {
    /// The samples that count.
    pub arrivals: Vec<Arrival>,
    /// Meanwhile, and of all topics: what the robot's relay has sent and the station's relay did not get.
    pub lost_on_air: u64,
    /// Meanwhile, and of all topics: what the robot's relay did not read in time.
    pub lost_in_relay: u64,
}

impl Reading {
    /// Of a way that loses nothing on the air.
    pub fn of(arrivals: Vec<Arrival>) -> Vec<Reading> {
        vec![Reading {
            arrivals,
            ..Reading::default()
        }]
    }
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
    // What the station's relay counts of the link to the robot; zero where there is no relay.
    let mut counts = ipc.subscriber::<RelayLink>()?;
    let mut before = RelayLink::default();
    request_slice(SchedulingRole::Consumer);
    let mut arrivals = Vec::with_capacity(WARM_UP + samples);
    let mut first = Some(first);
    let mut last = MonotonicNs::now();
    while arrivals.len() < WARM_UP + samples {
        subscriber.wait(TIMEOUT)?;
        if subscriber.drain(|sample| arrivals.push(arrival(sample)))? > 0 {
            last = MonotonicNs::now();
            if let Some(first) = first.take() {
                first();
            }
        }
        ensure!(
            MonotonicNs::now().since(last) < TIMEOUT,
            "nothing comes of robot {number}"
        );
        if arrivals.len() <= WARM_UP {
            counts.drain(|counts| before = *counts)?;
        }
    }
    sleep_until(MonotonicNs::now() + COUNTS_PERIOD)?;
    let mut after = before;
    counts.drain(|counts| after = *counts)?;
    let since = |of: fn(&RelayLink) -> u64| of(&after).saturating_sub(of(&before));
    Ok(Reading {
        arrivals: arrivals.split_off(WARM_UP),
        lost_on_air: since(|counts| counts.samples_lost_on_air),
        lost_in_relay: since(|counts| counts.samples_lost_in_relay),
    })
}

fn arrival(sample: &HeroTelemetry) -> Arrival {
    let mark = Mark::of(sample);
    Arrival {
        index: mark.index,
        sent_ns: mark.sent_ns,
        arrived_ns: MonotonicNs::now().0,
        ..Arrival::default()
    }
}

/// Publishes as a robot does, over plain Zenoh, until `termination`.
pub fn publish_over_zenoh(
    endpoint: &str,
    rate_hz: u32,
    termination: &Termination,
    ready: impl FnOnce() -> Result<()>,
) -> Result<()> {
    let session = zenoh_session(endpoint, "listen")?;
    let keys = ["bench/dsp_telemetry", HERO, "bench/module_state"];
    let [dsp, hero, state] = keys.map(|key| zenoh_publisher(&session, key));
    let (dsp, hero, state) = (dsp?, hero?, state?);
    let outlet: Outlet<'_> = Box::new(|new_dsp, new_hero, new_state| {
        zenoh_put(&dsp, new_dsp)?;
        zenoh_put(&hero, new_hero)?;
        new_state.map_or(Ok(()), |new_state| zenoh_put(&state, new_state))
    });
    ready()?;
    publish(outlet, rate_hz, Duration::ZERO, termination)
}

/// Reads `samples` samples over plain Zenoh. `ready` is called when the first one has come.
pub fn consume_over_zenoh(
    endpoint: &str,
    samples: usize,
    ready: impl FnOnce() -> Result<()>,
) -> Result<Vec<Arrival>> {
    let session = zenoh_session(endpoint, "connect")?;
    let mut receive = zenoh_subscriber(session, "bench/*", HERO)?;
    let mut arrivals = Vec::with_capacity(WARM_UP + samples);
    let mut ready = Some(ready);
    while arrivals.len() < WARM_UP + samples {
        receive(&mut |mark| {
            arrivals.push(Arrival {
                index: mark.index,
                sent_ns: mark.sent_ns,
                arrived_ns: MonotonicNs::now().0,
                ..Arrival::default()
            });
        })?;
        if !arrivals.is_empty() {
            ready.take().map_or(Ok(()), |ready| ready())?;
        }
    }
    Ok(arrivals.split_off(WARM_UP))
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
