//! A mission typed at the station, in bad weather.

use ipc_types::payload::RelayLink;
use ril_tests::Rig;
use ril_tests::relayed::{BridgeLog, says};

use super::site::{Plan, Site};
use crate::outcome::Outcome;

/// Flies start, take-off, a path of four waypoints, landing and stop.
///
/// # Errors
///
/// Why this machine cannot do it.
pub fn run(plan: &Plan) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    let station = &site.rig.station;
    let path = format!("goto {}", Rig::square(site.rig.place(), 5.0));
    let verbs = ["start", "takeoff --altitude 5", &path, "land", "stop"];
    let mut outcome = Outcome::default();
    let (mut done, mut is_path_done) = (0, false);
    for verb in verbs {
        let finished = station.finish(verb);
        is_path_done |= says(&finished.stdout, "goto: done, 4 of 4 waypoints sent");
        let is_done = finished.code() == Some(0);
        done += u32::from(is_done);
        let words = finished.stderr.join(", ");
        outcome.require(
            is_done,
            format!("`ril {verb}`: {:?}: {words}", finished.code()),
        );
    }
    let link = station.subscribe::<RelayLink>(1).next_sample();
    let [bridge, sim] = site.end();
    let twice = BridgeLog::of([&bridge]).executed_twice().len();
    // A landing that follows at once may empty the DSP's path buffer before the last waypoint: the bridge's box is larger.
    let are_flown = is_path_done && says(&sim.stderr, "waypoints_taken=4");
    let sent = link.samples_received + link.samples_lost_on_air;
    let lost_percent = link.samples_lost_on_air as f64 / sent.max(1) as f64 * 100.0;
    outcome.cell("packets lost, %", plan.loss * 100.0);
    outcome.cell("verbs done", done);
    outcome.cell("executed twice", twice);
    outcome.cell("all waypoints flown", are_flown);
    outcome.cell("samples lost, %", format!("{lost_percent:.1}"));
    outcome.cell("outages", link.outages);
    outcome.require(twice == 0, "executed twice");
    outcome.require(are_flown, "not all waypoints flown");
    Ok(outcome)
}
