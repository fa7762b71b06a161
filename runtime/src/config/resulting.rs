//! [`Resulting`]: what a process runs with, value by value, and where each value comes from, for `--check-config`.
//!
//! The built-in values are those of the annotated example: a test of each process says that its example is its default. So no
//! configuration has to be written back from its Rust structs, and a comment cannot differ from what is shown.

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Value;
use toml::de::{DeTable, DeValue};

use super::{ConfigError, parse, read_or_default};
use crate::exit::Failure;

/// Column of the origins, characters; a longer value moves its own.
const ORIGIN_COLUMN: usize = 48;

/// Where a value comes from. Each rules over those before it.
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
    const fn kind(&self) -> &'static str {
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
struct Setting {
    /// With the names of its tables, such as `serial.port` or `log[0].groups`.
    key: String,
    value: Value,
    origin: Origin,
}

/// See the module's documentation.
#[derive(Clone, Debug, PartialEq)]
pub struct Resulting {
    /// The file that was read, and whether it is there.
    file: PathBuf,
    is_there: bool,
    settings: Vec<Setting>,
}

impl Resulting {
    /// Reads the configuration `T` as [`load`](super::load) does; `example` is the annotated one with every default.
    ///
    /// # Errors
    ///
    /// Those of [`load`](super::load).
    pub fn load<T: DeserializeOwned + Default>(
        explicit: Option<&Path>,
        default_file: &Path,
        example: &str,
    ) -> Result<Resulting, ConfigError> {
        let file = explicit.unwrap_or(default_file);
        let text = read_or_default(explicit, default_file)?;
        if let Some(text) = &text {
            parse::<T>(text, file)?;
        }
        let mut settings = settings(example, |_| Origin::BuiltIn);
        let of_file = settings_of_file(text.as_deref().unwrap_or_default(), file);
        for setting in of_file {
            put(&mut settings, setting);
        }
        Ok(Resulting {
            file: file.to_owned(),
            is_there: text.is_some(),
            settings,
        })
    }

    /// The same with the value `key` from the command line or the environment, if one of them gave it.
    #[must_use]
    pub fn with(mut self, key: &str, given: Option<(Value, Origin)>) -> Resulting {
        if let Some((value, origin)) = given {
            let key = key.to_owned();
            put(&mut self.settings, Setting { key, value, origin });
        }
        self
    }

    /// Prints it for people on standard output.
    ///
    /// # Errors
    ///
    /// Those of standard output.
    pub fn print(&self) -> Result<(), Failure> {
        write!(std::io::stdout().lock(), "{self}").map_err(Failure::output)
    }

    /// As an object for programs; `of` is the process, or `ril` for the operator's commands.
    pub fn object<'a>(&'a self, of: &'a str) -> ResultingObject<'a> {
        ResultingObject {
            schema: "ril.Configuration.v1",
            of,
            file: self.is_there.then_some(&self.file),
            values: self.settings.iter().map(SettingObject::of).collect(),
        }
    }
}

/// A configuration as one JSON object.
#[derive(Debug, Serialize)]
pub struct ResultingObject<'a> {
    schema: &'static str,
    of: &'a str,
    file: Option<&'a PathBuf>,
    values: Vec<SettingObject<'a>>,
}

#[derive(Debug, Serialize)]
struct SettingObject<'a> {
    key: &'a str,
    value: &'a Value,
    origin: &'static str,
    from: Option<String>,
}

impl SettingObject<'_> {
    fn of(setting: &Setting) -> SettingObject<'_> {
        let is_built_in = setting.origin == Origin::BuiltIn;
        SettingObject {
            key: &setting.key,
            value: &setting.value,
            origin: setting.origin.kind(),
            from: (!is_built_in).then(|| setting.origin.to_string()),
        }
    }
}

impl fmt::Display for Resulting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.file.display();
        match self.is_there {
            true => writeln!(f, "# {file} is right. It results in:")?,
            false => writeln!(f, "# There is no {file} here. The built-in values:")?,
        }
        for setting in &self.settings {
            let text = format!("{} = {}", setting.key, setting.value);
            writeln!(f, "{text:ORIGIN_COLUMN$} # {}", setting.origin)?;
        }
        Ok(())
    }
}

