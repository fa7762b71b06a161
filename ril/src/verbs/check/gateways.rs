//! Judges what the view is set up with for the doctor: its port, what other machines can do, its certificate, the files
//! with its secrets.

use ipc_types::code::RelayLinkState;
use ipc_types::payload::RelayLink;
use operator::robot::domain::Look;
use operator::robot::relay_link::LinkReport;
use runtime::finding::Finding;
use status::log::clock::Utc;

use super::facts::{LinkFacts, MavlinkFacts, ViewFacts};

/// From how much before its end on a certificate is reported, s: two weeks.
const SOON_S: u64 = 14 * 86_400;

/// What view.toml and its places mean.
pub(super) fn view(look: &Look<ViewFacts>) -> Vec<Finding> {
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

/// What mavlink.toml and its key mean.
pub(super) fn mavlink(look: &Look<MavlinkFacts>) -> Vec<Finding> {
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

/// Part of the samples lost on the air from which on the link is too weak for what goes over it.
const MAX_LOSS: f64 = 0.01;

/// Uncertainty of times from which on ages mislead, s: a telemetry sample is published every 20 ms, and an operator
/// reacts in some tenths of a second.
const MAX_UNCERTAINTY_S: f64 = 0.05;

/// What the relay says of its link to `robot`.
pub(super) fn relay(facts: &LinkFacts, robot: u32) -> Vec<Finding> {
    let link = match &facts.link {
        Ok(Some(link)) => link,
        Ok(None) => return vec![silent(robot, "does not report its link".to_owned())],
        Err(trouble) => {
            let text = format!("looking at the link of the relay of robot {robot} {trouble}");
            let next_step = "look again; if it stays so, restart the relay";
            return vec![Finding::warning("relay-unclear", text, next_step)];
        }
    };
    let report = LinkReport::new(link, facts.now);
    if report.is_stale() {
        let text = "has not reported its link for more than three seconds".to_owned();
        return vec![silent(robot, text)];
    }
    let troubles: Vec<Finding> = [
        not_up(&report),
        two_robots(&report),
        lossy(link, robot),
        untrue(link, robot),
        reset(link, robot),
    ]
    .into_iter()
    .flatten()
    .collect();
    if !troubles.is_empty() {
        return troubles;
    }
    let text = format!("robot {robot} is {}", report.in_short());
    vec![Finding::note("relay-right", text)]
}

fn silent(robot: u32, what: String) -> Finding {
    let text = format!("the relay of robot {robot} is running and {what}");
    let next_step = "is it stopped, or is the machine overloaded? If it stays so, restart it";
    Finding::error("relay-silent", text, next_step)
}

fn not_up(report: &LinkReport) -> Option<Finding> {
    let (text, next_step) = report.trouble()?;
    Some(Finding::error("relay-link-down", text, next_step))
}

fn two_robots(report: &LinkReport) -> Option<Finding> {
    let (text, next_step) = report.two_robots()?;
    Some(Finding::error("relay-two-robots", text, next_step))
}

fn lossy(link: &RelayLink, robot: u32) -> Option<Finding> {
    let lost = link.lost_on_air().filter(|lost| *lost > MAX_LOSS)?;
    let text = format!(
        "{:.2} % of the samples of robot {robot} were lost on the air ({} of {})",
        lost * 100.0,
        link.samples_lost_on_air,
        link.samples_received
            .saturating_add(link.samples_lost_on_air)
    );
    let next_step =
        "lower the rates of topics in the relay's configuration, or improve the radio link";
    Some(Finding::warning("relay-link-lossy", text, next_step))
}

fn untrue(link: &RelayLink, robot: u32) -> Option<Finding> {
    let text = match link.clock_uncertainty() {
        Some(uncertainty) if uncertainty <= MAX_UNCERTAINTY_S => return None,
        Some(uncertainty) => format!(
            "ages of samples of robot {robot} are true within {:.0} ms only",
            uncertainty * 1e3
        ),
        // Before the first exchange nothing else is to be expected.
        None if link.state() != Some(RelayLinkState::Up) => return None,
        None => format!("how true the ages of samples of robot {robot} are is not known"),
    };
    let next_step = "look again in some seconds; if it stays so, the link is slow or uneven: `ril relay status` shows its round trip";
    Some(Finding::warning("relay-clock-uncertain", text, next_step))
}

fn reset(link: &RelayLink, robot: u32) -> Option<Finding> {
    if link.clock_resets == 0 {
        return None;
    }
    let text = format!(
        "the clock of robot {robot} jumped {} times since its relay here began: its machine was restarted or suspended",
        link.clock_resets
    );
    let next_step =
        "find out why if that was not meant; a restart of the relay here begins the count anew";
    Some(Finding::warning("relay-clock-reset", text, next_step))
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
        let findings = view(&Ok(facts));
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

#[cfg(test)]
mod mavlink_tests {
    use runtime::finding::Severity::{Error, Note, Warning};

    use super::*;

    fn found(facts: MavlinkFacts) -> Vec<(&'static str, runtime::finding::Severity)> {
        let findings = mavlink(&Ok(facts));
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

#[cfg(test)]
mod relay_link_tests {
    use ipc_types::MonotonicNs;
    use ipc_types::code::Reason;
    use ipc_types::payload::ascii_bytes;

    use super::*;
    use operator::robot::domain::{Look, Trouble};
    use runtime::finding::Severity::{self, Error, Note, Warning};

    const NOW: MonotonicNs = MonotonicNs(100_000_000_000);

    fn right() -> RelayLink {
        RelayLink {
            published_ns: NOW.0,
            state: RelayLinkState::Up.code(),
            samples_received: 99,
            samples_lost_on_air: 1,
            clock_valid: 1,
            clock_uncertainty_s: MAX_UNCERTAINTY_S,
            round_trip_s: 0.01,
            link: ascii_bytes("tcp/10.0.0.2:7447"),
            ..RelayLink::default()
        }
    }

    fn said(link: Look<Option<RelayLink>>) -> Vec<(Severity, &'static str)> {
        let findings = relay(&LinkFacts { link, now: NOW }, 1);
        for finding in &findings {
            assert_eq!(finding.next_step.is_some(), finding.severity > Note);
        }
        findings.iter().map(|one| (one.severity, one.id)).collect()
    }

    #[test]
    fn a_link_at_its_limits_is_in_order() {
        assert_eq!(said(Ok(Some(right()))), [(Note, "relay-right")]);
    }

    #[test]
    fn each_trouble_of_a_link_is_a_finding() {
        type Change = fn(&mut RelayLink);
        #[rustfmt::skip]
        let cases: [(Change, (Severity, &str)); 9] = [
            (|link| link.state = RelayLinkState::Down.code(), (Error, "relay-link-down")),
            (|link| (link.state, link.clock_valid) = (RelayLinkState::Connecting.code(), 0), (Error, "relay-link-down")),
            (|link| link.state = 77, (Error, "relay-link-down")),
            (|link| link.refusal = Reason::RelayTwoRobots.code(), (Error, "relay-two-robots")),
            (|link| link.samples_lost_on_air = 2, (Warning, "relay-link-lossy")),
            (|link| link.clock_uncertainty_s = 0.051, (Warning, "relay-clock-uncertain")),
            (|link| link.clock_valid = 0, (Warning, "relay-clock-uncertain")),
            (|link| link.clock_resets = 1, (Warning, "relay-clock-reset")),
            (|link| link.published_ns = 1, (Error, "relay-silent")),
        ];
        for (change, expected) in cases {
            let mut link = right();
            change(&mut link);
            assert_eq!(said(Ok(Some(link))), [expected], "{link:?}");
        }
    }

    #[test]
    fn a_relay_that_says_nothing_and_a_look_that_failed_are_findings() {
        assert_eq!(said(Ok(None)), [(Error, "relay-silent")]);
        let failed = Err(Trouble::Failed("no".to_owned()));
        assert_eq!(said(failed), [(Warning, "relay-unclear")]);
    }
}
