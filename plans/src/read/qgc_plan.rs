//! QGroundControl's `.plan`, and its older `.mission`.
//!
//! <https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html> describes the format. Items of older
//! versions have their coordinates apart from the parameters; all three forms are read.

use super::items::{clean, push, push_area, push_mavlink};
use super::json;
use super::tree::{Node, Remarks, Table, Value};
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::mavlink::{FRAMES_HOME, FRAMES_SEA, FRAMES_TERRAIN, MissionItem};
use crate::model::{Action, FenceArea, FenceShape, OtherKind, Plan, PlannedHome, Position};

/// Altitude modes of an item: what its altitude is above, and the frames that say so, too.
const RELATIVE: u16 = 1;
const ABSOLUTE: u16 = 2;
/// QGroundControl computes an altitude above sea from terrain data.
const CALCULATED_ABOVE_TERRAIN: u16 = 3;
const TERRAIN_FRAME: u16 = 4;
/// They say nothing.
const NO_MODE: [u16; 2] = [0, 5];

/// Two statements of an altitude that are closer than this are the same, m.
const SAME_ALTITUDE_M: f64 = 0.01;

/// What members of plans mean that are not read.
pub const TABLE: Table = Table {
    harmless: &[
        (
            "fileType groundStation MAV_AUTOPILOT firmwareType vehicleType version",
            "which program wrote it, in which form",
        ),
        (
            "cruiseSpeed globalPlanAltitudeMode",
            "what QGroundControl gives to new items, and reckons with",
        ),
        (
            "doJumpId id",
            "numbers that only jumps need, which are not flown",
        ),
        (
            "angle polygon polyline entryLocation flyAlternateTransects splitConcavePolygons CorridorWidth CameraCalc CameraShots \
          CameraTriggerInTurnAround FollowTerrain HoverAndCapture Refly90Degrees TurnAroundDistance VisualTransectPoints EntryPoint \
          TerrainFlightSpeed TerrainAdjustMaxClimbRate TerrainAdjustMaxDescentRate TerrainAdjustTolerance camera grid manualGrid \
          fixedValueIsAltitude cameraOrientationLandscape refly90Degrees hoverAndCapture cameraTriggerDistance",
            "what the simple items of a survey or corridor were made from",
        ),
    ],
    named: (
        "breachReturn",
        "the return point after a breach of the fence",
    ),
    // Members of the file and of the mission that QGroundControl does not write are those of other programs.
    open: "mission",
    flight: "mission items Items params param1 param2 param3 param4 coordinate frame command Altitude AltitudeMode AMSLAltAboveTerrain \
        autoContinue complexItems TransectStyleComplexItem complexItemType geoFence polygons circles circle inclusion center radius \
        plannedHomePosition",
};

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = json::parse(text)?;
    let mut reader = PlanReader {
        plan: Plan::empty(PlanFormat::QgcPlan),
        remarks: Remarks::default(),
    };
    if !matches!(root.value, Value::Object) {
        return Err(ReadError::file("it is no JSON object"));
    }
    match root.one("mission") {
        Some(mission) => {
            check_version(&root, "the file", &[1])?;
            check_version(mission, "mission", &[1, 2])?;
            reader.read_mission(mission)?;
        }
        None if root.has("items") => reader.read_mission(&root)?,
        None => return Err(ReadError::file("there is no `mission`")),
    }
    if let Some(fence) = root.one("geoFence") {
        let read = object(fence, "geoFence").and_then(|fence| reader.read_fence(fence));
        read.map_err(|error| error.at(fence.line))?;
    }
    if let Some(rally) = root.one("rallyPoints") {
        let points = list(rally, "points", "rallyPoints")?;
        points.iter().for_each(Node::skip);
        if !points.is_empty() {
            let text = format!("{} rally points are not used", points.len());
            reader.remarks.add(0, text, OtherKind::Payload);
        }
    }
    let PlanReader {
        mut plan,
        mut remarks,
    } = reader;
    remarks.add_left(&root, &TABLE);
    remarks.finish(&mut plan);
    Ok(plan)
}

fn check_version(node: &Node, place: &str, known: &[u8]) -> Result<(), ReadError> {
    match node.one("version").map(|version| &version.value) {
        Some(Value::Number(version)) if known.iter().any(|one| f64::from(*one) == *version) => {
            Ok(())
        }
        Some(Value::Number(version)) => Err(ReadError::part(
            place,
            format!("its version is {version}; read are {known:?}"),
        )),
        _ => Err(ReadError::part(place, "there is no number `version`")),
    }
}

