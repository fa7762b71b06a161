//! Completion of command lines in bash, zsh and fish, with what lives now: robots, topics, fields, modules, parameters.
//!
//! The shell's script, which [`script`] makes, runs `ril` itself at each press of the key, with [`VARIABLE`] in its environment;
//! [`answer`] prints what can follow. That never takes part in shared memory, so nothing is created there. It says nothing on
//! standard error, and what cannot be found out in time is left out.

mod context;
mod live;

use std::ffi::OsString;
use std::io;
use std::sync::Arc;

use clap::builder::StyledStr;
use clap::{Arg, Command, CommandFactory};
use clap_complete::engine::{ArgValueCandidates, CompletionCandidate};
use clap_complete::env::{Bash, CompleteEnv, EnvCompleter, Fish, Shells, Zsh};

use crate::cli::{Cli, CompletionShell};
use context::Context;
use live::{Offer, within_limit};

/// The environment variable that asks for an answer, and names the shell. Not `COMPLETE`, the usual one: a variable of this name
/// that a user has set for something else would turn `ril land` into a completion.
pub const VARIABLE: &str = "RIL_COMPLETE";

/// Set by the scripts of bash and zsh: which word is to be completed, from 0. In fish it is the last one.
const INDEX_VARIABLE: &str = "_CLAP_COMPLETE_INDEX";

/// How the scripts call this program: the one that the shell finds.
const PROGRAM: &str = "ril";

/// Completes an autoloaded function of zsh at its first call too, which otherwise only defines it.
const ZSH_AUTOLOAD: &str =
    "if [[ \"$funcstack[1]\" == _ril ]]; then _clap_dynamic_completer_ril \"$@\"; fi\n";

/// The script that makes `shell` complete the command lines of `ril`.
///
/// # Errors
///
/// Never in practice: it is written into memory.
pub fn script(shell: CompletionShell) -> io::Result<String> {
    let mut text = Vec::new();
    completer(shell).write_registration(VARIABLE, PROGRAM, PROGRAM, PROGRAM, &mut text)?;
    let mut text = String::from_utf8_lossy(&text).trim_start().to_owned();
    if shell == CompletionShell::Zsh {
        text.push_str(ZSH_AUTOLOAD);
    }
    Ok(text)
}

fn completer(shell: CompletionShell) -> &'static dyn EnvCompleter {
    match shell {
        CompletionShell::Bash => &Bash,
        CompletionShell::Zsh => &Zsh,
        CompletionShell::Fish => &Fish,
    }
}

/// Whether a shell asks what can follow on its command line.
pub fn is_asked() -> bool {
    std::env::var_os(VARIABLE).is_some()
}

/// Answers a shell; `args` are those of the process. Whatever goes wrong, nothing is printed.
pub fn answer(args: impl IntoIterator<Item = OsString>) {
    // A message in the middle of a person's command line would only disturb.
    std::panic::set_hook(Box::new(|_| {}));
    let args: Vec<OsString> = args.into_iter().collect();
    let context = Arc::new(Context::of(before_cursor(&args)));
    let shells: [&dyn EnvCompleter; 3] = [&Bash, &Zsh, &Fish];
    let _ = CompleteEnv::with_factory(|| with_live_values(Cli::command(), &context))
        .var(VARIABLE)
        .shells(Shells(&shells))
        .bin(PROGRAM)
        .completer(PROGRAM)
        .try_complete(args, std::env::current_dir().ok().as_deref());
}

/// The words of the command line before the one that is to be completed.
fn before_cursor(args: &[OsString]) -> &[OsString] {
    let begin = args.iter().position(|arg| arg == "--");
    let words = begin.map_or(&[][..], |begin| &args[begin + 1..]);
    let index = std::env::var(INDEX_VARIABLE).ok();
    let index = index.and_then(|index| index.parse::<usize>().ok());
    let end = index.unwrap_or_else(|| words.len().saturating_sub(1));
    &words[..end.min(words.len())]
}

