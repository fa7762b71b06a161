//! QGroundControl's `.plan`, and its older `.mission`.
//!
//! <https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html> describes the format. Items of
//! older versions have their coordinates apart from the parameters; all three forms are read.

use serde_json::{Map, Value};

use super::items::{clean, push, push_area, push_mavlink};
use super::syntax::json;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::mavlink::{FRAMES_TERRAIN, MissionItem};
use crate::model::{
    Action, FenceArea, FenceShape, LeftOut, OtherKind, Plan, PlannedHome, Position,
};

/// Altitude mode of an item whose altitude above sea QGroundControl computes from terrain data.
const CALCULATED_ABOVE_TERRAIN: u64 = 3;

/// Members of the file that are read, or mean nothing for a flight.
const KNOWN: [&str; 6] = [
    "fileType",
    "version",
    "groundStation",
    "mission",
    "geoFence",
    "rallyPoints",
];

type Object = Map<String, Value>;

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let value = json(text)?;
    let file = object(&value, "the file")?;
    let mut plan = Plan::empty(PlanFormat::QgcPlan);
    match file.get("mission") {
        Some(mission) => {
            check_version(file, "the file", &[1])?;
            let mission = object(mission, "mission")?;
            check_version(mission, "mission", &[1, 2])?;
            read_mission(&mut plan, mission)?;
        }
        None if file.contains_key("items") => read_mission(&mut plan, file)?,
        None => return Err(ReadError::file("there is no `mission`")),
    }
    if let Some(fence) = file.get("geoFence") {
        read_fence(&mut plan, object(fence, "geoFence")?)?;
    }
    if let Some(rally) = file.get("rallyPoints") {
        let points = array(object(rally, "rallyPoints")?, "points", "rallyPoints")?;
        if !points.is_empty() {
            plan.left_out.push(LeftOut {
                what: format!("{} rally points are not used", points.len()),
                kind: OtherKind::Payload,
            });
        }
    }
    if file.contains_key("mission") {
        for name in file.keys().filter(|name| !KNOWN.contains(&name.as_str())) {
            plan.left_out.push(LeftOut {
                what: format!("the member `{}` is not known", clean(name)),
                kind: OtherKind::Payload,
            });
        }
    }
    Ok(plan)
}

fn check_version(object: &Object, place: &str, known: &[u64]) -> Result<(), ReadError> {
    match object.get("version").map(Value::as_u64) {
        Some(Some(version)) if known.contains(&version) => Ok(()),
        Some(_) => Err(ReadError::part(
            place,
            format!(
                "its version is {}; read are {known:?}",
                object.get("version").unwrap_or(&Value::Null)
            ),
        )),
        None => Err(ReadError::part(place, "there is no `version`")),
    }
}

fn read_mission(plan: &mut Plan, mission: &Object) -> Result<(), ReadError> {
    plan.planned_home = match mission.get("plannedHomePosition") {
        None | Some(Value::Null) => None,
        Some(Value::Object(item)) => planned_home(item.get("coordinate").unwrap_or(&Value::Null))?,
        Some(home) => planned_home(home)?,
    };
    plan.planned_speed_mps = mission
        .get("hoverSpeed")
        .and_then(Value::as_f64)
        .filter(|speed| *speed > 0.0);
    for (index, item) in array(mission, "items", "mission")?.iter().enumerate() {
        let origin = format!("item {}", index + 1);
        read_item(plan, object(item, &origin)?, &origin)?;
    }
    // Of version 1. They stand apart from the items, so their place among them is not known.
    for (index, item) in optional_array(mission, "complexItems", "mission")?
        .iter()
        .enumerate()
    {
        let origin = format!("complex item {}", index + 1);
        read_complex(plan, object(item, &origin)?, &origin)?;
    }
    Ok(())
}

/// The altitude is above sea; a home of 0, 0 was never set.
fn planned_home(value: &Value) -> Result<Option<PlannedHome>, ReadError> {
    const PLACE: &str = "plannedHomePosition";
    let numbers = numbers(value, PLACE)?;
    let [latitude_deg, longitude_deg, rest @ ..] = numbers.as_slice() else {
        return Err(ReadError::part(PLACE, "it needs latitude and longitude"));
    };
    if *latitude_deg == 0.0 && *longitude_deg == 0.0 || latitude_deg.is_nan() {
        return Ok(None);
    }
    let position = Position::new(*latitude_deg, *longitude_deg)
        .map_err(|reason| ReadError::part(PLACE, reason))?;
    Ok(Some(PlannedHome {
        position,
        above_sea_m: rest.first().copied().filter(|metres| metres.is_finite()),
    }))
}

