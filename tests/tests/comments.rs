//! A comment stands alone: rustdoc shows one item without its neighbours and without the head of its module. So no
//! comment begins by pointing at another one, and each line has at most 120 characters.
//!
//! Judged are all Rust files of the workspace, tests, examples and measuring programs included.

use std::fs;
use std::path::{Path, PathBuf};

use super::imports::is_of_word;

/// How no paragraph of a comment begins: a reader who sees one item does not see what these point at.
const OPENINGS: [&str; 12] = [
    "The same",
    "Same as",
    "As above",
    "As before",
    "As for",
    "Likewise",
    "Ditto",
    "Another one",
    "The other one",
    "See above",
    "See the header",
    "See the module",
];

/// What no comment says anywhere.
const POINTER: &str = "See the module's documentation";

/// Most characters of a line that is a comment.
const MAX_CHARACTERS: usize = 120;

/// The Rust files below `folder`, without what cargo builds and without hidden folders.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder that can be read") {
        let entry = entry.expect("an entry");
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        // A link may lead out of the workspace, or in a circle.
        if entry.file_type().expect("a type").is_dir() {
            if name != "target" && !name.starts_with('.') {
                sources(&path, found);
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// What a line says that is a comment; `None` if it is code.
fn comment(line: &str) -> Option<&str> {
    let text = line.trim_start().strip_prefix("//")?;
    let text = text.strip_prefix(['/', '!']).unwrap_or(text);
    Some(text.strip_prefix(' ').unwrap_or(text))
}

fn points_elsewhere(text: &str) -> bool {
    OPENINGS.iter().any(|opening| {
        text.strip_prefix(opening)
            .is_some_and(|rest| !rest.starts_with(is_of_word))
    })
}

/// What is wrong with the comments of a source, each with the number of its line.
///
/// Too long may be a row of a table, a line of an example or of a drawing, and the documentation of a struct in shared
/// memory, whose lines are those of its schema.
fn offences(source: &str) -> Vec<(usize, &'static str)> {
    let mut found = Vec::new();
    let mut before: Option<&str> = None;
    let (mut is_example, mut is_schema) = (false, false);
    for (number, line) in (1..).zip(source.lines()) {
        is_schema = (is_schema || line.ends_with("shared_struct! {")) && line != "}";
        let Some(text) = comment(line) else {
            (before, is_example) = (None, false);
            continue;
        };
        let begins = before.is_none_or(|before| before.is_empty() || before.starts_with('#'));
        before = Some(text);
        if text.trim_start().starts_with("```") {
            is_example = !is_example;
        }
        if begins && points_elsewhere(text) || text.contains(POINTER) {
            found.push((number, "it points at its neighbours: say what the item is"));
        }
        let is_table = text.starts_with(['|', '…']);
        let may_be_long = is_example || is_schema || is_table;
        if line.chars().count() > MAX_CHARACTERS && !may_be_long {
            found.push((number, "its line is too long"));
        }
    }
    found
}

#[test]
fn every_comment_stands_alone() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 1000, "the search finds {} files", files.len());
    let mut all = Vec::new();
    for file in &files {
        let source = fs::read_to_string(file).expect("a source that can be read");
        let name = file.strip_prefix(&root).unwrap_or(file).display();
        for (line, why) in offences(&source) {
            all.push(format!("{name}:{line}: {why}"));
        }
    }
    assert!(all.is_empty(), "\n{}\n", all.join("\n"));
}

#[test]
fn the_search_knows_a_comment_that_points_elsewhere() {
    let cases: [(&str, &[usize]); 9] = [
        ("/// The same for a plan.", &[1]),
        ("    /// As above.\nfn of() {}", &[1]),
        ("//! Ditto", &[1]),
        ("// Same as `of`.", &[1]),
        ("/// Gives it.\n///\n/// # Errors\n/// As above.", &[4]),
        ("/// A plan; See the module's documentation.", &[1]),
        (
            "/// It ends where a line does.\n/// The same seed draws it.",
            &[],
        ),
        ("/// As formed by the parser.", &[]),
        ("let text = \"// The same\";", &[]),
    ];
    for (source, lines) in cases {
        let found: Vec<usize> = offences(source).iter().map(|(line, _)| *line).collect();
        assert_eq!(found, lines, "{source}");
    }
}

#[test]
fn the_search_knows_a_comment_that_is_too_long() {
    let long = "a word ".repeat(20);
    for (source, count) in [
        (format!("/// {long}"), 1),
        (format!("/// | {long}"), 0),
        (format!("/// ```\n/// {long}\n/// ```\n/// {long}"), 1),
        (format!("shared_struct! {{\n/// {long}\n}}\n/// {long}"), 1),
        (format!("let text = \"{long}\";"), 0),
    ] {
        assert_eq!(offences(&source).len(), count, "{source}");
    }
}
