//! The documents are right: every test that `docs/requirements.md` names exists, and every link leads somewhere.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// What a row names after "shown by": a file in backticks, and after it perhaps functions, with commas between.
fn named_tests(row: &str) -> Vec<(String, Option<String>)> {
    let shown_by = row.trim_end().trim_end_matches('|').rsplit('|').next();
    let mut named: Vec<(String, Option<String>)> = Vec::new();
    for entry in shown_by.into_iter().flat_map(|cell| cell.split(',')) {
        let entry = entry.trim();
        let file = entry
            .strip_prefix('`')
            .and_then(|rest| rest.split_once('`'));
        let (file, function) = match (file, named.last()) {
            (Some((file, function)), _) => (file.to_owned(), function.trim()),
            (None, Some((file, _))) => (file.clone(), entry),
            (None, None) => continue,
        };
        named.push((file, (!function.is_empty()).then(|| function.to_owned())));
    }
    named
}

#[test]
fn every_test_that_the_table_names_is_there() {
    let table = fs::read_to_string(root().join("docs/requirements.md")).unwrap();
    let (mut checked, mut missing) = (0, Vec::new());
    for row in table.lines().filter(|line| line.starts_with("| ")) {
        for (file, function) in named_tests(row) {
            checked += 1;
            let source = fs::read_to_string(root().join(&file)).unwrap_or_default();
            let found = match &function {
                Some(function) => source.contains(&format!("fn {function}(")),
                None => source.contains("#[test]"),
            };
            if !found {
                missing.push(format!("{file} {}", function.unwrap_or_default()));
            }
        }
    }
    assert!(checked > 40, "the table was not understood: {checked}");
    assert!(
        missing.is_empty(),
        "docs/requirements.md names tests that are not there: {missing:#?}"
    );
}

/// The documents below `folder`.
fn documents(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries
        .flat_map(|entry| {
            let (path, name) = (entry.path(), entry.file_name());
            let name = name.to_string_lossy();
            let is_source = !name.starts_with('.') && name != "target" && name != "node_modules";
            match entry.file_type().unwrap().is_dir() {
                true if is_source => documents(&path),
                false if name.ends_with(".md") => vec![path],
                _ => vec![],
            }
        })
        .collect()
}

/// Whether `document` has a heading with this anchor, as GitHub makes it.
fn has_anchor(document: &str, anchor: &str) -> bool {
    let headings = document.lines().filter(|line| line.starts_with('#'));
    let mut anchors = headings.map(|line| {
        let text = line.trim_start_matches('#').trim().to_lowercase();
        let kept = text
            .chars()
            .filter(|c| c.is_alphanumeric() || "-_ ".contains(*c));
        kept.collect::<String>().replace(' ', "-")
    });
    anchors.any(|one| one == anchor)
}

#[test]
fn every_link_leads_somewhere() {
    let (mut checked, mut dead) = (0, Vec::new());
    for document in documents(&root()) {
        let text = fs::read_to_string(&document).unwrap();
        for link in text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next())
        {
            if link.contains("://") || link.contains(char::is_whitespace) {
                continue;
            }
            checked += 1;
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match path {
                "" => document.clone(),
                path => document.parent().unwrap().join(path),
            };
            let is_there = match anchor {
                "" => target.exists(),
                anchor => fs::read_to_string(&target).is_ok_and(|text| has_anchor(&text, anchor)),
            };
            if !is_there {
                dead.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(checked > 200, "only {checked} links were found");
    assert!(dead.is_empty(), "{dead:#?}");
}
