//! [`Fault`]: what is wrong with a configuration whose values can all be read, and in which line of the file.

use toml::de::{DeTable, DeValue};

/// What is wrong with a configuration although each of its values could be read: two values that do not fit together, a file that
/// is named and cannot be used. [`Loaded::refuse`](super::Loaded::refuse) makes it an error with file and line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct Fault {
    keys: &'static [&'static str],
    text: Option<String>,
    reason: String,
}

impl Fault {
    /// A fault of the value, or the table, to which `keys` lead, outermost first: `&["robot", "listen"]`. The reason also says
    /// what to do.
    pub fn at(keys: &'static [&'static str], reason: impl Into<String>) -> Fault {
        Fault {
            keys,
            text: None,
            reason: reason.into(),
        }
    }

    /// Only this text is meant of what lies there: an entry of the list, a key of the table, or the value itself. Where it is
    /// another one in the file, the fault is not the file's: its value came from the command line.
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
}
