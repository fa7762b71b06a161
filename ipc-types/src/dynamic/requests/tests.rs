use std::time::Duration;

use super::*;
use crate::code::{ControlCommand, Reason, Stage};
use crate::dynamic::schema_of;
use crate::module::{ControlOf, Module};
use crate::payload::{HeroTelemetry, ModuleControl, MovementData, SharedStruct};
use crate::{Client, Domain, OpenError, Request, RobotId, Server};

/// Far longer than a request takes; only a test that hangs meets it.
const WATCHDOG: Duration = Duration::from_secs(20);

mod stranger {
    #![allow(unsafe_code)]

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

use stranger::{SetLimit, Watch};

const SET_LIMIT: &str =
    "# Layout: battery_watch.SetLimit.v1\n\nuint64 request_id\nfloat64 least_v\nuint64 path_id\n";

fn in_robot(act: impl FnOnce(&Ipc)) {
    let domain = Domain::isolated();
    let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
    act(&ipc);
    drop(ipc);
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

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
        let control = crate::schema::text(ModuleControl::LAYOUT);
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
