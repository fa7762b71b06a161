//! [`Network`]: Zenoh, as far as a relay needs it. No other file names it.
//!
//! Zenoh has threads of its own. What they receive waits in rings that keep the newest, with the moment of its arrival, and
//! an event descriptor wakes the relay's one wait. Sending never blocks: what a link cannot take is dropped, and comes again where
//! it must.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;

use ipc_types::{MonotonicNs, SchedulingRole, request_short_slice};
use rustix::event::{EventfdFlags, eventfd};
use serde_json::{Value, json};
use zenoh::Wait;
use zenoh::handlers::{Callback, IntoHandler, RingChannel, RingChannelHandler};
use zenoh::qos::{CongestionControl, Priority as ZenohPriority, Reliability};
use zenoh::sample::Sample;

use crate::config::{Config, Priority, Through};

/// Longest message that is put together of fragments, bytes: the longest sample, and twice the longest message of a relay.
const MAX_MESSAGE_BYTES: usize = 2 * 1024 * 1024;

/// Batches that may wait to be sent, for each priority: a burst of one sample of each of some topics.
const QUEUE_BATCHES: usize = 4;

/// The same in a router, where samples of many robots go to one station: as many as Zenoh allows. Samples that find no room are dropped;
/// with 20 robots at 50 samples a second of two topics, 16 batches are full after 8 ms in which the router's sender does not run.
const ROUTER_QUEUE_BATCHES: usize = 16;

/// What Zenoh reads about its threads when the first one of them is started.
const RUNTIME_VARIABLE: &str = "ZENOH_RUNTIME";

/// One thread does what five to six do by default.
const ONE_THREAD: &str =
    "(app: (handover: net), acc: (handover: net), tx: (handover: net), rx: (handover: net))";

/// Lets one thread of Zenoh wait for the sockets, receive and send. By default one thread waits and wakes another one that receives:
/// each message comes later by a wake-up, of which a station then has a third more. Only a router has so much to do that several
/// threads help. To be called first of all: it changes nothing when the process has threads already, or when `ZENOH_RUNTIME` is
/// set.
pub fn share_one_thread() {
    let is_alone = std::fs::read_dir("/proc/self/task").is_ok_and(|threads| threads.count() == 1);
    if is_alone && std::env::var_os(RUNTIME_VARIABLE).is_none() {
        // SAFETY: no other thread reads or writes the environment meanwhile, because there is none.
        #[allow(unsafe_code)]
        unsafe {
            std::env::set_var(RUNTIME_VARIABLE, ONE_THREAD);
        }
    }
}

/// Which side a relay is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Beside the robot.
    Robot,
    /// At a ground station.
    Station,
    /// Between robots and stations.
    Router,
}

/// The network does not work.
#[derive(Debug, thiserror::Error)]
#[error("{what}: {reason}")]
pub struct NetworkError {
    what: String,
    reason: String,
}

impl NetworkError {
    fn new(what: impl Into<String>, reason: impl std::fmt::Display) -> NetworkError {
        NetworkError {
            what: what.into(),
            reason: reason.to_string(),
        }
    }
}

/// A relay's part in the network.
pub struct Network {
    session: zenoh::Session,
    arrivals: Arc<OwnedFd>,
}

/// What arrives under a key expression.
pub struct Inbox {
    subscriber: zenoh::pubsub::Subscriber<RingChannelHandler<Arrival>>,
}

/// A way out, for samples of one topic.
pub struct Outbox {
    publisher: zenoh::pubsub::Publisher<'static>,
}

/// A sample, and when it came.
type Arrival = (MonotonicNs, Sample);

/// A message that has come.
pub struct Incoming<'a> {
    /// Where it was sent to.
    pub key: &'a str,
    /// When it came.
    pub at: MonotonicNs,
    /// Its bytes.
    pub payload: &'a [u8],
    /// What was attached; empty when nothing was.
    pub attachment: &'a [u8],
}

