use std::time::Duration;

use ipc_types::payload::{STATUS_JOURNAL_ROOM, SharedStruct, StatusJournal};
use ipc_types::{JournalPiece, MonotonicNs, Topic};
use proptest::prelude::*;
use serde::{Deserialize, Serialize};
use tracing::Level;

use super::codec::put;
use super::{
    Break, CHECKPOINT, DELAY, Entry, JournalReader, JournalRecord, JournalWriter, LogLine,
    MAX_RECORD, MAX_WAITING, Malformed, Piece,
};

const START: MonotonicNs = MonotonicNs(1_000_000_000);

#[derive(Debug, Serialize, Deserialize)]
enum Input<'a> {
    Bytes(&'a [u8]),
}

/// The sample that a piece is published as.
fn sample(piece: &Piece, sequence: u64) -> StatusJournal {
    let mut sample = StatusJournal::default();
    sample.fill(0, piece.begins, piece.beginnings, &piece.bytes);
    sample.stamp(sequence, 1);
    sample
}

fn started() -> JournalWriter {
    let mut writer = JournalWriter::new(STATUS_JOURNAL_ROOM);
    writer.start();
    writer
}

fn write(writer: &mut JournalWriter, now: MonotonicNs, record: &[u8]) {
    writer.input(now, &Input::Bytes(record));
}

/// All whole records that a reader finds after it took `piece`.
fn read(reader: &mut JournalReader, piece: &StatusJournal) -> (Option<Break>, Vec<Vec<u8>>) {
    let broken = reader.take(piece);
    let mut records = Vec::new();
    while let Some(record) = next(reader).expect("no damage") {
        records.push(record);
    }
    (broken, records)
}

/// The bytes of the next snapshot or input.
fn next(reader: &mut JournalReader) -> Result<Option<Vec<u8>>, Malformed> {
    let record: Option<JournalRecord<'_, Input<'_>, ()>> = reader.next()?;
    Ok(record.map(|record| match record.entry {
        Entry::Snapshot(bytes) | Entry::Input(Input::Bytes(bytes)) => bytes.to_vec(),
        entry => panic!("nobody has written {entry:?}"),
    }))
}

#[test]
fn a_writer_that_is_off_takes_nothing() {
    let mut writer = JournalWriter::new(STATUS_JOURNAL_ROOM);
    assert!(!writer.wants_snapshot(START) && !writer.is_on());
    writer.snapshot(START, b"snapshot");
    write(&mut writer, START, b"record");
    assert_eq!(writer.next(START + 2 * DELAY), None);
    assert_eq!(writer.deadline(), None);
}

#[test]
fn a_journal_begins_with_a_snapshot_and_waits_a_moment_for_more() {
    let mut writer = started();
    write(&mut writer, START, b"too early");
    assert!(writer.wants_snapshot(START));
    writer.snapshot(START, b"snapshot");
    assert!(!writer.wants_snapshot(START));
    write(&mut writer, START + DELAY / 2, b"record");
    assert_eq!(writer.next(START + DELAY / 2), None);
    assert_eq!(writer.deadline(), Some(START + DELAY));
    let piece = writer.next(START + DELAY).unwrap();
    assert_eq!(
        (writer.waiting(), writer.next(START + 2 * DELAY)),
        (0, None)
    );
    assert!(piece.begins);
    assert_eq!(piece.beginnings, 1);
    let (broken, records) = read(&mut JournalReader::new(), &sample(&piece, 1));
    assert_eq!(broken, None);
    assert_eq!(records, [b"snapshot".to_vec(), b"record".to_vec()]);
}

#[test]
fn an_output_has_the_time_of_its_input_and_a_line_its_own() {
    let mut writer = started();
    writer.snapshot(START, b"snapshot");
    let later = START + DELAY;
    write(&mut writer, later, b"input");
    writer.output(&Input::Bytes(b"output"));
    let line = LogLine {
        lost: 0,
        level: Level::WARN,
        module: "m",
        text: "line",
    };
    writer.line(later, START, &line);
    let mut reader = JournalReader::new();
    reader.take(&sample(&writer.take_all().next().unwrap(), 1));
    let mut found = Vec::new();
    while let Some(record) = reader.next::<Input<'_>, Input<'_>>().unwrap() {
        found.push((
            record.at,
            match record.entry {
                Entry::Snapshot(bytes) => ("snapshot", bytes.to_vec()),
                Entry::Input(Input::Bytes(bytes)) => ("input", bytes.to_vec()),
                Entry::Output(Input::Bytes(bytes)) => ("output", bytes.to_vec()),
                Entry::Line(line) => ("line", line.text.into()),
            },
        ));
    }
    let expected = [
        (START, "snapshot"),
        (later, "input"),
        (later, "output"),
        (START, "line"),
    ];
    let expected = expected.map(|(at, kind)| (at, (kind, kind.as_bytes().to_vec())));
    assert_eq!(found, expected);
}

