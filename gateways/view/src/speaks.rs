//! [`Speaks`]: what is spoken over a WebSocket.

use crate::foxglove::PROTOCOLS;
use crate::http::request::Upgrade;
use crate::page;

/// What a viewer speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Speaks {
    Page,
    Foxglove,
}

/// The subprotocol that is spoken with this client; `None` if it offers none that there is.
pub(crate) fn protocol(upgrade: &Upgrade) -> Option<(&'static str, Speaks)> {
    let is_offered = |name: &&str| upgrade.protocols.iter().any(|offered| offered == name);
    if is_offered(&page::PROTOCOL) {
        return Some((page::PROTOCOL, Speaks::Page));
    }
    let foxglove = PROTOCOLS.into_iter().find(is_offered)?;
    Some((foxglove, Speaks::Foxglove))
}
