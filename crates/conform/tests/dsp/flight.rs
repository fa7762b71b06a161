//! How the small DSP flies: take-off, landing, the path buffer.

use super::{Dsp, GROUND_M, MS, Phase, TICK, Waypoint, number};
use crate::fault::Fault;

impl Dsp {
    pub(super) fn flies(&self) -> bool {
        matches!(self.phase, Phase::Climb | Phase::Hover | Phase::Descent)
    }

    pub(super) fn takes_off(&self) -> bool {
        matches!(self.phase, Phase::Starting { .. } | Phase::Climb) || self.awaits_flow
    }

    pub(super) fn order_take_off(&mut self, value: u16) -> bool {
        if value != 1 && !self.is(Fault::AnyValueMoves) {
            return false;
        }
        if self.takes_off() {
            return !self.is(Fault::RefusesTakeOffAgain);
        }
        if self.is(Fault::TakesOffDuringLanding) && self.phase == Phase::Descent {
            return true;
        }
        let may = self.started_up || self.is(Fault::TakesOffWithoutStartUp);
        if self.phase != Phase::Ground || !may {
            return false;
        }
        self.phase = Phase::Starting {
            until: self.now + 1_500 * MS,
        };
        self.awaits_flow = self.flow_due.is_some();
        self.tick = self.now + TICK;
        true
    }

    pub(super) fn order_landing(&mut self, value: u16) -> bool {
        if value != 1 && !self.is(Fault::AnyValueMoves) {
            return false;
        }
        if matches!(self.phase, Phase::Descent | Phase::Stopping { .. }) {
            return !self.is(Fault::RefusesLandAgain);
        }
        if self.is(Fault::LandsDuringTakeOff) && self.takes_off() {
            return true;
        }
        if self.phase != Phase::Hover || self.awaits_flow {
            return self.is(Fault::SilentAboutLandOnGround) && self.phase == Phase::Ground;
        }
        self.drop_path();
        self.phase = Phase::Descent;
        true
    }

    pub(super) fn take_waypoint(&mut self, payload: &[u8], sequence: Option<u8>) {
        let raw = [0, 5, 10].map(|at| number(&payload[at..at + 5]).cast_signed());
        let waypoint = Waypoint { raw };
        if sequence.is_some()
            && sequence == self.waypoint_number
            && !self.is(Fault::TakesWaypointCopies)
        {
            return;
        }
        if self.is(Fault::RefusedWaypointLeavesNumber) {
            self.waypoint_number = sequence;
        }
        if self.is(Fault::TakesWaypointsDuringTakeOff) && self.takes_off() {
            return;
        }
        let accepts = self.phase == Phase::Hover && !self.awaits_flow && self.flow_due.is_some();
        let [latitude, longitude, altitude] = raw.map(f64::from);
        let is_within = latitude.abs() <= 90e7
            && longitude.abs() <= 180e7
            && (-1_000_000.0..=20_000_000.0).contains(&altitude)
            && !(self.is(Fault::RefusesWaypointAtLimit) && altitude >= 20_000_000.0)
            || self.is(Fault::TakesAnyWaypoint);
        let is_high = altitude >= (GROUND_M + 0.5) * 1e3
            || self.is(Fault::TakesLowWaypoints)
            || self.is(Fault::TakesAnyWaypoint);
        if !accepts || !is_within || !is_high {
            if !(self.is(Fault::SilentAboutWaypointsOnGround) && self.phase == Phase::Ground) {
                self.error(30);
            }
            return;
        }
        let is_equal = self.path.back().is_some_and(|newest| {
            *newest == waypoint
                || self.is(Fault::EqualByPosition) && newest.raw[..2] == waypoint.raw[..2]
        });
        if is_equal && !self.is(Fault::TakesEqualWaypoints) {
            return;
        }
        let places = match self.fault {
            Fault::Places(places) => places,
            _ => 16,
        };
        if self.path.len() >= places {
            return self.error(match self.fault {
                Fault::FullIs(code) => code,
                _ => 15,
            });
        }
        self.path.push_back(waypoint);
        self.waypoint_number = sequence;
        if !self.is(Fault::CountsNothing) {
            self.count = (self.count + 1) & 0x7FFF;
        }
    }

    pub(super) fn fly(&mut self) {
        let step = 2.0 * TICK.as_secs_f64();
        match self.phase {
            Phase::Ground => {}
            Phase::Starting { until } => {
                if self.now >= until {
                    self.phase = Phase::Climb;
                }
            }
            Phase::Climb => {
                let height = match self.fault {
                    Fault::ClimbsToTen => 10.0,
                    _ => f64::from(self.float(20_121)),
                };
                self.place[2] += step;
                if self.place[2] >= GROUND_M + height {
                    self.place[2] = GROUND_M + height;
                    self.phase = Phase::Hover;
                }
            }
            Phase::Hover => self.fly_path(),
            Phase::Descent => {
                self.place[2] -= step;
                if self.place[2] <= GROUND_M {
                    self.place[2] = GROUND_M;
                    self.phase = Phase::Stopping {
                        until: self.now + 1_000 * MS,
                    };
                }
            }
            Phase::Stopping { until } => {
                if self.now >= until {
                    self.phase = Phase::Ground;
                }
            }
        }
    }

    pub(super) fn fly_path(&mut self) {
        let Some(waypoint) = self.path.front().copied() else {
            return;
        };
        let [latitude, longitude, altitude] = waypoint.raw.map(f64::from);
        let north = (latitude / 1e7 - self.place[0]) * 111_000.0;
        let east = (longitude / 1e7 - self.place[1]) * 88_000.0;
        let up = altitude / 1e3 - self.place[2];
        let distance = (north * north + east * east + up * up).sqrt();
        if distance <= f64::from(self.float(20_002)) && up.abs() < 0.1 {
            if !self.is(Fault::ReachedStays) {
                self.path.pop_front();
            }
            return;
        }
        // Slow ahead, quick upwards, as the ports say.
        let ahead = f64::from(self.float(20_000)) * TICK.as_secs_f64() / distance.max(0.01);
        let climb = f64::from(self.float(20_001)) * TICK.as_secs_f64();
        self.place[0] += north * ahead.min(1.0) / 111_000.0;
        self.place[1] += east * ahead.min(1.0) / 88_000.0;
        let is_steep = north.abs() + east.abs() < 1.0;
        let most = if is_steep { climb } else { climb.min(0.002) };
        self.place[2] += up.clamp(-most, most);
    }
}
