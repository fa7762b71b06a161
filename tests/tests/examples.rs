//! The programs of `examples/` in C, C++ and Python, built as their documentation says, against the real processes.
//!
//! What a language needs and this machine does not have is skipped, and that is told past the capture of the tests'
//! output: [`ril_tests::languages`].

mod lost_senders;

use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use ipc_types::code::{Reason, Stage};
use ipc_types::{Ipc, Publisher, Source, Waiter, fresh_request_id};
use ril_tests::languages::{
    Compiler, built, cargo, python, python_example, root, run, skip, target_folder,
};
use ril_tests::packages;
use ril_tests::process::{Finished, Line, Signal, WAIT_LIMIT};
use ril_tests::sandbox::{free_port, records_in};
use ril_tests::{Process, PtyFolder, Sandbox, Script, StandInStatus, TestDomain, UnreadOutput};

/// Simulated seconds for one of the host: a mission takes about a second.
const SPEED: u32 = 10;

fn ril() -> PathBuf {
    built().expect("cargo").join("ril")
}

/// What is wanted, or nothing after saying why not.
fn or_skip<T, E: AsRef<str>>(language: &str, found: Result<T, E>) -> Option<T> {
    found
        .inspect_err(|why| skip(&format!("the examples in {language}"), why.as_ref()))
        .ok()
}

/// The lines about requests and not about telemetry.
fn requests(finished: &Finished) -> Vec<&str> {
    let lines = finished.stdout.iter().map(String::as_str);
    lines.filter(|line| line.contains(": ")).collect()
}

/// A program takes off, flies and lands, with a simulated helicopter.
fn flies_a_mission(program: impl FnOnce() -> Command) {
    let rig = Sandbox::of(ril());
    let robot = rig.start_robot(1, SPEED);
    let finished = Process::spawn(&rig.domain, program()).exits(0);
    let requests = requests(&finished);
    let ends: Vec<_> = requests
        .iter()
        .filter(|line| line.ends_with(": done"))
        .collect();
    let expected = ["start: done", "take off: done", "go to: done", "land: done"];
    assert_eq!(ends, expected.iter().collect::<Vec<_>>(), "{finished:#?}");
    let is_in_the_air = |line: &String| line.ends_with("m, flying 1");
    assert!(finished.stdout.iter().any(is_in_the_air), "{finished:#?}");
    robot.end();
}

/// What is said when no bridge runs.
fn says_that_nothing_runs(command: Command, text: &str) {
    let domain = TestDomain::new();
    let finished = Process::spawn(&domain, command).exits(1);
    let is_told = finished.stderr.iter().any(|line| line.contains(text));
    assert!(is_told, "{finished:#?}");
}

/// A program that takes the height as its argument, built by `build`.
fn a_compiled_program_flies_a_mission(build: impl FnOnce(&Path)) {
    let folder = PtyFolder::new();
    let program = folder.link("example");
    build(&program);
    flies_a_mission(|| {
        let mut command = Command::new(&program);
        command.arg("5");
        command
    });
    says_that_nothing_runs(Command::new(&program), "start `ril run status`");
}

#[test]
fn a_program_in_c_flies_a_mission() {
    if let Some(compiler) = or_skip("C", Compiler::c()) {
        a_compiled_program_flies_a_mission(|to| compiler.with_shared_library("c/mission.c", to));
    }
}

#[test]
fn a_program_in_cpp_flies_a_mission() {
    if let Some(compiler) = or_skip("C++", Compiler::cpp()) {
        a_compiled_program_flies_a_mission(|to| {
            compiler.with_static_library("cpp/mission.cpp", to);
        });
    }
}