impl Network {
    /// Takes part in the network. Connections are made, and made again, in the background.
    ///
    /// # Errors
    ///
    /// When the configuration's endpoints or certificates cannot be used, or an address is taken.
    pub fn open(config: &Config, side: Side) -> Result<Network, NetworkError> {
        let zenoh_config = zenoh_config(config, side).map_err(|error| {
            NetworkError::new("the configuration of the network is refused", error)
        })?;
        // Zenoh's threads inherit it.
        request_short_slice(SchedulingRole::Provider);
        let session = zenoh::open(zenoh_config).wait().map_err(|error| {
            NetworkError::new(
                "the network cannot be opened; is an address taken or a certificate missing?",
                error,
            )
        })?;
        let arrivals = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)
            .map_err(|error| NetworkError::new("no event descriptor", error))?;
        Ok(Network {
            session,
            arrivals: Arc::new(arrivals),
        })
    }

    /// Can be read when something has arrived.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.arrivals.as_fd()
    }

    /// To be called before the inboxes are drained.
    pub fn drained(&self) {
        let _ = rustix::io::read(&*self.arrivals, &mut [0; 8]);
    }

    /// Receives what is sent to `key`, of which the newest `capacity` messages wait.
    ///
    /// # Errors
    ///
    /// When Zenoh refuses the key expression.
    pub fn receive(&self, key: &str, capacity: usize) -> Result<Inbox, NetworkError> {
        let (ring, handler) = RingChannel::new(capacity).into_handler();
        let arrivals = Arc::clone(&self.arrivals);
        let callback: Callback<Sample> = Callback::from(move |sample| {
            Callback::<Arrival>::call(&ring, (MonotonicNs::now(), sample));
            // It fails when it has been written 2⁶⁴ − 2 times, and can be read then.
            let _ = rustix::io::write(&*arrivals, &1_u64.to_ne_bytes());
        });
        let subscriber = self
            .session
            .declare_subscriber(key.to_owned())
            .with((callback, handler))
            .wait()
            .map_err(|error| {
                NetworkError::new(format!("nothing can be received at {key}"), error)
            })?;
        Ok(Inbox { subscriber })
    }

    /// A way out for the samples of a topic.
    ///
    /// # Errors
    ///
    /// When Zenoh refuses the key expression.
    pub fn outbox(&self, key: &str, priority: Priority) -> Result<Outbox, NetworkError> {
        let publisher = self
            .session
            .declare_publisher(key.to_owned())
            .congestion_control(CongestionControl::Drop)
            .reliability(Reliability::BestEffort)
            .priority(zenoh_priority(priority))
            .express(true)
            .wait()
            .map_err(|error| NetworkError::new(format!("nothing can be sent to {key}"), error))?;
        Ok(Outbox { publisher })
    }

    /// Sends a message. It may be lost.
    pub fn send(&self, key: &str, message: Vec<u8>) {
        let sent = self
            .session
            .put(key, message)
            .congestion_control(CongestionControl::Drop)
            .priority(ZenohPriority::InteractiveHigh)
            .express(true)
            .wait();
        if let Err(error) = sent {
            tracing::debug!(key, %error, "a message was not sent");
        }
    }
}

