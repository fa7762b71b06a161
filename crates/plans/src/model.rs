//! The model of a plan: what its author wants, in the order in which it is flown, whatever program wrote it.
//!
//! Nothing of a file is lost without a trace: what the model has no word for stays as [`Action::Other`], by its name.

use std::fmt;

use crate::format::PlanFormat;
use crate::mavlink::MissionItem;

/// A plan as its file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What kind of file it was.
    pub format: PlanFormat,
    /// Where the author expected the helicopter to take off. It is not flown to.
    pub planned_home: Option<PlannedHome>,
    /// What is to be done, in order.
    pub items: Vec<Item>,
    /// Where the author allows to fly.
    pub fence: Vec<FenceArea>,
    /// Everything else that the file has and this model has not, one entry each.
    pub left_out: Vec<LeftOut>,
    /// Speed in a hover-capable vehicle's mission that the author reckoned with, m/s.
    pub planned_speed_mps: Option<f64>,
}

impl Plan {
    /// A plan with nothing in it.
    pub fn empty(format: PlanFormat) -> Plan {
        Plan {
            format,
            planned_home: None,
            items: Vec::new(),
            fence: Vec::new(),
            left_out: Vec::new(),
            planned_speed_mps: None,
        }
    }

    /// Gives items whose file does not say what their altitude is above, or has none, what `stated` says. Items with a
    /// reference of their own keep it.
    pub fn state_altitudes(&mut self, stated: &StatedAltitudes) {
        for item in &mut self.items {
            if let Some(altitude) = item.action.altitude_mut() {
                *altitude = match (*altitude, stated.reference, stated.missing) {
                    (Altitude::Unstated(Some(number)), Some(reference), _) => reference.at(number),
                    (Altitude::Unstated(None), _, Some(missing)) => missing,
                    (altitude, _, _) => altitude,
                };
            }
        }
    }
}

/// What the operator says of altitudes that the file leaves open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StatedAltitudes {
    /// What numbers without a reference are above.
    pub reference: Option<Reference>,
    /// The altitude of items without one.
    pub missing: Option<Altitude>,
}

/// A place on the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Degrees, −90 … 90, to the north.
    pub latitude_deg: f64,
    /// Degrees, −180 … 180, to the east.
    pub longitude_deg: f64,
}

impl Position {
    /// The position, if both numbers are finite and in range.
    ///
    /// # Errors
    ///
    /// Which of them is not, as a clause for people.
    pub fn new(latitude_deg: f64, longitude_deg: f64) -> Result<Position, String> {
        let check = |name: &str, value: f64, limit: f64| match value.abs() <= limit {
            true => Ok(value),
            false => Err(format!(
                "the {name} {value} is not from -{limit} to {limit} degrees"
            )),
        };
        Ok(Position {
            latitude_deg: check("latitude", latitude_deg, 90.0)?,
            longitude_deg: check("longitude", longitude_deg, 180.0)?,
        })
    }
}

/// The home of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedHome {
    /// Where.
    pub position: Position,
    /// Metres above sea, if the file says so.
    pub above_sea_m: Option<f64>,
}

/// What an altitude is above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// The point of take-off.
    TakeOff,
    /// Mean sea level.
    Sea,
    /// The ground below.
    Terrain,
}

impl Reference {
    /// The altitude `metres` above this.
    pub fn at(self, metres: f64) -> Altitude {
        match self {
            Reference::TakeOff => Altitude::AboveTakeOff(metres),
            Reference::Sea => Altitude::AboveSea(metres),
            Reference::Terrain => Altitude::AboveTerrain(metres),
        }
    }

    /// The reference with the name that GeoJSON and KML properties have: `take-off`, `sea`, `terrain`.
    pub fn from_name(name: &str) -> Option<Reference> {
        match name {
            "take-off" | "takeoff" => Some(Reference::TakeOff),
            "sea" => Some(Reference::Sea),
            "terrain" => Some(Reference::Terrain),
            _ => None,
        }
    }
}

/// An altitude with what it is above, finite, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Altitude {
    /// Above the point of take-off.
    AboveTakeOff(f64),
    /// Above mean sea level.
    AboveSea(f64),
    /// Above the ground below, which the helicopter does not know.
    AboveTerrain(f64),
    /// The file has a number and does not say above what, or has no altitude.
    Unstated(Option<f64>),
}

impl Altitude {
    /// The number, whatever it is above.
    pub fn metres(self) -> Option<f64> {
        match self {
            Altitude::AboveTakeOff(metres)
            | Altitude::AboveSea(metres)
            | Altitude::AboveTerrain(metres) => Some(metres),
            Altitude::Unstated(metres) => metres,
        }
    }
}

