//! Outages: how soon something fresh comes after them, and how true its shown age is.

use std::time::Duration;

use ipc_types::MonotonicNs;

use super::ages::{Comparison, Observer, Truth, compare};
use super::site::{Plan, Site};
use crate::outcome::{Outcome, Times};

/// Fine weather between two outages.
const BETWEEN: Duration = Duration::from_secs(3);

/// Cuts the link `count` times for `outage`.
///
/// # Errors
///
/// Why this machine cannot do it.
pub fn run(
    plan: &Plan,
    count: u32,
    outage: Duration,
    goes_on: &dyn Fn() -> bool,
) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    let truth = Truth::start(&site.rig.robot);
    let mut observer = Observer::new(&site.rig.station);
    let mut fresh_after = Times::default();
    for number in 0..count {
        if !goes_on() {
            break;
        }
        observer.watch_until(MonotonicNs::now() + BETWEEN);
        site.tunnel.lose(1.0);
        // Ends in the middle of another attempt to connect each time.
        let longer = Duration::from_millis(u64::from(number) * 230 % 1500);
        observer.watch_until(MonotonicNs::now() + outage + longer);
        site.tunnel.lose(plan.loss);
        let back = MonotonicNs::now();
        let fresh = observer.watch_for_fresh(back);
        // From the end of the outage to the first sample that the DSP sent after it.
        fresh_after.push(fresh.came.since(back));
    }
    let truth = truth.end(&site.rig.robot);
    site.end();
    let Comparison {
        compared,
        untrue,
        error_s,
        uncertainty_s,
    } = compare(&observer.shown, &truth);
    let mut outcome = Outcome::default();
    outcome.cell("outages", format!("{} of {outage:?}", fresh_after.count()));
    outcome.cell("packets lost otherwise, %", plan.loss * 100.0);
    outcome.cell("first fresh sample after", fresh_after);
    outcome.cell("shown ages compared with the truth", compared);
    outcome.cell("beyond the shown uncertainty", untrue);
    outcome.cell("greatest error, ms", format!("{:.2}", error_s * 1e3));
    let uncertainty_ms = format!("{:.2}", uncertainty_s * 1e3);
    outcome.cell("greatest uncertainty, ms", uncertainty_ms);
    outcome.require(compared > 0, "nothing could be compared");
    outcome.require(untrue == 0, "a shown age was wrong");
    Ok(outcome)
}
