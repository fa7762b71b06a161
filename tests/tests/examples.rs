//! The programs of `examples/` in C, C++ and Python, built as their documentation says, against the real processes.
//!
//! What a language needs and this machine does not have is skipped, and that is told past the capture of the tests' output:
//! [`ril_tests::languages`].

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use ipc_types::code::{Reason, Stage};
use ipc_types::{Ipc, Publisher, Source, Waiter, fresh_request_id};
use ril_tests::languages::{Compiler, built, python, python_example, root, skip};
use ril_tests::process::{Finished, Line, Signal, WAIT_LIMIT};
use ril_tests::{Chain, Process, PtyFolder, TestDomain};

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
    let domain = TestDomain::new();
    let chain = Chain::hurried(&domain, &ril(), SPEED);
    let finished = Process::spawn(&domain, program()).wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    let requests = requests(&finished);
    let ends: Vec<_> = requests
        .iter()
        .filter(|line| line.ends_with(": done"))
        .collect();
    let expected = ["start: done", "take off: done", "go to: done", "land: done"];
    assert_eq!(ends, expected.iter().collect::<Vec<_>>(), "{finished:#?}");
    let is_in_the_air = |line: &String| line.ends_with("m, flying 1");
    assert!(finished.stdout.iter().any(is_in_the_air), "{finished:#?}");
    chain.end();
}

/// What is said when no bridge runs.
fn says_that_nothing_runs(command: Command, text: &str) {
    let domain = TestDomain::new();
    let finished = Process::spawn(&domain, command).wait_exit();
    assert_eq!(finished.code(), Some(1), "{finished:#?}");
    let is_told = finished.stderr.iter().any(|line| line.contains(text));
    assert!(is_told, "{finished:#?}");
}

#[test]
fn a_program_in_c_flies_a_mission() {
    let Some(compiler) = or_skip("C", Compiler::c()) else {
        return;
    };
    let folder = PtyFolder::new();
    let program = folder.link("example");
    compiler.with_shared_library("c/mission.c", &program);
    flies_a_mission(|| {
        let mut command = Command::new(&program);
        command.arg("5");
        command
    });
    says_that_nothing_runs(Command::new(&program), "start `ril run status`");
}

#[test]
fn a_program_in_cpp_flies_a_mission() {
    let Some(compiler) = or_skip("C++", Compiler::cpp()) else {
        return;
    };
    let folder = PtyFolder::new();
    let program = folder.link("example");
    compiler.with_static_library("cpp/mission.cpp", &program);
    flies_a_mission(|| {
        let mut command = Command::new(&program);
        command.arg("5");
        command
    });
    says_that_nothing_runs(Command::new(&program), "start `ril run status`");
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
}

/// What a program of `bindings/c/tests` says at its end.
fn passes(program: Command, how: &str) {
    let domain = TestDomain::new();
    let finished = Process::spawn(&domain, program).wait_exit();
    assert_eq!(finished.code(), Some(0), "{how}: {finished:#?}");
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
    let finished = consumer.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
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
                let moved = client.start(&domain, &["move", width_m]).wait_exit();
                assert_eq!(moved.code(), Some(0), "{what}: {moved:#?}");
                let last = moved.stdout.last().unwrap();
                assert!(
                    last.starts_with(&format!("done: {width_m}")),
                    "{what}: {last}"
                );
            }
            let refused = client.start(&domain, &["move", "-1"]).wait_exit();
            assert_eq!(refused.code(), Some(1), "{what}: {refused:#?}");
        }
        serving.signal(Signal::TERM);
        let finished = serving.wait_exit();
        assert_eq!(
            finished.code(),
            Some(0),
            "{}: {finished:#?}",
            server.language
        );
    }
}

#[test]
fn a_program_in_c_prints_telemetry_and_ends_in_order() {
    let Some(compiler) = or_skip("C", Compiler::c()) else {
        return;
    };
    let folder = PtyFolder::new();
    let program = folder.link("example");
    compiler.with_shared_library("c/print_telemetry.c", &program);
    let domain = TestDomain::new();
    let chain = Chain::hurried(&domain, &ril(), SPEED);
    let mut printing = Process::spawn(&domain, Command::new(&program));
    printing.wait_for_text("m, flying 0, 0 lost");
    printing.signal(Signal::INT);
    let finished = printing.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    let finished = Process::start(&domain, &program, ["2"]).wait_exit();
    assert_eq!(finished.stdout.len(), 2, "{finished:#?}");
    chain.end();
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
        let finished = Process::spawn(&domain, command).wait_exit();
        assert_eq!(finished.code(), Some(0), "{finished:#?}");
    }
}

#[test]
fn a_program_in_python_plots_a_recorded_flight() {
    let Some(python) = or_skip("Python", python()) else {
        return;
    };
    let domain = TestDomain::new();
    let folder = PtyFolder::new();
    let chain = Chain::hurried(&domain, &ril(), SPEED);
    let mut record = Command::new(ril());
    record
        .args(["record", "--min-free", "0", "--output"])
        .arg(folder.link("log"));
    let mut recorder = Process::spawn(&domain, record);
    recorder.wait_for_text("recording file=");
    for order in [&["start"][..], &["takeoff", "--altitude", "5"], &["land"]] {
        assert_eq!(chain.run(&domain, order).code(), Some(0), "{order:?}");
    }
    recorder.signal(Signal::TERM);
    assert_eq!(recorder.wait_exit().code(), Some(0));
    let picture = folder.link("flight.png");
    let mut plot = python_example(python, "plot_flight.py");
    plot.arg(folder.link("log/*.mcap"))
        .arg(&picture)
        .env("MPLBACKEND", "Agg")
        .env("MPLCONFIGDIR", folder.path());
    let finished = Process::spawn(&domain, plot).wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    assert!(
        std::fs::metadata(&picture).is_ok_and(|file| file.len() > 10_000),
        "{finished:#?}"
    );
    chain.end();
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
    let domain = TestDomain::new();
    let chain = Chain::hurried(&domain, &ril(), SPEED);
    let mut asynchronous = python_example(python, "mission_async.py");
    asynchronous.arg("3");
    let mission = Process::spawn(&domain, asynchronous).wait_exit();
    assert_eq!(mission.code(), Some(0), "{mission:#?}");
    assert!(
        mission.stdout.contains(&"land: done".to_owned()),
        "{mission:#?}"
    );
    let mut printing = Process::spawn(&domain, python_example(python, "print_telemetry.py"));
    printing.wait_for_text("m, flying 0, 0 lost");
    printing.signal(Signal::INT);
    let finished = printing.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    chain.end();
}
