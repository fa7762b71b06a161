//! Judges what the gateway to MAVLink is set up with for the doctor: who reaches it, and its key.

use runtime::finding::Finding;

use super::facts::MavlinkFacts;
use crate::robot::domain::Look;

/// What mavlink.toml and its key mean.
pub(super) fn diagnose(look: &Look<MavlinkFacts>) -> Vec<Finding> {
    let facts = match look {
        Ok(facts) => facts,
        Err(trouble) => {
            let text = format!("looking at the key that mavlink.toml names {trouble}");
            let next_step = "is it on a file system that does not answer?";
            return vec![Finding::warning("mavlink-unclear", text, next_step)];
        }
    };
    let mut findings = vec![access(facts)];
    findings.extend(key(facts));
    findings
}

fn access(facts: &MavlinkFacts) -> Finding {
    const ID: &str = "mavlink-access";
    match (facts.is_open, facts.is_insecure) {
        (false, _) => Finding::note(
            ID,
            "only stations on this machine reach the gateway to MAVLink",
        ),
        (true, false) => Finding::note(
            ID,
            "stations on other machines reach the gateway to MAVLink if they sign",
        ),
        (true, true) => {
            let text = match facts.has_commanders {
                false => "every machine that reaches the gateway to MAVLink sees the flight",
                true => {
                    "every machine that reaches the gateway to MAVLink sees the flight, and commands it when it claims a number of \
                     `[commands] systems`"
                }
            };
            let next_step = "name a file by `key` of mavlink.toml instead of `insecure`";
            Finding::warning(ID, text, next_step)
        }
    }
}

fn key(facts: &MavlinkFacts) -> Option<Finding> {
    const ID: &str = "mavlink-key";
    let (path, fault) = facts.key.as_ref()?;
    let path = path.display();
    Some(match fault {
        None => Finding::note(ID, format!("the key of MAVLink {path} can be used")),
        Some(why) => Finding::error(
            ID,
            why.clone(),
            format!(
                "put a passphrase that your stations have, too, into {path}; `chmod 600 {path}`, as the user that runs the gateway"
            ),
        ),
    })
}

#[cfg(test)]
mod tests {
    use runtime::finding::Severity::{Error, Note, Warning};

    use super::*;

    fn found(facts: MavlinkFacts) -> Vec<(&'static str, runtime::finding::Severity)> {
        let findings = diagnose(&Ok(facts));
        findings.iter().map(|one| (one.id, one.severity)).collect()
    }

    #[test]
    fn who_reaches_it_and_its_key_are_judged() {
        let closed = MavlinkFacts::default();
        assert_eq!(found(closed.clone()), [("mavlink-access", Note)]);
        let open = MavlinkFacts {
            is_open: true,
            is_insecure: true,
            ..closed.clone()
        };
        assert_eq!(found(open), [("mavlink-access", Warning)]);
        for (fault, expected) in [(None, Note), (Some("it is not there".to_owned()), Error)] {
            let signed = MavlinkFacts {
                is_open: true,
                key: Some(("mavlink.key".into(), fault)),
                ..closed.clone()
            };
            assert_eq!(
                found(signed),
                [("mavlink-access", Note), ("mavlink-key", expected)]
            );
        }
    }
}
