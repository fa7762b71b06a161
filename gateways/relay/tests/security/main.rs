//! Strangers on the network: what they can read and order with certificates and without, and what their floods cost.

mod as_root;
mod handshakes;
mod hostile;
mod rig;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RelayStations;
use relay::message::{Ask, Ping, Reply, decode, encode};
use ril_tests::Received;
use ril_tests::process::{Process, WAIT_LIMIT};
use ril_tests::relayed::free_endpoint;

use hostile::{Flood, Heard, Stranger};
use rig::{RELAY, Rig};

/// Memory that a relay may take under any flood, kB: its queues are full, and Zenoh's buffers.
const MAX_RESIDENT_KB: u64 = 400_000;

/// Lines that a relay may log under any flood.
const MAX_LINES: usize = 400;

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).expect("a file in the test's folder");
}

/// A rig without certificates, and where the robot's relay listens.
fn open_rig() -> (Rig, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let endpoint = free_endpoint();
    write(
        folder.path(),
        "robot.toml",
        &format!("[robot]\nlisten = [{endpoint:?}]\n[commands]\nstations = [\"gcs\"]\n"),
    );
    write(
        folder.path(),
        "station.toml",
        &format!("[station]\nname = \"gcs\"\nconnect = [{endpoint:?}]\n"),
    );
    (Rig::start(folder), endpoint)
}

/// Runs the flood in threads of its own while `work` is done, and says how many messages were sent.
fn during(floods: Vec<Flood>, work: impl FnOnce()) -> u64 {
    let is_over = Arc::new(AtomicBool::new(false));
    let threads: Vec<_> = floods
        .into_iter()
        .map(|mut flood| {
            let is_over = Arc::clone(&is_over);
            thread::spawn(move || {
                let mut sent = 0;
                while !is_over.load(Ordering::Relaxed) {
                    flood.send();
                    sent += 1;
                }
                sent
            })
        })
        .collect();
    work();
    is_over.store(true, Ordering::Relaxed);
    threads
        .into_iter()
        .map(|thread| thread.join().expect("a flood"))
        .sum()
}

/// The session of the station, as an eavesdropper on its requests hears it.
fn session_of(rig: &mut Rig, heard: &Heard) -> u64 {
    rig.request_done();
    loop {
        rig.telemetry();
        if let Some(session) = heard.session() {
            return session;
        }
    }
}

#[test]
fn a_flood_of_garbage_long_and_replayed_messages_stops_neither_telemetry_nor_requests() {
    let (mut rig, endpoint) = open_rig();
    let recorder = Stranger::plain(&endpoint);
    let heard = recorder.listen("hero/1/**");
    let session = session_of(&mut rig, &heard);
    let kinds = [
        (20, Flood::garbage as fn(Stranger) -> Flood),
        (1, Flood::long),
        (20, Flood::names),
        (20, Flood::patterns),
        (20, Flood::topics),
    ];
    for (count, kind) in kinds {
        rig.floods.push((count, kind(Stranger::plain(&endpoint))));
    }
    let replay = Flood::replay(Stranger::plain(&endpoint), session);
    rig.floods.push((1, replay));
    let before = (rig.published(), rig.received, rig.processor_s());
    let began = std::time::Instant::now();
    for _ in 0..20 {
        rig.request_done();
    }
    for _ in 0..400 {
        rig.telemetry();
    }
    // How many come through while, the machine decides: what is promised is that they go on coming.
    rig.until_telemetry_comes(20);
    let sent = rig.hostile;
    let elapsed_s = began.elapsed().as_secs_f64();
    let published = (rig.published() - before.0) as u64;
    let received = rig.received - before.1;
    let after = rig.processor_s();
    let processor = [0, 1].map(|side| (after[side] - before.2[side]) / elapsed_s);
    let (resident, lines) = (rig.resident_kb(), rig.lines());
    println!(
        "{sent} hostile messages in {elapsed_s:.1} s; {received} of {published} samples; \
         processor {processor:.2?}; kB {resident:?}; lines {lines:?}"
    );
    assert!(
        resident.iter().all(|kb| *kb < MAX_RESIDENT_KB),
        "{resident:?}"
    );
    assert!(lines.iter().all(|lines| *lines < MAX_LINES), "{lines:?}");
    rig.floods.clear();
    rig.request_done();
    rig.end();
}

