//! Judges what the view is set up with for the doctor: its port, what other machines can do, its certificate, the files with its secrets.

use runtime::finding::Finding;
use status::log::clock::Utc;

use super::facts::ViewFacts;
use crate::robot::domain::Look;

/// From how much before its end on a certificate is reported, s: two weeks.
const SOON_S: u64 = 14 * 86_400;

/// What view.toml and its places mean.
pub(super) fn diagnose(look: &Look<ViewFacts>) -> Vec<Finding> {
    let facts = match look {
        Ok(facts) => facts,
        Err(trouble) => {
            let text = format!("looking at what view.toml names {trouble}");
            let next_step = "is a file of it on a file system that does not answer?";
            return vec![Finding::warning("view-unclear", text, next_step)];
        }
    };
    let mut findings = vec![port(facts)];
    findings.extend(open(facts));
    findings.extend(certificate(facts));
    findings.extend(facts.open_secrets.iter().map(|(path, fault)| {
        let path = path.display();
        let text = format!("{path} is a secret of the view, and {fault}");
        let next_step = format!("`chmod 600 {path}`, as the user that runs the view");
        Finding::error("view-secret", text, next_step)
    }));
    findings
}

fn port(facts: &ViewFacts) -> Finding {
    const ID: &str = "view-port";
    let port = facts.port;
    match &facts.holder {
        None => Finding::note(ID, format!("port {port} of the view is free")),
        Some(holder) if holder.starts_with("ril ") => {
            Finding::note(ID, format!("the view runs on port {port}: {holder}"))
        }
        Some(holder) => Finding::warning(
            ID,
            format!("port {port} of the view is in use by {holder}"),
            "the view cannot start: end that process, or change `port` of view.toml",
        ),
    }
}

fn open(facts: &ViewFacts) -> Vec<Finding> {
    let mut findings = Vec::new();
    if facts.is_open && facts.certificate.is_none() {
        findings.push(Finding::warning(
            "view-insecure",
            "the view serves other machines without TLS: anyone in the network can read along and take their tokens",
            "add `[tls]` to view.toml: `ril relay certify` makes certificates",
        ));
    }
    if facts.is_open && !facts.has_tokens {
        findings.push(Finding::warning(
            "view-tokens",
            "the view listens for other machines, and `[tokens]` has none for them",
            "add `phone = \"watch\"` to `[tokens]` of view.toml; `ril view --invite phone` gives it away",
        ));
    }
    findings
}

fn certificate(facts: &ViewFacts) -> Option<Finding> {
    const ID: &str = "view-certificate";
    let (path, end) = facts.certificate.as_ref()?;
    let path = path.display();
    let next_step = "make another one: `ril relay certify`, then restart the view";
    let end_s = match end {
        Ok(end_s) => *end_s,
        Err(why) => {
            let text = format!("the view's certificate {path} cannot be used: {why}");
            return Some(Finding::error(ID, text, next_step));
        }
    };
    let Utc {
        year, month, day, ..
    } = Utc::from_unix(end_s);
    let day = format!("{year:04}-{month:02}-{day:02}");
    Some(if end_s <= facts.unix_s {
        let text = format!("the view's certificate {path} has ended on {day}");
        Finding::error(ID, text, next_step)
    } else if end_s <= facts.unix_s + SOON_S {
        let text = format!("the view's certificate {path} ends on {day}");
        Finding::warning(ID, text, next_step)
    } else {
        Finding::note(
            ID,
            format!("the view's certificate {path} holds until {day}"),
        )
    })
}

#[cfg(test)]
mod tests {
    use runtime::finding::Severity::{Error, Note, Warning};

    use super::*;

    const NOW_S: u64 = 1_795_694_400;
    const DAY_S: u64 = 86_400;

    fn facts() -> ViewFacts {
        ViewFacts {
            port: 8765,
            unix_s: NOW_S,
            ..ViewFacts::default()
        }
    }

    fn found(facts: ViewFacts) -> Vec<(&'static str, runtime::finding::Severity)> {
        let findings = diagnose(&Ok(facts));
        findings.iter().map(|one| (one.id, one.severity)).collect()
    }

    #[test]
    fn what_others_can_do_is_judged() {
        assert_eq!(found(facts()), [("view-port", Note)]);
        let holder = |text: &str| ViewFacts {
            holder: Some(text.to_owned()),
            ..facts()
        };
        assert_eq!(found(holder("ril (process 5)")), [("view-port", Note)]);
        for other in ["rildo (process 5)", "a process of user 0"] {
            assert_eq!(found(holder(other)), [("view-port", Warning)], "{other}");
        }
        let open = ViewFacts {
            is_open: true,
            ..facts()
        };
        assert_eq!(
            found(open)[1..],
            [("view-insecure", Warning), ("view-tokens", Warning)]
        );
        let safe = ViewFacts {
            is_open: true,
            has_tokens: true,
            certificate: Some(("a.pem".into(), Ok(NOW_S + 700 * DAY_S))),
            ..facts()
        };
        assert_eq!(found(safe)[1..], [("view-certificate", Note)]);
        let read = ViewFacts {
            open_secrets: vec![("view.key".into(), "its mode is 644".into())],
            ..facts()
        };
        assert_eq!(found(read)[1..], [("view-secret", Error)]);
    }

    #[test]
    fn a_certificate_is_reported_before_it_ends() {
        for (end, expected) in [
            (Ok(NOW_S + 15 * DAY_S), Note),
            (Ok(NOW_S + 14 * DAY_S), Warning),
            (Ok(NOW_S + 1), Warning),
            (Ok(NOW_S), Error),
            (Err("it is gone".to_owned()), Error),
        ] {
            let one = ViewFacts {
                certificate: Some(("a.pem".into(), end.clone())),
                ..facts()
            };
            assert_eq!(found(one)[1..], [("view-certificate", expected)], "{end:?}");
        }
    }
}
