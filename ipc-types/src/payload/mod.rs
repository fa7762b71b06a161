//! The fixed-layout structs that lie in shared memory, and how a module of its own defines more of them.
//!
//! Each is `#[repr(C)]`, has no padding, holds only plain numbers and has a stable type name with a layout version; all
//! of that is checked when it is compiled. **A changed layout needs a new version**, because iceoryx2 compares
//! only a type's name, size and alignment.
//!
//! All are made by [`shared_struct!`](crate::shared_struct), which is there for every crate.

#[macro_use]
mod define;
pub(crate) mod layout;
mod number;

// What the macro makes is unsafe to implement by hand: it checks what makes it safe.
#[allow(unsafe_code)]
mod configuration;
#[allow(unsafe_code)]
mod dsp_telemetry;
#[allow(unsafe_code)]
mod hero_telemetry;
#[allow(unsafe_code)]
mod journal;
#[allow(unsafe_code)]
mod mavlink;
#[allow(unsafe_code)]
mod module_state;
#[allow(unsafe_code)]
mod outline;
mod position;
#[allow(unsafe_code)]
mod relay;
#[allow(unsafe_code)]
mod request;
mod text;

pub use configuration::{CONFIGURATION_ROOM, ConfigurationPiece};
pub use define::{FieldType, SharedStruct};
pub use dsp_telemetry::*;
pub use hero_telemetry::*;
pub use journal::{BRIDGE_JOURNAL_ROOM, BridgeJournal, STATUS_JOURNAL_ROOM, StatusJournal};
pub use layout::{FieldKind, FieldLayout, Layout, MAX_PAYLOAD_SIZE};
pub use mavlink::{MAVLINK_ADDRESS_LEN, MAX_MAVLINK_STATIONS, MavlinkStation, MavlinkStations};
pub use module_state::*;
pub use number::Number;
pub use outline::{BridgeOutline, OUTLINE_NAME_LEN, OUTLINE_POINTS, OutlinePoint};
pub use position::WaypointPosition;
pub use relay::{
    LINK_TEXT_LEN, MAX_STATIONS, RelayLink, RelayStation, RelayStations, STATION_NAME_LEN,
};
pub use request::*;
pub use text::{ascii_bytes, ascii_text};

/// What the expansion of `shared_struct!` names; `macro_support` of the crate's root.
#[doc(hidden)]
pub mod support {
    pub use super::define::Serialized;
    pub use super::layout::check;
    pub use iceoryx2::prelude::ZeroCopySend;
    pub use serde::ser::{Serialize, SerializeStruct, Serializer};
}
