//! `docs/requirements.md` tells the truth: every test that it names is there.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// What a row names after "shown by": a file in backticks, and after it perhaps the name of a function.
fn named_tests(row: &str) -> Vec<(String, Option<String>)> {
    let shown_by = row.trim_end().trim_end_matches('|').rsplit('|').next();
    shown_by
        .into_iter()
        .flat_map(|cell| cell.split(','))
        .filter_map(|entry| {
            let (file, function) = entry.trim().strip_prefix('`')?.split_once('`')?;
            let function = function.trim();
            Some((
                file.to_owned(),
                (!function.is_empty()).then(|| function.to_owned()),
            ))
        })
        .collect()
}

#[test]
fn every_test_that_the_table_names_is_there() {
    let table = std::fs::read_to_string(root().join("docs/requirements.md")).unwrap();
    let (mut checked, mut missing) = (0, Vec::new());
    for row in table.lines().filter(|line| line.starts_with("| ")) {
        for (file, function) in named_tests(row) {
            checked += 1;
            let source = std::fs::read_to_string(root().join(&file)).unwrap_or_default();
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
