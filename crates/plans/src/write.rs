//! Writing: a plan as QGroundControl's `.plan`.

use serde_json::{Value, json};

use crate::mavlink::{
    FRAME_MISSION, FRAMES_HOME, FRAMES_SEA, FRAMES_TERRAIN, MissionItem, command,
};
use crate::model::{Action, Altitude, FenceArea, FenceShape, Item, Plan, Position};

/// Why a plan cannot be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("item {number}: {reason}")]
pub struct WriteError {
    /// The item's number.
    pub number: u32,
    /// Why.
    pub reason: String,
}

/// A generic autopilot, and a helicopter: MAV_AUTOPILOT and MAV_TYPE.
const AUTOPILOT: u32 = 0;
const HELICOPTER: u32 = 4;

/// The text of a `.plan` that QGroundControl opens. A survey becomes the simple items that it stands for.
///
/// # Errors
///
/// An item that the format has no word for, or whose altitude is not stated.
pub fn to_qgc_plan(plan: &Plan) -> Result<String, WriteError> {
    let items = plan
        .items
        .iter()
        .map(|item| {
            let mavlink = mavlink_item(item).map_err(|reason| WriteError {
                number: item.number,
                reason,
            })?;
            Ok(simple_item(item.number, &mavlink))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let home = plan.planned_home.map_or(json!([0.0, 0.0, 0.0]), |home| {
        let Position {
            latitude_deg,
            longitude_deg,
        } = home.position;
        json!([latitude_deg, longitude_deg, home.above_sea_m.unwrap_or(0.0)])
    });
    let polygons: Vec<Value> = plan.fence.iter().filter_map(polygon).collect();
    let circles: Vec<Value> = plan.fence.iter().filter_map(circle).collect();
    let speed_mps = plan.planned_speed_mps.unwrap_or(5.0);
    let file = json!({
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": AUTOPILOT,
            "vehicleType": HELICOPTER,
            "cruiseSpeed": speed_mps,
            "hoverSpeed": speed_mps,
            "globalPlanAltitudeMode": 0,
            "plannedHomePosition": home,
            "items": items,
        },
        "geoFence": { "version": 2, "polygons": polygons, "circles": circles },
        "rallyPoints": { "version": 2, "points": [] },
    });
    Ok(format!("{file:#}\n"))
}

/// The item as MAVLink has it.
///
/// # Errors
///
/// Why it cannot be one, as a clause.
fn mavlink_item(item: &Item) -> Result<MissionItem, String> {
    if let Some(mavlink) = item.mavlink {
        return Ok(mavlink);
    }
    const UNUSED: f64 = f64::NAN;
    let build = |command: u16, params: [f64; 4], place: Option<Position>, altitude| {
        let (frame, altitude_m) = match altitude {
            Some(Altitude::AboveTakeOff(metres)) => (FRAMES_HOME[0], metres),
            Some(Altitude::AboveSea(metres)) => (FRAMES_SEA[0], metres),
            Some(Altitude::AboveTerrain(metres)) => (FRAMES_TERRAIN[0], metres),
            Some(Altitude::Unstated(_)) => {
                return Err("its altitude is not stated; say what it is above".to_owned());
            }
            None => (FRAMES_HOME[0], 0.0),
        };
        let [p1, p2, p3, p4] = params;
        let (latitude_deg, longitude_deg) = place.map_or((0.0, 0.0), |place| {
            (place.latitude_deg, place.longitude_deg)
        });
        Ok(MissionItem {
            frame,
            command,
            params: [p1, p2, p3, p4, latitude_deg, longitude_deg, altitude_m],
            auto_continue: true,
        })
    };
    let place = item.action.position();
    let altitude = item.action.altitude();
    match &item.action {
        Action::TakeOff { .. } => {
            build(command::TAKE_OFF, [0.0, 0.0, 0.0, UNUSED], place, altitude)
        }
        Action::Waypoint { hold_s, .. } => build(
            command::WAYPOINT,
            [*hold_s, 0.0, 0.0, UNUSED],
            place,
            altitude,
        ),
        Action::Hold {
            duration_s: Some(seconds),
            ..
        } => build(
            command::LOITER_TIME,
            [*seconds, 0.0, 0.0, UNUSED],
            place,
            altitude,
        ),
        Action::Hold { .. } => build(
            command::LOITER_UNLIMITED,
            [0.0, 0.0, 0.0, UNUSED],
            place,
            altitude,
        ),
        Action::Land { .. } => build(command::LAND, [0.0, 0.0, 0.0, UNUSED], place, None),
        Action::Speed { speed_mps } => Ok(MissionItem {
            frame: FRAME_MISSION,
            command: command::CHANGE_SPEED,
            params: [1.0, *speed_mps, -1.0, 0.0, 0.0, 0.0, 0.0],
            auto_continue: true,
        }),
        Action::ReturnToLaunch => Ok(MissionItem {
            frame: FRAME_MISSION,
            command: command::RETURN_TO_LAUNCH,
            params: [0.0; 7],
            auto_continue: true,
        }),
        Action::Other { name, .. } => Err(format!("a .plan has no simple item for {name}")),
    }
}

/// A number that is none is `null`, which is what QGroundControl writes, too.
fn simple_item(number: u32, item: &MissionItem) -> Value {
    let mode = match item.frame {
        frame if FRAMES_SEA.contains(&frame) => 2,
        frame if FRAMES_TERRAIN.contains(&frame) => 4,
        _ => 1,
    };
    json!({
        "type": "SimpleItem",
        "AMSLAltAboveTerrain": null,
        "Altitude": item.params[6],
        "AltitudeMode": mode,
        "autoContinue": item.auto_continue,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": item.params,
    })
}

fn polygon(area: &FenceArea) -> Option<Value> {
    let FenceShape::Polygon(vertices) = &area.shape else {
        return None;
    };
    let vertices: Vec<[f64; 2]> = vertices
        .iter()
        .map(|vertex| [vertex.latitude_deg, vertex.longitude_deg])
        .collect();
    Some(json!({ "polygon": vertices, "inclusion": area.is_inclusion, "version": 1 }))
}

fn circle(area: &FenceArea) -> Option<Value> {
    let FenceShape::Circle { centre, radius_m } = &area.shape else {
        return None;
    };
    let centre = [centre.latitude_deg, centre.longitude_deg];
    Some(json!({
        "circle": { "center": centre, "radius": radius_m },
        "inclusion": area.is_inclusion,
        "version": 1,
    }))
}
