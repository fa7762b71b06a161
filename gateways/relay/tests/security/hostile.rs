//! Strangers: sessions of Zenoh that know our messages, and mean no good.

use std::path::Path;
use std::sync::{Arc, Mutex};

use fastrand::Rng;
use ipc_types::MonotonicNs;
use ipc_types::payload::{MovementData, SharedStruct};
use relay::message::{Ask, MAX_BYTES, Ping, Reply, decode, encode};
use relay::orders::message::Order;
use serde_json::{Value, json};
use zenoh::Wait;
use zenoh::qos::CongestionControl;

/// Messages that are kept at most.
const MAX_HEARD: usize = 10_000;

/// Key and bytes of a message.
pub type Message = (String, Vec<u8>);

/// A session in which there is no rule.
pub struct Stranger {
    session: zenoh::Session,
}

/// What a stranger hears under a key expression: keys and messages.
pub struct Heard {
    messages: Arc<Mutex<Vec<Message>>>,
    _subscriber: zenoh::pubsub::Subscriber<()>,
}

impl Heard {
    /// The session of a station, if one was heard: without certificates all that a robot says can be.
    pub fn session(&self) -> Option<u64> {
        let heard = self.drain();
        heard.iter().find_map(|(_, message)| match decode(message) {
            Ok(Reply::Pong(pong)) if pong.session != 0 => Some(pong.session),
            _ => None,
        })
    }

    /// What has been heard since the last time.
    pub fn drain(&self) -> Vec<Message> {
        std::mem::take(&mut self.messages.lock().expect("no panic"))
    }
}

impl Stranger {
    /// Without a certificate.
    pub fn plain(endpoint: &str) -> Stranger {
        Stranger::open(endpoint, &[])
    }

    /// With the certificate `name` of the folder `pki`. It takes any robot for the right one.
    pub fn certified(endpoint: &str, folder: &Path, pki: &str, name: &str) -> Stranger {
        Stranger::open(endpoint, &certificate(folder, pki, name))
    }

    /// A stranger with the certificate `name` that tries to connect fifty times a second for as long as it is refused.
    pub fn persistent(endpoint: &str, folder: &Path, name: &str) -> Stranger {
        let mut settings = certificate(folder, "pki", name);
        let retry =
            json!({ "period_init_ms": 20, "period_max_ms": 20, "period_increase_factor": 1.0 });
        settings.extend([("connect/timeout_ms", json!(-1)), ("connect/retry", retry)]);
        Stranger::open(endpoint, &settings)
    }

    /// One who knows the authority, and shows no certificate.
    pub fn half_certified(endpoint: &str, folder: &Path) -> Stranger {
        Stranger::open(endpoint, &[authority(folder)])
    }

    fn open(endpoint: &str, settings: &[(&str, Value)]) -> Stranger {
        let usual = [
            ("mode", json!("peer")),
            ("connect/endpoints", json!([endpoint])),
            ("connect/timeout_ms", json!(2000)),
            ("connect/exit_on_failure", json!(false)),
            ("scouting/multicast/enabled", json!(false)),
            ("scouting/gossip/enabled", json!(false)),
        ];
        let mut config = zenoh::Config::default();
        for (key, value) in usual.iter().chain(settings) {
            config
                .insert_json5(key, &value.to_string())
                .expect("a key of Zenoh");
        }
        let session = zenoh::open(config).wait().expect("a session");
        Stranger { session }
    }

    /// Hears what there is.
    pub fn listen(&self, key: &str) -> Heard {
        let messages = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&messages);
        let subscriber = self
            .session
            .declare_subscriber(key.to_owned())
            .allowed_origin(zenoh::sample::Locality::Remote)
            .callback(move |sample| {
                let mut heard = heard.lock().expect("no panic");
                if heard.len() < MAX_HEARD {
                    let key = sample.key_expr().as_str().to_owned();
                    heard.push((key, sample.payload().to_bytes().into_owned()));
                }
            })
            .wait()
            .expect("a subscription");
        Heard {
            messages,
            _subscriber: subscriber,
        }
    }

    /// Sends it, and waits for room.
    pub fn put(&self, key: &str, message: &[u8]) {
        let put = self.session.put(key, message.to_vec());
        put.congestion_control(CongestionControl::Block)
            .wait()
            .expect("a session");
    }

    /// Orders a movement under this name.
    pub fn order(&self, name: &str) {
        for session in 0..3 {
            let order = Order {
                session,
                number: 1,
                floor: 1,
                service: movement(),
                expires: MonotonicNs(u64::MAX),
                is_repeat: false,
                is_given_up: false,
                request: MovementData::take_off(4711, 99.0).bytes().to_vec(),
            };
            self.put(&format!("hero/1/order/{name}"), &encode(&order));
        }
    }
}

