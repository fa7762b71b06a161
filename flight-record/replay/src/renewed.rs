//! [`renew`]: the digests of a kept flight as this version has them.

use std::collections::VecDeque;

use module_kit::journal::{Entry, Reader, Writer};
use status::journal::Snapshot;

use crate::bridge_core::BridgeCore;
use crate::keeper::{ROOM, drain};
use crate::kept::{Digest, KeptFlight, NotKept, Streams};
use crate::track::Core;

/// The same inputs, with what the cores of this version say to them: after a change that is meant.
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
    let mut reader = Reader::of(journal);
    let mut writer = Writer::new(ROOM);
    let (mut core, mut said, mut bytes) = (None, VecDeque::new(), Vec::new());
    // Outputs of the last input that were recorded.
    let mut recorded = 0;
    loop {
        let record = reader
            .next::<C::Kept<'_>, Digest>()
            .map_err(|_| NotKept::Damaged)?;
        let is_end = record.is_none();
        let entry = record.map(|record| (record.at, record.entry));
        match &entry {
            Some((_, Entry::Output(_))) => recorded += 1,
            // What was said before a loss, and at the end, may be more than what was recorded.
            None | Some((_, Entry::Snapshot(_))) => said.truncate(recorded),
            Some(_) => {}
        }
        if !matches!(entry, Some((_, Entry::Output(_)))) {
            for output in said.drain(..) {
                C::note(&output, streams);
                writer.output(&Digest::of(&output));
            }
            recorded = 0;
        }
        match (entry, &mut core) {
            (Some((at, Entry::Snapshot(beginning))), _) => {
                core = Some(C::begin(beginning, None).ok_or(NotKept::Damaged)?);
                writer.start();
                writer.snapshot(at, beginning);
            }
            (Some((at, Entry::Input(kept))), Some(core)) => {
                writer.input(at, &kept);
                if !core.apply_kept(at, kept, streams, &mut said) {
                    return Err(NotKept::Damaged);
                }
            }
            _ => {}
        }
        drain(&mut writer, &mut bytes);
        if is_end {
            return Ok(bytes);
        }
    }
}
