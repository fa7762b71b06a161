//! [`Fence`]: the geofence that the bridge has in force, as stations download it; and the one that a station has sent,
//! on its way there. [`StationFence`]: the items of that one as areas of the bridge.
//!
//! An area is one item for each corner, or one for a circle. The protocol has no room for an area's name, floor and
//! ceiling.

use ipc_types::MonotonicNs;
use ipc_types::outline::{Outline, OutlineReader, OutlineShape};
use ipc_types::payload::{BridgeOutline, ModuleState};
use plans::mavlink::command::{
    FENCE_INSIDE_CIRCLE as INSIDE_CIRCLE, FENCE_INSIDE_POLYGON as INSIDE_POLYGON,
    FENCE_OUTSIDE_CIRCLE as OUTSIDE_CIRCLE, FENCE_OUTSIDE_POLYGON as OUTSIDE_POLYGON,
};
use plans::mavlink::parameters::account;
use plans::mavlink::{FRAMES_HOME, FRAMES_SEA, command_name};
use plans::model::{FenceArea, FenceShape, Position};

use crate::mission::store::Item;
use crate::mission::transfer::Transfer;
use crate::number::{MissionRefusal, MissionResult};
use crate::stations::StationAddress;

/// MAV_CMD of a place to return to when the fence is broken. There is none here: the bridge stops in front of the
/// fence.
pub const RETURN_POINT: u16 = 5000;

/// Most areas: those of the bridge.
pub const MAX_AREAS: usize = 64;

/// Most corners of all areas together, which bounds the memory and the time of a transfer.
pub const MAX_CORNERS: usize = 4096;

/// Most items of a fence: corners, and for each area that has none a circle; and the return point.
pub const MAX_FENCE_ITEMS: usize = MAX_CORNERS + MAX_AREAS + 1;

/// How much of what the items of a fence ask for beside their areas is named in a text.
const MAX_NOT_DONE: usize = 4;

/// How the names of areas begin that came from a station or a plan; no others are ever changed.
const PREFIX: &str = "plan: ";

/// The items of the areas in force.
pub fn items(outline: &Outline) -> Vec<Item> {
    let mut items = Vec::new();
    for area in &outline.areas {
        match &area.shape {
            OutlineShape::Polygon(corners) => {
                let command = match area.is_inclusion {
                    true => INSIDE_POLYGON,
                    false => OUTSIDE_POLYGON,
                };
                let item = |place: &[f64; 2]| Item::of_area(command, corners.len() as f32, *place);
                items.extend(corners.iter().map(item));
            }
            OutlineShape::Circle { centre, radius_m } => {
                let command = match area.is_inclusion {
                    true => INSIDE_CIRCLE,
                    false => OUTSIDE_CIRCLE,
                };
                items.push(Item::of_area(command, *radius_m as f32, *centre));
            }
        }
    }
    items
}

/// The geofence that stations download, and the one that a station has sent, on its way to the bridge.
#[derive(Clone, Debug)]
pub struct Fence {
    reader: OutlineReader,
    pub transfer: Transfer,
    pub upload: Option<Upload>,
    /// Whether the file is being written, also for an upload that was given up meanwhile.
    pub is_writing: bool,
}

impl Default for Fence {
    fn default() -> Fence {
        Fence {
            reader: OutlineReader::default(),
            transfer: Transfer::new(MAX_FENCE_ITEMS),
            upload: None,
            is_writing: false,
        }
    }
}

/// How far a station's fence is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadStep {
    /// It goes into the bridge's configuration file.
    Writing,
    /// The bridge reads that file, by this order.
    Reloading(u64),
    /// The bridge has read it, and says what it has in force.
    Watching,
}

/// A station's fence, from its last item until the bridge has it in force.
#[derive(Clone, Debug)]
pub struct Upload {
    pub from: StationAddress,
    /// Its items, as the bridge is to say them.
    pub items: Vec<Item>,
    /// How many areas it has; and how many the file has with it.
    pub areas: usize,
    pub total: usize,
    pub step: UploadStep,
    pub until: MonotonicNs,
}

