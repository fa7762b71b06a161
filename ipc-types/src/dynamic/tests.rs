use std::time::Duration;

use iceoryx2::prelude::AttributeVerifier;
use iceoryx2::service::attribute::AttributeValue;

use super::*;
use crate::payload::{HeroTelemetry, ModuleState, SharedStruct};
use crate::service::{Contract, Topic};
use crate::{Domain, RobotId};

/// Far longer than a sample takes; only a test that hangs meets it.
const WATCHDOG: Duration = Duration::from_secs(20);

mod stranger {
    #![allow(unsafe_code)]

    crate::shared_struct! {
        /// Voltages of the flight battery.
        pub struct Voltages("battery_watch.Voltages.v1") = 64 {
            /// Counts the samples of this publisher from 1.
            pub sequence: u64,
            /// When the publisher began, host monotonic ns.
            pub epoch_ns: u64,
            /// Of the cells, from the negative pole, under load [V].
            pub cells: [f32; 12],
        }
    }

    crate::topic!(Voltages, "battery_watch/cell_voltages");
}

use stranger::Voltages;

fn joined() -> (Domain, Ipc) {
    let domain = Domain::isolated();
    let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
    (domain, ipc)
}

fn leaves_nothing(domain: &Domain, ipc: Ipc) {
    drop(ipc);
    assert!(domain.residue().is_empty());
}

/// A publisher of a struct that no port of this crate knows yet, made of iceoryx2 alone.
struct Raw<T: Topic> {
    port: iceoryx2::port::publisher::Publisher<Svc, T, ()>,
    samples: Notifier,
    _subscribers: Listener,
    _node: Node,
    sequence: u64,
    epoch_ns: u64,
}

impl<T: Topic> Raw<T> {
    fn new(ipc: &Ipc) -> Raw<T> {
        let contract = Contract::of_topic::<T>();
        let config = ipc.domain().config().unwrap();
        let node = NodeBuilder::new().config(&config).create::<Svc>().unwrap();
        let name = contract.name(ipc.robot());
        let service = |name: &str| node.service_builder(&ServiceName::new(name).unwrap());
        let hash = format!("{:016x}", contract.layout_hash());
        let attributes = AttributeVerifier::new()
            .require(
                &AttributeKey::try_from("layout_hash").unwrap(),
                &AttributeValue::try_from(hash.as_str()).unwrap(),
            )
            .unwrap();
        let topic = service(&name)
            .publish_subscribe::<T>()
            .subscriber_max_buffer_size(SUBSCRIBER_BUFFER)
            .history_size(1)
            .open_or_create_with_attributes(&attributes)
            .unwrap();
        let events = service(&name).event().open_or_create().unwrap();
        let subscribers = format!("{name}/subscribers");
        let subscribers = service(&subscribers).event().open_or_create().unwrap();
        Raw {
            port: topic.publisher_builder().create().unwrap(),
            samples: events.notifier_builder().create().unwrap(),
            _subscribers: subscribers.listener_builder().create().unwrap(),
            _node: node,
            sequence: 0,
            epoch_ns: MonotonicNs::now().0,
        }
    }

    fn publish(&mut self, mut payload: T) {
        self.sequence += 1;
        payload.stamp(self.sequence, self.epoch_ns);
        self.port.send_copy(payload).unwrap();
        self.samples.notify().unwrap();
    }
}

#[test]
fn a_struct_that_nobody_here_knows_is_read_by_its_schema() {
    let (domain, ipc) = joined();
    let mut publisher = Raw::<Voltages>::new(&ipc);
    // All that a tool has: the key and the text.
    let key = Voltages::KEY;
    schema::store(&schema_folder(&ipc), key, &schema::text(Voltages::LAYOUT)).unwrap();
    let schema = schema_of(&ipc, key).unwrap();
    let mut subscriber = DynamicSubscriber::open(&ipc, key, &schema).unwrap();
    let mut sent = Voltages::default();
    for index in 0..3 {
        sent.cells[11] = 3.5 + index as f32;
        publisher.publish(sent);
        assert!(subscriber.wait(WATCHDOG).unwrap().is_ready(0));
    }
    let cell = schema.number("cells[11]").unwrap();
    let mut seen = Vec::new();
    let read = |payload: &[u8]| seen.push(cell.value(payload).unwrap().as_f64());
    assert_eq!(subscriber.drain(read).unwrap(), 3);
    assert_eq!(seen, [3.5, 4.5, 5.5]);
    assert_eq!(subscriber.losses().received, 3);
    assert_eq!(subscriber.wait(Duration::ZERO).unwrap(), Wake::TimedOut);
    // Another publisher's first sample, and then a gap.
    drop(publisher);
    let mut publisher = Raw::<Voltages>::new(&ipc);
    publisher.sequence = 2;
    publisher.publish(sent);
    assert!(subscriber.wait(WATCHDOG).unwrap().is_ready(0));
    assert_eq!(subscriber.drain(|_| ()).unwrap(), 1);
    let losses = subscriber.losses();
    assert_eq!((losses.publisher_changes, losses.lost), (1, 2));
    std::fs::remove_dir_all(ipc.domain().root().join("topics")).unwrap();
    drop((subscriber, publisher));
    leaves_nothing(&domain, ipc);
}

