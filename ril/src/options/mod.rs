//! Options that several verbs take, and how their values are read. What only one verb takes is beside it.

pub mod length;

use std::ffi::OsString;
use std::time::Duration;

use clap::Args;
use runtime::args::CommonArgs;
use runtime::duration::{self, Shown};

use crate::config::{MAX_DEADLINE_MS, MAX_TIMEOUT_S, MIN_TIMEOUT_S};

/// What each exit code means, for the end of the help.
pub const EXIT_CODES: &str = "\
Exit codes:
   0  done
   1  internal error
   2  usage error
   3  the process that should answer does not run
   4  no answer in time, or the DSP did not acknowledge
   5  refused, or ended early; the reason is printed
   6  the link to the DSP, or the relay's link to the robot, is down
   7  the outcome cannot be known
   8  something is not in order; the findings are printed
  78  the configuration is wrong";

/// Whether the operator said which robot is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RobotChoice {
    /// By `--robot` or `RIL_ROBOT`.
    Explicit,
    /// No: the robot is the built-in default.
    Default,
}

/// What every command takes that asks the bridge for something.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct AskArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for the bridge's first answer, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Until how long after its issue the order may begin, such as 500ms; 0s leaves it to the bridge
    #[arg(long, value_name = "DURATION", env = "RIL_DEADLINE", value_parser = deadline_ms)]
    pub deadline: Option<u32>,

    /// Print each report as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// What every command takes whose request goes on for a while.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct RequestArgs {
    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,

    /// Return once the request was accepted, instead of following it to its end
    #[arg(long)]
    pub no_wait: bool,
}

/// Whether JSON is asked for, which holds for an error of the command line as well.
pub fn wants_json(args: &[OsString]) -> bool {
    let mut options = args.iter().take_while(|arg| *arg != "--");
    options.any(|arg| arg == "--json")
}

/// Reads a finite number of at most `limit`, either way.
pub(crate) fn number(what: &str, text: &str, limit: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if !number.is_finite() => Err(format!("the {what} `{text}` is not finite")),
        Ok(number) if number.abs() > limit => Err(format!(
            "the {what} {text} is out of range: it must be from -{limit} to {limit}"
        )),
        Ok(number) => Ok(number),
        Err(_) => Err(format!("the {what} `{text}` is not a number")),
    }
}

/// Reads how long something may take or is to go on, such as `5s` or `1m30s`.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let bounds = [MIN_TIMEOUT_S, MAX_TIMEOUT_S].map(Duration::from_secs_f64);
    within(duration::parse(text)?, bounds)
}

/// Reads until how long after its issue an order may begin, in whole ms; `0s` leaves it to the bridge.
pub(crate) fn deadline_ms(text: &str) -> Result<u32, String> {
    let longest = Duration::from_millis(MAX_DEADLINE_MS.into());
    let deadline = within(duration::parse(text)?, [Duration::ZERO, longest])?;
    match u32::try_from(deadline.as_millis()) {
        Ok(ms) if Duration::from_millis(ms.into()) == deadline => Ok(ms),
        _ => Err("a deadline is a whole number of milliseconds".to_owned()),
    }
}

/// `duration`, if it is from the first to the second bound.
fn within(duration: Duration, [least, most]: [Duration; 2]) -> Result<Duration, String> {
    match (least..=most).contains(&duration) {
        true => Ok(duration),
        false => Err(format!(
            "{} is out of range: it must be from {} to {}",
            Shown(duration),
            Shown(least),
            Shown(most)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units_and_bounds() {
        assert_eq!(duration("1m30s"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("10ms"), Ok(Duration::from_millis(10)));
        for (text, expected) in [
            ("5", "`5` has no unit: write 5s"),
            ("9ms", "9ms is out of range: it must be from 10ms to 24h"),
            ("24h1s", "24h1s is out of range"),
        ] {
            let error = duration(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
        assert_eq!(deadline_ms("0s"), Ok(0));
        assert_eq!(deadline_ms("1.5s"), Ok(1_500));
        for (text, expected) in [
            ("50", "write 50s or 50ms"),
            ("0.5ms", "whole number of milliseconds"),
            ("25h", "from 0s to 24h"),
        ] {
            let error = deadline_ms(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
