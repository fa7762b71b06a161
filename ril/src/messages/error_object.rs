//! A failure as one JSON object, the last line of standard output when `--json` was given and the exit code is not 0.

use runtime::exit::{ExitCode, Failure};
use serde::Serialize;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Error.v1";

/// Why a command failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ErrorObject {
    schema: &'static str,
    exit_code: u8,
    code: &'static str,
    message: String,
    causes: Vec<String>,
    next_step: String,
}

impl ErrorObject {
    /// The failure of a command.
    pub fn of(failure: &Failure) -> ErrorObject {
        let mut chain = failure.chain().into_iter();
        let (exit_code, code) = match failure.signal().map(u8::try_from) {
            // What a shell makes of it.
            Some(Ok(signal)) => (128 | signal, "interrupted"),
            _ => (failure.code().code(), failure.code().name()),
        };
        ErrorObject {
            schema: SCHEMA,
            exit_code,
            code,
            message: chain.next().unwrap_or_default(),
            causes: chain.collect(),
            next_step: failure.next_step().to_owned(),
        }
    }

    /// A usage error. `text` is what the parser prints for people: the message, perhaps with details on the next lines,
    /// then paragraphs with tips and the usage.
    pub fn of_usage(text: &str) -> ErrorObject {
        let text = text.trim_start();
        let message = match text.strip_prefix("error: ") {
            Some(text) => {
                let paragraph = text.split("\n\n").next().unwrap_or_default();
                let lines: Vec<&str> = paragraph.lines().map(str::trim).collect();
                lines.join(" ")
            }
            // The help, because nothing was asked for.
            None => "no command was given".to_owned(),
        };
        let tip = text
            .lines()
            .find_map(|line| line.trim().strip_prefix("tip: "));
        let next_step = tip.unwrap_or(ExitCode::Usage.next_step()).to_owned();
        ErrorObject {
            schema: SCHEMA,
            exit_code: ExitCode::Usage.code(),
            code: ExitCode::Usage.name(),
            message,
            causes: Vec::new(),
            next_step,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_has_its_code_causes_and_next_step() {
        let failure = Failure::new(ExitCode::Refused, "busy")
            .context("land was refused")
            .with_next_step("wait");
        let json = serde_json::to_string(&ErrorObject::of(&failure)).unwrap();
        assert_eq!(
            json,
            r#"{"schema":"ril.Error.v1","exit_code":5,"code":"refused","message":"land was refused","causes":["busy"],"next_step":"wait"}"#
        );
    }

    #[test]
    fn an_interruption_has_the_number_that_a_shell_gives_it() {
        let object = ErrorObject::of(&Failure::interrupted(2, "interrupted"));
        assert_eq!((object.exit_code, object.code), (130, "interrupted"));
    }

    #[test]
    fn a_usage_error_has_its_tip_as_next_step() {
        let text = "error: unrecognized subcommand 'strat'\n\n  tip: a similar subcommand exists: 'start'\n\nUsage: ril\n";
        let object = ErrorObject::of_usage(text);
        assert_eq!(object.message, "unrecognized subcommand 'strat'");
        assert_eq!(object.next_step, "a similar subcommand exists: 'start'");
        let text = "error: the following required arguments were not provided:\n  <TOPIC>\n\nUsage: ril hz <TOPIC>\n";
        let object = ErrorObject::of_usage(text);
        assert_eq!(
            object.message,
            "the following required arguments were not provided: <TOPIC>"
        );
        assert_eq!(object.next_step, "look at the command's --help");
        assert_eq!(
            ErrorObject::of_usage("The tool\n\nUsage: ril").message,
            "no command was given"
        );
    }
}
