//! What lies on the map, as GeoJSON: fence, path and home, and the track. Places of GeoJSON are longitude and latitude.

use operator::robot::geo::Place;
use serde_json::{Value, json};

use crate::page;

/// Colours by Okabe and Ito, as in the page.
const INCLUSION: &str = "#009e73";
const EXCLUSION: &str = "#d55e00";
const PATH: &str = "#0072b2";
const TRACK: &str = "#cc79a7";
const HOME: &str = "#000000";

/// The fence in force, the path that is flown, and home.
pub(crate) fn chart(chart: &page::Chart) -> String {
    let mut features: Vec<Value> = chart.fence.iter().map(area).collect();
    let path = chart
        .path
        .iter()
        .map(|[latitude, longitude, altitude]| json!([longitude, latitude, altitude]));
    let path: Vec<Value> = path.collect();
    if path.len() > 1 {
        features.push(feature("path", PATH, "LineString", json!(path)));
    }
    for (number, place) in path.iter().enumerate() {
        features.push(feature(
            &format!("waypoint {}", number + 1),
            PATH,
            "Point",
            place.clone(),
        ));
    }
    if let Some([latitude, longitude, altitude]) = chart.home {
        features.push(feature(
            "home",
            HOME,
            "Point",
            json!([longitude, latitude, altitude]),
        ));
    }
    collection(&features)
}

/// Where the robot was, by pieces: a piece of one place is no line.
pub(crate) fn track(pieces: &[Vec<Place>]) -> String {
    let line = |piece: &Vec<Place>| -> Vec<[f64; 2]> {
        let places = piece.iter();
        places
            .map(|place| [place.longitude_deg, place.latitude_deg])
            .collect()
    };
    let lines = pieces.iter().filter(|piece| piece.len() > 1).map(line);
    let lines: Vec<_> = lines.collect();
    let track =
        (!lines.is_empty()).then(|| feature("track", TRACK, "MultiLineString", json!(lines)));
    collection(track.as_slice())
}

fn area(area: &page::ChartArea) -> Value {
    let colour = match area.inclusion {
        true => INCLUSION,
        false => EXCLUSION,
    };
    // A ring ends where it begins.
    let corners = area.corners.iter().chain(area.corners.first());
    let ring: Vec<[f64; 2]> = corners
        .map(|[latitude, longitude]| [*longitude, *latitude])
        .collect();
    feature(&area.name, colour, "Polygon", json!([ring]))
}

fn feature(name: &str, colour: &str, kind: &str, coordinates: Value) -> Value {
    json!({
        "type": "Feature",
        "properties": {"name": name, "style": {"color": colour, "weight": 3, "fillOpacity": 0.05}},
        "geometry": {"type": kind, "coordinates": coordinates},
    })
}

fn collection(features: &[Value]) -> String {
    json!({"type": "FeatureCollection", "features": features}).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fence_path_and_home_are_features_with_longitude_first() {
        let text = chart(&page::Chart {
            robot: 1,
            source: page::ChartSource::Bridge,
            number: 3,
            fence: vec![page::ChartArea {
                name: "field".to_owned(),
                inclusion: true,
                floor_m: None,
                ceiling_m: None,
                corners: vec![[37.0, -6.0], [37.1, -6.0], [37.1, -6.1]],
            }],
            floor_m: None,
            ceiling_m: None,
            path: vec![[37.0, -6.0, 20.0], [37.05, -6.05, 30.0]],
            home: Some([37.01, -6.01, 5.0]),
        });
        let read: Value = serde_json::from_str(&text).unwrap();
        let names: Vec<_> = read["features"]
            .as_array()
            .unwrap()
            .iter()
            .map(|one| one["properties"]["name"].as_str().unwrap())
            .collect();
        assert_eq!(names, ["field", "path", "waypoint 1", "waypoint 2", "home"]);
        let geometry = |index: usize| &read["features"][index]["geometry"];
        let ring = json!([[[-6.0, 37.0], [-6.0, 37.1], [-6.1, 37.1], [-6.0, 37.0]]]);
        assert_eq!(
            geometry(0),
            &json!({"type": "Polygon", "coordinates": ring})
        );
        assert_eq!(
            geometry(4),
            &json!({"type": "Point", "coordinates": [-6.01, 37.01, 5.0]})
        );
    }

    #[test]
    fn a_piece_of_a_track_is_a_line_once_it_has_two_places() {
        let place = |latitude, longitude| Place::new(latitude, longitude).unwrap();
        assert_eq!(track(&[vec![place(37.0, -6.0)]]), collection(&[]));
        let pieces = [
            vec![place(37.0, -6.0), place(37.1, -6.1)],
            vec![place(38.0, -6.0)],
            vec![place(38.0, -6.0), place(38.1, -6.1)],
        ];
        let read: Value = serde_json::from_str(&track(&pieces)).unwrap();
        assert_eq!(
            read["features"][0]["geometry"]["coordinates"],
            json!([[[-6.0, 37.0], [-6.1, 37.1]], [[-6.0, 38.0], [-6.1, 38.1]]])
        );
    }
}