/// A module's own topic and request, as `examples/c/voltages.c` and `examples/c/gripper.c` have them too.
#[allow(unsafe_code)]
mod module {
    ipc_types::shared_struct! {
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
    ipc_types::topic!(Voltages, "battery_watch/cell_voltages");

    ipc_types::shared_struct! {
        /// Moves the fingers apart, or together.
        pub struct Move("gripper.Move.v1") = 16 {
            /// Chosen by the sender; every report repeats it.
            pub request_id: u64,
            /// Distance of the fingers.
            pub width_m: f64,
        }
    }
    ipc_types::request!(Move, "gripper/move");

    ipc_types::shared_struct! {
        /// Sets how often `examples/c/beacon.c` blinks.
        pub struct SetPeriod("beacon.SetPeriod.v1") = 16 {
            /// Chosen by the sender; every report repeats it.
            pub request_id: u64,
            /// From one blink to the next.
            pub period_s: f64,
        }
    }
    ipc_types::request!(SetPeriod, "beacon/period");

    ipc_types::shared_struct! {
        /// Sets the limit of `examples/python/battery_watch.py`.
        pub struct SetLimit("battery_watch.SetLimit.v1") = 16 {
            /// Chosen by the sender; every report repeats it.
            pub request_id: u64,
            /// Mean voltage of a cell below which a landing is commanded.
            pub limit_v: f64,
        }
    }
    ipc_types::request!(SetLimit, "battery_watch/limits");
}

/// What a program of `bindings/c/tests` says at its end.
fn passes(program: Command, how: &str) {
    let domain = TestDomain::new();
    let finished = Process::spawn(&domain, program).exits(0);
    let last = finished.stdout.last().map(String::as_str);
    assert_eq!(last, Some("passed"), "{how}: {finished:#?}");
}

#[test]
fn clients_in_c_and_cpp_send_whatever_they_have_read_and_wait_without_a_processor() {
    let folder = PtyFolder::new();
    if let Some(compiler) = or_skip("C", Compiler::c()) {
        let program = folder.link("in-c");
        compiler.with_shared_library("../bindings/c/tests/clients.c", &program);
        passes(Command::new(program), "C");
    }
    if let Some(compiler) = or_skip("C++", Compiler::cpp()) {
        let program = folder.link("in-cpp");
        compiler.with_static_library("../bindings/c/tests/clients.cpp", &program);
        passes(Command::new(program), "C++");
    }
}

#[test]
fn a_client_in_c_makes_no_wrong_access_to_memory() {
    let Some(compiler) = or_skip("C", Compiler::c()) else {
        return;
    };
    let folder = PtyFolder::new();
    let source = "../bindings/c/tests/clients.c";
    let program = folder.link("in-c");
    compiler.with_shared_library(source, &program);
    let mut valgrind = Command::new("valgrind");
    match valgrind.arg("--version").output() {
        Ok(_) => {
            let mut valgrind = Command::new("valgrind");
            // Values: iceoryx2 compares unused bytes of its ids, which are the same in every copy.
            valgrind
                .args(["--quiet", "--error-exitcode=9", "--undef-value-errors=no"])
                .arg(&program);
            passes(valgrind, "valgrind");
        }
        Err(why) => skip("C programs under valgrind", &why.to_string()),
    }
    let program = folder.link("sanitized");
    match compiler.sanitized(source, &program) {
        Ok(()) => {
            let mut sanitized = Command::new(&program);
            // A forked child leaks what its parent made, on purpose.
            sanitized.env("ASAN_OPTIONS", "detect_leaks=0");
            passes(sanitized, "address sanitizer");
        }
        Err(why) => skip("C programs with the address sanitizer", &why),
    }
}

#[test]
fn a_topic_of_a_module_goes_from_rust_to_c_and_from_c_to_c() {
    let Some(compiler) = or_skip("C", Compiler::c()) else {
        return;
    };
    let folder = PtyFolder::new();
    let program = folder.link("example");
    compiler.with_shared_library("c/voltages.c", &program);
    let start = |domain: &TestDomain, what: &str, count: &str| {
        let mut command = Command::new(&program);
        command.args([what, count]);
        Process::spawn(domain, command)
    };

    let domain = TestDomain::new();
    let ipc: Ipc = domain.join("battery-watch");
    let mut consumer = start(&domain, "print", "2");
    consumer.wait_for_text("subscribed");
    let mut publisher: Publisher<module::Voltages> = ipc.publisher().unwrap();
    let sample = |sample: &mut module::Voltages| sample.cells = [3.5; 12];
    publisher.publish(sample).unwrap();
    // The consumer joins now, or has: the publisher gives it the latest sample in its wait.
    let waiter = Waiter::new();
    let watchdog = Instant::now() + WAIT_LIMIT;
    let is_shown = |line: &Line| line.text.contains("1 3.50 V to 3.50 V");
    while !consumer.lines().iter().any(is_shown) {
        assert!(Instant::now() < watchdog, "{:?}", consumer.lines());
        let ports: &mut [(_, &mut dyn Source)] = &mut [((), &mut publisher)];
        waiter.wait(ports, Some(Duration::from_millis(20))).unwrap();
    }
    publisher.publish(sample).unwrap();
    let finished = consumer.wait_exit();
    assert_eq!(finished.stdout.last().unwrap(), "2 3.50 V to 3.50 V");
    drop((publisher, ipc));

    let mut consumer = start(&domain, "print", "2");
    consumer.wait_for_text("subscribed");
    let mut publisher = start(&domain, "publish", "1000");
    let finished = consumer.exits(0);
    assert_eq!(finished.stdout.last().unwrap(), "2 3.70 V to 3.81 V");
    publisher.signal(Signal::KILL);
    publisher.wait_exit();
    domain.sweep();
}

/// The program `gripper` in one language.
struct Gripper {
    language: &'static str,
    /// The interpreter, if there is one, and the program.
    program: Vec<PathBuf>,
}

impl Gripper {
    fn start(&self, domain: &TestDomain, arguments: &[&str]) -> Process {
        let mut command = Command::new(&self.program[0]);
        command.args(&self.program[1..]).args(arguments);
        Process::spawn(domain, command)
    }
}

/// In every language that this machine has.
fn grippers(folders: &[PtyFolder; 2]) -> Vec<Gripper> {
    let mut grippers = Vec::new();
    let mut add = |language, program| grippers.push(Gripper { language, program });
    if let Some(compiler) = or_skip("C", Compiler::c()) {
        let program = folders[0].link("example");
        compiler.with_shared_library("c/gripper.c", &program);
        add("C", vec![program]);
    }
    if let Some(compiler) = or_skip("C++", Compiler::cpp()) {
        let program = folders[1].link("example");
        compiler.with_static_library("cpp/gripper.cpp", &program);
        add("C++", vec![program]);
    }
    if let Some(python) = or_skip("Python", python()) {
        let gripper = root().join("examples/python/gripper.py");
        add("Python", vec![python.to_owned(), "-u".into(), gripper]);
    }
    grippers
}

/// A request from Rust: accepted, progress in steps, done; and one that is given up in the middle.
fn moves_the_gripper(domain: &TestDomain, gripper: &mut Process, language: &str) {
    let ipc: Ipc = domain.join("operator");
    let mut client = ipc.client::<module::Move>().unwrap();
    let order = |width_m| module::Move {
        request_id: fresh_request_id(),
        width_m,
    };
    let mut moving = client.request(&order(0.0025)).unwrap();
    let mut reports = Vec::new();
    while let Some(report) = moving.recv_timeout(WAIT_LIMIT).unwrap() {
        reports.push((report.stage().unwrap(), report.value));
    }
    let expected = [
        (Stage::Accepted, 0.0),
        (Stage::Progress, 0.001),
        (Stage::Progress, 0.002),
        (Stage::Done, 0.0025),
    ];
    assert_eq!(reports, expected, "served in {language}");
    drop(moving);

    let refused = client
        .request(&order(1.0))
        .unwrap()
        .result_timeout(WAIT_LIMIT)
        .unwrap();
    let refused = refused.expect("a result");
    assert_eq!(refused.reason(), Some(Reason::OutOfRange));
    let mut long = client.request(&order(0.1)).unwrap();
    let first = long.recv_timeout(WAIT_LIMIT).unwrap().unwrap();
    assert_eq!(first.stage(), Some(Stage::Accepted));
    drop(long);
    gripper.wait_for_text("given up");
}

#[test]
fn a_request_of_a_module_is_served_and_sent_in_every_language() {
    let folders = [PtyFolder::new(), PtyFolder::new()];
    let grippers = grippers(&folders);
    for server in &grippers {
        let domain = TestDomain::new();
        let mut serving = server.start(&domain, &["serve"]);
        serving.wait_for_text("serving");
        moves_the_gripper(&domain, &mut serving, server.language);
        for client in &grippers {
            let what = format!("{} to {}", client.language, server.language);
            for width_m in ["0.05", "0.047"] {
                let moved = client.start(&domain, &["move", width_m]).exits(0);
                let last = moved.stdout.last().unwrap();
                assert!(
                    last.starts_with(&format!("done: {width_m}")),
                    "{what}: {last}"
                );
            }
            client.start(&domain, &["move", "-1"]).exits(1);
        }
        serving.signal(Signal::TERM);
        serving.exits(0);
    }
}

#[test]
fn a_module_whose_standard_error_nobody_reads_serves_and_ends_in_every_language() {
    let folders = [PtyFolder::new(), PtyFolder::new()];
    for Gripper { language, program } in grippers(&folders) {
        let rig = Sandbox::new(program, language, 2 * WAIT_LIMIT);
        let _log = UnreadOutput::full(&rig);
        let line = format!(
            "RIL_LOG=trace exec \"$0\" \"$@\" serve 2>{}",
            UnreadOutput::NAME
        );
        let mut serving = rig.spawn(rig.shell(&line));
        serving.wait_for_text("serving");
        moves_the_gripper(&rig.domain, &mut serving, language);
        serving.signal(Signal::TERM);
        serving.exits(0);
    }
}

/// A program shows a robot that stands, until it is ended.
fn prints_telemetry(domain: &TestDomain, program: Command) {
    let mut printing = Process::spawn(domain, program);
    printing.wait_for_text("m, flying 0, 0 lost");
    printing.signal(Signal::INT);
    printing.exits(0);
}

#[test]
fn a_program_in_c_prints_telemetry_and_ends_in_order() {
    let Some(compiler) = or_skip("C", Compiler::c()) else {
        return;
    };
    let folder = PtyFolder::new();
    let program = folder.link("example");
    compiler.with_shared_library("c/print_telemetry.c", &program);
    let rig = Sandbox::of(ril());
    let robot = rig.start_robot(1, SPEED);
    prints_telemetry(&rig.domain, Command::new(&program));
    let finished = Process::start(&rig.domain, &program, ["2"]).wait_exit();
    assert_eq!(finished.stdout.len(), 2, "{finished:#?}");
    robot.end();
}

#[test]
fn the_python_package_does_what_its_tests_say() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    for tests in ["test_hero_ril.py", "test_flight.py"] {
        let domain = TestDomain::new();
        let mut command = Command::new(python);
        command
            .arg("-B")
            .arg(root().join("bindings/python/tests").join(tests));
        Process::spawn(&domain, command).exits(0);
    }
}

