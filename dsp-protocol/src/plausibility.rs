//! Which decoded values cannot be (`docs/protocol.md` section 9).

use crate::downlink::Status;
use crate::mask::StatusMask;

/// The groups of `status` that hold a value outside the limits of section 9.
pub fn implausible_groups(status: &Status) -> StatusMask {
    unimplemented!("{status:?}")
}
