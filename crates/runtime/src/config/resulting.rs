//! [`Resulting`]: what a process runs with, value by value, and where each value comes from, for `--check-config`.
//!
//! The built-in values are those of the annotated example: a test of each process says that its example is its default.
//! So no configuration has to be written back from its Rust structs, and a comment cannot differ from what is shown.

mod setting;

use std::collections::BTreeMap;
use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::Value;

use super::error::ConfigError;
use super::file::read_or_default;
use super::parse;
use crate::exit::Failure;
pub use setting::{Origin, given, value_of};
use setting::{Setting, put, settings, settings_of_file};

/// Column of the origins, characters; a longer value moves its own.
const ORIGIN_COLUMN: usize = 48;

/// What a process runs with, value by value, and where each value comes from.
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

    /// Adds the value `key` from the command line or the environment, if one of them gave it.
    #[must_use]
    pub fn with(mut self, key: &str, given: Option<(Value, Origin)>) -> Resulting {
        if let Some((value, origin)) = given {
            let key = key.to_owned();
            put(&mut self.settings, Setting { key, value, origin });
        }
        self
    }

    /// Takes all values of `table` from `of`, which was read later.
    #[must_use]
    pub fn with_table(mut self, table: &str, of: Resulting) -> Resulting {
        let is_in = |setting: &Setting| {
            let rest = setting.key.strip_prefix(table);
            rest.is_some_and(|rest| rest.starts_with(['.', '[']))
        };
        self.settings.retain(|setting| !is_in(setting));
        self.settings.extend(of.settings.into_iter().filter(is_in));
        self
    }

    /// `config`, the TOML of what a process runs with, with the origin of each value in a comment behind it.
    pub fn annotate(&self, config: &str) -> String {
        let mut text = match self.is_there {
            true => format!("# Read from {}.\n", self.file.display()),
            false => format!("# There was no {}.\n", self.file.display()),
        };
        // Tables of each list so far, by its name.
        let mut lists: BTreeMap<&str, usize> = BTreeMap::new();
        let mut table = String::new();
        for line in config.lines() {
            if line.starts_with('[') {
                let name = line.trim_matches(['[', ']']);
                if line.starts_with("[[") {
                    *lists.entry(name).or_default() += 1;
                }
                table = numbered(name, &lists);
            }
            match line.split_once(" = ").filter(|_| !line.starts_with('[')) {
                Some((key, _)) => {
                    let key = format!("{table}{}", key.trim_matches('"'));
                    let known = self.settings.iter().find(|setting| setting.key == key);
                    let origin = known.map_or(&Origin::BuiltIn, |setting| &setting.origin);
                    text += &format!("{line:ORIGIN_COLUMN$} # {origin}\n");
                }
                None => text += &format!("{line}\n"),
            }
        }
        // A value of several lines has perhaps got a comment into it.
        match toml::from_str::<Value>(&text) == toml::from_str(config) {
            true => text,
            false => config.to_owned(),
        }
    }

    /// Prints it for people on standard output.
    ///
    /// # Errors
    ///
    /// Those of standard output.
    pub fn print(&self) -> Result<(), Failure> {
        write!(std::io::stdout().lock(), "{self}").map_err(Failure::output)
    }

    /// The configuration as an object for programs; `of` is the process, or `ril` for the operator's commands.
    pub fn object<'a>(&'a self, of: &'a str) -> ResultingObject<'a> {
        ResultingObject {
            schema: "ril.Configuration.v1",
            of,
            file: self.is_there.then_some(&self.file),
            values: self.settings.iter().map(SettingObject::of).collect(),
        }
    }
}

/// The beginning of the keys of a table: its name, in which each list has the number of its last table, and a dot.
fn numbered(name: &str, lists: &BTreeMap<&str, usize>) -> String {
    let (mut begin, mut keys) = (0, String::new());
    for part in name.split('.') {
        let end = begin + part.len();
        keys += part;
        if let Some(count) = lists.get(&name[..end]) {
            keys += &format!("[{}]", count - 1);
        }
        keys.push('.');
        begin = end + 1;
    }
    keys
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

#[cfg(test)]
mod tests {
    use std::ffi::OsString;
    use std::fs;

    use super::setting::given_in;
    use super::*;

    #[derive(Debug, Default, serde::Deserialize)]
    #[serde(default)]
    #[allow(dead_code)]
    struct Example {
        serial: BTreeMap<String, Value>,
        log: Vec<BTreeMap<String, Value>>,
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
    fn what_a_process_runs_with_says_where_each_value_is_from() {
        let resulting =
            load("[serial]\nbaud_rate = 57600\n[[log]]\nname = 'a'\n[[log]]\nname = 'b'\n");
        let port = (Value::from("/dev/ttyUSB0"), Origin::CommandLine("--port"));
        let resulting = resulting.with("serial.port", Some(port));
        let config = "top = 1\n\n[[log]]\nname = \"a\"\n\n[[log]]\nname = \"b\"\nutc = false\n\n\
            [serial]\nbaud_rate = 57600\nport = \"/dev/ttyUSB0\"\n";
        let expected = "# Read from bridge.toml.\n\
            top = 1 # built-in\n[[log]]\nname = \"a\" # bridge.toml:4\n[[log]]\nname = \"b\" # bridge.toml:6\nutc = false # built-in\n\
            [serial]\nbaud_rate = 57600 # bridge.toml:2\nport = \"/dev/ttyUSB0\" # --port\n";
        let plain = |text: String| {
            let words = text
                .lines()
                .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
            words
                .filter(|line| !line.is_empty())
                .map(|line| line + "\n")
                .collect::<String>()
        };
        assert_eq!(plain(resulting.annotate(config)), expected);
        let later = load("[serial]\nport = 'x'\n[[log]]\nname = 'c'\n");
        let reloaded = resulting.clone().with_table("log", later).annotate(config);
        let expected = expected.replace("bridge.toml:6", "built-in");
        assert_eq!(plain(reloaded), expected);
        // A comment must not get into a text of several lines.
        let lines = "name = \"\"\"\nx = 1\n\"\"\"\n";
        assert_eq!(resulting.annotate(lines), lines);
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
}
