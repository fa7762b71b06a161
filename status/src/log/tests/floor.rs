//! The room on the disk that is left to other programs.

use super::*;

const FLOOR: u64 = 8000;

fn flight(free_bytes: u64) -> Flight {
    let disk = MemoryStore::default();
    disk.0.borrow_mut().free_bytes = free_bytes;
    let limits = Limits {
        min_free_bytes: FLOOR,
        ..UNLIMITED
    };
    Flight::begin(disk, limits)
}

fn set_free(flight: &Flight, bytes: u64) {
    flight.disk.0.borrow_mut().free_bytes = bytes;
}

#[test]
fn below_the_floor_the_log_pauses_with_one_warning_and_goes_on_above_it() {
    let mut flight = flight(FLOOR);
    flight.fly(100);
    assert_eq!(flight.reported(), ["opened"], "the floor itself is enough");
    let before = flight.disk.0.borrow().total_bytes();

    set_free(&flight, FLOOR - 1);
    flight.fly(50 * 120);
    assert_eq!(flight.reported(), ["paused", "rows lost", "rows lost"]);
    let paused = flight.disk.0.borrow().total_bytes();
    assert!(paused - before < 10_000, "only what was on its way");

    // At the floor it would stop again at once.
    set_free(&flight, FLOOR + FLOOR / 8 - 1);
    flight.fly(50 * 20);
    assert!(
        !flight
            .reported()
            .iter()
            .any(|word| word.contains("resumed"))
    );

    set_free(&flight, FLOOR + FLOOR / 8);
    flight.fly(50 * 20);
    let reported = flight.reported();
    let lost = flight.land().lost;
    assert!(reported.contains(&"resumed".to_owned()));
    assert!(
        !reported.contains(&"opened".to_owned()),
        "the same file goes on"
    );
    let runs = runs(&all_sequences(&flight.disk));
    let [(1, kept), (resumed, last)] = runs[..] else {
        panic!("{runs:?}");
    };
    assert_eq!((resumed - kept - 1, last), (lost, flight.samples));
}

#[test]
fn a_short_want_of_room_loses_nothing() {
    let mut flight = flight(u64::MAX);
    flight.fly(100);
    set_free(&flight, 0);
    flight.fly(50 * 5);
    set_free(&flight, u64::MAX);
    flight.fly(50 * 5);
    assert_eq!(flight.reported(), ["opened", "paused", "resumed"]);
    let Landed { written, lost } = flight.land();
    assert_eq!((written.files, lost), (1, 0));
}

#[test]
fn nothing_is_created_below_the_floor() {
    let mut flight = flight(FLOOR - 1);
    flight.fly(100);
    assert_eq!(flight.reported(), ["paused"]);
    assert!(flight.disk.0.borrow().files.is_empty());
    let Landed { written, lost } = flight.land();
    assert_eq!((written.files, lost), (0, 100));
    assert!(flight.disk.0.borrow().files.is_empty());
}
