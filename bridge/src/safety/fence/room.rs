//! How much room a helicopter needs to stop before the fence, and how fast it flies.

use serde::{Deserialize, Serialize};

/// How much of the margin of a path is for how far the helicopter strays from it; in flight the rest must be left.
const STRAY_SHARE: f64 = 0.5;

/// How many times as hard as it brakes at least a helicopter accelerates at most.
const MOST_BY_LEAST: f64 = 2.0;

/// How a helicopter stops, and how far it strays from where it should be.
///
/// At the speed v it needs v · `reaction_s` + v² / (2 · `braking_mps2`) to stop. The reaction is the sum of what passes
/// until the helicopter brakes at all, with the defaults of both sides:
///
/// | what | at most |
/// |---|---|
/// | a status is measured, and the next one is awaited by the rule *confirmed* | two status periods of 20 ms |
/// | it is on the line: 110 bytes at 115,200 Bd | 10 ms |
/// | the bridge wakes and answers | 10 ms |
/// | a command that is under way is acknowledged first, or its time-out passes | 200 ms |
/// | *invalidate path* is on the line, and the DSP takes it at its next cycle | 25 ms |
/// | the helicopter turns from flying to braking | 300 ms |
///
/// Each command that the line loses adds an `ack_timeout_ms`: on a poor line `reaction_s` is to be longer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// A path stays so far from every boundary, metres.
    pub margin_m: f64,
    /// How hard the helicopter brakes at least, m/s².
    pub braking_mps2: f64,
    /// How long it takes until it brakes, s.
    pub reaction_s: f64,
}

impl Default for Room {
    fn default() -> Self {
        Room {
            // ArduPilot's value (FENCE_MARGIN).
            margin_m: 2.0,
            // Half of what the simulated helicopter does, and a little less than PX4 plans with (MPC_ACC_HOR).
            braking_mps2: 2.5,
            reaction_s: 0.6,
        }
    }
}

impl Room {
    /// A helicopter in flight must be able to stop so far from every boundary, metres.
    pub(super) fn margin_in_flight_m(&self) -> f64 {
        self.margin_m * STRAY_SHARE
    }

    /// The speed that a helicopter reaches at most on a leg that it begins at `begin_mps`, m/s. Of the leg, what a
    /// helicopter strays in a hover does not count.
    pub(super) fn reached_mps(&self, begin_mps: f64, length_m: f64) -> f64 {
        let length_m = (length_m - self.margin_m * STRAY_SHARE).max(0.0);
        let accelerating_mps2 = MOST_BY_LEAST * self.braking_mps2;
        begin_mps.hypot((2.0 * accelerating_mps2 * length_m).sqrt())
    }

    /// For so long the helicopter would have to go on at `speed_mps` to come to where it stops, s.
    pub(super) fn stopping_s(&self, speed_mps: f64) -> f64 {
        self.reaction_s + speed_mps / (2.0 * self.braking_mps2)
    }
}

/// How fast paths are flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds {
    /// Greatest speed along the ground, m/s.
    pub cruise_mps: f64,
    /// Greatest speed up and down, m/s.
    pub climb_mps: f64,
    /// How fast the helicopter is where the leg begins, m/s; infinite if that is not known.
    pub begin_mps: f64,
}

impl Speeds {
    /// The speed along a leg of so many metres along the ground and up or down.
    pub(super) fn along(&self, ground_m: f64, climb_m: f64) -> f64 {
        let length_m = ground_m.hypot(climb_m);
        (self.cruise_mps * length_m / ground_m).min(self.climb_mps * length_m / climb_m.abs())
    }
}

/// A velocity over ground.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Velocity {
    /// Along the ground, m/s.
    pub ground_mps: f64,
    /// The direction of that, clockwise from true north, degrees.
    pub course_deg: f64,
    /// Up, m/s.
    pub up_mps: f64,
}
