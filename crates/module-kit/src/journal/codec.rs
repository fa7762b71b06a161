//! [`JournalRecord`]: an entry of a journal and its time; [`Codec`]: records to bytes and back.
//!
//! A record is a byte for its kind, a time, and a body: the entry in postcard's format. Times are written as what has
//! passed since the record before, bodies as what has changed since the last one of their kind: samples and states
//! change little.

use std::collections::BTreeMap;

use ipc_types::MonotonicNs;
use runtime::logging;
use serde::{Deserialize, Serialize};
use tracing::Level;

/// Longest record, bytes. The longest are snapshots: of a bridge with the largest geofence (64 areas of 256 vertices,
/// twice 650 KiB) and 2048 final reports (at most 290 KiB). A longer record is not written; the journal then begins
/// again.
pub const MAX_RECORD: usize = 2 << 20;

/// Longest body that the next one of its kind is compared with; after a longer one the next stands alone. Longer than
/// any sample; it bounds what hostile bytes make a reader keep: 256 kinds of 4 KiB.
const MAX_REMEMBERED: usize = 4096;

/// Equal bytes between two changed ones that are written all the same: their number would cost as much.
const SHORT_RUN: usize = 2;

/// Bytes that are no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are no record of a journal")]
pub struct Malformed;

/// An entry of a journal, and when it was. `I` is the input of the core, `O` its output.
#[derive(Clone, Debug, PartialEq)]
pub struct JournalRecord<'a, I, O> {
    /// Host monotonic; of an output the time of the input that caused it.
    pub at: MonotonicNs,
    /// What.
    pub entry: Entry<'a, I, O>,
}

/// What a record is.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry<'a, I, O> {
    /// The whole core, before the inputs that follow.
    Snapshot(&'a [u8]),
    /// An input of the core.
    Input(I),
    /// What the core said to the last input.
    Output(O),
    /// A line of the log of the process. It is no input: a replay skips it.
    Line(LogLine<'a>),
}

/// A line of the log of the process whose journal it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogLine<'a> {
    /// Lines that were lost about this time, because too many came at once.
    pub lost: u64,
    /// How grave.
    #[serde(with = "level")]
    pub level: Level,
    /// Path of the module in the source, such as `bridge::shell::audit`.
    pub module: &'a str,
    /// Message and fields, as standard error has them.
    pub text: &'a str,
}

impl<'a> LogLine<'a> {
    /// A line of this process; so many were lost.
    pub fn new(line: &'a logging::LogLine, lost: u64) -> LogLine<'a> {
        LogLine {
            lost,
            level: line.level,
            module: &line.module,
            text: &line.text,
        }
    }
}

/// A level by its name, such as `WARN`.
mod level {
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::Serializer;
    use tracing::Level;

    pub fn serialize<S: Serializer>(level: &Level, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(level.as_str())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Level, D::Error> {
        <&str>::deserialize(from)?.parse().map_err(D::Error::custom)
    }
}

/// The kind of a snapshot and of a line.
const SNAPSHOT: u8 = 0x01;
const LINE: u8 = 0x30;
/// The kinds of inputs and outputs: to these their variant is added. More than 16 variants share kinds, which costs
/// bytes only.
const INPUT: u8 = 0x10;
const OUTPUT: u8 = 0x20;
const VARIANT: u8 = 0x0F;

/// One end of a journal: the times and bodies that the next record is compared with.
#[derive(Clone, Debug, Default)]
pub(super) struct Codec {
    at: MonotonicNs,
    /// The last body.
    body: Vec<u8>,
    last: BTreeMap<u8, Vec<u8>>,
}

impl Codec {
    /// The time of the last record.
    pub fn at(&self) -> MonotonicNs {
        self.at
    }

    /// Appends a snapshot: no record after it is compared with one before it.
    pub fn put_snapshot(
        &mut self,
        at: MonotonicNs,
        snapshot: &[u8],
        out: &mut Vec<u8>,
    ) -> Result<(), Malformed> {
        self.forget();
        self.body.extend_from_slice(snapshot);
        self.put_body(SNAPSHOT, at, out)
    }

    /// Appends an input.
    pub fn put_input<I: Serialize>(
        &mut self,
        at: MonotonicNs,
        input: &I,
        out: &mut Vec<u8>,
    ) -> Result<(), Malformed> {
        self.put(INPUT, at, input, out)
    }

