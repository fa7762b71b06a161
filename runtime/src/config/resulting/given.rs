//! What the command line and the environment give.

use std::ffi::{OsStr, OsString};

use toml::Value;

use super::setting::Origin;

/// What the command line or else the environment of this process gives for an option, as it stands there; `variable` is empty
/// for an option without one. The parser of the command line has checked it before.
pub fn given(option: &'static str, variable: &'static str) -> Option<(OsString, Origin)> {
    let environment = match variable {
        "" => None,
        variable => std::env::var_os(variable),
    };
    given_in(std::env::args_os(), environment, option, variable)
}

pub(super) fn given_in(
    args: impl Iterator<Item = OsString>,
    environment: Option<OsString>,
    option: &'static str,
    variable: &'static str,
) -> Option<(OsString, Origin)> {
    let mut args = args.take_while(|arg| arg != "--");
    while let Some(arg) = args.next() {
        let value = match arg.to_str().and_then(|text| text.strip_prefix(option)) {
            Some("") => args.next(),
            Some(rest) => rest.strip_prefix('=').map(OsString::from),
            None => None,
        };
        if let Some(value) = value {
            return Some((value, Origin::CommandLine(option)));
        }
    }
    environment.map(|value| (value, Origin::Environment(variable)))
}

/// A text of the command line as a value: a number if it is one.
pub fn value_of(text: &OsStr) -> Value {
    let text = text.to_string_lossy();
    match text.parse() {
        Ok(number) => Value::Integer(number),
        Err(_) => Value::String(text.into_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_rules_over_the_environment() {
        let given = |args: &[&str], environment: Option<&str>| {
            let args: Vec<OsString> = args.iter().map(OsString::from).collect();
            let given = given_in(
                args.into_iter(),
                environment.map(OsString::from),
                "--port",
                "RIL_PORT",
            );
            given.map(|(value, origin)| format!("{} of {origin}", value.to_string_lossy()))
        };
        assert_eq!(
            given(&["ril", "--port=a"], Some("b")).unwrap(),
            "a of --port"
        );
        assert_eq!(
            given(&["ril", "--ports", "a"], Some("b")).unwrap(),
            "b of RIL_PORT"
        );
        assert_eq!(given(&["ril", "--", "--port", "a"], None), None);
        assert_eq!(given(&["ril", "--port"], None), None);
    }
}
