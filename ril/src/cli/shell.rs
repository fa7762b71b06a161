//! The arguments of verbs that serve the shell: completion. Those of the manual are [`runtime::manual::ManualArgs`].

use clap::{Args, ValueEnum};

use super::exit_codes::EXIT_CODES;

/// `ril completions`
///
/// Each press of the key then asks `ril` itself, so robots, topics, fields, modules and parameters are those that there are now.
/// The package installs these scripts; without it: source <(ril completions bash) in ~/.bashrc, the same in ~/.zshrc after
/// compinit, and `ril completions fish | source` in ~/.config/fish/config.fish.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct CompletionsArgs {
    /// Which shell the script is for
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Shells whose command lines can be completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shell {
    /// bash 4.4 or later
    Bash,
    /// zsh
    Zsh,
    /// fish
    Fish,
}
