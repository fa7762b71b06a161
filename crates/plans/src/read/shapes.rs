//! Points, lines and polygons with properties, as GeoJSON and KML have them, become items and fence areas.
//!
//! | property | of | meaning |
//! |---|---|---|
//! | `action` | point | `waypoint` (the default), `take-off`, `hold`, `land`, `return` |
//! | `hold_s` | point | how long to hover there, s |
//! | `speed_mps` | point, line | speed from there on, m/s |
//! | `altitude_reference` | point, line | `take-off`, `sea` or `terrain` |
//! | `kind` | polygon; point with `radius_m` | `inclusion` or `exclusion`: an area of the fence |

use super::items::{clean, push, push_area};
use crate::error::ReadError;
use crate::model::{
    Action, Altitude, FenceArea, FenceShape, LeftOut, OtherKind, Plan, Position, Reference,
};

/// One feature or placemark.
pub struct Feature<'a> {
    /// Where it stands, such as `feature 3`.
    pub origin: String,
    /// Its name, or nothing.
    pub name: &'a str,
    /// What is said about it.
    pub properties: Properties,
}

/// The properties of the table above.
#[derive(Default)]
pub struct Properties {
    pub action: Option<String>,
    pub hold_s: Option<f64>,
    pub speed_mps: Option<f64>,
    pub altitude_reference: Option<Reference>,
    pub is_inclusion: Option<bool>,
    pub radius_m: Option<f64>,
}

