use std::fs;
use std::time::Duration;

use super::*;
use crate::code::{ControlCommand, Reason, Stage};
use crate::files::while_no_port_opens;
use crate::module::{ControlOf, Module};
use crate::payload::{
    HeroTelemetry, ModuleControl, ModuleState, MovementData, RequestReport, SharedStruct,
};
use crate::service::{Request, Topic};
use crate::waiter::Wake;
use crate::{Client, Domain, Publisher, RobotId, Server, schema};

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

    crate::shared_struct! {
        /// Sets the voltage below which `battery_watch` warns, along a path.
        pub struct SetLimit("battery_watch.SetLimit.v1") = 24 {
            /// Chosen by the sender; every report repeats it.
            pub request_id: u64,
            /// Least voltage of a cell.
            pub least_v: f64,
            /// What it belongs to.
            pub path_id: u64,
        }
    }

    crate::request!(SetLimit, "battery_watch/limits");

    pub struct Watch;
    crate::module!(Watch, "battery_watch", 1001);
}

use stranger::{SetLimit, Voltages, Watch};

/// Runs a test as a process of this name, and checks that nothing is left.
fn as_process(name: &str, act: impl FnOnce(&Ipc)) {
    let domain = Domain::isolated();
    let ipc = Ipc::join(&domain, RobotId::DEFAULT, name).unwrap();
    act(&ipc);
    drop(ipc);
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

fn in_robot(act: impl FnOnce(&Ipc)) {
    as_process("test", act);
}

#[test]
fn a_struct_that_this_program_was_not_built_with_is_read_by_its_schema() {
    in_robot(|ipc| {
        let mut publisher: Publisher<Voltages> = ipc.publisher().unwrap();
        // All that a tool has is the key.
        let key = Voltages::KEY;
        let schema = schema_of(ipc, key).unwrap();
        assert_eq!(schema, Schema::of::<Voltages>());
        let mut subscriber = DynamicSubscriber::open(ipc, key, &schema).unwrap();
        for index in 0..3 {
            publisher
                .publish(|sample| sample.cells[11] = 3.5 + index as f32)
                .unwrap();
            assert!(subscriber.wait(WATCHDOG).unwrap().is_ready());
        }
        let cell = schema.number("cells[11]").unwrap();
        let mut seen = Vec::new();
        let read = |payload: &[u8]| seen.push(cell.value(payload).unwrap().as_f64());
        assert_eq!(subscriber.drain(read).unwrap(), 3);
        assert_eq!(seen, [3.5, 4.5, 5.5]);
        assert_eq!(subscriber.losses().received, 3);
        assert_eq!(subscriber.wait(Duration::ZERO).unwrap(), Wake::TimedOut);
        // The next publisher.
        drop(publisher);
        let mut publisher: Publisher<Voltages> = ipc.publisher().unwrap();
        assert_eq!(subscriber.drain(|_| ()).unwrap(), 0);
        publisher.publish(|_| {}).unwrap();
        assert!(subscriber.wait(WATCHDOG).unwrap().is_ready());
        assert_eq!(subscriber.drain(|_| ()).unwrap(), 1);
        let losses = subscriber.losses();
        assert_eq!((losses.publisher_restarts, losses.lost), (1, 0));
    });
}

/// What is left when a publisher is killed and its last subscriber leaves: `current` names a generation that is
/// deleted.
#[test]
fn a_generation_that_has_vanished_is_no_publisher() {
    for key in [HeroTelemetry::KEY, Voltages::KEY] {
        in_robot(|ipc| {
            let domain = ipc.domain();
            let folder = service_folder(domain, ipc.robot(), key);
            while_no_port_opens(|| fs::create_dir_all(&folder)).unwrap();
            generation::announce(domain, &folder, "abcdef", key).unwrap();
            assert_eq!(generation::current(&folder).unwrap(), None);
            match schema_of(ipc, key) {
                Ok(schema) => assert_eq!(schema, Schema::of::<HeroTelemetry>()),
                Err(LoadError::Missing(missing)) => assert_eq!(missing, Voltages::KEY),
                Err(error) => panic!("{error:?}"),
            }
            assert!(topics(ipc).is_empty());
            let schema = Schema::of::<HeroTelemetry>();
            let mut subscriber = DynamicSubscriber::open(ipc, HeroTelemetry::KEY, &schema).unwrap();
            assert_eq!(subscriber.wait(Duration::ZERO).unwrap(), Wake::TimedOut);
            assert_eq!(subscriber.drain(|_| ()).unwrap(), 0);
        });
    }
}

#[test]
fn the_robots_own_topics_are_read_like_any_other() {
    in_robot(|ipc| {
        let mut publisher = ipc.publisher::<HeroTelemetry>().unwrap();
        publisher
            .publish(|sample| sample.geodetic.altitude_m = 1.0)
            .unwrap();
        let schema = schema_of(ipc, "hero_telemetry").unwrap();
        assert_eq!(schema, Schema::of::<HeroTelemetry>());
        let mut subscriber = DynamicSubscriber::open(ipc, "hero_telemetry", &schema).unwrap();
        // A late joiner gets the latest sample.
        publisher.service();
        publisher
            .publish(|sample| sample.geodetic.altitude_m = 2.0)
            .unwrap();
        assert!(subscriber.wait(WATCHDOG).unwrap().is_ready());
        let mut samples = Vec::new();
        let keep = |payload: &[u8]| samples.extend(HeroTelemetry::from_bytes(payload));
        assert_eq!(subscriber.drain(keep).unwrap(), 2);
        let seen: Vec<_> = samples
            .iter()
            .map(|s| (s.sequence, s.geodetic.altitude_m))
            .collect();
        assert_eq!(seen, [(1, 1.0), (2, 2.0)]);
    });
}

#[test]
fn a_topic_is_opened_with_its_own_schema_alone() {
    in_robot(|ipc| {
        let state = Schema::of::<ModuleState>();
        let mut early = DynamicSubscriber::open(ipc, "module_state", &state).unwrap();
        let mut publisher = ipc.publisher::<ModuleState>().unwrap();
        let swapped =
            schema::text(ModuleState::LAYOUT).replacen("uint32 status\n", "uint32 was_status\n", 1);
        let swapped = Schema::parse(&swapped).unwrap();
        let hero = Schema::of::<HeroTelemetry>();
        for other in [&swapped, &hero] {
            let error = DynamicSubscriber::open(ipc, "module_state", other)
                .err()
                .unwrap();
            let is_layout = matches!(error, DynamicError::Open(OpenError::LayoutMismatch { .. }));
            assert!(is_layout, "{error}");
        }
        let no_sample =
            Schema::parse("# Layout: a.A.v1\n\nuint64 epoch_ns\nuint64 sequence\n").unwrap();
        let error = DynamicSubscriber::open(ipc, "module_state", &no_sample)
            .err()
            .unwrap();
        assert!(matches!(error, DynamicError::NoTopic(_)), "{error}");
        assert!(DynamicSubscriber::open(ipc, "module_state", &state).is_ok());
        assert!(matches!(
            schema_of(ipc, "strange"),
            Err(LoadError::Missing(_))
        ));
        assert_eq!(early.drain(|_| ()).unwrap(), 0);
        publisher.publish(|_| {}).unwrap();
        assert_eq!(early.drain(|_| ()).unwrap(), 1);
    });
}

#[test]
fn services_that_are_there_are_listed_and_nothing_else() {
    in_robot(|ipc| {
        assert_eq!(topics(ipc), []);
        let _publisher = ipc.publisher::<HeroTelemetry>().unwrap();
        let _server = ipc.server::<MovementData>().unwrap();
        let stranger = ipc.publisher::<Voltages>().unwrap();
        let other = Ipc::join(ipc.domain(), RobotId::new(7).unwrap(), "test").unwrap();
        let _other = other.publisher::<ModuleState>().unwrap();
        let listed = topics(ipc);
        let keys: Vec<&str> = listed.iter().map(|topic| topic.key.as_str()).collect();
        assert_eq!(keys, ["battery_watch/cell_voltages", "hero_telemetry"]);
        assert_eq!(listed[0].schema, Schema::of::<Voltages>());
        assert_eq!(listed[0].provider.as_ref().unwrap().process, "test");
        assert_eq!(Schema::parse(&listed[0].text).unwrap(), listed[0].schema);
        let listed = request_services(ipc);
        let keys: Vec<&str> = listed.iter().map(|service| service.key.as_str()).collect();
        assert_eq!(keys, ["movement"]);
        assert_eq!(listed[0].schema, Schema::of::<MovementData>());
        drop(stranger);
        assert_eq!(topics(ipc).len(), 1);
    });
}

/// The schema as a program in another language has it: a text.
const VOLTAGES: &str =
    "# Layout: battery_watch.Voltages.v1\n\nuint64 sequence\nuint64 epoch_ns\nfloat32[12] cells\n";

#[test]
fn a_struct_that_was_published_by_its_schema_is_read_as_a_struct() {
    in_robot(|ipc| {
        let mut subscriber = ipc.subscriber::<Voltages>().unwrap();
        let mut publisher = DynamicPublisher::open(ipc, Voltages::KEY, VOLTAGES).unwrap();
        let cells = publisher.schema().number("cells[11]").unwrap().offset;
        for index in 1..=2 {
            let sequence = publisher.publish(|bytes| {
                assert!(bytes.iter().all(|byte| *byte == 0));
                bytes[cells..].copy_from_slice(&3.5_f32.to_ne_bytes());
            });
            assert_eq!(sequence.unwrap(), index);
        }
        let mut seen = Vec::new();
        while seen.len() < 2 {
            assert!(subscriber.wait(WATCHDOG).unwrap().is_ready());
            subscriber
                .drain(|sample| seen.push((sample.sequence, sample.cells[11])))
                .unwrap();
            publisher.service();
        }
        assert_eq!(seen, [(1, 3.5), (2, 3.5)]);
    });
}

/// The relay and a replay provide what bridge and status do elsewhere.
#[test]
fn keys_of_the_rils_own_modules_are_for_its_own_processes() {
    for process in ["bridge", "relay", "replay"] {
        as_process(process, |ipc| {
            assert!(DynamicPublisher::open(ipc, "bridge/voltages", VOLTAGES).is_ok());
            let of_status = DynamicPublisher::open(ipc, "status/voltages", VOLTAGES);
            assert_eq!(of_status.is_ok(), process != "bridge");
        });
    }
}

#[test]
fn a_subscriber_without_a_place_says_so_when_the_publisher_comes() {
    in_robot(|ipc| {
        let large = VOLTAGES.replace("float32[12]", "float32[50000]");
        let schema = Schema::parse(&large).unwrap();
        let open = || DynamicSubscriber::open(ipc, "a/b", &schema).unwrap();
        let mut subscribers: Vec<_> = (0..3).map(|_| open()).collect();
        // Memory holds the samples of two.
        let _publisher = DynamicPublisher::open(ipc, "a/b", &large).unwrap();
        let results: Vec<_> = subscribers
            .iter_mut()
            .map(|subscriber| subscriber.drain(|_| ()).map_err(|error| error.is_full()))
            .collect();
        assert_eq!(results, [Ok(0), Ok(0), Err(true)]);
    });
}

#[test]
fn what_is_no_topic_of_a_module_is_not_published() {
    in_robot(|ipc| {
        let refusal = |key: &str, schema: &str| match DynamicPublisher::open(ipc, key, schema) {
            Ok(_) => panic!("`{key}` is published"),
            Err(error) => error.to_string(),
        };
        assert!(refusal("voltages", VOLTAGES).contains("is no key"));
        assert!(refusal("a/Voltages", VOLTAGES).contains("is no key"));
        let own = refusal("relay/voltages", VOLTAGES);
        assert!(own.contains("own module `relay`"), "{own}");
        let stations = refusal("relay/stations", VOLTAGES);
        assert!(stations.contains("own module `relay`"), "{stations}");
        for key in ["status/state", "bridge/anything", "bridge/a/b"] {
            let own = refusal(key, VOLTAGES);
            assert!(own.contains("the RIL's own module"), "{own}");
            let request = "# Layout: a.A.v1\n\nuint64 request_id\n";
            let error = DynamicServer::open(ipc, key, request).err().unwrap();
            assert!(matches!(error, DynamicError::OwnModule { .. }), "{error}");
        }
        let large = VOLTAGES.replace("float32[12]", "float32[100000]");
        let large = refusal("a/b", &large);
        assert!(
            large.contains("a sample of `a/b` has 400016 bytes"),
            "{large}"
        );
        assert!(refusal("hero_telemetry", VOLTAGES).contains("hero.HeroTelemetry"));
        assert!(refusal("movement", VOLTAGES).contains("robot's own"));
        assert!(refusal("a/b", "nonsense").contains("not usable"));
        let other = VOLTAGES.replace("sequence", "number");
        assert!(refusal("a/b", &other).contains("do not begin"));
    });
}

const SET_LIMIT: &str =
    "# Layout: battery_watch.SetLimit.v1\n\nuint64 request_id\nfloat64 least_v\nuint64 path_id\n";

fn done() -> RequestReport {
    RequestReport::new(Stage::Done, Reason::None)
}

#[test]
fn a_request_goes_by_its_schema_to_a_server_with_the_struct() {
    in_robot(|ipc| {
        let mut server: Server<SetLimit> = ipc.server().unwrap();
        // All that a tool has is the key.
        let schema = schema_of(ipc, SetLimit::KEY).unwrap();
        assert_eq!(schema, Schema::of::<SetLimit>());
        let mut client = DynamicClient::open(ipc, SetLimit::KEY, &schema).unwrap();
        let request = SetLimit {
            least_v: 3.5,
            ..SetLimit::ZERO
        };
        let id = client.send(request.bytes()).unwrap();
        assert_ne!(id, 0);
        assert!(server.wait(WATCHDOG).unwrap().is_ready());
        let mut taken = Vec::new();
        server
            .drain(|ticket, request| taken.push((ticket, *request)))
            .unwrap();
        let [(ticket, received)] = taken[..] else {
            panic!("{taken:?}");
        };
        assert_eq!((received.request_id, received.least_v), (id, 3.5));
        server.report(ticket, &done()).unwrap();
        assert!(client.wait(WATCHDOG).unwrap().is_ready());
        let mut reports = Vec::new();
        client.drain(|report| reports.push((report.request_id, report.stage())));
        assert_eq!(reports, [(id, Some(Stage::Done))]);
        assert_eq!(client.outstanding(), 0);
    });
}

#[test]
fn a_service_that_is_served_by_its_schema_takes_requests_of_the_struct() {
    in_robot(|ipc| {
        let mut server = DynamicServer::open(ipc, SetLimit::KEY, SET_LIMIT).unwrap();
        let mut client: Client<SetLimit> = ipc.client().unwrap();
        let request = SetLimit {
            request_id: 7,
            least_v: 3.5,
            path_id: 9,
        };
        client.send(&request).unwrap();
        assert!(server.wait(WATCHDOG).unwrap().is_ready());
        let mut taken = Vec::new();
        let take =
            |ticket, bytes: &[u8]| taken.push((ticket, SetLimit::from_bytes(bytes).unwrap()));
        assert_eq!(server.drain(take).unwrap(), 1);
        assert_eq!(taken[0].1, request);
        // The reports of a server that is gone are the client's own, and repeat what the request says.
        drop(server);
        assert!(client.wait(WATCHDOG).unwrap().is_ready());
        let mut reports = Vec::new();
        client.drain(|report| reports.push((report.request_id, report.path_id, report.reason())));
        assert_eq!(reports, [(7, 9, Some(Reason::ModuleGone))]);
    });
}

#[test]
fn a_module_s_control_service_is_served_and_used_by_its_schema() {
    in_robot(|ipc| {
        let key = Watch::CONTROL_KEY;
        let control = schema::text(ModuleControl::LAYOUT);
        let mut server = DynamicServer::open(ipc, key, &control).unwrap();
        let mut typed: Client<ControlOf<Watch>> = ipc.client().unwrap();
        let mut dynamic = DynamicClient::open(ipc, key, &Schema::of::<ModuleControl>()).unwrap();
        typed
            .send(&ControlOf::command(7, ControlCommand::Start))
            .unwrap();
        let unissued = ModuleControl {
            issued_ns: 0,
            ..ModuleControl::new(8, ControlCommand::Stop)
        };
        dynamic.send(unissued.bytes()).unwrap();
        let mut taken = Vec::new();
        let take =
            |ticket, bytes: &[u8]| taken.push((ticket, ModuleControl::from_bytes(bytes).unwrap()));
        assert_eq!(server.drain(take).unwrap(), 2);
        for (ticket, _) in &taken {
            server.report(*ticket, &done()).unwrap();
        }
        taken.sort_by_key(|(_, request)| request.request_id);
        assert_eq!(taken[0].1.command(), Some(ControlCommand::Start));
        assert_eq!(taken[1].1.command(), Some(ControlCommand::Stop));
        assert!(taken[1].1.issued_ns >= taken[0].1.issued_ns, "{taken:?}");
        assert_eq!(typed.drain(|report| assert_eq!(report.request_id, 7)), 1);
        assert_eq!(dynamic.drain(|report| assert_eq!(report.request_id, 8)), 1);
    });
}

#[test]
fn what_is_no_request_of_a_module_is_refused() {
    in_robot(|ipc| {
        let serve = |key: &str, schema: &str| match DynamicServer::open(ipc, key, schema) {
            Ok(_) => panic!("`{key}` is served"),
            Err(error) => error.to_string(),
        };
        assert!(serve("limits", SET_LIMIT).contains("is no key"));
        assert!(serve("relay/limits", SET_LIMIT).contains("own module `relay`"));
        assert!(serve("movement", SET_LIMIT).contains("hero.MovementData"));
        assert!(serve("hero_telemetry", SET_LIMIT).contains("robot's own"));
        assert!(serve("a/b", "nonsense").contains("not usable"));
        assert!(serve("a/b", &SET_LIMIT.replace("request_id", "id")).contains("do not begin"));
        let topic = Schema::of::<HeroTelemetry>();
        assert!(DynamicClient::open(ipc, "a/b", &topic).is_err());

        let server: Server<SetLimit> = ipc.server().unwrap();
        let other = Schema::of::<MovementData>();
        let refusal = DynamicClient::open(ipc, SetLimit::KEY, &other).err();
        assert!(matches!(
            refusal,
            Some(DynamicError::Open(OpenError::LayoutMismatch { .. }))
        ));
        let schema = Schema::of::<SetLimit>();
        let mut client = DynamicClient::open(ipc, SetLimit::KEY, &schema).unwrap();
        let error = client.send(&[0; 8]).unwrap_err();
        assert!(
            error.to_string().contains("24 bytes, 8 were given"),
            "{error}"
        );
        drop(server);
        let error = client.send(SetLimit::ZERO.bytes()).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("start its module `battery_watch`"),
            "{error}"
        );
    });
}

#[test]
fn a_key_that_no_service_can_have_is_refused_by_every_port() {
    as_process("test", |ipc| {
        let schema = Schema::of::<Voltages>();
        let asks = "# Layout: a.A.v1\n\nuint64 request_id\n";
        let request = Schema::parse(asks).unwrap();
        let long = "a/".repeat(2_500);
        for key in ["", "A/b", "../x", "a b/c", "a/", &long] {
            let refusals = [
                DynamicSubscriber::open(ipc, key, &schema).err(),
                DynamicSubscriber::open_with_history(ipc, key, &schema).err(),
                DynamicPublisher::open(ipc, key, VOLTAGES).err(),
                DynamicClient::open(ipc, key, &request).err(),
                DynamicServer::open(ipc, key, asks).err(),
            ];
            for refusal in refusals {
                assert!(
                    matches!(refusal, Some(DynamicError::InvalidKey(_))),
                    "{key}: {refusal:?}"
                );
            }
        }
    });
}
