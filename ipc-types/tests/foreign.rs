//! What others may have put into the domain: services with another layout or other settings, live foreign nodes.
//!
//! The only tests that speak to iceoryx2 themselves, in the place of a foreign program.

mod support;

use std::sync::mpsc;
use std::thread;

use iceoryx2::prelude::*;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as Topic;
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{DspTelemetry, ModuleControl, RequestReport, SharedStruct};
use ipc_types::{
    Domain, DomainError, Ipc, OpenError, Removal, ReportError, RobotId, ServiceId, fresh_request_id,
};

use support::{WATCHDOG, in_domain, join, until};

/// A later or earlier version of the sample, of the same size and alignment.
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("hero.DspTelemetry.v0")]
#[repr(C)]
struct OtherTelemetry {
    words: [u64; size_of::<DspTelemetry>() / 8],
}

fn foreign_node(domain: &Domain) -> Node<ipc::Service> {
    let mut config = Config::default();
    config.global.prefix = FileName::new(domain.prefix().as_bytes()).unwrap();
    let root = domain.root().to_str().unwrap();
    config
        .global
        .set_root_path(&Path::new(root.as_bytes()).unwrap());
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create()
        .unwrap()
}

fn create<T: std::fmt::Debug + ZeroCopySend>(
    node: &Node<ipc::Service>,
    attributes: &[(&str, &str)],
) -> Topic<ipc::Service, T, ()> {
    let name = ServiceId::DspTelemetry.name(RobotId::DEFAULT);
    let mut specifier = AttributeSpecifier::new();
    for (key, value) in attributes {
        let key = AttributeKey::try_from(*key).unwrap();
        let value = AttributeValue::try_from(*value).unwrap();
        specifier = specifier.define(&key, &value).unwrap();
    }
    node.service_builder(&name.as_str().try_into().unwrap())
        .publish_subscribe::<T>()
        .create_with_attributes(&specifier)
        .unwrap()
}

fn refusal(ipc: &Ipc) -> OpenError {
    match ipc.subscriber::<DspTelemetry>() {
        Ok(_) => panic!("not refused"),
        Err(error) => error,
    }
}

#[test]
fn another_version_is_refused_and_both_are_named() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let node = foreign_node(domain);
        let _service = create::<OtherTelemetry>(&node, &[("layout_hash", "0123456789abcdef")]);
        let error = refusal(&ipc);
        assert!(matches!(error, OpenError::LayoutMismatch { .. }), "{error}");
        let text = error.to_string();
        let wanted = format!(
            "was built for `{} {:016x}`",
            DspTelemetry::TYPE_NAME,
            ServiceId::DspTelemetry.spec().layout_hash
        );
        for part in [
            "hero/1/dsp_telemetry",
            "carries `hero.DspTelemetry.v0 0123456789abcdef`",
            &wanted,
        ] {
            assert!(text.contains(part), "{part} not in: {text}");
        }
    });
}

#[test]
fn fields_that_changed_places_under_the_same_name_are_refused() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let node = foreign_node(domain);
        let attributes = [
            ("slot", "3000"),
            ("layout", DspTelemetry::TYPE_NAME),
            ("layout_hash", "0123456789abcdef"),
        ];
        let _service = create::<DspTelemetry>(&node, &attributes);
        let error = refusal(&ipc).to_string();
        assert!(error.contains("0123456789abcdef"), "{error}");
    });
}

#[test]
fn a_service_with_other_settings_is_refused_with_what_to_do() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let node = foreign_node(domain);
        let hash = format!("{:016x}", ServiceId::DspTelemetry.spec().layout_hash);
        let attributes = [
            ("slot", "3000"),
            ("layout", DspTelemetry::TYPE_NAME),
            ("layout_hash", hash.as_str()),
        ];
        // iceoryx2's defaults: a buffer of two samples, no history.
        let _service = create::<DspTelemetry>(&node, &attributes);
        let error = refusal(&ipc);
        assert!(matches!(error, OpenError::OtherSettings { .. }), "{error}");
        assert!(
            error
                .to_string()
                .contains("must open services, not create them")
        );
    });
}

#[test]
fn a_foreign_consumer_opens_what_the_publisher_made() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let node = foreign_node(domain);
        let name = ServiceId::DspTelemetry.name(RobotId::DEFAULT);
        let service = node
            .service_builder(&name.as_str().try_into().unwrap())
            .publish_subscribe::<DspTelemetry>()
            .open()
            .unwrap();
        let slot = AttributeKey::try_from("slot").unwrap();
        let slot = service
            .attributes()
            .key_value(&slot, 0)
            .unwrap()
            .to_string();
        assert_eq!(slot, "3000");
        let subscriber = service.subscriber_builder().create().unwrap();
        publisher.publish(|sample| sample.rotor_rpm = 1234).unwrap();
        assert_eq!(subscriber.receive().unwrap().unwrap().rotor_rpm, 1234);
    });
}

#[test]
fn a_live_foreign_node_keeps_the_domain() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let node = foreign_node(domain);
        drop(ipc);
        assert!(!domain.residue().is_empty());
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::InUse);
        drop(node);
        assert!(matches!(
            domain.remove_if_dead().unwrap(),
            Removal::Removed(_)
        ));
    });
}