struct PlanReader {
    plan: Plan,
    remarks: Remarks,
}

impl PlanReader {
    fn read_mission(&mut self, mission: &Node) -> Result<(), ReadError> {
        self.plan.planned_home = match mission.one("plannedHomePosition") {
            None => None,
            Some(item) if matches!(item.value, Value::Object) => item
                .take_whole()
                .one("coordinate")
                .map_or(Ok(None), planned_home)?,
            Some(home) => planned_home(home)?,
        };
        let speed = mission
            .one("hoverSpeed")
            .map(|speed| number_or_null(speed, "hoverSpeed", "mission"));
        self.plan.planned_speed_mps = speed.transpose()?.filter(|speed| *speed > 0.0);
        for (index, item) in list(mission, "items", "mission")?.iter().enumerate() {
            let origin = format!("item {}", index + 1);
            let read = object(item, &origin).and_then(|item| self.read_item(item, &origin));
            read.map_err(|error| error.at(item.line))?;
        }
        // Of version 1. They stand apart from the items.
        for item in optional_list(mission, "complexItems", "mission")? {
            item.skip();
            let text = "a complex item stands apart from the items: where it belongs among them is not known";
            self.remarks.add(item.line, text, OtherKind::Flight);
        }
        Ok(())
    }

    fn read_item(&mut self, item: &Node, origin: &str) -> Result<(), ReadError> {
        match item.one("type").and_then(Node::text) {
            Some("SimpleItem" | "MissionItem" | "missionItem") => {
                let mavlink = self.simple(item, origin)?;
                push_mavlink(&mut self.plan, origin, mavlink)
            }
            Some("ComplexItem") => self.read_complex(item, origin),
            Some(other) => {
                item.take_whole();
                self.other(origin, format!("an item of the type `{}`", clean(other)))
            }
            None => Err(ReadError::part(origin, "there is no `type`")),
        }
    }

    fn other(&mut self, origin: &str, name: String) -> Result<(), ReadError> {
        push(
            &mut self.plan,
            origin,
            "",
            Action::Other {
                name,
                kind: OtherKind::Flight,
            },
        )
    }

    /// A survey or a corridor holds the simple items that it stands for.
    fn read_complex(&mut self, item: &Node, origin: &str) -> Result<(), ReadError> {
        let name = item.one("complexItemType").and_then(Node::text).map(clean);
        let name = name.ok_or_else(|| ReadError::part(origin, "there is no `complexItemType`"))?;
        let transects = match item.one("TransectStyleComplexItem") {
            None => item,
            Some(inner) => object(inner, origin)?,
        };
        let parts = optional_list(transects, "Items", origin)?;
        if parts.is_empty() {
            item.take_whole();
            return self.other(
                origin,
                format!("a complex item `{name}` without simple items"),
            );
        }
        for (index, part) in parts.iter().enumerate() {
            let origin = format!("{origin} ({name}), part {}", index + 1);
            object(part, &origin)?.one("type").map(Node::text);
            let mavlink = self.simple(part, &origin)?;
            push_mavlink(&mut self.plan, &origin, mavlink)?;
        }
        Ok(())
    }

    fn simple(&mut self, item: &Node, origin: &str) -> Result<MissionItem, ReadError> {
        let mut params = params(item, origin)?;
        let mut frame = whole(item, "frame", origin)?;
        self.check_altitude(item, origin, &mut frame, &mut params[6])?;
        Ok(MissionItem {
            frame,
            command: match item.has("command") {
                true => whole(item, "command", origin)?,
                false => whole(item, "id", origin)?,
            },
            params,
            auto_continue: match item.one("autoContinue").map(|value| &value.value) {
                None => true,
                Some(Value::Flag(value)) => *value,
                Some(_) => {
                    return Err(ReadError::part(
                        origin,
                        "`autoContinue` is not true or false",
                    ));
                }
            },
        })
    }

