//! The fence before the breach: a breach is looked for where the helicopter would stop, not where it is.
//!
//! [`Fence::check_flight`] judges a leg before it is flown, and [`Fence::check_ahead`] the measured velocity. The first
//! leaves more room than the second asks for, so that a path that was taken and is flown as it was ordered is not held.

use dsp_protocol::Waypoint;

use super::leg::{Plane, ground_length_m, point_between};
use super::room::{Speeds, Velocity};
use super::{Breach, Fence, FenceRule};
use crate::geodesy::longitude_difference_deg;

/// A leg shorter than this has no direction, metres.
const SHORT_M: f64 = 0.01;

impl Fence {
    /// First breach of a leg that is flown at these speeds, the room to stop included: the leg keeps the margin, and so
    /// does its end. A leg that begins where the helicopter is, nearer than the margin, needs to keep it at its end
    /// only. Beyond its end there is room to stop for a helicopter that comes there as fast as it can.
    pub fn check_flight(&self, from: &Waypoint, to: &Waypoint, speeds: &Speeds) -> Option<Breach> {
        if self.is_empty() {
            return None;
        }
        let margin_m = self.room.margin_m;
        self.check_leg(from, to)
            .or_else(|| self.first_breach(to, to, margin_m).map(Breach::ahead))
            .or_else(|| self.breach_ahead(from, to, margin_m))
            .or_else(|| {
                let beyond = self.where_it_stops(from, to, speeds)?;
                self.breach_ahead(to, &beyond, self.room.margin_in_flight_m())
            })
    }

    /// How a helicopter that flies on from `at` with this velocity would break the fence before it stands, or come
    /// nearer to it than the part of the margin that straying does not use. A helicopter that is nearer already is
    /// judged without the margin.
    pub fn check_ahead(&self, at: &Waypoint, velocity: &Velocity) -> Option<Breach> {
        let Velocity {
            ground_mps,
            course_deg,
            up_mps,
        } = *velocity;
        let way_s = self.room.stopping_s(ground_mps.hypot(up_mps));
        let (east, north) = course_deg.to_radians().sin_cos();
        let plane = Plane::at(at.latitude_deg, at.longitude_deg);
        let (east_m, north_m) = (ground_mps * way_s * east, ground_mps * way_s * north);
        let stop = plane.moved(at, east_m, north_m, up_mps * way_s);
        self.breach_ahead(at, &stop, self.room.margin_in_flight_m())
    }

    /// Where a helicopter stops that flies the leg and brakes at its end.
    fn where_it_stops(&self, from: &Waypoint, to: &Waypoint, speeds: &Speeds) -> Option<Waypoint> {
        let ground_m = ground_length_m(from, to);
        let climb_m = to.altitude_m - from.altitude_m;
        let length_m = ground_m.hypot(climb_m);
        let reached_mps = self.room.reached_mps(speeds.begin_mps, length_m);
        let speed_mps = speeds.along(ground_m, climb_m).min(reached_mps);
        let stop_m = speed_mps * self.room.stopping_s(speed_mps);
        let beyond = point_between(from, to, 1.0 + stop_m / length_m);
        (length_m > SHORT_M).then_some(Waypoint {
            longitude_deg: longitude_difference_deg(beyond.longitude_deg, 0.0),
            ..beyond
        })
    }

    fn breach_ahead(&self, from: &Waypoint, to: &Waypoint, margin_m: f64) -> Option<Breach> {
        // `check_leg` reports a leg that cannot be judged.
        if self.is_empty() || !self.can_judge(from, to) {
            return None;
        }
        let margin_m = match self.first_breach(from, from, margin_m) {
            Some(_) => 0.0,
            None => margin_m,
        };
        self.first_breach(from, to, margin_m).map(Breach::ahead)
    }
}

impl Breach {
    /// Turns it into the breach that flying on would be.
    fn ahead(self) -> Breach {
        Breach {
            rule: FenceRule::Ahead,
            ..self
        }
    }
}
