//! [`Network`]: Zenoh, as far as a relay needs it. No other file names it.
//!
//! Zenoh has threads of its own. What they receive waits in rings that keep the newest, with the moment of its arrival, and
//! an event descriptor wakes the relay's one wait. Sending never blocks: what a link cannot take is dropped, and comes again where
//! it must.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;

use ipc_types::{MonotonicNs, SchedulingRole, request_short_slice};
use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd, poll};
use rustix::io::Errno;
use serde_json::{Value, json};
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::qos::{CongestionControl, Priority as ZenohPriority, Reliability};
use zenoh::sample::Sample;

pub use crate::access::Side;
use crate::access::access_control;
use crate::config::{Config, Priority, Through};
use crate::queue::Queue;
pub use crate::queue::Room;
use crate::ros2;

/// Longest message that is put together of fragments, bytes: the longest sample, and eight times the longest message of a relay.
pub const MAX_MESSAGE_BYTES: usize = 2 * 1024 * 1024;

/// Bytes that are sent together at most. While a link takes nothing, messages gather in batches of this size, and what is in them
/// grows old: Zenoh's own 64 KiB are five seconds of a link of 100 kbit/s.
const BATCH_BYTES: u16 = 4352;

/// Batches of samples that may wait to be sent, for each priority: a burst of one sample of each of some topics. What finds no room is
/// dropped. 2 · 4,352 bytes are 0.7 s of a link of 100 kbit/s.
const SAMPLE_BATCHES: usize = 2;

/// The same in a router, where samples of many robots go to one station: as many as Zenoh takes. With 20 robots at 50 samples a second
/// of two topics, 16 batches are full when the router's sender does not run for some tens of milliseconds.
const ROUTER_SAMPLE_BATCHES: usize = 16;

/// How long a sample that finds no room waits for it, µs, once in each congestion: a thread of Zenoh that does not run for a moment
/// on a busy machine is no slow link.
const WAIT_FOR_ROOM_US: u32 = 20_000;

/// The same in a router, whose receiving thread would wait: one station that is stalled must not hold up all robots.
const ROUTER_WAIT_FOR_ROOM_US: u32 = 1000;

/// Batches of other messages that may wait to be sent, the most that Zenoh takes: 16 · 4,352 = 69,632 bytes are room for the longest
/// message, the description of a service, which has at most 66,560.
const MESSAGE_BATCHES: usize = 16;

/// What Zenoh reads about its threads when the first one of them is started.
const RUNTIME_VARIABLE: &str = "ZENOH_RUNTIME";

/// One thread does what five to six do by default.
const ONE_THREAD: &str =
    "(app: (handover: net), acc: (handover: net), tx: (handover: net), rx: (handover: net))";

/// Lets one thread of Zenoh wait for the sockets, receive and send. By default one thread waits and wakes another one that receives,
/// which makes each message later by a wake-up and costs a third of the processor time of a relay; only a router has so much to do
/// that several threads help. To be called first of all: it changes nothing when the process has threads already, or when
/// `ZENOH_RUNTIME` is set.
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

/// The network does not work.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// Zenoh, or the operating system, refuses.
    #[error("{what}: {reason}")]
    Failed {
        /// What was wanted.
        what: String,
        /// What it says.
        reason: String,
    },
    /// The process was asked to end before a router was reached.
    #[error("it was ended before a router was reached")]
    Ended,
}

