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
use crate::format::PlanFormat;
use crate::model::{Action, Altitude, FenceArea, FenceShape, Plan, Position, Reference};

const KNOWN: &str = "action hold_s speed_mps altitude_reference kind radius_m";

/// Properties that other programs write, and from which nothing follows for a flight: names, times, and how a shape is
/// drawn.
pub const HARMLESS_PROPERTIES: &str = "name title description desc cmt id fid time timestamp styleUrl stroke stroke-width \
    stroke-opacity fill fill-opacity marker-color marker-size marker-symbol icon";

/// A point of a shape, as the file has it.
pub struct Vertex {
    pub position: Position,
    pub altitude_m: Option<f64>,
    pub above: Above,
}

/// What an altitude is above by the file's own rules, which a property can overrule.
#[derive(Clone, Copy)]
pub enum Above {
    Said(Reference),
    Unsaid,
    /// They leave it unused.
    Unused,
}

/// Where the shapes of a file go, one feature or placemark after the other.
pub struct Shapes {
    pub plan: Plan,
    pub remarks: Remarks,
    /// Which feature, such as `feature 3`, its line, and its name, or nothing.
    pub part: String,
    line: usize,
    pub name: String,
    /// Name, value and line of its properties.
    stated: Vec<(String, String, usize)>,
}

impl Shapes {
    pub fn new(format: PlanFormat) -> Shapes {
        Shapes {
            plan: Plan::empty(format),
            remarks: Remarks::default(),
            part: String::new(),
            line: 0,
            name: String::new(),
            stated: Vec::new(),
        }
    }

    /// Begins with the feature of `node`.
    pub fn begin(&mut self, part: String, node: &Node) {
        (self.part, self.line) = (part, node.line);
        self.name.clear();
        self.stated.clear();
    }

    /// Takes the property `name` with the value of `node`. `null` and an empty text say nothing. What is not known is a
    /// remark.
    pub fn property(&mut self, name: &str, node: &Node) -> Result<(), ReadError> {
        let text = match &node.value {
            Value::Text(text) => text.trim().to_owned(),
            Value::Number(number) => number.to_string(),
            Value::Flag(flag) => flag.to_string(),
            Value::Null => String::new(),
            Value::List | Value::Object => "a list or an object".to_owned(),
        };
        if text.is_empty() {
            return Ok(());
        }
        if has_word(KNOWN, name) {
            if self.stated(name).is_some() {
                return Err(node.wrong(format!("`{name}` is said twice of the same shape")));
            }
            self.stated.push((name.to_owned(), text, node.line));
        } else if name.eq_ignore_ascii_case("visibility") {
            // -1 is what some programs write where nothing was said.
            if !["1", "true", "-1"].contains(&&*text) {
                let text = format!(
                    "`visibility` is `{}`: its author has hidden it",
                    clean(&text)
                );
                self.remarks.add(node.line, text, true);
            }
        } else if node.is_nested() || !has_word(HARMLESS_PROPERTIES, name) {
            // What lies in a harmless property counts, its own name does not.
            let speaks = |inner: &Node| inner.of_flying().is_some();
            let forbids = node.nodes.iter().any(speaks) || speaks_of_flying(name);
            let text = format!("the property `{}` is not read", clean(name));
            self.remarks.add(node.line, text, forbids);
        }
        Ok(())
    }

    fn stated(&self, name: &str) -> Option<(&str, usize)> {
        let mut stated = self.stated.iter().filter(|(stated, ..)| stated == name);
        stated.next().map(|(_, text, line)| (&**text, *line))
    }

    fn number(&self, name: &str) -> Result<Option<f64>, ReadError> {
        let read = |text: &str| whole_number(text).filter(|number| *number >= 0.0);
        self.one_of(name, "a number from 0 up", read)
    }

    fn one_of<T>(
        &self,
        name: &str,
        values: &str,
        read: impl Fn(&str) -> Option<T>,
    ) -> Result<Option<T>, ReadError> {
        let Some((text, line)) = self.stated(name) else {
            return Ok(None);
        };
        let reason = format!("`{name}` is `{}`; it can be {values}", clean(text));
        read(text)
            .map(Some)
            .ok_or_else(|| ReadError::line(line, reason))
    }

