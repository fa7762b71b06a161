//! GeoJSON, RFC 7946: coordinates are longitude, latitude and perhaps altitude, of WGS 84.
//!
//! The RFC's altitude is above the ellipsoid, which no program keeps to: what it is above must be said, by the property
//! `altitude_reference` or by the operator.

use super::items::clean;
use super::json;
use super::shapes::{Above, Shapes, Vertex};
use super::tree::{Node, Table, Value, has_word};
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::Plan;

/// What members of GeoJSON mean that are not read.
pub const TABLE: Table = Table {
    harmless: &[
        "bbox = the box round all coordinates",
        "xy_coordinate_resolution z_coordinate_resolution = how exact the coordinates are",
        "id title description /name /generator /copyright /timestamp = names and origin",
    ],
    whole: &[],
    named: "",
    open: "features[] geometry geometries[]",
    flight: "geometry geometries coordinates features properties action hold_s speed_mps altitude_reference kind radius_m crs",
};

/// The names of WGS 84 with longitude first, without altitude, in upper case.
const WGS_84: &str = "URN:OGC:DEF:CRS:OGC:1.3:CRS84 URN:OGC:DEF:CRS:OGC::CRS84 OGC:CRS84 CRS84 EPSG:4326 \
    URN:OGC:DEF:CRS:EPSG::4326 HTTP://WWW.OPENGIS.NET/DEF/CRS/OGC/1.3/CRS84";

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = json::parse(text)?;
    let mut shapes = Shapes::new(PlanFormat::GeoJson);
    match kind(&root)? {
        "FeatureCollection" => {
            read_crs(&mut shapes, &root);
            for (index, feature) in root.list("features")?.iter().enumerate() {
                read_feature(&mut shapes, feature.take(), index + 1)?;
            }
        }
        "Feature" => read_feature(&mut shapes, &root, 1)?,
        _ => {
            shapes.begin("geometry".to_owned(), &root);
            read_geometry(&mut shapes, &root)?;
        }
    }
    Ok(shapes.finish(&root, &TABLE))
}

fn kind(node: &Node) -> Result<&str, ReadError> {
    let kind = node.one("type").and_then(Node::text);
    kind.ok_or_else(|| node.wrong("there is no `type` of GeoJSON"))
}

/// Only the older form of the format has one; RFC 7946 is WGS 84.
fn read_crs(shapes: &mut Shapes, node: &Node) {
    for crs in node.all("crs") {
        let properties = crs.one("properties");
        let name = properties.and_then(|properties| properties.one("name")?.text());
        let name = name.unwrap_or("unknown");
        // A name and nothing beside it: what else is there could say another one.
        let is_name = crs.one("type").and_then(Node::text) == Some("name");
        let is_alone = properties.is_some_and(|properties| properties.nodes.len() == 1)
            && crs.nodes.len() == 2;
        crs.skip();
        if !is_name || !is_alone || !has_word(WGS_84, &name.to_ascii_uppercase()) {
            let name = clean(name);
            let text = format!("the coordinate reference system `{name}`; WGS 84 is read");
            shapes.remarks.add(crs.line, text, true);
        }
    }
}

fn read_feature(shapes: &mut Shapes, node: &Node, number: usize) -> Result<(), ReadError> {
    shapes.begin(format!("feature {number}"), node);
    if kind(node)? != "Feature" {
        return Err(shapes.wrong("its `type` is not `Feature`"));
    }
    read_crs(shapes, node);
    let properties = node.one("properties");
    if properties.is_some_and(|properties| !matches!(properties.value, Value::Object)) {
        return Err(shapes.wrong("its `properties` are no object"));
    }
    for property in properties.iter().flat_map(|object| &object.nodes) {
        property.skip();
        shapes.property(&property.name, property)?;
        if let (Value::Text(name), "name") = (&property.value, &*property.name) {
            shapes.name.clone_from(name);
        }
    }
    match node.one("geometry") {
        Some(geometry) => read_geometry(shapes, geometry)?,
        None => shapes.left_out("feature without a geometry"),
    }
    Ok(())
}

/// Collections lie in each other at most as deep as the reader of JSON allows, 128.
fn read_geometry(shapes: &mut Shapes, node: &Node) -> Result<(), ReadError> {
    read_crs(shapes, node);
    let kind = kind(node)?;
    let name = match kind {
        "GeometryCollection" => "geometries",
        _ => "coordinates",
    };
    let parts = node.list(name)?;
    if parts.is_empty() {
        shapes.left_out(&format!("`{}` without `{name}`", clean(kind)));
        return Ok(());
    }
    match kind {
        "Point" => {
            let coordinates = node.one(name).unwrap_or(node);
            let vertex = vertex(shapes, coordinates)?;
            shapes.point(&vertex)
        }
        "MultiPoint" => {
            let vertices = vertices(shapes, parts)?;
            shapes.points(&vertices)
        }
        "LineString" => {
            let vertices = vertices(shapes, parts)?;
            shapes.line(&vertices)
        }
        "MultiLineString" => parts.iter().try_for_each(|line| {
            let vertices = vertices(shapes, &line.take().nodes)?;
            shapes.line(&vertices)
        }),
        "Polygon" => read_polygon(shapes, parts),
        "MultiPolygon" => {
            let mut polygons = parts.iter();
            polygons.try_for_each(|polygon| read_polygon(shapes, &polygon.take().nodes))
        }
        "GeometryCollection" => {
            let mut geometries = parts.iter();
            geometries.try_for_each(|geometry| read_geometry(shapes, geometry.take()))
        }
        kind => Err(node.wrong(format!("`{}` is no geometry of GeoJSON", clean(kind)))),
    }
}

fn read_polygon(shapes: &mut Shapes, rings: &[Node]) -> Result<(), ReadError> {
    let [outline, holes @ ..] = rings else {
        shapes.left_out("polygon without an outline");
        return Ok(());
    };
    holes.iter().for_each(Node::skip);
    let outline = vertices(shapes, &outline.take().nodes)?;
    shapes.polygon(&outline, !holes.is_empty())
}

fn vertices(shapes: &Shapes, points: &[Node]) -> Result<Vec<Vertex>, ReadError> {
    points.iter().map(|point| vertex(shapes, point)).collect()
}

fn vertex(shapes: &Shapes, point: &Node) -> Result<Vertex, ReadError> {
    point.skip();
    let numbers = point.nodes.iter().map(|number| match number.value {
        Value::Number(number) => Some(number),
        _ => None,
    });
    match numbers.collect::<Option<Vec<f64>>>().as_deref() {
        Some([longitude_deg, latitude_deg, altitude @ ..]) if altitude.len() <= 1 => {
            let position = shapes.position(*latitude_deg, *longitude_deg)?;
            Ok(Vertex {
                position,
                altitude_m: altitude.first().copied(),
                above: Above::Unsaid,
            })
        }
        _ => {
            let reason = "a point needs longitude and latitude, and at most an altitude";
            Err(point.wrong(format!("{}: {reason}", shapes.part)))
        }
    }
}
