//! Configuration files: TOML whose every mistake is refused with file, line, reason and what to do.
//!
//! A file becomes a typed value once, here; inside a process nothing is checked again. Structures say
//! `#[serde(default, deny_unknown_fields)]`, and [`ranged!`](crate::ranged) bounds their numbers.
//!
//! [`resulting`] says for `--check-config` what a process runs with, and where each value comes from.
//!
//! Reading a configuration never waits for another process: the bridge does it in flight.

mod fault;
pub mod resulting;

use std::fmt;
use std::fs::{self, File, FileType, OpenOptions};
use std::io::{self, Read};
use std::ops::RangeBounds;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::OFlags;
pub use serde::Deserializer;
use serde::de::{DeserializeOwned, Error as _};

pub use fault::Fault;

/// Longest configuration file, bytes: a hundred times the annotated examples. A longer one is refused; it is surely
/// something else.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// Longest piece of a line that an error repeats, characters: it stays readable on a terminal.
const MAX_EXCERPT_CHARS: usize = 60;

/// A configuration and where it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded<T> {
    /// The configuration.
    pub value: T,
    /// The file; nothing when there was none and the built-in defaults rule.
    pub file: Option<PathBuf>,
    /// What the file says.
    text: String,
}

impl<T> Loaded<T> {
    /// The error that a fault of this configuration is, with file and line where the file has what is wrong.
    pub fn refuse(&self, fault: &Fault) -> ConfigError {
        let reason = fault.reason().to_owned();
        match (&self.file, fault.start(&self.text)) {
            (Some(file), Some(start)) => invalid(self.text.as_bytes(), start, reason, file),
            _ => ConfigError::Unfit { reason },
        }
    }
}

/// Why a configuration was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("{}: cannot be read{}", .file.display(), .next_step)]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What to do, as the end of a sentence.
        next_step: &'static str,
        /// What the operating system says.
        source: io::Error,
    },
    /// Something else stands in the place of the file.
    #[error("{}: is {what}, not a regular file; name a configuration file", .file.display())]
    NotAFile {
        /// The path.
        file: PathBuf,
        /// What is there.
        what: &'static str,
    },
    /// The file is far too long to be a configuration.
    #[error("{}: is longer than {MAX_FILE_BYTES} bytes; name a configuration file", .file.display())]
    TooLong {
        /// The file.
        file: PathBuf,
    },
    /// The content is wrong.
    #[error("{}:{line}: {reason}{}", .file.display(), in_line(.excerpt))]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong, and what would be right.
        reason: String,
        /// What the line says, shortened.
        excerpt: String,
    },
    /// A value is wrong that the file does not have: it is the built-in default, or came from the command line.
    #[error("{reason}")]
    Unfit {
        /// What is wrong, and what would be right.
        reason: String,
    },
}

/// Reads the configuration from `explicit`, which must exist, or else from `default_file`, which may be absent.
///
/// # Errors
/// The file cannot be read, or its content is refused.
pub fn load<T: DeserializeOwned + Default>(
    explicit: Option<&Path>,
    default_file: &Path,
) -> Result<Loaded<T>, ConfigError> {
    let file = explicit.unwrap_or(default_file);
    Ok(match read_or_default(explicit, default_file)? {
        Some(text) => Loaded {
            value: parse(&text, file)?,
            file: Some(file.to_owned()),
            text,
        },
        None => Loaded {
            value: T::default(),
            file: None,
            text: String::new(),
        },
    })
}

/// The text of the file; nothing when none was named and the default one is not there.
fn read_or_default(
    explicit: Option<&Path>,
    default_file: &Path,
) -> Result<Option<String>, ConfigError> {
    match read(explicit.unwrap_or(default_file)) {
        Ok(text) => Ok(Some(text)),
        Err(ConfigError::Unreadable { source, .. })
            if explicit.is_none() && source.kind() == io::ErrorKind::NotFound =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// Reads the configuration from `text`; errors call it `file_name`.
///
/// # Errors
/// The content is refused.
pub fn parse<T: DeserializeOwned>(
    text: &str,
    file_name: impl AsRef<Path>,
) -> Result<T, ConfigError> {
    toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start);
        let reason = explain(error.message());
        invalid(text.as_bytes(), start, reason, file_name.as_ref())
    })
}