    fn is_inclusion(&self) -> Result<Option<bool>, ReadError> {
        self.one_of("kind", "inclusion or exclusion", |kind| match kind {
            "inclusion" => Some(true),
            "exclusion" => Some(false),
            _ => None,
        })
    }

    /// A single point: an item, or the middle of a circle of the fence.
    pub fn point(&mut self, vertex: &Vertex) -> Result<(), ReadError> {
        if let Some(is_inclusion) = self.is_inclusion()? {
            self.only("a circle of the fence", "kind radius_m");
            let radius_m = self.number("radius_m")?;
            let radius_m =
                radius_m.ok_or_else(|| self.wrong("a point with a `kind` needs a `radius_m`"))?;
            let centre = vertex.position;
            return self.area(
                is_inclusion,
                FenceShape::Circle { centre, radius_m },
                std::slice::from_ref(vertex),
            );
        }
        let (position, altitude, hold_s) = (
            vertex.position,
            self.altitude(vertex)?,
            self.number("hold_s")?,
        );
        let place = Some(position);
        let hold = |position, altitude| {
            let duration_s = hold_s;
            Action::Hold {
                position,
                altitude,
                duration_s,
            }
        };
        let names = "waypoint, take-off, hold, land or return";
        let actions = self.one_of("action", names, |action| match action {
            "waypoint" => Some(vec![]),
            "take-off" | "takeoff" => Some(vec![
                Action::TakeOff {
                    position: place,
                    altitude,
                },
                hold(None, None),
            ]),
            "hold" => Some(vec![hold(place, Some(altitude))]),
            "land" => Some(vec![
                hold(place, Some(altitude)),
                Action::Land { position: place },
            ]),
            "return" => Some(vec![Action::ReturnToLaunch]),
            _ => None,
        })?;
        let hold_s = hold_s.unwrap_or(0.0);
        let mut actions = actions.unwrap_or_default();
        if actions.is_empty() {
            actions.push(Action::Waypoint {
                position,
                altitude,
                hold_s,
            });
        }
        // A hover after a climb or before a landing is an item of its own.
        if actions.len() > 1 && hold_s == 0.0 {
            actions.retain(|action| !matches!(action, Action::Hold { .. }));
        }
        let is_return = matches!(actions[..], [Action::ReturnToLaunch]);
        let allowed = match is_return && hold_s > 0.0 {
            true => "action speed_mps altitude_reference",
            false => "action speed_mps altitude_reference hold_s",
        };
        let is_landing = matches!(actions[..], [Action::Land { .. }]);
        if is_return {
            let text =
                "the place of a return is not used: it leads home, as high as the item before";
            self.remarks.add(self.line, text, false);
        } else if is_landing && altitude.metres().is_some_and(|metres| metres != 0.0) {
            let text = "the altitude of a landing is not used: it is as high as the item before";
            self.remarks.add(self.line, text, false);
        }
        self.only("such a point", allowed);
        self.speed()?;
        actions.into_iter().try_for_each(|action| self.item(action))
    }

    /// A line: a waypoint for each of its points.
    pub fn line(&mut self, vertices: &[Vertex]) -> Result<(), ReadError> {
        match vertices.len() {
            0 | 1 => Err(self.wrong(format!("a `LineString` with {} points", vertices.len()))),
            _ => self.points(vertices),
        }
    }

    /// Points that belong together: a waypoint for each.
    pub fn points(&mut self, vertices: &[Vertex]) -> Result<(), ReadError> {
        self.only("a line", "speed_mps altitude_reference");
        self.speed()?;
        for vertex in vertices {
            let (position, altitude, hold_s) = (vertex.position, self.altitude(vertex)?, 0.0);
            self.item(Action::Waypoint {
                position,
                altitude,
                hold_s,
            })?;
        }
        Ok(())
    }

