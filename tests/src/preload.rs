//! Libraries in C that a program is started with, by `LD_PRELOAD`, so that it sees another world: for this workspace's
//! own tests and measurements of real processes. Each stands in a file beside this one that says what it does.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime};

use crate::languages::run;
use crate::sandbox::Sandbox;

/// Says what a program does with files below a folder: `preload/trace.c`.
pub const TRACE: (&str, &str) = ("trace", include_str!("preload/trace.c"));

/// A wall clock that is set at will: `preload/clock.c`.
pub const CLOCK: (&str, &str) = ("clock", include_str!("preload/clock.c"));

/// Builds a library into `folder`, with `cc` or what `CC` names.
///
/// # Errors
///
/// Why there is no compiler, or what it says.
pub fn build(folder: &Path, (name, source): (&str, &str)) -> Result<PathBuf, String> {
    let (text, library) = (
        folder.join(format!("{name}.c")),
        folder.join(format!("{name}.so")),
    );
    std::fs::write(&text, source).map_err(|error| error.to_string())?;
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let mut command = Command::new(compiler);
    command.args([
        "-std=gnu11",
        "-Wall",
        "-Werror",
        "-O1",
        "-shared",
        "-fPIC",
        "-o",
    ]);
    run(command.arg(&library).arg(&text).arg("-ldl"))?;
    Ok(library)
}

/// A wall clock for the processes of a [`Sandbox`] that is set at will. Their monotonic clock is that of the machine.
#[derive(Debug)]
pub struct SetClock {
    folder: tempfile::TempDir,
    library: PathBuf,
}

impl SetClock {
    /// One that is right.
    ///
    /// # Errors
    ///
    /// Why it cannot be built here.
    pub fn new() -> Result<SetClock, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let library = build(folder.path(), CLOCK)?;
        std::fs::write(folder.path().join("offset"), [0; 8]).map_err(|error| error.to_string())?;
        let clock = SetClock { folder, library };
        // Programs without libc's shared library do not see it.
        match clock.command(Path::new("true")).status() {
            Ok(status) if status.success() => Ok(clock),
            refused => Err(format!("no program can be started with it: {refused:?}")),
        }
    }

    /// Sets the clock: so many seconds after the beginning of 1970, now.
    ///
    /// # Panics
    ///
    /// When its file is gone.
    pub fn set(&self, unix_s: u64) {
        let right = SystemTime::UNIX_EPOCH
            .elapsed()
            .expect("a clock after 1970");
        let offset_ns = i128::from(unix_s) * 1_000_000_000 - right.as_nanos() as i128;
        let offset = i64::try_from(offset_ns).expect("a moment of this age");
        let file = File::options()
            .write(true)
            .open(self.folder.path().join("offset"));
        let written = file.and_then(|file| file.write_all_at(&offset.to_ne_bytes(), 0));
        written.expect("a file of this clock");
    }

    /// A sandbox whose processes have this clock. `name` is printed when it hangs.
    pub fn sandbox(&self, ril: &Path, name: &str) -> Sandbox {
        let command = self.command(ril);
        let words = [command.get_program()]
            .into_iter()
            .chain(command.get_args());
        Sandbox::new(words, name, Duration::from_secs(300))
    }

    fn command(&self, program: &Path) -> Command {
        let mut command = Command::new("env");
        command.arg(format!("LD_PRELOAD={}", self.library.display()));
        command.arg(format!(
            "CLOCK_FILE={}",
            self.folder.path().join("offset").display()
        ));
        command.arg(program);
        command
    }
}