#[test]
fn the_robots_own_topics_are_read_like_any_other() {
    let (domain, ipc) = joined();
    let mut publisher = ipc.publisher::<HeroTelemetry>().unwrap();
    publisher
        .publish(|sample| sample.geodetic.altitude_m = 1.0)
        .unwrap();
    let schema = schema_of(&ipc, "hero_telemetry").unwrap();
    assert_eq!(schema, Schema::of::<HeroTelemetry>());
    let mut subscriber = DynamicSubscriber::open(&ipc, "hero_telemetry", &schema).unwrap();
    // Who joins late gets the latest sample.
    publisher.welcome();
    publisher
        .publish(|sample| sample.geodetic.altitude_m = 2.0)
        .unwrap();
    assert!(subscriber.wait(WATCHDOG).unwrap().is_ready(0));
    let mut samples = Vec::new();
    let keep = |payload: &[u8]| samples.extend(HeroTelemetry::from_bytes(payload));
    assert_eq!(subscriber.drain(keep).unwrap(), 2);
    let seen: Vec<_> = samples
        .iter()
        .map(|s| (s.sequence, s.geodetic.altitude_m))
        .collect();
    assert_eq!(seen, [(1, 1.0), (2, 2.0)]);
    drop((subscriber, publisher));
    leaves_nothing(&domain, ipc);
}

#[test]
fn a_topic_is_opened_with_its_own_schema_alone() {
    let (domain, ipc) = joined();
    let state = Schema::of::<ModuleState>();
    let absent = DynamicSubscriber::open(&ipc, "module_state", &state)
        .err()
        .unwrap();
    assert!(matches!(absent, DynamicError::Absent(_)), "{absent}");
    let publisher = ipc.publisher::<ModuleState>().unwrap();
    let swapped =
        schema::text(ModuleState::LAYOUT).replacen("uint32 status\n", "uint32 was_status\n", 1);
    let swapped = Schema::parse(&swapped).unwrap();
    let hero = Schema::of::<HeroTelemetry>();
    for other in [&swapped, &hero] {
        let error = DynamicSubscriber::open(&ipc, "module_state", other)
            .err()
            .unwrap();
        assert!(matches!(error, DynamicError::OtherLayout { .. }), "{error}");
    }
    let no_sample =
        Schema::parse("# Layout: a.A.v1\n\nuint64 epoch_ns\nuint64 sequence\n").unwrap();
    let error = DynamicSubscriber::open(&ipc, "module_state", &no_sample)
        .err()
        .unwrap();
    assert!(matches!(error, DynamicError::NoTopic(_)), "{error}");
    assert!(DynamicSubscriber::open(&ipc, "module_state", &state).is_ok());
    assert!(matches!(
        schema_of(&ipc, "strange"),
        Err(LoadError::Missing(_))
    ));
    drop(publisher);
    leaves_nothing(&domain, ipc);
}

#[test]
fn topics_that_are_there_are_listed_and_nothing_else() {
    let (domain, ipc) = joined();
    assert_eq!(topics(&ipc).unwrap(), []);
    let publisher = ipc.publisher::<HeroTelemetry>().unwrap();
    let server = ipc.server::<crate::payload::MovementData>().unwrap();
    let stranger = Raw::<Voltages>::new(&ipc);
    let other = Ipc::join(&domain, RobotId::new(2).unwrap(), "test").unwrap();
    let of_other = other.publisher::<ModuleState>().unwrap();
    let facts = |contract: Contract| TopicFacts {
        key: contract.key.to_owned(),
        type_name: contract.payload.type_name.to_owned(),
        size: contract.payload.size,
        align: contract.payload.align,
        layout_hash: Some(contract.layout_hash()),
    };
    assert_eq!(
        topics(&ipc).unwrap(),
        [
            facts(Contract::of_topic::<Voltages>()),
            facts(Contract::of_topic::<HeroTelemetry>())
        ]
    );
    drop((publisher, server, stranger, of_other, other));
    leaves_nothing(&domain, ipc);
}
