//! Both ends of a relay, and of plain Zenoh beside it: a robot that publishes as bridge and status do, and a consumer on a station's
//! machine.

use anyhow::{Result, ensure};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Domain, Ipc, MonotonicNs, RobotId, SchedulingRole, request_slice};
use runtime::signal::Termination;

use crate::measured::{Arrival, WARM_UP};
use crate::pace::Pace;
use crate::peers::network::{zenoh_publisher, zenoh_put, zenoh_session, zenoh_subscriber};
use crate::peers::{Mark, TIMEOUT};
use crate::stream::telemetry;

/// Key of the telemetry that is measured over plain Zenoh.
const HERO: &str = "bench/hero_telemetry";

/// What a robot publishes at one moment: both kinds of telemetry of a frame of the DSP, and once a second the state of the bridge.
type Outlet<'a> =
    Box<dyn FnMut(&DspTelemetry, &HeroTelemetry, Option<&ModuleState>) -> Result<()> + 'a>;

/// Publishes at `rate_hz` until `termination`.
fn publish(mut outlet: Outlet<'_>, rate_hz: u32, termination: &Termination) -> Result<()> {
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

fn join(name: &str) -> Result<Ipc> {
    let domain = Domain::from_environment()?;
    Ok(Ipc::join(&domain, RobotId::DEFAULT, name)?)
}

/// Is a robot in the domain of the environment.
pub fn be_robot(
    rate_hz: u32,
    termination: &Termination,
    ready: impl FnOnce() -> Result<()>,
) -> Result<()> {
    let ipc = join("bench-robot")?;
    let mut dsp = ipc.publisher::<DspTelemetry>()?;
    let mut hero = ipc.publisher::<HeroTelemetry>()?;
    let mut state = ipc.publisher::<ModuleState>()?;
    let outlet: Outlet<'_> = Box::new(|new_dsp, new_hero, new_state| {
        dsp.publish(|slot| *slot = *new_dsp)?;
        hero.publish(|slot| *slot = *new_hero)?;
        if let Some(new_state) = new_state {
            state.publish(|slot| *slot = *new_state)?;
        }
        Ok(())
    });
    ready()?;
    publish(outlet, rate_hz, termination)
}

/// Reads `samples` samples of a robot in the domain of the environment. `ready` is called when the first one has come.
pub fn consume(samples: usize, ready: impl FnOnce() -> Result<()>) -> Result<Vec<Arrival>> {
    let ipc = join("bench-consumer")?;
    let mut subscriber = ipc.subscriber::<HeroTelemetry>()?;
    request_slice(SchedulingRole::Consumer);
    let mut arrivals = Vec::with_capacity(WARM_UP + samples);
    let mut ready = Some(ready);
    let mut last = MonotonicNs::now();
    while arrivals.len() < WARM_UP + samples {
        subscriber.wait(TIMEOUT)?;
        if subscriber.drain(|sample| arrivals.push(arrival(sample)))? > 0 {
            last = MonotonicNs::now();
            ready.take().map_or(Ok(()), |ready| ready())?;
        }
        let is_late = MonotonicNs::now().since(last) >= TIMEOUT;
        ensure!(!is_late, "nothing comes of the robot");
    }
    Ok(arrivals.split_off(WARM_UP))
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
    publish(outlet, rate_hz, termination)
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
