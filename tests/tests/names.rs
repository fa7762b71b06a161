//! A type's name says what it is: few names stand for three types or more, so that a reader who meets one seldom has to
//! look up which one it is.
//!
//! Counted are the types and traits of the product, in all crates of the workspace; neither tests and measuring
//! programs nor the associated types of traits.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::imports::{code, crates, is_of_word};

/// Names of three types or more that there may be, those of [`ROLES`] included.
const AT_MOST: usize = 25;

/// Names that many crates give to the type that has this part in them; the path tells them apart.
const ROLES: [(&str, &str); 6] = [
    ("Cli", "what clap makes of a program's command line"),
    ("Config", "the whole configuration of a program"),
    ("Event", "what a pure core or a library reports"),
    ("Input", "what a pure core takes"),
    ("Output", "what a pure core gives"),
    ("Settings", "what a library is given when it begins"),
];

/// Crates that are no part of the product.
const ASIDE: [&str; 3] = ["tests", "workbench/", "crates/ipc-fixtures"];

/// The sources of the product.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder that can be read") {
        let path = entry.expect("an entry").path();
        let stem = path.file_stem().and_then(|stem| stem.to_str());
        if stem.is_some_and(|stem| stem == "tests" || stem.ends_with("_tests")) {
            continue;
        }
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The name that a line gives to a type or a trait.
fn defined(line: &str) -> Option<&str> {
    let is_inner = line.starts_with(' ');
    let mut words = line.split_whitespace().peekable();
    if words
        .next_if(|word| word.starts_with("pub"))
        .is_some_and(|word| !word.ends_with(')') && word != "pub")
    {
        // `pub(in super::super)` is two words.
        words.next();
    }
    let keyword = words.next()?;
    let is_type = match keyword {
        "struct" | "enum" | "union" | "trait" => true,
        "type" => !is_inner,
        _ => false,
    };
    let name = words.next().filter(|_| is_type)?;
    let name = name.split(|letter| !is_of_word(letter)).next()?;
    name.starts_with(|first: char| first.is_ascii_uppercase())
        .then_some(name)
}

#[test]
fn few_names_stand_for_three_types_or_more() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    for member in crates() {
        if !ASIDE.iter().any(|aside| member.starts_with(aside)) {
            sources(&root.join(member).join("src"), &mut files);
        }
    }
    let mut named: BTreeMap<String, Vec<&Path>> = BTreeMap::new();
    for file in &files {
        let source = fs::read_to_string(file).expect("a source that can be read");
        for name in code(&source).lines().filter_map(defined) {
            named.entry(name.to_owned()).or_default().push(file);
        }
    }
    assert!(named.len() > 1000, "the search finds {} names", named.len());
    named.retain(|_, files| files.len() > 2);

    for (role, _) in ROLES {
        assert!(
            named.remove(role).is_some(),
            "{role} is not the name of three types: take it from ROLES"
        );
    }
    assert!(
        named.len() + ROLES.len() <= AT_MOST,
        "{AT_MOST} names may stand for three types or more; give these types names of their own: {named:#?}"
    );
}

#[test]
fn the_search_knows_a_definition() {
    for (line, name) in [
        ("pub struct Link<'a> {", Some("Link")),
        ("    struct Inner;", Some("Inner")),
        ("pub(in super::super) enum Step {", Some("Step")),
        ("pub(crate) type Key = u64;", Some("Key")),
        ("    type Key = u64;", None),
        ("pub fn of() -> Link {", None),
        ("struct $name {", None),
        ("use crate::Link;", None),
    ] {
        assert_eq!(defined(line), name, "{line}");
    }
}
