//! The programs of `examples/` in C, C++ and Python, built as their documentation says, against the real processes.
//!
//! What a language needs and this machine does not have is skipped, and that is told past the capture of the tests' output:
//!
//! * C and C++: a compiler, `cc` and `c++` (or what `CC` and `CXX` name);
//! * Python: an interpreter from 3.9 on with the package `hero_ril`. `RIL_TEST_PYTHON` names one; else a virtual environment is
//!   made in the target folder, for which `maturin` and `numpy` come from PyPI.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use ipc_types::{Ipc, Publisher};
use ril_tests::process::{Finished, Signal};
use ril_tests::{Chain, Process, PtyFolder, TestDomain};

/// Simulated seconds for one of the host: a mission takes about a second.
const SPEED: u32 = 10;

fn root() -> PathBuf {
    let member = Path::new(env!("CARGO_MANIFEST_DIR"));
    member.parent().expect("a workspace above").to_owned()
}

fn skip(what: &str, why: &str) {
    // Not `eprintln`, which is shown only if a test fails.
    let _ = writeln!(std::io::stderr(), "SKIPPED: the examples in {what}: {why}");
}

/// Runs a tool to its end, or says why that did not work.
fn run(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{name}: {error}"))?;
    match output.status.success() {
        true => Ok(()),
        false => Err(format!(
            "{name}: {}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        )),
    }
}

/// The folder in which cargo leaves libraries and programs, with `libhero_ril` and `ril` in it, of this build's profile.
fn built() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let test = std::env::current_exe().expect("this program's path");
        let folder = test.parent().and_then(Path::parent);
        let folder = folder.expect("a folder above `deps`").to_owned();
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut command = Command::new(cargo);
        command
            .args(["build", "--quiet", "-p", "hero-ril", "-p", "ril"])
            .current_dir(root())
            .env(
                "CARGO_TARGET_DIR",
                folder.parent().expect("a target folder"),
            );
        if !cfg!(debug_assertions) {
            command.arg("--release");
        }
        run(&mut command).expect("cargo builds the library and ril");
        folder
    })
}

/// A compiler for one of the languages.
struct Compiler {
    program: String,
    options: &'static [&'static str],
}

impl Compiler {
    fn find(language: &str, variable: &str, fallback: &str) -> Option<Compiler> {
        let program = std::env::var(variable).unwrap_or_else(|_| fallback.to_owned());
        match run(Command::new(&program).arg("--version")) {
            Ok(()) => Some(Compiler {
                program,
                options: match language {
                    "C" => &["-std=c11"],
                    _ => &["-std=c++17"],
                },
            }),
            Err(why) => {
                skip(language, &why);
                None
            }
        }
    }

    fn c() -> Option<Compiler> {
        Compiler::find("C", "CC", "cc")
    }

    fn cpp() -> Option<Compiler> {
        Compiler::find("C++", "CXX", "c++")
    }

    /// Compiles `examples/<source>` into `folder`; `libraries` come last.
    fn build(&self, source: &str, folder: &PtyFolder, libraries: &[&OsStr]) -> PathBuf {
        let program = folder.link("example");
        let mut command = Command::new(&self.program);
        command
            .args(self.options)
            .args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-o"])
            .arg(&program)
            .arg("-I")
            .arg(root().join("bindings/c/include"))
            .arg("-I")
            .arg(root().join("ipc-types/layouts"))
            .arg(root().join("examples").join(source))
            .args(libraries);
        run(&mut command).expect("the example compiles");
        program
    }

    fn with_shared_library(&self, source: &str, folder: &PtyFolder) -> PathBuf {
        let mut run_path = std::ffi::OsString::from("-Wl,-rpath,");
        run_path.push(built());
        let libraries = [
            OsStr::new("-L"),
            built().as_ref(),
            "-lhero_ril".as_ref(),
            &run_path,
        ];
        self.build(source, folder, &libraries)
    }

    fn with_static_library(&self, source: &str, folder: &PtyFolder) -> PathBuf {
        let library = built().join("libhero_ril.a");
        let mut libraries = vec![library.as_os_str()];
        libraries.extend(["-lpthread", "-ldl", "-lm"].map(OsStr::new));
        self.build(source, folder, &libraries)
    }
}

/// The lines about requests and not about telemetry.
fn requests(finished: &Finished) -> Vec<&str> {
    let lines = finished.stdout.iter().map(String::as_str);
    lines.filter(|line| line.contains(": ")).collect()
}

/// A program takes off, flies and lands, with a simulated helicopter.
fn flies_a_mission(program: impl FnOnce() -> Command) {
    let domain = TestDomain::new();
    let chain = Chain::hurried(&domain, &built().join("ril"), SPEED);
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
    let Some(compiler) = Compiler::c() else {
        return;
    };
    let folder = PtyFolder::new();
    let program = compiler.with_shared_library("c/mission.c", &folder);
    flies_a_mission(|| {
        let mut command = Command::new(&program);
        command.arg("5");
        command
    });
    says_that_nothing_runs(Command::new(&program), "start `ril status`");
}

#[test]
fn a_program_in_cpp_flies_a_mission() {
    let Some(compiler) = Compiler::cpp() else {
        return;
    };
    let folder = PtyFolder::new();
    let program = compiler.with_static_library("cpp/mission.cpp", &folder);
    flies_a_mission(|| {
        let mut command = Command::new(&program);
        command.arg("5");
        command
    });
    says_that_nothing_runs(Command::new(&program), "start `ril status`");
}

/// A module's own topic, as `examples/c/voltages.c` has it too.
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
}

#[test]
fn a_topic_of_a_module_goes_from_rust_to_c_and_from_c_to_c() {
    let Some(compiler) = Compiler::c() else {
        return;
    };
    let folder = PtyFolder::new();
    let program = compiler.with_shared_library("c/voltages.c", &folder);
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
    let mut publish = || {
        publisher
            .publish(|sample| sample.cells = [3.5; 12])
            .unwrap()
    };
    publish();
    consumer.wait_for_text("1 3.50 V to 3.50 V");
    publish();
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
