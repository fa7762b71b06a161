//! GeoJSON, RFC 7946: coordinates are longitude, latitude and perhaps altitude.
//!
//! The RFC's altitude is above the ellipsoid, which no program keeps to: what it is above must be said, by the property
//! `altitude_reference` or by the operator.

use ::geojson::{Feature as Source, GeoJson, Geometry, GeometryValue, Position as Coordinates};
use serde_json::Value;

use super::shapes::{Feature, Properties, Shapes, Vertex};
use super::syntax::json;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::{Altitude, Plan};

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let geojson: GeoJson = json(text)?;
    let mut plan = Plan::empty(PlanFormat::GeoJson);
    match geojson {
        GeoJson::FeatureCollection(collection) => {
            for (index, feature) in collection.features.iter().enumerate() {
                read_feature(&mut plan, feature, index + 1)?;
            }
        }
        GeoJson::Feature(feature) => read_feature(&mut plan, &feature, 1)?,
        GeoJson::Geometry(geometry) => {
            let feature = Feature {
                origin: "geometry".to_owned(),
                name: "",
                properties: Properties::default(),
            };
            let mut shapes = Shapes {
                plan: &mut plan,
                feature,
            };
            read_geometry(&mut shapes, &geometry)?;
        }
    }
    Ok(plan)
}

fn read_feature(plan: &mut Plan, feature: &Source, number: usize) -> Result<(), ReadError> {
    let origin = format!("feature {number}");
    let mut properties = Properties::default();
    let mut name = "";
    for (key, value) in feature.properties.iter().flatten() {
        let text = match value {
            Value::String(text) => text.clone(),
            value => value.to_string(),
        };
        if key == "name" {
            name = value.as_str().unwrap_or_default();
        }
        properties
            .take(key, &text)
            .map_err(|reason| ReadError::part(&origin, reason))?;
    }
    let feature_of_shape = Feature {
        origin,
        name,
        properties,
    };
    let mut shapes = Shapes {
        plan,
        feature: feature_of_shape,
    };
    match &feature.geometry {
        Some(geometry) => read_geometry(&mut shapes, geometry),
        None => shapes.left_out("feature without a geometry"),
    }
}

/// Collections lie in each other at most as deep as the reader of JSON allows, 128.
fn read_geometry(shapes: &mut Shapes<'_>, geometry: &Geometry) -> Result<(), ReadError> {
    match &geometry.value {
        GeometryValue::Point { coordinates } => {
            let vertex = vertex(shapes, coordinates)?;
            shapes.point(&vertex)
        }
        GeometryValue::MultiPoint { coordinates } | GeometryValue::LineString { coordinates } => {
            let vertices = vertices(shapes, coordinates)?;
            shapes.line(&vertices)
        }
        GeometryValue::MultiLineString { coordinates } => coordinates.iter().try_for_each(|line| {
            let vertices = vertices(shapes, line)?;
            shapes.line(&vertices)
        }),
        GeometryValue::Polygon { coordinates } => read_polygon(shapes, coordinates),
        GeometryValue::MultiPolygon { coordinates } => coordinates
            .iter()
            .try_for_each(|polygon| read_polygon(shapes, polygon)),
        GeometryValue::GeometryCollection { geometries } => geometries
            .iter()
            .try_for_each(|geometry| read_geometry(shapes, geometry)),
    }
}

fn read_polygon(shapes: &mut Shapes<'_>, rings: &[Vec<Coordinates>]) -> Result<(), ReadError> {
    match rings {
        [] => shapes.left_out("polygon without an outline"),
        [outline, holes @ ..] => {
            let outline = vertices(shapes, outline)?;
            shapes.polygon(&outline, holes.len())
        }
    }
}

fn vertices(shapes: &Shapes<'_>, line: &[Coordinates]) -> Result<Vec<Vertex>, ReadError> {
    line.iter().map(|point| vertex(shapes, point)).collect()
}

fn vertex(shapes: &Shapes<'_>, coordinates: &Coordinates) -> Result<Vertex, ReadError> {
    match coordinates.as_slice() {
        [longitude_deg, latitude_deg, rest @ ..] => Ok(Vertex {
            latitude_deg: *latitude_deg,
            longitude_deg: *longitude_deg,
            altitude: Altitude::Unstated(rest.first().copied()),
        }),
        _ => Err(ReadError::part(
            &shapes.feature.origin,
            "a point needs longitude and latitude",
        )),
    }
}
