//! What the tests of every configuration prove alike. No program calls it.

use std::collections::BTreeSet;
use std::fmt::Debug;

use serde::de::DeserializeOwned;

use super::{ConfigError, parse};

/// A key that no table has, and that resembles none.
const UNKNOWN: &str = "qqqqqqqq";

/// Proves that an annotated file says the defaults, and names every setting of `T`, be it behind a `#`: who reads the
/// file finds what can be set, and `--check-config` prints what the file names. Each of its tables refuses a key that
/// is no setting, but for those in `maps`, whose keys a user chooses.
///
/// Settings within braces, as in `{ warn = 1.0, fail = 0.5 }`, are not looked at.
///
/// # Panics
///
/// When it is not so.
pub fn assert_annotated<T>(annotated: &str, maps: &[&str])
where
    T: DeserializeOwned + Default + PartialEq + Debug,
{
    let read = |text: &str| parse::<T>(text, "annotated.toml").unwrap();
    assert_eq!(read(annotated), T::default());
    assert_eq!(read(""), T::default());
    let (tables, keys) = named(annotated);
    for (table, header) in &tables {
        if maps.contains(&table.as_str()) {
            continue;
        }
        let text = format!("{header}\n{UNKNOWN} = 0");
        let Err(ConfigError::Invalid { reason, .. }) = parse::<T>(&text, "annotated.toml") else {
            panic!("{text} is not refused");
        };
        let list = reason.split_once(&format!("unknown field `{UNKNOWN}`, expected "));
        let (_, list) = list.unwrap_or_else(|| panic!("{text}: {reason}"));
        for setting in list.split('`').skip(1).step_by(2) {
            let path = joined(table, setting);
            assert!(
                keys.contains(&path) || tables.iter().any(|(table, _)| *table == path),
                "the annotated file does not name `{path}`"
            );
        }
    }
}

/// The tables that a file names, each with its header, and the paths of its keys; what is behind a `#` counts as if it
/// were not.
fn named(annotated: &str) -> (Vec<(String, String)>, BTreeSet<String>) {
    let mut tables = vec![(String::new(), String::new())];
    let mut keys = BTreeSet::new();
    let mut table = String::new();
    for line in annotated.lines() {
        let line = line.trim_start_matches(['#', ' ']);
        let word = |text: &str| {
            let is_of_word =
                |letter: char| letter.is_ascii_alphanumeric() || "_-.".contains(letter);
            !text.is_empty() && text.chars().all(is_of_word)
        };
        let header = line
            .split_inclusive(']')
            .take_while(|part| part.ends_with(']'));
        let header: String = header.collect();
        let name = header.trim_matches(['[', ']']);
        if line.starts_with('[') && word(name) {
            table = name.to_owned();
            // Of `[a.b]`, the table `a` is named too.
            for (end, _) in name.match_indices('.') {
                tables.push((name[..end].to_owned(), format!("[{}]", &name[..end])));
            }
            tables.push((table.clone(), header));
        } else if let Some((key, _)) = line.split_once('=').filter(|(key, _)| word(key.trim())) {
            keys.insert(joined(&table, key.trim()));
        }
    }
    (tables, keys)
}

fn joined(table: &str, key: &str) -> String {
    match table {
        "" => key.to_owned(),
        _ => format!("{table}.{key}"),
    }
}

/// Proves that each of the texts, between which a line is `---`, is refused as a `T`: the error names the line that
/// ends with `#!`, and has the words behind that.
///
/// # Panics
///
/// When one is not.
pub fn assert_refused<T: DeserializeOwned + Debug>(texts: &str) {
    let lines: Vec<&str> = texts.lines().skip(1).collect();
    for case in lines.split(|line| line.trim() == "---") {
        let (mut text, mut expected) = (String::new(), None);
        for (index, line) in case.iter().enumerate() {
            let (line, reason) = line.split_once("#!").unwrap_or((line, ""));
            if line.len() < case[index].len() {
                expected = Some((index + 1, reason.trim()));
            }
            text += &format!("{line}\n");
        }
        let (line, reason) = expected.unwrap_or_else(|| panic!("no line of {text} ends with `#!`"));
        let error = parse::<T>(&text, "x.toml").unwrap_err().to_string();
        let place = format!("x.toml:{line}: ");
        assert!(error.starts_with(&place), "{text}\n{error}");
        assert!(error.contains(reason), "{text}\n{error}");
        assert_eq!(error.lines().count(), 1, "{error:?}");
    }
}
