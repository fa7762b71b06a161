//! [`Keeper`]: the journals of a recording to a kept flight.

use std::fmt;

use ipc_types::payload::{BridgeJournal, SharedStruct, StatusJournal};
use ipc_types::{JournalPiece, Topic};
use module_kit::journal::{Entry, JournalReader, JournalWriter};
use status::journal::Snapshot;

use crate::bridge_core::BridgeCore;
use crate::kept::{Digest, KeptFlight, NotKept, Streams};
use crate::track::Core;

/// Bytes that the writer of a kept journal hands over at once.
pub(crate) const ROOM: usize = 64 << 10;

/// Takes the samples of the journals' topics in the order in which they were recorded.
#[derive(Debug, Default)]
pub struct Keeper {
    streams: Streams,
    bridge: KeptJournal<BridgeCore>,
    /// They refer to samples of the bridge, so they wait until all of these are known.
    status: Vec<StatusJournal>,
}

/// A kept flight, and how far it can be read.
#[derive(Debug)]
pub struct Kept {
    /// The bytes of the file.
    pub file: Vec<u8>,
    /// Each journal begins with the start of its process, so no version is bound to it by a snapshot.
    pub is_from_the_start: bool,
}

impl Keeper {
    /// Takes a sample of the topic with this key; one that is no journal is ignored.
    pub fn take(&mut self, key: &str, sample: &[u8]) {
        if key == BridgeJournal::KEY
            && let Some(piece) = BridgeJournal::from_bytes(sample)
        {
            self.bridge.take(&piece, &mut self.streams);
        } else if key == StatusJournal::KEY
            && let Some(piece) = StatusJournal::from_bytes(sample)
        {
            self.status.push(piece);
        }
    }

    /// The file.
    ///
    /// # Errors
    /// No journal begins.
    pub fn finish(self) -> Result<Kept, NotKept> {
        let Keeper {
            mut streams,
            bridge,
            status: pieces,
        } = self;
        let mut status = KeptJournal::<Snapshot>::default();
        for piece in &pieces {
            status.take(piece, &mut streams);
        }
        if bridge.bytes.is_empty() && status.bytes.is_empty() {
            return Err(NotKept::Empty);
        }
        let is_from_the_start = bridge.snapshots + status.snapshots == 0;
        let has_samples = streams.unknown() > 0;
        let received = streams.into_received();
        Ok(Kept {
            file: KeptFlight::new(received, bridge.bytes, status.bytes, has_samples).write(),
            is_from_the_start,
        })
    }
}

/// One journal.
struct KeptJournal<C> {
    reader: JournalReader,
    writer: JournalWriter,
    /// What is read belongs to a beginning that was written.
    is_going: bool,
    /// Beginnings that are snapshots.
    snapshots: u64,
    bytes: Vec<u8>,
    core: std::marker::PhantomData<C>,
}

impl<C> Default for KeptJournal<C> {
    fn default() -> Self {
        KeptJournal {
            reader: JournalReader::new(),
            writer: JournalWriter::new(ROOM),
            is_going: false,
            snapshots: 0,
            bytes: Vec::new(),
            core: std::marker::PhantomData,
        }
    }
}

impl<C> fmt::Debug for KeptJournal<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("KeptJournal").finish_non_exhaustive()
    }
}

impl<C: Core> KeptJournal<C> {
    fn take<P: JournalPiece>(&mut self, piece: &P, streams: &mut Streams) {
        if self.reader.take(piece).is_some() {
            self.is_going = false;
        }
        let writer = &mut self.writer;
        loop {
            let record = match self.reader.next::<C::Input<'_>, C::Output<'_>>() {
                Ok(Some(record)) => record,
                Ok(None) => break,
                Err(_malformed) => {
                    self.is_going = false;
                    break;
                }
            };
            match record.entry {
                Entry::Snapshot(_) if self.is_going => {}
                Entry::Snapshot(snapshot) => {
                    let beginning = C::beginning(snapshot);
                    self.snapshots += u64::from(beginning.is_snapshot());
                    writer.start();
                    // Writing into memory does not fail.
                    let bytes = postcard::to_allocvec(&beginning).unwrap_or_default();
                    writer.snapshot(record.at, &bytes);
                    self.is_going = true;
                }
                _ if !self.is_going => {}
                Entry::Input(input) => C::keep(record.at, input, streams, writer),
                Entry::Output(output) => {
                    C::note(&output, streams);
                    writer.output(&Digest::of(&output));
                }
                // Nothing that is published follows from it.
                Entry::Line(_) => {}
            }
        }
        drain(writer, &mut self.bytes);
    }
}

/// Moves what `writer` has to `bytes`.
pub(crate) fn drain(writer: &mut JournalWriter, bytes: &mut Vec<u8>) {
    for piece in writer.take_all() {
        bytes.extend_from_slice(&piece.bytes);
    }
}
