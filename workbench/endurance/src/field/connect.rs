//! How soon a station is connected over a bad link: from the start of its relay until the link is up.

use std::time::Duration;

use ipc_types::code::RelayLinkState;
use ipc_types::payload::RelayLink;
use ipc_types::{MonotonicNs, Wake};

use super::site::{Plan, Site};
use crate::outcome::{Outcome, Times};

/// What a link of 600 ms that loses a fifth is to need at most.
const GOAL: Duration = Duration::from_secs(15);

/// A station that is not connected by then is counted as such.
const LONGEST: Duration = Duration::from_secs(120);

/// Starts the station's relay `count` times, and kills it when it is connected.
///
/// # Errors
///
/// Why this machine cannot do it.
pub fn run(plan: &Plan, count: u32, goes_on: &dyn Fn() -> bool) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    let (mut up_after, mut never) = (Times::default(), 0);
    for _ in 0..count {
        if !goes_on() {
            break;
        }
        site.rig.kill_station_relay();
        let began = MonotonicNs::now();
        site.rig.start_station_relay();
        match up_since(&site, began) {
            Some(at) => up_after.push(at.since(began)),
            None => never += 1,
        }
    }
    site.end();
    let within = up_after.0.iter().filter(|took| **took <= GOAL).count();
    let [median, most, worst] = [0.5, 0.9, 1.0].map(|share| up_after.quantile(share).as_secs_f64());
    let mut outcome = Outcome::default();
    outcome.cell("round trip, ms", 2 * plan.weather.delay.as_millis());
    outcome.cell("packets lost each way, %", plan.loss * 100.0);
    outcome.cell("over", &plan.protocol);
    outcome.cell("connected", up_after.count());
    outcome.cell("within 15 s", within);
    let times = format!("{median:.1}, {most:.1}, {worst:.1}");
    outcome.cell("up after: p50, p90, worst, s", times);
    outcome.cell("not in 120 s", never);
    outcome.require(never == 0, format!("{never} were not connected"));
    Ok(outcome)
}

/// When the link came up that was made after `began`.
fn up_since(site: &Site, began: MonotonicNs) -> Option<MonotonicNs> {
    let mut links = site.rig.station.subscribe::<RelayLink>(1).port;
    let give_up = began + LONGEST;
    loop {
        // What cannot be received now can be by the next call, says the subscriber.
        if let Ok(Some(link)) = links.latest()
            && link.state == RelayLinkState::Up.code()
            && link.since_ns >= began.0
        {
            return Some(MonotonicNs(link.published_ns));
        }
        let left = give_up.since(MonotonicNs::now());
        if left.is_zero() || links.wait(left).expect("a wait") == Wake::TimedOut {
            return None;
        }
    }
}