impl Inbox {
    /// Hands on every message that is there, in the order of arrival.
    pub fn drain(&self, mut take: impl FnMut(&Incoming<'_>)) {
        while let Ok(Some((at, sample))) = self.subscriber.handler().try_recv() {
            let payload = sample.payload().to_bytes();
            let attachment = sample.attachment().map(|bytes| bytes.to_bytes());
            take(&Incoming {
                key: sample.key_expr().as_str(),
                at,
                payload: &payload,
                attachment: attachment.as_deref().unwrap_or_default(),
            });
        }
    }
}

impl Outbox {
    /// Sends a sample. It may be lost.
    pub fn send(&self, payload: Vec<u8>, attachment: Vec<u8>) {
        let sent = self.publisher.put(payload).attachment(attachment).wait();
        if let Err(error) = sent {
            tracing::debug!(%error, "a sample was not sent");
        }
    }
}

fn zenoh_priority(priority: Priority) -> ZenohPriority {
    match priority {
        Priority::RealTime => ZenohPriority::RealTime,
        Priority::High => ZenohPriority::DataHigh,
        Priority::Data => ZenohPriority::Data,
        Priority::Low => ZenohPriority::DataLow,
        Priority::Background => ZenohPriority::Background,
    }
}

/// What Zenoh is told; nothing that strangers on the network could use is on unless it was asked for.
fn zenoh_config(config: &Config, side: Side) -> zenoh::Result<zenoh::Config> {
    let network = &config.network;
    let (listen, connect) = match side {
        Side::Robot => (&config.robot.listen, &config.robot.connect),
        Side::Station => (&config.station.listen, &config.station.connect),
        Side::Router => (&config.router.listen, &config.router.connect),
    };
    let mode = match (side, network.through) {
        (Side::Router, _) => "router",
        (Side::Robot | Side::Station, Through::Peers) => "peer",
        (Side::Robot | Side::Station, Through::Router) => "client",
    };
    let queue_batches = match side {
        Side::Robot | Side::Station => QUEUE_BATCHES,
        Side::Router => ROUTER_QUEUE_BATCHES,
    };
    let is_secured = config.security.authority.is_some();
    let mut settings = vec![
        ("mode", json!(mode)),
        ("listen/endpoints", json!(with_options(listen))),
        ("connect/endpoints", json!(with_options(connect))),
        ("connect/timeout_ms", json!(-1)),
        ("connect/exit_on_failure", json!(false)),
        (
            "connect/retry",
            json!({
                "period_init_ms": network.retry_ms,
                "period_max_ms": network.retry_ms,
                "period_increase_factor": 1,
            }),
        ),
        ("scouting/multicast/enabled", json!(network.discovery)),
        (
            "scouting/multicast/address",
            json!(network.multicast.to_string()),
        ),
        ("scouting/gossip/enabled", json!(network.discovery)),
        ("adminspace/enabled", json!(false)),
        (
            "transport/unicast/open_timeout",
            json!(network.open_timeout_ms),
        ),
        (
            "transport/unicast/accept_timeout",
            json!(network.open_timeout_ms),
        ),
        ("transport/link/tx/lease", json!(network.lease_ms)),
        ("transport/link/tx/threads", json!(1)),
        ("transport/link/tx/queue/size/data", json!(queue_batches)),
        (
            "transport/link/rx/max_message_size",
            json!(MAX_MESSAGE_BYTES),
        ),
        (
            "transport/link/tcp/so_sndbuf",
            json!(network.send_buffer_bytes),
        ),
        (
            "transport/link/tls/so_sndbuf",
            json!(network.send_buffer_bytes),
        ),
    ];
    if is_secured {
        settings.extend(tls(config));
    }
    let mut zenoh_config = zenoh::Config::default();
    for (key, value) in settings {
        zenoh_config.insert_json5(key, &value.to_string())?;
    }
    Ok(zenoh_config)
}

/// Both sides show a certificate.
fn tls(config: &Config) -> Vec<(&'static str, Value)> {
    let Ok(Some(files)) = config.security.certificates() else {
        return Vec::new();
    };
    vec![
        (
            "transport/link/tls/root_ca_certificate",
            json!(files.authority),
        ),
        (
            "transport/link/tls/listen_certificate",
            json!(files.certificate),
        ),
        ("transport/link/tls/listen_private_key", json!(files.key)),
        (
            "transport/link/tls/connect_certificate",
            json!(files.certificate),
        ),
        ("transport/link/tls/connect_private_key", json!(files.key)),
        ("transport/link/tls/enable_mtls", json!(true)),
        ("transport/link/tls/close_link_on_expiration", json!(true)),
    ]
}

/// QUIC carries samples as datagrams beside its stream, so that a lost one holds up none that follows.
fn with_options(endpoints: &[String]) -> Vec<String> {
    endpoints
        .iter()
        .map(
            |endpoint| match endpoint.starts_with("quic/") && !endpoint.contains('?') {
                true => format!("{endpoint}?mixed_rel=1"),
                false => endpoint.clone(),
            },
        )
        .collect()
}