impl Properties {
    /// Takes a property; others mean nothing for a flight.
    ///
    /// # Errors
    ///
    /// A value that the property does not have, as a clause.
    pub fn take(&mut self, name: &str, value: &str) -> Result<(), String> {
        let number = || match value.trim().parse::<f64>() {
            Ok(number) if number.is_finite() && number >= 0.0 => Ok(Some(number)),
            _ => Err(format!(
                "`{name}` is `{}`, which is no number from 0 up",
                clean(value)
            )),
        };
        let one_of = |names: &str| format!("`{name}` is `{}`; it can be {names}", clean(value));
        match name {
            "action" => self.action = Some(value.trim().to_owned()),
            "hold_s" => self.hold_s = number()?,
            "speed_mps" => self.speed_mps = number()?,
            "radius_m" => self.radius_m = number()?,
            "altitude_reference" => {
                let reference = Reference::from_name(value.trim());
                self.altitude_reference =
                    Some(reference.ok_or_else(|| one_of("take-off, sea or terrain"))?);
            }
            "kind" => {
                self.is_inclusion = match value.trim() {
                    "inclusion" => Some(true),
                    "exclusion" => Some(false),
                    _ => return Err(one_of("inclusion or exclusion")),
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// A point of a shape.
#[derive(Clone, Copy)]
pub struct Vertex {
    /// Degrees.
    pub latitude_deg: f64,
    /// Degrees.
    pub longitude_deg: f64,
    /// Altitude by the file's own rules.
    pub altitude: Altitude,
}

/// Where points of a feature go.
pub struct Shapes<'a> {
    pub plan: &'a mut Plan,
    pub feature: Feature<'a>,
}

impl Shapes<'_> {
    /// A single point: an item, or the middle of a circle of the fence.
    pub fn point(&mut self, vertex: &Vertex) -> Result<(), ReadError> {
        let properties = &self.feature.properties;
        if let Some(is_inclusion) = properties.is_inclusion {
            let radius_m = properties
                .radius_m
                .ok_or_else(|| self.wrong("a point with a `kind` needs a `radius_m`"))?;
            let centre = self.position(vertex)?;
            return self.area(is_inclusion, FenceShape::Circle { centre, radius_m });
        }
        self.speed()?;
        let action = self.action(vertex)?;
        self.item(action)
    }

    /// A line: a waypoint for each of its points.
    pub fn line(&mut self, vertices: &[Vertex]) -> Result<(), ReadError> {
        if self.feature.properties.action.is_some() {
            return Err(self.wrong("an `action` belongs to a point, not to a line"));
        }
        self.speed()?;
        for vertex in vertices {
            let action = self.action(vertex)?;
            self.item(action)?;
        }
        Ok(())
    }

    /// A polygon: an area of the fence, if the file says so.
    pub fn polygon(&mut self, outline: &[Vertex], holes: usize) -> Result<(), ReadError> {
        let Some(is_inclusion) = self.feature.properties.is_inclusion else {
            return self
                .left_out("polygon without the property `kind`, `inclusion` or `exclusion`");
        };
        if holes > 0 {
            return self.left_out("polygon with holes");
        }
        let mut vertices = outline
            .iter()
            .map(|vertex| self.position(vertex))
            .collect::<Result<Vec<_>, _>>()?;
        // Both formats repeat the first point at the end.
        if vertices.len() > 1 && vertices.first() == vertices.last() {
            vertices.pop();
        }
        self.area(is_inclusion, FenceShape::Polygon(vertices))
    }

    /// A shape that is no item and no area.
    pub fn left_out(&mut self, what: &str) -> Result<(), ReadError> {
        let Feature { origin, name, .. } = &self.feature;
        let name = clean(name);
        let of = match name.is_empty() {
            true => String::new(),
            false => format!(" `{name}`"),
        };
        if self.plan.left_out.len() == crate::error::MAX_ITEMS {
            return Err(ReadError::too_many_items());
        }
        self.plan.left_out.push(LeftOut {
            what: format!("{origin}{of}: {what}"),
            kind: OtherKind::Flight,
        });
        Ok(())
    }

    fn action(&self, vertex: &Vertex) -> Result<Action, ReadError> {
        let properties = &self.feature.properties;
        let position = self.position(vertex)?;
        let altitude = self.altitude(vertex);
        let hold_s = properties.hold_s;
        Ok(match properties.action.as_deref() {
            None | Some("waypoint") => Action::Waypoint {
                position,
                altitude,
                hold_s: hold_s.unwrap_or(0.0),
            },
            Some("take-off" | "takeoff") => Action::TakeOff {
                position: Some(position),
                altitude,
            },
            Some("hold") => Action::Hold {
                position: Some(position),
                altitude: Some(altitude),
                duration_s: hold_s,
            },
            Some("land") => Action::Land {
                position: Some(position),
            },
            Some("return") => Action::ReturnToLaunch,
            Some(other) => {
                return Err(self.wrong(format!(
                    "`action` is `{}`; it can be waypoint, take-off, hold, land or return",
                    clean(other)
                )));
            }
        })
    }

    /// The property takes precedence over the format.
    fn altitude(&self, vertex: &Vertex) -> Altitude {
        let metres = match vertex.altitude {
            Altitude::AboveTakeOff(metres)
            | Altitude::AboveSea(metres)
            | Altitude::AboveTerrain(metres)
            | Altitude::Unstated(Some(metres)) => metres,
            Altitude::Unstated(None) => return vertex.altitude,
        };
        match self.feature.properties.altitude_reference {
            _ if !metres.is_finite() => Altitude::Unstated(None),
            Some(reference) => reference.at(metres),
            None => vertex.altitude,
        }
    }

    fn speed(&mut self) -> Result<(), ReadError> {
        match self.feature.properties.speed_mps {
            Some(speed_mps) => self.item(Action::Speed { speed_mps }),
            None => Ok(()),
        }
    }

    fn item(&mut self, action: Action) -> Result<(), ReadError> {
        push(self.plan, &self.feature.origin, self.feature.name, action)
    }

    fn area(&mut self, is_inclusion: bool, shape: FenceShape) -> Result<(), ReadError> {
        let name = self.feature.name.to_owned();
        let area = FenceArea {
            name,
            is_inclusion,
            shape,
        };
        push_area(self.plan, area)
    }

    fn position(&self, vertex: &Vertex) -> Result<Position, ReadError> {
        Position::new(vertex.latitude_deg, vertex.longitude_deg)
            .map_err(|reason| self.wrong(reason))
    }

    fn wrong(&self, reason: impl std::fmt::Display) -> ReadError {
        ReadError::part(&self.feature.origin, reason)
    }
}
