//! `--check-config`: prints the configuration that results from file, environment and command line.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;
use std::time::Duration;

use runtime::args::CommonArgs;
use runtime::config::resulting::{Origin, Resulting, given};
use runtime::duration;
use runtime::exit::Failure;

use super::json::json_line;
use crate::cli::wants_json;
use crate::config::{Config, DEFAULT_FILE};

/// What the operator's commands run with.
pub(super) fn of_commands(common: &CommonArgs) -> Result<Resulting, Failure> {
    let (file, default) = (common.config.as_deref(), Path::new(DEFAULT_FILE));
    let resulting = Resulting::load::<Config>(file, default, include_str!("../../ril.toml"))?;
    let timeout = given("--timeout", "RIL_TIMEOUT");
    let deadline = given("--deadline", "RIL_DEADLINE");
    let timeout = in_unit(timeout, |time| time.as_secs_f64().into());
    let deadline = in_unit(deadline, |time| (time.as_millis() as i64).into());
    Ok(resulting
        .with("request.timeout_s", timeout.clone())
        .with("request.deadline_ms", deadline)
        .with("observe.timeout_s", timeout))
}

/// A duration that was given, in the unit that the key of the configuration names.
fn in_unit<V>(
    given: Option<(OsString, Origin)>,
    unit: impl FnOnce(Duration) -> V,
) -> Option<(V, Origin)> {
    let (text, origin) = given?;
    let read = |text: &OsStr| duration::parse(text.to_str()?).ok();
    Some((unit(read(&text)?), origin))
}

/// Prints the configuration of a process, or of the operator's commands, as text or as JSON.
pub(crate) fn print(of: &str, resulting: &Resulting) -> Result<(), Failure> {
    let args: Vec<OsString> = std::env::args_os().collect();
    match wants_json(&args) {
        true => json_line(&mut io::stdout().lock(), &resulting.object(of)),
        false => resulting.print(),
    }
}