/// Adds the look-ups to the options and arguments that they are for, in all verbs.
fn with_live_values(command: Command, context: &Arc<Context>) -> Command {
    let verb = command.get_name().to_owned();
    command
        .mut_args(|arg| match look_up(&verb, &arg) {
            Some(look_up) => {
                let context = Arc::clone(context);
                arg.add(ArgValueCandidates::new(move || {
                    candidates(look_up, &context)
                }))
            }
            None => arg,
        })
        .mut_subcommands(|inner| with_live_values(inner, context))
}

/// What is looked up for a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LookUp {
    Robots,
    Topics,
    Fields,
    Modules,
    Parameters,
}

/// What is looked up for an argument of a verb; `None` where the definition of the command line says all.
fn look_up(verb: &str, arg: &Arg) -> Option<LookUp> {
    match arg.get_id().as_str() {
        "robot" => Some(LookUp::Robots),
        "topic" => Some(LookUp::Topics),
        "fields" => Some(LookUp::Fields),
        "module" => Some(LookUp::Modules),
        // Elsewhere that is the serial port, a path.
        "port" if ["get", "set"].contains(&verb) => Some(LookUp::Parameters),
        _ => None,
    }
}

fn candidates(look_up: LookUp, context: &Arc<Context>) -> Vec<CompletionCandidate> {
    let context = Arc::clone(context);
    let offers = match look_up {
        LookUp::Robots => within_limit(live::robots),
        LookUp::Topics => match within_limit(move || live::topics(&context)) {
            found if found.is_empty() => live::own_topics(),
            found => found,
        },
        LookUp::Fields => within_limit(move || live::fields(&context)),
        LookUp::Modules => within_limit(move || live::modules(&context)),
        LookUp::Parameters => live::parameters(),
    };
    offers.into_iter().map(candidate).collect()
}

fn candidate(offer: Offer) -> CompletionCandidate {
    let help = (!offer.help.is_empty()).then(|| StyledStr::from(offer.help));
    CompletionCandidate::new(offer.value).help(help)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look_ups(command: &Command, found: &mut Vec<(String, LookUp)>) {
        for arg in command.get_arguments() {
            if let Some(one) = look_up(command.get_name(), arg) {
                found.push((command.get_name().to_owned(), one));
            }
        }
        command
            .get_subcommands()
            .for_each(|inner| look_ups(inner, found));
    }

    #[test]
    fn each_look_up_belongs_to_verbs_that_there_are() {
        let mut found = Vec::new();
        look_ups(&Cli::command(), &mut found);
        for expected in [
            ("info", LookUp::Topics),
            ("echo", LookUp::Fields),
            ("start", LookUp::Modules),
            ("get", LookUp::Parameters),
            ("set", LookUp::Parameters),
        ] {
            let expected = (expected.0.to_owned(), expected.1);
            assert!(found.contains(&expected), "{expected:?}: {found:?}");
        }
        assert!(found.iter().any(|(_, one)| *one == LookUp::Robots));
        assert!(!found.contains(&("bridge".to_owned(), LookUp::Parameters)));
    }

    #[test]
    fn the_words_before_the_cursor_are_those_after_the_dashes() {
        let args =
            |line: &str| -> Vec<OsString> { line.split_whitespace().map(OsString::from).collect() };
        for (line, expected) in [
            ("ril -- ril state --ro", "ril state"),
            ("ril --", ""),
            ("ril", ""),
        ] {
            assert_eq!(before_cursor(&args(line)), args(expected), "{line}");
        }
    }

    #[test]
    fn a_script_asks_this_program_and_has_no_path_of_this_machine() {
        for shell in [
            CompletionShell::Bash,
            CompletionShell::Zsh,
            CompletionShell::Fish,
        ] {
            let script = script(shell).unwrap();
            assert!(script.contains(VARIABLE), "{script}");
            assert!(
                !script.contains('\u{b}') && !script.contains("/target/"),
                "{script}"
            );
        }
        assert!(
            script(CompletionShell::Zsh)
                .unwrap()
                .starts_with("#compdef ril\n")
        );
    }
}
