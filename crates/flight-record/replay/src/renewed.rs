//! [`renew`]: the digests of a kept flight as this version has them.

use std::collections::VecDeque;

use module_kit::journal::{Entry, JournalReader, JournalWriter};
use status::journal::Snapshot;

use crate::bridge_core::BridgeCore;
use crate::keeper::{ROOM, drain};
use crate::kept::{Digest, KeptFlight, NotKept, Streams};
use crate::track::Core;

/// Renews a kept flight after a change that is meant: its inputs, with what the cores of this version say to them.
///
/// # Errors
/// See [`NotKept`]; [`NotKept::Damaged`] also when a core cannot begin.
pub fn renew(file: &[u8]) -> Result<Vec<u8>, NotKept> {
    let kept = KeptFlight::read(file)?;
    let mut streams = Streams::of(kept.received);
    let bridge = renewed::<BridgeCore>(kept.bridge, &mut streams)?;
    let status = renewed::<Snapshot>(kept.status, &mut streams)?;
    let renewed = KeptFlight {
        received: streams.into_received(),
        bridge,
        status,
        ..kept
    };
    Ok(renewed.write())
}

fn renewed<C: Core>(journal: Vec<u8>, streams: &mut Streams) -> Result<Vec<u8>, NotKept> {
    let mut reader = JournalReader::of(journal);
    let mut writer = JournalWriter::new(ROOM);
    let (mut core, mut said, mut bytes) = (None, VecDeque::new(), Vec::new());
    // Outputs of the last input that were recorded.
    let mut recorded = 0;
    while let Some(record) = reader
        .next::<C::Kept<'_>, Digest>()
        .map_err(|_| NotKept::Damaged)?
    {
        match (record.entry, &mut core) {
            (Entry::Output(_), _) => recorded += 1,
            (Entry::Snapshot(beginning), _) => {
                // Before a loss less may have been recorded than the core says.
                said.truncate(recorded);
                write_outputs::<C>(&mut said, &mut writer, streams);
                core = Some(C::begin(beginning, None).ok_or(NotKept::Damaged)?);
                // A writer that starts drops what it has.
                drain(&mut writer, &mut bytes);
                writer.start();
                writer.snapshot(record.at, beginning);
            }
            (Entry::Input(kept), Some(core)) => {
                write_outputs::<C>(&mut said, &mut writer, streams);
                recorded = 0;
                writer.input(record.at, &kept);
                if !core.apply_kept(record.at, kept, streams, &mut said) {
                    return Err(NotKept::Damaged);
                }
            }
            _ => {}
        }
        drain(&mut writer, &mut bytes);
    }
    // The outputs of the last input, of which fewer may have been recorded.
    said.truncate(recorded);
    write_outputs::<C>(&mut said, &mut writer, streams);
    drain(&mut writer, &mut bytes);
    Ok(bytes)
}

fn write_outputs<C: Core>(
    said: &mut VecDeque<C::Output<'static>>,
    writer: &mut JournalWriter,
    streams: &mut Streams,
) {
    for output in said.drain(..) {
        C::note(&output, streams);
        writer.output(&Digest::of(&output));
    }
}
