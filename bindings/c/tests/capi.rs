//! The functions as a C program calls them, wrong calls included.

#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_int};
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::ptr::{null, null_mut};

use hero_ril::capi::requests::*;
use hero_ril::capi::robot::*;
use hero_ril::capi::serving::*;
use hero_ril::capi::topics::*;
use hero_ril::capi::*;
use ipc_types::Domain;
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{ModuleControl, RequestReport};
use ipc_types::service::ServiceId;

fn last_error() -> String {
    let text = unsafe { CStr::from_ptr(hero_ril_last_error()) };
    text.to_str().unwrap().to_owned()
}

#[track_caller]
fn refused(code: c_int, expected: c_int, text: &str) {
    assert_eq!(code, expected, "{}", last_error());
    assert!(last_error().contains(text), "{}", last_error());
}

#[test]
fn no_panic_leaves_the_library() {
    refused(hero_ril_test_panic(), -7, "on purpose");
}

#[test]
fn null_pointers_and_senseless_arguments_are_errors() {
    let domain = Domain::isolated();
    let root = CString::new(domain.root().to_str().unwrap()).unwrap();
    unsafe {
        let mut robot = null_mut();
        refused(
            hero_ril_join(root.as_ptr(), 0, c"c".as_ptr(), &mut robot),
            -1,
            "robot id",
        );
        refused(
            hero_ril_join(root.as_ptr(), 1, null(), &mut robot),
            -1,
            "process_name",
        );
        refused(
            hero_ril_join(root.as_ptr(), 1, c"a b".as_ptr(), &mut robot),
            -1,
            "process name",
        );
        refused(
            hero_ril_join(root.as_ptr(), 1, c"relay".as_ptr(), &mut robot),
            -1,
            "`relay` is the name of the RIL's own module",
        );
        refused(
            hero_ril_join(root.as_ptr(), 1, c"c".as_ptr(), null_mut()),
            -1,
            "out",
        );
        assert!(robot.is_null());
        assert_eq!(
            hero_ril_join(root.as_ptr(), 1, c"c".as_ptr(), &mut robot),
            0
        );
        let mut subscriber = null_mut();
        refused(
            hero_ril_subscribe(robot, null(), &mut subscriber),
            -1,
            "topic",
        );
        refused(
            hero_ril_receive(subscriber, null_mut(), 0, 0),
            -1,
            "subscriber",
        );
        let mut client = null_mut();
        assert_eq!(hero_ril_client_open(robot, &mut client), 0);
        refused(
            hero_ril_take_off(client, 10.0, null_mut()),
            -3,
            "start its bridge",
        );
        let request = 0_u64;
        let bytes = (&raw const request).cast();
        let movement = service(c"movement");
        refused(
            hero_ril_send(client, &movement, bytes, 8, null_mut()),
            -2,
            "96 bytes",
        );
        let unknown = service(c"nothing/there");
        refused(
            hero_ril_send(client, &unknown, bytes, 8, null_mut()),
            -3,
            "no running process",
        );
        refused(
            hero_ril_send(client, null(), bytes, 8, null_mut()),
            -1,
            "service",
        );
        assert_eq!(hero_ril_when_lost(client, 3, 60_000), 0);
        for (action, lease_ms) in [(4, 0), (-1, 0), (2, 499), (2, -500)] {
            refused(hero_ril_when_lost(client, action, lease_ms), -1, "lease");
        }
        refused(
            hero_ril_go_to(client, null(), 1, 0, null_mut()),
            -1,
            "waypoints",
        );
        let mut server = null_mut();
        refused(
            hero_ril_serve(robot, &unknown, &mut server),
            -1,
            "needs a schema",
        );
        refused(
            hero_ril_report(server, 0, &RequestReport::default()),
            -1,
            "server",
        );
        hero_ril_unsubscribe(null_mut());
        hero_ril_server_close(null_mut());
        hero_ril_client_close(client);
        hero_ril_leave(robot);
    }
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

/// What a publisher that was killed leaves when its last subscriber has gone: its announcement, of a generation that is
/// not there.
#[test]
fn a_topic_of_which_only_the_announcement_is_left_is_not_there() {
    let domain = Domain::isolated();
    let root = CString::new(domain.root().to_str().unwrap()).unwrap();
    let schema = c"# Layout: battery_watch.Cell.v1\n\nuint64 sequence\nuint64 epoch_ns\n";
    let cell = service(c"battery_watch/cell");
    unsafe {
        let mut robot = null_mut();
        hero_ril_join(root.as_ptr(), 1, c"c".as_ptr(), &mut robot);
        let (mut publisher, mut subscriber) = (null_mut(), null_mut());
        let advertised = Service {
            schema: schema.as_ptr(),
            ..service(c"battery_watch/cell")
        };
        let code = hero_ril_advertise(robot, &advertised, &mut publisher);
        assert_eq!(code, 0, "{}", last_error());
        assert_eq!(hero_ril_subscribe(robot, &cell, &mut subscriber), 0);
        hero_ril_unsubscribe(subscriber);
        let services = fs::read_dir(domain.root().join("1")).unwrap().flatten();
        let current = services
            .map(|service| service.path().join("current"))
            .find(|current| current.exists());
        let current = current.unwrap();
        let announcement = fs::read(&current).unwrap();
        hero_ril_withdraw(publisher);
        for _ in 0..2 {
            refused(
                hero_ril_subscribe(robot, &cell, &mut subscriber),
                -3,
                "battery_watch/cell",
            );
            fs::create_dir_all(current.parent().unwrap()).unwrap();
            fs::write(&current, &announcement).unwrap();
        }
        hero_ril_leave(robot);
    }
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

/// What the header says of a program that is started by exec: it gets what iceoryx2 has open, but no lock and no
/// segment, so that it keeps nothing of its parent alive.
#[test]
fn a_program_that_is_started_by_exec_inherits_no_lock_and_keeps_nothing_alive() {
    let domain = Domain::isolated();
    let root = domain.root().to_str().unwrap();
    let root_text = CString::new(root).unwrap();
    unsafe {
        let mut robot = null_mut();
        hero_ril_join(root_text.as_ptr(), 1, c"c".as_ptr(), &mut robot);
        let topic = service(c"hero_telemetry");
        let (mut publisher, mut subscriber) = (null_mut(), null_mut());
        assert_eq!(hero_ril_advertise(robot, &topic, &mut publisher), 0);
        assert_eq!(hero_ril_subscribe(robot, &topic, &mut subscriber), 0);
        let mut child = Command::new("sh")
            .args(["-c", "ls -l /proc/$$/fd; echo .; read line"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let held: Vec<String> = lines
            .map_while(Result::ok)
            .take_while(|line| line != ".")
            .collect();
        let of_iceoryx2 = |name: &str| {
            [".details", ".port_tag", ".service"]
                .iter()
                .any(|end| name.ends_with(end))
                || name.contains(".node_monitor")
        };
        let files: Vec<&String> = held.iter().filter(|line| line.contains(root)).collect();
        assert!(files.iter().all(|line| of_iceoryx2(line)), "{files:#?}");
        let tag = domain.tag();
        let is_segment = |line: &&String| line.contains(&format!("/dev/shm/{tag}"));
        assert_eq!(held.iter().find(is_segment), None);
        hero_ril_unsubscribe(subscriber);
        hero_ril_withdraw(publisher);
        assert_eq!(hero_ril_advertise(robot, &topic, &mut publisher), 0);
        hero_ril_withdraw(publisher);
        hero_ril_leave(robot);
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
        assert_eq!(child.try_wait().unwrap(), None, "it lives");
        drop(child.stdin.take());
        child.wait().unwrap();
    }
}

fn service(key: &CStr) -> Service {
    Service {
        key: key.as_ptr(),
        layout_hash: null(),
        schema: null(),
        size: 0,
    }
}

/// Longest wait of a test, ms; only one that hangs meets it.
const WATCHDOG_MS: i32 = 20_000;

#[test]
fn requests_are_served_and_clients_that_are_gone_are_known() {
    let domain = Domain::isolated();
    let root = CString::new(domain.root().to_str().unwrap()).unwrap();
    let hash = ServiceId::ModuleControl.contract().layout_hash();
    let hash = CString::new(format!("{hash:016x}")).unwrap();
    let control = Service {
        layout_hash: hash.as_ptr(),
        size: size_of::<ModuleControl>(),
        ..service(c"battery_watch/control")
    };
    unsafe {
        let mut robot = null_mut();
        hero_ril_join(root.as_ptr(), 1, c"c".as_ptr(), &mut robot);
        let (mut server, mut client) = (null_mut(), null_mut());
        assert_eq!(
            hero_ril_serve(robot, &control, &mut server),
            0,
            "{}",
            last_error()
        );
        let mut second = null_mut();
        refused(
            hero_ril_serve(robot, &control, &mut second),
            -4,
            "already provided",
        );
        hero_ril_client_open(robot, &mut client);
        let request = ModuleControl::new(0, ControlCommand::Start);
        let size = size_of::<ModuleControl>();
        let send =
            |id: &mut u64| hero_ril_send(client, &control, (&raw const request).cast(), size, id);
        let mut taken = ModuleControl::default();
        let mut take = |ticket: &mut u64, timeout_ms| {
            let to = (&raw mut taken).cast();
            (hero_ril_take(server, to, size, ticket, timeout_ms), taken)
        };
        let answer = |ticket, stage| {
            hero_ril_report(server, ticket, &RequestReport::new(stage, Reason::None))
        };
        let (mut id, mut ticket) = (0, u64::MAX);
        assert_eq!(take(&mut ticket, 0).0, 1);
        assert_eq!(send(&mut id), 0, "{}", last_error());
        let (code, order) = take(&mut ticket, WATCHDOG_MS);
        assert_eq!(
            (code, order.request_id, order.command),
            (0, id, request.command)
        );
        for stage in [Stage::Accepted, Stage::Progress, Stage::Done] {
            assert_eq!(answer(ticket, stage), 0);
            let mut report = RequestReport::default();
            assert_eq!(
                hero_ril_next_report(client, id, WATCHDOG_MS, &mut report),
                0
            );
            assert_eq!((report.request_id, report.stage()), (id, Some(stage)));
        }
        refused(answer(ticket, Stage::Done), -1, "not open");
        let (mut found, mut count) = ([-1; 4], 0);
        let code = hero_ril_client_descriptors(client, found.as_mut_ptr(), 4, &mut count);
        assert_eq!((code, count), (0, 1));
        let mut descriptor = -1;
        assert_eq!(hero_ril_server_descriptor(server, &mut descriptor), 0);
        assert!(found[0] >= 0 && descriptor >= 0);

        // One is taken and given up, one is given up before it is taken.
        assert_eq!(send(&mut id), 0);
        assert_eq!(take(&mut ticket, WATCHDOG_MS).0, 0);
        assert_eq!(send(&mut id), 0);
        assert_eq!(hero_ril_give_up(client), 0);
        let mut gone = u64::MAX;
        assert_eq!(take(&mut gone, WATCHDOG_MS).0, 3);
        assert_eq!(gone, ticket);
        assert_eq!(take(&mut gone, 0).0, 1);
        refused(answer(ticket, Stage::Done), -1, "not open");
        hero_ril_server_close(server);
        hero_ril_client_close(client);
        hero_ril_leave(robot);
    }
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}
