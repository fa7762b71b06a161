//! Services: what they are called, what lies in them, and every quality-of-service value.
//!
//! `key` has the names, `contract` what the processes of one service must agree on, `table` the robot's own services,
//! `bounds` how much of everything a service holds.

mod bounds;
mod contract;
mod key;
mod table;

pub use crate::sequence::{EPOCH_OFFSET, SEQUENCE_OFFSET};
pub use bounds::*;
pub use contract::{Contract, Pattern, REQUEST_ID_OFFSET, Request, Topic};
#[doc(hidden)]
pub use contract::{check_request, check_topic};
#[doc(hidden)]
pub use key::check_outside;
pub(crate) use key::folder_name;
pub use key::{MAX_KEY_LEN, OWN_NAMES, is_key, is_own_name, module_of, service_name};
pub(crate) use table::slot;
pub use table::{SERVICES, ServiceId, ServiceSpec, own};