fn read_item(plan: &mut Plan, item: &Object, origin: &str) -> Result<(), ReadError> {
    match item.get("type").and_then(Value::as_str) {
        Some("SimpleItem" | "MissionItem" | "missionItem") => {
            push_mavlink(plan, origin, simple(item, origin)?)
        }
        Some("ComplexItem") => read_complex(plan, item, origin),
        Some(other) => {
            let name = format!("an item of the type `{}`", clean(other));
            let kind = OtherKind::Flight;
            push(plan, origin, "", Action::Other { name, kind })
        }
        None => Err(ReadError::part(origin, "there is no `type`")),
    }
}

/// A survey or a corridor holds the simple items that it stands for.
fn read_complex(plan: &mut Plan, item: &Object, origin: &str) -> Result<(), ReadError> {
    let name = match item.get("complexItemType").and_then(Value::as_str) {
        Some(name) => clean(name),
        None => return Err(ReadError::part(origin, "there is no `complexItemType`")),
    };
    let transects = match item.get("TransectStyleComplexItem") {
        None => item,
        Some(inner) => object(inner, origin)?,
    };
    let parts = optional_array(transects, "Items", origin)?;
    if parts.is_empty() {
        let name = format!("a complex item `{name}` without simple items");
        let kind = OtherKind::Flight;
        return push(plan, origin, "", Action::Other { name, kind });
    }
    for (index, part) in parts.iter().enumerate() {
        let origin = format!("{origin} ({name}), part {}", index + 1);
        push_mavlink(plan, &origin, simple(object(part, &origin)?, &origin)?)?;
    }
    Ok(())
}

fn simple(item: &Object, origin: &str) -> Result<MissionItem, ReadError> {
    let mut params = params(item, origin)?;
    let mut frame = whole(item, "frame", origin)?;
    let is_calculated =
        item.get("AltitudeMode").and_then(Value::as_u64) == Some(CALCULATED_ABOVE_TERRAIN);
    let has_calculated = item
        .get("AMSLAltAboveTerrain")
        .is_some_and(Value::is_number);
    if is_calculated && !has_calculated {
        // QGroundControl did not know the terrain, so the altitude is still above it.
        frame = FRAMES_TERRAIN[0];
        if let Some(above_terrain_m) = item.get("Altitude").and_then(Value::as_f64) {
            params[6] = above_terrain_m;
        }
    }
    Ok(MissionItem {
        frame,
        command: match item.contains_key("command") {
            true => whole(item, "command", origin)?,
            false => whole(item, "id", origin)?,
        },
        params,
        auto_continue: match item.get("autoContinue") {
            None => true,
            Some(Value::Bool(value)) => *value,
            Some(_) => {
                return Err(ReadError::part(
                    origin,
                    "`autoContinue` is not true or false",
                ));
            }
        },
    })
}

/// Seven parameters; or four and a `coordinate`; or `param1` to `param4` and a `coordinate`.
fn params(item: &Object, origin: &str) -> Result<[f64; 7], ReadError> {
    let mut all = match item.get("params") {
        Some(params) => numbers(params, origin)?,
        None => (1..=4)
            .map(|number| {
                let name = format!("param{number}");
                match item.get(&name) {
                    Some(value) => number_or_null(value, &name, origin),
                    None => Err(ReadError::part(
                        origin,
                        format!("there is no `params` and no `{name}`"),
                    )),
                }
            })
            .collect::<Result<_, _>>()?,
    };
    if all.len() == 4 {
        let coordinate = item
            .get("coordinate")
            .ok_or_else(|| ReadError::part(origin, "4 parameters and no `coordinate`"))?;
        all.extend(numbers(coordinate, origin)?);
    }
    let count = all.len();
    all.try_into()
        .map_err(|_| ReadError::part(origin, format!("{count} parameters; an item has 7")))
}