#[test]
fn a_program_in_python_plots_a_recorded_flight() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    let rig = Sandbox::of(ril());
    let robot = rig.start_robot(1, SPEED);
    let mut recorder = rig.start("record --min-free 0 --output log");
    recorder.wait_for_text("recording file=");
    for order in ["start", "takeoff --altitude 5", "land"] {
        rig.run(order, 0);
    }
    recorder.end();
    let picture = rig.path("flight.png");
    let mut plot = python_example(python, "plot_flight.py");
    plot.arg(rig.path("log/*.mcap"))
        .arg(&picture)
        .env("MPLBACKEND", "Agg")
        .env("MPLCONFIGDIR", rig.folder());
    let finished = rig.spawn(plot).exits(0);
    assert!(
        std::fs::metadata(&picture).is_ok_and(|file| file.len() > 10_000),
        "{finished:#?}"
    );
    robot.end();
}

#[test]
fn each_name_of_a_topic_is_understood_wherever_a_topic_is_named() {
    const NAMES: [&str; 9] = [
        "dsp",
        "dsp_telemetry",
        "dsp/telemetry",
        "hero",
        "hero_telemetry",
        "hero/telemetry",
        "state",
        "module_state",
        "bridge/state",
    ];
    let rig = Sandbox::of(ril());
    let robot = rig.start_robot(1, SPEED);
    let mut recorder = rig.start("record --min-free 0 --output log");
    recorder.wait_for_text("recording file=");
    for name in NAMES {
        let mut layouts = NAMES.chunks(3).zip(["Dsp", "Hero", "ModuleState"]);
        let (_, layout) = layouts.find(|(names, _)| names.contains(&name)).unwrap();
        let finished = rig.run(&format!("echo {name} --count 1 --json"), 0);
        finished.out_says(format!("\"schema\":\"hero.{layout}"));
    }
    let found = or_skip("Python", python());
    let run = |program: &str, first: &str| {
        let Some(python) = found else { return };
        let mut command = Command::new(python);
        command.args(["-B", "-c", program, first]).args(NAMES);
        rig.spawn(command).exits(0);
    };
    run(
        "import sys, hero_ril\n\
         with hero_ril.Robot() as robot:\n\
         \x20   for name in sys.argv[2:]: assert robot.subscribe(name).receive().sequence, name\n",
        "",
    );
    recorder.end();
    let files = records_in(&rig.path("log"));
    let file = files[0].to_str().unwrap();
    for (index, name) in NAMES.into_iter().enumerate() {
        let export = format!("log export {file} --topic {name} --output {index}.mcap");
        let finished = rig.run(&export, 0);
        assert!(
            !finished.stdout[0].ends_with(": 0 messages"),
            "{finished:#?}"
        );
    }
    run(
        "import sys, hero_ril\n\
         flight = hero_ril.Flight(sys.argv[1])\n\
         for name in sys.argv[2:]: assert len(flight[name]), name\n",
        file,
    );
    robot.end();
}

