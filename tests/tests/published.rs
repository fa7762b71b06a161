//! What others depend on: the crates that are published, in themselves and as a registry and a stranger see them.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use serde_json::Value;

use super::{metadata, sources, workspace};

/// Each can be had without the others that stand after it.
const PUBLISHED: [&str; 5] = [
    "dsp-protocol",
    "ipc-types",
    "ril-runtime",
    "module-kit",
    "ipc-fixtures",
];

/// The packages of what cargo says.
fn packages(metadata: &Value) -> &[Value] {
    metadata["packages"].as_array().expect("packages")
}

/// A text of a package.
fn text<'a>(package: &'a Value, key: &str) -> &'a str {
    package[key].as_str().unwrap_or_default()
}

/// `1.89` as numbers. Who declares none takes any compiler.
fn version(text: &str) -> [u32; 3] {
    let mut parts = text.split('.').map(|part| part.parse().unwrap_or(0));
    std::array::from_fn(|_| parts.next().unwrap_or(0))
}

#[test]
fn what_is_published_has_all_that_a_registry_and_its_readers_ask_for() {
    let metadata = metadata(&["--no-deps"]);
    // `publish = false` is an empty list of registries.
    let is_published = |package: &&Value| package["publish"].is_null();
    let published: Vec<_> = packages(&metadata).iter().filter(is_published).collect();
    let names: BTreeSet<_> = published.iter().map(|it| text(it, "name")).collect();
    assert_eq!(names, BTreeSet::from(PUBLISHED));
    let packaged = PUBLISHED.map(|name| format!("-p {name}")).join(" ");
    let ci = fs::read_to_string(workspace().join(".ci/run")).unwrap();
    assert!(ci.contains(&format!("published=({packaged})")));
    for package in published {
        let name = text(package, "name");
        for key in ["description", "license", "readme", "rust_version"] {
            assert_ne!(text(package, key), "", "{name} has no {key}");
        }
        for (key, most) in [("keywords", 5), ("categories", 5)] {
            let count = package[key].as_array().map_or(0, Vec::len);
            assert!((1..=most).contains(&count), "{name}: {count} {key}");
        }
        assert_eq!(
            package["metadata"]["docs"]["rs"]["all-features"], true,
            "{name}"
        );
        let before = PUBLISHED.iter().take_while(|one| **one != name);
        let before: BTreeSet<_> = before.copied().collect();
        for dependency in package["dependencies"].as_array().expect("a list") {
            // Without its path, a published crate has what stands beside it. Its tests are not built elsewhere.
            if dependency["path"].is_string() && dependency["kind"] != "dev" {
                let to = text(dependency, "name");
                assert_ne!(text(dependency, "req"), "*", "{name} → {to} has no version");
                assert!(
                    before.contains(to),
                    "{name} → {to} is published later, or not"
                );
            }
        }
    }
}

#[test]
fn what_is_packaged_by_itself_has_the_licences_of_the_project() {
    let folders = "bindings/python crates/dsp-protocol crates/ipc-fixtures crates/module-kit crates/runtime ipc-types";
    for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
        let whole = fs::read(workspace().join(licence)).unwrap();
        for folder in folders.split(' ') {
            let own = fs::read(workspace().join(folder).join(licence)).unwrap();
            assert!(
                own == whole,
                "{folder}/{licence} is not that of the project"
            );
        }
    }
}

#[test]
fn nothing_is_built_of_what_asks_for_a_newer_compiler_than_is_promised() {
    // What other platforms need has not been fetched.
    let platform = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let metadata = metadata(&["--filter-platform", &platform]);
    let own = packages(&metadata)
        .iter()
        .find(|it| text(it, "name") == "ipc-types");
    let promised = text(own.expect("ipc-types"), "rust_version");
    for package in packages(&metadata) {
        let asked = text(package, "rust_version");
        let (name, number) = (text(package, "name"), text(package, "version"));
        assert!(
            version(asked) <= version(promised),
            "{name} {number} needs Rust {asked}, not {promised}"
        );
    }
    let pages = [
        ("README.md", format!("Rust {promised} or newer")),
        ("CONTRIBUTING.md", format!("Rust {promised} or newer")),
        (".ci/run", format!("cargo +{promised} check")),
        (
            "bindings/python/Cargo.toml",
            format!("rust-version = \"{promised}\""),
        ),
    ];
    for (page, words) in pages {
        let page_text = fs::read_to_string(workspace().join(page)).unwrap();
        assert!(page_text.contains(&words), "{page} does not say: {words}");
    }
}

/// What a stranger builds for the fixtures, all in all.
const MOST_CRATES: usize = 75;

#[test]
fn the_fixtures_of_strangers_are_few_crates_and_know_no_helicopter() {
    for package in ["ipc-types", "ipc-fixtures"] {
        let tree = [
            "tree",
            "--offline",
            "--prefix=none",
            "--edges=normal,build",
            "-p",
            package,
        ];
        let output = Command::new(env!("CARGO"))
            .args(tree)
            .output()
            .expect("cargo");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let crates: BTreeSet<_> = text
            .lines()
            .map(|line| line.trim_end_matches(" (*)"))
            .collect();
        println!("{package}: {} crates", crates.len());
        assert!(
            (1..=MOST_CRATES).contains(&crates.len()),
            "{package}: {crates:?}"
        );
    }
    let words = [
        "hero_", "heli", "flight", "flying", "bridge", "dsp", "rotor", "waypoint", "movement",
    ];
    for path in sources(&workspace().join("crates/ipc-fixtures/src"), &[]) {
        let source = fs::read_to_string(&path).expect("a source");
        let public = source.split("#[cfg(test)]").next().unwrap_or_default();
        for line in public
            .lines()
            .filter(|line| line.contains("pub ") || line.contains("///"))
        {
            let word = words
                .iter()
                .find(|word| line.to_lowercase().contains(**word));
            assert_eq!(word, None, "{}: {line}", path.display());
        }
    }
}
