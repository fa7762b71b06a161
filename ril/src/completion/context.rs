//! [`Context`]: what the words that are on the command line already say about the word that is to be completed.

use std::ffi::OsString;
use std::num::NonZeroU32;

use clap::{ArgMatches, CommandFactory};
use ipc_types::RobotId;

use crate::cli::Cli;
use crate::recorded::key_of;

/// What is said already.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Context {
    /// The robot that is named, on the command line or in the environment; else robot 1.
    pub robot: RobotId,
    /// Key of the topic that is named.
    pub topic: Option<String>,
}

impl Context {
    /// Reads the words before the one that is to be completed, of which the first is the program's name. What cannot be
    /// understood is skipped.
    pub fn of(words: &[OsString]) -> Context {
        let mut context = Context {
            robot: RobotId::DEFAULT,
            topic: None,
        };
        let read = Cli::command()
            .ignore_errors(true)
            .try_get_matches_from(words);
        let Ok(matches) = read else {
            return context;
        };
        let mut level = Some(&matches);
        while let Some(matches) = level {
            if let Ok(Some(robot)) = matches.try_get_one::<NonZeroU32>("robot") {
                context.robot = RobotId::from(*robot);
            }
            if let Some(topic) = first_text(matches, "topic") {
                context.topic = Some(key_of(&topic).to_owned());
            }
            level = matches.subcommand().map(|(_, inner)| inner);
        }
        context
    }
}

/// The value of an option as it stands there; `None` if the command has no such option.
fn first_text(matches: &ArgMatches, id: &str) -> Option<String> {
    let mut values = matches.try_get_raw(id).ok()??;
    Some(values.next()?.to_str()?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn context(line: &str) -> (u32, Option<String>) {
        let words: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
        let context = Context::of(&words);
        (context.robot.get(), context.topic)
    }

    #[test]
    fn robot_and_topic_are_found_wherever_they_stand() {
        let hero = || Some("hero_telemetry".to_owned());
        for (line, expected) in [
            ("ril", (1, None)),
            ("ril state --robot 7", (7, None)),
            ("ril state --robot=7 --json", (7, None)),
            ("ril echo hero --robot 3 --field", (3, hero())),
            ("ril echo --json hero --field", (1, hero())),
            ("ril topic echo hero --field", (1, hero())),
            (
                "ril topic echo watch/cells --field level --field",
                (1, Some("watch/cells".to_owned())),
            ),
        ] {
            assert_eq!(context(line), expected, "{line}");
        }
    }

    #[test]
    fn what_cannot_be_understood_is_skipped() {
        for line in [
            "",
            "ril nonsense",
            "ril state --robot",
            "ril state --robot x",
            "ril --help",
        ] {
            assert_eq!(context(line), (1, None), "{line}");
        }
    }
}
