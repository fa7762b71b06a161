//! Zenoh, two peers connected by a Unix socket; no discovery, no batching.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use ipc_types::payload::HeroTelemetry;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};

use super::ends::{Mark, PATIENCE};
use crate::plain;

const KEY: &str = "hero/telemetry";

/// A session that listens (`listen`) or connects (`connect`) at the site's socket.
fn session(site: &Path, role: &str) -> Result<Session> {
    let mut config = Config::default();
    let endpoint = format!("unixsock-stream/{}", site.join("socket").display());
    for (key, value) in [
        ("mode", "\"peer\"".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("listen/endpoints", "[]".to_owned()),
        (
            &format!("{role}/endpoints") as &str,
            format!("[\"{endpoint}\"]"),
        ),
    ] {
        config
            .insert_json5(key, &value)
            .map_err(|error| anyhow!(error))?;
    }
    zenoh::open(config).wait().map_err(|error| anyhow!(error))
}

pub struct Sender {
    publisher: Publisher<'static>,
    _session: Session,
}

impl Sender {
    pub fn new(site: &Path) -> Result<Sender> {
        let session = session(site, "connect")?;
        let publisher = session
            .declare_publisher(KEY)
            .express(true)
            .wait()
            .map_err(|error| anyhow!(error))?;
        Ok(Sender {
            publisher,
            _session: session,
        })
    }
}

impl super::ends::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        self.publisher
            .put(plain::to_bytes(sample).to_vec())
            .wait()
            .map_err(|error| anyhow!(error))
    }
}

pub struct Receiver {
    subscriber: Subscriber<FifoChannelHandler<Sample>>,
    _session: Session,
}

impl Receiver {
    pub fn new(site: &Path) -> Result<Receiver> {
        let session = session(site, "listen")?;
        let subscriber = session
            .declare_subscriber(KEY)
            .wait()
            .map_err(|error| anyhow!(error))?;
        Ok(Receiver {
            subscriber,
            _session: session,
        })
    }
}

impl super::ends::Receiver for Receiver {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        let sample = self
            .subscriber
            .recv_timeout(PATIENCE)
            .map_err(|error| anyhow!(error))?
            .context("no sample came")?;
        let bytes = sample.payload().to_bytes();
        let bytes = bytes[..].try_into().context("another message")?;
        take(Mark::of(&plain::from_bytes(bytes)));
        Ok(())
    }
}
