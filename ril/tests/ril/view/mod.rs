//! `ril run view` and `ril view` beside real robots and stand-ins, as a browser sees them.

mod foxglove;
mod judges;
pub mod page;
mod places;
mod replayed;

use std::fs;
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;

use ipc_types::RobotId;
use ipc_types::code::{MovementKind, Reason};
use ril_tests::process::Signal;
use ril_tests::sandbox::free_port;
use ril_tests::{Answer, Process, Sandbox, StandInBridge};
use rustix::process::{Pid, Resource, Rlimit, prlimit};
use serde_json::{Value, json};

use crate::common::{FOR_SLOW_MACHINES, Flight, end, end_all, json as json_of, movement, sandbox};
use page::{Page, request};

/// Robots that come at once, of the 32 that a view shows.
const MANY: u32 = 32;

/// A view that runs on a port of its own.
struct View {
    process: Process,
    port: u16,
    token: String,
}

/// `ril` with these arguments, whose runtime folder is the sandbox's.
fn ril(rig: &Sandbox, args: &str) -> Process {
    let mut command = rig.command(args.split_whitespace());
    command.env("XDG_RUNTIME_DIR", rig.folder());
    Process::spawn(&rig.domain, command)
}

fn run_file(rig: &Sandbox, port: u16) -> PathBuf {
    rig.path(&format!("ril/view-{port}.json"))
}

pub fn token(rig: &Sandbox, port: u16) -> String {
    let text = fs::read_to_string(run_file(rig, port)).expect("a file of the running view");
    let running: Value = serde_json::from_str(&text).expect("JSON");
    running["token"].as_str().expect("a token").to_owned()
}

impl View {
    fn start(rig: &Sandbox) -> View {
        View::start_with(rig, "")
    }

    /// Starts the view with further options.
    fn start_with(rig: &Sandbox, options: &str) -> View {
        View::start_by(rig, &format!("run view {options}"))
    }

    /// The replay of a file.
    fn of_file(rig: &Sandbox, file: &str) -> View {
        View::start_by(rig, &format!("view {file} --no-browser"))
    }

    fn start_by(rig: &Sandbox, args: &str) -> View {
        let port = free_port();
        let mut process = ril(rig, &format!("{args} --port {port}"));
        process.wait_for_text("ready");
        let token = token(rig, port);
        View {
            process,
            port,
            token,
        }
    }

    fn page(&self) -> Page {
        Page::open(self.port, Some(&self.token))
    }

    fn end(self) {
        end(self.process, Signal::TERM);
    }
}

pub fn order(number: &str, kind: &str) -> Value {
    json!({"type": "order", "order": number, "robot": 1, "kind": kind, "seen": 0, "position": null,
        "altitude_m": null, "confirm": null})
}