#[test]
fn a_program_in_python_flies_a_mission() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    flies_a_mission(|| {
        let mut command = python_example(python, "mission.py");
        command.arg("5");
        command
    });
    says_that_nothing_runs(
        python_example(python, "mission.py"),
        "start `ril run status`",
    );
}

#[test]
fn a_program_in_python_prints_telemetry_and_ends_in_order() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    let rig = Sandbox::of(ril());
    let robot = rig.start_robot(1, SPEED);
    let mut asynchronous = python_example(python, "mission_async.py");
    asynchronous.arg("3");
    let mission = Process::spawn(&rig.domain, asynchronous).exits(0);
    assert!(
        mission.stdout.contains(&"land: done".to_owned()),
        "{mission:#?}"
    );
    prints_telemetry(&rig.domain, python_example(python, "print_telemetry.py"));
    robot.end();
}

/// Runs `ril` to its end: its exit code and what it has printed.
fn run_ril(domain: &TestDomain, arguments: &[&str]) -> (Option<i32>, String) {
    let finished = Process::start(domain, ril(), arguments).wait_exit();
    let text = [finished.stdout.join("\n"), finished.stderr.join("\n")].join("\n");
    (finished.code(), text)
}

#[test]
fn a_module_in_c_keeps_the_rules_of_the_kit_and_carries_each_request_out_once() {
    if let Some(compiler) = or_skip("C", Compiler::c()) {
        let folder = PtyFolder::new();
        let program = folder.link("beacon");
        compiler.with_shared_library("c/beacon.c", &program);
        keeps_the_rules(&folder, &program);
    }
}

#[test]
fn a_module_in_cpp_keeps_the_same_rules() {
    if let Some(compiler) = or_skip("C++", Compiler::cpp()) {
        let folder = PtyFolder::new();
        let program = folder.link("beacon");
        compiler.with_static_library("cpp/beacon.cpp", &program);
        keeps_the_rules(&folder, &program);
    }
}

/// A beacon is started, stopped and asked.
fn keeps_the_rules(folder: &PtyFolder, program: &Path) {
    let domain = TestDomain::new();
    let supervisor = UnixDatagram::bind(folder.link("notify")).unwrap();
    supervisor.set_read_timeout(Some(WAIT_LIMIT)).unwrap();
    let told = || {
        let mut text = [0; 64];
        let length = supervisor.recv(&mut text).unwrap();
        String::from_utf8(text[..length].to_vec()).unwrap()
    };
    let mut command = Command::new(program);
    command.env("NOTIFY_SOCKET", folder.link("notify"));
    let mut beacon = Process::spawn(&domain, command);
    assert_eq!(told(), "READY=1");
    let ipc: Ipc = domain.join("operator");
    let mut client = ipc.client::<module::SetPeriod>().unwrap();
    let mut set = |request_id, period_s| {
        let request = module::SetPeriod {
            request_id,
            period_s,
        };
        let mut handle = client.request(&request).unwrap();
        let report = handle.result_timeout(WAIT_LIMIT).unwrap().unwrap();
        (report.stage(), report.reason())
    };
    let (first, second) = (fresh_request_id(), fresh_request_id());
    let done = (Some(Stage::Done), Some(Reason::None));
    assert_eq!(set(first, 0.02), done);
    assert_eq!(set(second, 0.03), done);
    // Sent again: answered from memory.
    assert_eq!(set(first, 0.02), done);
    assert_eq!(set(fresh_request_id(), 99.0).1, Some(Reason::OutOfRange));

    let control = |what| run_ril(&domain, &[what, "--module", "beacon"]);
    assert_eq!(control("start").0, Some(0));
    beacon.wait_for_text("blink");
    let (code, text) = control("start");
    assert_eq!(code, Some(5), "{text}");
    assert!(text.contains("already-running"), "{text}");
    assert_eq!(control("stop").0, Some(0));
    let echo = ["topic", "echo", "beacon/state", "--count", "1", "--json"];
    let (_, state) = run_ril(&domain, &echo);
    assert!(state.contains("\"module_id\":1002"), "{state}");
    assert!(state.contains("\"blocked\":1"), "{state}");
    let mut another = Process::spawn(&domain, Command::new(program));
    let refused = another.wait_exit();
    assert_eq!(refused.code(), Some(1));
    let errors = refused.stderr.join("\n");
    assert!(errors.contains("already provided by `beacon`"), "{errors}");
    beacon.signal(Signal::TERM);
    assert_eq!(told(), "STOPPING=1");
    let finished = beacon.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    let periods: Vec<_> = finished
        .stdout
        .iter()
        .filter(|line| line.starts_with("period"))
        .collect();
    assert_eq!(periods, ["period 0.02 s", "period 0.03 s"]);
    assert!(finished.stdout.contains(&"dark".to_owned()));
}