#[test]
fn a_stranger_who_takes_the_name_of_the_station_executes_nothing_twice_and_when_he_goes_all_is_well()
 {
    let (mut rig, endpoint) = open_rig();
    let recorder = Stranger::plain(&endpoint);
    let heard = recorder.listen("hero/1/**");
    let session = session_of(&mut rig, &heard);
    let floods = vec![
        Flood::instances(Stranger::plain(&endpoint), "gcs"),
        Flood::replay(Stranger::plain(&endpoint), session),
    ];
    let mut outcomes = Vec::new();
    let sent = during(floods, || {
        for _ in 0..5 {
            outcomes.push(rig.request());
        }
    });
    println!(
        "{sent} hostile messages; outcomes {:?}",
        outcomes
            .iter()
            .map(|report| (report.stage(), report.reason()))
            .collect::<Vec<_>>()
    );
    // The link comes back by itself.
    while rig.request().stage() != Some(Stage::Done) {}
    // The bridge has had each request once, besides questions about it, and none of the stranger.
    let mut seen = BTreeSet::new();
    while !seen.contains(&rig.last_id()) {
        let Received::Movement(movement) = rig.bridge.next_request() else {
            panic!("a stranger's request");
        };
        assert!(movement.request_id <= rig.last_id(), "a stranger's request");
        let is_new = movement.repeat == 1 || seen.insert(movement.request_id);
        assert!(is_new, "{} was ordered twice", movement.request_id);
    }
    rig.end();
}

/// Certificates of the robot, the station and a watcher in `pki`, and of a stranger with an authority of his own in
/// `other`.
fn certify(folder: &Path) {
    for args in [
        &[
            "certify",
            "pki",
            "robot-1=127.0.0.1,::1",
            "gcs",
            "viewer",
            "router=127.0.0.1",
        ][..],
        &["certify", "other", "gcs", "robot-1=127.0.0.1"],
    ] {
        let made = std::process::Command::new(RELAY)
            .args(args)
            .current_dir(folder)
            .output()
            .expect("the relay's program");
        assert!(made.status.success(), "{made:?}");
    }
}

/// A rig with certificates over `protocol`, through a router if it is asked for, and where others connect to.
fn secured_rig(protocol: &str, through_router: bool) -> (Rig, String) {
    secured_rig_at(&free_endpoint().replace("tcp", protocol), through_router)
}

/// As [`secured_rig`], with others that connect to `endpoint`.
fn secured_rig_at(endpoint: &str, through_router: bool) -> (Rig, String) {
    let folder = tempfile::tempdir().expect("a folder");
    certify(folder.path());
    let endpoint = endpoint.to_owned();
    let sides = [
        ("robot", "robot-1"),
        ("station", "gcs"),
        ("router", "router"),
    ];
    for (side, name) in sides.into_iter().take(if through_router { 3 } else { 2 }) {
        let through = if through_router { "router" } else { "peers" };
        let listens = if through_router { "router" } else { "robot" };
        let (listen, connect) = match side == listens {
            true => (vec![&endpoint], Vec::new()),
            false => (Vec::new(), vec![&endpoint]),
        };
        let station = if side == "station" {
            "name = \"gcs\"\n"
        } else {
            ""
        };
        let text = format!(
            "[network]\nthrough = \"{through}\"\n[security]\nauthority = \"pki/ca.pem\"\ncertificate = \"pki/{name}.pem\"\n\
             key = \"pki/{name}-key.pem\"\nrobots = {{ robot-1 = 1 }}\nrouters = [\"router\"]\nstations = [\"viewer\"]\n\
             [commands]\nstations = [\"gcs\"]\n[{side}]\nlisten = {listen:?}\nconnect = {connect:?}\n{station}"
        );
        write(folder.path(), &format!("{side}.toml"), &text);
    }
    (Rig::start(folder), endpoint)
}

