//! The table of the checks and the page that it quotes.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use conform::table::{chosen, table};
use dsp_protocol::Profile;

/// The sections of docs/protocol.md: number and text, in one line.
fn sections() -> Vec<(String, String)> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/protocol.md");
    let text = fs::read_to_string(page).expect("the page");
    let mut sections: Vec<(String, String)> = Vec::new();
    for line in text.lines() {
        let heading = line.strip_prefix("## ").or(line.strip_prefix("### "));
        let number = heading.and_then(|heading| heading.split(' ').next());
        // `### 16 bits` is a part of section 6.
        let is_section = |number: &&str| {
            number.starts_with(|first: char| first.is_ascii_digit())
                && (line.starts_with("## ") || number.contains('.'))
        };
        match number.filter(is_section) {
            Some(number) => sections.push((number.to_owned(), String::new())),
            None => {
                if let Some((_, text)) = sections.last_mut() {
                    text.push_str(line.trim());
                    text.push(' ');
                }
            }
        }
    }
    sections
}

#[test]
fn every_sentence_stands_in_its_section_of_the_page() {
    let sections = sections();
    let mut missing = Vec::new();
    for check in table() {
        let text = sections.iter().find(|(number, _)| *number == check.section);
        if !text.is_some_and(|(_, text)| text.contains(&check.sentence)) {
            missing.push(format!("{}: {}", check.id, check.sentence));
        }
    }
    assert!(
        missing.is_empty(),
        "not in the page:\n{}",
        missing.join("\n")
    );
}

#[test]
fn no_two_checks_have_a_name_and_each_begins_with_its_section() {
    let mut names = BTreeSet::new();
    for check in table() {
        assert!(names.insert(check.id.clone()), "{}", check.id);
        let start = format!("{}-", check.section);
        let topic = check.id.strip_prefix(&start);
        assert!(topic.is_some_and(|topic| !topic.is_empty()), "{}", check.id);
    }
}

#[test]
fn a_choice_is_by_name_or_section() {
    let ids = |only: &[&str]| -> Vec<String> {
        let only: Vec<String> = only.iter().map(|one| (*one).to_owned()).collect();
        let chosen = chosen(Profile::Classic, &only);
        chosen.into_iter().map(|check| check.id).collect()
    };
    assert_eq!(ids(&["8.2-ack-time"]), ["8.2-ack-time"]);
    assert!(ids(&["8.3"]).len() >= 8);
    assert!(ids(&["8.3"]).iter().all(|id| id.starts_with("8.3")));
    assert_eq!(ids(&["nothing"]).len(), 0);
    assert!(ids(&[]).len() > ids(&["6"]).len());
}