impl Upload {
    /// Whether the bridge has exactly this one in force, behind its own areas.
    pub fn is_in(&self, outline: &Outline) -> bool {
        let of_stations = outline
            .areas
            .iter()
            .filter(|area| area.name.starts_with(PREFIX));
        let counts = (of_stations.count(), outline.areas.len());
        counts == (self.areas, self.total) && items(outline).ends_with(&self.items)
    }
}

impl Fence {
    /// A piece of what the bridge holds has come.
    pub fn take(&mut self, piece: &BridgeOutline) {
        self.reader.take(piece);
    }

    /// The fence in force; `None` while the bridge has not said it.
    pub fn in_force(&self, state: Option<&ModuleState>) -> Option<&Outline> {
        let outline = self.reader.outline()?;
        (outline.number == state?.outline).then_some(outline)
    }

    /// When something is due.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let upload = self.upload.as_ref().map(|upload| upload.until);
        upload.into_iter().chain(self.transfer.deadline()).min()
    }
}

/// A station's fence.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StationFence {
    pub areas: Vec<FenceArea>,
    /// The areas as the bridge says them when it has them in force.
    pub items: Vec<Item>,
    pub has_return_point: bool,
    /// What its items ask for beside that, the first of it.
    pub not_done: Vec<String>,
}

