//! [`Encoder`] and [`Decoder`]: records to bytes and back.

use ipc_types::MonotonicNs;
use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, SharedStruct};
use module_kit::journal::MAX_RECORD;
use module_kit::journal::bytes::{Cursor, Malformed, put_changes, put_number, put_signed};

use super::record::{Entry, Input, Kind, Output, Record};
use crate::core::InputCounts;

/// What the record before had: times, samples and counts are written as what has changed.
#[derive(Clone, Debug, Default)]
struct Before {
    at: MonotonicNs,
    dsp: DspTelemetry,
    hero: HeroTelemetry,
    state: State,
    counts: InputCounts,
}

/// Writes records. All records of a journal go through one encoder, beginning with a snapshot.
#[derive(Clone, Debug, Default)]
pub struct Encoder(Before);

impl Encoder {
    /// Before the first snapshot.
    pub fn new() -> Encoder {
        Encoder::default()
    }

    /// Appends a snapshot. Whatever was written before is forgotten.
    pub fn snapshot(&mut self, at: MonotonicNs, snapshot: &[u8], out: &mut Vec<u8>) {
        self.0 = Before {
            at,
            ..Before::default()
        };
        out.push(Kind::Snapshot as u8);
        put_number(out, at.0);
        put_number(out, snapshot.len() as u64);
        put_changes(out, &vec![0; snapshot.len()], snapshot);
    }

    /// Appends an input.
    pub fn input(&mut self, at: MonotonicNs, input: &Input, out: &mut Vec<u8>) {
        let kind = match input {
            Input::Translate(_) => Kind::Translate,
            Input::Record(_) => Kind::Record,
            Input::Step(_) => Kind::Step,
            Input::State { .. } => Kind::State,
        };
        out.push(kind as u8);
        let before = &mut self.0;
        put_signed(out, at.0.wrapping_sub(before.at.0) as i64);
        before.at = at;
        match input {
            Input::Translate(dsp) => {
                put_changes(out, before.dsp.bytes(), dsp.bytes());
                before.dsp = *dsp;
            }
            Input::Record(is_published) => out.push((*is_published).into()),
            Input::Step(counts) => {
                let past = before.counts;
                let mut put = |now: u64, past: u64| put_signed(out, now.wrapping_sub(past) as i64);
                put(counts.received, past.received);
                put(counts.lost, past.lost);
                put(counts.publisher_restarts, past.publisher_restarts);
                before.counts = *counts;
            }
            Input::State { always } => out.push((*always).into()),
        }
    }

    /// Appends a telemetry sample; what its publisher counts is left out.
    pub fn telemetry(&mut self, hero: &HeroTelemetry, out: &mut Vec<u8>) {
        let hero = HeroTelemetry {
            sequence: 0,
            epoch_ns: 0,
            ..*hero
        };
        out.push(Kind::Telemetry as u8);
        put_changes(out, self.0.hero.bytes(), hero.bytes());
        self.0.hero = hero;
    }

    /// Appends a state; what its publisher counts is left out.
    pub fn state(&mut self, state: &State, out: &mut Vec<u8>) {
        let state = State {
            sequence: 0,
            epoch_ns: 0,
            published_ns: 0,
            ..*state
        };
        out.push(Kind::Published as u8);
        put_changes(out, self.0.state.bytes(), state.bytes());
        self.0.state = state;
    }
}

/// Reads records, in the order in which they were written, beginning with a snapshot. After a loss it goes on with the next
/// snapshot. Never panics, whatever the bytes; takes memory in proportion to a record, at most [`MAX_RECORD`].
#[derive(Clone, Debug, Default)]
pub struct Decoder(Before);

impl Decoder {
    /// Before the first snapshot.
    pub fn new() -> Decoder {
        Decoder::default()
    }

    /// The record that these bytes are.
    ///
    /// # Errors
    /// They are none of this version. The records up to the next snapshot cannot be read then.
    pub fn decode(&mut self, record: &[u8]) -> Result<Record, Malformed> {
        let mut cursor = Cursor::new(record);
        let kind = Kind::of(cursor.byte()?).ok_or(Malformed)?;
        let entry = match kind {
            Kind::Snapshot => Entry::Snapshot(self.snapshot(&mut cursor)?),
            Kind::Telemetry => {
                self.0.hero = changed(&mut cursor, &self.0.hero)?;
                Entry::Output(Output::Telemetry(self.0.hero))
            }
            Kind::Published => {
                self.0.state = changed(&mut cursor, &self.0.state)?;
                Entry::Output(Output::State(self.0.state))
            }
            Kind::Translate | Kind::Record | Kind::Step | Kind::State => {
                let elapsed = cursor.signed()?;
                self.0.at = MonotonicNs(self.0.at.0.wrapping_add_signed(elapsed));
                Entry::Input(self.input(kind, &mut cursor)?)
            }
        };
        if !cursor.is_at_end() {
            return Err(Malformed);
        }
        let at = self.0.at;
        Ok(Record { at, entry })
    }

