//! [`Paths`]: the path that the bridge holds and the track that was flown, as lines in the frame `map`, for viewers
//! that draw them.

use std::time::Duration;

use ipc_types::outline::OutlineReader;
use ipc_types::payload::{BridgeOutline, HeroTelemetry, WaypointPosition};
use ipc_types::{MonotonicNs, RobotId, TelemetryGroup};
use operator::robot::geo::{Place, Spaced, Track, distance_m, origin, plane_m};
use recording::Recorder;
use recording::topic;
use ros_messages::{PATH, PathPoint, Qos, UnixOffset, path_message, position};

use super::log::RecorderTopic;

/// Most points of a track: a message with so many has 18 kB.
const TRACK_POINTS: usize = 256;

/// Time between two messages of the track, each of which has all of it: 1.8 kB/s at most.
const TRACK_PERIOD: Duration = Duration::from_secs(10);

/// The origin of `map` is another one when it lies farther from the last one than this, m, and a part of the distance
/// to it: telemetry has the place with an error that grows with the distance, because `map` is flat.
const ORIGIN_ERROR_M: f64 = 1.0;
const ORIGIN_ERROR: f64 = 0.01;

/// The path that the bridge holds and the track that was flown, as lines in the frame `map`.
#[derive(Debug)]
pub struct Paths {
    offset: UnixOffset,
    planned: RecorderTopic,
    flown: RecorderTopic,
    outline: OutlineReader,
    /// The outline's path has not been said as it is.
    is_planned_new: bool,
    /// Where `map` begins.
    origin: Option<Place>,
    track: Track<TrackPoint>,
    /// The last point that was said, and when it was said.
    said: Option<(TrackPoint, MonotonicNs)>,
}

/// Where the robot was.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TrackPoint {
    at: MonotonicNs,
    position: [f64; 3],
}

impl Spaced for TrackPoint {
    fn distance_m(self, to: TrackPoint) -> f64 {
        let [east, north, up] = std::array::from_fn(|axis| to.position[axis] - self.position[axis]);
        f64::hypot(east, north).hypot(up)
    }
}

impl Paths {
    /// Of `robot`; nothing is known of it yet.
    pub fn new(robot: RobotId, offset: UnixOffset) -> Paths {
        let line = |name| RecorderTopic::new(topic(robot, name), PATH, Qos::LATCHED);
        Paths {
            offset,
            planned: line("planned_path"),
            flown: line("flown_path"),
            outline: OutlineReader::new(),
            is_planned_new: false,
            origin: None,
            track: Track::with_room(TRACK_POINTS),
            said: None,
        }
    }

    /// Takes a piece of what the bridge holds.
    pub fn outline(&mut self, recorder: &mut Recorder, piece: &BridgeOutline, now: MonotonicNs) {
        let path = |outline: &OutlineReader| {
            let outline = outline.outline();
            outline.map_or(Vec::new(), |outline| outline.path.clone())
        };
        let before = path(&self.outline);
        if self.outline.take(piece) && path(&self.outline) != before {
            self.is_planned_new = true;
            self.say_planned(recorder, now, now);
        }
    }

    /// Takes a sample of telemetry.
    pub fn telemetry(&mut self, recorder: &mut Recorder, sample: &HeroTelemetry, now: MonotonicNs) {
        let Some(position) = position(sample) else {
            return;
        };
        let at = sample.received();
        self.place_origin(sample);
        self.say_planned(recorder, now, at);
        self.track.push(TrackPoint { at, position });
        if self.said.is_none_or(|(_, said)| now >= said + TRACK_PERIOD) {
            self.say_flown(recorder, now);
        }
    }

    /// A file has begun: it is to have what holds.
    pub fn begin_file(&mut self) {
        self.is_planned_new = self
            .outline
            .outline()
            .is_some_and(|held| !held.path.is_empty());
        self.said = None;
    }

    /// Says the rest of the track, at the end of the recording or of a flight.
    pub fn end(&mut self, recorder: &mut Recorder, now: MonotonicNs) {
        self.say_flown(recorder, now);
    }

    /// Begins another track.
    pub fn forget_track(&mut self) {
        self.track = Track::with_room(TRACK_POINTS);
        self.said = None;
    }

    fn place_origin(&mut self, sample: &HeroTelemetry) {
        let (geodetic, local) = (&sample.geodetic, &sample.local);
        let degrees = [geodetic.latitude_rad, geodetic.longitude_rad].map(f64::to_degrees);
        let is_known = sample.valid(TelemetryGroup::Geographic);
        let place = Place::new(degrees[0], degrees[1]).filter(|_| is_known);
        let Some(found) = place.and_then(|place| origin(place, local.east_m, local.north_m)) else {
            return;
        };
        let error_m = ORIGIN_ERROR_M + ORIGIN_ERROR * local.east_m.hypot(local.north_m);
        match self.origin {
            Some(before) if distance_m(before, found) <= error_m => return,
            // The DSP has begun again.
            Some(_) => {
                self.is_planned_new = true;
                self.forget_track();
            }
            None => {}
        }
        self.origin = Some(found);
    }

    fn say_planned(&mut self, recorder: &mut Recorder, now: MonotonicNs, at: MonotonicNs) {
        let (Some(origin), true) = (self.origin, self.is_planned_new) else {
            return;
        };
        self.is_planned_new = false;
        let unix_ns = self.offset.unix_ns(at);
        let path = self
            .outline
            .outline()
            .into_iter()
            .flat_map(|held| &held.path);
        let points: Vec<_> = path.filter_map(|to| point(unix_ns, origin, to)).collect();
        self.planned
            .add(recorder, now, at, &path_message(unix_ns, &points));
    }

    fn say_flown(&mut self, recorder: &mut Recorder, now: MonotonicNs) {
        let points = self.track.points();
        let Some(last) = points.last().copied() else {
            return;
        };
        if self.said.is_some_and(|(said, _)| said == last) {
            return;
        }
        let points: Vec<_> = points
            .iter()
            .map(|point| PathPoint {
                unix_ns: self.offset.unix_ns(point.at),
                position: point.position,
            })
            .collect();
        let message = path_message(self.offset.unix_ns(last.at), &points);
        self.flown.add(recorder, now, last.at, &message);
        self.said = Some((last, now));
    }
}

/// A waypoint in `map`; `None` if it is no place.
fn point(unix_ns: i64, origin: Place, to: &WaypointPosition) -> Option<PathPoint> {
    let place = Place::new(to.latitude_deg, to.longitude_deg)?;
    let (east_m, north_m) = plane_m(origin, place);
    Some(PathPoint {
        unix_ns,
        position: [east_m, north_m, to.altitude_m],
    })
}

#[cfg(test)]
mod tests;
