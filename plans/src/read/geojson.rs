//! GeoJSON, RFC 7946: coordinates are longitude, latitude and perhaps altitude, of WGS 84.
//!
//! The RFC's altitude is above the ellipsoid, which no program keeps to: what it is above must be said, by the property
//! `altitude_reference` or by the operator.

use super::items::clean;
use super::json;
use super::shapes::{Feature, Properties, Shapes, Vertex};
use super::tree::{Node, Table, Value, has_word};
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::{Altitude, OtherKind, Plan};

/// What members of GeoJSON mean that are not read.
pub const TABLE: Table = Table {
    harmless: &[
        ("bbox", "the box round all coordinates"),
        (
            "id title description /name /generator /copyright /timestamp",
            "names and origin",
        ),
    ],
    named: ("", ""),
    open: "geometry",
    flight: "geometry geometries coordinates features properties action hold_s speed_mps altitude_reference kind radius_m crs",
};

/// The names of WGS 84 with longitude first, without altitude, in upper case.
const WGS_84: &str = "URN:OGC:DEF:CRS:OGC:1.3:CRS84 URN:OGC:DEF:CRS:OGC::CRS84 OGC:CRS84 CRS84 EPSG:4326 \
    URN:OGC:DEF:CRS:EPSG::4326 HTTP://WWW.OPENGIS.NET/DEF/CRS/OGC/1.3/CRS84";

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = json::parse(text)?;
    let mut shapes = Shapes::new(Plan::empty(PlanFormat::GeoJson));
    match kind(&root)? {
        "FeatureCollection" => {
            read_crs(&mut shapes, &root);
            let features = list(&root, "features")?;
            for (index, feature) in features.iter().enumerate() {
                read_feature(&mut shapes, feature.take(), index + 1)?;
            }
        }
        "Feature" => read_feature(&mut shapes, &root, 1)?,
        _ => {
            shapes.feature.part = "geometry".to_owned();
            shapes.feature.line = root.line;
            read_geometry(&mut shapes, &root)?;
        }
    }
    let Shapes {
        mut plan,
        mut remarks,
        ..
    } = shapes;
    remarks.add_left(&root, &TABLE);
    remarks.finish(&mut plan);
    Ok(plan)
}

fn kind(node: &Node) -> Result<&str, ReadError> {
    let kind = node.one("type").and_then(Node::text);
    kind.ok_or_else(|| node.wrong("there is no `type` of GeoJSON"))
}

fn list<'a>(node: &'a Node, name: &str) -> Result<&'a [Node], ReadError> {
    match node.one(name) {
        Some(list) if matches!(list.value, Value::List) => Ok(&list.nodes),
        _ => Err(node.wrong(format!("there is no list `{name}`"))),
    }
}

/// Only the older form of the format has one; RFC 7946 is WGS 84.
fn read_crs(shapes: &mut Shapes, node: &Node) {
    for crs in node.all("crs") {
        let name = crs
            .one("properties")
            .and_then(|properties| properties.one("name")?.text());
        crs.take_whole();
        if !name.is_some_and(|name| has_word(WGS_84, &name.to_ascii_uppercase())) {
            let text = format!(
                "the coordinate reference system `{}`; WGS 84 is read",
                clean(name.unwrap_or("unknown"))
            );
            shapes.remarks.add(crs.line, text, OtherKind::Flight);
        }
    }
}

fn read_feature(shapes: &mut Shapes, node: &Node, number: usize) -> Result<(), ReadError> {
    let part = format!("feature {number}");
    shapes.feature = Feature {
        part,
        line: node.line,
        ..Feature::default()
    };
    if kind(node)? != "Feature" {
        return Err(shapes.wrong("its `type` is not `Feature`"));
    }
    read_crs(shapes, node);
    let mut properties = Properties::default();
    if let Some(object) = node.one("properties") {
        for property in &object.nodes {
            properties.take(&property.name, property.take_whole(), &mut shapes.remarks)?;
            if let (Value::Text(name), "name") = (&property.value, &*property.name) {
                shapes.feature.name = name.clone();
            }
        }
    }
    shapes.feature.properties = properties;
    match node.one("geometry") {
        Some(geometry) => read_geometry(shapes, geometry),
        None => shapes.left_out("feature without a geometry"),
    }
}

/// Collections lie in each other at most as deep as the reader of JSON allows, 128.
fn read_geometry(shapes: &mut Shapes, node: &Node) -> Result<(), ReadError> {
    read_crs(shapes, node);
    match kind(node)? {
        "Point" => {
            let coordinates = node
                .one("coordinates")
                .ok_or_else(|| shapes.wrong("there is no list `coordinates`"))?;
            let vertex = vertex(shapes, coordinates)?;
            shapes.point(&vertex)
        }
        "MultiPoint" | "LineString" => {
            let vertices = vertices(shapes, list(node, "coordinates")?)?;
            shapes.line(&vertices)
        }
        "MultiLineString" => list(node, "coordinates")?.iter().try_for_each(|line| {
            let vertices = vertices(shapes, &line.take().nodes)?;
            shapes.line(&vertices)
        }),
        "Polygon" => read_polygon(shapes, list(node, "coordinates")?),
        "MultiPolygon" => {
            let mut polygons = list(node, "coordinates")?.iter();
            polygons.try_for_each(|polygon| read_polygon(shapes, &polygon.take().nodes))
        }
        "GeometryCollection" => {
            let mut geometries = list(node, "geometries")?.iter();
            geometries.try_for_each(|geometry| read_geometry(shapes, geometry.take()))
        }
        kind => Err(node.wrong(format!("`{}` is no geometry of GeoJSON", clean(kind)))),
    }
}

fn read_polygon(shapes: &mut Shapes, rings: &[Node]) -> Result<(), ReadError> {
    let [outline, holes @ ..] = rings else {
        return shapes.left_out("polygon without an outline");
    };
    holes.iter().for_each(Node::skip);
    let outline = vertices(shapes, &outline.take().nodes)?;
    shapes.polygon(&outline, !holes.is_empty())
}

fn vertices(shapes: &Shapes, points: &[Node]) -> Result<Vec<Vertex>, ReadError> {
    points.iter().map(|point| vertex(shapes, point)).collect()
}

fn vertex(shapes: &Shapes, point: &Node) -> Result<Vertex, ReadError> {
    let numbers = point
        .take_whole()
        .nodes
        .iter()
        .map(|number| match number.value {
            Value::Number(number) => Some(number),
            _ => None,
        });
    match numbers.collect::<Option<Vec<f64>>>().as_deref() {
        Some([longitude_deg, latitude_deg, altitude @ ..]) if altitude.len() <= 1 => Ok(Vertex {
            latitude_deg: *latitude_deg,
            longitude_deg: *longitude_deg,
            altitude: Altitude::Unstated(altitude.first().copied()),
        }),
        _ => Err(shapes.wrong(format!(
            "line {}: a point needs longitude and latitude, and at most an altitude",
            point.line
        ))),
    }
}
