//! What is said of a verification.

use replay::JournalSpan;

use super::*;

const AT: MonotonicNs = MonotonicNs(12_000_000_000);

fn of(recorded: [u64; 2], against: bool) -> Of<'static> {
    Of {
        file: "flight.mcap",
        against,
        start: MonotonicNs(10_000_000_000),
        recorded,
        took: Duration::from_millis(5),
    }
}

/// The bridge's journal, with `samples` that are the same.
fn verdict(samples: u64, differences: Vec<Difference>) -> Comparison {
    Comparison {
        bridge: JournalVerdict {
            pieces: 3,
            snapshots: 1,
            inputs: 40,
            samples,
            spans: vec![JournalSpan { from: AT, to: AT }],
            difference_count: differences.len() as u64,
            differences,
            ..JournalVerdict::default()
        },
        ..Comparison::default()
    }
}

fn difference(topic: &str, field: &str, recorded: &str, replayed: &str) -> Difference {
    Difference {
        at: AT,
        topic: topic.to_owned(),
        field: field.to_owned(),
        recorded: recorded.to_owned(),
        replayed: replayed.to_owned(),
    }
}

#[test]
fn codes_are_in_words_and_other_numbers_as_they_are() {
    #[rustfmt::skip]
    let cases = [
        ("requests", "stage", "1", "16", "stage was accepted and is done"),
        ("requests", "reason", "0", "4", "reason was none and is too-far"),
        ("requests", "imi_error", "0", "2", "imi_error was no-error and is impossible-to-stop-module"),
        ("requests", "stage", "1", "99", "stage was accepted and is 99"),
        ("requests", "waypoint", "1", "2", "waypoint was 1 and is 2"),
        ("module_state", "functionality", "1", "4", "functionality was at-rest and is following-path"),
        ("module_state", "safety.amount", "0", "4", "safety.amount was 0 and is 4"),
        (
            "serial/sent",
            "byte 3",
            "0x01 (of 4 bytes)",
            "nothing (of 3 bytes)",
            "byte 3 was 0x01 (of 4 bytes) and is nothing (of 3 bytes)",
        ),
    ];
    for (topic, field, recorded, replayed, expected) in cases {
        let differences = vec![difference(topic, field, recorded, replayed)];
        let shown = Verification::new(&verdict(7, differences), &of([7, 0], false)).to_string();
        let line = format!("at 2.000000 s, {topic}: {expected}\n");
        assert!(shown.contains(&line), "{line:?} is missing in\n{shown}");
    }
}

#[test]
fn a_journal_that_does_not_reach_over_the_whole_file_is_no_proof_of_the_whole() {
    let whole = Verification::new(&verdict(175, Vec::new()), &of([175, 0], false)).to_string();
    assert!(whole.contains("the same, bit for bit\n"), "{whole}");
    assert!(whole.contains("the same: 175 samples,"), "{whole}");
    let part = Verification::new(&verdict(70, Vec::new()), &of([175, 0], false)).to_string();
    for expected in [
        "the same, bit for bit, as far as the journals reach\n",
        "the same: 70 of 175 samples,",
    ] {
        assert!(part.contains(expected), "{part}");
    }
}

/// A journal begins with its process: what it has of before the recording is no part of that.
#[test]
fn samples_of_before_the_recording_hide_none_that_is_missing_in_it() {
    let mut journal = verdict(175, Vec::new());
    journal.bridge.samples_before = 10;
    let part = Verification::new(&journal, &of([170, 0], false)).to_string();
    assert!(part.contains("as far as the journals reach\n"), "{part}");
    assert!(part.contains("the same: 165 of 170 samples,"), "{part}");
    let whole = Verification::new(&journal, &of([165, 0], false)).to_string();
    assert!(whole.contains("the same, bit for bit\n"), "{whole}");
}

#[test]
fn with_another_configuration_only_the_first_difference_is_sure() {
    let two = || vec![difference("requests", "waypoint", "1", "2"); 2];
    for (against, lines, is_consequence) in [(true, 1, true), (false, 2, false)] {
        let shown = Verification::new(&verdict(7, two()), &of([7, 0], against)).to_string();
        assert_eq!(shown.matches("waypoint was 1 and is 2").count(), lines);
        assert_eq!(
            shown.contains("and 1 more, which may be a consequence"),
            is_consequence,
            "{shown}"
        );
    }
}