    /// An item says its altitude twice, for QGroundControl and for the vehicle: both must mean the same.
    fn check_altitude(
        &mut self,
        item: &Node,
        origin: &str,
        frame: &mut u16,
        altitude_m: &mut f64,
    ) -> Result<(), ReadError> {
        let optional = |name: &str| {
            item.one(name)
                .map(|node| number_or_null(node, name, origin))
                .transpose()
        };
        let (altitude, above_sea) = (optional("Altitude")?, optional("AMSLAltAboveTerrain")?);
        let mode = match item.one("AltitudeMode") {
            Some(_) => {
                Some(whole(item, "AltitudeMode", origin)?).filter(|mode| !NO_MODE.contains(mode))
            }
            None => None,
        };
        let (shown, shown_m) = match (mode, above_sea) {
            (Some(CALCULATED_ABOVE_TERRAIN), None) => {
                // QGroundControl did not know the terrain, so the altitude is still above it.
                *frame = FRAMES_TERRAIN[0];
                *altitude_m = altitude.unwrap_or(*altitude_m);
                return Ok(());
            }
            (Some(CALCULATED_ABOVE_TERRAIN), above_sea) => ("AMSLAltAboveTerrain", above_sea),
            _ => ("Altitude", altitude),
        };
        let mut contradicts = |text: String| self.remarks.add(item.line, text, OtherKind::Flight);
        if let Some(metres) = shown_m
            && !((metres - *altitude_m).abs() <= SAME_ALTITUDE_M)
        {
            contradicts(format!(
                "{origin}: `{shown}` is {metres} m and the altitude in `params` {altitude_m} m: which is meant?"
            ));
        }
        let frames = match mode {
            None => return Ok(()),
            Some(RELATIVE) => FRAMES_HOME,
            Some(ABSOLUTE | CALCULATED_ABOVE_TERRAIN) => FRAMES_SEA,
            Some(TERRAIN_FRAME) => FRAMES_TERRAIN,
            Some(other) => {
                contradicts(format!("{origin}: the `AltitudeMode` {other} is not known"));
                return Ok(());
            }
        };
        let has_altitude = [FRAMES_HOME, FRAMES_SEA, FRAMES_TERRAIN]
            .concat()
            .contains(frame);
        if has_altitude && !frames.contains(frame) {
            let mode = mode.unwrap_or_default();
            contradicts(format!(
                "{origin}: `AltitudeMode` {mode} and `frame` {frame} say different things: which is meant?"
            ));
        }
        Ok(())
    }

    fn read_fence(&mut self, fence: &Node) -> Result<(), ReadError> {
        const PLACE: &str = "geoFence";
        if fence.has("version") {
            check_version(fence, PLACE, &[1, 2])?;
        }
        for (index, polygon) in optional_list(fence, "polygons", PLACE)?.iter().enumerate() {
            let place = format!("fence polygon {}", index + 1);
            let vertices = list(object(polygon, &place)?, "polygon", &place)?;
            let vertices = vertices.iter().map(|vertex| position(vertex, &place));
            let shape = FenceShape::Polygon(vertices.collect::<Result<_, _>>()?);
            self.area(polygon, shape, &place)?;
        }
        for (index, item) in optional_list(fence, "circles", PLACE)?.iter().enumerate() {
            let place = format!("fence circle {}", index + 1);
            let missing = |name: &str| ReadError::part(&place, format!("there is no `{name}`"));
            let circle = object(item, &place)?
                .one("circle")
                .ok_or_else(|| missing("circle"))?;
            let radius = circle
                .one("radius")
                .map(|radius| number_or_null(radius, "radius", &place));
            let shape = FenceShape::Circle {
                centre: position(
                    circle.one("center").ok_or_else(|| missing("center"))?,
                    &place,
                )?,
                radius_m: radius.transpose()?.ok_or_else(|| missing("radius"))?,
            };
            self.area(item, shape, &place)?;
        }
        if fence
            .one("breachReturn")
            .is_some_and(|point| point.take_whole().line > 0)
        {
            let text = "the return point after a breach of the fence is not used";
            self.remarks.add(0, text, OtherKind::Payload);
        }
        // Version 1 had one polygon, and did not say what it is for.
        if !optional_list(fence, "polygon", PLACE)?.is_empty() {
            let text = "the fence of version 1 does not say whether it is to be left or entered";
            fence.nodes.iter().for_each(Node::skip);
            self.remarks.add(0, text, OtherKind::Flight);
        }
        Ok(())
    }

    fn area(&mut self, item: &Node, shape: FenceShape, place: &str) -> Result<(), ReadError> {
        if item.has("version") {
            check_version(item, place, &[1])?;
        }
        let Some(Value::Flag(is_inclusion)) =
            item.one("inclusion").map(|inclusion| &inclusion.value)
        else {
            return Err(ReadError::part(place, "`inclusion` is not true or false"));
        };
        push_area(
            &mut self.plan,
            FenceArea {
                name: String::new(),
                is_inclusion: *is_inclusion,
                shape,
            },
        )
    }
}

