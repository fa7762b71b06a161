//! Every mission's journals, verified while they are written: second cores are driven by them and must say the same,
//! bit for bit.

use bridge::BridgeConfig;
use bridge::journal::Journaled;
use ipc_types::payload::BridgeJournal;
use ipc_types::{JournalPiece, MonotonicNs};
use module_kit::journal::{JournalWriter, Piece};
use replay::Verifier;

/// The recorder of one journal of a mission.
pub struct Recording<P> {
    verifier: Verifier,
    /// The life of the process, and its pieces.
    life: u64,
    sequence: u64,
    /// When pieces were taken last.
    now: MonotonicNs,
    /// All samples, if they are kept.
    kept: Option<Vec<P>>,
}

impl<P> Default for Recording<P> {
    fn default() -> Self {
        Recording {
            verifier: Verifier::new(),
            life: 1,
            sequence: 0,
            now: MonotonicNs(0),
            kept: None,
        }
    }
}

/// A bridge that is recorded from its beginning, or never.
pub fn bridge(config: &BridgeConfig, is_recorded: bool) -> Journaled {
    Journaled::new(config, writer::<BridgeJournal>(is_recorded))
}

/// A writer that waits for its first snapshot, or writes nothing.
pub fn writer<P: JournalPiece>(is_recorded: bool) -> JournalWriter {
    let mut writer = JournalWriter::new(P::ROOM);
    if is_recorded {
        writer.start();
    }
    writer
}

impl<P: JournalPiece> Recording<P> {
    /// Keeps all samples from now on.
    pub fn keep(&mut self) {
        self.kept = Some(Vec::new());
    }

    /// The samples that were kept.
    pub fn kept(&mut self) -> Vec<P> {
        self.kept.take().unwrap_or_default()
    }

    /// Verifies what has been written so far.
    pub fn take(&mut self, writer: &mut JournalWriter, now: MonotonicNs) {
        self.now = now;
        while let Some(piece) = writer.next(now) {
            self.verify(&piece);
        }
    }

    /// Verifies all that is left. The process is gone; its successor has a journal of its own.
    pub fn process_gone(&mut self, writer: &mut JournalWriter) {
        let pieces: Vec<_> = writer.take_all().collect();
        for piece in pieces {
            self.verify(&piece);
        }
        self.life += 1;
        self.sequence = 0;
    }

    fn verify(&mut self, piece: &Piece) {
        self.sequence += 1;
        let sample = sample::<P>(piece, self.now, self.sequence, self.life);
        self.verifier.take(P::KEY, sample.bytes());
        if let Some(kept) = &mut self.kept {
            kept.push(sample);
        }
    }
}

/// A piece as it is published.
pub fn sample<P: JournalPiece>(
    piece: &Piece,
    published: MonotonicNs,
    sequence: u64,
    epoch_ns: u64,
) -> P {
    let mut sample = P::ZERO;
    sample.fill(published.0, piece.begins, piece.beginnings, &piece.bytes);
    sample.stamp(sequence, epoch_ns);
    sample
}

impl<P> Drop for Recording<P> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            return;
        }
        let verdict = std::mem::take(&mut self.verifier).finish();
        if let Some(difference) = verdict.difference() {
            panic!("the replay differs: {difference}");
        }
        for journal in [verdict.bridge, verdict.status] {
            assert!(journal.is_verified() || journal.is_empty(), "{journal:?}");
        }
    }
}
