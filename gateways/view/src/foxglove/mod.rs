//! The protocol of Foxglove and Lichtblick: any topic as it is, for their panels and layouts.
//!
//! Two names of it are spoken, [`PROTOCOLS`], and mean the same bytes here. The published text is `docs/spec.md` in the
//! history of the repository `foxglove/ws-protocol`.

pub(crate) mod channels;
pub(crate) mod client;
pub(crate) mod hub;
mod message;
mod playback;
mod samples;

/// The names of the WebSocket subprotocol, the preferred one first.
pub(crate) const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