/// Reads a number and refuses it outside `range`; floats that are not finite are outside every range.
///
/// [`ranged!`](crate::ranged) makes this a function for `#[serde(deserialize_with)]`.
///
/// # Errors
/// The value is not a number of this type, or lies outside.
pub fn in_range<'de, T: Number, D: Deserializer<'de>>(
    deserializer: D,
    range: impl RangeBounds<T> + fmt::Debug,
) -> Result<T, D::Error> {
    let number = T::deserialize(deserializer)?;
    if number.is_finite() && range.contains(&number) {
        return Ok(number);
    }
    let range = format!("{range:?}")
        .replace("..=", " to ")
        .replace("..", " to below ");
    Err(D::Error::custom(format_args!(
        "{number} is out of range: it must be from {range}"
    )))
}

/// Defines functions for `#[serde(deserialize_with = "…")]` that read a bounded number.
///
/// ```
/// runtime::ranged! {
///     /// Bits per second.
///     pub fn baud_rate(u32) in 50..=4_000_000;
///     fn tolerance_m(f64) in 0.1..=50.0;
/// }
///
/// #[derive(Debug, serde::Deserialize)]
/// struct Port {
///     #[serde(deserialize_with = "baud_rate")]
///     baud_rate: u32,
///     #[serde(deserialize_with = "tolerance_m")]
///     tolerance_m: f64,
/// }
///
/// let text = "tolerance_m = 2\nbaud_rate = 3\n";
/// let error = runtime::config::parse::<Port>(text, "bridge.toml").unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "bridge.toml:2: 3 is out of range: it must be from 50 to 4000000, in `baud_rate = 3`"
/// );
/// ```
#[macro_export]
macro_rules! ranged {
    ($( $(#[$meta:meta])* $visibility:vis fn $name:ident($number:ty) in $range:expr; )+) => {
        $(
            $(#[$meta])*
            $visibility fn $name<'de, D: $crate::config::Deserializer<'de>>(
                deserializer: D,
            ) -> ::core::result::Result<$number, D::Error> {
                $crate::config::in_range(deserializer, $range)
            }
        )+
    };
}

/// Numbers that [`in_range`] can bound.
pub trait Number: DeserializeOwned + PartialOrd + fmt::Display {
    /// Whether this is a number at all: neither infinite nor not-a-number.
    fn is_finite(&self) -> bool;
}

macro_rules! numbers {
    ($($integer:ty),+; $($float:ty),+) => {
        $(impl Number for $integer { fn is_finite(&self) -> bool { true } })+
        $(impl Number for $float { fn is_finite(&self) -> bool { <$float>::is_finite(*self) } })+
    };
}

numbers!(u8, u16, u32, u64, usize, i8, i16, i32, i64, isize; f32, f64);

/// The text of `file`.
fn read(file: &Path) -> Result<String, ConfigError> {
    let mut bytes = Vec::new();
    let outcome = open(file).and_then(|opened| match opened {
        Opened::Regular(opened) => {
            // One byte more than allowed tells a file of the greatest length from a longer one.
            opened.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes)?;
            Ok(None)
        }
        Opened::Other(kind) => Ok(Some(kind)),
    });
    if let Ok(Some(kind)) = outcome {
        return Err(ConfigError::NotAFile {
            file: file.to_owned(),
            what: describe(kind),
        });
    }
    if let Err(source) = outcome {
        let next_step = match source.kind() {
            io::ErrorKind::NotFound => "; name a file that exists, or none for the defaults",
            io::ErrorKind::PermissionDenied => "; give yourself read permission",
            _ => "",
        };
        return Err(ConfigError::Unreadable {
            file: file.to_owned(),
            next_step,
            source,
        });
    }
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(ConfigError::TooLong {
            file: file.to_owned(),
        });
    }
    String::from_utf8(bytes).map_err(|error| {
        let start = error.utf8_error().valid_up_to();
        let reason = "is not UTF-8 text; save the file as UTF-8".to_owned();
        invalid(error.as_bytes(), start, reason, file)
    })
}

/// What is at a path: a file that can be read, or something that cannot be one.
enum Opened {
    Regular(File),
    Other(FileType),
}

/// Opens `file` without waiting.
///
/// A pipe would keep its opener waiting until somebody writes into it, and a serial port restarts some autopilots when it
/// is opened: therefore the look before. What comes to the place after that look is opened without waiting, and not read.
fn open(file: &Path) -> io::Result<Opened> {
    let kind = fs::metadata(file)?.file_type();
    if !kind.is_file() {
        return Ok(Opened::Other(kind));
    }
    let without_waiting = OFlags::NONBLOCK | OFlags::NOCTTY;
    let opened = OpenOptions::new()
        .read(true)
        .custom_flags(without_waiting.bits() as i32)
        .open(file)?;
    let kind = opened.metadata()?.file_type();
    Ok(match kind.is_file() {
        true => Opened::Regular(opened),
        false => Opened::Other(kind),
    })
}

fn describe(kind: FileType) -> &'static str {
    if kind.is_dir() {
        "a folder"
    } else if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

/// The refusal of what stands at `start` in `text`.
fn invalid(text: &[u8], start: usize, reason: String, file: &Path) -> ConfigError {
    let before = &text[..start.min(text.len())];
    let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
    let content = text.split(|&byte| byte == b'\n').nth(line - 1);
    let content = String::from_utf8_lossy(content.unwrap_or_default());
    let mut excerpt: String = content.trim().chars().take(MAX_EXCERPT_CHARS).collect();
    if excerpt.len() < content.trim().len() {
        excerpt.push('…');
    }
    ConfigError::Invalid {
        file: file.to_owned(),
        line,
        reason,
        excerpt,
    }
}

/// What the line says, as the end of an error.
fn in_line(excerpt: &str) -> String {
    match excerpt {
        "" => String::new(),
        _ => format!(", in `{excerpt}`"),
    }
}

/// The reader's message, with a suggestion for a word that it does not know.
fn explain(message: &str) -> String {
    // The parser's own messages may have several lines; one is the rule for errors.
    let message = message.trim().replace('\n', ", ");
    match suggestion(&message) {
        Some(word) => format!("{message}; did you mean `{word}`?"),
        None => message,
    }
}

/// The expected word that is nearest to the unknown one that serde's message names.
///
/// serde's messages are ``unknown field `x`, expected one of `a`, `b` `` and the same with `variant`.
fn suggestion(message: &str) -> Option<&str> {
    let rest = message
        .strip_prefix("unknown field `")
        .or_else(|| message.strip_prefix("unknown variant `"))?;
    let mut words = rest.split('`').step_by(2);
    let unknown = words.next()?;
    nearest(unknown, words)
}

/// Of the `expected` words the one nearest to `unknown`, if it is near enough to be a slip of the keyboard: for "did you
/// mean".
pub fn nearest<'a>(unknown: &str, expected: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // One wrong letter in three is still a slip; more is another word.
    let length = |word: &str| word.chars().count();
    let near = |expected: &str| length(unknown).max(length(expected)).div_ceil(3);
    expected
        .into_iter()
        .filter(|expected| !expected.is_empty())
        .map(|expected| (edit_distance(unknown, expected), expected))
        .filter(|(distance, expected)| *distance <= near(expected))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, expected)| expected)
}

