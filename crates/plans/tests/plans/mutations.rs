//! Files that were mutated at random: each is read or refused, and whatever is read can be checked and written.

use std::path::Path;

use proptest::prelude::*;

use super::files::bytes;
use super::reading::use_plan;

const CORPUS: &str = "../../workbench/fuzz/corpus";

const FILES: [&str; 6] = [
    "mission.plan",
    "version1.plan",
    "mission.waypoints",
    "field.geojson",
    "field.kml",
    "route.gpx",
];

/// Text that is likely to be understood, or to break something.
const PIECES: [&str; 18] = [
    "null", "NaN", "1e400", "-1", "0", "65536", "\"", "{", "}", "[", "]", "<", "</", ">", "\t",
    "\n", "&x;", "\u{0}",
];

#[derive(Clone, Debug)]
enum Mutation {
    Replace(usize, u8),
    Insert(usize, usize),
    Remove(usize, usize),
    Repeat(usize, usize),
    /// The number at or after this place becomes that one.
    Number(usize, f64),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let place = any::<usize>;
    prop_oneof![
        (place(), any::<u8>()).prop_map(|(at, byte)| Mutation::Replace(at, byte)),
        (place(), 0..PIECES.len()).prop_map(|(at, piece)| Mutation::Insert(at, piece)),
        (place(), 1..40_usize).prop_map(|(at, count)| Mutation::Remove(at, count)),
        (place(), 1..400_usize).prop_map(|(at, count)| Mutation::Repeat(at, count)),
        (place(), prop_oneof![any::<f64>(), -200.0..200.0])
            .prop_map(|(at, number)| Mutation::Number(at, number)),
    ]
}

fn mutate(text: &mut Vec<u8>, mutation: &Mutation) {
    let place = |at: usize| at % text.len().max(1);
    match *mutation {
        _ if text.is_empty() => {}
        Mutation::Replace(at, byte) => {
            let at = place(at);
            text[at] = byte;
        }
        Mutation::Insert(at, piece) => {
            let at = place(at);
            text.splice(at..at, PIECES[piece].bytes());
        }
        Mutation::Remove(at, count) => {
            let at = place(at);
            text.drain(at..(at + count).min(text.len()));
        }
        Mutation::Repeat(at, count) => {
            let at = place(at);
            let part = text[at..(at + count).min(text.len())].to_vec();
            text.splice(at..at, part);
        }
        Mutation::Number(at, number) => {
            let is_digit = |byte: &u8| byte.is_ascii_digit() || b"-.".contains(byte);
            let at = place(at);
            let Some(begin) = text[at..].iter().position(is_digit) else {
                return;
            };
            let begin = at + begin;
            let length = text[begin..]
                .iter()
                .take_while(|byte| is_digit(byte))
                .count();
            text.splice(begin..begin + length, number.to_string().bytes());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_file_is_too_strange(
        file in 0..FILES.len(),
        mutations in proptest::collection::vec(mutation(), 0..6),
    ) {
        let mut text = bytes(FILES[file]);
        for mutation in &mutations {
            mutate(&mut text, mutation);
        }
        use_plan(FILES[file], &text);
    }
}

#[test]
fn every_beginning_of_a_file_is_read_or_refused() {
    for name in FILES {
        let text = bytes(name);
        for end in (0..text.len()).step_by(7) {
            use_plan(name, &text[..end]);
        }
    }
}

/// The files of the fuzz targets are read by every test run, without the tool.
#[test]
fn the_corpus_of_each_reader_is_read_or_refused() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join(CORPUS);
    for (target, name) in [
        ("plan_qgc", "x.plan"),
        ("plan_list", "x.waypoints"),
        ("plan_geojson", "x.geojson"),
        ("plan_kml", "x.kml"),
        ("plan_gpx", "x.gpx"),
    ] {
        let files = std::fs::read_dir(corpus.join(target)).expect("a corpus");
        let count = files
            .map(|file| use_plan(name, &std::fs::read(file.unwrap().path()).unwrap()))
            .count();
        assert!(count >= 3, "{target}: {count} files are no corpus");
    }
}