#[test]
fn a_page_sees_a_robot_fly_and_that_its_bridge_is_gone() {
    let rig = sandbox();
    let robot = rig.start_robot(1, 1);
    let view = View::start(&rig);
    let mut page = view.page();
    let hello = page.until_type("hello");
    assert_eq!(hello["protocol"], "hero.view.v1");
    assert_eq!(hello["role"], "command");
    assert_eq!(hello["robots"], json!([1]));
    let past = page.until_type("past");
    assert!(past["t_s"].is_array(), "{past}");
    let words = page.until("the phase", |message| {
        message["type"] == "robot" && message["phase"] == "on the ground"
    });
    assert_eq!(
        (&words["replayed"], &words["relayed"]),
        (&json!(false), &json!(false))
    );
    page.until("the list", |message| {
        message["type"] == "robots" && message["robots"][0]["link"] == "fresh"
    });

    // 20 a second at most, of true ages.
    let mut last_ms = 0;
    let mut least_ms = u64::MAX;
    let first = page.until_type("now");
    for _ in 0..40 {
        let now = page.until_type("now");
        let freshness = match now["telemetry"]["age_ms"].as_u64().unwrap() {
            ..1000 => "fresh",
            // Cut off to whole milliseconds: both are true.
            1000 => now["telemetry"]["freshness"].as_str().unwrap(),
            1001.. => "stale",
        };
        assert_eq!(now["telemetry"]["freshness"], freshness, "{now}");
        assert!(now["position"][0].is_number(), "{now}");
        let sent_ms = now["sent_ms"].as_u64().unwrap();
        if last_ms > 0 {
            least_ms = least_ms.min(sent_ms - last_ms);
        }
        last_ms = sent_ms;
    }
    let span_ms = last_ms - first["sent_ms"].as_u64().unwrap();
    assert!(
        span_ms >= 39 * 45,
        "40 values in {span_ms} ms, two of them in {least_ms} ms"
    );

    let [bridge, sim, status] = [robot.bridge, robot.sim, robot.status];
    // A status that stands still is an alarm, and telemetry goes on by the bridge's own.
    status.signal(Signal::STOP);
    page.until("the alarm of a status that hangs", |message| {
        message["type"] == "robot" && message["alarms"][0]["id"] == "status-silent"
    });
    status.signal(Signal::CONT);
    page.until("the end of that alarm", |message| {
        message["type"] == "robot" && message["alarms"] == json!([])
    });
    rig.kill(bridge);
    page.until("the event", |message| {
        message["type"] == "event" && message["severity"] == "alarm"
    });
    let gone = page.until("a bridge that is gone, and its telemetry", |message| {
        let is_gone = |name: &str| message[name]["freshness"] == "gone";
        message["type"] == "now" && is_gone("bridge") && is_gone("telemetry")
    });
    // The process that ended is gone at once; telemetry, which another process publishes, when it is old.
    let age_ms = |name: &str| gone[name]["age_ms"].as_u64().unwrap();
    assert!(age_ms("telemetry") >= 1000, "{gone}");
    page.until("the alarm", |message| {
        message["type"] == "robot" && message["alarms"][0]["id"] == "bridge-gone"
    });
    // A page that comes now has it in its past.
    let past = view.page().until_type("past");
    let events = past["events"].as_array().unwrap();
    assert_eq!(events.last().unwrap()["severity"], "alarm", "{past}");
    view.end();
    end_all([sim, status]);
}

#[test]
fn an_order_is_given_once_whatever_a_page_repeats() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    bridge.publish_state(&StandInBridge::idle_state());
    let view = View::start(&rig);
    let mut page = view.page();
    page.until_type("robot");
    for _ in 0..3 {
        let report = page.order(&order("a1", "hold"));
        assert_eq!(
            (&report["stage"], &report["kind"]),
            (&json!("done"), &json!("hold"))
        );
    }
    bridge.answer_next(Answer::refuse(Reason::LinkDown));
    let report = page.order(&order("a2", "land"));
    assert_eq!(report["stage"], "refused");
    assert!(
        report["text"].as_str().unwrap().contains("link-down"),
        "{report}"
    );

    // Another page finds what became of it, and does not give it again either.
    let mut other = view.page();
    other.until_type("robot");
    other.order(&order("a2", "land"));

    // Who may only watch orders nothing.
    let mut stranger = Page::open(view.port, None);
    assert_eq!(stranger.until_type("hello")["role"], "watch");
    let report = stranger.order(&order("a3", "land"));
    assert_eq!(report["stage"], "not-sent", "{report}");
    let mut liar = Page::open(view.port, Some("0123456789abcdef0123456789abcdef"));
    let answer = liar.until("an answer", |message| {
        message["type"] == "hello" || message["type"] == "refused"
    });
    assert_ne!(answer["role"], "command", "{answer}");

    page.order(&order("a4", "hold"));
    let kinds: Vec<_> = (0..3)
        .map(|_| movement(bridge.next_request()).kind())
        .collect();
    let expected = [MovementKind::Hold, MovementKind::Land, MovementKind::Hold];
    assert_eq!(kinds, expected.map(Some));
    let finished = end(view.process, Signal::TERM);
    finished.err_says("kind=Land");
}

