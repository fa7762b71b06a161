//! A `/dev/shm` of the caller's own: the program starts itself again in a mount namespace where that is a fresh file system,
//! so that filling it hurts nobody.

use std::io;
use std::process::{Command, ExitStatus};

/// Tells a program that it runs inside already.
const INSIDE: &str = "RIL_OWN_MEMORY";

/// Mounts the file system and becomes the program. `$1` are the options of the mount.
const ENTER: &str = "mount -t tmpfs -o \"$1\" tmpfs /dev/shm && shift && exec \"$@\"";

/// Whether `/dev/shm` is this program's own.
pub fn is_own() -> bool {
    std::env::var_os(INSIDE).is_some()
}

/// Runs this program again, with `args`, with a `/dev/shm` that is mounted with `options`. `None` when the kernel forbids
/// that; the reason is printed.
pub fn run_again(options: &str, args: &[String]) -> io::Result<Option<ExitStatus>> {
    let program = std::env::current_exe()?;
    let attempt = enter(options).arg("true").output()?;
    if !attempt.status.success() {
        eprintln!("SKIPPED: no /dev/shm of its own: {attempt:?}");
        return Ok(None);
    }
    enter(options).arg(program).args(args).status().map(Some)
}

/// The beginning of a command line.
fn enter(options: &str) -> Command {
    // Who is not root becomes root of a user namespace, which may mount.
    let flags = match rustix::process::geteuid().is_root() {
        true => "-m",
        false => "-rm",
    };
    let mut command = Command::new("unshare");
    command.args([flags, "sh", "-c", ENTER, "sh", options]);
    command.env(INSIDE, "1");
    command
}
