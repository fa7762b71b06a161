//! Pages that are elsewhere: tokens by name, TLS, and what becomes of a robot whose page is gone.

use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt};

use ipc_types::code::Functionality;
use ril_tests::process::Signal;
use ril_tests::sandbox::free_port;
use serde_json::json;

use super::{View, order, ril};
use crate::common::{FOR_SLOW_MACHINES, Flight, end, sandbox};
use crate::view::page::Page;

const TOKENS: &str = "token_key = \"view.key\"\n[tokens]\nphone = \"watch\"\npad = \"command\"\n";

/// The token behind the address that an invitation begins with.
fn invited(rig: &ril_tests::Sandbox, options: &str) -> String {
    let finished = ril(rig, &format!("view --invite {options}")).exits(0);
    let [address, _, code @ ..] = &finished.stdout[..] else {
        panic!("no invitation: {finished:?}");
    };
    assert!(code.iter().any(|line| line.contains('█')), "{code:?}");
    let (_, token) = address.split_once("/#token=").expect("a token");
    token.to_owned()
}

/// The page may order, and knows where the helicopter is.
fn take_lease(page: &mut Page) {
    page.send(&json!({"type": "lease", "robot": 1, "action": "take"}));
    page.until("the lease", |message| {
        message["type"] == "lease" && message["holder"] == "you"
    });
    page.until("where it is", |message| {
        message["type"] == "now" && message["telemetry"]["freshness"] == "fresh"
    });
}

#[test]
fn a_named_token_allows_what_its_role_says_and_its_key_is_secret() {
    let rig = sandbox();
    rig.write("view.toml", TOKENS);
    let phone = invited(&rig, "phone");
    let key = rig.path("view.key");
    assert_eq!(fs::metadata(&key).unwrap().mode() & 0o777, 0o600);
    let view = View::start_with(&rig, "--robot 1");
    for (token, role) in [(&phone, "watch"), (&invited(&rig, "pad"), "command")] {
        let hello = Page::open(view.port, Some(token)).until_type("hello");
        assert_eq!(hello["role"], role);
    }
    assert_eq!(invited(&rig, "phone"), phone);
    ril(&rig, "view --invite other")
        .exits(2)
        .err_says("no token `other`");
    view.end();

    fs::set_permissions(&key, Permissions::from_mode(0o640)).unwrap();
    let port = free_port();
    for args in ["view --invite phone", &format!("run view --port {port}")] {
        ril(&rig, args).exits(8).err_says("its mode is 640");
    }
}

/// A page keeps its token in the browser; a server that was killed keeps none but by the key.
#[test]
fn a_page_goes_on_when_its_server_was_started_again_in_flight() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let flight = Flight::begin(&rig);
    let view = View::start(&rig);
    let mut page = view.page();
    let life = page.until_type("hello")["instance"].clone();
    let (port, token) = (view.port, view.token.clone());
    rig.kill(view.process);
    let key = rig.path("state/ril/view.key");
    assert_eq!(fs::metadata(&key).unwrap().mode() & 0o777, 0o600);

    let run = format!("run view --port {port}");
    let mut again = ril(&rig, &run);
    again.wait_for_text("ready");
    let mut page = Page::open(port, Some(&token));
    let hello = page.until_type("hello");
    assert_eq!(hello["role"], "command", "{hello}");
    assert_ne!(hello["instance"], life);
    // The bridge says where home is, so nothing of it was lost with the server.
    page.until("home", |message| {
        message["type"] == "chart" && message["home"].is_array()
    });
    page.until("the height", |message| {
        message["type"] == "now"
            && message["height_m"]
                .as_f64()
                .is_some_and(|height| height > 1.0)
    });
    let report = page.order(&order("after", "land"));
    assert_ne!(report["stage"], "not-sent", "{report}");
    end(again, Signal::TERM);

    // Without the key all tokens are new: so an operator takes the right to order back.
    fs::remove_file(&key).unwrap();
    let mut again = ril(&rig, &run);
    again.wait_for_text("ready");
    let hello = Page::open(port, Some(&token)).until_type("hello");
    assert_eq!(hello["role"], "watch", "{hello}");
    end(again, Signal::TERM);

    // A key that others may read makes no token, and keeps no server from starting.
    fs::set_permissions(&key, Permissions::from_mode(0o640)).unwrap();
    let mut again = ril(&rig, &run);
    again.wait_for_text("ready");
    let first = super::token(&rig, port);
    end(again, Signal::TERM).err_says("its mode is 640");
    let mut again = ril(&rig, &run);
    again.wait_for_text("ready");
    assert_ne!(super::token(&rig, port), first);
    end(again, Signal::TERM);
    flight.end();
}