#[test]
fn a_record_may_be_longer_than_a_piece() {
    let long: Vec<u8> = (0..5000u32).map(|index| index as u8).collect();
    let mut writer = started();
    writer.snapshot(START, &long);
    write(&mut writer, START, b"after");
    let (mut reader, mut records) = (JournalReader::new(), Vec::new());
    for (piece, sequence) in writer.take_all().zip(1..) {
        assert!(piece.bytes.len() <= STATUS_JOURNAL_ROOM);
        records.extend(read(&mut reader, &sample(&piece, sequence)).1);
    }
    assert_eq!(records, [long, b"after".to_vec()]);
}

#[test]
fn another_snapshot_comes_when_it_is_time_and_enough_was_written() {
    let mut writer = started();
    writer.snapshot(START, &[7; 1000]);
    let later = START + CHECKPOINT;
    write(&mut writer, later, &[1; 3000]);
    assert!(!writer.wants_snapshot(later), "three times its bytes");
    write(&mut writer, later, &[2; 1100]);
    assert!(!writer.wants_snapshot(START + CHECKPOINT / 2));
    assert!(writer.wants_snapshot(later));
    writer.snapshot(later, &[8; 1000]);
    assert!(!writer.wants_snapshot(later + Duration::from_secs(1)));
    let begins: Vec<_> = writer.take_all().filter(|piece| piece.begins).collect();
    assert_eq!(begins.len(), 2);
    assert_eq!(begins[1].beginnings, 1, "the journal goes on");
}

#[test]
fn a_reader_that_comes_gets_a_snapshot_and_breaks_nothing() {
    let mut writer = started();
    writer.snapshot(START, b"first");
    write(&mut writer, START, b"one");
    writer.ask_for_snapshot();
    assert!(writer.wants_snapshot(START));
    writer.snapshot(START, b"second");
    assert!(!writer.wants_snapshot(START));
    write(&mut writer, START, b"two");
    let (mut reader, mut late, mut records) =
        (JournalReader::new(), JournalReader::new(), Vec::new());
    for (piece, sequence) in writer.take_all().zip(1..) {
        let piece = sample(&piece, sequence);
        let (broken, found) = read(&mut reader, &piece);
        assert_eq!(broken, None);
        records.extend(found);
        if sequence > 1 {
            assert_eq!(read(&mut late, &piece).1.len(), 2);
        }
    }
    assert_eq!(records.len(), 4);
    let mut off = JournalWriter::new(STATUS_JOURNAL_ROOM);
    off.ask_for_snapshot();
    assert!(!off.wants_snapshot(START));
}

#[test]
fn a_loss_is_noticed_and_reading_goes_on_at_the_next_snapshot() {
    let mut writer = started();
    let mut samples = Vec::new();
    for round in 0..3u8 {
        let now = START + u32::from(round) * CHECKPOINT;
        writer.snapshot(now, &[round; 10]);
        for record in 0..4 {
            write(&mut writer, now, &[100 + record; 900]);
        }
    }
    samples.extend(
        writer
            .take_all()
            .zip(1..)
            .map(|(piece, n)| sample(&piece, n)),
    );
    let begins: Vec<_> = samples.iter().map(|piece| piece.begins()).collect();
    assert_eq!(begins[..6], [true, false, false, false, true, false]);

    let mut reader = JournalReader::new();
    let (broken, records) = read(&mut reader, &samples[0]);
    assert_eq!((broken, records.len()), (None, 2));
    // A piece that was there before changes nothing.
    assert_eq!(read(&mut reader, &samples[0]), (None, vec![]));
    let (broken, records) = read(&mut reader, &samples[3]);
    assert_eq!((broken, records.len()), (Some(Break::Lost(2)), 0));
    let (broken, records) = read(&mut reader, &samples[4]);
    assert_eq!(broken, None);
    assert_eq!(records[0], [1; 10]);
    assert_eq!(reader.lost(), 2);
}

#[test]
fn what_waits_is_bounded_and_the_journal_begins_again() {
    let mut writer = started();
    writer.snapshot(START, b"first");
    for byte in 1..=MAX_WAITING / (MAX_RECORD / 2) + 1 {
        write(&mut writer, START, &vec![byte as u8; MAX_RECORD / 2]);
    }
    assert_eq!(writer.losses(), 1);
    assert!(writer.wants_snapshot(START) && !writer.is_on());
    writer.snapshot(START, b"second");
    let pieces: Vec<_> = writer.take_all().collect();
    assert_eq!(pieces.len(), 1);
    assert_eq!((pieces[0].begins, pieces[0].beginnings), (true, 2));
    write(&mut writer, START, &vec![1; MAX_RECORD + 1]);
    assert_eq!(writer.losses(), 2, "a record that is too long");
}

