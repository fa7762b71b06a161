//! Whether battery and fuel last.

use crate::finding::Findings;
use crate::flight::Flight;
use crate::site::Endurance;
use crate::timeline::{Mark, timeline};
use runtime::finding::{Finding, Severity};

/// Checks the whole flight; what is not configured is a finding, too.
pub fn check(flight: &Flight, endurance: &Endurance, findings: &mut Findings) {
    let marks = timeline(flight, endurance);
    let (Some(last), Some(endurance_s)) = (marks.last(), endurance.endurance_s) else {
        if !flight.steps.is_empty() {
            findings.push(
                Finding::unchecked(
                    "endurance",
                    "whether battery and fuel last is not checked: how long they do is not configured",
                )
                .with_next_step("set `endurance_s` and `cruise_speed_mps` under `[plan]` of ril.toml"),
            );
        }
        return;
    };
    let Some(total_s) = last.time_s else {
        findings.push(
            Finding::unchecked(
                "endurance",
                "whether battery and fuel last is not checked: the cruise speed is not known",
            )
            .with_next_step("set `cruise_speed_mps` under `[plan]` of ril.toml"),
        );
        return;
    };
    let usable_s = endurance_s - endurance.reserve_s;
    if total_s <= usable_s {
        return;
    }
    let is_late = |mark: &&Mark| mark.time_s.is_some_and(|time_s| time_s > usable_s);
    let first = marks.iter().find(is_late).unwrap_or(last);
    let left_m = last.distance_m - (first.distance_m - first.step_m);
    findings.push(Finding {
        items: first.item.into_iter().collect(),
        leg: first.leg,
        ..Finding::new(Severity::Error,
            "endurance",
            format!(
                "is reached too late: the flight takes {total_s:.0} s, battery and fuel last {endurance_s:.0} s, of which {:.0} s \
                 are reserve",
                endurance.reserve_s
            ),
        )
        .by_m(left_m)
        .with_next_step("divide the plan, or correct `[plan]` of ril.toml")
    });
}
