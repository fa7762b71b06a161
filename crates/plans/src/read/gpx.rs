//! GPX: the route, or else the track, or else the waypoints. Elevations are above sea.

use ::gpx::{Gpx, Waypoint};

use super::items::{clean_reason, push};
use super::syntax::check_xml;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::model::{Action, Altitude, LeftOut, OtherKind, Plan, Position};

/// A list of points that could be what is meant.
struct Candidate<'a> {
    /// Such as `route`.
    kind: &'static str,
    /// Such as `route 1`.
    name: String,
    points: Vec<&'a Waypoint>,
}

pub fn read(text: &str) -> Result<Plan, ReadError> {
    check_xml(text)?;
    let gpx = ::gpx::read(text.as_bytes())
        .map_err(|error| ReadError::file(clean_reason(&format!("not valid GPX: {error}"))))?;
    let mut candidates = candidates(&gpx).into_iter();
    let mut plan = Plan::empty(PlanFormat::Gpx);
    let Some(path) = candidates.next() else {
        return Ok(plan);
    };
    for (index, point) in path.points.iter().enumerate() {
        let origin = format!("{}, point {}", path.name, index + 1);
        let place = point.point();
        let position = Position::new(place.y(), place.x())
            .map_err(|reason| ReadError::part(&origin, reason))?;
        let elevation = point.elevation.filter(|metres| metres.is_finite());
        let action = Action::Waypoint {
            position,
            altitude: elevation.map_or(Altitude::Unstated(None), Altitude::AboveSea),
            hold_s: 0.0,
        };
        let label = point.name.as_deref().unwrap_or_default();
        push(&mut plan, &origin, label, action)?;
    }
    for other in candidates {
        plan.left_out.push(LeftOut {
            what: format!(
                "{} ({} points) stands beside {}, which is flown",
                other.name,
                other.points.len(),
                path.name
            ),
            // Two routes, or two tracks: which one is meant is not known.
            kind: match other.kind == path.kind {
                true => OtherKind::Flight,
                false => OtherKind::Payload,
            },
        });
    }
    Ok(plan)
}

/// All lists that are not empty, what is most surely meant first.
fn candidates(gpx: &Gpx) -> Vec<Candidate<'_>> {
    let mut found = Vec::new();
    for (index, route) in gpx.routes.iter().enumerate() {
        let name = format!("route {}", index + 1);
        let points = route.points.iter().collect();
        let kind = "route";
        found.push(Candidate { kind, name, points });
    }
    for (index, track) in gpx.tracks.iter().enumerate() {
        let name = format!("track {}", index + 1);
        let points = track
            .segments
            .iter()
            .flat_map(|part| &part.points)
            .collect();
        let kind = "track";
        found.push(Candidate { kind, name, points });
    }
    found.push(Candidate {
        kind: "waypoints",
        name: "waypoints".to_owned(),
        points: gpx.waypoints.iter().collect(),
    });
    found.retain(|candidate| !candidate.points.is_empty());
    found
}
