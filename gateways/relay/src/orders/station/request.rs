//! [`Request`]: what a client asks for.

use ipc_types::MonotonicNs;

/// A request of a client.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// By what the caller knows the request; different from all that are open.
    pub handle: u64,
    /// Path of the request, which every report repeats; 0 if it has none.
    pub path_id: u64,
    /// Which request service of the robot.
    pub topic: u64,
    /// The robot side must not pass the request on later than this. Monotonic clock of the *robot*; the caller takes the earliest
    /// time that the deadline can be in that clock.
    pub expires: MonotonicNs,
    /// The request as its service has it.
    pub bytes: Vec<u8>,
}
