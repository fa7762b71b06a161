//! The manual has a page for each verb, and each page is one that `man` and `mandoc` take.

use ril_tests::Sandbox;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::CommandFactory;
use ril::cli::Cli;

use super::has;
use crate::common::sandbox;

/// The pages of `ril`, in a folder of the test.
fn pages(rig: &Sandbox) -> Vec<PathBuf> {
    rig.run("man --to man/man1", 0);
    let folder = std::fs::read_dir(rig.folder().join("man/man1")).unwrap();
    folder.map(|entry| entry.unwrap().path()).collect()
}

/// The verbs that the help shows, by the names of their pages, with their long options.
fn verbs(command: &clap::Command, name: &str, all: &mut Vec<(String, Vec<String>)>) {
    let shown = command.get_arguments().filter(|one| !one.is_hide_set());
    let options = shown.filter_map(|one| one.get_long().map(str::to_owned));
    all.push((format!("{name}.1"), options.collect()));
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
        verbs(verb, &format!("{name}-{}", verb.get_name()), all);
    }
}

#[test]
fn each_verb_has_a_page_with_all_its_options() {
    let rig = sandbox();
    let pages = pages(&rig);
    let mut all = Vec::new();
    verbs(&Cli::command(), "ril", &mut all);
    let expected: BTreeSet<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
    let names = pages
        .iter()
        .map(|page| page.file_name().unwrap().to_str().unwrap());
    assert_eq!(names.collect::<BTreeSet<_>>(), expected);
    for (name, options) in &all {
        let text = std::fs::read_to_string(rig.folder().join("man/man1").join(name)).unwrap();
        // In the language of `man` a dash is escaped.
        let text = text.replace('\\', "");
        for option in options {
            assert!(
                text.contains(&format!("--{option}")),
                "{name} has no --{option}"
            );
        }
    }
}

#[test]
fn the_pages_are_ones_that_man_takes() {
    let rig = sandbox();
    let pages = pages(&rig);
    let complaints = |program: &str, args: &[&str], page: &Path| {
        let mut command = Command::new(program);
        command
            .args(args)
            .arg(page)
            .env("MANWIDTH", "80")
            .env("LC_ALL", "C.UTF-8");
        let output = command.output().unwrap();
        String::from_utf8_lossy(match program {
            "mandoc" => &output.stdout,
            _ => &output.stderr,
        })
        .into_owned()
    };
    for (program, args) in [
        ("mandoc", &["-Tlint", "-Werror"][..]),
        ("man", &["--warnings", "--local-file"]),
    ] {
        if !has(program, "it does not read the manual") {
            continue;
        }
        for page in &pages {
            let said = complaints(program, args, page);
            assert!(said.is_empty(), "{program} {}: {said}", page.display());
        }
    }
}
