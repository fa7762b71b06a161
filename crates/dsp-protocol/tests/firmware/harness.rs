//! `hero_dsp.c` as a program that answers questions; `harness.c` says which.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{Seek as _, Write as _};
use std::os::fd::AsRawFd as _;
use std::path::Path;
use std::process::{self, Command};
use std::sync::OnceLock;

use dsp_protocol::{DecodeError, Group};

use super::source::{c_place, path};

/// How the codec itself is compiled: as a firmware compiles it.
pub const FREESTANDING: [&str; 7] = [
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Werror",
    "-ffreestanding",
];

/// The compilations that are tested: name, options of the compiler.
const BUILDS: [(&str, &[&str]); 3] = [
    ("optimised", &["-O2"]),
    (
        "sanitized",
        &[
            "-O1",
            "-g",
            "-fsanitize=address,undefined",
            "-fno-sanitize-recover=all",
        ],
    ),
    // As where no type is smaller than 16 bits.
    ("wide bytes", &["-O1", "-DHERO_DSP_BYTE=uint_least16_t"]),
];

/// Says that something was not tested, past the capture of the tests' output.
pub fn skip(what: &str, why: &str) {
    let _ = writeln!(std::io::stderr(), "SKIPPED: {what}: {why}");
}

/// Runs a program to its end.
///
/// # Errors
/// What it printed, or why it cannot be started.
pub fn run(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{name}: {error}"))?;
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    match output.status.success() {
        true => Ok(printed),
        false => Err(format!(
            "{name}: {}: {printed}{}",
            output.status,
            String::from_utf8_lossy(&output.stderr)
        )),
    }
}

/// The compiler for this machine, `cc` or what `CC` names; `None` if there is none.
pub fn compiler() -> Option<String> {
    let name = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    match run(Command::new(&name).arg("--version")) {
        Ok(_) => Some(name),
        Err(why) => {
            skip("the codec in C", &why);
            None
        }
    }
}

/// The program. Its file has no name any more, so that nothing is left of those that all tests share.
pub struct Harness {
    pub name: &'static str,
    program: File,
}

impl Harness {
    /// All builds that this machine can make and run, made once; none without a compiler.
    pub fn all() -> &'static [Harness] {
        static ALL: OnceLock<Vec<Harness>> = OnceLock::new();
        ALL.get_or_init(Harness::build_all)
    }

    fn build_all() -> Vec<Harness> {
        let source = fs::read_to_string(path("hero_dsp.c")).expect("a file of the repository");
        let Some(compiler) = compiler() else {
            return vec![];
        };
        let build = |(name, options): (&'static str, &[&str])| {
            let harness = Harness::build(&compiler, name, options, &source);
            let started = harness.and_then(|harness| harness.try_ask(&[]).map(|_| harness));
            match started {
                Ok(harness) => Some(harness),
                // A compiler without sanitizers, or a machine on which what they made does not start.
                Err(why) if name == "sanitized" => {
                    skip("the codec in C with the compiler's sanitizers", &why);
                    None
                }
                Err(why) => panic!("{name}: {why}"),
            }
        };
        BUILDS.into_iter().filter_map(build).collect()
    }

    /// The program with this text in place of `hero_dsp.c`.
    ///
    /// # Errors
    /// What the compiler says.
    pub fn build(
        compiler: &str,
        name: &'static str,
        options: &[&str],
        source: &str,
    ) -> Result<Harness, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |file: &str| folder.path().join(file);
        let write = |file: &str, text: &str| fs::write(at(file), text).expect("a file");
        write("hero_dsp.c", source);
        write("fields.inc", &fields());
        write("results.inc", &results());
        let include = path("");
        let compile = |file: &Path, into: &str, more: &[&str]| {
            let mut command = Command::new(compiler);
            command.args(options).args(more).arg("-I").arg(&include);
            command.arg("-I").arg(folder.path()).arg("-c").arg(file);
            run(command.arg("-o").arg(at(into)))
        };
        compile(&at("hero_dsp.c"), "hero_dsp.o", &FREESTANDING)?;
        let harness = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/firmware/harness.c");
        compile(&harness, "harness.o", &["-std=c99", "-Wall", "-Werror"])?;
        let mut link = Command::new(compiler);
        link.args(options).args([at("harness.o"), at("hero_dsp.o")]);
        run(link.arg("-o").arg(at("harness")))?;
        let program = File::open(at("harness")).expect("the program");
        Ok(Harness { name, program })
    }

    /// The answers to `questions`, one for each.
    ///
    /// # Panics
    /// When the program fails, such as where a sanitizer finds something.
    pub fn ask(&self, questions: &[String]) -> Vec<String> {
        let answers = self.try_ask(questions);
        let answers = answers.unwrap_or_else(|why| panic!("{}: {why}", self.name));
        assert_eq!(answers.len(), questions.len(), "{}", self.name);
        answers
    }

    /// The answers to `questions`, one for each, unless the program fails.
    ///
    /// # Errors
    /// What the program printed when it failed.
    pub fn try_ask(&self, questions: &[String]) -> Result<Vec<String>, String> {
        let mut file = tempfile::tempfile().expect("a file");
        let text: String = questions.iter().map(|line| format!("{line}\n")).collect();
        file.write_all(text.as_bytes()).expect("the questions");
        file.rewind().expect("a file");
        let (own, program) = (process::id(), self.program.as_raw_fd());
        let mut command = Command::new(format!("/proc/{own}/fd/{program}"));
        command.env("ASAN_OPTIONS", "detect_leaks=0").stdin(file);
        Ok(run(&mut command)?.lines().map(str::to_owned).collect())
    }
}

/// The fields of a status for `harness.c`.
fn fields() -> String {
    let mut text = String::new();
    for group in Group::ALL {
        for field in group.limits() {
            let (bit, place) = (group.bit(), c_place(group, field));
            let is_signed = u8::from(field.wire.starts_with('i'));
            writeln!(text, "FIELD({bit}, \"{place}\", {place}, {is_signed})").unwrap();
        }
    }
    text
}

/// The names of the results for `harness.c`, in the order of their numbers.
fn results() -> String {
    let errors = DecodeError::ALL.map(DecodeError::name);
    let names = ["incomplete", "message"].into_iter().chain(errors);
    names.map(|name| format!("RESULT({name})\n")).collect()
}
