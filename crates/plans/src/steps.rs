//! What the helicopter does for a plan: steps, and the legs of its paths.

use bridge::geodesy::{distance_m, ground_distance_m};
use dsp_protocol::Waypoint;
use dsp_protocol::downlink::Geographic;
use ipc_types::payload::WaypointPosition;

use crate::finding::Findings;

/// What the helicopter does at once.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Take off vertically.
    TakeOff {
        /// The item; `None` for the take-off that the operator asked for.
        item: Option<u32>,
        /// Height above take-off, m.
        height_m: f64,
    },
    /// Fly a path, at most [`MAX_WAYPOINTS`](bridge::flight::assembly::MAX_WAYPOINTS); afterwards the helicopter
    /// hovers.
    Path(Vec<PathPoint>),
    /// Hover.
    Wait {
        /// The item.
        item: u32,
        /// Seconds.
        duration_s: f64,
    },
    /// Set the cruise speed.
    Speed {
        /// The item.
        item: u32,
        /// m/s.
        speed_mps: f64,
    },
    /// Land vertically.
    Land {
        /// The item.
        item: u32,
    },
}

impl Step {
    /// The first item that the step belongs to; `None` for a take-off in front of the plan.
    pub fn first_item(&self) -> Option<u32> {
        match self {
            Step::TakeOff { item, .. } => *item,
            Step::Path(points) => points.first().map(|point| point.item),
            Step::Wait { item, .. } | Step::Speed { item, .. } | Step::Land { item } => Some(*item),
        }
    }
}

/// A waypoint of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// The item that it belongs to.
    pub item: u32,
    /// What the DSP gets, with its telemetry altitude.
    pub waypoint: Waypoint,
}

impl PathPoint {
    /// The position in the form of a request.
    pub fn position(&self) -> WaypointPosition {
        position(&self.waypoint)
    }
}

/// A waypoint of the DSP as a request has it.
pub(crate) fn position(waypoint: &Waypoint) -> WaypointPosition {
    WaypointPosition {
        latitude_deg: waypoint.latitude_deg,
        longitude_deg: waypoint.longitude_deg,
        altitude_m: waypoint.altitude_m,
    }
}

/// A straight way between two points, of all paths together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// From 1, of the whole flight.
    pub number: u32,
    /// The item that it leads to.
    pub item: u32,
    /// Which step it belongs to, from 0.
    pub step: usize,
    /// Where it begins.
    pub from: Waypoint,
    /// Where it ends.
    pub to: Waypoint,
    /// Where the helicopter is when its path is sent.
    pub path_start: Waypoint,
}

impl Leg {
    /// Along the ground and up or down, m.
    pub fn length_m(&self) -> f64 {
        distance_m(&self.from, &self.to)
    }
}

/// A plan as the helicopter flies it.
#[derive(Clone, Debug, PartialEq)]
pub struct Flight {
    /// In order.
    pub steps: Vec<Step>,
    /// In order.
    pub legs: Vec<Leg>,
    /// Items that are done by staying where the helicopter is.
    pub stays: Vec<u32>,
    /// What could not be turned into steps, and what the operator must know of it.
    pub findings: Findings,
}

impl Flight {
    /// Whether the helicopter does the item.
    pub fn is_flown(&self, item: u32) -> bool {
        self.stays.contains(&item)
            || self.steps.iter().any(|step| match step {
                Step::TakeOff { item: of, .. } => *of == Some(item),
                Step::Path(points) => points.iter().any(|point| point.item == item),
                Step::Wait { item: of, .. }
                | Step::Speed { item: of, .. }
                | Step::Land { item: of } => *of == item,
            })
    }

    /// The cruise speed that the plan has asked for before a step, from 0, m/s.
    pub fn speed_before(&self, step: usize) -> Option<f64> {
        self.steps[..step].iter().rev().find_map(|step| match step {
            Step::Speed { speed_mps, .. } => Some(*speed_mps),
            _ => None,
        })
    }
}

/// Metres along the ground.
pub fn ground_m(from: &Waypoint, to: &Waypoint) -> f64 {
    let from = Geographic {
        latitude_deg: from.latitude_deg,
        longitude_deg: from.longitude_deg,
        altitude_m: from.altitude_m,
    };
    ground_distance_m(&from, to)
}

/// The waypoint that arrives at the DSP: in steps of 10⁻⁷ degrees and 1 mm.
pub fn quantised(at: Waypoint) -> Waypoint {
    let round = |value: f64, steps: f64| (value * steps).round() / steps;
    Waypoint {
        latitude_deg: round(at.latitude_deg, 1e7),
        longitude_deg: round(at.longitude_deg, 1e7),
        altitude_m: round(at.altitude_m, 1e3),
    }
}
