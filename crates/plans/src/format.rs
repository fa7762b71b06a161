//! Which format a file has: first by its content, then by its extension.

use std::fmt;
use std::path::Path;

/// A format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanFormat {
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

impl PlanFormat {
    /// The format's name for people.
    pub fn name(self) -> &'static str {
        match self {
            PlanFormat::QgcPlan => "QGroundControl plan",
            PlanFormat::WaypointList => "QGC WPL 110",
            PlanFormat::GeoJson => "GeoJSON",
            PlanFormat::Kml => "KML",
            PlanFormat::Gpx => "GPX",
        }
    }

    /// The format of `text`, or else that of the extension of `name`.
    pub fn of(text: &str, name: &Path) -> Option<PlanFormat> {
        PlanFormat::of_content(text).or_else(|| PlanFormat::of_extension(name))
    }

    fn of_content(text: &str) -> Option<PlanFormat> {
        let text = text.trim_start_matches('\u{feff}').trim_start();
        if text.starts_with("QGC WPL") {
            return Some(PlanFormat::WaypointList);
        }
        if text.starts_with('{') {
            return PlanFormat::of_json(text);
        }
        if text.starts_with('<') {
            return root_element(text);
        }
        None
    }

    /// By the members that each format must have. The text need not be valid JSON: its reader says where it is not.
    fn of_json(text: &str) -> Option<PlanFormat> {
        let has = |name: &str| text.contains(&format!("\"{name}\""));
        if has("FeatureCollection") || has("Feature") {
            Some(PlanFormat::GeoJson)
        } else if has("fileType") || has("plannedHomePosition") || has("MAV_AUTOPILOT") {
            Some(PlanFormat::QgcPlan)
        } else if has("coordinates") {
            Some(PlanFormat::GeoJson)
        } else {
            None
        }
    }

    fn of_extension(name: &Path) -> Option<PlanFormat> {
        let extension = name.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "plan" | "mission" => Some(PlanFormat::QgcPlan),
            "waypoints" | "wpl" | "txt" => Some(PlanFormat::WaypointList),
            "geojson" | "json" => Some(PlanFormat::GeoJson),
            "kml" => Some(PlanFormat::Kml),
            "gpx" => Some(PlanFormat::Gpx),
            _ => None,
        }
    }
}

impl fmt::Display for PlanFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The format of an XML file by its first element, whose name may have a prefix.
fn root_element(text: &str) -> Option<PlanFormat> {
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
        "kml" => Some(PlanFormat::Kml),
        "gpx" => Some(PlanFormat::Gpx),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_content_counts_before_the_extension() {
        #[rustfmt::skip]
        let cases = [
            ("{\"fileType\": \"Plan\"}", "a.geojson", Some(PlanFormat::QgcPlan)),
            ("\u{feff} {\"type\": \"Feature\"}", "a.plan", Some(PlanFormat::GeoJson)),
            ("QGC WPL 110\n", "a", Some(PlanFormat::WaypointList)),
            ("<?xml version='1.0'?>\n<!-- <gpx> -->\n<kml xmlns='x'>", "a.xml", Some(PlanFormat::Kml)),
            ("<gpx:gpx version='1.1'>", "a.kml", Some(PlanFormat::Gpx)),
            ("<html>", "a.kml", Some(PlanFormat::Kml)),
            ("{}", "a.JSON", Some(PlanFormat::GeoJson)),
            ("0\t1\t0\t16", "a.waypoints", Some(PlanFormat::WaypointList)),
            ("hello", "a.md", None),
            ("", "plan", None),
        ];
        for (text, name, expected) in cases {
            assert_eq!(
                PlanFormat::of(text, Path::new(name)),
                expected,
                "{name}: {text}"
            );
        }
    }
}
