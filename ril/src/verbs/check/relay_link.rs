//! Judges the relay's link to a robot on another machine for the doctor: whether it is up, how much it loses, how true its times are.

use ipc_types::code::RelayLinkState;
use ipc_types::payload::RelayLink;
use runtime::finding::Finding;

use super::facts::LinkFacts;
use crate::robot::relay_link::LinkReport;

/// Part of the samples lost on the air from which on the link is too weak for what goes over it.
const MAX_LOSS: f64 = 0.01;

/// Uncertainty of times from which on ages mislead, s: a telemetry sample is published every 20 ms, and an operator reacts in
/// some tenths of a second.
const MAX_UNCERTAINTY_S: f64 = 0.05;

/// What the relay says of its link to `robot`.
pub(super) fn diagnose(facts: &LinkFacts, robot: u32) -> Vec<Finding> {
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
    use ipc_types::MonotonicNs;
    use ipc_types::payload::ascii_bytes;

    use super::*;
    use crate::robot::domain::{Look, Trouble};
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
        let findings = diagnose(&LinkFacts { link, now: NOW }, 1);
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
        let cases: [(Change, (Severity, &str)); 8] = [
            (|link| link.state = RelayLinkState::Down.code(), (Error, "relay-link-down")),
            (|link| (link.state, link.clock_valid) = (RelayLinkState::Connecting.code(), 0), (Error, "relay-link-down")),
            (|link| link.state = 77, (Error, "relay-link-down")),
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