#[test]
fn two_robots_of_one_number_behind_a_router_are_named_and_neither_is_ordered_until_one_is_gone() {
    let (mut rig, _) = secured_rig("tls", true);
    rig.until_telemetry_comes(5);
    rig.request_done();
    let (mut robot, bridge, domain) = rig.copy_of_robot();
    let refused = (Some(Stage::Refused), Some(Reason::RelayTwoRobots));
    let outcome = |rig: &mut Rig| {
        let report = rig.request();
        (report.stage(), report.reason())
    };
    let until = |rig: &mut Rig, expected| {
        let began = std::time::Instant::now();
        while outcome(rig) != expected {
            assert!(began.elapsed() < WAIT_LIMIT, "never {expected:?}");
        }
    };
    until(&mut rig, refused);
    // By the names that each has in the log of its own relay. On a machine that stalls the first one may be the copy.
    let name = |relay: &mut Process| {
        let text = relay.wait_for_text("the relay of this robot").text;
        let (_, name) = text.split_once("instance=").expect("its instance");
        name.to_owned()
    };
    let named = |[first, second]: [&String; 2]| format!("first={first} second={second}");
    let [one, two] = [name(&mut rig.robot), name(&mut robot)];
    let line = rig
        .station
        .wait_for_text("two robots answer under this number");
    let names = [named([&one, &two]), named([&two, &one])];
    assert!(
        names.iter().any(|names| line.text.contains(names)),
        "{names:?}: {line:?}"
    );
    let alternations = rig.alternations;
    for _ in 0..20 {
        assert_eq!(outcome(&mut rig), refused);
    }
    // Until the relay of the second sends the station all of its telemetry.
    let consumer = domain.join("consumer");
    let mut stations = consumer
        .subscriber::<RelayStations>()
        .expect("a subscriber");
    let sends_all = |stations: RelayStations| {
        stations.samples_bytes_per_s == 0 && !stations.stations().is_empty()
    };
    while !stations.latest().expect("samples").is_some_and(sends_all) {
        rig.until_telemetry_comes(1);
    }
    rig.until_telemetry_comes(50);
    assert_eq!(rig.alternations, alternations, "samples of two robots");
    assert_eq!(bridge.take_requests(), [], "of the second robot");
    robot.end();
    bridge.die();
    let done = (Some(Stage::Done), Some(Reason::None));
    until(&mut rig, done);
    rig.end();
}

#[test]
fn over_tls_and_quic_a_station_reaches_a_robot_at_an_address_of_the_sixth_version_of_ip() {
    if std::net::UdpSocket::bind("[::1]:0").is_err() {
        return println!("SKIPPED: this machine has no IPv6");
    }
    for protocol in ["tls", "quic"] {
        let endpoint = free_endpoint().replace("127.0.0.1", "[::1]");
        let (mut rig, _) = secured_rig_at(&endpoint.replace("tcp", protocol), false);
        rig.until_telemetry_comes(5);
        rig.request_done();
        rig.end();
    }
}

