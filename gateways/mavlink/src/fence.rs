//! [`Fence`]: the geofence that the bridge has in force, as stations download it; and the one that a station has sent, on its way there.
//!
//! An area is one item for each corner, or one for a circle. The protocol has no room for an area's name, floor and ceiling.

use std::sync::Arc;

use ipc_types::MonotonicNs;
use ipc_types::outline::{Outline, OutlineReader, OutlineShape};
use ipc_types::payload::{BridgeOutline, ModuleState};

use crate::message::MISSION_ITEM_INT;
use crate::mission::transfer::Transfer;
use crate::number::MISSION_TYPE_FENCE;
use crate::stations::{MAX_STATIONS, StationAddress};
use crate::wire::MessageWriter;

/// MAV_CMD of the items: corners and circles, to stay inside and to stay outside.
pub const INSIDE_POLYGON: u16 = 5001;
pub const OUTSIDE_POLYGON: u16 = 5002;
pub const INSIDE_CIRCLE: u16 = 5003;
pub const OUTSIDE_CIRCLE: u16 = 5004;
/// MAV_CMD of a place to return to when the fence is broken. There is none here: the bridge stops in front of the fence.
pub const RETURN_POINT: u16 = 5000;

/// Most areas: those of the bridge.
pub const MAX_AREAS: usize = 64;

/// Most corners of all areas together, which bounds the memory and the time of a transfer.
pub const MAX_CORNERS: usize = 4096;

/// Most items of a fence: corners, and for each area that has none a circle; and the return point.
pub const MAX_FENCE_ITEMS: usize = MAX_CORNERS + MAX_AREAS + 1;

/// How the names of areas begin that came from a station or a plan; no others are ever changed.
const PREFIX: &str = "plan: ";

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
    fn place_e7(&self) -> [i32; 2] {
        self.place.map(|degrees| (degrees * 1e7).round() as i32)
    }

    /// The item with this number, for a station.
    pub fn message(&self, sequence: u16, to: StationAddress) -> MessageWriter {
        let [x, y] = self.place_e7();
        let message = MessageWriter::new(MISSION_ITEM_INT)
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
#[derive(Clone, Debug)]
pub struct Fence {
    reader: OutlineReader,
    /// What stations read: each reads the fence that was in force when it began.
    downloads: Vec<(StationAddress, Arc<Vec<FenceItem>>)>,
    pub transfer: Transfer,
    pub upload: Option<Upload>,
}

impl Default for Fence {
    fn default() -> Fence {
        Fence {
            reader: OutlineReader::default(),
            downloads: Vec::new(),
            transfer: Transfer::new(MAX_FENCE_ITEMS),
            upload: None,
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
    pub items: Vec<FenceItem>,
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
        let in_force = items(outline);
        let same = |(one, other): (&FenceItem, &FenceItem)| {
            (one.command, one.param1, one.place_e7())
                == (other.command, other.param1, other.place_e7())
        };
        let mut pairs = in_force.iter().rev().zip(self.items.iter().rev());
        counts == (self.areas, self.total) && in_force.len() >= self.items.len() && pairs.all(same)
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

    /// A station begins to read it; how many items it has, or `None` while it is not known.
    pub fn read_by(&mut self, sender: StationAddress, state: Option<&ModuleState>) -> Option<u16> {
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
    pub fn item(&self, sender: StationAddress, sequence: u16) -> Option<FenceItem> {
        let mut downloads = self.downloads.iter();
        let (_, items) = downloads.find(|(one, _)| *one == sender)?;
        items.get(usize::from(sequence)).copied()
    }

    /// When something is due.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let upload = self.upload.as_ref().map(|upload| upload.until);
        upload.into_iter().chain(self.transfer.deadline()).min()
    }

    /// A station has read it, or is gone.
    pub fn forget(&mut self, sender: StationAddress) {
        self.downloads.retain(|(one, _)| *one != sender);
    }
}