#[test]
fn a_module_in_python_is_started_stopped_and_configured_as_one_in_rust() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    let rig = Sandbox::of(ril());
    let file = rig.path("battery_watch.toml");
    let module = |arguments: &[&str]| {
        let mut command = python_example(python, "battery_watch.py");
        command.arg("--config").arg(&file).args(arguments);
        Process::spawn(&rig.domain, command)
    };
    for (text, expected) in [
        (
            "cells = 6\nlimitv = 3.0\n",
            ":2: unknown field `limitv`: did you mean `limit_v`?",
        ),
        (
            "limit_v = 9.0\n",
            ":1: `limit_v` is 9.0: it must be from 2.5 to 4.2",
        ),
        (
            "cells = \"six\"\n",
            ":1: `cells` is 'six': it must be a int",
        ),
    ] {
        std::fs::write(&file, text).unwrap();
        let refused = module(&[]).wait_exit();
        let errors = refused.stderr.join("\n");
        assert_eq!(refused.code(), Some(78), "{errors}");
        assert!(errors.contains(expected), "{errors}");
    }
    std::fs::write(&file, "limit_v = 4\n").unwrap();
    assert_eq!(module(&["--check-config"]).wait_exit().code(), Some(0));
    assert_eq!(module(&["--robot", "0"]).wait_exit().code(), Some(2));

    let robot = rig.start_robot(1, SPEED);
    let mut watch = module(&[]);
    watch.wait_for_text("ready");
    let again = module(&[]).wait_exit();
    assert_eq!(again.code(), Some(1), "{again:#?}");
    let errors = again.stderr.join("\n");
    assert!(
        errors.contains("already provided by `battery_watch`"),
        "{errors}"
    );
    let run = |line: &str| rig.run(line, 0).stdout.join("\n");
    let topics = run("topic list");
    assert!(topics.contains("battery_watch/cells") && topics.contains("battery_watch/state"));
    let cells = run("topic echo battery_watch/cells --count 1 --json");
    assert!(cells.contains("\"limit_v\":4.0"));
    run("start");
    run("takeoff 4m");
    // Cells of a simulated battery have less than 4.2 V.
    let ipc: Ipc = rig.domain.join("operator");
    let mut limits = ipc.client::<module::SetLimit>().unwrap();
    let set = module::SetLimit {
        request_id: fresh_request_id(),
        limit_v: 4.2,
    };
    let mut set = limits.request(&set).unwrap();
    let set = set.result_timeout(WAIT_LIMIT).unwrap().unwrap();
    assert_eq!(set.stage(), Some(Stage::Done));
    run("start --module battery_watch");
    watch.wait_for_text("doing=\"landing\"");
    watch.wait_for_text("status=ended");
    run("stop --module battery_watch");
    watch.signal(Signal::TERM);
    let finished = watch.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    rig.run("stop --module battery_watch", 3);
    robot.end();
}

/// What `ril topic generate` made of `examples/msg/Pack.msg`.
mod made {
    include!("../../examples/msg/pack.rs");
}

#[test]
fn one_command_makes_the_same_struct_for_every_language() {
    let domain = TestDomain::new();
    let folder = PtyFolder::new();
    let examples = root().join("examples/msg");
    let definition = examples.join("Pack.msg");
    let generate = |into: &str| {
        let file = definition.to_str().unwrap();
        run_ril(&domain, &["topic", "generate", file, "--output", into])
    };
    let into = folder.link("made");
    std::fs::create_dir(&into).unwrap();
    let (code, text) = generate(into.to_str().unwrap());
    assert_eq!(code, Some(0), "{text}");
    for name in ["pack.rs", "pack.h", "pack.py"] {
        let read = |path: PathBuf| std::fs::read_to_string(path).unwrap();
        let (made, kept) = (read(into.join(name)), read(examples.join(name)));
        assert!(made == kept, "{name} is not what the command makes: {made}");
    }
    // It replaces its own files and no other.
    std::fs::write(into.join("pack.h"), "/* by hand */\n").unwrap();
    let (code, text) = generate(into.to_str().unwrap());
    assert_eq!(code, Some(1));
    assert!(text.contains("did not make it"), "{text}");

    use ipc_types::payload::SharedStruct;
    let schema = ipc_types::Schema::of::<made::Pack>();
    let text = std::fs::read_to_string(&definition).unwrap();
    let parsed = ipc_types::Schema::parse(&text).unwrap();
    assert_eq!(schema.layout_hash(), parsed.layout_hash());
    assert_eq!(made::Pack::ZERO.cells.len(), 6);
    let main = "#include \"pack.h\"\n#include <stdio.h>\n\
        int main(void) { fputs(BATTERY_WATCH_PACK_SCHEMA, stdout); return sizeof(Pack) != 72; }\n";
    let mut compilers = Vec::new();
    compilers.extend(or_skip("C", Compiler::c()).map(|compiler| ("c", compiler)));
    compilers.extend(or_skip("C++", Compiler::cpp()).map(|compiler| ("cpp", compiler)));
    for (ending, compiler) in compilers {
        let source = folder.link(&format!("main.{ending}"));
        std::fs::write(&source, main).unwrap();
        std::fs::copy(examples.join("pack.h"), folder.link("pack.h")).unwrap();
        let program = folder.link(&format!("in-{ending}"));
        compiler.with_static_library(source.to_str().unwrap(), &program);
        let printed = Process::spawn(&domain, Command::new(program)).wait_exit();
        assert_eq!(printed.code(), Some(0), "{printed:#?}");
        assert_eq!(printed.stdout, text.lines().collect::<Vec<_>>());
    }
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    let mut command = Command::new(python);
    let program = "import ctypes, sys, hero_ril, pack; sys.stdout.write(hero_ril.schema_of(pack.Pack)); \
        assert ctypes.sizeof(pack.Pack) == 72";
    command
        .args(["-B", "-c", program])
        .env("PYTHONPATH", &examples);
    let printed = Process::spawn(&domain, command).wait_exit();
    assert_eq!(printed.code(), Some(0), "{printed:#?}");
    assert_eq!(printed.stdout, text.lines().collect::<Vec<_>>());
}

