//! The last state of the helicopter that telemetry gave, as far as the flight needs it, with its age.

use std::time::Duration;

use dsp_protocol::Status;
use dsp_protocol::downlink::{Geographic, Supply};
use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

use crate::geodesy::{distance_m, here};
use crate::link::StatusSample;
use crate::safety::SafetyFacts;
use crate::safety::fence::Velocity;

/// NMEA fix quality without a fix (`docs/protocol.md` section 4.1).
const GPS_NO_FIX: u8 = 0;

/// No helicopter is faster, m/s.
const FASTEST_MPS: f64 = 100.0;

/// A position that leaps farther than the fastest flight and this is not plausible, m. A better fix moves it by less.
const LEAP_M: f64 = 500.0;

/// What was last seen. A value that is too old is not known any more; how old that is, the link's observed status
/// period says ([`Link::status_fresh_for`](crate::link::Link::status_fresh_for)).
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Observation {
    fresh_for: Duration,
    flying: Option<(bool, MonotonicNs)>,
    /// Samples received before this moment do not say whether it is in the air.
    flying_since: MonotonicNs,
    position: Option<(Geographic, MonotonicNs)>,
    /// Where it stood last.
    home: Option<Geographic>,
    /// The position of the last sample, if it has one that is plausible.
    latest: Option<Geographic>,
    /// What the last position was said to be, plausible or not.
    said: Option<(Geographic, MonotonicNs)>,
    velocity: Option<(Velocity, MonotonicNs)>,
    supply: Option<(Supply, MonotonicNs)>,
}

impl Observation {
    /// Takes a sample; values count as known for `fresh_for` from now on. A sample without a known position leaves the
    /// last one to age.
    pub fn take(&mut self, sample: &StatusSample, fresh_for: Duration) {
        let at = sample.received;
        self.fresh_for = fresh_for;
        // A sample may have waited for its successor: one from before a change does not show it.
        if at >= self.flying_since {
            self.flying = Some((sample.status.flying, at));
        }
        self.latest = known_position(&sample.status).filter(|said| self.is_plausible(said, at));
        if let Some(said) = known_position(&sample.status) {
            self.said = Some((said, at));
        }
        if let Some(position) = self.latest {
            self.velocity = sample.status.gps_velocity.map(|measured| {
                let velocity = Velocity {
                    ground_mps: measured.horizontal_speed_mps.into(),
                    course_deg: measured.heading_deg.into(),
                    up_mps: measured.vertical_speed_mps.into(),
                };
                (velocity, at)
            });
            self.position = Some((position, at));
            if !sample.status.flying {
                self.home = Some(position);
            }
        }
        if let Some(supply) = sample.status.supply {
            self.supply = Some((supply, at));
        }
    }

    /// The DSP has begun something that changes whether the helicopter is in the air: the next sample says it again, or
    /// the DSP's word that it is over.
    pub fn forget_flying(&mut self, now: MonotonicNs) {
        self.flying = None;
        self.flying_since = now;
    }

    /// The DSP says that the helicopter is in the air, without a sample.
    pub fn note_flying(&mut self, now: MonotonicNs) {
        self.flying = Some((true, now));
        self.flying_since = now;
    }

    /// Whether the helicopter is in the air, if that is known.
    pub fn flying(&self, now: MonotonicNs) -> Option<bool> {
        self.fresh(self.flying, now)
    }

    /// Whether the helicopter was in the air when that was last known.
    pub fn flew(&self) -> bool {
        self.flying.is_some_and(|(flying, _)| flying)
    }

    /// Whether the helicopter may be in the air: it was when that was last known, or that was never known.
    pub fn may_fly(&self) -> bool {
        self.flying.is_none_or(|(flying, _)| flying)
    }

    /// Where the helicopter is, if that is known.
    pub fn position(&self, now: MonotonicNs) -> Option<Geographic> {
        self.fresh(self.position, now)
    }

    /// Where the helicopter stands, and in the air where it took off, if it was seen there. It does not age.
    pub fn home(&self) -> Option<Geographic> {
        self.home
    }

    /// The position in the last sample, if it has one that is plausible.
    pub fn latest(&self) -> Option<Geographic> {
        self.latest
    }

    /// Whether a helicopter can have come to this position, which is said to be its own at `now`. One that leapt is
    /// plausible when the next one is near it.
    fn is_plausible(&self, position: &Geographic, now: MonotonicNs) -> bool {
        self.said.is_none_or(|(before, seen)| {
            let farthest_m = LEAP_M + FASTEST_MPS * now.since(seen).as_secs_f64();
            distance_m(&here(position), &here(&before)) <= farthest_m
        })
    }

    /// Telemetry altitude of home, m.
    pub fn ground_altitude_m(&self) -> Option<f64> {
        self.home.map(|home| home.altitude_m)
    }

    /// Battery, fuel and the pilot's switch, if they are known.
    pub fn supply(&self, now: MonotonicNs) -> Option<Supply> {
        self.fresh(self.supply, now)
    }

    /// How fast the helicopter is, in all directions, if that is known, m/s.
    pub fn speed_mps(&self, now: MonotonicNs) -> Option<f64> {
        let velocity = self.fresh(self.velocity, now)?;
        Some(velocity.ground_mps.hypot(velocity.up_mps))
    }

    /// What the safety rules ask for.
    pub fn safety_facts(&self, now: MonotonicNs) -> SafetyFacts {
        SafetyFacts {
            position: self.position(now),
            has_position: self.latest.is_some(),
            velocity: self.fresh(self.velocity, now),
            supply: self.supply(now),
        }
    }

    fn fresh<T>(&self, value: Option<(T, MonotonicNs)>, now: MonotonicNs) -> Option<T> {
        value.and_then(|(value, seen)| (now.since(seen) <= self.fresh_for).then_some(value))
    }
}

/// The position in a status, unless the status says that the GPS has no fix: what stands there then was never measured.
fn known_position(status: &Status) -> Option<Geographic> {
    status
        .geographic
        .filter(|_| status.gps_quality != Some(GPS_NO_FIX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_recent_for_its_time_and_no_longer() {
        let mut seen = Observation::default();
        let (at, recent) = (MonotonicNs(1000), Duration::from_nanos(50));
        let sample = StatusSample {
            status: Status::default(),
            received: at,
            sent: Default::default(),
        };
        seen.take(&sample, recent);
        assert_eq!(seen.flying(MonotonicNs(1050)), Some(false));
        assert_eq!(seen.flying(MonotonicNs(1051)), None);
        // The next sample says it again, or the DSP's word.
        seen.forget_flying(at);
        assert_eq!(seen.flying(at), None);
        seen.take(&sample, recent);
        assert_eq!(seen.flying(at), Some(false));
        seen.note_flying(at);
        assert_eq!(seen.flying(at), Some(true));
    }
}
