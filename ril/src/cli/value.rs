//! Reading of coordinates, numbers, times and names.

use std::ffi::OsString;
use std::time::Duration;

use ipc_types::service::is_key;
use runtime::duration::{self, Shown};

use crate::config::{MAX_DEADLINE_MS, MAX_TIMEOUT_S, MIN_TIMEOUT_S};

/// The command line as clap can read it: a waypoint that begins with a minus sign would be taken for an option.
///
/// Such an argument gets a space in front, which the reader of waypoints drops. No option of ours begins with a digit, so
/// nothing else is ever touched.
pub(super) fn protect_coordinates(args: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let protect = |arg: OsString| match arg.to_str() {
        Some(text) if is_negative_coordinate(text) => OsString::from(format!(" {text}")),
        _ => arg,
    };
    args.into_iter().map(protect).collect()
}

/// A minus sign, a number, and a comma somewhere or a unit of length at the end.
fn is_negative_coordinate(text: &str) -> bool {
    text.strip_prefix('-')
        .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.'))
        && (text.contains(',') || text.ends_with('m') || text.ends_with("ft"))
}

/// Reads the name of a module.
pub(super) fn module_name(text: &str) -> Result<String, String> {
    match is_key(text) && !text.contains('/') {
        true => Ok(text.to_owned()),
        false => Err("a module's name is one word in lower snake case".to_owned()),
    }
}

/// How a command names a port of the DSP.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortKey {
    /// By the number of the port.
    Number(u16),
    /// By the name that the bridge gives it.
    Name(String),
}

/// Reads the name or the number of a port.
pub(super) fn port_key(text: &str) -> Result<PortKey, String> {
    match text.bytes().all(|byte| byte.is_ascii_digit()) {
        true => text
            .parse()
            .map(PortKey::Number)
            .map_err(|_| "the number of a port is from 0 to 65535".to_owned()),
        false => Ok(PortKey::Name(text.to_owned())),
    }
}

/// Reads the value of a parameter. Its range is the port's, which the bridge knows.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    number("value", text, f64::MAX)
}

/// Reads a finite number of at most `limit`, either way.
pub(super) fn number(what: &str, text: &str, limit: f64) -> Result<f64, String> {
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
pub(super) fn deadline_ms(text: &str) -> Result<u32, String> {
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
    fn only_waypoints_are_protected() {
        for text in ["-37,6,2", "-.5,1,2", "-5m", "-16.5ft"] {
            let protected = protect_coordinates([OsString::from(text)]);
            assert_eq!(protected, [format!(" {text}").as_str()], "{text}");
        }
        for text in ["-v", "--robot", "-1", "37,-6,2", "-x,1,2", "", "-"] {
            let protected = protect_coordinates([OsString::from(text)]);
            assert_eq!(protected, [text], "{text}");
        }
    }

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