#[test]
fn mypy_finds_a_field_that_is_misspelt() {
    let folder = PtyFolder::new();
    let found = packages::python("mypy");
    let Some(python) = or_skip("Python, by mypy", found) else {
        return;
    };
    let domain = TestDomain::new();
    let program = folder.link("program.py");
    let text = |field: &str, cell: &str| {
        format!(
            "import hero_ril\nimport pack\n\n\
             with hero_ril.Robot() as robot:\n\
             \x20   cells = robot.advertise(\"battery_watch/cells\", pack.Pack)\n\
             \x20   for sample in robot.telemetry():\n\
             \x20       print(sample.geodetic.{field})\n\
             \x20       battery = pack.Pack(charge=0.5)\n\
             \x20       battery.cells[0].{cell} = 3.5\n\
             \x20       cells.publish(battery)\n"
        )
    };
    let check = |field, cell| {
        std::fs::write(&program, text(field, cell)).unwrap();
        let mut mypy = Command::new(&python);
        let path = [
            root().join("bindings/python/python"),
            root().join("examples/msg"),
        ];
        mypy.args(["-m", "mypy", "--strict", "--no-incremental"])
            .arg(&program)
            .env("MYPYPATH", std::env::join_paths(path).unwrap());
        let finished = Process::spawn(&domain, mypy).wait_exit();
        (finished.code(), finished.stdout.join("\n"))
    };
    let (code, text) = check("altitude_m", "voltage_v");
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = check("altitud_m", "voltag_v");
    assert_eq!(code, Some(1));
    for expected in [
        "\"HeroGeodetic\" has no attribute \"altitud_m\"",
        "\"Cell\" has no attribute \"voltag_v\"",
    ] {
        assert!(text.contains(expected), "{text}");
    }
}

/// The blocks of a page in one language, without what they are indented by.
fn fragments(page: &str, language: &str) -> Vec<String> {
    let page = std::fs::read_to_string(root().join(page)).unwrap();
    let parts = page.split("```").skip(1).step_by(2);
    let texts = parts.filter_map(|part| part.strip_prefix(language)?.strip_prefix('\n'));
    let found: Vec<String> = texts
        .map(|text| {
            let first = text.trim_start_matches(' ');
            let indent = &text[..text.len() - first.len()];
            let lines = text
                .lines()
                .map(|line| line.strip_prefix(indent).unwrap_or(line));
            lines.map(|line| format!("{line}\n")).collect()
        })
        .collect();
    assert!(!found.is_empty(), "no {language}");
    found
}

#[test]
fn the_first_minute_shows_how_high_the_helicopter_is_in_every_language() {
    let folder = PtyFolder::new();
    let first = |language| fragments("docs/consumers.md", language).swap_remove(0);
    let write = |name: &str, text: String| {
        let source = folder.link(name);
        std::fs::write(&source, text).unwrap();
        source
    };
    let mut programs = Vec::new();
    let c = or_skip("C", Compiler::c()).map(|found| (found, "c"));
    let cpp = or_skip("C++", Compiler::cpp()).map(|found| (found, "cpp"));
    for (compiler, language) in c.into_iter().chain(cpp) {
        let source = write(&format!("first.{language}"), first(language));
        let program = folder.link(&format!("first-{language}"));
        compiler.with_static_library(source.to_str().unwrap(), &program);
        programs.push(vec![program]);
    }
    if let Some(python) = or_skip("Python", python()) {
        let source = write("first.py", first("python"));
        programs.push(vec![python.to_owned(), "-u".into(), source]);
    }
    for program in programs {
        let domain = TestDomain::new();
        let status = StandInStatus::start(&domain);
        for sample in Script::at(37.4, -5.9, 12.5).stand(0.1).hero() {
            status.publish(&sample);
        }
        // Its output has lines only when it is a terminal's: the program ends, or is asked to, and tells all.
        let mut command = Command::new("stdbuf");
        let mut process = Process::spawn(&domain, {
            command.arg("-oL").args(&program);
            command
        });
        process.wait_for_text("12.5 m");
        process.signal(Signal::KILL);
        process.wait_exit();
        drop(status);
        domain.sweep();
    }
}

#[test]
fn the_conveyor_belt_tests_itself_in_every_language() {
    let (folder, domain) = (PtyFolder::new(), TestDomain::new());
    let c = or_skip("C", Compiler::c()).map(|found| (found, "c/conveyor_test.c"));
    let cpp = or_skip("C++", Compiler::cpp()).map(|found| (found, "cpp/conveyor_test.cpp"));
    for (index, (compiler, source)) in c.into_iter().chain(cpp).enumerate() {
        let program = folder.link(&format!("conveyor-{index}"));
        compiler.with_static_library(source, &program);
        let mut process = Process::start::<&str>(&domain, &program, []);
        process.exits(0).out_says("ok");
    }
    if let Some(python) = or_skip("Python", python()) {
        let test = root().join("examples/python/test_conveyor.py");
        let mut command = Command::new(python);
        command.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]);
        Process::spawn(&domain, {
            command.arg(test);
            command
        })
        .exits(0);
    }
}