impl fmt::Display for Altitude {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Altitude::AboveTakeOff(metres) => write!(f, "{metres:.1} m above take-off"),
            Altitude::AboveSea(metres) => write!(f, "{metres:.1} m above sea"),
            Altitude::AboveTerrain(metres) => write!(f, "{metres:.1} m above terrain"),
            Altitude::Unstated(Some(metres)) => write!(f, "{metres:.1} m above an unknown zero"),
            Altitude::Unstated(None) => f.write_str("no altitude"),
        }
    }
}

/// One item of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Its place in the plan, from 1. Parts of a survey are items of their own.
    pub number: u32,
    /// Where it stands in the file, such as `line 7` or `item 3 (survey), part 12`.
    pub origin: String,
    /// The name that the author gave it; empty when there is none.
    pub label: String,
    /// What is to be done.
    pub action: Action,
    /// What the item asks for beside its action and the helicopter does not do.
    pub ignored: Vec<Ignored>,
    /// The item as MAVLink has it, when the file did.
    pub mavlink: Option<MissionItem>,
}

/// What an item asks for beside its action.
#[derive(Clone, Debug, PartialEq)]
pub struct Ignored {
    /// What it is, such as `the heading 90 degrees`.
    pub text: String,
    /// Whether the flight is the same without it.
    pub kind: OtherKind,
}

/// What an item asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Take off and climb; then, if there is a position, fly there.
    TakeOff {
        /// Where the climb leads to.
        position: Option<Position>,
        /// The end of the climb.
        altitude: Altitude,
    },
    /// Fly to a place.
    Waypoint {
        /// Where.
        position: Position,
        /// How high.
        altitude: Altitude,
        /// How long to hover there, s; 0 to fly on.
        hold_s: f64,
    },
    /// Hover.
    Hold {
        /// Where; `None` for the place where the helicopter is.
        position: Option<Position>,
        /// How high; `None` for as high as the helicopter is.
        altitude: Option<Altitude>,
        /// How long, s; `None` for ever.
        duration_s: Option<f64>,
    },
    /// Fly at this speed over ground from here on, m/s.
    Speed {
        /// m/s.
        speed_mps: f64,
    },
    /// Fly to where the take-off was and land.
    ReturnToLaunch,
    /// Land.
    Land {
        /// Where; `None` for the place where the helicopter is.
        position: Option<Position>,
    },
    /// Something that this model has no word for.
    Other {
        /// Its name, as its format calls it.
        name: String,
        /// Whether the flight is the same without it.
        kind: OtherKind,
    },
}

impl Action {
    /// One or two words for people.
    pub fn name(&self) -> &str {
        match self {
            Action::TakeOff { .. } => "take-off",
            Action::Waypoint { .. } => "waypoint",
            Action::Hold { .. } => "hold",
            Action::Speed { .. } => "speed",
            Action::ReturnToLaunch => "return",
            Action::Land { .. } => "land",
            Action::Other { name, .. } => name,
        }
    }

    /// Where it is done, if it says so.
    pub fn position(&self) -> Option<Position> {
        match self {
            Action::Waypoint { position, .. } => Some(*position),
            Action::TakeOff { position, .. }
            | Action::Hold { position, .. }
            | Action::Land { position } => *position,
            Action::Speed { .. } | Action::ReturnToLaunch | Action::Other { .. } => None,
        }
    }

    /// How high it is done, if it says so.
    pub fn altitude(&self) -> Option<Altitude> {
        match self {
            Action::TakeOff { altitude, .. } | Action::Waypoint { altitude, .. } => Some(*altitude),
            Action::Hold { altitude, .. } => *altitude,
            _ => None,
        }
    }

    fn altitude_mut(&mut self) -> Option<&mut Altitude> {
        match self {
            Action::TakeOff { altitude, .. } | Action::Waypoint { altitude, .. } => Some(altitude),
            Action::Hold { altitude, .. } => altitude.as_mut(),
            _ => None,
        }
    }
}

/// Whether the flight is the same without an item that cannot be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherKind {
    /// It is for a camera, a gimbal or another load, or for the heading: the path stays the same.
    Payload,
    /// It changes the flight, or may.
    Flight,
}

/// An area of a plan's own geofence.
#[derive(Clone, Debug, PartialEq)]
pub struct FenceArea {
    /// Its name, or its kind and its number in the file.
    pub name: String,
    /// Whether it must not be left; otherwise it must not be entered.
    pub is_inclusion: bool,
    /// Its outline.
    pub shape: FenceShape,
}

/// The outline of a [`FenceArea`].
#[derive(Clone, Debug, PartialEq)]
pub enum FenceShape {
    /// Vertices in order.
    Polygon(Vec<Position>),
    /// A circle.
    Circle {
        /// Its middle.
        centre: Position,
        /// Metres.
        radius_m: f64,
    },
}

/// A part of a file that is no item and is not used.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// What it is, as the beginning of a sentence.
    pub what: String,
    /// Whether the flight is the same without it.
    pub kind: OtherKind,
}