fn read_fence(plan: &mut Plan, fence: &Object) -> Result<(), ReadError> {
    const PLACE: &str = "geoFence";
    for (index, polygon) in optional_array(fence, "polygons", PLACE)?.iter().enumerate() {
        let place = format!("fence polygon {}", index + 1);
        let polygon = object(polygon, &place)?;
        let vertices = array(polygon, "polygon", &place)?;
        let vertices = vertices.iter().map(|vertex| position(vertex, &place));
        let shape = FenceShape::Polygon(vertices.collect::<Result<_, _>>()?);
        push_area(plan, area(polygon, shape, &place)?)?;
    }
    for (index, circle) in optional_array(fence, "circles", PLACE)?.iter().enumerate() {
        let place = format!("fence circle {}", index + 1);
        let item = object(circle, &place)?;
        let circle = object(item.get("circle").unwrap_or(&Value::Null), &place)?;
        let radius_m = circle.get("radius").and_then(Value::as_f64);
        let shape = FenceShape::Circle {
            centre: position(circle.get("center").unwrap_or(&Value::Null), &place)?,
            radius_m: radius_m.ok_or_else(|| ReadError::part(&place, "there is no `radius`"))?,
        };
        push_area(plan, area(item, shape, &place)?)?;
    }
    // Version 1 had one polygon, and did not say what it is for.
    if !optional_array(fence, "polygon", PLACE)?.is_empty() {
        plan.left_out.push(LeftOut {
            what: "the fence of version 1 does not say whether it is to be left or entered"
                .to_owned(),
            kind: OtherKind::Flight,
        });
    }
    if fence
        .get("breachReturn")
        .is_some_and(|value| !value.is_null())
    {
        plan.left_out.push(LeftOut {
            what: "the return point after a breach of the fence is not used".to_owned(),
            kind: OtherKind::Payload,
        });
    }
    Ok(())
}

fn area(item: &Object, shape: FenceShape, place: &str) -> Result<FenceArea, ReadError> {
    let is_inclusion = item.get("inclusion").and_then(Value::as_bool);
    Ok(FenceArea {
        name: String::new(),
        is_inclusion: is_inclusion
            .ok_or_else(|| ReadError::part(place, "`inclusion` is not true or false"))?,
        shape,
    })
}

fn position(value: &Value, place: &str) -> Result<Position, ReadError> {
    match numbers(value, place)?.as_slice() {
        [latitude_deg, longitude_deg, ..] => Position::new(*latitude_deg, *longitude_deg)
            .map_err(|reason| ReadError::part(place, reason)),
        _ => Err(ReadError::part(
            place,
            "a point needs latitude and longitude",
        )),
    }
}

fn object<'a>(value: &'a Value, place: &str) -> Result<&'a Object, ReadError> {
    value
        .as_object()
        .ok_or_else(|| ReadError::part(place, "it is no JSON object"))
}

fn array<'a>(object: &'a Object, name: &str, place: &str) -> Result<&'a [Value], ReadError> {
    match object.get(name) {
        Some(Value::Array(array)) => Ok(array),
        _ => Err(ReadError::part(place, format!("there is no list `{name}`"))),
    }
}

/// Nothing in it when there is no such member.
fn optional_array<'a>(
    object: &'a Object,
    name: &str,
    place: &str,
) -> Result<&'a [Value], ReadError> {
    match object.get(name) {
        None | Some(Value::Null) => Ok(&[]),
        Some(_) => array(object, name, place),
    }
}

/// A list of numbers, of which `null` is none.
fn numbers(value: &Value, place: &str) -> Result<Vec<f64>, ReadError> {
    let list = value
        .as_array()
        .ok_or_else(|| ReadError::part(place, "a list of numbers is expected"))?;
    list.iter()
        .enumerate()
        .map(|(index, value)| number_or_null(value, &format!("number {}", index + 1), place))
        .collect()
}

fn number_or_null(value: &Value, name: &str, place: &str) -> Result<f64, ReadError> {
    match value {
        Value::Null => Ok(f64::NAN),
        value => value
            .as_f64()
            .ok_or_else(|| ReadError::part(place, format!("{name} is not a number"))),
    }
}

fn whole(item: &Object, name: &str, place: &str) -> Result<u16, ReadError> {
    item.get(name)
        .and_then(Value::as_u64)
        .and_then(|number| u16::try_from(number).ok())
        .ok_or_else(|| ReadError::part(place, format!("`{name}` is no whole number up to 65535")))
}