/// The setting of the authority that a stranger trusts.
fn authority(folder: &Path) -> (&'static str, Value) {
    let key = "transport/link/tls/root_ca_certificate";
    (key, json!(folder.join("pki/ca.pem")))
}

/// The settings of the certificate `name` of the folder `pki`.
fn certificate(folder: &Path, pki: &str, name: &str) -> Vec<(&'static str, Value)> {
    let file = |name: String| json!(folder.join(pki).join(name));
    vec![
        authority(folder),
        (
            "transport/link/tls/connect_certificate",
            file(format!("{name}.pem")),
        ),
        (
            "transport/link/tls/connect_private_key",
            file(format!("{name}-key.pem")),
        ),
        ("transport/link/tls/enable_mtls", json!(true)),
    ]
}

/// What movements are called in orders.
fn movement() -> u64 {
    let schema = ipc_types::Schema::of::<MovementData>();
    relay::names::service_id("movement", &schema)
}

/// Messages without end.
pub struct Flood {
    stranger: Stranger,
    next: Box<dyn FnMut(u64) -> (String, Vec<u8>) + Send>,
    sent: u64,
}

impl Flood {
    fn new(
        stranger: Stranger,
        next: impl FnMut(u64) -> (String, Vec<u8>) + Send + 'static,
    ) -> Flood {
        Flood {
            stranger,
            next: Box::new(next),
            sent: 0,
        }
    }

    /// Bytes that are no messages, under all keys that a relay listens to.
    pub fn garbage(stranger: Stranger) -> Flood {
        let keys = [
            "ask/gcs2",
            "order/gcs2",
            "order/gcs",
            "tell/gcs",
            "topic/movement",
        ];
        Flood::new(stranger, move |count| {
            let mut bytes = vec![0; (count % 200) as usize];
            Rng::with_seed(count).fill(&mut bytes);
            (key(keys[count as usize % keys.len()]), bytes)
        })
    }

    /// Messages that are longer than any.
    pub fn long(stranger: Stranger) -> Flood {
        let keys = ["ask/gcs", "order/gcs", "tell/gcs", "topic/hero_telemetry"];
        let long = vec![1; MAX_BYTES * 3];
        Flood::new(stranger, move |count| {
            let most = if count % 2 == 0 {
                long.len()
            } else {
                MAX_BYTES
            };
            (
                key(keys[count as usize % keys.len()]),
                long[..most].to_vec(),
            )
        })
    }

    /// Stations that nobody knows, each with a new name, that want all there is.
    pub fn names(stranger: Stranger) -> Flood {
        Flood::new(stranger, |count| {
            (key(&format!("ask/x{count}")), ping(count))
        })
    }

    /// New instances of a station, that want all there is.
    pub fn instances(stranger: Stranger, name: &'static str) -> Flood {
        Flood::new(stranger, move |count| {
            (
                key(&format!("ask/{name}")),
                ping(Rng::with_seed(count).u64(..)),
            )
        })
    }

    /// Names that are patterns.
    pub fn patterns(stranger: Stranger) -> Flood {
        let keys = [
            "hero/1/ask/*",
            "hero/*/ask/gcs",
            "hero/1/**",
            "hero/1/ask/**",
            "hero/1/order/*",
        ];
        Flood::new(stranger, move |count| {
            (keys[count as usize % keys.len()].to_owned(), ping(count))
        })
    }

    /// Samples of topics that do not exist.
    pub fn topics(stranger: Stranger) -> Flood {
        Flood::new(stranger, |count| {
            (key(&format!("topic/x/y{count}")), vec![0; 300])
        })
    }

    /// The first order of the station, whose session was heard: as it was, of a former floor, and under numbers to
    /// come.
    pub fn replay(stranger: Stranger, session: u64) -> Flood {
        let order = |number| Order {
            session,
            number,
            floor: 1,
            service: movement(),
            expires: MonotonicNs(u64::MAX),
            is_repeat: false,
            is_given_up: false,
            request: MovementData::take_off(1, 10.0).bytes().to_vec(),
        };
        let orders = [1, 0, u64::MAX].map(|number| encode(&order(number)));
        Flood::new(stranger, move |count| {
            (
                key("order/gcs"),
                orders[count as usize % orders.len()].clone(),
            )
        })
    }

    /// Sends the next one.
    pub fn send(&mut self) {
        let (key, message) = (self.next)(self.sent);
        self.sent += 1;
        self.stranger.put(&key, &message);
    }
}

fn key(rest: &str) -> String {
    format!("hero/1/{rest}")
}

fn ping(station_instance: u64) -> Vec<u8> {
    encode(&Ask::Ping(Ping {
        station_instance,
        sent_ns: MonotonicNs::now().0,
        suspended_ns: 0,
        wants_latest: true,
        has_all: true,
        late_ms: None,
    }))
}
