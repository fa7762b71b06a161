//! Variables of the environment that stand for options of a command line.

use std::ffi::OsStr;

use clap::Command;
use clap::builder::Resettable;

/// The command line of which a variable of the environment that is empty stands for no option, as one that is not set:
/// a unit or a script that leaves it open means nothing else.
pub fn without_empty_variables(command: Command) -> Command {
    let is_empty = |name: &OsStr| std::env::var_os(name).is_some_and(|value| value.is_empty());
    command
        .mut_args(|arg| match arg.get_env().is_some_and(is_empty) {
            true => arg.env(Resettable::Reset),
            false => arg,
        })
        .mut_subcommands(without_empty_variables)
}
