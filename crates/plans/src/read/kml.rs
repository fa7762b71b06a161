//! KML 2.2: the placemarks in the order of the file.
//!
//! `absolute` altitudes are above sea, `relativeToGround` ones above terrain. `clampToGround`, which is also what holds
//! when nothing is said, means that the number is not used: the operator must say how high.

use ::kml::types::{AltitudeMode, Coord, Element, Geometry, LineString, Placemark, Polygon};
use ::kml::{Kml, KmlReader};

use super::items::clean_reason;
use super::shapes::{Feature, Properties, Shapes, Vertex};
use super::syntax::check_xml;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::{Altitude, Plan};

pub fn read(text: &str) -> Result<Plan, ReadError> {
    check_xml(text)?;
    let root: Kml = KmlReader::<_, f64>::from_string(text)
        .read()
        .map_err(|error| ReadError::file(clean_reason(&format!("not valid KML: {error}"))))?;
    let mut reader = Placemarks {
        plan: Plan::empty(PlanFormat::Kml),
        count: 0,
    };
    reader.read(&root)?;
    Ok(reader.plan)
}

struct Placemarks {
    plan: Plan,
    count: usize,
}

impl Placemarks {
    /// Folders lie in each other at most as deep as [`check_xml`] allows.
    fn read(&mut self, element: &Kml) -> Result<(), ReadError> {
        match element {
            Kml::KmlDocument(document) => self.read_all(&document.elements),
            Kml::Document { elements, .. } => self.read_all(elements),
            Kml::Folder(folder) => self.read_all(&folder.elements),
            Kml::Placemark(placemark) => self.placemark(placemark),
            // Geometries without a placemark, styles and the like show nothing on a map.
            _ => Ok(()),
        }
    }

    fn read_all(&mut self, elements: &[Kml]) -> Result<(), ReadError> {
        elements.iter().try_for_each(|element| self.read(element))
    }

    fn placemark(&mut self, placemark: &Placemark) -> Result<(), ReadError> {
        self.count += 1;
        let origin = format!("placemark {}", self.count);
        let mut properties = Properties::default();
        for (name, value) in placemark.children.iter().flat_map(extended_data) {
            properties
                .take(name, value)
                .map_err(|reason| ReadError::part(&origin, reason))?;
        }
        let mut shapes = Shapes {
            plan: &mut self.plan,
            feature: Feature {
                origin,
                name: placemark.name.as_deref().unwrap_or_default(),
                properties,
            },
        };
        match &placemark.geometry {
            Some(geometry) => read_geometry(&mut shapes, geometry),
            None => match placemark.children.iter().find(|child| is_geometry(child)) {
                Some(child) => shapes.left_out(&format!("`{}`, which is not read", child.name)),
                None => shapes.left_out("placemark without a geometry"),
            },
        }
    }
}

/// Extensions such as `gx:Track`.
fn is_geometry(element: &Element) -> bool {
    element.name.starts_with("gx:") || element.name == "Model"
}

/// `<Data name="…"><value>…</value></Data>` of `<ExtendedData>`.
fn extended_data(element: &Element) -> impl Iterator<Item = (&str, &str)> {
    let is_data = element.name == "ExtendedData";
    let data = element.children.iter().filter(move |_| is_data);
    data.filter_map(|data| {
        let name = data.attrs.get("name")?;
        let value = data.children.iter().find(|child| child.name == "value")?;
        Some((name.as_str(), value.content.as_deref().unwrap_or_default()))
    })
}

fn read_geometry(shapes: &mut Shapes<'_>, geometry: &Geometry) -> Result<(), ReadError> {
    match geometry {
        Geometry::Point(point) => shapes.point(&vertex(&point.coord, point.altitude_mode)),
        Geometry::LineString(line) => shapes.line(&vertices(line)),
        Geometry::Polygon(polygon) => read_polygon(shapes, polygon),
        Geometry::MultiGeometry(several) => several
            .geometries
            .iter()
            .try_for_each(|geometry| read_geometry(shapes, geometry)),
        Geometry::LinearRing(_) => shapes.left_out("ring outside of a polygon"),
        _ => shapes.left_out("geometry of another kind"),
    }
}

fn read_polygon(shapes: &mut Shapes<'_>, polygon: &Polygon) -> Result<(), ReadError> {
    let outline: Vec<Vertex> = polygon
        .outer
        .coords
        .iter()
        .map(|coord| vertex(coord, polygon.altitude_mode))
        .collect();
    shapes.polygon(&outline, polygon.inner.len())
}

fn vertices(line: &LineString) -> Vec<Vertex> {
    let vertex = |coord| vertex(coord, line.altitude_mode);
    line.coords.iter().map(vertex).collect()
}

fn vertex(coord: &Coord, mode: AltitudeMode) -> Vertex {
    Vertex {
        latitude_deg: coord.y,
        longitude_deg: coord.x,
        altitude: match (mode, coord.z) {
            (AltitudeMode::Absolute, Some(metres)) => Altitude::AboveSea(metres),
            (AltitudeMode::RelativeToGround, Some(metres)) => Altitude::AboveTerrain(metres),
            (AltitudeMode::ClampToGround, _) | (_, None) => Altitude::Unstated(None),
        },
    }
}