    fn snapshot(&mut self, cursor: &mut Cursor<'_>) -> Result<Vec<u8>, Malformed> {
        let at = MonotonicNs(cursor.number()?);
        self.0 = Before {
            at,
            ..Before::default()
        };
        let mut snapshot = vec![0; cursor.count(MAX_RECORD)?];
        cursor.changes(&mut snapshot)?;
        Ok(snapshot)
    }

    fn input(&mut self, kind: Kind, cursor: &mut Cursor<'_>) -> Result<Input, Malformed> {
        Ok(match kind {
            Kind::Translate => {
                self.0.dsp = changed(cursor, &self.0.dsp)?;
                Input::Translate(self.0.dsp)
            }
            Kind::Record => Input::Record(flag(cursor)?),
            Kind::Step => {
                let past = self.0.counts;
                let mut next = |past: u64| Ok(past.wrapping_add_signed(cursor.signed()?));
                self.0.counts = InputCounts {
                    received: next(past.received)?,
                    lost: next(past.lost)?,
                    publisher_restarts: next(past.publisher_restarts)?,
                };
                Input::Step(self.0.counts)
            }
            Kind::State => Input::State {
                always: flag(cursor)?,
            },
            Kind::Snapshot | Kind::Telemetry | Kind::Published => return Err(Malformed),
        })
    }
}

fn flag(cursor: &mut Cursor<'_>) -> Result<bool, Malformed> {
    match cursor.byte()? {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(Malformed),
    }
}

/// `before` with what has changed.
fn changed<T: SharedStruct>(cursor: &mut Cursor<'_>, before: &T) -> Result<T, Malformed> {
    let mut bytes = before.bytes().to_vec();
    cursor.changes(&mut bytes)?;
    T::from_bytes(&bytes).ok_or(Malformed)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::test_samples::sample;

    #[test]
    fn what_is_written_is_read_again() {
        let (mut encoder, mut decoder) = (Encoder::new(), Decoder::new());
        let at = MonotonicNs(1_000_000_007);
        let counts = InputCounts {
            received: 7,
            lost: 0,
            publisher_restarts: 1,
        };
        let inputs = [
            Input::Translate(sample(1, 1)),
            Input::Translate(sample(1, 2)),
            Input::Record(true),
            Input::Record(false),
            Input::Step(counts),
            Input::Step(InputCounts::default()),
            Input::State { always: true },
        ];
        let mut bytes = Vec::new();
        encoder.snapshot(at, &[0, 0, 7, 0], &mut bytes);
        let snapshot = decoder.decode(&bytes).unwrap();
        assert_eq!(snapshot.entry, Entry::Snapshot(vec![0, 0, 7, 0]));
        // A clock that was read before the last one.
        for (index, input) in inputs.into_iter().enumerate() {
            let at = MonotonicNs(at.0 + 20 - index as u64);
            bytes.clear();
            encoder.input(at, &input, &mut bytes);
            let entry = Entry::Input(input);
            assert_eq!(decoder.decode(&bytes), Ok(Record { at, entry }));
        }
        bytes.clear();
        let hero = HeroTelemetry {
            sequence: 9,
            flying: 1,
            ..HeroTelemetry::default()
        };
        encoder.telemetry(&hero, &mut bytes);
        let read = decoder.decode(&bytes).unwrap();
        let hero = HeroTelemetry {
            sequence: 0,
            ..hero
        };
        assert_eq!(read.entry, Entry::Output(Output::Telemetry(hero)));
        bytes.clear();
        encoder.state(&State::default(), &mut bytes);
        let read = decoder.decode(&bytes).unwrap();
        assert_eq!(read.entry, Entry::Output(Output::State(State::default())));
    }

    #[test]
    fn no_kind_of_ours_is_a_line_of_the_log() {
        assert_eq!(Kind::of(module_kit::journal::LOG_LINE), None);
    }

    proptest! {
        #[test]
        fn no_bytes_make_the_decoder_panic(
            records in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..64), 0..16),
            kind in prop::sample::select(Kind::ALL.to_vec()),
        ) {
            let mut decoder = Decoder::new();
            for mut record in records {
                let _ = decoder.decode(&record);
                record.insert(0, kind as u8);
                let _ = decoder.decode(&record);
            }
        }
    }
}
