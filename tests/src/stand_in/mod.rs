//! Stand-ins for the bridge, for status and for any module's topics and requests: what a consumer or an operator's
//! program is tested against, in one process and without a helicopter.
//!
//! Each has a thread of its own that owns the real ports of `ipc-types` and sleeps until there is something to do, so
//! that the program under test may block as it does in earnest. They do what they are told: a stand-in never changes
//! what it publishes because of a request.

mod answer;
mod bridge;
mod own;
mod ports;
mod publishing;
mod status;
mod worker;

pub use answer::Answer;
pub use bridge::{Received, StandInBridge};
pub use own::{StandInServer, StandInTopic};
pub use ports::{PortTable, StandInPort};
pub use publishing::Publishing;
pub use status::StandInStatus;