#[test]
fn nobody_else_may_read_or_write_the_domain_s_segments() {
    use std::os::unix::fs::PermissionsExt;
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let _publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let segments: Vec<_> = domain
            .residue()
            .into_iter()
            .filter(|path| !path.starts_with(domain.root()))
            .collect();
        assert!(segments.len() > 1, "{segments:?}");
        for path in segments {
            let mode = path.metadata().unwrap().permissions().mode() & 0o777;
            assert_eq!(mode & 0o077, 0, "{}: {mode:03o}", path.display());
        }
        let mode = domain.root().metadata().unwrap().permissions().mode() & 0o777;
        assert_eq!(mode, 0o700);
    });
}

/// Marks the last sample.
const LAST: u32 = 1;

/// It rings no bell: a consumer that sleeps goes over to events, for which it had no listener before.
#[test]
fn a_publisher_of_another_language_is_heard_by_its_events() {
    in_domain(|domain| {
        let ipc = join(domain, "consumer");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let (heard, is_heard) = mpsc::channel();
        thread::scope(|scope| {
            scope.spawn(|| publish_until_listened_to(domain, is_heard));
            loop {
                heard.send(()).unwrap();
                assert!(subscriber.wait(WATCHDOG).unwrap().is_ready(0));
                if subscriber.latest().unwrap().unwrap().sonar_adc == LAST {
                    break;
                }
            }
        });
        assert_eq!(subscriber.losses().lost, 0);
    });
}

/// Publishes one sample for each that was heard, until somebody listens to the events of samples, and one more.
fn publish_until_listened_to(domain: &Domain, is_heard: mpsc::Receiver<()>) {
    let node = foreign_node(domain);
    let name = ServiceId::DspTelemetry.name(RobotId::DEFAULT);
    let builder = || node.service_builder(&name.as_str().try_into().unwrap());
    let samples = builder()
        .publish_subscribe::<DspTelemetry>()
        .open()
        .unwrap();
    let events = builder().event().open().unwrap();
    let publisher = samples.publisher_builder().create().unwrap();
    let notifier = events.notifier_builder().create().unwrap();
    let listeners = || events.dynamic_config().number_of_listeners();
    assert_eq!(listeners(), 0, "who sleeps on the bell costs nothing");
    let mut sequence = 0;
    let mut publish = |mark| {
        is_heard.recv_timeout(WATCHDOG).unwrap();
        sequence += 1;
        let mut sample = publisher.loan().unwrap();
        sample.payload_mut().sequence = sequence;
        sample.payload_mut().sonar_adc = mark;
        sample.send().unwrap();
        notifier.notify().unwrap();
    };
    until("somebody listens", || {
        publish(0);
        listeners() == 1
    });
    publish(LAST);
}

#[test]
fn a_process_has_one_domain_that_is_not_isolated() {
    let domains = [1, 2].map(|n| {
        let isolated = Domain::isolated();
        let prefix = format!("{}x{n}_", isolated.prefix().trim_end_matches('_'));
        Domain::new(&prefix, isolated.root()).unwrap()
    });
    domains[0].enter().unwrap();
    domains[0].enter().unwrap();
    let error = domains[1].enter().unwrap_err();
    assert!(matches!(error, DomainError::AnotherDomainEntered { .. }));
    for domain in &domains {
        assert!(error.to_string().contains(domain.prefix()), "{error}");
        assert!(domain.residue().is_empty());
    }
    let joined = Ipc::join(&domains[1], RobotId::DEFAULT, "test");
    assert!(joined.is_err());
    drop(joined);
    assert!(domains[1].residue().is_empty());
}

/// iceoryx2 addresses a report by the place of the client and by a number that every client counts from 0. So the request of a
/// client that is gone looks like the first one of the next client in its place.
#[test]
fn a_client_in_the_place_of_another_gets_nothing_of_its_and_loses_nothing() {
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let node = foreign_node(domain);
        let name = ServiceId::ModuleControl.name(RobotId::DEFAULT);
        let service = node
            .service_builder(&name.as_str().try_into().unwrap())
            .request_response::<ModuleControl, RequestReport>()
            .open()
            .unwrap();
        let request = || ModuleControl::new(fresh_request_id(), ControlCommand::Start);
        let report = |stage| RequestReport::new(stage, Reason::None);

        let first = service.client_builder().create().unwrap();
        let pending = first.send_copy(request()).unwrap();
        let mut tickets = Vec::new();
        server.drain(|ticket, _| tickets.push(ticket)).unwrap();
        drop((pending, first));
        let second = service.client_builder().create().unwrap();
        let pending = second.send_copy(request()).unwrap();
        server.drain(|ticket, _| tickets.push(ticket)).unwrap();
        let [gone, there] = tickets[..] else {
            panic!("{tickets:?}");
        };

        let told = server.report(gone, &report(Stage::Done));
        assert_eq!(told, Err(ReportError::Vanished));
        assert!(pending.receive().unwrap().is_none(), "the other's report");
        assert!(pending.is_connected(), "closed by the end of the other's");
        server.vanished(|_, _| panic!("told of before"));
        server.report(there, &report(Stage::Accepted)).unwrap();
        server.report(there, &report(Stage::Done)).unwrap();
        for stage in [Stage::Accepted, Stage::Done] {
            let report = pending.receive().unwrap().expect("a report");
            assert_eq!(report.stage, stage.code());
        }
        assert!(!pending.is_connected());
        // With that, the request of the first can be given back as well.
        let third = service.client_builder().create().unwrap();
        let _pending = third.send_copy(request()).unwrap();
        assert_eq!(server.drain(|_, _| {}).unwrap(), 1);
        assert!(!server.is_worn());
    });
}