    /// Appends an output.
    pub fn put_output<O: Serialize>(
        &mut self,
        at: MonotonicNs,
        output: &O,
        out: &mut Vec<u8>,
    ) -> Result<(), Malformed> {
        self.put(OUTPUT, at, output, out)
    }

    /// Appends a line.
    pub fn put_line(
        &mut self,
        at: MonotonicNs,
        line: &LogLine<'_>,
        out: &mut Vec<u8>,
    ) -> Result<(), Malformed> {
        self.body.clear();
        put(&mut self.body, line)?;
        self.put_body(LINE, at, out)
    }

    /// Reads a record up to its body. Gives its kind, for [`Codec::entry`].
    pub fn take(&mut self, record: &[u8]) -> Result<u8, Malformed> {
        let (&kind, rest) = record.split_first().ok_or(Malformed)?;
        if kind == SNAPSHOT {
            self.forget();
        }
        let (elapsed, rest) = get::<i64>(rest)?;
        let (length, rest) = get::<usize>(rest)?;
        if length > MAX_RECORD {
            return Err(Malformed);
        }
        self.at = MonotonicNs(self.at.0.wrapping_add_signed(elapsed));
        self.body.clear();
        if let Some(last) = self.last.get(&kind) {
            self.body.extend_from_slice(last);
        }
        self.body.resize(length, 0);
        apply_changes(&mut self.body, rest)?;
        self.remember(kind);
        Ok(kind)
    }

    /// The entry of the last record, whose kind is `kind`.
    pub fn entry<'a, I: Deserialize<'a>, O: Deserialize<'a>>(
        &'a self,
        kind: u8,
    ) -> Result<Entry<'a, I, O>, Malformed> {
        match kind {
            SNAPSHOT => Ok(Entry::Snapshot(&self.body)),
            LINE => whole(&self.body).map(Entry::Line),
            _ if kind & !VARIANT == INPUT => whole(&self.body).map(Entry::Input),
            _ if kind & !VARIANT == OUTPUT => whole(&self.body).map(Entry::Output),
            _ => Err(Malformed),
        }
    }

    fn put<T: Serialize>(
        &mut self,
        class: u8,
        at: MonotonicNs,
        value: &T,
        out: &mut Vec<u8>,
    ) -> Result<(), Malformed> {
        self.body.clear();
        put(&mut self.body, value)?;
        // The body of an enum begins with the number of its variant.
        let variant = self.body.first().map_or(0, |variant| variant & VARIANT);
        self.put_body(class | variant, at, out)
    }

    fn put_body(&mut self, kind: u8, at: MonotonicNs, out: &mut Vec<u8>) -> Result<(), Malformed> {
        if self.body.len() > MAX_RECORD {
            return Err(Malformed);
        }
        out.push(kind);
        put(out, &(at.0.wrapping_sub(self.at.0) as i64))?;
        put(out, &self.body.len())?;
        self.at = at;
        let last = self.last.get(&kind).map_or(&[][..], Vec::as_slice);
        put_changes(out, last, &self.body)?;
        self.remember(kind);
        Ok(())
    }

    fn remember(&mut self, kind: u8) {
        let last = self.last.entry(kind).or_default();
        last.clear();
        if self.body.len() <= MAX_REMEMBERED {
            last.extend_from_slice(&self.body);
        }
    }

    fn forget(&mut self) {
        self.at = MonotonicNs(0);
        self.body.clear();
        // They keep their memory: what is empty compares as if it were not there.
        self.last.values_mut().for_each(Vec::clear);
    }
}

/// Appends `value` in postcard's format.
pub(super) fn put<T: Serialize>(out: &mut Vec<u8>, value: &T) -> Result<(), Malformed> {
    *out = postcard::to_extend(value, std::mem::take(out)).map_err(|_| Malformed)?;
    Ok(())
}

/// The value that `bytes` begin with, and the rest.
fn get<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<(T, &'a [u8]), Malformed> {
    postcard::take_from_bytes(bytes).map_err(|_| Malformed)
}

/// The value that `bytes` are.
fn whole<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, Malformed> {
    match get(bytes)? {
        (value, []) => Ok(value),
        _ => Err(Malformed),
    }
}

