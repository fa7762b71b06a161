//! KML 2.2: the placemarks in the order of the file.
//!
//! `absolute` altitudes are above sea, `relativeToGround` ones above terrain. `clampToGround`, which is also what holds
//! when nothing is said, means that the number is not used: the operator must say how high.

use super::items::clean;
use super::shapes::{Above, Shapes, Vertex};
use super::tree::{Node, Table, has_word, whole_number};
use super::xml;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::{Plan, Reference};

/// What elements of KML mean that are not read.
pub const TABLE: Table = Table {
    harmless: &[
        "name description Snippet snippet address phoneNumber :author :link :AddressDetails = texts for people",
        "TimeStamp TimeSpan gx:TimeStamp gx:TimeSpan = when something was there",
        "Data/displayName SimpleField/displayName @schemaUrl @type = how the data is kept and shown",
        "@id @targetId @hint @version :schemaLocation :lang = marks of the file itself",
    ],
    whole: &[
        "Style StyleMap styleUrl ListStyle open tessellate extrude gx:drawOrder gx:balloonVisibility gx:CascadingStyle gx:Carousel LookAt Camera Region \
          LinearRing/altitudeMode = how it is drawn, or looked at",
    ],
    named: "GroundOverlay ScreenOverlay PhotoOverlay Metadata = pictures and data beside the placemarks",
    open: "ExtendedData",
    flight: "Document Folder Placemark Point LineString LinearRing Polygon MultiGeometry outerBoundaryIs innerBoundaryIs coordinates \
        ExtendedData Data SchemaData SimpleData Track MultiTrack Model Tour NetworkLink altitudeOffset @name",
};

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = xml::parse(text, "kml")?;
    let mut shapes = Shapes::new(PlanFormat::Kml);
    read_features(&mut shapes, &root, &mut 0)?;
    Ok(shapes.finish(&root, &TABLE))
}

/// Folders lie in each other at most as deep as the parser allows.
fn read_features(shapes: &mut Shapes, container: &Node, count: &mut u32) -> Result<(), ReadError> {
    read_visibility(shapes, container)?;
    for node in &container.nodes {
        match node.name.as_str() {
            "Document" | "Folder" => read_features(shapes, node.take(), count)?,
            "Placemark" => {
                *count += 1;
                shapes.begin(format!("placemark {count}"), node);
                read_placemark(shapes, node.take())?;
            }
            // The kinds of the data.
            "Schema" => {
                let fields = node.take().all("SimpleField");
                let names = fields.chain([node]).filter_map(|kind| kind.one("@name"));
                names.for_each(Node::skip);
            }
            _ => {}
        }
    }
    Ok(())
}

/// What its author has hidden is not flown, and not left out either.
fn read_visibility(shapes: &mut Shapes, node: &Node) -> Result<(), ReadError> {
    let Some(visibility) = node.one("visibility") else {
        return Ok(());
    };
    match visibility.text() {
        Some("1" | "true" | "") => {}
        Some("0" | "false") => {
            let text = format!(
                "`visibility` of a `{}` is 0: its author has hidden it",
                node.name
            );
            shapes.remarks.add(visibility.line, text, true);
        }
        _ => return Err(visibility.wrong("`visibility` is neither 0 nor 1")),
    }
    Ok(())
}

fn read_placemark(shapes: &mut Shapes, node: &Node) -> Result<(), ReadError> {
    shapes.name = node
        .one("name")
        .and_then(Node::text)
        .unwrap_or_default()
        .to_owned();
    read_visibility(shapes, node)?;
    for data in node.one("ExtendedData").iter().flat_map(|data| &data.nodes) {
        match data.name.as_str() {
            "Data" => {
                let value = data.take().one("value");
                let value = value.ok_or_else(|| data.wrong("a `Data` without a `value`"))?;
                read_property(shapes, data, value)?;
            }
            "SchemaData" => {
                let mut values = data.take().all("SimpleData");
                values.try_for_each(|value| read_property(shapes, value, value))?;
            }
            _ => {}
        }
    }
    match node.nodes.iter().find(|child| is_geometry(child)) {
        Some(geometry) => read_geometry(shapes, geometry.take())?,
        None => shapes.left_out("placemark without a geometry"),
    }
    Ok(())
}

/// The property that the attribute `name` of `node` names.
fn read_property(shapes: &mut Shapes, node: &Node, value: &Node) -> Result<(), ReadError> {
    let name = node.one("@name").and_then(Node::text);
    value.text();
    shapes.property(
        name.ok_or_else(|| node.wrong("a value without a name"))?,
        value,
    )
}

fn is_geometry(node: &Node) -> bool {
    has_word("Point LineString Polygon MultiGeometry", &node.name)
}

fn read_geometry(shapes: &mut Shapes, node: &Node) -> Result<(), ReadError> {
    match node.name.as_str() {
        "Point" => match vertices(shapes, node, node)?.as_slice() {
            [vertex] => shapes.point(vertex),
            points => Err(shapes.wrong(format!("a `Point` with {} points", points.len()))),
        },
        "LineString" => {
            let vertices = vertices(shapes, node, node)?;
            shapes.line(&vertices)
        }
        "Polygon" => {
            let outer = node.one("outerBoundaryIs");
            let ring = outer.and_then(|outer| outer.one("LinearRing"));
            let ring = ring.ok_or_else(|| shapes.wrong("a `Polygon` without an outline"))?;
            let outline = vertices(shapes, node, ring)?;
            let has_holes = node.all("innerBoundaryIs").map(Node::skip).count() > 0;
            shapes.polygon(&outline, has_holes)
        }
        _ => {
            let mut parts = node
                .nodes
                .iter()
                .filter(|child| is_geometry(child))
                .peekable();
            if parts.peek().is_none() {
                shapes.left_out("`MultiGeometry` without a geometry");
            }
            parts.try_for_each(|part| read_geometry(shapes, part.take()))
        }
    }
}

/// The points of `coordinates` in `ring`, with the altitude mode of `node`.
fn vertices(shapes: &Shapes, node: &Node, ring: &Node) -> Result<Vec<Vertex>, ReadError> {
    let mode = node
        .one("altitudeMode")
        .or_else(|| node.one("gx:altitudeMode"));
    let above = match mode.map(|mode| (mode, mode.text().unwrap_or_default())) {
        None | Some((_, "clampToGround")) => Above::Unused,
        Some((_, "absolute")) => Above::Said(Reference::Sea),
        Some((_, "relativeToGround")) => Above::Said(Reference::Terrain),
        Some((mode, other)) => {
            return Err(mode.wrong(format!("the altitude mode `{}` is not known", clean(other))));
        }
    };
    let missing = || ring.wrong(format!("`{}` without `coordinates`", ring.name));
    let coordinates = ring.one("coordinates").ok_or_else(missing)?;
    let tuples = coordinates.text().unwrap_or_default().split_whitespace();
    let vertices = tuples.enumerate().map(|(index, tuple)| {
        let numbers: Option<Vec<f64>> = tuple.split(',').map(whole_number).collect();
        match numbers.as_deref() {
            Some([longitude_deg, latitude_deg, altitude @ ..]) if altitude.len() <= 1 => {
                Ok(Vertex {
                    position: shapes.position(*latitude_deg, *longitude_deg)?,
                    altitude_m: altitude.first().copied(),
                    above,
                })
            }
            _ => {
                let (number, found) = (index + 1, clean(tuple));
                let reason = format!("point {number} is `{found}`, not longitude,latitude or longitude,latitude,altitude");
                Err(coordinates.wrong(format!("{}: {reason}", shapes.part)))
            }
        }
    });
    vertices.collect()
}