#[test]
fn a_page_flies_to_a_place_that_was_checked() {
    let rig = sandbox();
    let mast = "[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\ncentre = [37.4114, -6.001]\nradius_m = 10.0\n";
    rig.write("bridge.toml", &format!("{FOR_SLOW_MACHINES}\n{mast}"));
    let flight = Flight::begin(&rig);
    let view = View::start(&rig);
    let mut page = view.page();
    page.until("where it is", |message| {
        message["type"] == "now" && message["telemetry"]["freshness"] == "fresh"
    });
    let (latitude, longitude, altitude) = flight.place;
    let near = [latitude + 0.0002, longitude];
    let behind = [latitude + 0.0006, longitude];
    let check = |order: &str, place: [f64; 2]| json!({"type": "check", "order": order, "robot": 1, "kind": "goto", "position": place, "altitude_m": altitude});
    let goto = |order: &str, place: [f64; 2], seen: &Value| {
        json!({"type": "order", "order": order, "robot": 1, "kind": "goto", "seen": seen, "position": place,
            "altitude_m": altitude, "confirm": null})
    };
    let mut other = view.page();
    let chart = other.until("the fence", |message| {
        message["type"] == "chart" && message["fence"][0]["name"] == "mast"
    });
    assert_eq!(
        (&chart["source"], &chart["fence"][0]["inclusion"]),
        (&json!("bridge"), &json!(false))
    );
    // On a machine that stood still, where the helicopter is may not be known at that moment: then the pilot asks
    // again.
    let mut attempts = 0..50;
    let mut number = || format!("a{}", attempts.next().expect("few attempts"));
    let mut ask = |page: &mut Page, place| loop {
        let number = number();
        page.send(&check(&number, place));
        let answer = page.until_type("check");
        assert_eq!(answer["order"], json!(number));
        if let Some(distance_m) = answer["distance_m"].as_f64() {
            return (answer, distance_m);
        }
    };
    let (good, distance_m) = ask(&mut page, near);
    assert!((20.0..25.0).contains(&distance_m), "{good}");
    assert_ne!(good["severity"], "alarm", "{good}");
    let (bad, _) = ask(&mut page, behind);
    assert_eq!(bad["severity"], "alarm", "{bad}");
    let first = bad["findings"][0]["text"].as_str().unwrap();
    assert!(first.contains("mast"), "{bad}");

    page.send(&json!({"type": "lease", "robot": 1, "action": "take"}));
    page.until("the lease", |message| {
        message["type"] == "lease" && message["holder"] == "you"
    });
    let seen = page.until_type("now")["n"].clone();
    let report = page.order(&goto("g1", behind, &seen));
    assert_eq!(report["stage"], "not-sent", "{report}");
    let report = loop {
        let seen = page.until_type("now")["n"].clone();
        let report = page.order(&goto(&number(), near, &seen));
        let text = report["text"].as_str().unwrap_or_default();
        if !text.contains("not known now") && !text.contains("2 s old") {
            break report;
        }
    };
    assert_eq!(report["stage"], "done", "{report}");
    view.end();
    flight.end();
}

#[test]
fn robots_that_come_are_shown_and_a_take_off_is_checked_by_the_preflight() {
    let rig = sandbox();
    let first = StandInBridge::start(&rig.domain);
    let view = View::start(&rig);
    let mut page = view.page();
    assert_eq!(page.until_type("hello")["robots"], json!([1]));
    let second = StandInBridge::start_for(&rig.domain, RobotId::new(7).unwrap());
    page.until("both robots", |message| {
        message["type"] == "robots" && message["robots"][1]["robot"] == 7
    });
    page.send(&json!({"type": "open", "token": view.token, "robot": 7, "rate_hz": 20}));
    page.until("robot 7", |message| {
        message["type"] == "past" && message["robot"] == 7
    });
    page.send(&json!({"type": "check", "order": "t1", "robot": 7, "kind": "takeoff", "position": null, "altitude_m": 10.0}));
    let check = page.until_type("check");
    assert_eq!(
        (&check["robot"], &check["severity"]),
        (&json!(7), &json!("alarm"))
    );
    let findings = check["findings"].as_array().unwrap();
    let has = |text: &str| {
        findings
            .iter()
            .any(|one| one["text"].as_str().unwrap().contains(text))
    };
    assert!(
        has("no telemetry came") && has("checks of the preflight passed"),
        "{check}"
    );
    view.end();
    drop((first, second));
}

/// To join robots takes the view longer than two samples of telemetry are apart.
#[test]
fn what_comes_while_robots_are_joined_is_of_no_unknown_age() {
    let rig = sandbox();
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let flight = Flight::begin(&rig);
    let view = View::start(&rig);
    let mut page = view.page();
    page.until("where it is", |message| {
        message["type"] == "now" && message["telemetry"]["freshness"] == "fresh"
    });
    let others: Vec<_> = (2..=MANY)
        .map(|robot| StandInBridge::start_for(&rig.domain, RobotId::new(robot).unwrap()))
        .collect();
    page.until("all robots", |message| {
        let text = message.to_string();
        assert!(!text.contains("unknown age"), "{text}");
        message["type"] == "robots" && message["robots"].as_array().unwrap().len() == MANY as usize
    });
    view.end();
    flight.end();
    drop(others);
}