/// Appends how `now` differs from `before`, which counts as filled up with zeros. Repeated until the end: length of the
/// unchanged run, length of the new bytes, the new bytes.
fn put_changes(out: &mut Vec<u8>, before: &[u8], now: &[u8]) -> Result<(), Malformed> {
    let is_same = |at: usize| before.get(at).copied().unwrap_or(0) == now[at];
    let mut at = 0;
    while at < now.len() {
        let same = at;
        at += same_len(before.get(at..).unwrap_or_default(), &now[at..]);
        let first = at;
        let mut end = at;
        // Up to the last changed byte before a long run of equal ones.
        while at < now.len() && at - end <= SHORT_RUN {
            if !is_same(at) {
                end = at + 1;
            }
            at += 1;
        }
        at = end;
        put(out, &(first - same, end - first))?;
        out.extend_from_slice(&now[first..end]);
    }
    Ok(())
}

/// With how many bytes both begin that are the same, if `before` is filled up with zeros; most of them eight at a time.
fn same_len(before: &[u8], now: &[u8]) -> usize {
    let words = before.as_chunks::<8>().0.iter().zip(now.as_chunks::<8>().0);
    let at = 8 * words.take_while(|(a, b)| a == b).count();
    let filled = before[at..].iter().chain(std::iter::repeat(&0));
    at + filled.zip(&now[at..]).take_while(|(a, b)| a == b).count()
}

