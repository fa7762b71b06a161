//! Which format a file has: first by its content, then by its extension.

use std::fmt;
use std::path::Path;

/// A format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// QGroundControl's `.plan`, also its older `.mission`.
    QgcPlan,
    /// `QGC WPL 110`, the text file of MAVProxy, Mission Planner and older QGroundControl.
    WaypointList,
    /// GeoJSON, RFC 7946.
    GeoJson,
    /// KML 2.2 and 2.3, not packed.
    Kml,
    /// GPX 1.0 and 1.1.
    Gpx,
}

impl Format {
    /// The format's name for people.
    pub fn name(self) -> &'static str {
        match self {
            Format::QgcPlan => "QGroundControl plan",
            Format::WaypointList => "QGC WPL 110",
            Format::GeoJson => "GeoJSON",
            Format::Kml => "KML",
            Format::Gpx => "GPX",
        }
    }

    /// The format of `text`, or else that of the extension of `name`.
    pub fn of(text: &str, name: &Path) -> Option<Format> {
        Format::of_content(text).or_else(|| Format::of_extension(name))
    }

    fn of_content(text: &str) -> Option<Format> {
        let text = text.trim_start_matches('\u{feff}').trim_start();
        if text.starts_with("QGC WPL") {
            return Some(Format::WaypointList);
        }
        if text.starts_with('{') {
            return Format::of_json(text);
        }
        if text.starts_with('<') {
            return root_element(text);
        }
        None
    }

    /// By the members that each format must have. The text need not be valid JSON: its reader says where it is not.
    fn of_json(text: &str) -> Option<Format> {
        let has = |name: &str| text.contains(&format!("\"{name}\""));
        if has("fileType") || has("plannedHomePosition") || has("MAV_AUTOPILOT") {
            Some(Format::QgcPlan)
        } else if has("coordinates") || has("FeatureCollection") || has("Feature") {
            Some(Format::GeoJson)
        } else {
            None
        }
    }

    fn of_extension(name: &Path) -> Option<Format> {
        let extension = name.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "plan" | "mission" => Some(Format::QgcPlan),
            "waypoints" | "wpl" | "txt" => Some(Format::WaypointList),
            "geojson" | "json" => Some(Format::GeoJson),
            "kml" => Some(Format::Kml),
            "gpx" => Some(Format::Gpx),
            _ => None,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The format of an XML file by its first element, whose name may have a prefix.
fn root_element(text: &str) -> Option<Format> {
    let mut rest = text;
    let name = loop {
        let (_, tag) = rest.split_once('<')?;
        if let Some(comment) = tag.strip_prefix("!--") {
            (_, rest) = comment.split_once("-->")?;
        } else if tag.starts_with(|c: char| c.is_alphabetic()) {
            break tag
                .split(|c: char| c.is_whitespace() || c == '>' || c == '/')
                .next()?;
        } else {
            rest = tag;
        }
    };
    match name.rsplit(':').next()? {
        "kml" => Some(Format::Kml),
        "gpx" => Some(Format::Gpx),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_content_counts_before_the_extension() {
        for (text, name, expected) in [
            (
                "{\"fileType\": \"Plan\"}",
                "a.geojson",
                Some(Format::QgcPlan),
            ),
            (
                "\u{feff} {\"type\": \"Feature\"}",
                "a.plan",
                Some(Format::GeoJson),
            ),
            ("QGC WPL 110\n", "a", Some(Format::WaypointList)),
            (
                "<?xml version='1.0'?>\n<!-- <gpx> -->\n<kml xmlns='x'>",
                "a.xml",
                Some(Format::Kml),
            ),
            ("<gpx:gpx version='1.1'>", "a.kml", Some(Format::Gpx)),
            ("<html>", "a.kml", Some(Format::Kml)),
            ("{}", "a.JSON", Some(Format::GeoJson)),
            ("0\t1\t0\t16", "a.waypoints", Some(Format::WaypointList)),
            ("hello", "a.md", None),
            ("", "plan", None),
        ] {
            assert_eq!(
                Format::of(text, Path::new(name)),
                expected,
                "{name}: {text}"
            );
        }
    }
}