/// The altitude is above sea; a home of 0, 0 was never set.
fn planned_home(node: &Node) -> Result<Option<PlannedHome>, ReadError> {
    let place = "plannedHomePosition";
    let numbers = numbers(node, place)?;
    let [latitude_deg, longitude_deg, above_sea_m @ ..] = numbers.as_slice() else {
        return Err(ReadError::part(place, "it needs latitude and longitude"));
    };
    if above_sea_m.len() > 1 {
        return Err(ReadError::part(
            place,
            format!("{} numbers; a home has 3", numbers.len()),
        ));
    }
    if *latitude_deg == 0.0 && *longitude_deg == 0.0 || latitude_deg.is_nan() {
        return Ok(None);
    }
    let position = Position::new(*latitude_deg, *longitude_deg)
        .map_err(|reason| ReadError::part(place, reason))?;
    let above_sea_m = above_sea_m
        .first()
        .copied()
        .filter(|metres| metres.is_finite());
    Ok(Some(PlannedHome {
        position,
        above_sea_m,
    }))
}

/// Seven parameters; or four and a `coordinate`; or `param1` to `param4` and a `coordinate`.
fn params(item: &Node, origin: &str) -> Result<[f64; 7], ReadError> {
    let mut all = match item.one("params") {
        Some(params) => numbers(params, origin)?,
        None => {
            let param = |number: u8| {
                let name = format!("param{number}");
                let node = item.nodes.iter().find(|node| node.name == name);
                let missing =
                    || ReadError::part(origin, format!("there is no `params` and no `{name}`"));
                number_or_null(node.ok_or_else(missing)?.take(), &name, origin)
            };
            (1..=4).map(param).collect::<Result<_, _>>()?
        }
    };
    if all.len() == 4 {
        let coordinate = item.one("coordinate");
        let coordinate = coordinate
            .ok_or_else(|| ReadError::part(origin, "4 parameters and no `coordinate`"))?;
        all.extend(numbers(coordinate, origin)?);
    }
    let count = all.len();
    all.try_into()
        .map_err(|_| ReadError::part(origin, format!("{count} parameters; an item has 7")))
}

fn position(node: &Node, place: &str) -> Result<Position, ReadError> {
    match numbers(node, place)?.as_slice() {
        [latitude_deg, longitude_deg] => Position::new(*latitude_deg, *longitude_deg)
            .map_err(|reason| ReadError::part(place, reason)),
        _ => Err(ReadError::part(
            place,
            "a point needs latitude and longitude, and nothing else",
        )),
    }
}

/// Takes an object.
fn object<'a>(node: &'a Node, place: &str) -> Result<&'a Node, ReadError> {
    match node.take().value {
        Value::Object => Ok(node),
        _ => Err(ReadError::part(place, "it is no JSON object")),
    }
}

fn list<'a>(node: &'a Node, name: &str, place: &str) -> Result<&'a [Node], ReadError> {
    match node.one(name) {
        Some(list) if matches!(list.value, Value::List) => Ok(&list.nodes),
        _ => Err(ReadError::part(place, format!("there is no list `{name}`"))),
    }
}

/// Nothing in it when there is no such member.
fn optional_list<'a>(node: &'a Node, name: &str, place: &str) -> Result<&'a [Node], ReadError> {
    match node.one(name) {
        None => Ok(&[]),
        Some(_) => list(node, name, place),
    }
}

/// A list of numbers, of which `null` is none.
fn numbers(node: &Node, place: &str) -> Result<Vec<f64>, ReadError> {
    let Value::List = node.take_whole().value else {
        return Err(ReadError::part(place, "a list of numbers is expected"));
    };
    let numbers = node.nodes.iter().enumerate();
    numbers
        .map(|(index, value)| number_or_null(value, &format!("number {}", index + 1), place))
        .collect()
}

fn number_or_null(node: &Node, name: &str, place: &str) -> Result<f64, ReadError> {
    match node.value {
        Value::Null => Ok(f64::NAN),
        Value::Number(number) => Ok(number),
        _ => Err(ReadError::part(place, format!("{name} is not a number"))),
    }
}

fn whole(item: &Node, name: &str, place: &str) -> Result<u16, ReadError> {
    match item.one(name).map(|node| &node.value) {
        Some(Value::Number(number))
            if number.fract() == 0.0 && (0.0..=65535.0).contains(number) =>
        {
            Ok(*number as u16)
        }
        _ => Err(ReadError::part(
            place,
            format!("`{name}` is no whole number up to 65535"),
        )),
    }
}