#[test]
fn other_machines_are_served_only_as_the_configuration_says() {
    let rig = sandbox();
    let port = free_port();
    let run = format!("run view --port {port} --robot 1");
    rig.write("view.toml", "listen = [\"0.0.0.0\"]\n");
    ril(&rig, &run)
        .exits(78)
        .err_says("other machines would be served without TLS");
    rig.write("view.toml", "listen = [\"0.0.0.0\"]\ninsecure = true\n");
    let view = View::start_with(&rig, "--robot 1");
    assert_eq!(view.page().until_type("hello")["role"], "command");
    let finished = end(view.process, Signal::TERM);
    finished.err_says("served without TLS");

    rig.write(
        "view.toml",
        "[tls]\ncertificate = \"a.pem\"\nkey = \"a-key.pem\"\n",
    );
    let why = match cfg!(feature = "tls") {
        true => "a.pem",
        false => "this build of ril has no TLS",
    };
    ril(&rig, &run).exits(78).err_says(why);
}

#[test]
fn a_movement_whose_page_is_gone_ends_in_a_hold() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    rig.write("view.toml", "page_lost = \"hold\"\npage_lost_s = 1\n");
    let flight = Flight::begin(&rig);
    let view = View::start(&rig);
    let mut other = view.page();
    let mut page = view.page();
    take_lease(&mut page);
    let (latitude, longitude, altitude) = flight.place;
    let seen = page.until_type("now")["n"].clone();
    // A minute away.
    page.send(
        &json!({"type": "order", "order": "far", "robot": 1, "kind": "goto", "seen": seen,
        "position": [latitude + 0.004, longitude], "altitude_m": altitude, "confirm": null}),
    );
    page.until("its acceptance", |message| {
        message["type"] == "order" && message["stage"] == "accepted"
    });
    drop(page);
    other.until("the event", |message| {
        message["type"] == "event"
            && message["text"]
                .as_str()
                .unwrap()
                .contains("no page commands any more and")
    });
    let report = other.until("the end of the flight", |message| {
        message["type"] == "order" && message["order"] == "far" && message["final"] == true
    });
    assert_eq!(report["stage"], "replaced", "{report}");
    other.until("hovering", |message| {
        message["type"] == "robot" && message["phase"] == "hovering"
    });
    view.end();
    flight.end();
}

/// The server stands still while the presses wait in its socket, as they do in a network that stalls.
#[test]
fn what_a_page_pressed_is_not_carried_out_late_over_a_newer_order() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let flight = Flight::begin(&rig);
    let mut state = rig.watch(1);
    let view = View::start(&rig);
    let mut page = view.page();
    for late_s in [3, 6] {
        page.until("where it is", |message| {
            message["type"] == "now" && message["telemetry"]["freshness"] == "fresh"
        });
        view.process.signal(Signal::STOP);
        let hold = order(&format!("hold{late_s}"), "hold");
        page.press(&hold);
        page.press(&order(&format!("land{late_s}"), "land"));
        rig.run("goto +400m,+0m --preempt --no-wait", 0);
        let mut until = None;
        state.until("the time to pass", |state| {
            state.published_ns > *until.get_or_insert(state.published_ns + late_s * 1_000_000_000)
        });
        view.process.signal(Signal::CONT);
        for name in ["hold", "land"] {
            let report = page.until("the final report", |message| {
                message["type"] == "order"
                    && message["order"] == format!("{name}{late_s}")
                    && message["final"] == true
            });
            // The server does not send it, or the bridge finds it too late.
            let is_late = report["stage"] == "not-sent"
                || report["stage"] == "refused"
                    && report["text"]
                        .as_str()
                        .is_some_and(|text| text.contains("too-late"));
            assert!(is_late, "{report}");
        }
        state.until("it flies on", |state| {
            state.functionality() == Some(Functionality::FollowingPath)
        });
    }
    // A press that comes at once is carried out.
    page.until_type("now");
    assert_eq!(page.order(&order("now", "hold"))["stage"], "done");
    view.end();
    drop(state);
    flight.end();
}

/// A page that is loaded again is back within the time.
#[test]
fn a_movement_whose_page_is_loaded_again_goes_on() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    rig.write("view.toml", "page_lost = \"hold\"\npage_lost_s = 2\n");
    let flight = Flight::begin(&rig);
    let view = View::start(&rig);
    let open =
        json!({"type": "open", "token": view.token, "robot": 1, "rate_hz": 20, "page": "tab"});
    let mut page = view.page();
    page.send(&open);
    let mut page = {
        let host = format!("127.0.0.1:{}", view.port);
        drop(page);
        let mut page = Page::upgrade(view.port, &host, None).expect("an upgrade");
        page.send(&open);
        page
    };
    take_lease(&mut page);
    let (latitude, longitude, altitude) = flight.place;
    page.press(
        &json!({"type": "order", "order": "far", "robot": 1, "kind": "goto", "seen": 0,
        "position": [latitude + 0.004, longitude], "altitude_m": altitude, "confirm": null}),
    );
    page.until("its acceptance", |message| {
        message["type"] == "order" && message["stage"] == "accepted"
    });
    drop(page);
    let host = format!("127.0.0.1:{}", view.port);
    let mut page = Page::upgrade(view.port, &host, None).expect("an upgrade");
    page.send(&open);
    page.until("the lease", |message| {
        message["type"] == "lease" && message["holder"] == "you"
    });
    let mut since = None;
    page.until("twice the time", |message| {
        assert_ne!(
            message["text"],
            "no page commands any more and a movement of one goes on: hold"
        );
        let Some(now) = message["sent_ms"].as_u64() else {
            return false;
        };
        now > *since.get_or_insert(now) + 4_000
    });
    let mut state = rig.watch(1);
    state.until("it flies on", |state| {
        state.functionality() == Some(Functionality::FollowingPath)
    });
    drop(state);
    view.end();
    flight.end();
}

