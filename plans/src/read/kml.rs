//! KML 2.2: the placemarks in the order of the file.
//!
//! `absolute` altitudes are above sea, `relativeToGround` ones above terrain. `clampToGround`, which is also what holds when
//! nothing is said, means that the number is not used: the operator must say how high.

use super::items::clean;
use super::shapes::{Feature, Properties, Shapes, Vertex};
use super::tree::{Node, Table, whole_number};
use super::xml;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::{Altitude, OtherKind, Plan, Reference};

/// What elements of KML mean that are not read.
pub const TABLE: Table = Table {
    harmless: &[
        (
            "name description Snippet snippet address phoneNumber :author :link :AddressDetails",
            "texts for people",
        ),
        (
            "Style StyleMap styleUrl ListStyle open tessellate extrude gx:drawOrder gx:balloonVisibility LookAt Camera Region \
          LinearRing/altitudeMode",
            "how it is drawn, or looked at",
        ),
        (
            "TimeStamp TimeSpan gx:TimeStamp gx:TimeSpan",
            "when something was there",
        ),
        (
            "Schema Data/displayName @schemaUrl",
            "the kinds of the data",
        ),
        (
            "@id @targetId @hint @version :schemaLocation :lang",
            "marks of the file itself",
        ),
    ],
    named: (
        "GroundOverlay ScreenOverlay PhotoOverlay Metadata",
        "pictures and data beside the placemarks",
    ),
    open: "ExtendedData",
    flight: "Document Folder Placemark Point LineString LinearRing Polygon MultiGeometry outerBoundaryIs innerBoundaryIs coordinates \
        ExtendedData Data SchemaData SimpleData Track MultiTrack Model Tour NetworkLink altitudeOffset",
};

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = xml::parse(text, "kml")?;
    let mut reader = Placemarks {
        shapes: Shapes::new(Plan::empty(PlanFormat::Kml)),
        count: 0,
    };
    reader.read_features(&root)?;
    let Shapes {
        mut plan,
        mut remarks,
        ..
    } = reader.shapes;
    remarks.add_left(&root, &TABLE);
    remarks.finish(&mut plan);
    Ok(plan)
}

struct Placemarks {
    shapes: Shapes,
    count: usize,
}

impl Placemarks {
    /// Folders lie in each other at most as deep as the parser allows.
    fn read_features(&mut self, container: &Node) -> Result<(), ReadError> {
        self.read_visibility(container)?;
        container
            .nodes
            .iter()
            .try_for_each(|node| match node.name.as_str() {
                "Document" | "Folder" => self.read_features(node.take()),
                "Placemark" => self.read_placemark(node.take()),
                _ => Ok(()),
            })
    }

    /// What its author has hidden is not flown, and not left out either.
    fn read_visibility(&mut self, node: &Node) -> Result<(), ReadError> {
        match node
            .one("visibility")
            .map(|visibility| (visibility, visibility.text()))
        {
            None | Some((_, Some("1" | "true"))) => Ok(()),
            Some((visibility, Some("0" | "false"))) => {
                let text = format!(
                    "`visibility` of a `{}` is 0: its author has hidden it",
                    node.name
                );
                self.shapes
                    .remarks
                    .add(visibility.line, text, OtherKind::Flight);
                Ok(())
            }
            Some((visibility, _)) => Err(visibility.wrong("`visibility` is neither 0 nor 1")),
        }
    }

    fn read_placemark(&mut self, node: &Node) -> Result<(), ReadError> {
        self.count += 1;
        let part = format!("placemark {}", self.count);
        let name = node
            .one("name")
            .and_then(Node::text)
            .unwrap_or_default()
            .to_owned();
        self.read_visibility(node)?;
        let mut properties = Properties::default();
        for data in node.one("ExtendedData").iter().flat_map(|data| &data.nodes) {
            match data.name.as_str() {
                "Data" => {
                    let value = data
                        .take()
                        .one("value")
                        .ok_or_else(|| data.wrong("a `Data` without a `value`"))?;
                    read_property(&mut properties, data, value, &mut self.shapes)?;
                }
                "SchemaData" => data.take().all("SimpleData").try_for_each(|value| {
                    read_property(&mut properties, value, value, &mut self.shapes)
                })?,
                _ => {}
            }
        }
        self.shapes.feature = Feature {
            part,
            line: node.line,
            name,
            properties,
        };
        match node.nodes.iter().find(|child| is_geometry(child)) {
            Some(geometry) => self.read_geometry(geometry),
            None => self.shapes.left_out("placemark without a geometry"),
        }
    }