fn strangers_read_and_order_nothing(protocol: &str) {
    let (mut rig, endpoint) = secured_rig(protocol, false);
    // As relays connect over QUIC.
    let endpoint = match protocol {
        "quic" => format!("{endpoint}?mixed_rel=1"),
        _ => endpoint,
    };
    rig.request_done();
    let folder = rig.folder.path().to_owned();
    // Without a certificate of the authority there is no session.
    let mut outside = vec![
        Stranger::certified(&endpoint, &folder, "other", "gcs"),
        Stranger::half_certified(&endpoint, &folder),
    ];
    if protocol == "tls" {
        outside.push(Stranger::plain(&endpoint.replace("tls/", "tcp/")));
    }
    let outside: Vec<_> = outside
        .into_iter()
        .map(|stranger| (stranger.listen("**"), stranger))
        .collect();
    // One with a certificate that may only watch.
    let viewer = Stranger::certified(&endpoint, &folder, "pki", "viewer");
    let all = viewer.listen("**");
    let others = viewer.listen("hero/1/tell/gcs");
    let orders = viewer.listen("hero/1/order/*");
    let replies = viewer.listen("hero/1/tell/viewer");
    let topics = viewer.listen("hero/1/topic/**");
    let ping = Ask::Ping(Ping {
        station_instance: 77,
        sent_ns: 1,
        suspended_ns: 0,
        wants_latest: true,
        has_all: true,
        late_ms: None,
    });
    for stranger in outside
        .iter()
        .map(|(_, stranger)| stranger)
        .chain([&viewer])
    {
        for name in ["gcs", "viewer", "*"] {
            stranger.order(name);
            stranger.put(&format!("hero/1/ask/{name}"), &encode(&ping));
            stranger.put(
                &format!("hero/1/tell/{name}"),
                &encode(&Reply::UnknownSession(1)),
            );
        }
        stranger.put("hero/1/topic/hero_telemetry", b"garbage");
    }
    // The watcher is answered under his own name: by then all that he has sent before was looked at.
    let pong = loop {
        rig.telemetry();
        viewer.put("hero/1/ask/viewer", &encode(&ping));
        if let Some((_, message)) = replies.drain().pop() {
            break decode::<Reply>(&message).expect("a message");
        }
    };
    let Reply::Pong(pong) = pong else {
        panic!("{pong:?}");
    };
    assert_eq!(pong.session, 0, "he may not command");
    while topics.drain().is_empty() {
        rig.telemetry();
    }
    for _ in 0..5 {
        rig.request_done();
    }
    let flood = vec![Flood::instances(viewer, "gcs")];
    let sent = during(flood, || {
        for _ in 0..10 {
            rig.request_done();
        }
    });
    println!("{protocol}: {sent} hostile messages under the station's name");
    // All that comes to the session is heard under `**` too.
    let is_allowed = |key: &str| key.starts_with("hero/1/topic/") || key == "hero/1/tell/viewer";
    for (key, _) in all.drain() {
        assert!(is_allowed(&key), "{key}");
    }
    assert_eq!(others.drain(), []);
    assert_eq!(orders.drain(), []);
    for (heard, _) in &outside {
        assert_eq!(heard.drain(), []);
    }
    let lines = rig.lines();
    assert!(lines.iter().all(|lines| *lines < MAX_LINES), "{lines:?}");
    rig.end();
}

#[test]
fn with_certificates_over_tls_strangers_read_and_order_nothing() {
    strangers_read_and_order_nothing("tls");
}

#[test]
fn with_certificates_over_quic_strangers_read_and_order_nothing() {
    strangers_read_and_order_nothing("quic");
}

#[test]
fn through_a_router_with_certificates_a_watcher_reads_and_orders_nothing_in_another_name() {
    let (mut rig, endpoint) = secured_rig("tls", true);
    rig.request_done();
    let viewer = Stranger::certified(&endpoint, rig.folder.path(), "pki", "viewer");
    let others = viewer.listen("hero/1/tell/gcs");
    let orders = viewer.listen("hero/1/order/*");
    let topics = viewer.listen("hero/1/topic/**");
    viewer.order("gcs");
    viewer.order("viewer");
    while topics.drain().is_empty() {
        rig.telemetry();
    }
    for _ in 0..5 {
        viewer.order("gcs");
        rig.request_done();
    }
    assert_eq!(others.drain(), []);
    assert_eq!(orders.drain(), []);
    rig.end();
}