/// Puts a setting in the place of the one with its key; a new one behind the others of its table.
fn put(settings: &mut Vec<Setting>, setting: Setting) {
    if let Some(old) = settings.iter_mut().find(|old| old.key == setting.key) {
        *old = setting;
        return;
    }
    let table = |key: &str| key.rsplit_once('.').map(|(table, _)| table.to_owned());
    let of_table = |old: &Setting| table(&old.key) == table(&setting.key);
    let place = settings.iter().rposition(of_table);
    settings.insert(place.map_or(settings.len(), |place| place + 1), setting);
}

fn settings_of_file(text: &str, file: &Path) -> Vec<Setting> {
    settings(text, |line| Origin::File(file.to_owned(), line))
}

/// All values of a text in its order, each with the origin that its line has. A text that is no TOML, which was refused before,
/// has none.
fn settings(text: &str, origin: impl Fn(usize) -> Origin) -> Vec<Setting> {
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

/// What the command line or else the environment of this process gives for an option, as it stands there; `variable` is empty
/// for an option without one. The parser of the command line has checked it before.
pub fn given(option: &'static str, variable: &'static str) -> Option<(OsString, Origin)> {
    let environment = match variable {
        "" => None,
        variable => std::env::var_os(variable),
    };
    given_in(std::env::args_os(), environment, option, variable)
}

fn given_in(
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
    use std::fs;

    use super::*;

    #[derive(Debug, Default, serde::Deserialize)]
    #[serde(default)]
    #[allow(dead_code)]
    struct Example {
        serial: std::collections::BTreeMap<String, Value>,
        log: Vec<std::collections::BTreeMap<String, Value>>,
    }

    const EXAMPLE: &str = "# Annotated.\n[serial]\nport = \"/dev/ttyS0\" # any\nbaud_rate = 115_200\n\n[safety]\nsupply_for_s = 2.0\n";

    fn load(text: &str) -> Resulting {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("bridge.toml");
        fs::write(&file, text).unwrap();
        let mut resulting = Resulting::load::<Example>(Some(&file), &file, EXAMPLE).unwrap();
        for setting in &mut resulting.settings {
            if let Origin::File(path, _) = &mut setting.origin {
                *path = "bridge.toml".into();
            }
        }
        Resulting {
            file: "bridge.toml".into(),
            ..resulting
        }
    }

    #[test]
    fn every_value_is_shown_with_its_origin() {
        let text = "\n[serial]\nbaud_rate = 57600\n\n[[log]]\ngroups = ['imu']\n[[log]]\nname = 'b'\n[serial.more]\nx = 0x10\n";
        let given = given_in(
            ["x", "--port", "/dev/ttyUSB0"]
                .map(OsString::from)
                .into_iter(),
            None,
            "--port",
            "RIL_PORT",
        );
        let given = given.map(|(text, origin)| (value_of(&text), origin));
        let resulting = load(text)
            .with("serial.port", given)
            .with("serial.baud_rate", None);
        let expected = r#"# bridge.toml is right. It results in:
serial.port = "/dev/ttyUSB0"                     # --port
serial.baud_rate = 57600                         # bridge.toml:3
safety.supply_for_s = 2.0                        # built-in
log[0].groups = ["imu"]                          # bridge.toml:6
log[1].name = "b"                                # bridge.toml:8
serial.more.x = 16                               # bridge.toml:10
"#;
        assert_eq!(resulting.to_string(), expected);
        let object = resulting.object("bridge");
        let first = &object.values[0];
        assert_eq!(
            (first.origin, first.from.as_deref()),
            ("command-line", Some("--port"))
        );
        assert_eq!(object.values[2].from, None);
    }

    #[test]
    fn without_a_file_everything_is_built_in() {
        let absent = Path::new("/no/such/bridge.toml");
        let resulting = Resulting::load::<Example>(None, absent, EXAMPLE).unwrap();
        let text = resulting.to_string();
        assert!(
            text.starts_with("# There is no /no/such/bridge.toml here."),
            "{text}"
        );
        assert_eq!(text.matches("# built-in").count(), 3);
        assert!(Resulting::load::<Example>(Some(absent), absent, EXAMPLE).is_err());
    }

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
