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
use super::tree::{Node, Remarks, Value, has_word, speaks_of_flying, whole_number};
use crate::error::ReadError;
use crate::model::{Action, Altitude, FenceArea, FenceShape, OtherKind, Plan, Position, Reference};

/// Properties that other programs write, and from which nothing follows for a flight: names, times, and how a shape is drawn.
pub const HARMLESS_PROPERTIES: &str = "name title description desc cmt id fid time timestamp styleUrl stroke stroke-width \
    stroke-opacity fill fill-opacity marker-color marker-size marker-symbol icon visibility";

/// One feature or placemark.
#[derive(Default)]
pub struct Feature {
    /// Which it is, such as `feature 3`.
    pub part: String,
    pub line: usize,
    /// Its name, or nothing.
    pub name: String,
    /// What is said about it.
    pub properties: Properties,
}

/// The properties of the table above.
#[derive(Default)]
pub struct Properties {
    action: Option<String>,
    hold_s: Option<f64>,
    speed_mps: Option<f64>,
    altitude_reference: Option<Reference>,
    is_inclusion: Option<bool>,
    radius_m: Option<f64>,
    /// Their names and lines.
    stated: Vec<(&'static str, usize)>,
}

const KNOWN: [&str; 6] = [
    "action",
    "hold_s",
    "speed_mps",
    "altitude_reference",
    "kind",
    "radius_m",
];

impl Properties {
    /// Takes the property `name` with the value of `node`. `null` and an empty text say nothing. What is not known is a remark.
    ///
    /// # Errors
    ///
    /// A value that the property does not have, or a second one.
    pub fn take(
        &mut self,
        name: &str,
        node: &Node,
        remarks: &mut Remarks,
    ) -> Result<(), ReadError> {
        let text = match &node.value {
            Value::Text(text) => text.trim().to_owned(),
            Value::Number(number) => number.to_string(),
            Value::Flag(flag) => flag.to_string(),
            Value::Null => String::new(),
            Value::List | Value::Object => "a list or an object".to_owned(),
        };
        let Some(known) = KNOWN.iter().find(|known| **known == name) else {
            if !has_word(HARMLESS_PROPERTIES, name) {
                let kind = match speaks_of_flying(name) {
                    true => OtherKind::Flight,
                    false => OtherKind::Payload,
                };
                remarks.add(
                    node.line,
                    format!("the property `{}` is not read", clean(name)),
                    kind,
                );
            }
            return Ok(());
        };
        if text.is_empty() {
            return Ok(());
        }
        if self.stated.iter().any(|(stated, _)| stated == known) {
            return Err(node.wrong(format!("`{name}` is said twice of the same shape")));
        }
        self.stated.push((known, node.line));
        let number = || match whole_number(&text) {
            Some(number) if number >= 0.0 => Ok(Some(number)),
            _ => Err(node.wrong(format!(
                "`{name}` is `{}`, which is no number from 0 up",
                clean(&text)
            ))),
        };
        let one_of =
            |names: &str| node.wrong(format!("`{name}` is `{}`; it can be {names}", clean(&text)));
        match name {
            "hold_s" => self.hold_s = number()?,
            "speed_mps" => self.speed_mps = number()?,
            "radius_m" => self.radius_m = number()?,
            "altitude_reference" => {
                let reference = Reference::from_name(&text);
                self.altitude_reference =
                    Some(reference.ok_or_else(|| one_of("take-off, sea or terrain"))?);
            }
            "kind" => {
                self.is_inclusion = match &*text {
                    "inclusion" => Some(true),
                    "exclusion" => Some(false),
                    _ => return Err(one_of("inclusion or exclusion")),
                }
            }
            _ => self.action = Some(text),
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
    /// As the file's own rules say.
    pub altitude: Altitude,
}

/// Where points of a feature go.
pub struct Shapes {
    pub plan: Plan,
    pub remarks: Remarks,
    pub feature: Feature,
}

impl Shapes {
    pub fn new(plan: Plan) -> Shapes {
        Shapes {
            plan,
            remarks: Remarks::default(),
            feature: Feature::default(),
        }
    }

    /// A single point: an item, or the middle of a circle of the fence.
    pub fn point(&mut self, vertex: &Vertex) -> Result<(), ReadError> {
        let properties = &self.feature.properties;
        if let Some(is_inclusion) = properties.is_inclusion {
            let radius_m = properties.radius_m;
            let radius_m =
                radius_m.ok_or_else(|| self.wrong("a point with a `kind` needs a `radius_m`"))?;
            let centre = self.position(vertex)?;
            self.only("a circle of the fence", &["kind", "radius_m"]);
            return self.area(
                is_inclusion,
                FenceShape::Circle { centre, radius_m },
                &[*vertex],
            );
        }
        let hold_s = properties.hold_s;
        self.speed()?;
        let action = self.action(vertex)?;
        let mut allowed = vec!["action", "speed_mps", "altitude_reference", "hold_s"];
        match action {
            Action::ReturnToLaunch => allowed.truncate(3),
            // There is no word for a hover after a climb, or before a landing, but a hover of its own.
            Action::TakeOff { .. } => {
                self.item(action.clone())?;
                return self.hover(None, None, hold_s);
            }
            Action::Land { position } => {
                let altitude = self.altitude(vertex);
                self.hover(position, Some(altitude), hold_s)?;
            }
            _ => {}
        }
        self.only("such a point", &allowed);
        self.item(action)
    }

    fn hover(
        &mut self,
        position: Option<Position>,
        altitude: Option<Altitude>,
        hold_s: Option<f64>,
    ) -> Result<(), ReadError> {
        match hold_s.filter(|seconds| *seconds > 0.0) {
            Some(_) => self.item(Action::Hold {
                position,
                altitude,
                duration_s: hold_s,
            }),
            None => Ok(()),
        }
    }

    /// A line: a waypoint for each of its points.
    pub fn line(&mut self, vertices: &[Vertex]) -> Result<(), ReadError> {
        self.only("a line", &["speed_mps", "altitude_reference"]);
        self.speed()?;
        for vertex in vertices {
            let (position, altitude) = (self.position(vertex)?, self.altitude(vertex));
            self.item(Action::Waypoint {
                position,
                altitude,
                hold_s: 0.0,
            })?;
        }
        Ok(())
    }

    /// A polygon: an area of the fence, if the file says so.
    pub fn polygon(&mut self, outline: &[Vertex], has_holes: bool) -> Result<(), ReadError> {
        self.only("a polygon", &["kind"]);
        let Some(is_inclusion) = self.feature.properties.is_inclusion else {
            return self
                .left_out("polygon without the property `kind`, `inclusion` or `exclusion`");
        };
        if has_holes {
            return self.left_out("polygon with holes");
        }
        let positions = outline.iter().map(|vertex| self.position(vertex));
        let mut vertices = positions.collect::<Result<Vec<_>, _>>()?;
        // Both formats repeat the first point at the end.
        if vertices.len() > 1 && vertices.first() == vertices.last() {
            vertices.pop();
        }
        self.area(is_inclusion, FenceShape::Polygon(vertices), outline)
    }

    /// A shape that is no item and no area.
    pub fn left_out(&mut self, what: &str) -> Result<(), ReadError> {
        let Feature {
            part, name, line, ..
        } = &self.feature;
        let of = match clean(name) {
            name if name.is_empty() => name,
            name => format!(" `{name}`"),
        };
        self.remarks
            .add(*line, format!("{part}{of}: {what}"), OtherKind::Flight);
        Ok(())
    }

    /// Names the properties that a shape cannot have.
    fn only(&mut self, shape: &str, allowed: &[&str]) {
        for (name, line) in &self.feature.properties.stated {
            if !allowed.contains(name) {
                self.remarks.add(
                    *line,
                    format!("`{name}` cannot belong to {shape}"),
                    OtherKind::Flight,
                );
            }
        }
    }

    fn action(&self, vertex: &Vertex) -> Result<Action, ReadError> {
        let properties = &self.feature.properties;
        let position = self.position(vertex)?;
        let altitude = self.altitude(vertex);
        let hold_s = properties.hold_s;
        if properties.radius_m.is_some() {
            return Err(self.wrong("a point with a `radius_m` needs a `kind`"));
        }
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
                let found = clean(other);
                let reason = format!(
                    "`action` is `{found}`; it can be waypoint, take-off, hold, land or return"
                );
                return Err(self.wrong(reason));
            }
        })
    }

