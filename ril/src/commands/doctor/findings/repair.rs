//! What a repair did.

use ipc_types::{Cleaning, Removal, Repair};

use super::super::facts::{Look, Trouble};
use super::{About, Finding, Subject, count};

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
        removal,
        cleaning,
        secured,
        renewed,
    } = *repair;
    let Cleaning {
        removed,
        failed,
        swept,
    } = cleaning;
    let mut findings = Vec::new();
    let mut did = |text: String| findings.push(ABOUT.note("repaired", text));
    if let Removal::Removed(entries) = removal {
        let entries = count(entries, "thing", "things");
        did(format!(
            "nobody was in the domain: {entries} of it removed, nothing is left"
        ));
    }
    let amount = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
    if removed > 0 {
        let nodes = count(amount(removed), "dead node", "dead nodes");
        did(format!("{nodes} removed"));
    }
    if swept > 0 {
        let remains = count(amount(swept), "abandoned thing", "abandoned things");
        did(format!("{remains} removed"));
    }
    if secured {
        did("the management segment was taken away from other users".to_owned());
    }
    if renewed {
        did("the spoiled management segment was removed; the next node makes a new one".to_owned());
    }
    if failed > 0 {
        let nodes = count(amount(failed), "dead node", "dead nodes");
        findings.push(ABOUT.warning(
            "repair-incomplete",
            format!("{nodes} could not be removed yet"),
            "repair again in ten seconds: another process may be removing them just now, or was killed while it did",
        ));
    }
    if findings.is_empty() {
        findings.push(ABOUT.note("nothing-to-repair", "there was nothing to repair"));
    }
    findings
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::Severity;
    use super::*;

    const IN_USE: Repair = Repair {
        removal: Removal::InUse,
        cleaning: Cleaning {
            removed: 0,
            failed: 0,
            swept: 0,
        },
        secured: false,
        renewed: false,
    };

    #[test]
    fn what_was_done_is_told() {
        let cleaned = |removed, failed, swept| Repair {
            cleaning: Cleaning {
                removed,
                failed,
                swept,
            },
            ..IN_USE
        };
        let removed = Repair {
            removal: Removal::Removed(7),
            ..IN_USE
        };
        let mended = Repair {
            secured: true,
            renewed: true,
            ..IN_USE
        };
        type Case = (Look<Repair>, &'static [(Severity, &'static str)]);
        let cases: [Case; 7] = [
            (
                Ok(IN_USE),
                &[(Severity::Note, "there was nothing to repair")],
            ),
            (Ok(removed), &[(Severity::Note, "7 things of it removed")]),
            (
                Ok(cleaned(1, 0, 3)),
                &[
                    (Severity::Note, "1 dead node removed"),
                    (Severity::Note, "3 abandoned things removed"),
                ],
            ),
            (
                Ok(cleaned(0, 2, 0)),
                &[(Severity::Warning, "2 dead nodes could not")],
            ),
            (
                Ok(mended),
                &[(Severity::Note, "taken away"), (Severity::Note, "spoiled")],
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
