//! [`ProgressLine`]: how far a path is flown, beside the reports of its requests: distance and time to go, on a
//! terminal as one line that is renewed. [`Way`] is the pure part.

use std::io::{self, IsTerminal};
use std::time::Duration;

use ipc_types::code::Stage;
use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport, WaypointPosition};
use ipc_types::{MonotonicNs, Source, Subscriber, Topic};
use operator::render::messages::Verb;
use operator::render::terminal::{Block, Size};
use operator::render::words::{count, distance, duration};
use operator::render::{Weight, tell};
use operator::request::Companion;
use operator::robot::geo::{Place, distance_m};
use operator::robot::pilot::PilotView;
use operator::session::Session;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::output::standard_output;

/// Slower than this the helicopter hovers or turns, and its speed says nothing about the time to go, m/s.
const MIN_SPEED_MPS: f64 = 0.5;

/// A helicopter whose speed has not risen by this part for [`STEADY`] has the speed at which it flies the path.
const RISE: f64 = 1.1;

/// Time without a rise by [`RISE`] after which the speed is steady. A helicopter speeds up by some tenths of a metre
/// per second in a second at least.
const STEADY: Duration = Duration::from_secs(2);

/// A turn takes no longer. A speed that is not reached again in that time is not the one of this path: the path before
/// it was faster.
const TURN: Duration = Duration::from_secs(5);

/// The way of a path, along the ground.
#[derive(Debug)]
struct Way {
    waypoints: Vec<Place>,
    /// Metres from each waypoint to the last one.
    behind_m: Vec<f64>,
}

impl Way {
    /// `None` if a waypoint is no place: the bridge refuses the path.
    fn new(waypoints: &[WaypointPosition]) -> Option<Way> {
        let place = |at: &WaypointPosition| Place::new(at.latitude_deg, at.longitude_deg);
        let waypoints: Vec<Place> = waypoints.iter().map(place).collect::<Option<_>>()?;
        let mut behind_m = vec![0.0; waypoints.len()];
        for index in (1..waypoints.len()).rev() {
            let leg_m = distance_m(waypoints[index - 1], waypoints[index]);
            behind_m[index - 1] = behind_m[index] + leg_m;
        }
        Some(Way {
            waypoints,
            behind_m,
        })
    }

    /// Metres from `place` to the end, when so many waypoints were reached.
    fn to_go_m(&self, place: Place, reached: usize) -> f64 {
        let next = self.waypoints.get(reached).zip(self.behind_m.get(reached));
        next.map_or(0.0, |(next, behind_m)| distance_m(place, *next) + behind_m)
    }
}

/// At which speed the path is flown: the highest of late, once the helicopter has sped up. In turns it is slower for a
/// while.
#[derive(Debug, Default)]
struct PathSpeed {
    /// The highest speed in this and in the last span of [`TURN`], m/s.
    highest_mps: [f64; 2],
    /// When this span began.
    began: MonotonicNs,
    /// To which speed it has risen last, m/s, and when.
    risen: (f64, MonotonicNs),
}

impl PathSpeed {
    fn take(&mut self, speed_mps: f64, now: MonotonicNs) {
        if now.since(self.began) >= TURN {
            self.highest_mps = [0.0, self.highest_mps[0]];
            self.began = now;
        }
        self.highest_mps[0] = self.highest_mps[0].max(speed_mps);
        self.risen.0 = self.risen.0.min(self.highest());
        if speed_mps > self.risen.0 * RISE {
            self.risen = (speed_mps, now);
        }
    }

    fn highest(&self) -> f64 {
        self.highest_mps[0].max(self.highest_mps[1])
    }

    /// `None` while the helicopter hovers or speeds up.
    fn speed_mps(&self, now: MonotonicNs) -> Option<f64> {
        let is_steady = now.since(self.risen.1) >= STEADY;
        Some(self.highest()).filter(|speed_mps| is_steady && *speed_mps >= MIN_SPEED_MPS)
    }
}

/// The metres, and the seconds at this speed if it is known.
fn to_go(metres: f64, speed_mps: Option<f64>) -> String {
    let time = speed_mps.map_or_else(String::new, |speed_mps| {
        format!(", about {}", duration(metres / speed_mps))
    });
    format!("{} to go{time}", distance(metres))
}

/// Prints how far a path is flown, with distance and time to go.
pub struct ProgressLine {
    telemetry: Subscriber<DspTelemetry>,
    states: Subscriber<ModuleState>,
    verb: Verb,
    path_id: u64,
    way: Option<Way>,
    /// How long the path is from where it was begun, and when that was.
    whole: Option<(f64, MonotonicNs)>,
    now: PilotView,
    pace: PathSpeed,
    reached: usize,
    /// Whether the bridge says that it flies this path.
    is_flown: bool,
    block: Option<Block>,
    shown: String,
}

impl ProgressLine {
    /// Of the path with this id. A line is renewed if `is_live`, and standard output is a terminal.
    pub fn open(
        session: &Session,
        verb: Verb,
        path_id: u64,
        waypoints: &[WaypointPosition],
        is_live: bool,
    ) -> Result<ProgressLine, Failure> {
        let is_live = is_live && io::stdout().is_terminal();
        Ok(ProgressLine {
            telemetry: session.ipc.subscriber().or_fail(ExitCode::Internal)?,
            states: session.ipc.subscriber().or_fail(ExitCode::Internal)?,
            verb,
            path_id,
            way: Way::new(waypoints),
            whole: None,
            now: PilotView::default(),
            pace: PathSpeed::default(),
            reached: 0,
            is_flown: false,
            block: is_live.then(Block::default),
            shown: String::new(),
        })
    }