/// How many letters must be inserted, deleted or replaced to make `b` of `a` (Levenshtein).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, a) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, b) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde::Deserialize;

    use super::*;

    ranged! {
        fn baud_rate(u32) in 50..=4_000_000;
        fn gain(f64) in 0.05..=5.0;
        fn any(f64) in ..;
        fn below_one(f32) in 0.0..1.0;
        fn trim(i16) in -500..=500;
    }

    #[derive(Debug, Default, Deserialize, PartialEq)]
    #[serde(default, deny_unknown_fields)]
    struct Example {
        serial: Serial,
        log: Vec<Log>,
    }

    #[derive(Debug, Default, Deserialize, PartialEq)]
    #[serde(default, deny_unknown_fields)]
    struct Serial {
        #[serde(deserialize_with = "baud_rate")]
        baud_rate: u32,
        #[serde(deserialize_with = "gain")]
        gain: f64,
        #[serde(deserialize_with = "any")]
        any: f64,
        #[serde(deserialize_with = "below_one")]
        below_one: f32,
        #[serde(deserialize_with = "trim")]
        trim: i16,
        device: String,
    }

    #[derive(Debug, Default, Deserialize, PartialEq)]
    #[serde(default, deny_unknown_fields)]
    struct Log {
        directory: String,
        groups: Vec<Group>,
    }

    #[derive(Debug, Deserialize, PartialEq)]
    #[serde(rename_all = "kebab-case")]
    enum Group {
        ImuAttitude,
        Barometer,
    }

    #[test]
    fn a_right_file_is_read_and_its_gaps_are_the_defaults() {
        let text = "[serial]\nbaud_rate = 50\ngain = 5\nbelow_one = 0.5\ntrim = -500\n[[log]]\ngroups = [\"imu-attitude\"]\n";
        let example: Example = parse(text, "x.toml").unwrap();
        assert_eq!(example.serial.baud_rate, 50);
        assert_eq!(example.serial.gain, 5.0);
        assert_eq!(example.serial.trim, -500);
        assert_eq!(example.serial.device, "");
        assert_eq!(example.log[0].groups, [Group::ImuAttitude]);
    }

    #[test]
    fn every_mistake_is_told_with_line_and_reason() {
        #[rustfmt::skip]
        let cases = [
            // Unknown keys: at the top, in a table, in the second table of an array.
            ("serail = 1", 1, "did you mean `serial`?"),
            ("\n[serial]\n\nbuad_rate = 1", 4, "did you mean `baud_rate`?"),
            ("[[log]]\n[[log]]\ndirectroy = 'a'", 3, "did you mean `directory`?"),
            ("[serial]\nzzz = 1", 2, "unknown field `zzz`, expected one of"),
            ("[[log]]\ngroups = [\n'imu-attitude',\n'barometre',\n]", 4, "did you mean `barometer`?"),
            // Wrong types.
            ("[serial]\ndevice = 7", 2, "invalid type: integer `7`, expected a string"),
            ("[serial]\nbaud_rate = 'fast'", 2, "expected u32"),
            ("[serial]\nbaud_rate = -1", 2, "expected u32"),
            ("serial = 3", 1, "expected struct Serial"),
            ("[log]\ndirectory = 'a'", 1, "expected a sequence"),
            // Out of range.
            ("[serial]\nbaud_rate = 49", 2, "49 is out of range: it must be from 50 to 4000000"),
            ("[serial]\n\ntrim = 501", 3, "501 is out of range: it must be from -500 to 500"),
            ("[serial]\ngain = nan", 2, "NaN is out of range: it must be from 0.05 to 5.0"),
            ("[serial]\ngain = inf", 2, "inf is out of range"),
            ("[serial]\nany = inf", 2, "inf is out of range"),
            ("[serial]\nany = nan", 2, "NaN is out of range"),
            ("[serial]\nbelow_one = 1.0", 2, "1 is out of range: it must be from 0.0 to below 1.0"),
            // Not TOML.
            ("[serial]\nbaud_rate = ", 2, "x.toml:2: "),
            ("[serial]\ndevice = 'a'\ndevice = 'b'", 3, "duplicate key"),
            ("[serial", 1, "x.toml:1: "),
        ];
        for (text, line, reason) in cases {
            let error = parse::<Example>(text, "x.toml").unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("x.toml:{line}: ")),
                "{text:?}: {error}"
            );
            assert!(error.contains(reason), "{text:?}: {error}");
            assert_eq!(error.lines().count(), 1, "{error:?}");
        }
    }

    #[test]
    fn the_error_repeats_the_line_but_not_without_end() {
        let text = format!("[serial]\ndevice = 7 # {}", "x".repeat(1000));
        let error = parse::<Example>(&text, "x.toml").unwrap_err().to_string();
        assert!(error.contains("in `device = 7 # xxx"), "{error}");
        assert!(error.len() < 200, "{error}");
    }

    #[test]
    fn a_suggestion_is_made_only_for_a_slip() {
        let message = |word: &str| format!("unknown field `{word}`, expected `gain` or `device`");
        for (word, expected) in [
            ("gian", Some("gain")),
            ("Gain", Some("gain")),
            ("devices", Some("device")),
            ("speed", None),
            ("", None),
        ] {
            assert_eq!(suggestion(&message(word)), expected, "{word}");
        }
        assert_eq!(suggestion("something else"), None);
        assert_eq!(suggestion("unknown field `a`, there are no fields"), None);
    }

    #[test]
    fn the_default_file_may_be_absent_and_the_named_one_may_not() {
        let folder = tempfile::tempdir().unwrap();
        let absent = folder.path().join("absent.toml");
        let present = folder.path().join("present.toml");
        fs::write(&present, "[serial]\nbaud_rate = 100\n").unwrap();

        let loaded = load::<Example>(None, &absent).unwrap();
        assert_eq!((loaded.value, loaded.file), (Example::default(), None));
        for (explicit, default_file) in [(Some(&*present), &absent), (None, &present)] {
            let loaded = load::<Example>(explicit, default_file).unwrap();
            assert_eq!(loaded.value.serial.baud_rate, 100);
            assert_eq!(loaded.file.as_deref(), Some(&*present));
        }
        let error = load::<Example>(Some(&absent), &present).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("absent.toml: cannot be read; name a file")
        );
        let error = load::<Example>(Some(folder.path()), &present).unwrap_err();
        assert!(matches!(
            error,
            ConfigError::NotAFile {
                what: "a folder",
                ..
            }
        ));
    }

    #[test]
    fn a_fault_has_file_and_line_unless_the_file_does_not_say_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.toml");
        fs::write(&file, "\n[serial]\ndevice = 'a'\n").unwrap();
        let loaded = load::<Example>(Some(&file), &file).unwrap();
        let fault = Fault::at(&["serial", "device"], "is not there; name another");
        let error = loaded.refuse(&fault.clone().of("a")).to_string();
        let expected = "x.toml:3: is not there; name another, in `device = 'a'`";
        assert!(error.ends_with(expected), "{error}");
        let error = loaded.refuse(&fault.of("b")).to_string();
        assert_eq!(error, "is not there; name another");
    }

    #[test]
    fn nothing_but_a_file_is_opened() {
        use rustix::fs::{CWD, Mode, mkfifoat};
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        mkfifoat(CWD, &pipe, Mode::RUSR | Mode::WUSR).unwrap();
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&pipe, &link).unwrap();
        for (path, expected) in [
            (&*pipe, "is a pipe, not"),
            (&link, "is a pipe, not"),
            (&socket, "is a socket, not"),
            (Path::new("/dev/null"), "is a device, not"),
        ] {
            // In the place of a default file it is no less wrong.
            for explicit in [Some(path), None] {
                let error = load::<Example>(explicit, path).unwrap_err();
                assert!(error.to_string().contains(expected), "{error}");
            }
        }
    }

    #[test]
    fn a_file_that_is_no_text_or_too_long_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.toml");
        fs::write(&file, b"\n\ndevice = \xFF").unwrap();
        let error = load::<Example>(Some(&file), &file).unwrap_err().to_string();
        assert!(error.contains("x.toml:3: is not UTF-8"), "{error}");

        let longest = " ".repeat(MAX_FILE_BYTES as usize);
        fs::write(&file, &longest).unwrap();
        assert!(load::<Example>(Some(&file), &file).is_ok());
        fs::write(&file, longest + " ").unwrap();
        let error = load::<Example>(Some(&file), &file).unwrap_err();
        assert!(matches!(error, ConfigError::TooLong { .. }));
    }
}
