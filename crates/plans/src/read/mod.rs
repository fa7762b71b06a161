//! Reading: bytes become a [`Plan`], or a mistake with its place.

mod encoding;
mod geojson;
mod gpx;
mod items;
mod json;
mod kml;
mod qgc_plan;
mod shapes;
mod tree;
mod waypoint_list;
mod xml;

use std::path::Path;

use crate::error::{MAX_FILE_BYTES, ReadError};
use crate::format::PlanFormat;
use crate::model::Plan;

const UNKNOWN_FORMAT: &str = "neither content nor name is that of a plan: QGroundControl .plan, QGC WPL 110, GeoJSON, KML and GPX are read";

/// Reads a plan. Its format is that of its content, or else that of the extension of `name`, which is not opened.
///
/// # Errors
///
/// The first mistake, with item or line; also a file that is too long or has too many items.
pub fn read(name: &Path, bytes: &[u8]) -> Result<Plan, ReadError> {
    if bytes.len() > MAX_FILE_BYTES {
        let length = bytes.len();
        return Err(ReadError::new(format!(
            "{length} bytes; at most {MAX_FILE_BYTES} are read"
        )));
    }
    if bytes.starts_with(b"PK") {
        return Err(ReadError::file(
            "a packed file (kmz or zip); unpack it and read the .kml inside",
        ));
    }
    let text = &encoding::decode(bytes)?;
    match PlanFormat::of(text, name).ok_or_else(|| ReadError::new(UNKNOWN_FORMAT))? {
        PlanFormat::QgcPlan => qgc_plan::read(text),
        PlanFormat::WaypointList => waypoint_list::read(text),
        PlanFormat::GeoJson => geojson::read(text),
        PlanFormat::Kml => kml::read(text),
        PlanFormat::Gpx => gpx::read(text),
    }
}

#[cfg(test)]
mod tests {
    use super::tree::{FLIGHT_WORDS, LONG_FLIGHT_WORDS, Table};
    use super::*;

    const TABLES: [(&str, &Table); 4] = [
        ("QGroundControl `.plan`", &qgc_plan::TABLE),
        ("GeoJSON", &geojson::TABLE),
        ("KML", &kml::TABLE),
        ("GPX", &gpx::TABLE),
    ];

    fn row(format: &str, row: &str) -> String {
        let (names, reason) = row.split_once(" = ").unwrap_or_default();
        let names: Vec<String> = names
            .split_whitespace()
            .map(|name| format!("`{name}`"))
            .collect();
        format!("| {format} | {} | {reason} |", names.join(", "))
    }

    #[test]
    fn what_is_left_out_without_a_word_is_what_the_document_says() {
        let document = include_str!("../../../../docs/plans.md");
        let harmless = TABLES
            .iter()
            .flat_map(|(format, table)| table.harmless.iter().map(move |one| row(format, one)));
        let properties = format!(
            "{} = properties: names, times and styles",
            shapes::HARMLESS_PROPERTIES
        );
        let properties = row("GeoJSON, KML", &properties);
        let survey = row("QGroundControl `.plan`", qgc_plan::SURVEY);
        let named = TABLES
            .iter()
            .map(|(format, table)| row(format, table.named));
        let whole = TABLES
            .iter()
            .flat_map(|(format, table)| table.whole.iter().map(move |one| row(format, one)));
        let harmless: Vec<String> = harmless.chain([properties, survey]).chain(whole).collect();
        let named: Vec<String> = named.filter(|row| !row.contains("|  |")).collect();
        let [words, long] =
            [FLIGHT_WORDS, LONG_FLIGHT_WORDS].map(|words| Vec::from_iter(words.split_whitespace()));
        for expected in [
            harmless.join("\n"),
            named.join("\n"),
            words.join(", "),
            long.join(", "),
        ] {
            assert!(
                document.contains(&expected),
                "docs/plans.md should have:\n{expected}"
            );
        }
    }
}
