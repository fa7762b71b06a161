//! The consumers in C and Python of `examples/` do what their documentation says, against stand-ins.
//!
//! They need iceoryx2's bindings, which are no part of this repository. Where one is missing its tests are skipped, and
//! that is told past the capture of the tests' output:
//!
//! * Python: `RIL_TEST_PYTHON` names an interpreter that has the package `iceoryx2` 0.10.0, else `python3` is asked;
//! * C: `RIL_TEST_IOX2_INCLUDE` and `RIL_TEST_IOX2_LIB` name the folders with `iox2/iceoryx2.h` and with
//!   `libiceoryx2_ffi_c`, else the compiler's own are searched.

use std::ffi::OsString;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ipc_types::payload::HeroTelemetry;
use ril_tests::process::{Finished, Signal};
use ril_tests::{Process, PtyFolder, Script, StandInStatus, TestDomain};

/// What a subscriber keeps while it does not read.
const KEPT: u64 = 128;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// An example in one of the languages, ready to be started.
trait Example {
    /// The command that prints so many samples.
    fn command(&self, count: u64) -> Command;

    /// The command that was made for another layout of `hero_telemetry`; its files lie in `folder`.
    fn of_another_layout(&self, folder: &Path) -> Command;
}

fn skip(what: &str, why: &str) {
    // Not `eprintln`, which is shown only if a test fails.
    let _ = writeln!(std::io::stderr(), "SKIPPED: the example in {what}: {why}");
}

/// What a program prints, or why it cannot be used.
fn output(command: &mut Command) -> Result<Output, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{name}: {error}"))?;
    if output.status.success() {
        return Ok(output);
    }
    let text = String::from_utf8_lossy(&output.stderr);
    // A compiler's error comes first, and what Python says of an exception last.
    let error = text.lines().find(|line| line.contains("error:"));
    let error = error.or(text.lines().last()).unwrap_or_default();
    Err(format!("{name}: {error}"))
}

struct Python {
    interpreter: OsString,
}

impl Python {
    fn find() -> Option<Python> {
        let interpreter = std::env::var_os("RIL_TEST_PYTHON").unwrap_or_else(|| "python3".into());
        let probe =
            "import iceoryx2; from importlib.metadata import version; print(version('iceoryx2'))";
        match output(Command::new(&interpreter).args(["-c", probe])) {
            Ok(output) if output.stdout.trim_ascii() == b"0.10.0" => Some(Python { interpreter }),
            Ok(output) => {
                let version = String::from_utf8_lossy(&output.stdout).into_owned();
                skip(
                    "Python",
                    &format!("iceoryx2 is {}, not 0.10.0", version.trim()),
                );
                None
            }
            Err(why) => {
                skip(
                    "Python",
                    &format!("{why}; `pip install iceoryx2==0.10.0` helps"),
                );
                None
            }
        }
    }

    fn with_layouts(&self, layouts: &Path) -> Command {
        let mut command = Command::new(&self.interpreter);
        command
            .arg(root().join("examples/python/print_telemetry.py"))
            .env("PYTHONPATH", layouts)
            .env("PYTHONDONTWRITEBYTECODE", "1");
        command
    }
}

impl Example for Python {
    fn command(&self, count: u64) -> Command {
        let mut command = self.with_layouts(&root().join("ipc-types/layouts"));
        command.arg(count.to_string());
        command
    }

    fn of_another_layout(&self, folder: &Path) -> Command {
        alter(folder, "hero_ipc.py");
        self.with_layouts(folder)
    }
}

struct C {
    folder: PtyFolder,
    options: Vec<OsString>,
    libraries: Vec<OsString>,
}