#[test]
fn a_view_without_descriptors_turns_away_and_goes_on() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let port = free_port();
    let mut command = rig.command(["run", "view", "--port", &port.to_string()]);
    command.env("XDG_RUNTIME_DIR", rig.folder());
    let mut process = rig.spawn(command);
    process.wait_for_text("ready");
    // Not before it starts: it has inherited this program's files of shared memory, which count.
    // The limit is one of numbers, and what was inherited may have high ones.
    let open = fs::read_dir(format!("/proc/{}/fd", process.id())).unwrap();
    let numbers = open.map(|entry| {
        entry
            .unwrap()
            .file_name()
            .to_str()
            .unwrap()
            .parse()
            .unwrap()
    });
    let used: Vec<u64> = numbers.collect();
    let most = (0..).filter(|number| !used.contains(number)).nth(40);
    let limits = Rlimit {
        current: most,
        maximum: most,
    };
    prlimit(Pid::from_raw(process.id() as i32), Resource::Nofile, limits).unwrap();
    let crowd: Vec<TcpStream> = (0..80)
        .map(|_| TcpStream::connect(("127.0.0.1", port)).expect("room in the backlog"))
        .collect();
    process.wait_for_text("no file descriptor is left");
    drop(crowd);
    // The server sees one end after the other; until then it turns away.
    let own = format!("127.0.0.1:{port}");
    let comes = (0..100_000).find_map(|_| Page::upgrade(port, &own, None).ok());
    let mut page = comes.expect("a server that accepts again");
    page.send(&json!({"type": "open", "token": token(&rig, port), "robot": null, "rate_hz": 20}));
    assert_eq!(page.until_type("hello")["role"], "command");
    page.until_type("robot");
    end(process, Signal::TERM);
    drop(bridge);
}

#[test]
fn pages_of_others_get_nothing() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let view = View::start(&rig);
    let port = view.port;
    let own = format!("127.0.0.1:{port}");
    let evil = format!("evil.example:{port}");
    assert!(Page::upgrade(port, &own, Some("http://evil.example")).is_err());
    assert!(Page::upgrade(port, &own, Some("null")).is_err());
    assert!(Page::upgrade(port, &evil, Some(&format!("http://{evil}"))).is_err());
    let (status, _) = request(port, "/", &[("Host", &evil)]);
    assert!(!status.contains(" 200 "), "{status}");
    let (status, body) = request(port, "/", &[("Host", &own)]);
    assert!(status.contains(" 200 ") && body.contains("<!"), "{status}");
    assert!(!body.contains(&view.token));
    view.end();
    drop(bridge);
}

#[test]
fn tiles_come_from_their_folder_and_from_nowhere_else() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    for (name, bytes) in [
        ("imagery/18/5/7.png", &b"\x89PNG\r\n\x1a\nlow"[..]),
        ("imagery/19/10/14.jpg", b"\xff\xd8\xff\xe0high"),
        ("imagery/19/10/15.png", b"no image"),
        ("empty/note.txt", b"no tile"),
        ("secret.png", b"\x89PNG\r\n\x1a\nsecret"),
    ] {
        let path = rig.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    let view = View::start_with(&rig, "--tiles imagery");
    let hello = view.page().until_type("hello");
    assert_eq!(hello["tiles"], json!({"min_zoom": 18, "max_zoom": 19}));
    let host = format!("127.0.0.1:{}", view.port);
    let get = |path: &str| request(view.port, path, &[("Host", &host)]);
    for (path, status, end) in [
        ("/tiles/18/5/7", " 200 ", "low"),
        ("/tiles/19/10/14?2", " 200 ", "high"),
        ("/tiles/19/10/15", " 404 ", ""),
        ("/tiles/19/10/16", " 404 ", ""),
        ("/tiles/../secret", " 404 ", ""),
        ("/tiles/18/../../secret", " 404 ", ""),
    ] {
        let (found, body) = get(path);
        assert!(found.contains(status), "{path}: {found}");
        assert!(
            body.ends_with(end) && !body.contains("secret"),
            "{path}: {body}"
        );
    }
    view.end();
    // The folder of imagery, with rows that count from the south.
    let view = View::start_with(&rig, "--tiles imagery --tiles-tms");
    let host = format!("127.0.0.1:{}", view.port);
    for (row, status) in [(7, " 404 "), ((1 << 18) - 1 - 7, " 200 ")] {
        let path = format!("/tiles/18/5/{row}");
        let (found, _) = request(view.port, &path, &[("Host", &host)]);
        assert!(found.contains(status), "{path}: {found}");
    }
    view.end();
    for folder in ["empty", "missing"] {
        ril(
            &rig,
            &format!("run view --port {} --tiles {folder}", free_port()),
        )
        .exits(2)
        .err_says("has no tiles");
    }
    drop(bridge);
}

