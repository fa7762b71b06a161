//! [`show`]: what `ril view` does with a view that runs: it opens its page, or prints where that is.

use std::ffi::OsStr;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

use runtime::exit::{ExitCode, Failure};
use serde::Serialize;

use super::options::ViewArgs;
use crate::render::json_line;
use crate::view_setup::run_file::{self, RunEntry};

/// A view that runs, for programs.
#[derive(Serialize)]
struct ViewObject {
    schema: &'static str,
    pid: u32,
    port: u16,
    address: String,
    address_with_token: String,
}

impl ViewObject {
    fn of(running: &RunEntry) -> ViewObject {
        ViewObject {
            schema: "ril.View.v1",
            pid: running.pid,
            port: running.port,
            address: running.address(),
            address_with_token: running.address_with_token(),
        }
    }
}

/// Opens the page of a view, or prints where it is, as the command line wants it.
///
/// # Errors
///
/// Code 8 when no browser can be started.
pub(super) fn show(running: &RunEntry, args: &ViewArgs) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    if args.json {
        return json_line(&mut out, &ViewObject::of(running));
    }
    if args.no_browser {
        return writeln!(out, "{}", running.address_with_token()).map_err(Failure::output);
    }
    writeln!(out, "the view is at {}", running.address()).map_err(Failure::output)?;
    let file = run_file::write_opener(running)?;
    if open(&file) {
        return Ok(());
    }
    let text = "no browser could be started: neither $BROWSER nor xdg-open";
    Err(Failure::new(ExitCode::NotInOrder, text)
        .with_next_step("`ril view --no-browser` prints the address for a browser of your choice"))
}

/// Opens a file in the browser that the user prefers. The browser goes on by itself.
fn open(file: &Path) -> bool {
    let preferred = std::env::var_os("BROWSER").unwrap_or_default();
    let preferred = preferred.to_str().unwrap_or_default().split(':');
    let programs = preferred
        .filter(|program| !program.is_empty())
        .chain(["xdg-open"]);
    programs.into_iter().any(|program| {
        let mut words = program.split_whitespace();
        let Some(program) = words.next() else {
            return false;
        };
        let page: &OsStr = file.as_os_str();
        let opened = Command::new(program)
            .args(words.filter(|word| *word != "%s"))
            .arg(page)
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        opened.is_ok()
    })
}
