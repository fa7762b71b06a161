//! Why a configuration was refused: [`ConfigError`]; [`Fault`], of one whose values can all be read; and what was meant
//! by a word that is written wrong.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use toml::de::{DeTable, DeValue};

use crate::duration::DurationText;
use crate::exit::{ExitCode, Failure};

/// Longest configuration file, bytes: a hundred times the annotated examples. A longer one is refused; it is surely
/// something else.
pub(super) const MAX_FILE_BYTES: u64 = 1 << 20;

/// Longest piece of a line that an error repeats, characters: it stays readable on a terminal.
const MAX_EXCERPT_CHARS: usize = 60;

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
    /// The file was not read in time.
    #[error("{}: was not read within {}; does the disk hang?", .file.display(), DurationText(*.limit))]
    NotInTime {
        /// The file.
        file: PathBuf,
        /// How long it was waited for.
        limit: Duration,
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

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Failure {
        Failure::new(ExitCode::Configuration, error)
    }
}

/// The refusal of what stands at `start` in `text`.
pub(super) fn invalid(text: &[u8], start: usize, reason: String, file: &Path) -> ConfigError {
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

/// What is wrong with a configuration although each of its values could be read: two values that do not fit together, a
/// file that is named and cannot be used. [`Loaded::refuse`](super::Loaded::refuse) makes it an error with file and
/// line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct Fault {
    keys: &'static [&'static str],
    text: Option<String>,
    reason: String,
}

impl Fault {
    /// A fault of the value, or the table, to which `keys` lead, outermost first: `&["robot", "listen"]`. The reason
    /// also says what to do.
    pub fn at(keys: &'static [&'static str], reason: impl Into<String>) -> Fault {
        Fault {
            keys,
            text: None,
            reason: reason.into(),
        }
    }

    /// Only this text is meant of what lies there: an entry of the list, a key of the table, or the value itself. Where
    /// it is another one in the file, the fault is not the file's: its value came from the command line.
    #[must_use]
    pub fn of(self, text: impl Into<String>) -> Fault {
        Fault {
            text: Some(text.into()),
            ..self
        }
    }

    /// What is wrong, and what to do.
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// Where it stands in a file, bytes from the beginning; `None` if the file does not say it.
    pub(super) fn start(&self, file: &str) -> Option<usize> {
        let document = DeTable::parse(file).ok()?;
        let (last, path) = self.keys.split_last()?;
        let mut table = document.get_ref();
        for key in path {
            table = table.get(*key)?.get_ref().as_table()?;
        }
        let (key, value) = table.get_key_value(*last)?;
        match &self.text {
            None => Some(key.span().start),
            Some(text) if value.get_ref().as_str() == Some(text) => Some(value.span().start),
            Some(text) => start_within(value.get_ref(), text),
        }
    }
}

/// Where a list or a table has a text. A file has few levels, which its reader bounds.
fn start_within(value: &DeValue<'_>, text: &str) -> Option<usize> {
    match value {
        DeValue::Array(entries) => entries.iter().find_map(|entry| match entry.get_ref() {
            DeValue::String(found) if found == text => Some(entry.span().start),
            inner => start_within(inner, text),
        }),
        DeValue::Table(table) => table.iter().find_map(|(key, entry)| {
            let is_meant = key.get_ref() == text || entry.get_ref().as_str() == Some(text);
            match is_meant {
                true => Some(key.span().start),
                false => start_within(entry.get_ref(), text),
            }
        }),
        _ => None,
    }
}

/// The reader's message, with a suggestion for a word that it does not know.
pub(super) fn explain(message: &str) -> String {
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

/// Of the `expected` words the one nearest to `unknown`, if it is near enough to be a slip of the keyboard: for "did
/// you mean".
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
    use super::*;

    const FILE: &str = "\
[robot]
listen = [
    \"tcp/a:1\",
    \"tcp/b:1\",
]
name = \"x\"
[security]
robots = { one = 1,
  two = 2 }
[[topics.rules]]
key = \"a\"
[[topics.rules]]
key = \"b\"
";

    fn line(fault: &Fault) -> Option<usize> {
        let before = &FILE[..fault.start(FILE)?];
        Some(1 + before.matches('\n').count())
    }

    #[test]
    fn a_fault_is_found_by_its_keys_and_its_text() {
        let of = |keys, text| line(&Fault::at(keys, "wrong").of(text));
        assert_eq!(line(&Fault::at(&["robot"], "wrong")), Some(1));
        assert_eq!(line(&Fault::at(&["robot", "listen"], "wrong")), Some(2));
        assert_eq!(of(&["robot", "listen"], "tcp/b:1"), Some(4));
        assert_eq!(of(&["robot", "name"], "x"), Some(6));
        assert_eq!(of(&["security", "robots"], "two"), Some(9));
        assert_eq!(of(&["topics", "rules"], "b"), Some(13));
    }

    #[test]
    fn what_the_file_does_not_say_is_no_fault_of_the_file() {
        let of = |keys, text| line(&Fault::at(keys, "wrong").of(text));
        assert_eq!(of(&["robot", "listen"], "tcp/of-the-command-line:1"), None);
        assert_eq!(of(&["robot", "name"], "y"), None);
        assert_eq!(line(&Fault::at(&["station", "listen"], "wrong")), None);
        assert_eq!(line(&Fault::at(&["robot", "connect"], "wrong")), None);
        assert_eq!(Fault::at(&[], "wrong").start("not [ toml"), None);
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
}
