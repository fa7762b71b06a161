//! Programs that use iceoryx2 by themselves, as docs/ipc.md says: consumers of ours, and providers with another layout.
//!
//! The only tests that speak to iceoryx2 themselves, in the place of a foreign program.

use std::fs::{self, File};
use std::os::unix::fs::PermissionsExt;

use iceoryx2::prelude::*;
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as Topic;
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleControl, RequestReport, SharedStruct};
use ipc_types::{
    Domain, Ipc, OpenError, Removal, ReportError, RobotId, ServiceId, Source, Waiter,
    fresh_request_id,
};
use rustix::fs::{FlockOperation, flock};

use crate::support::{WATCHDOG, in_domain, join, until};

/// A later or earlier version of the sample, of the same size and alignment.
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("hero.DspTelemetry.v0")]
#[repr(C)]
struct OtherTelemetry {
    words: [u64; size_of::<DspTelemetry>() / 8],
}

/// A foreign program's part in a generation. The locks go last.
struct Foreign {
    node: Node<ipc::Service>,
    _locks: [File; 2],
}

fn folder_of(domain: &Domain, service: ServiceId) -> std::path::PathBuf {
    domain.root().join("1").join(service.key())
}

fn locked(path: std::path::PathBuf) -> File {
    let file = File::open(path).unwrap();
    flock(&file, FlockOperation::NonBlockingLockShared).unwrap();
    file
}

/// Enters the current generation of a service.
fn enter(domain: &Domain, service: ServiceId) -> Foreign {
    let folder = folder_of(domain, service);
    let current = fs::read_to_string(folder.join("current")).unwrap();
    let mut words = current.trim_end().split(' ');
    let (name, prefix) = (words.next().unwrap(), words.next().unwrap());
    assert_eq!(words.next(), Some(service.key()));
    let locks = [
        locked(domain.root().join("1/doorbell")),
        locked(folder.join(name).join("lock")),
    ];
    let root = folder.join(name);
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix.as_bytes()).unwrap();
    config
        .global
        .set_root_path(&Path::new(root.to_str().unwrap().as_bytes()).unwrap());
    config.global.service.cleanup_dead_nodes_on_open = false;
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create()
        .unwrap();
    Foreign {
        node,
        _locks: locks,
    }
}

/// Stands in for a provider of `dsp_telemetry` of another version: a generation with nothing in it yet.
fn provide(domain: &Domain) -> Foreign {
    let folder = folder_of(domain, ServiceId::DspTelemetry);
    fs::create_dir_all(folder.join("abcdef")).unwrap();
    fs::write(folder.join("abcdef/lock"), "").unwrap();
    let prefix = format!("{}abcdef_", domain.tag());
    fs::write(
        folder.join("current"),
        format!("abcdef {prefix} dsp_telemetry\n"),
    )
    .unwrap();
    enter(domain, ServiceId::DspTelemetry)
}

/// Opens the published `dsp_telemetry`.
fn open(node: &Node<ipc::Service>) -> Topic<ipc::Service, DspTelemetry, ()> {
    let name = ServiceId::DspTelemetry.name(RobotId::DEFAULT);
    node.service_builder(&name.as_str().try_into().unwrap())
        .publish_subscribe::<DspTelemetry>()
        .open()
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
        let foreign = provide(domain);
        let _service =
            create::<OtherTelemetry>(&foreign.node, &[("layout_hash", "0123456789abcdef")]);
        let error = refusal(&ipc);
        assert!(matches!(error, OpenError::LayoutMismatch { .. }), "{error}");
        let text = error.to_string();
        let wanted = format!(
            "was built for `{} {:016x}`",
            DspTelemetry::TYPE_NAME,
            ServiceId::DspTelemetry.contract().layout_hash()
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
        let foreign = provide(domain);
        let attributes = [
            ("slot", "3000"),
            ("layout", DspTelemetry::TYPE_NAME),
            ("layout_hash", "0123456789abcdef"),
        ];
        let _service = create::<DspTelemetry>(&foreign.node, &attributes);
        let error = refusal(&ipc).to_string();
        assert!(error.contains("0123456789abcdef"), "{error}");
    });
}

#[test]
fn a_foreign_consumer_opens_what_the_publisher_made() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let foreign = enter(domain, ServiceId::DspTelemetry);
        let service = open(&foreign.node);
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

/// It neither rings nor notifies, and the process that publishes never sleeps, because it has other things to do.
#[test]
fn a_foreign_consumer_that_announces_nothing_gets_the_latest_sample_of_a_busy_process() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        publisher.publish(|sample| sample.rotor_rpm = 1234).unwrap();
        let mut other = ipc.publisher::<HeroTelemetry>().unwrap();
        let mut woken_by = ipc.subscriber::<HeroTelemetry>().unwrap();
        let waiter = Waiter::new();
        let mut wait = || {
            other.publish(|_| {}).unwrap();
            let sources: &mut [((), &mut dyn Source)] =
                &mut [((), &mut publisher), ((), &mut woken_by)];
            assert!(waiter.wait(sources, Some(WATCHDOG)).unwrap().is_ready());
            assert!(woken_by.drain(|_| {}).unwrap() > 0);
            publisher.has_subscribers()
        };
        assert!(!wait());
        let foreign = enter(domain, ServiceId::DspTelemetry);
        let subscriber = open(&foreign.node).subscriber_builder().create().unwrap();
        until("the latest sample is there", wait);
        assert_eq!(subscriber.receive().unwrap().unwrap().rotor_rpm, 1234);
    });
}

/// It would deafen every consumer with a start time of its own.
#[test]
fn a_second_publisher_finds_no_place() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let foreign = enter(domain, ServiceId::DspTelemetry);
        let service = open(&foreign.node);
        assert!(service.publisher_builder().create().is_err());
        publisher.publish(|_| {}).unwrap();
        assert_eq!(subscriber.drain(|_| {}).unwrap(), 1);
    });
}

#[test]
fn a_live_foreign_program_keeps_the_robot_s_folder() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let foreign = enter(domain, ServiceId::DspTelemetry);
        drop((publisher, ipc));
        assert!(!domain.residue().is_empty());
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::InUse);
        drop(foreign);
        assert!(matches!(
            domain.remove_if_dead().unwrap(),
            Removal::Removed(_)
        ));
    });
}

#[test]
fn no_other_user_may_read_or_write_the_domain_s_segments() {
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

/// iceoryx2 addresses a report by the place of the client and by a number that every client counts from 0. So the
/// request of a client that is gone looks like the first one of the next client in its place.
#[test]
fn a_client_in_the_place_of_another_gets_nothing_of_its_and_loses_nothing() {
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let foreign = enter(domain, ServiceId::ModuleControl);
        let name = ServiceId::ModuleControl.name(RobotId::DEFAULT);
        let service = foreign
            .node
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
        assert_eq!(server.generations(), 1);
    });
}
