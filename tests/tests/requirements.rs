//! The documents are right: every test that `docs/requirements.md` names exists, and every link leads somewhere.

use std::fs;

use ril_tests::languages::{documents, root};

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

/// Whether `name` is a test in `source`: one by its attribute, or one of the list of a program that runs its tests
/// itself.
fn is_test(source: &str, name: &str) -> bool {
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let functions = (0..lines.len()).filter(|at| lines[*at].contains(&format!("fn {name}(")));
    let has_attribute = |at: usize| {
        let above = lines[..at].iter().rev();
        let mut above = above.take_while(|line| line.starts_with("#[") || line.starts_with("//"));
        above.any(|line| *line == "#[test]")
    };
    let is_listed = source.contains("const TESTS") && lines.contains(&&*format!("{name},"));
    let mut functions = functions.peekable();
    functions.peek().is_some() && (is_listed || functions.any(has_attribute))
}

#[test]
fn a_test_is_one_by_its_attribute_or_by_the_list_of_its_program() {
    let source = "#[test]\n// Why.\n#[ignore]\nfn one() {}\nfn two() {}\n";
    assert!(is_test(source, "one") && !is_test(source, "two") && !is_test(source, "three"));
    let source = "const TESTS: &[Test] = &tests![\n    two,\n];\nfn two() {}\nfn three() {}\n";
    assert!(is_test(source, "two") && !is_test(source, "three"));
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
                Some(function) => is_test(&source, function),
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
