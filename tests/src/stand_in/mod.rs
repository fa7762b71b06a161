//! Stand-ins for the bridge and for status: what a consumer or an operator's program is tested against, in one process
//! and without a helicopter. They are made of those of `ipc-fixtures`.

mod bridge;
mod ports;
mod status;

pub use bridge::{Received, StandInBridge, progress};
pub use ports::{PortTable, StandInPort};
pub use status::StandInStatus;
