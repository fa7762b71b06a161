//! `ril completions` and `ril man`: what the shell and `man` want to know of the command line.

use std::io::{self, Write};

use clap::CommandFactory;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::manual::{self, ManualArgs};

use crate::cli::{Cli, CompletionsArgs};
use crate::completion;

/// `ril completions`
///
/// # Errors
///
/// When standard output cannot be written.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let script = completion::script(args.shell).or_fail(ExitCode::Internal)?;
    io::stdout()
        .write_all(script.as_bytes())
        .map_err(Failure::output)
}

/// `ril man`
///
/// # Errors
///
/// Code 1 when the pages cannot be written.
pub fn man(args: &ManualArgs) -> Result<(), Failure> {
    manual::write(Cli::command(), args)
}
