//! GPX: the route, or else the track, or else the waypoints. Elevations are above sea.

use super::items::{clean, push};
use super::tree::{Node, Remarks, Table};
use super::xml;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::{Action, Altitude, Plan, Position};

/// What elements of GPX mean that are not read.
pub const TABLE: Table = Table {
    harmless: &[
        "name desc cmt src link url urlname author email keywords copyright = texts for people",
        "type sym number bounds @creator :schemaLocation = marks of the file itself",
        "time course magvar geoidheight fix sat hdop vdop pdop ageofdgpsdata dgpsid :hr :cad :atemp :wtemp :depth :power :course :bearing = what was measured there",
        ":DisplayColor :IsAutoNamed :Subclass :DisplayMode :Categories :ElevationMode :color = how it is drawn",
    ],
    whole: &[":TrackStatsExtension = figures of the whole track"],
    named: "speed :speed = how fast somebody moved there",
    open: "extensions TrackPointExtension RoutePointExtension WaypointExtension RouteExtension TrackExtension",
    flight: "rte rtept trk trkseg trkpt wpt ele rpt @lat @lon",
};

/// A list of points that could be what is meant, such as `route 1`.
type Candidate<'a> = (String, Vec<&'a Node>);

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = xml::parse(text, "gpx")?;
    let version = root.one("@version").and_then(Node::text);
    if !["1.0", "1.1"].map(Some).contains(&version) {
        let version = clean(version.unwrap_or_default());
        return Err(root.wrong(format!("version `{version}` of GPX; 1.0 and 1.1 are read")));
    }
    root.one("metadata");
    let mut plan = Plan::empty(PlanFormat::Gpx);
    let mut remarks = Remarks::default();
    let mut candidates = candidates(&root, &mut remarks).into_iter();
    if let Some((path, points)) = candidates.next() {
        for (index, point) in points.into_iter().enumerate() {
            read_point(&mut plan, &format!("{path}, point {}", index + 1), point)?;
        }
        for (other, points) in candidates {
            points.iter().for_each(|point| point.skip());
            let count = points.len();
            let text = format!("{other} ({count} points) stands beside {path}, which is flown");
            // Two routes, or two tracks: which one is meant is not known.
            let is_like = other.split(' ').next() == path.split(' ').next();
            remarks.add(points[0].line, text, is_like);
        }
    }
    remarks.add_left(&root, &TABLE);
    remarks.finish(&mut plan);
    Ok(plan)
}

fn read_point(plan: &mut Plan, part: &str, point: &Node) -> Result<(), ReadError> {
    let origin = point.origin(part);
    let number = |node: &Node| {
        let reason = format!("`{}` is no number", node.name.trim_start_matches('@'));
        node.number()
            .ok_or_else(|| ReadError::part(&origin, reason))
    };
    let coordinate = |name: &str| match point.one(name) {
        Some(node) => number(node),
        None => Err(ReadError::part(&origin, "a point needs `lat` and `lon`")),
    };
    let position = Position::new(coordinate("@lat")?, coordinate("@lon")?);
    let action = Action::Waypoint {
        position: position.map_err(|reason| ReadError::part(&origin, reason))?,
        altitude: match point.one("ele") {
            Some(elevation) => Altitude::AboveSea(number(elevation)?),
            None => Altitude::Unstated(None),
        },
        hold_s: 0.0,
    };
    let label = point.one("name").and_then(Node::text).unwrap_or_default();
    push(plan, &origin, label, action)
}

/// All lists that are not empty, what is most surely meant first.
fn candidates<'a>(root: &'a Node, remarks: &mut Remarks) -> Vec<Candidate<'a>> {
    let mut found: Vec<Candidate> = Vec::new();
    for (index, route) in root.all("rte").enumerate() {
        found.push((format!("route {}", index + 1), route.all("rtept").collect()));
    }
    for (index, track) in root.all("trk").enumerate() {
        let name = format!("track {}", index + 1);
        let segments = track
            .all("trkseg")
            .map(|segment| segment.all("trkpt").collect());
        let segments: Vec<Vec<&Node>> = segments.collect();
        // What lies between two segments of a track that is flown was not recorded.
        if found.iter().all(|(_, points)| points.is_empty()) {
            let text =
                format!("{name} has a gap before this point: where it leads there is not known");
            let begins = segments.iter().filter_map(|points| points.first()).skip(1);
            begins.for_each(|begin| remarks.add(begin.line, &text, true));
        }
        found.push((name, segments.concat()));
    }
    found.push(("waypoints".to_owned(), root.all("wpt").collect()));
    if let Some(flown) = found.iter().position(|(_, points)| !points.is_empty()) {
        for (index, (name, points)) in found.iter().enumerate() {
            if points.is_empty() && name != "waypoints" {
                let text = format!("{name} has no points: {} is flown", found[flown].0);
                // What would have been flown rather forbids.
                remarks.add(root.line, text, index < flown);
            }
        }
    }
    found.retain(|(_, points)| !points.is_empty());
    found
}
