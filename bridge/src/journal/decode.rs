//! [`Decoder`]: bytes to records.

use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use ipc_types::payload::{DspTelemetry, ModuleState, SharedStruct};
use module_kit::journal::MAX_RECORD;
use module_kit::journal::bytes::{Cursor, Malformed};

use super::record::{Entry, Input, Kind, Output, Record};
use crate::flight::request::RequestKey;
use crate::safety::fence::Fence;

/// Reads records, in the order in which they were written, beginning with a snapshot. After a loss it goes on with the next
/// snapshot. Never panics, whatever the bytes; takes memory in proportion to a record, at most [`MAX_RECORD`].
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    at: MonotonicNs,
    telemetry: DspTelemetry,
    state: ModuleState,
}

impl Decoder {
    /// Before the first snapshot.
    pub fn new() -> Decoder {
        Decoder::default()
    }

    /// The record that these bytes are.
    ///
    /// # Errors
    /// They are none of this version. The records up to the next snapshot cannot be read then.
    pub fn decode<'a>(&mut self, record: &'a [u8]) -> Result<Record<'a>, Malformed> {
        let mut cursor = Cursor::new(record);
        let kind = Kind::of(cursor.byte()?).ok_or(Malformed)?;
        let entry = match kind {
            Kind::Snapshot => Entry::Snapshot(self.snapshot(&mut cursor)?),
            Kind::Telemetry | Kind::State | Kind::Report | Kind::Sent => {
                Entry::Output(self.output(kind, &mut cursor)?)
            }
            _ => {
                let elapsed = cursor.signed()?;
                self.at = MonotonicNs(self.at.0.wrapping_add_signed(elapsed));
                Entry::Input(input(kind, &mut cursor)?)
            }
        };
        if !cursor.is_at_end() {
            return Err(Malformed);
        }
        Ok(Record { at: self.at, entry })
    }

    fn snapshot(&mut self, cursor: &mut Cursor<'_>) -> Result<Vec<u8>, Malformed> {
        let at = MonotonicNs(cursor.number()?);
        *self = Decoder {
            at,
            ..Decoder::default()
        };
        let mut snapshot = vec![0; cursor.count(MAX_RECORD)?];
        cursor.changes(&mut snapshot)?;
        Ok(snapshot)
    }

    fn output<'a>(&mut self, kind: Kind, cursor: &mut Cursor<'a>) -> Result<Output<'a>, Malformed> {
        Ok(match kind {
            Kind::Telemetry => {
                self.telemetry = changed(cursor, &self.telemetry)?;
                Output::Telemetry(self.telemetry)
            }
            Kind::State => {
                self.state = changed(cursor, &self.state)?;
                Output::State(self.state)
            }
            Kind::Report => Output::Report(key(cursor)?, changed(cursor, &SharedStruct::ZERO)?),
            _ => Output::Sent(cursor.take_rest()),
        })
    }
}

fn input<'a>(kind: Kind, cursor: &mut Cursor<'a>) -> Result<Input<'a>, Malformed> {
    Ok(match kind {
        Kind::PortOpened => Input::PortOpened,
        Kind::PortClosed => Input::PortClosed,
        Kind::Received => Input::Received(cursor.take_rest()),
        Kind::Control => Input::Control {
            key: key(cursor)?,
            sender: sender(cursor)?,
            request: changed(cursor, &SharedStruct::ZERO)?,
        },
        Kind::NewFence => Input::NewFence {
            key: key(cursor)?,
            sender: sender(cursor)?,
            request: changed(cursor, &SharedStruct::ZERO)?,
            fence: fence(cursor)?,
        },
        Kind::Movement => Input::Movement {
            key: key(cursor)?,
            sender: sender(cursor)?,
            request: changed(cursor, &SharedStruct::ZERO)?,
        },
        Kind::Parameter => Input::Parameter {
            key: key(cursor)?,
            sender: sender(cursor)?,
            request: changed(cursor, &SharedStruct::ZERO)?,
        },
        Kind::SenderGone => Input::SenderGone(key(cursor)?),
        Kind::Advance => Input::Advance,
        Kind::WindDown => Input::WindDown,
        Kind::Close => Input::Close,
        Kind::Transmit => Input::Transmit,
        Kind::Transmitted => Input::Transmitted(cursor.count(usize::MAX)?),
        Kind::DiscardUnsent => Input::DiscardUnsent,
        Kind::Snapshot | Kind::Telemetry | Kind::State | Kind::Report | Kind::Sent => {
            return Err(Malformed);
        }
    })
}

fn key(cursor: &mut Cursor<'_>) -> Result<RequestKey, Malformed> {
    let service = cursor.byte()?;
    let ticket = cursor.number()?;
    match service {
        0 => Ok(RequestKey::Control(ticket)),
        1 => Ok(RequestKey::Movement(ticket)),
        2 => Ok(RequestKey::Parameter(ticket)),
        _ => Err(Malformed),
    }
}

fn sender(cursor: &mut Cursor<'_>) -> Result<Option<u32>, Malformed> {
    let pid = u32::try_from(cursor.number()?).map_err(|_| Malformed)?;
    Ok((pid != 0).then_some(pid))
}

fn fence(cursor: &mut Cursor<'_>) -> Result<Result<Fence, Reason>, Malformed> {
    match cursor.byte()? {
        0 => {
            let code = u32::try_from(cursor.number()?).map_err(|_| Malformed)?;
            Ok(Err(Reason::from_code(code).ok_or(Malformed)?))
        }
        1 => {
            let text = std::str::from_utf8(cursor.bytes()?).map_err(|_| Malformed)?;
            let fence = runtime::config::parse(text, "the journal").map_err(|_| Malformed)?;
            Ok(Ok(fence))
        }
        _ => Err(Malformed),
    }
}

/// `before` with what has changed.
fn changed<T: SharedStruct>(cursor: &mut Cursor<'_>, before: &T) -> Result<T, Malformed> {
    let mut bytes = before.bytes().to_vec();
    cursor.changes(&mut bytes)?;
    T::from_bytes(&bytes).ok_or(Malformed)
}
