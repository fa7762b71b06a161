//! Names of connections, of the viewers at their other ends, and of what Foxglove clients subscribe to and call.

/// A connection that was accepted. No two have the same one, as long as the server lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ConnectionId(pub(crate) u64);

/// A page, or a Foxglove client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ViewerId(pub(crate) u64);

/// The number of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ChannelId(pub(crate) u32);

/// A call that waits for its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Call {
    pub(crate) viewer: ViewerId,
    pub(crate) service: u32,
    /// As the client calls it.
    pub(crate) call: u32,
}

impl ConnectionId {
    /// The viewer at the other end.
    pub(crate) fn viewer(self) -> ViewerId {
        ViewerId(self.0)
    }
}
