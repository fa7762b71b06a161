//! Stations that come, fall silent and are too many, and what is shown of them.

use super::*;
use crate::orders::message::NO_PLACE;
use crate::orders::robot::places::LIFE_KEPT;
use crate::orders::robot::{Config, Robot, SESSIONS};

const fn at(ms: u64) -> MonotonicNs {
    MonotonicNs(ms * 1_000_000)
}

fn none(_: u64) -> Option<OrderCounts> {
    None
}

/// The names that are shown, and why their requests are refused.
fn shown(rows: &[RelayStation]) -> Vec<(&str, Option<Reason>)> {
    let row = |row| -> (&str, Option<Reason>) {
        let row: &RelayStation = row;
        (row.name().unwrap(), row.refusal())
    };
    rows.iter().map(row).collect()
}

#[test]
fn stations_come_fall_silent_and_come_again() {
    let mut stations = Stations::new(Duration::from_millis(1000));
    assert!(stations.hear("gcs", 1, true, at(0)));
    assert!(!stations.hear("gcs", 1, true, at(500)));
    assert_eq!(stations.deadline(), Some(at(1500)));
    assert_eq!(stations.pass(at(1499)), Vec::<String>::new());
    assert_eq!(stations.pass(at(1500)), ["gcs"]);
    assert!(!stations.is_any_up() && stations.deadline().is_none());
    assert!(stations.hear("gcs", 1, true, at(2000)), "it is back");
    assert!(stations.hear("gcs", 2, true, at(2100)), "it was restarted");
}

#[test]
fn of_the_stations_that_are_not_heard_the_one_that_was_silent_longest_is_forgotten() {
    let mut stations = Stations::new(Duration::from_millis(1000));
    for index in 0..MAX_STATIONS as u64 {
        stations.hear(&format!("gcs-{index}"), index, false, at(index));
    }
    stations.pass(at(1002));
    assert!(stations.hear("new", 99, false, at(1002)));
    let rows = stations.rows(0, none);
    assert_eq!(rows.len(), MAX_STATIONS);
    assert_eq!(rows[0].last_heard_ns, at(1).0);
}

#[test]
fn stations_that_are_heard_keep_their_rows_however_many_there_are() {
    let mut stations = Stations::new(Duration::from_millis(1000));
    for ms in (0..60_000).step_by(500) {
        for index in 0..2 * MAX_STATIONS as u64 {
            let is_news = stations.hear(&format!("x{index}"), index, false, at(ms));
            let is_first = ms == 0 && index < MAX_STATIONS as u64;
            assert_eq!(is_news, is_first, "{index} at {ms} ms");
        }
        assert_eq!(stations.pass(at(ms)), Vec::<String>::new());
    }
    assert!(stations.hear("gcs", 99, true, at(60_000)), "it may command");
    let rows = stations.rows(0, none);
    assert_eq!(rows.len(), MAX_STATIONS);
    assert_eq!(shown(&rows)[MAX_STATIONS - 1].0, "gcs");
}

#[test]
fn a_made_up_name_takes_no_place_of_a_station_that_may_command() {
    let mut stations = Stations::new(Duration::from_millis(1000));
    stations.hear("gcs", 1, true, at(0));
    for index in 0..100 {
        stations.pass(at(2000 * index));
        stations.hear(&format!("x{index}"), index, false, at(2000 * index));
    }
    let rows = stations.rows(0, none);
    assert_eq!(rows.len(), MAX_STATIONS);
    assert_eq!(rows[0].may_command, 1);
    let mut full = Stations::new(Duration::from_millis(1000));
    for index in 0..MAX_STATIONS as u64 {
        full.hear(&format!("gcs-{index}"), index, true, at(index));
    }
    full.pass(at(5000));
    assert!(!full.hear("x", 99, false, at(5000)), "there is no room");
    assert!(full.hear("gcs-new", 99, true, at(5000)));
}

/// What the robot's side does with a clock message: the session that the station is told.
fn pong(
    (stations, lives, orders): (&mut Stations, &mut Lives, &mut Robot),
    life: u64,
    now: MonotonicNs,
) -> u64 {
    let name = format!("gcs-{life}");
    let _ = stations.hear(&name, life, true, now);
    assert!(lives.admit(life, &name, now));
    orders.session_for(life, now, &mut Vec::new())
}

