//! When each leg ends, and how far the helicopter has come by then.
//!
//! A leg takes as long as the slower of its ways, along the ground at cruise speed and up or down at climb speed.
//! Speeding up and slowing down are not reckoned with.

use dsp_protocol::port;

use crate::flight::{Flight, Leg, Step, ground_m};
use crate::site::Endurance;

/// The state of the flight at the end of a step or of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// The item; `None` for the take-off that the operator asked for.
    pub item: Option<u32>,
    /// The leg that ends here.
    pub leg: Option<u32>,
    /// What was flown, m, climbs and descents included.
    pub distance_m: f64,
    /// What was flown since the mark before, m.
    pub step_m: f64,
    /// Seconds since the beginning, if the cruise speed is known.
    pub time_s: Option<f64>,
}

/// The marks of a flight, in order.
pub fn timeline(flight: &Flight, endurance: &Endurance) -> Vec<Mark> {
    let at_boot = port::port32(port::CLIMB_SPEED_MPS).map_or(1.0, |port| f64::from(port.boot));
    let mut clock = FlightClock {
        cruise_mps: endurance.cruise_speed_mps,
        climb_mps: endurance.climb_speed_mps.unwrap_or(at_boot),
        time_s: Some(0.0),
        distance_m: 0.0,
        height_m: 0.0,
        marks: Vec::new(),
    };
    for (index, step) in flight.steps.iter().enumerate() {
        match step {
            Step::TakeOff { item, height_m } => {
                clock.height_m = *height_m;
                clock.climb(*item, height_m.max(0.0));
            }
            Step::Path(_) => {
                let legs = flight.legs.iter().filter(|leg| leg.step == index);
                legs.for_each(|leg| clock.fly(leg));
            }
            Step::Wait { item, duration_s } => {
                clock.mark(Some(*item), None, 0.0, Some(*duration_s))
            }
            Step::Speed { item, speed_mps } => {
                clock.cruise_mps = Some(*speed_mps).filter(|speed| *speed > 0.0);
                clock.mark(Some(*item), None, 0.0, Some(0.0));
            }
            Step::Land { item } => {
                let height_m = clock.height_m.max(0.0);
                clock.climb(Some(*item), height_m);
                clock.height_m = 0.0;
            }
        }
    }
    clock.marks
}

struct FlightClock {
    cruise_mps: Option<f64>,
    climb_mps: f64,
    time_s: Option<f64>,
    distance_m: f64,
    /// Over the last point of take-off.
    height_m: f64,
    marks: Vec<Mark>,
}

impl FlightClock {
    fn climb(&mut self, item: Option<u32>, height_m: f64) {
        let duration_s = height_m / self.climb_mps;
        self.mark(item, None, height_m, Some(duration_s));
    }

    fn fly(&mut self, leg: &Leg) {
        let climb_m = leg.to.altitude_m - leg.from.altitude_m;
        self.height_m += climb_m;
        let climb_s = climb_m.abs() / self.climb_mps;
        let duration_s = self
            .cruise_mps
            .map(|speed| (ground_m(&leg.from, &leg.to) / speed).max(climb_s));
        self.mark(Some(leg.item), Some(leg.number), leg.length_m(), duration_s);
    }

    fn mark(&mut self, item: Option<u32>, leg: Option<u32>, step_m: f64, duration_s: Option<f64>) {
        self.distance_m += step_m;
        self.time_s = self
            .time_s
            .zip(duration_s)
            .map(|(time_s, duration_s)| time_s + duration_s);
        self.marks.push(Mark {
            item,
            leg,
            distance_m: self.distance_m,
            step_m,
            time_s: self.time_s,
        });
    }
}
