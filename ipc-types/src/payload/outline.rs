//! [`BridgeOutline`]: pieces of what the bridge holds: the geofence in force and the path under way.
//!
//! [`OutlineReader`](crate::outline::OutlineReader) makes the whole of them.

use super::number::given;
use super::text::{ascii_bytes, ascii_text};
use crate::code::OutlineKind;

/// Points of one piece: most areas and paths have fewer, and a narrow radio carries each piece whole.
pub const OUTLINE_POINTS: usize = 32;

/// Bytes of an area's name. What does not fit, and what is not ASCII, is lost.
pub const OUTLINE_NAME_LEN: usize = 64;

shared_struct! {
    /// A place of an outline.
    pub struct OutlinePoint("hero.OutlinePoint.v1") = 24 {
        /// Latitude, degrees, north positive.
        pub latitude_deg: f64,
        /// Longitude, degrees, east positive.
        pub longitude_deg: f64,
        /// Telemetry altitude of a waypoint, m; 0 for the points of an area.
        pub altitude_m: f64,
    }
}

shared_struct! {
    /// A piece of the geofence in force and of the path that the bridge holds. Topic `bridge/outline`: all pieces at each change,
    /// when a subscriber has come, and now and then.
    ///
    /// The pieces of one `number` together are the outline. `ModuleState` repeats the number of the one that holds.
    pub struct BridgeOutline("hero.BridgeOutline.v1") = 928 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// Which outline: another number with every change of fence or path, also after a restart. To be compared for equality only.
        pub number: u64,
        /// Which piece this is, from 0.
        pub piece: u32,
        /// Pieces of this outline.
        pub pieces: u32,
        /// What it describes, an [`OutlineKind`](crate::code::OutlineKind).
        pub kind: u32 => kind: OutlineKind,
        /// Area: which one of the fence, from 0. Fence: how many areas there are.
        pub area: u32,
        /// Area and path: the first point of this piece among all of the area or path, from 0.
        pub first: u32,
        /// Points in this piece.
        pub count: u32,
        /// Points of the whole area or path. Fence: waypoints of the path, 0 when the bridge holds none.
        pub total: u32,
        /// Area: 1 when the helicopter must stay inside, 0 when it must stay outside.
        pub inclusion: u32,
        /// Fence and area: it begins at this telemetry altitude, m; meaningful when `floor_valid` is 1.
        pub floor_m: f64,
        /// Fence and area: it ends at this telemetry altitude, m; meaningful when `ceiling_valid` is 1.
        pub ceiling_m: f64,
        /// Area: radius of a circle, whose only point is its centre, m; 0 for a polygon.
        pub radius_m: f64,
        /// 1 when there is a floor.
        pub floor_valid: u32,
        /// 1 when there is a ceiling.
        pub ceiling_valid: u32,
        /// Name of the area in ASCII, filled up with zeros; a letter that is not ASCII is `?`.
        pub name: [u8; OUTLINE_NAME_LEN],
        /// The points: corners in order, of which the last is joined with the first; the centre of a circle; or waypoints in order.
        pub points: [OutlinePoint; OUTLINE_POINTS],
    }
}

impl BridgeOutline {
    /// The floor; `None` if there is none.
    pub const fn floor(&self) -> Option<f64> {
        given(self.floor_valid != 0, self.floor_m)
    }

    /// The ceiling; `None` if there is none.
    pub const fn ceiling(&self) -> Option<f64> {
        given(self.ceiling_valid != 0, self.ceiling_m)
    }

    /// Writes floor and ceiling.
    pub fn set_limits(&mut self, floor_m: Option<f64>, ceiling_m: Option<f64>) {
        self.floor_m = floor_m.unwrap_or_default();
        self.floor_valid = u32::from(floor_m.is_some());
        self.ceiling_m = ceiling_m.unwrap_or_default();
        self.ceiling_valid = u32::from(ceiling_m.is_some());
    }

    /// The area's name; `None` if it is not text.
    pub fn name(&self) -> Option<&str> {
        ascii_text(&self.name)
    }

    /// A name as it lies in shared memory, cut to its length.
    pub fn name_bytes(name: &str) -> [u8; OUTLINE_NAME_LEN] {
        ascii_bytes(name)
    }

    /// The points that mean something.
    pub fn points(&self) -> &[OutlinePoint] {
        let count = (self.count as usize).min(OUTLINE_POINTS);
        &self.points[..count]
    }
}