impl NetworkError {
    fn new(what: impl Into<String>, reason: impl std::fmt::Display) -> NetworkError {
        NetworkError::Failed {
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
    queues: Arc<Queues>,
    _subscriber: zenoh::pubsub::Subscriber<()>,
}

/// A way out, for samples of one topic.
pub struct Outbox {
    publisher: zenoh::pubsub::Publisher<'static>,
}

/// Declares ways out in another thread. The network stays open as long as there is one.
pub struct Declarer {
    session: zenoh::Session,
}

/// A liveliness token: others see it as long as this exists.
pub struct Token {
    _token: zenoh::liveliness::LivelinessToken,
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
    /// Takes part in the network. Connections are made, and made again, in the background; only a side that goes through a
    /// router waits here for the first one, or until `end` can be read.
    ///
    /// # Errors
    ///
    /// When the configuration's endpoints or certificates cannot be used, or an address is taken.
    pub fn open(config: &Config, side: Side, end: BorrowedFd<'_>) -> Result<Network, NetworkError> {
        let zenoh_config = zenoh_config(config, side).map_err(|error| {
            NetworkError::new("the configuration of the network is refused", error)
        })?;
        // Zenoh's threads inherit it.
        request_short_slice(SchedulingRole::Provider);
        let session = open_session(zenoh_config, end)?.map_err(|error| {
            NetworkError::new(
                "the network cannot be opened; is an address taken or a certificate missing?",
                error,
            )
        })?;
        let (listen, connect) = side.endpoints(config);
        tracing::info!(?listen, ?connect, "the network is open");
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

    /// Receives what is sent to `key`, of which the newest wait as there is room. What comes under a key of `own` has room of its own,
    /// which nothing that comes under other keys takes.
    ///
    /// # Errors
    ///
    /// When Zenoh refuses the key expression.
    pub fn receive(&self, key: &str, own: Vec<String>, room: Room) -> Result<Inbox, NetworkError> {
        let queues = Arc::new(Queues {
            own_keys: own,
            own: Queue::new(room),
            others: Queue::new(room),
        });
        let (arriving, arrivals) = (Arc::clone(&queues), Arc::clone(&self.arrivals));
        let callback = move |sample: Sample| {
            if arriving.push(sample) {
                // It fails when it has been written 2⁶⁴ − 2 times, and can be read then.
                let _ = rustix::io::write(&*arrivals, &1_u64.to_ne_bytes());
            }
        };
        let subscriber = self
            .session
            .declare_subscriber(key.to_owned())
            .callback(callback)
            .wait()
            .map_err(|error| {
                NetworkError::new(format!("nothing can be received at {key}"), error)
            })?;
        Ok(Inbox {
            queues,
            _subscriber: subscriber,
        })
    }

    /// A way out for the samples of a topic.
    ///
    /// # Errors
    ///
    /// When Zenoh refuses the key expression.
    pub fn outbox(&self, key: &str, priority: Priority) -> Result<Outbox, NetworkError> {
        outbox(&self.session, key, priority, Reliability::BestEffort)
    }

    /// The id of this relay in the network.
    pub fn id(&self) -> String {
        self.session.zid().to_string()
    }

    /// For another thread.
    pub fn declarer(&self) -> Declarer {
        Declarer {
            session: self.session.clone(),
        }
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

impl Declarer {
    /// A way out for samples for ROS 2. It may take as long as a peer that reads nothing is borne with.
    ///
    /// # Errors
    ///
    /// When Zenoh refuses the key expression.
    pub fn outbox(
        &self,
        key: &str,
        priority: Priority,
        reliability: ros2::Reliability,
    ) -> Result<Outbox, NetworkError> {
        let reliability = match reliability {
            ros2::Reliability::BestEffort => Reliability::BestEffort,
            ros2::Reliability::Reliable => Reliability::Reliable,
        };
        outbox(&self.session, key, priority, reliability)
    }

    /// Declares a liveliness token. It may take as long.
    ///
    /// # Errors
    ///
    /// When Zenoh refuses the key expression.
    pub fn token(&self, key: &str) -> Result<Token, NetworkError> {
        let token = self.session.liveliness().declare_token(key.to_owned());
        let token = token
            .wait()
            .map_err(|error| NetworkError::new(format!("{key} cannot be declared"), error))?;
        Ok(Token { _token: token })
    }
}

/// What has arrived: under keys that were named, and under others.
struct Queues {
    own_keys: Vec<String>,
    own: Queue<Arrival>,
    others: Queue<Arrival>,
}

impl Queues {
    fn push(&self, sample: Sample) -> bool {
        let bytes = sample.payload().len() + sample.attachment().map_or(0, ZBytes::len);
        let key = sample.key_expr().as_str();
        let queue = match self.own_keys.iter().any(|own| own == key) {
            true => &self.own,
            false => &self.others,
        };
        queue.push(bytes, (MonotonicNs::now(), sample))
    }
}

impl Inbox {
    /// Hands on every message that is there, those under named keys first, each kind in the order of arrival, and none that comes
    /// meanwhile.
    pub fn drain(&self, mut take: impl FnMut(&Incoming<'_>)) {
        for (at, sample) in self.queues.own.take().chain(self.queues.others.take()) {
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

fn outbox(
    session: &zenoh::Session,
    key: &str,
    priority: Priority,
    reliability: Reliability,
) -> Result<Outbox, NetworkError> {
    let publisher = session
        .declare_publisher(key.to_owned())
        .congestion_control(CongestionControl::Drop)
        .reliability(reliability)
        .priority(zenoh_priority(priority))
        .express(true)
        .wait()
        .map_err(|error| NetworkError::new(format!("nothing can be sent to {key}"), error))?;
    Ok(Outbox { publisher })
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

/// Opens a session in a thread of its own, because nothing can interrupt Zenoh while it looks for a router.
fn open_session(
    config: zenoh::Config,
    end: BorrowedFd<'_>,
) -> Result<zenoh::Result<zenoh::Session>, NetworkError> {
    let failed = |error| NetworkError::new("the network cannot be waited for", error);
    let opened = eventfd(0, EventfdFlags::CLOEXEC).map_err(failed)?;
    let opener = opened
        .try_clone()
        .map_err(|error| NetworkError::new("no descriptor", error))?;
    let thread = std::thread::spawn(move || {
        let session = zenoh::open(config).wait();
        let _ = rustix::io::write(&opener, &1_u64.to_ne_bytes());
        session
    });
    loop {
        let mut ready = [
            PollFd::new(&opened, PollFlags::IN),
            PollFd::new(&end, PollFlags::IN),
        ];
        match poll(&mut ready, None) {
            Err(Errno::INTR) => {}
            Err(error) => return Err(failed(error)),
            // The thread ends with the process.
            Ok(_) if ready[0].revents().is_empty() => return Err(NetworkError::Ended),
            Ok(_) => {
                let session = thread.join();
                return session
                    .map_err(|_| NetworkError::new("the network", "its thread has failed"));
            }
        }
    }
}

/// What Zenoh is told; nothing that strangers on the network could use is on unless it was asked for.
fn zenoh_config(config: &Config, side: Side) -> zenoh::Result<zenoh::Config> {
    let network = &config.network;
    let (listen, connect) = side.endpoints(config);
    let mode = match (side, network.through) {
        (Side::Router, _) => "router",
        (Side::Robot | Side::Station, Through::Peers) => "peer",
        (Side::Robot | Side::Station, Through::Router) => "client",
    };
    let (sample_batches, wait_us) = match side {
        Side::Robot | Side::Station => (SAMPLE_BATCHES, WAIT_FOR_ROOM_US),
        Side::Router => (ROUTER_SAMPLE_BATCHES, ROUTER_WAIT_FOR_ROOM_US),
    };
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
        ("transport/link/tx/batch_size", json!(BATCH_BYTES)),
        (
            "transport/link/tx/queue/congestion_control/drop/wait_before_drop",
            json!(wait_us),
        ),
        (
            "transport/link/tx/queue/size",
            json!({
                "control": 2,
                "interactive_high": MESSAGE_BATCHES,
                "interactive_low": sample_batches,
                "real_time": sample_batches,
                "data_high": sample_batches,
                "data": sample_batches,
                "data_low": sample_batches,
                "background": sample_batches,
            }),
        ),
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
    settings.extend(tls(config));
    if let Some(rules) = access_control(config, side) {
        settings.push(("access_control", rules));
    }
    let mut zenoh_config = zenoh::Config::default();
    for (key, value) in settings {
        zenoh_config.insert_json5(key, &value.to_string())?;
    }
    Ok(zenoh_config)
}

/// Both sides show a certificate, and the side that connects compares the name or address that it has connected to with the
/// certificate.
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
        ("transport/link/tls/verify_name_on_connect", json!(true)),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zenoh_takes_the_rules_and_the_certificates() {
        let text = "[security]\nauthority = \"ca.pem\"\ncertificate = \"x.pem\"\nkey = \"x-key.pem\"\n\
                    robots = { robot-1 = 1 }\nrouters = [\"hub\"]\n[commands]\nstations = [\"gcs\"]\n[ros2]\nenabled = true\n";
        let config: Config = runtime::config::parse(text, "relay.toml").unwrap();
        for side in [Side::Robot, Side::Station, Side::Router] {
            let zenoh = zenoh_config(&config, side).unwrap();
            let read = |key| zenoh.get_json(key).unwrap();
            assert_eq!(read("access_control/enabled"), "true");
            assert_eq!(read("transport/link/tls/enable_mtls"), "true");
            assert_eq!(read("transport/link/tls/verify_name_on_connect"), "true");
        }
    }
}