#[test]
fn the_page_that_commands_has_the_control_of_a_bridge_that_is_exclusive() {
    let rig = sandbox();
    rig.write(
        "bridge.toml",
        &format!("{FOR_SLOW_MACHINES}\n[control]\nexclusive = true\n"),
    );
    let robot = rig.start_robot(1, 1);
    let mut state = rig.watch(1);
    let view = View::start(&rig);
    let mut page = view.page();
    page.until("the bridge", |message| {
        message["type"] == "now" && message["bridge"]["freshness"] == "fresh"
    });
    for (action, held) in [("take", 1), ("release", 0), ("take", 1)] {
        page.send(&json!({"type": "lease", "robot": 1, "action": action}));
        state.until(action, |state| state.control.held == held);
    }
    // A page that is gone gives it back, too.
    drop(page);
    state.until("free control", |state| state.control.held == 0);
    view.end();
    drop(state);
    robot.end();
}

#[cfg(feature = "tls")]
mod tls {
    use std::io::{Read, Write};
    use std::sync::Arc;

    use rcgen::{CertificateParams, CertifiedKey, KeyPair};
    use rustls::pki_types::ServerName;
    use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};

    use super::*;
    use crate::view::order;
    use crate::view::page::{connect, request};

    fn certificate(rig: &ril_tests::Sandbox) -> CertifiedKey<KeyPair> {
        let names = vec!["field.local".to_owned(), "127.0.0.1".to_owned()];
        let signing_key = KeyPair::generate().expect("a key");
        let params = CertificateParams::new(names).expect("names");
        let cert = params.self_signed(&signing_key).expect("a certificate");
        rig.write("field.pem", &cert.pem());
        rig.write("field-key.pem", &signing_key.serialize_pem());
        CertifiedKey { cert, signing_key }
    }

    #[test]
    fn one_port_serves_tls_and_plain_loopback() {
        let rig = sandbox();
        let made = certificate(&rig);
        rig.write(
            "view.toml",
            "token_key = \"view.key\"\nlisten = [\"0.0.0.0\"]\nnames = [\"field.local\"]\n\
                [tls]\ncertificate = \"field.pem\"\nkey = \"field-key.pem\"\n[tokens]\npad = \"command\"\n",
        );
        let finished = ril(&rig, "view --invite pad").exits(0);
        let token = finished.stdout[0]
            .strip_prefix("https://field.local:8765/#token=")
            .unwrap();
        let view = View::start_with(&rig, "--robot 1");

        let mut roots = RootCertStore::empty();
        roots.add(made.cert.der().clone()).expect("a root");
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .expect("versions")
            .with_root_certificates(roots)
            .with_no_client_auth();
        let config = Arc::new(config);
        let tls = || {
            let name = ServerName::try_from("field.local").expect("a name");
            let client = ClientConnection::new(config.clone(), name).expect("a client");
            StreamOwned::new(client, connect(view.port))
        };
        let host = format!("field.local:{}", view.port);

        // The page's files, of which one is larger than the kernel takes at once.
        let mut stream = tls();
        write!(
            stream,
            "GET /app.js HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        )
        .unwrap();
        let mut answer = Vec::new();
        // The server ends the connection without a word of TLS.
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8(answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        assert!(head.starts_with("HTTP/1.1 200 OK"), "{head}");
        let plain = request(view.port, "/app.js", &[("Host", &host)]);
        assert_eq!(body, plain.1);

        // The page orders, of its own origin alone.
        let protocol = "hero.view.v1";
        let foreign = Page::over(
            Box::new(tls()),
            "/",
            protocol,
            &host,
            Some(&format!("http://{host}")),
        );
        assert!(foreign.is_err_and(|status| status.contains(" 403 ")));
        let origin = format!("https://{host}");
        let mut page =
            Page::over(Box::new(tls()), "/", protocol, &host, Some(&origin)).expect("an upgrade");
        page.send(&json!({"type": "open", "token": token, "robot": null, "rate_hz": 20}));
        assert_eq!(page.until_type("hello")["role"], "command");
        page.until_type("robot");
        let report = page.order(&order("a1", "hold"));
        assert_eq!(report["stage"], "not-sent", "no bridge runs: {report}");

        // What is neither is turned away, and the others go on.
        let mut broken = connect(view.port);
        broken
            .write_all(&[0x16, 3, 1, 0, 5, 1, 2, 3, 4, 5])
            .unwrap();
        let _ = broken.read_to_end(&mut Vec::new());
        page.until_type("beat");
        assert_eq!(view.page().until_type("hello")["role"], "command");
        view.end();
    }
}
