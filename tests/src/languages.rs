//! Programs in C, C++ and Python that use the RIL's library, built as their documentation says: for this workspace's
//! own tests.
//!
//! * C and C++ need a compiler, `cc` and `c++`, or what `CC` and `CXX` name;
//! * Python needs an interpreter from 3.9 on with the package `hero_ril`. `RIL_TEST_PYTHON` names one; else a virtual
//!   environment is made in the target folder, for which `maturin`, `numpy`, and what flights are read and plotted
//!   with, come from PyPI.
//!
//! What is missing is said in words, and then the test is to be skipped visibly: [`skip`]. A user that cannot run cargo
//! uses what was built before.

use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Says that a test is skipped, past the capture of the tests' output.
pub fn skip(what: &str, why: &str) {
    // Not `eprintln`, which is shown only if a test fails.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {what}: {why}");
}

/// The root of the workspace.
pub fn root() -> PathBuf {
    let member = Path::new(env!("CARGO_MANIFEST_DIR"));
    member.parent().expect("a workspace above").to_owned()
}

/// The documents below `folder`, in an order of their own, without what is built.
///
/// # Panics
///
/// When a folder cannot be read.
pub fn documents(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let entry = entry.expect("an entry");
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        let is_built = ["target", "node_modules", "out"].contains(&&*name);
        match entry.file_type().expect("a type").is_dir() {
            true if !name.starts_with('.') && !is_built => found.extend(documents(&path)),
            false if name.ends_with(".md") => found.push(path),
            _ => {}
        }
    }
    found
}

/// The target folder of this build, for programs of all kinds; cargo tells tests alone.
pub fn target_folder() -> PathBuf {
    let folder = profile_folder();
    folder.parent().expect("a target folder").to_owned()
}

/// The folder in which cargo leaves the programs of this build's profile.
fn profile_folder() -> PathBuf {
    let program = std::env::current_exe().expect("this program's path");
    let folder = program.parent().expect("a folder");
    // Tests lie in `deps` and examples in `examples`, both below it.
    let is_below = ["deps", "examples"]
        .iter()
        .any(|name| folder.ends_with(name));
    let folder = folder.ancestors().nth(usize::from(is_below));
    folder.expect("a folder of programs").to_owned()
}

/// Runs a tool to its end.
///
/// # Errors
///
/// Why that did not work, with what it printed.
pub fn run(command: &mut Command) -> Result<(), String> {
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

/// Cargo, for what is built beside the test.
pub fn cargo() -> Command {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    without_this_package(Command::new(cargo))
}

/// Hides from a command that runs cargo which package the outer cargo is testing. Build scripts of libraries ask for
/// these variables, so cargo would build those libraries again for the inner command, and again for the next outer one.
fn without_this_package(mut command: Command) -> Command {
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if text.starts_with("CARGO_PKG_") || text.starts_with("CARGO_MANIFEST_") {
            command.env_remove(&name);
        }
    }
    command
}

/// The folder in which cargo leaves libraries and programs, with `libhero_ril` and `ril` in it, of this build's
/// profile.
///
/// # Panics
///
/// When cargo is there and cannot build them.
pub fn built() -> Result<&'static Path, &'static str> {
    static BUILT: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let built = BUILT.get_or_init(|| {
        let folder = profile_folder();
        if let Err(why) = run(cargo().arg("--version")) {
            let is_built = folder.join("libhero_ril.so").is_file();
            return if is_built { Ok(folder) } else { Err(why) };
        }
        // The whole workspace with a test, so that the libraries get the features that `cargo test --workspace` has
        // built them with: nothing is compiled a second time.
        let mut command = cargo();
        command
            .args(["build", "--quiet", "--workspace"])
            .args(["--lib", "--bin", "ril", "--test", "examples"])
            .current_dir(root())
            .env("CARGO_TARGET_DIR", target_folder());
        if !cfg!(debug_assertions) {
            command.arg("--release");
        }
        run(&mut command).expect("cargo builds the library and ril");
        Ok(folder)
    });
    built.as_deref().map_err(String::as_str)
}

/// A compiler, and the library to link with.
#[derive(Debug)]
pub struct Compiler {
    program: String,
    standard: &'static str,
    libraries: &'static Path,
}

impl Compiler {
    fn find(variable: &str, fallback: &str, standard: &'static str) -> Result<Compiler, String> {
        let program = std::env::var(variable).unwrap_or_else(|_| fallback.to_owned());
        run(Command::new(&program).arg("--version"))?;
        Ok(Compiler {
            program,
            standard,
            libraries: built()?,
        })
    }

    /// The one for C.
    ///
    /// # Errors
    ///
    /// Why there is none.
    pub fn c() -> Result<Compiler, String> {
        Compiler::find("CC", "cc", "-std=c11")
    }

    /// The one for C++.
    ///
    /// # Errors
    ///
    /// Why there is none.
    pub fn cpp() -> Result<Compiler, String> {
        Compiler::find("CXX", "c++", "-std=c++17")
    }

    /// Compiles `examples/<source>`; `libraries` come last.
    fn build(&self, source: &str, program: &Path, libraries: &[&OsStr]) -> Result<(), String> {
        let mut command = Command::new(&self.program);
        command
            .arg(self.standard)
            .args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-o"])
            .arg(program)
            .arg("-I")
            .arg(root().join("bindings/c/include"))
            .arg("-I")
            .arg(root().join("ipc-types/layouts"))
            .arg(root().join("examples").join(source))
            .args(libraries);
        run(&mut command)
    }