/// Makes of `before`, which is as long as the new bytes, what [`put_changes`] was given as `now`.
fn apply_changes(before: &mut [u8], mut changes: &[u8]) -> Result<(), Malformed> {
    let mut at = 0usize;
    while at < before.len() {
        let ((same, new), rest) = get::<(usize, &[u8])>(changes)?;
        changes = rest;
        if same == 0 && new.is_empty() {
            return Err(Malformed);
        }
        at = at.checked_add(same).ok_or(Malformed)?;
        let place = before
            .get_mut(at..)
            .and_then(|rest| rest.get_mut(..new.len()));
        place.ok_or(Malformed)?.copy_from_slice(new);
        at += new.len();
    }
    match changes {
        [] => Ok(()),
        _ => Err(Malformed),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    enum Input<'a> {
        Nothing,
        Bytes(&'a [u8]),
        Number(u64),
    }

    fn read(codec: &mut Codec, record: &[u8]) -> Result<(), Malformed> {
        let kind = codec.take(record)?;
        codec.entry::<Input<'_>, Input<'_>>(kind).map(drop)
    }

    /// The bytes that `docs/journal.md` gives as an example.
    #[test]
    fn records_are_written_as_the_document_says() {
        let mut codec = Codec::default();
        let at = MonotonicNs(300);
        type Put<'a> = &'a dyn Fn(&mut Codec, &mut Vec<u8>) -> Result<(), Malformed>;
        let mut put = |put: Put<'_>| {
            let mut out = Vec::new();
            put(&mut codec, &mut out).unwrap();
            out
        };
        let snapshot = put(&|codec, out| codec.put_snapshot(at, &[0, 0, 0, 7], out));
        assert_eq!(snapshot, [0x01, 0xD8, 0x04, 4, 3, 1, 7]);
        let later = MonotonicNs(301);
        let first = put(&|codec, out| codec.put_input(later, &Input::Bytes(b"abcde"), out));
        let bytes = [0x11, 2, 7, 0, 7, 1, 5, b'a', b'b', b'c', b'd', b'e'];
        assert_eq!(first, bytes);
        let second = put(&|codec, out| codec.put_input(at, &Input::Bytes(b"abcxe"), out));
        assert_eq!(second, [0x11, 1, 7, 5, 1, b'x', 1, 0]);
        let output = put(&|codec, out| codec.put_output(at, &Input::Nothing, out));
        assert_eq!(output, [0x20, 0, 1, 1, 0]);
        let line = LogLine {
            lost: 2,
            level: Level::WARN,
            module: "m",
            text: "ä",
        };
        let line = put(&|codec, out| codec.put_line(at, &line, out));
        let body = [2, 4, b'W', b'A', b'R', b'N', 1, b'm', 2, 0xC3, 0xA4];
        assert_eq!(line[..5], [0x30, 0, 11, 0, 11]);
        assert_eq!(line[5..], body);
        let mut reader = Codec::default();
        let read = [&snapshot, &first, &second, &output, &line].map(|record| {
            let kind = reader.take(record).unwrap();
            let entry = reader.entry::<Input<'_>, Input<'_>>(kind).unwrap();
            format!("{entry:?}")
        });
        assert_eq!(read[3], "Output(Nothing)");
        let kinds = read.map(|entry| entry.split('(').next().unwrap().to_owned());
        assert_eq!(kinds, ["Snapshot", "Input", "Input", "Output", "Line"]);
    }

    #[test]
    fn damaged_records_are_refused() {
        let table: [(&str, &[u8]); 12] = [
            ("none", &[]),
            ("a kind that there is not", &[0x7F, 0, 0]),
            ("the same with a body", &[0x40, 0, 1, 1, 0]),
            ("an input without a body", &[0x10, 0]),
            ("an input of no variant", &[0x13, 0, 1, 0, 1, 3]),
            ("an input that goes on", &[0x10, 0, 2, 2, 0]),
            ("changes that end early", &[0x10, 0, 1]),
            ("changes that go on", &[0x10, 0, 1, 1, 0, 0]),
            ("changes of no byte", &[0x10, 0, 1, 0, 0]),
            ("changes beyond the end", &[0x10, 0, 1, 1, 1, 0]),
            ("a level", &[0x30, 0, 5, 0, 5, 0, 1, b'9', 0, 0]),
            ("a text", &[0x30, 0, 6, 0, 6, 0, 1, b'1', 0, 1, 0xFF]),
        ];
        for (what, record) in table {
            assert_eq!(
                read(&mut Codec::default(), record),
                Err(Malformed),
                "{what}"
            );
        }
        let mut long = vec![0x10, 0];
        put(&mut long, &(MAX_RECORD + 1)).unwrap();
        put(&mut long, &(MAX_RECORD + 1, 0usize)).unwrap();
        assert_eq!(read(&mut Codec::default(), &long), Err(Malformed));
    }

    /// The bytes of an input behind another one of its kind, behind its kind, its time and its length.
    fn changes(before: &[u8], now: &[u8]) -> Vec<u8> {
        let mut codec = Codec::default();
        let mut record = Vec::new();
        for bytes in [before, now] {
            record.clear();
            let input = Input::Bytes(bytes);
            codec
                .put_input(MonotonicNs(0), &input, &mut record)
                .unwrap();
        }
        let (_, changes) = get::<(u8, i64, usize)>(&record).unwrap();
        changes.to_vec()
    }

    #[test]
    fn changes_at_the_limits_of_what_is_compared() {
        // The body begins with its variant and its length.
        let (before, first) = (b"abcdefgh", *b"XbcYefgh");
        let two = changes(before, &first);
        assert_eq!(two, [2, 4, b'X', b'b', b'c', b'Y', 4, 0], "a short run");
        let three = changes(before, b"XbcdYfgh");
        assert_eq!(three, [2, 1, b'X', 3, 1, b'Y', 3, 0]);
        // Of a longer body the next one stands alone.
        for (length, is_compared) in [(MAX_REMEMBERED - 3, true), (MAX_REMEMBERED - 2, false)] {
            let bytes = vec![7; length];
            assert_eq!(changes(&bytes, &bytes).len() < 10, is_compared, "{length}");
        }
        for (length, is_written) in [(MAX_RECORD, true), (MAX_RECORD + 1, false)] {
            let mut record = Vec::new();
            let snapshot = vec![7; length];
            let put = Codec::default().put_snapshot(MonotonicNs(0), &snapshot, &mut record);
            assert_eq!(put.is_ok(), is_written);
            if is_written {
                assert_eq!(read(&mut Codec::default(), &record), Ok(()));
            }
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            bodies in prop::collection::vec(prop::collection::vec(0u8..4, 0..300), 1..8),
            times: [u64; 8],
        ) {
            let (mut writer, mut reader) = (Codec::default(), Codec::default());
            for (bytes, at) in bodies.iter().zip(times) {
                let at = MonotonicNs(at);
                for input in [Input::Bytes(bytes), Input::Number(at.0), Input::Nothing] {
                    let mut record = Vec::new();
                    writer.put_input(at, &input, &mut record).unwrap();
                    let kind = reader.take(&record).unwrap();
                    prop_assert_eq!(reader.at(), at);
                    let entry = reader.entry::<Input<'_>, Input<'_>>(kind);
                    prop_assert_eq!(entry, Ok(Entry::Input(input)));
                }
            }
        }

        #[test]
        fn no_bytes_make_it_panic_or_keep_much(
            records in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..80), 0..16),
            kind in prop::sample::select(vec![SNAPSHOT, INPUT, INPUT + 1, INPUT + 2, OUTPUT, LINE]),
        ) {
            let mut codec = Codec::default();
            for mut record in records {
                let _ = read(&mut codec, &record);
                record.insert(0, kind);
                let _ = read(&mut codec, &record);
                prop_assert!(codec.body.len() <= MAX_RECORD);
                prop_assert!(codec.last.values().all(|body| body.len() <= MAX_REMEMBERED));
            }
        }
    }
}