#[test]
fn the_ninth_active_station_is_refused_and_shown_with_the_reason_until_a_place_is_free() {
    const ALL: u64 = SESSIONS as u64 + 1;
    let mut stations = Stations::new(Duration::from_millis(2500));
    let mut lives = Lives::default();
    let mut orders = Robot::new(Config::default(), 1);
    let mut first = Vec::new();
    for ms in (0..60_000).step_by(500) {
        let mut sessions = Vec::new();
        for life in 1..=ALL {
            let side = (&mut stations, &mut lives, &mut orders);
            sessions.push(pong(side, life, at(ms)));
        }
        assert_eq!(sessions.last(), Some(&NO_PLACE));
        if first.is_empty() {
            first.clone_from(&sessions);
        }
        assert_eq!(sessions, first, "no session is ever lost");
    }
    let rows = stations.rows(0, |life| orders.counts_of(life));
    let shown_rows = shown(&rows);
    assert_eq!(shown_rows.len(), SESSIONS + 1);
    assert_eq!(shown_rows[0], ("gcs-1", Some(Reason::None)));
    let refused = ("gcs-9", Some(Reason::RelayTooManyStations));
    assert_eq!(shown_rows[SESSIONS], refused);
    assert_eq!(lives.name_of(ALL), None);
    // The first one ends.
    let free = at(59_500) + LIFE_KEPT;
    for life in 2..ALL {
        pong((&mut stations, &mut lives, &mut orders), life, free);
    }
    stations.pass(free);
    assert!(pong((&mut stations, &mut lives, &mut orders), ALL, free) > NO_PLACE);
    let rows = stations.rows(0, |life| orders.counts_of(life));
    let shown_rows = shown(&rows);
    assert_eq!(shown_rows[0], ("gcs-1", Some(Reason::None)), "it is silent");
    assert_eq!(shown_rows[SESSIONS], ("gcs-9", Some(Reason::None)));
    assert_eq!(
        (lives.name_of(1), lives.name_of(ALL)),
        (None, Some("gcs-9"))
    );
}

#[test]
fn a_station_that_may_not_command_is_shown_with_that() {
    let mut stations = Stations::new(Duration::from_millis(1000));
    stations.hear("viewer", 1, false, at(0));
    let rows = stations.rows(0, none);
    assert_eq!(shown(&rows), [("viewer", Some(Reason::RelayNotPermitted))]);
}

#[test]
fn made_up_lives_push_out_no_life_that_is_heard() {
    let mut lives = Lives::default();
    assert!(lives.admit(1, "gcs", at(0)));
    let mut admitted = 0;
    for ms in 1..60_000 {
        if ms % 500 == 0 {
            assert!(lives.admit(1, "gcs", at(ms)), "{ms}");
        }
        let _ = lives.admit(1000 + ms, "gcs", at(ms));
        admitted += u64::from(lives.name_of(1000 + ms).is_some());
    }
    // Seven places, each for ten seconds.
    let most = 7 * 60_000 / LIFE_KEPT.as_millis() as u64 + 7;
    assert!(admitted <= most, "{admitted}");
    assert_eq!(lives.name_of(1), Some("gcs"));
    assert_eq!(lives.names.iter().count(), SESSIONS);
}

#[test]
fn a_life_that_is_silent_makes_room_and_no_other_station_can_take_it_over() {
    let mut lives = Lives::default();
    for life in 1..=SESSIONS as u64 {
        assert!(lives.admit(life, "gcs", at(life)));
    }
    let kept = LIFE_KEPT.as_millis() as u64;
    assert!(lives.admit(99, "gcs", at(kept)));
    assert_eq!(lives.name_of(99), None, "there was no place");
    assert!(lives.admit(99, "gcs", at(kept + 1)));
    assert_eq!((lives.name_of(1), lives.name_of(99)), (None, Some("gcs")));
    assert!(!lives.admit(99, "other", at(kept + 2)));
    assert_eq!(lives.name_of(99), Some("gcs"));
}
