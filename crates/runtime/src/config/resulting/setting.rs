//! Values of a configuration by name, each with its origin: as a text of TOML, the command line and the environment
//! have them.

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};

use toml::Value;
use toml::de::{DeTable, DeValue};

/// Where a value comes from, in ascending precedence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The process's default.
    BuiltIn,
    /// This line of a file, counted from 1.
    File(PathBuf, usize),
    /// This environment variable.
    Environment(&'static str),
    /// This option.
    CommandLine(&'static str),
}

impl Origin {
    /// Its kind in JSON.
    pub(super) const fn kind(&self) -> &'static str {
        match self {
            Origin::BuiltIn => "built-in",
            Origin::File(..) => "file",
            Origin::Environment(_) => "environment",
            Origin::CommandLine(_) => "command-line",
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::BuiltIn => f.write_str("built-in"),
            Origin::File(file, line) => write!(f, "{}:{line}", file.display()),
            Origin::Environment(name) | Origin::CommandLine(name) => f.write_str(name),
        }
    }
}

/// A value of a configuration.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Setting {
    /// With the names of its tables, such as `serial.port` or `log[0].groups`.
    pub key: String,
    /// What the file has.
    pub value: Value,
    /// Where it comes from.
    pub origin: Origin,
}

/// Puts a setting in the place of the one with its key; a new one behind the others of its table.
pub(super) fn put(settings: &mut Vec<Setting>, setting: Setting) {
    if let Some(old) = settings.iter_mut().find(|old| old.key == setting.key) {
        *old = setting;
        return;
    }
    let table = |key: &str| key.rsplit_once('.').map(|(table, _)| table.to_owned());
    let of_table = |old: &Setting| table(&old.key) == table(&setting.key);
    let place = settings.iter().rposition(of_table);
    settings.insert(place.map_or(settings.len(), |place| place + 1), setting);
}

/// All values of a file's text, each with its line.
pub(super) fn settings_of_file(text: &str, file: &Path) -> Vec<Setting> {
    settings(text, |line| Origin::File(file.to_owned(), line))
}

/// All values of a text in its order, each with the origin that its line has. A text that is no TOML, which was refused
/// before, has none.
pub(super) fn settings(text: &str, origin: impl Fn(usize) -> Origin) -> Vec<Setting> {
    let Ok(table) = DeTable::parse(text) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    collect(table.get_ref(), "", &mut found);
    found.sort_by_key(|(start, _, _)| *start);
    let line = |start: usize| 1 + text[..start].matches('\n').count();
    found
        .into_iter()
        .map(|(start, key, value)| Setting {
            key,
            value,
            origin: origin(line(start)),
        })
        .collect()
}

/// The values of a table, each with the place of its key in the text. `outer` is the table's name with a dot.
fn collect(table: &DeTable<'_>, outer: &str, found: &mut Vec<(usize, String, Value)>) {
    for (key, value) in table {
        let name = format!("{outer}{}", key.get_ref());
        match value.get_ref() {
            DeValue::Table(inner) => collect(inner, &format!("{name}."), found),
            DeValue::Array(array) if is_of_tables(array) => {
                for (index, element) in array.iter().enumerate() {
                    if let DeValue::Table(inner) = element.get_ref() {
                        collect(inner, &format!("{name}[{index}]."), found);
                    }
                }
            }
            other => {
                if let Some(value) = plain(other) {
                    found.push((key.span().start, name, value));
                }
            }
        }
    }
}

fn is_of_tables(array: &toml::de::DeArray<'_>) -> bool {
    let is_table =
        |element: &toml::Spanned<DeValue<'_>>| matches!(element.get_ref(), DeValue::Table(_));
    !array.is_empty() && array.iter().all(is_table)
}

/// The value itself; nothing for a number that its type cannot hold, which no configuration takes.
fn plain(value: &DeValue<'_>) -> Option<Value> {
    Some(match value {
        DeValue::String(text) => Value::String(text.to_string()),
        DeValue::Integer(number) => {
            Value::Integer(i64::from_str_radix(number.as_str(), number.radix()).ok()?)
        }
        DeValue::Float(number) => Value::Float(number.as_str().parse().ok()?),
        DeValue::Boolean(flag) => Value::Boolean(*flag),
        DeValue::Datetime(time) => Value::Datetime(*time),
        DeValue::Array(array) => Value::Array(
            array
                .iter()
                .map(|element| plain(element.get_ref()))
                .collect::<Option<_>>()?,
        ),
        DeValue::Table(table) => Value::Table(
            table
                .iter()
                .map(|(key, value)| Some((key.get_ref().to_string(), plain(value.get_ref())?)))
                .collect::<Option<_>>()?,
        ),
    })
}

/// What the command line or else the environment of this process gives for an option, as it stands there; `variable` is
/// empty for an option without one. The parser of the command line has checked it before.
pub fn given(option: &'static str, variable: &'static str) -> Option<(OsString, Origin)> {
    let environment = match variable {
        "" => None,
        variable => std::env::var_os(variable).filter(|value| !value.is_empty()),
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
