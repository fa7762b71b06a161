//! The functions as a C program calls them, wrong calls included.

#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_int};
use std::ptr::{null, null_mut};

use hero_ril::capi::*;
use ipc_types::Domain;

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
        refused(
            hero_ril_send(client, c"movement".as_ptr(), bytes, 8, null_mut()),
            -2,
            "56 bytes",
        );
        refused(
            hero_ril_send(client, c"nothing".as_ptr(), bytes, 8, null_mut()),
            -1,
            "no request",
        );
        refused(
            hero_ril_go_to(client, null(), 1, 0, null_mut()),
            -1,
            "waypoints",
        );
        hero_ril_unsubscribe(null_mut());
        hero_ril_client_close(client);
        hero_ril_leave(robot);
    }
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}
