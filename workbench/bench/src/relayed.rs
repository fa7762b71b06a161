//! Both ends of a relay, and of plain Zenoh beside it: a robot that publishes as bridge and status do, and a consumer
//! on a station's machine.

use anyhow::Result;
use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use runtime::signal::Termination;

use crate::harness::report_ready;
use crate::pace::Pace;
use crate::peers::network::{zenoh_publisher, zenoh_put, zenoh_session, zenoh_subscriber};
use crate::peers::{Mark, Receive, join};
use crate::stream::telemetry;

/// Key of the telemetry that is measured over plain Zenoh.
const HERO: &str = "bench/hero_telemetry";

/// What a robot publishes at one moment: both kinds of telemetry of a frame of the DSP, and once a second the state of
/// the bridge.
type Outlet<'a> =
    Box<dyn FnMut(&DspTelemetry, &HeroTelemetry, Option<&ModuleState>) -> Result<()> + 'a>;

/// Publishes at `rate_hz` until it is asked to end.
fn publish(mut outlet: Outlet<'_>, rate_hz: u32, end: &Termination) -> Result<()> {
    let mut pace = Pace::new(rate_hz);
    let dsp = DspTelemetry {
        valid_groups: u16::MAX,
        flying: 1,
        ..DspTelemetry::default()
    };
    let mut hero = telemetry();
    for index in 1.. {
        pace.wait()?;
        if end.requested() {
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

/// Is a robot in the domain of the environment.
pub fn be_robot(rate_hz: u32, end: &Termination) -> Result<()> {
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
    report_ready()?;
    publish(outlet, rate_hz, end)
}

/// Publishes as a robot does, over plain Zenoh, until it is asked to end.
pub fn publish_over_zenoh(endpoint: &str, rate_hz: u32, end: &Termination) -> Result<()> {
    let session = zenoh_session(endpoint, "listen")?;
    let keys = ["bench/dsp_telemetry", HERO, "bench/module_state"];
    let [dsp, hero, state] = keys.map(|key| zenoh_publisher(&session, key));
    let (dsp, hero, state) = (dsp?, hero?, state?);
    let outlet: Outlet<'_> = Box::new(|new_dsp, new_hero, new_state| {
        zenoh_put(&dsp, new_dsp)?;
        zenoh_put(&hero, new_hero)?;
        new_state.map_or(Ok(()), |new_state| zenoh_put(&state, new_state))
    });
    report_ready()?;
    publish(outlet, rate_hz, end)
}

/// Receives the telemetry of a robot over plain Zenoh.
pub fn zenoh_receiver(endpoint: &str) -> Result<Receive> {
    zenoh_subscriber(zenoh_session(endpoint, "connect")?, "bench/*", HERO)
}
