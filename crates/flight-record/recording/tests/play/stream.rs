//! A flight as a stream, from any place on.

use std::fs;
use std::path::PathBuf;

use recording::play::{FlightError, FlightStream};

use super::made::{Made, START_MS};

fn written(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.mcap");
    fs::write(&path, bytes).expect("a file");
    (folder, path)
}

/// The times of the rest, ms since the beginning, and the values.
fn rest(stream: &mut FlightStream) -> Vec<(u64, u64)> {
    let mut found = Vec::new();
    while let Some(item) = stream.next() {
        if let Ok((at, message)) = item {
            let value = message.data()[4 + 24..].first_chunk().expect("a sample");
            found.push((at.0 / 1_000_000 - START_MS, u64::from_le_bytes(*value)));
        }
    }
    found
}

fn long() -> Vec<u8> {
    let mut made = Made::new();
    let values = made.values("/robot7/a");
    let others = made.values("/robot8/a");
    // Several chunks.
    for ms in 0..20_000 {
        made.value(values, ms, ms.max(1), ms);
        if ms % 100 == 0 {
            made.value(others, ms, ms.max(1), 0);
        }
    }
    made.file()
}

#[test]
fn it_goes_on_from_each_mark_with_the_same_messages() {
    let (_folder, path) = written(&long());
    let mut stream = FlightStream::open(&path).unwrap();
    assert_eq!(stream.robot().get(), 7);
    let begin = stream.mark();
    let whole = rest(&mut stream);
    let expected: Vec<(u64, u64)> = (0..20_000).map(|ms| (ms, ms)).collect();
    assert_eq!(whole, expected, "the other robot is left out");
    stream.go_to(begin);
    let mut marks = Vec::new();
    for index in 0..20_000 {
        if index % 1777 == 0 {
            marks.push((index, stream.mark()));
        }
        stream.next();
    }
    assert!(stream.next().is_none());
    for (index, mark) in marks.into_iter().rev() {
        stream.go_to(mark);
        assert_eq!(stream.mark(), mark);
        assert_eq!(rest(&mut stream), expected[index..], "{index}");
    }
}

#[test]
fn behind_a_damaged_place_it_goes_on_however_often_it_is_passed() {
    let mut bytes = long();
    let within = bytes.len() / 10;
    bytes[within] ^= 1;
    let (_folder, path) = written(&bytes);
    let mut stream = FlightStream::open(&path).unwrap();
    let begin = stream.mark();
    let first = rest(&mut stream);
    assert!((1..20_000).contains(&first.len()), "{}", first.len());
    assert_eq!(first.last(), Some(&(19_999, 19_999)));
    for _ in 0..10 {
        stream.go_to(begin);
        assert_eq!(rest(&mut stream), first);
    }
}

#[test]
fn a_file_without_samples_of_a_robot_is_no_flight() {
    let mut made = Made::new();
    let values = made.values("/elsewhere");
    made.value(values, 0, 1, 1);
    let (_folder, path) = written(&made.file());
    assert!(matches!(
        FlightStream::open(&path),
        Err(FlightError::NoSamples)
    ));
    let (_folder, path) = written(b"anything");
    assert!(matches!(
        FlightStream::open(&path),
        Err(FlightError::Read(_))
    ));
    let (_folder, path) = written(&[]);
    assert!(matches!(
        FlightStream::open(&path),
        Err(FlightError::Read(_))
    ));
}