    fn read_geometry(&mut self, node: &Node) -> Result<(), ReadError> {
        node.take();
        let shapes = &mut self.shapes;
        match node.name.as_str() {
            "Point" => match vertices(node, node, shapes)?.as_slice() {
                [vertex] => shapes.point(vertex),
                points => Err(shapes.wrong(format!("a `Point` with {} points", points.len()))),
            },
            "LineString" => match vertices(node, node, shapes)?.as_slice() {
                points @ [_, _, ..] => shapes.line(points),
                points => Err(shapes.wrong(format!("a `LineString` with {} points", points.len()))),
            },
            "Polygon" => {
                let ring = node
                    .one("outerBoundaryIs")
                    .and_then(|outer| outer.one("LinearRing"));
                let ring = ring.ok_or_else(|| shapes.wrong("a `Polygon` without an outline"))?;
                let outline = vertices(node, ring, shapes)?;
                let has_holes = node.all("innerBoundaryIs").map(Node::take_whole).count() > 0;
                shapes.polygon(&outline, has_holes)
            }
            _ => node
                .nodes
                .iter()
                .filter(|child| is_geometry(child))
                .try_for_each(|child| self.read_geometry(child)),
        }
    }
}

fn is_geometry(node: &Node) -> bool {
    ["Point", "LineString", "Polygon", "MultiGeometry"].contains(&node.name.as_str())
}

/// The property that the attribute `name` of `node` names.
fn read_property(
    properties: &mut Properties,
    node: &Node,
    value: &Node,
    shapes: &mut Shapes,
) -> Result<(), ReadError> {
    let name = node
        .one("@name")
        .and_then(Node::text)
        .ok_or_else(|| node.wrong("a value without a name"))?;
    value.text();
    properties.take(name, value, &mut shapes.remarks)
}

/// The points of `coordinates` in `ring`, with the altitude mode of `node`.
fn vertices(node: &Node, ring: &Node, shapes: &mut Shapes) -> Result<Vec<Vertex>, ReadError> {
    let mode = node
        .one("altitudeMode")
        .or_else(|| node.one("gx:altitudeMode"))
        .map(|mode| (mode, mode.text().unwrap_or_default()));
    let reference = match mode {
        None | Some((_, "clampToGround" | "")) => None,
        Some((_, "absolute")) => Some(Reference::Sea),
        Some((_, "relativeToGround")) => Some(Reference::Terrain),
        Some((mode, other)) => {
            return Err(mode.wrong(format!("the altitude mode `{}` is not known", clean(other))));
        }
    };
    let coordinates = ring
        .one("coordinates")
        .ok_or_else(|| ring.wrong(format!("`{}` without `coordinates`", ring.name)))?;
    let tuples = coordinates
        .text()
        .unwrap_or_default()
        .split_whitespace()
        .enumerate();
    let vertices = tuples.map(|(index, tuple)| {
        let numbers: Option<Vec<f64>> = tuple.split(',').map(whole_number).collect();
        match numbers.as_deref() {
            Some([longitude_deg, latitude_deg, altitude @ ..]) if altitude.len() <= 1 => Ok(Vertex {
                latitude_deg: *latitude_deg,
                longitude_deg: *longitude_deg,
                altitude: match (reference, altitude.first()) {
                    (Some(reference), Some(metres)) => reference.at(*metres),
                    _ => Altitude::Unstated(None),
                },
            }),
            _ => Err(coordinates.wrong(format!(
                "point {} of {} is `{}`; it needs longitude,latitude or longitude,latitude,altitude, and a blank behind it",
                index + 1,
                shapes.feature.part,
                clean(tuple)
            ))),
        }
    });
    vertices.collect()
}