    /// Compiles `examples/<source>` into `program`.
    ///
    /// # Panics
    ///
    /// When that fails, with what the compiler says.
    pub fn with_shared_library(&self, source: &str, program: &Path) {
        self.shared(source, program, &[])
            .expect("the example compiles");
    }

    /// Compiles `source` against the shared library with the compiler's sanitizer of addresses.
    ///
    /// # Errors
    ///
    /// When the compiler has none.
    pub fn sanitized(&self, source: &str, program: &Path) -> Result<(), String> {
        self.shared(source, program, &["-fsanitize=address".as_ref()])
    }

    fn shared(&self, source: &str, program: &Path, options: &[&OsStr]) -> Result<(), String> {
        let mut run_path = OsString::from("-Wl,-rpath,");
        run_path.push(self.libraries);
        let libraries = [
            OsStr::new("-L"),
            self.libraries.as_ref(),
            "-lhero_ril".as_ref(),
            &run_path,
        ];
        self.build(source, program, &[options, &libraries].concat())
    }

    /// Compiles `examples/<source>` into `program`.
    ///
    /// # Panics
    ///
    /// When that fails, with what the compiler says.
    pub fn with_static_library(&self, source: &str, program: &Path) {
        let library = self.libraries.join("libhero_ril.a");
        let mut libraries = vec![library.as_os_str()];
        libraries.extend(["-lpthread", "-ldl", "-lm"].map(OsStr::new));
        self.build(source, program, &libraries)
            .expect("the example compiles");
    }
}

/// Compiles the DSP of `examples/firmware` with the codec of `bindings/firmware` into `program`; `board` is the file
/// with `main`.
///
/// # Errors
///
/// Why there is no compiler.
///
/// # Panics
///
/// When the compiler rejects one of the files.
pub fn firmware(board: &Path, program: &Path) -> Result<(), String> {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    run(Command::new(&compiler).arg("--version"))?;
    let compile = |options: &[&str]| {
        let mut command = Command::new(&compiler);
        command.args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]);
        command.args(options).arg("-o").arg(program).arg(board);
        for (folder, source) in [
            ("bindings/firmware", "hero_dsp.c"),
            ("examples/firmware", "dsp.c"),
        ] {
            let folder = root().join(folder);
            command.arg("-I").arg(&folder).arg(folder.join(source));
        }
        run(&mut command)
    };
    // What C does not define ends the program, where the compiler can see to it.
    let checked = compile(&["-O1", "-fsanitize=undefined", "-fno-sanitize-recover=all"]);
    if checked.is_err() {
        compile(&["-O1"]).expect("the firmware compiles");
    }
    Ok(())
}

/// An interpreter that has the package `hero_ril`.
///
/// # Errors
///
/// Why there is none.
///
/// # Panics
///
/// When what the package needs is there, and it cannot be built.
pub fn python() -> Result<&'static Path, &'static str> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| match std::env::var_os("RIL_TEST_PYTHON") {
        Some(python) => Ok(python.into()),
        None => virtual_environment(),
    });
    python.as_deref().map_err(String::as_str)
}

/// Makes a virtual environment, builds the wheel with it and installs it there. What is there already is used again.
fn virtual_environment() -> Result<PathBuf, String> {
    built()?;
    let target = target_folder();
    let (folder, wheels) = (target.join("python-venv"), target.join("python-wheels"));
    let python = folder.join("bin/python");
    if let Err(why) = run(cargo().arg("--version")) {
        let is_built = run(Command::new(&python).args(["-c", "import hero_ril"]));
        return is_built.map(|()| python).map_err(|_| why);
    }
    let package = root().join("bindings/python");
    let pip = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
        ]);
        command.args(arguments);
        command
    };
    let imports = "import maturin, numpy, mcap, pandas, matplotlib, prometheus_client, pytest";
    if run(Command::new(&python).args(["-c", imports])).is_err() {
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        run(&mut pip(&[
            "maturin>=1.9.4,<2",
            "prometheus-client",
            "pytest",
            "numpy",
            "mcap>=1.3,<2",
            "pandas>=2",
            "matplotlib",
        ]))?;
    }
    run(cargo().arg("fetch").current_dir(&package))?;
    // From here on a failure is ours.
    let _ = std::fs::remove_dir_all(&wheels);
    let profile = match cfg!(debug_assertions) {
        true => "dev",
        false => "release",
    };
    let mut build = without_this_package(Command::new(&python));
    build
        .args(["-m", "maturin", "build", "--quiet", "--profile", profile])
        .arg("--out")
        .arg(&wheels)
        .arg("--interpreter")
        .arg(&python)
        .current_dir(&package)
        .env("CARGO_TARGET_DIR", target.join("python"));
    run(&mut build).expect("the wheel is built");
    let wheel = std::fs::read_dir(&wheels).expect("wheels").next();
    let wheel = wheel.expect("a wheel").expect("a wheel").path();
    let wheel = wheel.to_str().expect("a path in UTF-8");
    run(&mut pip(&["--force-reinstall", "--no-deps", wheel])).expect("the wheel is installed");
    Ok(python)
}

/// The command that runs one of `examples/python`.
pub fn python_example(python: &Path, name: &str) -> Command {
    let mut command = Command::new(python);
    command
        .arg("-u")
        .arg(root().join("examples/python").join(name));
    command
}
