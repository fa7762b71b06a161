//! Outages: how soon something fresh comes after them, and how true its shown age is.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::ages::{Comparison, Observer, Truth, compare};
use crate::air::Weather;
use crate::site::{Plan, Site};

/// Fine weather between two outages.
const BETWEEN: Duration = Duration::from_secs(3);

/// What came of it.
pub struct Outcome {
    outage: Duration,
    loss: f64,
    /// From the end of each outage to the first sample that the DSP sent after it.
    fresh_after: Vec<Duration>,
    ages: Comparison,
}

impl Outcome {
    /// Whether nothing was untrue.
    pub fn is_good(&self) -> bool {
        self.ages.untrue == 0 && self.ages.compared > 0
    }
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut sorted = self.fresh_after.clone();
        sorted.sort();
        let at = |share: f64| {
            let index = (sorted.len() as f64 * share) as usize;
            sorted
                .get(index.min(sorted.len().saturating_sub(1)))
                .copied()
                .unwrap_or_default()
        };
        write!(
            f,
            "first fresh sample after an outage of {:?}, {:.0} % loss otherwise | {} outages: {:.0} ms (median), {:.0} ms (worst); {} \
             shown ages compared with the truth, {} beyond the shown uncertainty; greatest error {:.2} ms, greatest uncertainty {:.2} ms",
            self.outage,
            self.loss * 100.0,
            sorted.len(),
            at(0.5).as_secs_f64() * 1e3,
            at(1.0).as_secs_f64() * 1e3,
            self.ages.compared,
            self.ages.untrue,
            self.ages.error_s * 1e3,
            self.ages.uncertainty_s * 1e3,
        )
    }
}

/// Cuts the link `count` times for `outage`.
///
/// # Errors
///
/// Why this machine cannot do it.
pub fn run(
    plan: &Plan,
    count: u32,
    outage: Duration,
    loss: f64,
    goes_on: &dyn Fn() -> bool,
) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    site.air.set(Weather::loss(loss));
    let truth = Truth::start(&site.robot);
    let mut observer = Observer::new(&site.station);
    let mut fresh_after = Vec::new();
    for number in 0..count {
        if !goes_on() {
            break;
        }
        observer.watch_until(MonotonicNs::now() + BETWEEN);
        site.air.set(Weather::OUTAGE);
        // Ends in the middle of another attempt to connect each time.
        let longer = Duration::from_millis(u64::from(number) * 230 % 1500);
        observer.watch_until(MonotonicNs::now() + outage + longer);
        site.air.set(Weather::loss(loss));
        let back = MonotonicNs::now();
        let fresh = observer.watch_for_fresh(back);
        fresh_after.push(fresh.came.since(back));
        if plan.log.is_some() {
            eprintln!("{:?} after outage {number}", fresh.came.since(back));
        }
    }
    let truth = truth.end();
    site.end();
    Ok(Outcome {
        outage,
        loss,
        fresh_after,
        ages: compare(&observer.shown, &truth),
    })
}