impl C {
    fn find() -> Option<C> {
        let mut options: Vec<OsString> = ["-std=c11", "-Wall", "-Wextra", "-Werror"]
            .map(OsString::from)
            .into();
        if let Some(include) = std::env::var_os("RIL_TEST_IOX2_INCLUDE") {
            options.extend(["-isystem".into(), include]);
        }
        let mut libraries = Vec::new();
        if let Some(lib) = std::env::var_os("RIL_TEST_IOX2_LIB") {
            let mut run_path = OsString::from("-Wl,-rpath,");
            run_path.push(&lib);
            libraries.extend(["-L".into(), lib, run_path]);
        }
        libraries.push("-liceoryx2_ffi_c".into());
        let c = C {
            folder: PtyFolder::new(),
            options,
            libraries,
        };
        let probe = c.folder.link("probe.c");
        fs::write(
            &probe,
            "#include \"iox2/iceoryx2.h\"\nint main(void) { return 0; }\n",
        )
        .unwrap();
        let mut compiler = Command::new("cc");
        compiler.args(&c.options).arg(&probe).args(&c.libraries);
        compiler.arg("-o").arg(c.folder.link("probe"));
        match output(&mut compiler) {
            Ok(_) => Some(c),
            Err(why) => {
                skip(
                    "C",
                    &format!(
                        "{why}; RIL_TEST_IOX2_INCLUDE and RIL_TEST_IOX2_LIB may name iceoryx2's C binding"
                    ),
                );
                None
            }
        }
    }

    /// Compiles the example with the header in `layouts`. What a compiler complains of is the test's failure.
    fn compiled(&self, layouts: &Path, name: &str) -> Command {
        let (sources, program) = (root().join("examples/c"), self.folder.link(name));
        let mut compiler = Command::new("cc");
        compiler.args(&self.options).arg("-I").arg(layouts);
        compiler.arg(sources.join("print_telemetry.c"));
        compiler.arg(sources.join("hero_consumer.c"));
        compiler.args(&self.libraries).arg("-o").arg(&program);
        let output = compiler
            .output()
            .expect("a compiler, which was there before");
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{text}");
        Command::new(program)
    }
}

impl Example for C {
    fn command(&self, count: u64) -> Command {
        let mut command = self.compiled(&root().join("ipc-types/layouts"), "print_telemetry");
        command.arg(count.to_string());
        command
    }

    fn of_another_layout(&self, folder: &Path) -> Command {
        alter(folder, "hero_ipc.h");
        self.compiled(folder, "of_another_layout")
    }
}

/// Writes the generated file `name` to `folder` with a layout hash that the RIL does not have.
fn alter(folder: &Path, name: &str) {
    let text = fs::read_to_string(root().join("ipc-types/layouts").join(name)).unwrap();
    let hash = ipc_types::ServiceId::HeroTelemetry.spec().layout_hash;
    let hash = format!("{hash:016x}");
    assert!(text.contains(&hash));
    fs::write(folder.join(name), text.replace(&hash, "0123456789abcdef")).unwrap();
}

/// A flight of few samples, of which the last is on the ground.
fn flight() -> Vec<HeroTelemetry> {
    Script::at(37.4, -5.9, 10.0)
        .every_ms(500)
        .take_off(1.0)
        .land()
        .hero()
}

/// The lines that a consumer prints of `samples`, if none is lost.
fn lines_of(samples: &[HeroTelemetry]) -> Vec<String> {
    (1..)
        .zip(samples)
        .map(|(sequence, sample)| {
            let (altitude_m, flying) = (sample.geodetic.altitude_m, sample.flying);
            format!("{sequence} {altitude_m:.2} m, flying {flying}, 0 lost")
        })
        .collect()
}

fn it_gets_the_latest_sample_at_once_and_then_every_one(example: &impl Example) {
    let domain = TestDomain::new();
    let status = StandInStatus::start(&domain);
    let samples = flight();
    status.publish(&samples[0]);
    let mut consumer = Process::spawn(&domain, example.command(samples.len() as u64));
    consumer.wait_for_text("1 ");
    for sample in &samples[1..] {
        status.publish(sample);
    }
    let finished = consumer.wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    assert_eq!(finished.stdout, lines_of(&samples));
}

