//! The fixed-layout structs that lie in shared memory.
//!
//! Each is `#[repr(C)]`, has no padding, holds only plain numbers and has a stable type name with a layout version; all
//! of that is checked when this crate is compiled. **A changed layout needs a new version**, because iceoryx2 compares
//! only a type's name, size and alignment.

#[macro_use]
mod layout;

mod access;
mod dsp_telemetry;
mod hero_telemetry;
mod module_state;
mod request;

pub use access::WaypointPosition;
pub use dsp_telemetry::*;
pub use hero_telemetry::*;
pub use layout::{FieldKind, FieldLayout, SharedStruct, layout_hash};
pub use module_state::*;
pub use request::*;
