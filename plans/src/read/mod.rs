//! Reading: bytes become a [`Plan`], or a mistake with its place.

mod geojson;
mod gpx;
mod items;
mod json;
mod kml;
mod qgc_plan;
mod shapes;
mod waypoint_list;
mod xml;

use std::path::Path;

use crate::error::ReadError;
use crate::format::Format;
use crate::limits::MAX_FILE_BYTES;
use crate::model::Plan;

/// Reads a plan. Its format is that of its content, or else that of the extension of `name`, which is not opened.
///
/// # Errors
///
/// The first mistake, with item or line; also a file that is too long or has too many items.
pub fn read(name: &Path, bytes: &[u8]) -> Result<Plan, ReadError> {
    if bytes.len() > MAX_FILE_BYTES {
        return Err(ReadError::TooLong(bytes.len()));
    }
    if bytes.starts_with(b"PK") {
        return Err(ReadError::file(
            "a packed file (kmz or zip); unpack it and read the .kml inside",
        ));
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = bytes[..error.valid_up_to()]
            .iter()
            .filter(|byte| **byte == b'\n')
            .count();
        ReadError::NotText(line + 1)
    })?;
    let text = text.trim_start_matches('\u{feff}');
    match Format::of(text, name).ok_or(ReadError::UnknownFormat)? {
        Format::QgcPlan => qgc_plan::read(text),
        Format::WaypointList => waypoint_list::read(text),
        Format::GeoJson => geojson::read(text),
        Format::Kml => kml::read(text),
        Format::Gpx => gpx::read(text),
    }
}
