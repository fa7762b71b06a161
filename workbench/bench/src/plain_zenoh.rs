//! Zenoh without a relay: what a relay is compared with. The same samples go between two processes over TCP, with what a relay
//! asks of Zenoh: best effort, express, and a sample that has no room is dropped.

use anyhow::{Context, Result, anyhow};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, SharedStruct};
use runtime::signal::Termination;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::{Config, Session, Wait};

use crate::latency::{Recorder, Series};
use crate::peers::ends::PATIENCE;
use crate::relayed::{self, Outlet, mark};

/// Key of the telemetry that is measured.
const HERO: &str = "bench/hero_telemetry";

/// A session that listens (`listen`) or connects (`connect`) at `endpoint`.
fn session(endpoint: &str, role: &str) -> Result<Session> {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("listen/endpoints", "[]"),
        (
            &format!("{role}/endpoints") as &str,
            &format!("[\"{endpoint}\"]") as &str,
        ),
    ] {
        config
            .insert_json5(key, value)
            .map_err(|error| anyhow!(error))?;
    }
    zenoh::open(config).wait().map_err(|error| anyhow!(error))
}

struct Sender {
    dsp: Publisher<'static>,
    hero: Publisher<'static>,
    state: Publisher<'static>,
    _session: Session,
}

impl Sender {
    fn new(endpoint: &str) -> Result<Sender> {
        let session = session(endpoint, "listen")?;
        let publisher = |key| {
            session
                .declare_publisher(key)
                .congestion_control(CongestionControl::Drop)
                .reliability(Reliability::BestEffort)
                .express(true)
                .wait()
                .map_err(|error| anyhow!(error))
        };
        Ok(Sender {
            dsp: publisher("bench/dsp_telemetry")?,
            hero: publisher(HERO)?,
            state: publisher("bench/module_state")?,
            _session: session,
        })
    }
}

fn put(publisher: &Publisher<'_>, sample: &impl SharedStruct) -> Result<()> {
    let sent = publisher.put(sample.bytes().to_vec()).wait();
    sent.map_err(|error| anyhow!(error))
}

impl Outlet for Sender {
    fn telemetry(&mut self, dsp: &DspTelemetry, hero: &HeroTelemetry) -> Result<()> {
        put(&self.dsp, dsp)?;
        put(&self.hero, hero)
    }

    fn state(&mut self, state: &ModuleState) -> Result<()> {
        put(&self.state, state)
    }
}

/// Publishes as a robot does, until it is ended.
pub fn publish(endpoint: &str, rate_hz: u32, ready: impl FnOnce() -> Result<()>) -> Result<()> {
    let termination = Termination::install()?;
    let sender = Sender::new(endpoint)?;
    ready()?;
    relayed::publish(sender, rate_hz, std::time::Duration::ZERO, &termination)
}

/// Reads `samples` samples. `ready` is called when the first one has come.
pub fn consume(
    endpoint: &str,
    samples: usize,
    ready: impl FnOnce() -> Result<()>,
) -> Result<Series> {
    let session = session(endpoint, "connect")?;
    let subscriber = session
        .declare_subscriber("bench/*")
        .wait()
        .map_err(|error| anyhow!(error))?;
    let mut recorder = Recorder::new(samples);
    let mut ready = Some(ready);
    while !recorder.is_complete() {
        let sample = subscriber
            .recv_timeout(PATIENCE)
            .map_err(|error| anyhow!(error))?
            .context("no sample came")?;
        if sample.key_expr().as_str() == HERO {
            let bytes = sample.payload().to_bytes();
            let hero = HeroTelemetry::from_bytes(&bytes).context("another message")?;
            recorder.take(mark(&hero));
            ready.take().map_or(Ok(()), |ready| ready())?;
        }
    }
    Ok(recorder.finish())
}