/// What the template of `ril new module` in Rust needs to share what the workspace has built.
const PROFILE: &str = "
[profile.dev]
debug = \"line-tables-only\"
[profile.dev.package]
\"*\" = { debug = false }
ipc-types = { debug = \"line-tables-only\", opt-level = 2 }
ipc-fixtures = { debug = \"line-tables-only\", opt-level = 2 }
module-kit = { debug = \"line-tables-only\", opt-level = 2 }
ril-runtime = { debug = \"line-tables-only\" }
postcard = { opt-level = 1 }
";

#[test]
fn a_new_module_builds_and_passes_its_test_in_every_language() {
    let (rig, domain) = (Sandbox::of(ril()), TestDomain::new());
    let at = |path: &str| rig.path(path);
    let begin = |name: &str, language: &str| {
        let repository = root();
        rig.run(
            &format!(
                "new module {name} --lang {language} --ril {}",
                repository.display()
            ),
            0,
        )
    };
    begin("belt_rust", "rust");
    let manifest = at("belt_rust/Cargo.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, text + PROFILE).unwrap();
    std::fs::copy(root().join("Cargo.lock"), at("belt_rust/Cargo.lock")).unwrap();
    let mut command = cargo();
    command.args(["test", "--quiet", "--offline", "--target-dir"]);
    command
        .arg(target_folder())
        .arg("--manifest-path")
        .arg(&manifest);
    run(&mut command).unwrap();
    rig.run("new module belt_rust", 2)
        .err_says("exists already");

    if let Some(python) = or_skip("Python", python()) {
        begin("belt_python", "python");
        let mut command = Command::new(python);
        command.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]);
        command.arg(at("belt_python"));
        Process::spawn(&domain, command).exits(0);
    }
    if let Some(compiler) = or_skip("C++", Compiler::cpp()) {
        begin("belt_cpp", "cpp");
        let [module, test] = ["belt_cpp", "test_belt_cpp"].map(|name| {
            let program = at(&format!("belt_cpp/{name}"));
            let source = at(&format!("belt_cpp/{name}.cpp"));
            compiler.with_static_library(source.to_str().unwrap(), &program);
            program
        });
        Process::start(&domain, test, [module]).exits(0);
    }
}

/// Reads the metrics at the address as Prometheus does, and prints each sample.
const PROMETHEUS: &str = "
import sys, urllib.request
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse
answer = urllib.request.urlopen(sys.argv[1])
assert answer.headers['Content-Type'].startswith('application/openmetrics-text')
for family in parse(answer.read().decode()):
    for sample in family.samples:
        print(family.type, family.unit, sample.name, sample.labels['robot'], sample.value)
";

#[test]
fn prometheus_reads_the_metrics_of_a_live_view() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    let rig = Sandbox::of(ril());
    let robot = rig.start_robot(1, 1);
    let port = free_port();
    let view = rig.start_ready(&format!("run view --port {port}"));
    let address = format!("http://localhost:{port}/metrics");
    let read = || {
        let mut command = Command::new(python);
        command.args(["-c", PROMETHEUS, &address]);
        Process::spawn(&rig.domain, command).exits(0).stdout
    };
    // The view looks for robots once in a while.
    let is_up = |lines: &[String]| lines.iter().any(|line| line == "gauge  hero_link_up 1 1");
    let deadline = Instant::now() + WAIT_LIMIT;
    let mut lines = read();
    while !is_up(&lines) && Instant::now() < deadline {
        lines = read();
    }
    assert!(is_up(&lines), "{lines:#?}");
    let counted = "counter bytes hero_link_received_bytes_total 1 ";
    assert!(
        lines.iter().any(|line| line.starts_with(counted)),
        "{lines:#?}"
    );
    view.end();
    robot.end();
}

#[test]
fn the_fragments_of_the_page_about_c_and_cpp_compile() {
    let folder = PtyFolder::new();
    let page = "bindings/c/README.md";
    let mut programs = Vec::new();
    let c = or_skip("C", Compiler::c()).map(|found| (found, "c", "hero_ril.h"));
    let cpp = or_skip("C++", Compiler::cpp()).map(|found| (found, "cpp", "hero_ril.hpp"));
    for (compiler, language, header) in c.into_iter().chain(cpp) {
        for fragment in fragments(page, language) {
            let source = folder.link(&format!("{}.{language}", programs.len()));
            let text = format!(
                "#include <stdio.h>\n#include <{header}>\nint main(void) {{\n{fragment}return 0;\n}}\n"
            );
            std::fs::write(&source, text).unwrap();
            compiler.with_static_library(
                source.to_str().unwrap(),
                &folder.link(&format!("program-{}", programs.len())),
            );
            programs.push(source);
        }
    }
}

/// Runs the fragments of bindings/python/README.md one after the other. One that goes on for ever is left after ten
/// lines; a request comes as soon as it is served.
const FRAGMENTS: &str = r#"
import builtins, ctypes, sys, threading
import hero_ril

class Enough(Exception):
    pass

lines = []

def show(*words):
    lines.append(words)
    if len(lines) >= 10:
        raise Enough

class SetLimit(ctypes.Structure):
    _fields_ = [("request_id", ctypes.c_uint64), ("least_v", ctypes.c_double)]

    @staticmethod
    def type_name():
        return "battery_watch.SetLimit.v1"

def ask():
    with hero_ril.Robot(name="client") as client:
        client.send("battery_watch/limits", SetLimit(least_v=3.5)).wait()

class Robot(hero_ril.Robot):
    def serve(self, key, struct):
        server = super().serve(key, struct)
        threading.Thread(target=ask).start()
        yield next(iter(server))
        server.close()

limits = []
with Robot(name="page") as robot:
    names = {"ctypes": ctypes, "hero_ril": hero_ril, "print": show, "robot": robot, "SetLimit": SetLimit,
             "set_limit": limits.append, "control": lambda: show("tick")}
    for number, path in enumerate(sys.argv[1:]):
        lines.clear()
        # The first one has a robot of its own.
        scope = {"print": show} if number == 0 else names
        try:
            exec(compile(open(path).read(), path, "exec"), scope)
        except Enough:
            pass
        builtins.print("ran", path)
assert limits == [3.5], limits
"#;

#[test]
fn the_fragments_of_the_page_about_python_run() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    let rig = Sandbox::of(ril());
    let mut recorder = rig.start("record --min-free 0 --output log");
    recorder.wait_for_text("recording file=");
    let robot = rig.start_robot(1, SPEED);
    let mut command = Command::new(python);
    command.arg("-B").arg(rig.write("fragments.py", FRAGMENTS));
    let fragments = fragments("bindings/python/README.md", "python");
    let (flight, live): (Vec<_>, Vec<_>) = fragments
        .iter()
        .partition(|text| text.contains("flight.mcap"));
    for (number, fragment) in live.iter().enumerate() {
        command.arg(rig.write(&format!("{number}.py"), fragment));
    }
    let finished = rig.spawn(command).exits(0);
    assert_eq!(finished.stdout.len(), live.len(), "{finished:#?}");
    recorder.end();
    let records = records_in(&rig.path("log"));
    std::fs::rename(&records[0], rig.path("flight.mcap")).unwrap();
    for fragment in flight {
        let mut command = Command::new(python);
        command
            .args(["-B", "-c", fragment])
            .env("MPLBACKEND", "Agg")
            .env("MPLCONFIGDIR", rig.folder());
        rig.spawn(command).exits(0);
    }
    robot.end();
}

/// Installs what is built already, with a stand-in for cargo, and says which name the library was to get.
fn install(folder: &PtyFolder) -> Result<String, &'static str> {
    use std::os::unix::fs::PermissionsExt;
    let (tools, name) = (folder.link("tools"), folder.link("soname"));
    std::fs::create_dir(&tools).unwrap();
    let cargo = tools.join("cargo");
    std::fs::write(
        &cargo,
        "#!/bin/sh\nprintf %s \"$HERO_RIL_SONAME\" > \"$SONAME_TO\"\n",
    )
    .unwrap();
    std::fs::set_permissions(&cargo, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths([tools].into_iter().chain(std::env::split_paths(&path)));
    let mut install = Command::new(root().join("bindings/c/install.sh"));
    let profile = if cfg!(debug_assertions) {
        "dev"
    } else {
        "release"
    };
    install
        .arg(folder.link("prefix"))
        .env("PATH", path.unwrap())
        .env("SONAME_TO", &name)
        .env("CARGO_PROFILE", profile)
        .env("CARGO_TARGET_DIR", built()?.parent().unwrap());
    run(&mut install).unwrap();
    Ok(std::fs::read_to_string(name).unwrap())
}

#[test]
fn the_installed_library_has_a_versioned_name_and_is_found_by_pkg_config_and_cmake() {
    let folder = PtyFolder::new();
    let Some(name) = or_skip("C, installed", install(&folder)) else {
        return;
    };
    assert_eq!(name, "libhero_ril.so.0.1");
    let prefix = folder.link("prefix");
    let library = std::fs::canonicalize(prefix.join("lib").join(&name)).unwrap();
    assert!(library.ends_with("libhero_ril.so.0.1.0"), "{library:?}");
    let newest = std::fs::canonicalize(prefix.join("lib/libhero_ril.so")).unwrap();
    assert_eq!(newest, library);

    let mut flags = Command::new("pkg-config");
    flags
        .args(["--cflags", "--libs", "hero_ril"])
        .env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig"));
    match flags.output() {
        Ok(flags) => {
            let flags = String::from_utf8(flags.stdout).unwrap();
            assert!(flags.contains("-lhero_ril"), "{flags}");
        }
        Err(why) => skip("pkg-config", &why.to_string()),
    }
    let source = folder.link("program");
    std::fs::create_dir(&source).unwrap();
    std::fs::copy(
        root().join("examples/c/print_telemetry.c"),
        source.join("mission.c"),
    )
    .unwrap();
    let [shown] = &fragments("bindings/c/README.md", "cmake")[..] else {
        panic!("one project");
    };
    let project = format!("cmake_minimum_required(VERSION 3.16)\nproject(mission C)\n{shown}");
    std::fs::write(source.join("CMakeLists.txt"), project).unwrap();
    let cmake = |arguments: &[&str]| {
        let mut cmake = Command::new("cmake");
        cmake.args(arguments).current_dir(&source);
        cmake.env("CMAKE_PREFIX_PATH", &prefix);
        run(&mut cmake)
    };
    if or_skip("C, by CMake", cmake(&["--version"])).is_none() {
        return;
    }
    cmake(&["-S", ".", "-B", "out"]).unwrap();
    cmake(&["--build", "out"]).unwrap();
    starts_and_ends(&source.join("out/mission"));
    // Another minor version is another library.
    let project = std::fs::read_to_string(source.join("CMakeLists.txt")).unwrap();
    std::fs::write(source.join("CMakeLists.txt"), project.replace("0.1", "0.2")).unwrap();
    let refused = cmake(&["-S", ".", "-B", "other"]).unwrap_err();
    assert!(
        refused.contains("compatible with requested version"),
        "{refused}"
    );
}

/// The program starts with the library that it finds.
fn starts_and_ends(program: &Path) {
    let domain = TestDomain::new();
    let mut printing = Process::spawn(&domain, Command::new(program));
    printing.wait_for_text("subscribed");
    printing.signal(Signal::INT);
    assert_eq!(printing.wait_exit().code(), Some(0));
}