#[test]
fn the_command_finds_or_starts_a_view_opens_it_and_ends_it() {
    let rig = sandbox();
    let bridge = StandInBridge::start(&rig.domain);
    let port = free_port();
    ril(&rig, &format!("view --stop --port {port}")).exits(3);
    let started = ril(&rig, &format!("view --no-browser --port {port}")).exits(0);
    let token = token(&rig, port);
    let address = format!("http://127.0.0.1:{port}/#token={token}");
    assert_eq!(started.stdout, [&*address]);
    // The second one finds it.
    let found = ril(&rig, &format!("view --no-browser --port {port}")).exits(0);
    assert_eq!(found.stdout, started.stdout);
    let told = ril(&rig, &format!("view --json --port {port}")).exits(0);
    assert_eq!(json_of(&told.stdout[0])["address_with_token"], address);
    // A browser gets a file that leads there: its command line is no place for the token.
    let browser = rig.write(
        "browser",
        "#!/bin/sh\necho \"$@\" > args\ncp \"$1\" opened\n",
    );
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    fs::set_permissions(&browser, executable).unwrap();
    let mut command = rig.command(["view", "--port", &port.to_string()]);
    command
        .env("XDG_RUNTIME_DIR", rig.folder())
        .env("BROWSER", &browser);
    let shown = Process::spawn(&rig.domain, command).exits(0);
    assert!(!shown.stdout.concat().contains(&token), "{shown:#?}");
    // It is a process of its own, which this test cannot wait for: what it opens is on the command's way.
    let opened = rig.path(&format!("ril/view-{port}.html"));
    assert!(fs::read_to_string(&opened).unwrap().contains(&address));
    let mut page = Page::open(port, Some(&token));
    assert_eq!(page.until_type("hello")["role"], "command");
    ril(&rig, &format!("view --stop --port {port}")).exits(0);
    assert!(!run_file(&rig, port).exists() && !opened.exists());
    drop(bridge);
}

#[test]
fn a_port_that_is_in_use_is_said_with_its_holder() {
    let rig = sandbox();
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let finished = ril(&rig, &format!("run view --port {port}")).exits(1);
    finished.err_says(format!("port {port} is in use by "));
    finished.err_says(format!("(process {})", std::process::id()));
    // Started in the background, it says the same.
    let finished = ril(&rig, &format!("view --port {port} --no-browser")).exits(1);
    finished.err_says(format!("port {port} is in use by "));
    drop(listener);

    let view = View::start(&rig);
    let finished = ril(&rig, &format!("run view --port {}", view.port)).exits(1);
    finished.err_says(format!("(process {} of domain ", view.process.id()));
    view.end();
}

#[test]
fn a_view_that_was_killed_leaves_nothing_in_the_way() {
    let rig = sandbox();
    let view = View::start(&rig);
    let port = view.port;
    rig.kill(view.process);
    assert!(run_file(&rig, port).exists());
    ril(&rig, &format!("view --stop --port {port}")).exits(3);
    let mut again = ril(&rig, &format!("run view --port {port}"));
    again.wait_for_text("ready");
    assert_eq!(token(&rig, port), view.token, "its pages go on");
    end(again, Signal::INT);
    assert!(!rig.path("ril").exists(), "its folder is gone as well");
    rig.write("view.toml", "\n[request]\ntimeout = 1\n");
    ril(&rig, "run view --check-config")
        .exits(78)
        .err_says("view.toml:3: ");
}
