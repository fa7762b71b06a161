//! Options that may stand before the verb as well as behind it.
//!
//! Every verb has its own of them, so that its help says what they do there and a verb refuses what it has no use for. Those
//! that stand before the verb are written behind it before the command line is read.

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::time::Duration;

use clap::{ArgAction, Args, Command};

use super::value::duration;

/// Options that may stand before the verb too. Here they are for the help and for completion; the verb reads them.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Options of the verbs, before the verb or after it")]
pub struct GlobalArgs {
    /// Which robot: an integer greater than 0 [env: RIL_ROBOT] [default: 1]
    #[arg(long, value_name = "N")]
    robot: Option<String>,

    /// Print JSON, one object a line; a failure is the object ril.Error.v1
    #[arg(long)]
    json: bool,

    /// How long to wait for an answer or a sample, such as 5s or 200ms [env: RIL_TIMEOUT]
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    timeout: Option<Duration>,

    /// Configuration file; it must exist when it is named here [env: RIL_CONFIG]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,

    /// Log more: -v debug, -vv trace
    #[arg(short, long, action = ArgAction::Count)]
    verbose: u8,

    /// Log less: -q warnings, -qq errors, -qqq nothing
    #[arg(short, long, action = ArgAction::Count)]
    quiet: u8,
}

/// The command line with the options that stand before the verb written behind it: before a `--`, or else at the end.
///
/// `command` says which options those are. What it does not know stays where it is, and so does everything when there is no verb.
pub(super) fn behind_the_verb(args: Vec<OsString>, command: &Command) -> Vec<OsString> {
    let mut rest = args.iter().skip(1).peekable();
    let mut moved = Vec::new();
    while let Some(option) = rest.next_if(|arg| takes_value(arg, command).is_some()) {
        moved.push(option.clone());
        if takes_value(option, command) == Some(true) {
            moved.extend(rest.next().cloned());
        }
    }
    if moved.is_empty() || rest.peek().is_none() {
        return args;
    }
    let rest: Vec<OsString> = rest.cloned().collect();
    let end = rest
        .iter()
        .position(|arg| arg == "--")
        .unwrap_or(rest.len());
    let (verb, behind) = rest.split_at(end);
    [&args[..1], verb, &moved, behind].concat()
}

/// Whether an argument is an option of `command` of which the next argument is the value; `None` if it is none.
fn takes_value(arg: &OsStr, command: &Command) -> Option<bool> {
    let text = arg.to_str()?;
    let options = || {
        command
            .get_arguments()
            .filter(|option| !option.is_positional())
    };
    if let Some(long) = text.strip_prefix("--") {
        let name = long.split('=').next()?;
        let option = options().find(|option| option.get_long() == Some(name))?;
        return Some(option.get_action().takes_values() && !long.contains('='));
    }
    let shorts = text.strip_prefix('-').filter(|shorts| !shorts.is_empty())?;
    let is_known = |short| options().any(|option| option.get_short() == Some(short));
    shorts.chars().all(is_known).then_some(false)
}

/// Whether JSON is asked for, which holds for an error of the command line as well.
pub fn wants_json(args: &[OsString]) -> bool {
    let mut options = args.iter().take_while(|arg| *arg != "--");
    options.any(|arg| arg == "--json")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn what_stands_before_the_verb_is_written_behind_it() {
        for (before, after) in [
            ("ril status --robot 2", "ril status --robot 2"),
            ("ril --robot 2 status", "ril status --robot 2"),
            (
                "ril --robot=2 --json -vv param list",
                "ril param list --robot=2 --json -vv",
            ),
            (
                "ril --json goto 37,-6,20 -- -1,2,3",
                "ril goto 37,-6,20 --json -- -1,2,3",
            ),
            (
                "ril --timeout 5s --config x.toml echo dsp -q",
                "ril echo dsp -q --timeout 5s --config x.toml",
            ),
            // Without a verb, and what is none of these.
            ("ril --robot 2", "ril --robot 2"),
            ("ril --robot", "ril --robot"),
            ("ril", "ril"),
            ("ril --help status", "ril --help status"),
            ("ril --json --help", "ril --help --json"),
            ("ril --nonsense status", "ril --nonsense status"),
            ("ril -vx status", "ril -vx status"),
            ("ril - status", "ril - status"),
        ] {
            let args = before.split(' ').map(OsString::from).collect();
            let moved = behind_the_verb(args, &super::super::Cli::command());
            assert_eq!(moved.join(OsStr::new(" ")), after, "{before}");
        }
    }
}
