//! [`Fence`]: the geofence that the bridge has in force, as stations download it.
//!
//! An area is one item for each corner, or one for a circle. The protocol has no room for an area's name, floor and ceiling.

use std::sync::Arc;

use ipc_types::outline::{Outline, OutlineReader, OutlineShape};
use ipc_types::payload::{BridgeOutline, ModuleState};

use crate::message::MISSION_ITEM_INT;
use crate::number::MISSION_TYPE_FENCE;
use crate::stations::{MAX_STATIONS, Sender};
use crate::wire::Message;

/// MAV_CMD of the items: corners and circles, to stay inside and to stay outside.
const INSIDE_POLYGON: u16 = 5001;
const OUTSIDE_POLYGON: u16 = 5002;
const INSIDE_CIRCLE: u16 = 5003;
const OUTSIDE_CIRCLE: u16 = 5004;

/// An item of a fence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FenceItem {
    pub command: u16,
    /// How many corners the area has, or the radius, m.
    pub param1: f32,
    /// Latitude and longitude, degrees.
    pub place: [f64; 2],
}

impl FenceItem {
    /// The item with this number, for a station.
    pub fn message(&self, sequence: u16, to: Sender) -> Message {
        let [x, y] = self.place.map(|degrees| (degrees * 1e7).round() as i32);
        let message = Message::new(MISSION_ITEM_INT)
            .f32(self.param1)
            .f32s(0.0, 3)
            .i32(x)
            .i32(y)
            .f32(0.0)
            .u16(sequence)
            .u16(self.command);
        let target = message.u8(to.system).u8(to.component);
        target.u8(0).u8(0).u8(1).u8(MISSION_TYPE_FENCE)
    }
}

/// The items of the areas in force.
pub fn items(outline: &Outline) -> Vec<FenceItem> {
    let mut items = Vec::new();
    for area in &outline.areas {
        match &area.shape {
            OutlineShape::Polygon(corners) => {
                let command = match area.is_inclusion {
                    true => INSIDE_POLYGON,
                    false => OUTSIDE_POLYGON,
                };
                let param1 = corners.len() as f32;
                items.extend(corners.iter().map(|place| FenceItem {
                    command,
                    param1,
                    place: *place,
                }));
            }
            OutlineShape::Circle { centre, radius_m } => items.push(FenceItem {
                command: match area.is_inclusion {
                    true => INSIDE_CIRCLE,
                    false => OUTSIDE_CIRCLE,
                },
                param1: *radius_m as f32,
                place: *centre,
            }),
        }
    }
    items
}

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct Fence {
    reader: OutlineReader,
    /// What stations read: each reads the fence that was in force when it began.
    downloads: Vec<(Sender, Arc<Vec<FenceItem>>)>,
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

    /// A station begins to read it; how many items it has, or `None` while it is not known.
    pub fn read_by(&mut self, sender: Sender, state: Option<&ModuleState>) -> Option<u16> {
        let items = items(self.in_force(state)?);
        let count = u16::try_from(items.len()).ok()?;
        self.forget(sender);
        if self.downloads.len() == MAX_STATIONS {
            // Of more the oldest has to begin anew.
            self.downloads.remove(0);
        }
        self.downloads.push((sender, Arc::new(items)));
        Some(count)
    }

    /// An item of what a station reads; `None` if there is none.
    pub fn item(&self, sender: Sender, sequence: u16) -> Option<FenceItem> {
        let mut downloads = self.downloads.iter();
        let (_, items) = downloads.find(|(one, _)| *one == sender)?;
        items.get(usize::from(sequence)).copied()
    }

    /// A station has read it, or is gone.
    pub fn forget(&mut self, sender: Sender) {
        self.downloads.retain(|(one, _)| *one != sender);
    }
}