    /// A polygon: an area of the fence, if the file says so.
    pub fn polygon(&mut self, outline: &[Vertex], has_holes: bool) -> Result<(), ReadError> {
        self.only("a polygon", "kind");
        let Some(is_inclusion) = self.is_inclusion()? else {
            self.left_out("polygon without the property `kind`, `inclusion` or `exclusion`");
            return Ok(());
        };
        if has_holes {
            self.left_out("polygon with holes");
            return Ok(());
        }
        let mut vertices: Vec<Position> = outline.iter().map(|vertex| vertex.position).collect();
        // Both formats repeat the first point at the end.
        if vertices.len() > 1 && vertices.first() == vertices.last() {
            vertices.pop();
        }
        self.area(is_inclusion, FenceShape::Polygon(vertices), outline)
    }

    /// A shape that is no item and no area.
    pub fn left_out(&mut self, what: &str) {
        let of = match clean(&self.name) {
            name if name.is_empty() => name,
            name => format!(" `{name}`"),
        };
        let text = format!("{}{of}: {what}", self.part);
        self.remarks.add(self.line, text, true);
    }

    /// Names the properties that a shape cannot have.
    fn only(&mut self, shape: &str, allowed: &str) {
        for (name, _, line) in &self.stated {
            if !has_word(allowed, name) {
                let text = format!("`{name}` cannot belong to {shape}");
                self.remarks.add(*line, text, true);
            }
        }
    }

    /// The property takes precedence over the format.
    fn altitude(&mut self, vertex: &Vertex) -> Result<Altitude, ReadError> {
        let values = "take-off, sea or terrain";
        let reference = self.one_of("altitude_reference", values, Reference::from_name)?;
        let reference = reference.or(match vertex.above {
            Above::Said(reference) => Some(reference),
            Above::Unsaid | Above::Unused => None,
        });
        Ok(match (vertex.altitude_m, reference, vertex.above) {
            (Some(metres), Some(reference), _) => reference.at(metres),
            (None, Some(Reference::Sea | Reference::Terrain), _) => {
                let text = "it says what its altitude is above, and has none";
                self.remarks.add(self.line, text, true);
                Altitude::Unstated(None)
            }
            (Some(metres), None, Above::Unused) => {
                if metres != 0.0 {
                    let text = format!(
                        "the altitude {metres} m is not used: no `altitudeMode` says what it is above"
                    );
                    self.remarks.add(self.line, text, false);
                }
                Altitude::Unstated(None)
            }
            (metres, ..) => Altitude::Unstated(metres),
        })
    }

    fn speed(&mut self) -> Result<(), ReadError> {
        match self.number("speed_mps")? {
            Some(speed_mps) => self.item(Action::Speed { speed_mps }),
            None => Ok(()),
        }
    }

    fn item(&mut self, action: Action) -> Result<(), ReadError> {
        let origin = self.origin();
        push(&mut self.plan, &origin, &self.name, action)
    }

    /// The bridge's areas have no altitudes of vertices: those of an exclusion are not needed, those of an inclusion
    /// could limit it.
    fn area(
        &mut self,
        is_inclusion: bool,
        shape: FenceShape,
        vertices: &[Vertex],
    ) -> Result<(), ReadError> {
        let mut altitudes = vertices.iter().filter_map(|vertex| vertex.altitude_m);
        if altitudes.any(|metres| metres != 0.0) {
            let text = "the altitudes of a fence area are not read: it reaches from below the ground to the sky";
            self.remarks.add(self.line, text, is_inclusion);
        }
        let name = self.name.clone();
        push_area(
            &mut self.plan,
            FenceArea {
                name,
                is_inclusion,
                shape,
            },
        )
    }

    pub fn position(&self, latitude_deg: f64, longitude_deg: f64) -> Result<Position, ReadError> {
        Position::new(latitude_deg, longitude_deg).map_err(|reason| self.wrong(reason))
    }

    fn origin(&self) -> String {
        format!("{}, line {}", self.part, self.line)
    }

    pub fn wrong(&self, reason: impl std::fmt::Display) -> ReadError {
        ReadError::part(self.origin(), reason)
    }

    /// The plan, with a remark about each node of the file that was not taken.
    pub fn finish(mut self, root: &Node, table: &super::tree::Table) -> Plan {
        self.remarks.add_left(root, table);
        self.remarks.finish(&mut self.plan);
        self.plan
    }
}
