//! A port by its number: what a request names, and what stands for it in a snapshot.

use dsp_protocol::port::{Port, port16, port32};
use serde::de::{Deserializer, Error};
use serde::{Deserialize, Serialize, Serializer};

/// The port of this number, if there is one.
pub(super) fn find(number: u32) -> Option<Port> {
    let number = u16::try_from(number).ok()?;
    port16(number)
        .map(Port::Bits16)
        .or_else(|| port32(number).map(Port::Bits32))
}

/// For `#[serde(with)]`.
pub(super) fn serialize<S: Serializer>(port: &Port, to: S) -> Result<S::Ok, S::Error> {
    let number = match port {
        Port::Bits16(port) => port.number,
        Port::Bits32(port) => port.number,
    };
    number.serialize(to)
}

/// For `#[serde(with)]`.
pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Port, D::Error> {
    let number = u16::deserialize(from)?;
    find(number.into()).ok_or_else(|| D::Error::custom("no such port"))
}
