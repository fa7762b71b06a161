//! QGroundControl's `.plan`, and its older `.mission`.
//!
//! <https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html> describes the format. Items of
//! older versions have their coordinates apart from the parameters; all three forms are read.

use super::items::{clean, push, push_area, push_mavlink};
use super::json;
use super::tree::{Node, Remarks, Row, Table, Value};
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
        "/fileType /groundStation /MAV_AUTOPILOT /firmwareType /vehicleType /version mission/firmwareType mission/vehicleType mission/version \
          geoFence/version rallyPoints/version TransectStyleComplexItem/version = which program wrote it, in which form",
        "/cruiseSpeed mission/cruiseSpeed mission/hoverSpeed mission/globalPlanAltitudeMode = what QGroundControl gives to new items, and reckons with",
        "items[]/doJumpId Items[]/doJumpId items[]/id Items[]/id items[]/MISSION_ITEM_ID = numbers that only jumps need, which are not flown",
    ],
    whole: &[],
    named: "breachReturn = the return point after a breach of the fence",
    // Members of the file and of the mission that QGroundControl does not write are those of other programs.
    open: "mission",
    flight: "mission items Items params param1 param2 param3 param4 coordinate frame command Altitude AltitudeMode AMSLAltAboveTerrain \
        autoContinue complexItems TransectStyleComplexItem complexItemType geoFence polygons circles circle inclusion center radius \
        plannedHomePosition",
};