fn it_counts_what_it_loses(example: &impl Example) {
    const SAMPLES: u64 = 300;
    let domain = TestDomain::new();
    let status = StandInStatus::start(&domain);
    status.publish(&HeroTelemetry::default());
    let mut consumer = Process::spawn(&domain, example.command(1 + KEPT));
    consumer.wait_for_text("1 - m");
    consumer.signal(Signal::STOP);
    for _ in 0..SAMPLES {
        status.publish(&HeroTelemetry::default());
    }
    consumer.signal(Signal::CONT);
    let finished = consumer.wait_exit();
    assert_eq!(finished.stdout.len() as u64, 1 + KEPT, "{finished:#?}");
    let lost = SAMPLES - KEPT;
    let last = format!("{} - m, flying 0, {lost} lost", 1 + SAMPLES);
    assert_eq!(finished.stdout.last(), Some(&last));
}

fn it_ends_in_order(example: &impl Example) {
    for signal in [Signal::INT, Signal::TERM] {
        let domain = TestDomain::new();
        let _status = StandInStatus::start(&domain);
        let mut consumer = Process::spawn(&domain, example.command(u64::from(u32::MAX)));
        consumer.wait_for_text("subscribed");
        consumer.signal(signal);
        let finished = consumer.wait_exit();
        assert_eq!(finished.code(), Some(0), "{finished:#?}");
    }
}

/// The one error that a consumer tells.
#[track_caller]
fn error(finished: &Finished) -> &str {
    assert_eq!(finished.stderr.len(), 1, "{finished:#?}");
    &finished.stderr[0]
}

fn it_says_what_is_missing(example: &impl Example) {
    let domain = TestDomain::new();
    let nobody = Process::spawn(&domain, example.command(1)).wait_exit();
    assert_eq!(nobody.code(), Some(3), "{nobody:#?}");
    assert!(error(&nobody).contains("start it first"), "{nobody:#?}");
    let _somebody = domain.join("somebody");
    let no_status = Process::spawn(&domain, example.command(1)).wait_exit();
    assert_eq!(no_status.code(), Some(3), "{no_status:#?}");
    assert!(
        error(&no_status).contains("start `ril status`"),
        "{no_status:#?}"
    );
}

fn it_refuses_another_layout_and_names_both(example: &impl Example) {
    let (domain, folder) = (TestDomain::new(), PtyFolder::new());
    let _status = StandInStatus::start(&domain);
    let consumer = example.of_another_layout(folder.path());
    let finished = Process::spawn(&domain, consumer).wait_exit();
    assert_eq!(finished.code(), Some(1), "{finished:#?}");
    let hash = ipc_types::ServiceId::HeroTelemetry.spec().layout_hash;
    for part in [
        "`hero/1/hero_telemetry`".to_owned(),
        format!("carries `hero.HeroTelemetry.v2 {hash:016x}`"),
        "for `hero.HeroTelemetry.v2 0123456789abcdef`".to_owned(),
    ] {
        assert!(error(&finished).contains(&part), "{part}: {finished:#?}");
    }
}

/// A test of each language for each of these checks.
macro_rules! for_each_language {
    ($($check:ident),+ $(,)?) => {
        mod in_c {
            $(
                #[test]
                fn $check() {
                    if let Some(example) = super::C::find() {
                        super::$check(&example);
                    }
                }
            )+
        }

        mod in_python {
            $(
                #[test]
                fn $check() {
                    if let Some(example) = super::Python::find() {
                        super::$check(&example);
                    }
                }
            )+
        }
    };
}

for_each_language! {
    it_gets_the_latest_sample_at_once_and_then_every_one,
    it_counts_what_it_loses,
    it_ends_in_order,
    it_says_what_is_missing,
    it_refuses_another_layout_and_names_both,
}