impl StationFence {
    /// The fence of these items: the corners of a polygon follow each other, and each says how many there are.
    ///
    /// # Errors
    ///
    /// The first item that is wrong.
    pub fn of(items: &[Item]) -> Result<StationFence, MissionRefusal> {
        let mut fence = StationFence::default();
        let mut corners: Vec<Position> = Vec::new();
        for (number, item) in (1..).zip(items) {
            let refused = |result, why: String| MissionRefusal {
                result,
                text: format!("item {number}: {why}"),
            };
            let command = item.command();
            if command == RETURN_POINT {
                fence.has_return_point = true;
                continue;
            }
            let is_inclusion = matches!(command, INSIDE_POLYGON | INSIDE_CIRCLE);
            let is_polygon = matches!(command, INSIDE_POLYGON | OUTSIDE_POLYGON);
            if !is_inclusion && !matches!(command, OUTSIDE_POLYGON | OUTSIDE_CIRCLE) {
                let why = format!("{} is none of a fence", command_name(command));
                return Err(refused(MissionResult::Unsupported, why));
            }
            let frame = u16::from(item.frame());
            if !FRAMES_SEA.contains(&frame) && !FRAMES_HOME.contains(&frame) {
                let why = format!("frame {frame} has no latitude and longitude");
                return Err(refused(MissionResult::UnsupportedFrame, why));
            }
            let account = account(&item.read());
            if let Some((2, what)) = account.refused {
                let why = format!("it asks for {what}, and an area is one by itself");
                return Err(refused(MissionResult::InvalidParam2, why));
            }
            for (what, _) in account.named {
                match fence.not_done.len() {
                    _ if fence.not_done.contains(&what) => {}
                    0..MAX_NOT_DONE => fence.not_done.push(what),
                    MAX_NOT_DONE => fence.not_done.push("and more".to_owned()),
                    _ => {}
                }
            }
            let [param1, _, _, _, latitude_deg, longitude_deg, _] = item.read().params;
            if !(-90.0..=90.0).contains(&latitude_deg) {
                let why = format!("the latitude {latitude_deg} is none");
                return Err(refused(MissionResult::InvalidParam5, why));
            }
            if !(-180.0..=180.0).contains(&longitude_deg) {
                let why = format!("the longitude {longitude_deg} is none");
                return Err(refused(MissionResult::InvalidParam6, why));
            }
            if let Some(before) = fence.items.last().filter(|_| !corners.is_empty())
                && (before.command(), before.read().params[0]) != (command, param1)
            {
                let why = "the polygon before it is not complete".to_owned();
                return Err(refused(MissionResult::InvalidSequence, why));
            }
            let place = Position {
                latitude_deg,
                longitude_deg,
            };
            let place_deg = [latitude_deg, longitude_deg];
            let item = Item::of_area(command, param1 as f32, place_deg);
            fence.items.push(item);
            let shape = if is_polygon {
                if param1.fract() != 0.0 || !(3.0..=MAX_CORNERS as f64).contains(&param1) {
                    let why = format!("a polygon has at least 3 corners, and not {param1}");
                    return Err(refused(MissionResult::InvalidParam1, why));
                }
                corners.push(place);
                if corners.len() < param1 as usize {
                    continue;
                }
                FenceShape::Polygon(std::mem::take(&mut corners))
            } else {
                if !(param1.is_finite() && param1 > 0.0) {
                    let why = format!("a circle cannot have a radius of {param1} m");
                    return Err(refused(MissionResult::InvalidParam1, why));
                }
                FenceShape::Circle {
                    centre: place,
                    radius_m: param1,
                }
            };
            if fence.areas.len() == MAX_AREAS {
                let why = format!("a fence has at most {MAX_AREAS} areas");
                return Err(refused(MissionResult::NoSpace, why));
            }
            let kind = match is_inclusion {
                true => "inclusion",
                false => "exclusion",
            };
            fence.areas.push(FenceArea {
                name: format!("{kind} {}", fence.areas.len() + 1),
                is_inclusion,
                shape,
            });
        }
        if !corners.is_empty() {
            return Err(MissionRefusal {
                result: MissionResult::InvalidSequence,
                text: "the last polygon is not complete".to_owned(),
            });
        }
        let corners = fence.areas.iter().map(|area| match &area.shape {
            FenceShape::Polygon(corners) => corners.len(),
            FenceShape::Circle { .. } => 0,
        });
        if corners.sum::<usize>() > MAX_CORNERS {
            return Err(MissionRefusal {
                result: MissionResult::NoSpace,
                text: format!("a fence has at most {MAX_CORNERS} corners"),
            });
        }
        Ok(fence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::MISSION_ITEM_INT;
    use crate::wire::MessageWriter;

    fn item(command: u16, frame: u8, param1: f32, (x, y): (i32, i32)) -> Item {
        let message = MessageWriter::new(MISSION_ITEM_INT)
            .f32(param1)
            .f32s(0.0, 3);
        let message = message.i32(x).i32(y).f32(0.0).u16(0).u16(command);
        let message = message.u8(1).u8(1).u8(frame).u8(0).u8(1).u8(1);
        Item::of(message.payload())
    }

    const HERE: (i32, i32) = (374_112_000, -60_010_000);

    fn polygon(command: u16, corners: usize, sent: usize) -> Vec<Item> {
        vec![item(command, 0, corners as f32, HERE); sent]
    }

    #[test]
    fn polygons_and_circles_become_areas_and_the_return_point_is_left_out() {
        let mut items = polygon(5001, 3, 3);
        items.push(item(5000, 3, 0.0, HERE));
        items.extend(polygon(5002, 4, 4));
        items.push(item(5003, 5, 20.5, HERE));
        items.push(item(5004, 6, 5.3, HERE));
        let fence = StationFence::of(&items).unwrap();
        let shown: Vec<(&str, bool)> = fence
            .areas
            .iter()
            .map(|area| (area.name.as_str(), area.is_inclusion))
            .collect();
        assert_eq!(
            shown,
            [
                ("inclusion 1", true),
                ("exclusion 2", false),
                ("inclusion 3", true),
                ("exclusion 4", false)
            ]
        );
        assert!(fence.has_return_point && fence.items.len() == 9);
        let FenceShape::Circle { centre, radius_m } = fence.areas[3].shape else {
            panic!("a circle");
        };
        assert_eq!((centre.latitude_deg, radius_m), (37.4112, 5.3));
        assert_eq!(StationFence::of(&[]), Ok(StationFence::default()));
    }

    #[test]
    fn each_refusal_names_the_item_and_the_parameter() {
        use MissionResult::{
            InvalidParam1, InvalidParam5, InvalidParam6, InvalidSequence, NoSpace, Unsupported,
            UnsupportedFrame,
        };
        let circle = |count| vec![item(5004, 0, 9.0, HERE); count];
        let two = |first: Vec<Item>, second: Vec<Item>| [first, second].concat();
        let table: Vec<(Vec<Item>, MissionResult, &str)> = vec![
            (
                vec![item(16, 0, 0.0, HERE)],
                Unsupported,
                "item 1: NAV_WAYPOINT (16) is none of a fence",
            ),
            (
                vec![item(5001, 2, 3.0, HERE)],
                UnsupportedFrame,
                "item 1: frame 2",
            ),
            (
                two(circle(1), vec![item(5004, 0, 9.0, (999_999_999, 0))]),
                InvalidParam5,
                "item 2: the latitude 99.9999999",
            ),
            (
                vec![item(5004, 0, 9.0, (i32::MAX, 0))],
                InvalidParam5,
                "NaN",
            ),
            (
                vec![item(5004, 0, 9.0, (0, 1_999_999_999))],
                InvalidParam6,
                "the longitude 199.9999999",
            ),
            (polygon(5001, 2, 2), InvalidParam1, "at least 3 corners"),
            (vec![item(5001, 0, 3.5, HERE)], InvalidParam1, "and not 3.5"),
            (
                vec![item(5003, 0, 0.0, HERE)],
                InvalidParam1,
                "a radius of 0 m",
            ),
            (
                vec![item(5003, 0, f32::NAN, HERE)],
                InvalidParam1,
                "a radius of NaN m",
            ),
            (
                two(polygon(5001, 4, 3), circle(1)),
                InvalidSequence,
                "item 4: the polygon before it is not complete",
            ),
            (
                two(polygon(5001, 4, 3), polygon(5002, 4, 4)),
                InvalidSequence,
                "item 4: the polygon before it",
            ),
            (
                two(polygon(5001, 4, 3), polygon(5001, 3, 3)),
                InvalidSequence,
                "item 4: the polygon before it",
            ),
            (polygon(5001, 4, 3), InvalidSequence, "the last polygon"),
            (circle(65), NoSpace, "item 65: a fence has at most 64 areas"),
            (
                two(polygon(5001, 2048, 4096), polygon(5001, 3, 3)),
                NoSpace,
                "at most 4096 corners",
            ),
        ];
        for (items, result, text) in table {
            let refusal = StationFence::of(&items).unwrap_err();
            assert_eq!(refusal.result, result, "{}", refusal.text);
            assert!(refusal.text.contains(text), "{} / {text}", refusal.text);
        }
        assert_eq!(StationFence::of(&circle(64)).unwrap().areas.len(), 64);
        // A group makes of several areas one; a height is named.
        let with = |second: f32, height_m: f32| {
            let message = MessageWriter::new(MISSION_ITEM_INT).f32(9.0).f32(second);
            let message = message.f32s(0.0, 2).i32(HERE.0).i32(HERE.1).f32(height_m);
            let message = message.u16(0).u16(5003).u8(1).u8(1);
            Item::of(message.u8(0).u8(0).u8(1).u8(1).payload())
        };
        let refusal = StationFence::of(&[with(1.0, 0.0)]).unwrap_err();
        assert_eq!(refusal.result, MissionResult::InvalidParam2);
        let fence = StationFence::of(&[with(0.0, 30.0), with(0.0, 30.0)]).unwrap();
        assert_eq!(fence.not_done, ["parameter 7 = 30"]);
        let many: Vec<Item> = (1..9).map(|height_m| with(0.0, height_m as f32)).collect();
        let fence = StationFence::of(&many).unwrap();
        assert_eq!(fence.not_done.len(), MAX_NOT_DONE + 1);
        assert_eq!(fence.not_done.last().unwrap(), "and more");
    }
}
