//! What a repair did.

use ipc_types::Repair;

use super::super::facts::{Look, Trouble};
use super::finding::{About, Finding, Subject};
use crate::words::count_irregular;

const ABOUT: About = About(Subject::Repair);

/// What became of the repair.
pub(super) fn diagnose(repair: &Look<Repair>) -> Vec<Finding> {
    match repair {
        Ok(repair) => done(repair),
        Err(trouble @ Trouble::TookTooLong(_)) => vec![ABOUT.error(
            "repair-failed",
            format!("the repair {trouble}; what it did so far stays done"),
            "stop every process of the domain and repair again",
        )],
        Err(trouble @ Trouble::Failed(_)) => vec![ABOUT.error(
            "repair-failed",
            format!("the repair {trouble}"),
            "do what is said there, then repair again",
        )],
    }
}

fn done(repair: &Repair) -> Vec<Finding> {
    let Repair {
        robots,
        generations,
        leftovers,
    } = *repair;
    let removed = [
        (
            robots,
            "robot in which no process was",
            "robots in which no process was",
        ),
        (
            generations,
            "generation of shared memory in which no process was",
            "generations of shared memory in which no process was",
        ),
        (leftovers, "thing half removed", "things half removed"),
    ];
    let mut findings: Vec<Finding> = removed
        .into_iter()
        .filter(|(number, ..)| *number > 0)
        .map(|(number, singular, plural)| {
            let text = format!("removed: {}", count_irregular(number, singular, plural));
            ABOUT.note("repaired", text)
        })
        .collect();
    if findings.is_empty() {
        findings.push(ABOUT.note("nothing-to-repair", "there was nothing to repair"));
    }
    findings
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::finding::Severity;
    use super::*;

    #[test]
    fn what_was_done_is_reported() {
        let repair = |robots, generations, leftovers| {
            Ok(Repair {
                robots,
                generations,
                leftovers,
            })
        };
        type Case = (Look<Repair>, &'static [(Severity, &'static str)]);
        let cases: [Case; 5] = [
            (
                repair(0, 0, 0),
                &[(Severity::Note, "there was nothing to repair")],
            ),
            (
                repair(1, 0, 0),
                &[(Severity::Note, "removed: 1 robot in which")],
            ),
            (
                repair(0, 1, 3),
                &[
                    (Severity::Note, "removed: 1 generation of"),
                    (Severity::Note, "removed: 3 things"),
                ],
            ),
            (
                Err(Trouble::Failed("it is not ours".to_owned())),
                &[(Severity::Error, "the repair failed: it is not ours")],
            ),
            (
                Err(Trouble::TookTooLong(Duration::from_secs(15))),
                &[(Severity::Error, "given up after 15s")],
            ),
        ];
        for (repair, expected) in cases {
            let findings = diagnose(&repair);
            assert_eq!(findings.len(), expected.len(), "{findings:?}");
            for (finding, (severity, text)) in findings.iter().zip(expected) {
                assert_eq!(finding.severity, *severity, "{finding:?}");
                assert!(finding.text.contains(text), "{finding:?}");
            }
        }
    }
}