#[test]
fn the_longest_record_and_all_that_may_wait_are_taken_to_the_last_byte() {
    // The longest snapshot that is taken, of about so many bytes.
    let longest = |before: &JournalWriter, about: usize| {
        let mut lengths = (about - 40..=about).rev();
        let taken = lengths.find_map(|length| {
            let mut writer = before.clone();
            writer.snapshot(START, &vec![7; length]);
            (writer.losses() == 0).then_some((length, writer))
        });
        taken.unwrap()
    };
    let (length, mut one) = longest(&started(), MAX_RECORD);
    // The length of a record stands before it.
    assert_eq!(one.waiting(), MAX_RECORD + 4);
    let left = MAX_WAITING - one.waiting();
    let (_, two) = longest(&one, left);
    assert_eq!(two.waiting() - one.waiting(), left + 3);
    let (mut reader, mut found) = (JournalReader::new(), Vec::new());
    for (piece, sequence) in one.take_all().zip(1..) {
        found.extend(read(&mut reader, &sample(&piece, sequence)).1);
    }
    assert_eq!(found, [vec![7; length]]);
}

#[test]
fn another_snapshot_comes_with_the_last_byte_of_its_share() {
    let mut writer = started();
    writer.snapshot(START, &[7; 1000]);
    // Its length takes two bytes.
    let (share, before) = (4 * (writer.waiting() - 2), writer.waiting());
    let mut seen = Vec::new();
    for length in share - 30..share {
        let mut other = writer.clone();
        write(&mut other, START, &vec![1; length]);
        let written = other.waiting() - before;
        let is_wanted = other.wants_snapshot(START + CHECKPOINT);
        assert_eq!(is_wanted, written >= share, "{written} of {share}");
        seen.push(written);
    }
    assert!(seen.contains(&share) && seen.contains(&(share - 1)));
}

#[test]
fn the_memory_of_a_piece_that_was_published_is_used_again() {
    const MUCH: usize = 100_000;
    let mut writer = started();
    let bytes = Vec::with_capacity(MUCH);
    let piece = Piece {
        bytes,
        ..Piece::default()
    };
    writer.give_back(piece);
    (0..3).for_each(|_| writer.snapshot(START, b"snapshot"));
    assert!(
        writer
            .take_all()
            .any(|piece| piece.bytes.capacity() >= MUCH)
    );
}

#[test]
fn another_process_and_another_beginning_are_breaks() {
    let piece = |epoch_ns, sequence, beginnings| {
        let bytes = vec![3, 0x10, 0, 0];
        let piece = Piece {
            begins: false,
            beginnings,
            bytes,
        };
        let mut sample = sample(&piece, sequence);
        sample.epoch_ns = epoch_ns;
        sample
    };
    let mut reader = JournalReader::new();
    let table = [
        (piece(1, 5, 1), None),
        (piece(1, 6, 1), None),
        (piece(1, 7, 2), Some(Break::BegunAgain)),
        (piece(2, 1, 1), Some(Break::Restarted)),
        (piece(2, 4, 1), Some(Break::Lost(2))),
    ];
    for (piece, broken) in table {
        assert_eq!(reader.take(&piece), broken);
        assert_eq!(next(&mut reader), Ok(None), "no snapshot was seen");
    }
}

#[test]
fn a_length_that_no_record_has_is_damage() {
    let mut writer = started();
    writer.snapshot(START, b"first");
    let mut piece = writer.take_all().next().unwrap();
    put(&mut piece.bytes, &(MAX_RECORD + 1)).unwrap();
    let mut reader = JournalReader::new();
    reader.take(&sample(&piece, 1));
    assert_eq!(next(&mut reader), Ok(Some(b"first".to_vec())));
    assert_eq!(next(&mut reader), Err(Malformed));
    assert_eq!(next(&mut reader), Ok(None));
}

proptest! {
    #[test]
    fn records_come_back_whatever_their_lengths(
        records in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..2500), 1..20),
    ) {
        let mut writer = started();
        writer.snapshot(START, &records[0]);
        for record in &records[1..] {
            write(&mut writer, START, record);
        }
        let (mut reader, mut found) = (JournalReader::new(), Vec::new());
        for (piece, sequence) in writer.take_all().zip(1..) {
            found.extend(read(&mut reader, &sample(&piece, sequence)).1);
        }
        prop_assert_eq!(found, records);
    }

    #[test]
    fn no_bytes_make_a_reader_panic_or_keep_more_than_a_record(
        pieces in prop::collection::vec(
            (any::<bool>(), 0u32..3, 0u64..9, prop::collection::vec(any::<u8>(), 0..60)),
            0..40,
        ),
    ) {
        let mut reader = JournalReader::new();
        for (begins, beginnings, sequence, bytes) in pieces {
            let piece = Piece { begins, beginnings, bytes };
            reader.take(&sample(&piece, sequence));
            while let Ok(Some(record)) = reader.next::<Input<'_>, Input<'_>>() {
                if let Entry::Snapshot(bytes) = record.entry {
                    prop_assert!(bytes.len() <= MAX_RECORD);
                }
            }
        }
    }
}

#[test]
fn a_piece_is_as_large_as_its_topic_says() {
    assert_eq!(StatusJournal::LAYOUT.size, STATUS_JOURNAL_ROOM + 40);
    assert_eq!(<StatusJournal as JournalPiece>::ROOM, STATUS_JOURNAL_ROOM);
    assert_eq!(StatusJournal::KEY, "status/journal");
}
