//! Files that were mutated at random: each is read or refused, and whatever is read can be checked and written.

use std::path::Path;

use dsp_protocol::Waypoint;
use plans::check::check;
use plans::flight::Flight;
use plans::site::{Endurance, HomeSource, Site, Start};
use plans::timeline::timeline;
use plans::write::to_qgc_plan;
use proptest::prelude::*;

use super::files::bytes;

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

const HOME: Waypoint = Waypoint {
    latitude_deg: 37.411,
    longitude_deg: -6.001,
    altitude_m: 10.0,
};

/// Everything that is done with a plan.
fn use_plan(name: &str, text: &[u8]) {
    let Ok(plan) = plans::read(Path::new(name), text) else {
        return;
    };
    let site = Site {
        home: HOME,
        is_home_altitude_known: true,
        home_source: HomeSource::Operator,
        start: Start::Ground(HOME),
        zero_above_sea_m: None,
        take_off_m: Some(10.0),
        from: 1,
        is_for_flight: true,
    };
    let endurance = Endurance {
        cruise_speed_mps: Some(5.0),
        climb_speed_mps: None,
        endurance_s: Some(600.0),
        reserve_s: 60.0,
    };
    let flight = Flight::new(&plan, &site);
    let _ = timeline(&flight, &endurance);
    let findings = check(&plan, &flight, &site, None, &endurance);
    assert!(findings.iter().all(|finding| !finding.text.is_empty()));
    // Each item is flown, or named by a finding.
    for item in &plan.items {
        let is_named = findings
            .iter()
            .any(|finding| finding.items.contains(&item.number));
        assert!(
            flight.is_flown(item.number) || is_named,
            "{item:?}\n{findings:#?}"
        );
    }
    if let Ok(text) = to_qgc_plan(&plan) {
        plans::read(Path::new("x.plan"), text.as_bytes()).expect("what was written can be read");
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
