//! A mission typed at the station, in bad weather.

use ipc_types::payload::{DspTelemetry, RelayLink};

use crate::air::Weather;
use crate::bridge_log::BridgeLog;
use crate::machine::says;
use crate::site::{Plan, Site};

/// What came of it.
pub struct Outcome {
    loss: f64,
    /// Verbs that were typed, and those that were done.
    verbs: usize,
    done: usize,
    failures: Vec<String>,
    executed_twice: usize,
    /// The DSP took each waypoint once, and the bridge saw the path flown.
    waypoints_flown: bool,
    samples_lost: f64,
    outages: u32,
}

impl Outcome {
    /// Whether the mission was flown.
    pub fn is_good(&self) -> bool {
        self.done == self.verbs && self.executed_twice == 0 && self.waypoints_flown
    }
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "mission typed at the station through {:.0} % loss | {} of {} verbs done, {} executed twice, all waypoints flown: {}; {:.1} % \
             of the samples lost, {} outages",
            self.loss * 100.0,
            self.done,
            self.verbs,
            self.executed_twice,
            self.waypoints_flown,
            self.samples_lost * 100.0,
            self.outages
        )?;
        self.failures
            .iter()
            .try_for_each(|failure| write!(f, "; {failure}"))
    }
}

/// Flies start, take-off, a path of four waypoints, landing and stop.
///
/// # Errors
///
/// Why this machine cannot do it.
pub fn run(plan: &Plan, loss: f64) -> Result<Outcome, String> {
    let mut site = Site::start(plan)?;
    site.air.set(Weather::loss(loss));
    let place = site.station.subscribe::<DspTelemetry>(1).next().geographic;
    let point = |north_deg: f64, east_deg: f64, up_m: f64| {
        let (latitude, longitude) = (
            place.latitude_deg + north_deg,
            place.longitude_deg + east_deg,
        );
        format!("{latitude},{longitude},{}", place.altitude_m + up_m)
    };
    let square = [
        point(0.00007, 0.0, 6.0),
        point(0.00007, 0.00009, 7.0),
        point(0.0, 0.00009, 6.0),
        point(0.0, 0.0, 5.0),
    ];
    let path = format!("goto {}", square.join(" "));
    let verbs = ["start", "takeoff --altitude 5", &path, "land", "stop"];
    let (mut done, mut failures) = (0, Vec::new());
    let mut is_path_done = false;
    for verb in verbs {
        let finished = site.station.start(verb).wait_exit();
        is_path_done |= says(&finished.stdout, "goto: done, 4 of 4 waypoints sent");
        if finished.code() == Some(0) {
            done += 1;
        } else {
            let words = finished.stderr.join(", ");
            failures.push(format!("`ril {verb}`: {:?}: {words}", finished.code()));
        }
    }
    let link = site.station.subscribe::<RelayLink>(1).next();
    let sent = link.samples_received + link.samples_lost_on_air;
    let [bridge, sim] = site.end();
    Ok(Outcome {
        loss,
        verbs: verbs.len(),
        done,
        failures,
        executed_twice: BridgeLog::of([&bridge]).executed_twice().len(),
        // A landing that follows at once may empty the DSP's path buffer before the last waypoint: the bridge's box is larger.
        waypoints_flown: is_path_done && says(&sim.stderr, "waypoints_taken=4"),
        samples_lost: link.samples_lost_on_air as f64 / sent.max(1) as f64,
        outages: link.outages,
    })
}