/// What members of a survey or corridor mean that are not read.
pub const SURVEY: Row = "version angle polygon polyline entryLocation flyAlternateTransects splitConcavePolygons CorridorWidth CameraCalc \
    CameraShots CameraTriggerInTurnAround FollowTerrain HoverAndCapture Refly90Degrees TurnAroundDistance VisualTransectPoints EntryPoint \
    TerrainFlightSpeed TerrainAdjustMaxClimbRate TerrainAdjustMaxDescentRate TerrainAdjustTolerance camera grid manualGrid \
    fixedValueIsAltitude cameraOrientationLandscape refly90Degrees hoverAndCapture cameraTriggerDistance \
    = of a survey or corridor: what its simple items were made from";

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let root = json::parse(text)?;
    let plan = Plan::empty(PlanFormat::QgcPlan);
    let mut reader = PlanReader {
        plan,
        remarks: Remarks::default(),
    };
    object(&root).map_err(|error| error.about(root.line, "the file"))?;
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
        let read = reader.read_fence(fence);
        read.map_err(|error| error.about(fence.line, "geoFence"))?;
    }
    if let Some(rally) = root.one("rallyPoints") {
        let points = rally.list("points")?;
        points.iter().for_each(Node::skip);
        if !points.is_empty() {
            let text = format!("{} rally points are not used", points.len());
            reader.remarks.add(rally.line, text, false);
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
    let reason = match node.one("version").map(|version| &version.value) {
        Some(Value::Number(version)) => {
            if known.iter().any(|known| f64::from(*known) == *version) {
                return Ok(());
            }
            format!("its version is {version}; read are {known:?}")
        }
        _ => "there is no number `version`".to_owned(),
    };
    Err(ReadError::part(place, reason))
}

struct PlanReader {
    plan: Plan,
    remarks: Remarks,
}

impl PlanReader {
    fn read_mission(&mut self, mission: &Node) -> Result<(), ReadError> {
        if let Some(home) = mission.one("plannedHomePosition") {
            let read = planned_home(home);
            self.plan.planned_home = read.map_err(|error| error.about(home.line, &home.name))?;
        }
        let speed_mps = mission.one("hoverSpeed").map(number_or_null).transpose()?;
        self.plan.planned_speed_mps = speed_mps.filter(|speed_mps| *speed_mps > 0.0);
        for (index, item) in mission.list("items")?.iter().enumerate() {
            let origin = format!("item {}", index + 1);
            let read = self.read_item(item, &origin);
            read.map_err(|error| error.about(item.line, &origin))?;
        }
        // Of version 1. They stand apart from the items.
        for item in optional_list(mission, "complexItems")? {
            item.skip();
            let text =
                "a complex item stands apart from the items: its place among them is not known";
            self.remarks.add(item.line, text, true);
        }
        Ok(())
    }

    fn read_item(&mut self, item: &Node, origin: &str) -> Result<(), ReadError> {
        match object(item)?.one("type").and_then(Node::text) {
            Some("SimpleItem" | "MissionItem" | "missionItem") => self.read_simple(item, origin),
            Some("ComplexItem") => self.read_complex(item, origin),
            Some(other) => self.other(
                item,
                origin,
                format!("an item of the type `{}`", clean(other)),
            ),
            None => Err(ReadError::new("there is no `type`")),
        }
    }

    fn other(&mut self, item: &Node, origin: &str, name: String) -> Result<(), ReadError> {
        item.skip();
        let kind = OtherKind::Flight;
        push(&mut self.plan, origin, "", Action::Other { name, kind })
    }

    /// A survey or a corridor holds the simple items that it stands for.
    fn read_complex(&mut self, item: &Node, origin: &str) -> Result<(), ReadError> {
        let name = item.one("complexItemType").and_then(Node::text).map(clean);
        let name = name.ok_or_else(|| ReadError::new("there is no `complexItemType`"))?;
        let transects = item.one("TransectStyleComplexItem").unwrap_or(item);
        let parts = optional_list(transects, "Items")?;
        item.skip_all(SURVEY, &TABLE);
        transects.skip_all(SURVEY, &TABLE);
        if parts.is_empty() {
            let name = format!("a complex item `{name}` without simple items");
            return self.other(item, origin, name);
        }
        for (index, part) in parts.iter().enumerate() {
            let origin = format!("{origin} ({name}), part {}", index + 1);
            object(part)?.one("type").map(Node::text);
            let read = self.read_simple(part, &origin);
            read.map_err(|error| error.about(part.line, &origin))?;
        }
        Ok(())
    }

    fn read_simple(&mut self, item: &Node, origin: &str) -> Result<(), ReadError> {
        let params = params(item)?;
        let mut mavlink = MissionItem {
            frame: whole(item, "frame")?,
            command: match item.has("command") {
                true => whole(item, "command")?,
                false => whole(item, "id")?,
            },
            params,
            auto_continue: match item.one("autoContinue").map(|value| &value.value) {
                None => true,
                Some(Value::Flag(value)) => *value,
                Some(_) => return Err(ReadError::new("`autoContinue` is not true or false")),
            },
        };
        self.check_altitude(item, origin, &mut mavlink)?;
        push_mavlink(&mut self.plan, origin, mavlink)
    }

    /// An item says its altitude twice, for QGroundControl and for the vehicle: both must mean the same.
    fn check_altitude(
        &mut self,
        item: &Node,
        origin: &str,
        mavlink: &mut MissionItem,
    ) -> Result<(), ReadError> {
        let optional = |name: &str| item.one(name).map(number_or_null).transpose();
        let (altitude, above_sea) = (optional("Altitude")?, optional("AMSLAltAboveTerrain")?);
        let mode = match item.one("AltitudeMode") {
            Some(_) => whole(item, "AltitudeMode")?,
            None => NO_MODE[0],
        };
        let MissionItem {
            frame,
            params: [.., altitude_m],
            ..
        } = mavlink;
        if mode == CALCULATED_ABOVE_TERRAIN && above_sea.is_none() {
            // QGroundControl did not know the terrain, so the altitude is still above it.
            *frame = FRAMES_TERRAIN[0];
            *altitude_m = altitude.unwrap_or(*altitude_m);
            return Ok(());
        }
        let (name, shown_m) = match mode {
            CALCULATED_ABOVE_TERRAIN => ("AMSLAltAboveTerrain", above_sea),
            _ => ("Altitude", altitude),
        };
        let is_same = |shown_m: f64| (shown_m - *altitude_m).abs() <= SAME_ALTITUDE_M;
        if let Some(shown_m) = shown_m.filter(|shown_m| !is_same(*shown_m)) {
            let text =
                format!("`{name}` is {shown_m} m and the altitude in `params` {altitude_m} m");
            self.contradiction(item, origin, &text);
        }
        let frames = match mode {
            RELATIVE => &FRAMES_HOME[..],
            ABSOLUTE | CALCULATED_ABOVE_TERRAIN => &FRAMES_SEA,
            TERRAIN_FRAME => &FRAMES_TERRAIN,
            _ => &[],
        };
        let has_altitude = [FRAMES_HOME, FRAMES_SEA, FRAMES_TERRAIN]
            .concat()
            .contains(frame);
        if has_altitude && !NO_MODE.contains(&mode) && !frames.contains(frame) {
            let text = format!("`AltitudeMode` {mode} and `frame` {frame} say different things");
            self.contradiction(item, origin, &text);
        }
        Ok(())
    }

    fn contradiction(&mut self, item: &Node, origin: &str, text: &str) {
        let text = format!("{origin}: {text}: which is meant?");
        self.remarks.add(item.line, text, true);
    }

    fn read_fence(&mut self, fence: &Node) -> Result<(), ReadError> {
        if object(fence)?.has("version") {
            check_version(fence, "geoFence", &[1, 2])?;
        }
        for (index, item) in optional_list(fence, "polygons")?.iter().enumerate() {
            let read = polygon(item).and_then(|shape| self.area(item, shape));
            read.map_err(|error| error.about(item.line, &format!("fence polygon {}", index + 1)))?;
        }
        for (index, item) in optional_list(fence, "circles")?.iter().enumerate() {
            let read = circle(item).and_then(|shape| self.area(item, shape));
            read.map_err(|error| error.about(item.line, &format!("fence circle {}", index + 1)))?;
        }
        if let Some(point) = fence.one("breachReturn") {
            point.skip();
            let text = "the return point after a breach of the fence is not used";
            self.remarks.add(point.line, text, false);
        }
        // Version 1 had one polygon, and did not say what it is for.
        if !optional_list(fence, "polygon")?.is_empty() {
            fence.nodes.iter().for_each(Node::skip);
            let text = "the fence of version 1 does not say whether it is to be left or entered";
            self.remarks.add(fence.line, text, true);
        }
        Ok(())
    }

    fn area(&mut self, item: &Node, shape: FenceShape) -> Result<(), ReadError> {
        if item.has("version") {
            check_version(item, "the area", &[1])?;
        }
        let inclusion = item.one("inclusion").map(|inclusion| &inclusion.value);
        let Some(Value::Flag(is_inclusion)) = inclusion else {
            return Err(ReadError::new("`inclusion` is not true or false"));
        };
        let (name, is_inclusion) = (String::new(), *is_inclusion);
        push_area(
            &mut self.plan,
            FenceArea {
                name,
                is_inclusion,
                shape,
            },
        )
    }
}

/// The altitude is above sea; a home of 0, 0 was never set. In version 1 it is an item.
fn planned_home(node: &Node) -> Result<Option<PlannedHome>, ReadError> {
    let node = match node.value {
        Value::Object => {
            node.skip();
            node.one("coordinate").unwrap_or(node)
        }
        _ => node,
    };
    let numbers = numbers(node)?;
    let [latitude_deg, longitude_deg, above_sea_m @ ..] = numbers.as_slice() else {
        return Err(ReadError::new("it needs latitude and longitude"));
    };
    if above_sea_m.len() > 1 {
        return Err(ReadError::new(format!(
            "{} numbers; a home has 3",
            numbers.len()
        )));
    }
    if *latitude_deg == 0.0 && *longitude_deg == 0.0 || latitude_deg.is_nan() {
        return Ok(None);
    }
    let position = Position::new(*latitude_deg, *longitude_deg).map_err(ReadError::new)?;
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
fn params(item: &Node) -> Result<[f64; 7], ReadError> {
    let mut all = match item.one("params") {
        Some(params) => numbers(params)?,
        None => {
            let param = |name: &str| {
                let node = item.nodes.iter().find(|node| node.name == name);
                let missing = || ReadError::new(format!("there is no `params` and no `{name}`"));
                number_or_null(node.ok_or_else(missing)?.take())
            };
            let names = ["param1", "param2", "param3", "param4"];
            names.into_iter().map(param).collect::<Result<_, _>>()?
        }
    };
    if all.len() == 4 {
        let missing = || ReadError::new("4 parameters and no `coordinate`");
        all.extend(numbers(item.one("coordinate").ok_or_else(missing)?)?);
    }
    let count = all.len();
    all.try_into()
        .map_err(|_| ReadError::new(format!("{count} parameters; an item has 7")))
}

fn polygon(item: &Node) -> Result<FenceShape, ReadError> {
    let vertices = object(item)?.list("polygon")?.iter().map(position);
    Ok(FenceShape::Polygon(vertices.collect::<Result<_, _>>()?))
}

fn circle(item: &Node) -> Result<FenceShape, ReadError> {
    let missing = |name: &str| ReadError::new(format!("there is no `{name}`"));
    let circle = object(item)?
        .one("circle")
        .ok_or_else(|| missing("circle"))?;
    let centre = position(circle.one("center").ok_or_else(|| missing("center"))?)?;
    let radius_m = number_or_null(circle.one("radius").ok_or_else(|| missing("radius"))?)?;
    Ok(FenceShape::Circle { centre, radius_m })
}

fn position(node: &Node) -> Result<Position, ReadError> {
    match numbers(node)?.as_slice() {
        [latitude_deg, longitude_deg] => {
            Position::new(*latitude_deg, *longitude_deg).map_err(ReadError::new)
        }
        _ => Err(ReadError::new(
            "a point needs latitude and longitude, and nothing else",
        )),
    }
}

/// Takes an object.
fn object(node: &Node) -> Result<&Node, ReadError> {
    match node.take().value {
        Value::Object => Ok(node),
        _ => Err(ReadError::new("it is no JSON object")),
    }
}

/// Nothing in it when there is no such member.
fn optional_list<'a>(node: &'a Node, name: &str) -> Result<&'a [Node], ReadError> {
    match node.one(name) {
        None => Ok(&[]),
        Some(_) => node.list(name),
    }
}

/// A list of numbers, of which `null` is none.
fn numbers(node: &Node) -> Result<Vec<f64>, ReadError> {
    node.skip();
    match node.value {
        Value::List => node.nodes.iter().map(number_or_null).collect(),
        _ => Err(ReadError::new("a list of numbers is expected")),
    }
}

fn number_or_null(node: &Node) -> Result<f64, ReadError> {
    match node.value {
        Value::Null => Ok(f64::NAN),
        Value::Number(number) => Ok(number),
        _ if node.name.ends_with("[]") => Err(ReadError::new("an entry of a list is not a number")),
        _ => Err(ReadError::new(format!(
            "`{}` is not a number",
            clean(&node.name)
        ))),
    }
}

fn whole(item: &Node, name: &str) -> Result<u16, ReadError> {
    match item.one(name).map(|node| &node.value) {
        Some(Value::Number(number))
            if number.fract() == 0.0 && (0.0..=65535.0).contains(number) =>
        {
            Ok(*number as u16)
        }
        _ => Err(ReadError::new(format!(
            "`{name}` is no whole number up to 65535"
        ))),
    }
}
