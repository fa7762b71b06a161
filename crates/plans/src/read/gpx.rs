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
        (
            "metadata name desc cmt src link url urlname author email keywords",
            "texts for people",
        ),
        (
            "type sym number bounds @creator :schemaLocation",
            "marks of the file itself",
        ),
        (
            "time course magvar geoidheight fix sat hdop vdop pdop ageofdgpsdata dgpsid :hr :cad :atemp :wtemp :depth :power :course :bearing",
            "what was measured there",
        ),
        (
            ":DisplayColor :IsAutoNamed :Subclass :DisplayMode :Categories :color",
            "how it is drawn",
        ),
    ],
    named: ("speed :speed", "how fast somebody moved there"),
    open: "extensions TrackPointExtension RoutePointExtension WaypointExtension RouteExtension TrackExtension",
    flight: "rte rtept trk trkseg trkpt wpt ele rpt @lat @lon",
};

/// A list of points that could be what is meant.
struct Candidate<'a> {
    /// Such as `route`.
    kind: &'static str,
    /// Such as `route 1`.
    name: String,
    line: usize,
    points: Vec<&'a Node>,
}

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = xml::parse(text, "gpx")?;
    let version = root
        .one("@version")
        .and_then(Node::text)
        .unwrap_or_default();
    if !["1.0", "1.1"].contains(&version) {
        return Err(root.wrong(format!(
            "version `{}` of GPX; 1.0 and 1.1 are read",
            clean(version)
        )));
    }
    let mut plan = Plan::empty(PlanFormat::Gpx);
    let mut remarks = Remarks::default();
    let mut candidates = candidates(&root, &mut remarks).into_iter();
    if let Some(path) = candidates.next() {
        for (index, point) in path.points.iter().enumerate() {
            read_point(
                &mut plan,
                &format!("{}, point {}", path.name, index + 1),
                point,
            )?;
        }
        for other in candidates {
            other.points.iter().for_each(|point| point.skip());
            let count = other.points.len();
            let text = format!(
                "{} ({count} points) stands beside {}, which is flown",
                other.name, path.name
            );
            // Two routes, or two tracks: which one is meant is not known.
            remarks.add(other.line, text, other.kind == path.kind);
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
    let mut found = Vec::new();
    for (index, route) in root.all("rte").enumerate() {
        let name = format!("route {}", index + 1);
        found.push(Candidate {
            kind: "route",
            name,
            line: route.line,
            points: route.all("rtept").collect(),
        });
    }
    for (index, track) in root.all("trk").enumerate() {
        let name = format!("track {}", index + 1);
        let segments: Vec<Vec<&Node>> = track
            .all("trkseg")
            .map(|segment| segment.all("trkpt").collect())
            .collect();
        // What lies between two segments was not recorded.
        if found
            .iter()
            .all(|other: &Candidate| other.points.is_empty())
        {
            for gap in segments.iter().filter(|points| !points.is_empty()).skip(1) {
                let text = format!(
                    "{name} has a gap before this point: where it leads there is not known"
                );
                remarks.add(gap[0].line, text, true);
            }
        }
        found.push(Candidate {
            kind: "track",
            name,
            line: track.line,
            points: segments.concat(),
        });
    }
    let points: Vec<&Node> = root.all("wpt").collect();
    let line = points.first().map_or(0, |point| point.line);
    found.push(Candidate {
        kind: "waypoints",
        name: "waypoints".to_owned(),
        line,
        points,
    });
    found.retain(|candidate| !candidate.points.is_empty());
    found
}
