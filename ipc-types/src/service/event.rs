//! What an event of a service says.

/// What an event says. Every event is only a reason to wake up and drain; the data is in the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum EventCode {
    /// There is something to receive: a sample, a request, a report, or a request that was given up.
    Data = 1,
    /// A port of the other side was created.
    Arrived = 2,
    /// A port of the other side was dropped.
    Left = 3,
    /// A port of the other side died; sent by the provider, which cleans up after it.
    Died = 4,
}

/// The largest event id; four are used, the rest is room.
pub const EVENT_ID_MAX: usize = 15;