    /// The property takes precedence over the format.
    fn altitude(&self, vertex: &Vertex) -> Altitude {
        match (
            vertex.altitude.metres(),
            self.feature.properties.altitude_reference,
        ) {
            (Some(metres), Some(reference)) => reference.at(metres),
            _ => vertex.altitude,
        }
    }

    fn speed(&mut self) -> Result<(), ReadError> {
        match self.feature.properties.speed_mps {
            Some(speed_mps) => self.item(Action::Speed { speed_mps }),
            None => Ok(()),
        }
    }

    fn item(&mut self, action: Action) -> Result<(), ReadError> {
        let origin = self.origin();
        push(&mut self.plan, &origin, &self.feature.name, action)
    }

    /// The bridge's areas have no altitudes of vertices: those of an exclusion are not needed, those of an inclusion could limit it.
    fn area(
        &mut self,
        is_inclusion: bool,
        shape: FenceShape,
        vertices: &[Vertex],
    ) -> Result<(), ReadError> {
        if vertices
            .iter()
            .any(|vertex| vertex.altitude.metres().is_some_and(|metres| metres != 0.0))
        {
            let kind = match is_inclusion {
                true => OtherKind::Flight,
                false => OtherKind::Payload,
            };
            let text = "the altitudes of a fence area are not read: it reaches from below the ground to the sky";
            self.remarks.add(self.feature.line, text, kind);
        }
        let name = self.feature.name.clone();
        push_area(
            &mut self.plan,
            FenceArea {
                name,
                is_inclusion,
                shape,
            },
        )
    }

    fn origin(&self) -> String {
        format!("{}, line {}", self.feature.part, self.feature.line)
    }

    fn position(&self, vertex: &Vertex) -> Result<Position, ReadError> {
        Position::new(vertex.latitude_deg, vertex.longitude_deg)
            .map_err(|reason| self.wrong(reason))
    }

    pub fn wrong(&self, reason: impl std::fmt::Display) -> ReadError {
        ReadError::part(self.origin(), reason)
    }
}