    fn to_go_m(&self) -> Option<f64> {
        let way = self.way.as_ref()?;
        Some(way.to_go_m(self.now.place?, self.reached))
    }

    /// What is shown on a terminal while the path is flown.
    fn line(&self) -> Option<String> {
        let way = self.way.as_ref().filter(|_| self.is_flown)?;
        let left = way.waypoints.len().saturating_sub(self.reached);
        let to_go = to_go(self.to_go_m()?, self.pace.speed_mps(MonotonicNs::now()));
        let waypoints = count(left, "waypoint");
        Some(format!("{}: {waypoints}, {to_go}", self.verb.name()))
    }
}

/// The newest sample, if one came. A publisher that goes just now is no reason to end: what follows the order says how
/// it ends.
fn newest<T: Topic>(port: &mut Subscriber<T>) -> Option<T> {
    port.latest().unwrap_or_else(|error| {
        tracing::debug!(%error, "samples could not be received");
        None
    })
}

impl Companion for ProgressLine {
    fn source(&mut self) -> &mut dyn Source {
        &mut self.telemetry
    }

    fn look(&mut self) -> Result<(), Failure> {
        if let Some(sample) = newest(&mut self.telemetry) {
            self.now = PilotView::from(&sample);
        }
        if let Some(state) = newest(&mut self.states) {
            self.is_flown = state.movement.path_id == self.path_id;
            if self.is_flown {
                self.reached = state.movement.waypoints_reached as usize;
            }
        }
        if let Some(speed_mps) = self.now.ground_speed_mps.filter(|_| self.is_flown) {
            self.pace.take(speed_mps, MonotonicNs::now());
        }
        if self.whole.is_none() {
            self.whole = self.to_go_m().map(|metres| (metres, MonotonicNs::now()));
        }
        let line = self.line().unwrap_or_default();
        // A terminal that stands still is shown what is newest when it goes on.
        if let Some(block) = &mut self.block
            && line != self.shown
            && standard_output().is_idle()
        {
            let mut text = Vec::new();
            let size = Size::of(io::stdout());
            block
                .show(&mut text, size, [&line])
                .map_err(Failure::output)?;
            self.shown = line;
            return tell(Weight::Progress, String::from_utf8_lossy(&text));
        }
        Ok(())
    }

    fn clear(&mut self) -> Result<(), Failure> {
        self.shown.clear();
        let mut text = Vec::new();
        if let Some(block) = &mut self.block {
            block.clear(&mut text).map_err(Failure::output)?;
        }
        match text.is_empty() {
            true => Ok(()),
            false => tell(Weight::Result, String::from_utf8_lossy(&text)),
        }
    }

    fn remark(&self, report: &RequestReport) -> String {
        let whole = self.whole.map(|(metres, _)| metres);
        let remark = match (report.stage(), self.whole) {
            (Some(Stage::Accepted), _) => whole.map(distance),
            (Some(Stage::Progress), _) => self
                .to_go_m()
                .map(|metres| to_go(metres, self.pace.speed_mps(MonotonicNs::now()))),
            (Some(Stage::Done), Some((metres, begun))) => {
                let took = MonotonicNs::now().since(begun).as_secs_f64();
                Some(format!("{} in {}", distance(metres), duration(took)))
            }
            _ => None,
        };
        remark.map_or_else(String::new, |remark| format!(", {remark}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use operator::robot::geo::moved;

    #[test]
    fn the_way_to_go_follows_the_legs_and_the_time_the_speed() {
        let home = Place::new(37.0, -6.0).unwrap();
        let waypoint = |east_m, north_m| {
            let place = moved(home, east_m, north_m).unwrap();
            WaypointPosition {
                latitude_deg: place.latitude_deg,
                longitude_deg: place.longitude_deg,
                altitude_m: 20.0,
            }
        };
        // A square whose last waypoint is where it begins.
        let square = [
            waypoint(100.0, 0.0),
            waypoint(100.0, 100.0),
            waypoint(0.0, 100.0),
            waypoint(0.0, 0.0),
        ];
        let way = Way::new(&square).unwrap();
        for (reached, expected) in [(0, 400.0), (1, 341.4), (3, 0.0), (4, 0.0)] {
            let metres = way.to_go_m(home, reached);
            assert!((metres - expected).abs() < 0.1, "{reached}: {metres}");
        }
        assert_eq!(to_go(100.0, Some(4.0)), "100 m to go, about 25s");
        assert_eq!(to_go(100.0, None), "100 m to go");
        let nowhere = WaypointPosition {
            latitude_deg: f64::NAN,
            ..square[0]
        };
        assert!(Way::new(&[nowhere]).is_none());
    }

    #[test]
    fn the_time_to_go_is_said_once_the_helicopter_has_sped_up() {
        let mut pace = PathSpeed::default();
        let at = |seconds: f64| MonotonicNs((seconds * 1e9) as u64);
        // Half a metre per second more in each second, as far as 5 m/s; then a turn; then a slower path.
        for tenth in 0..400 {
            let seconds = f64::from(tenth) / 10.0;
            let speed_mps = match seconds {
                ..15.0 => (0.5 * seconds).min(5.0),
                ..19.0 => 1.0,
                ..24.0 => 5.0,
                _ => 3.0,
            };
            pace.take(speed_mps, at(seconds));
            let expected = match seconds {
                // The last rise by a tenth is that to 4.6 m/s or more.
                ..11.0 => None,
                ..13.0 => continue,
                ..24.0 => Some(5.0),
                ..35.0 => continue,
                _ => Some(3.0),
            };
            assert_eq!(pace.speed_mps(at(seconds)), expected, "{seconds}");
        }
    }
}
