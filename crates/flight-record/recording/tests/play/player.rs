//! What is due when.

use std::sync::Arc;
use std::time::Duration;

use ipc_types::MonotonicNs;
use recording::play::{EmptySection, PlayableFlight, PlayedContent, Player, Section};

use crate::made::Made;

const NOW_MS: u64 = 1_000_000;

fn at(ms: u64) -> MonotonicNs {
    MonotonicNs((NOW_MS + ms) * 1_000_000)
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Values 0 to 10 every 100 ms, each 1 ms after it was measured; a second topic with the value 100 at 150 ms.
fn flight() -> Arc<PlayableFlight> {
    let mut made = Made::new();
    let (one, two) = (made.values("/robot7/a/one"), made.values("/robot7/a/two"));
    for value in 0..=10 {
        made.value(one, value * 100 + 10, value * 100 + 9, value);
        if value == 1 {
            made.value(two, 150, 0, 100);
        }
    }
    Arc::new(made.flight())
}

/// What a player plays in virtual time until `end_ms`: ms and value, by waking at its deadlines alone.
fn played(player: &mut Player, from_ms: u64, end_ms: u64) -> Vec<(u64, u8)> {
    let mut now = at(from_ms);
    let mut played = Vec::new();
    loop {
        played.extend(
            due(player, now)
                .into_iter()
                .map(|value| (now.0 / 1_000_000 - NOW_MS, value)),
        );
        match player.deadline().filter(|next| *next <= at(end_ms)) {
            Some(next) => now = now.max(next),
            None => return played,
        }
    }
}

fn due(player: &mut Player, now: MonotonicNs) -> Vec<u8> {
    let mut values = Vec::new();
    while let Some(due) = player.next(now) {
        let flight = Arc::clone(player.flight());
        if let Some(PlayedContent::Sample(_, sample)) = flight.content(due.index) {
            let mut sample = sample.to_vec();
            due.timeline.translate(&mut sample, &[16], now);
            values.push(sample[24]);
        }
    }
    values
}

#[test]
fn a_flight_is_played_in_its_order_at_its_pace() {
    let whole = Section::default();
    for (speed, times) in [
        (1.0, [0, 100, 140, 200, 300]),
        (10.0, [0, 10, 14, 20, 30]),
        (0.5, [0, 200, 280, 400, 600]),
    ] {
        let section = Section { speed, ..whole };
        let mut player = Player::new(flight(), section, at(0)).expect("messages");
        let all = played(&mut player, 0, 1_000_000);
        assert_eq!(all.len(), 12);
        let expected: Vec<_> = times.into_iter().zip([0, 1, 100, 2, 3]).collect();
        assert_eq!(all[..5], expected);
        assert!(player.is_ended());
        assert_eq!((player.deadline(), player.next_position()), (None, None));
        assert_eq!(player.end(), ms(1000));
    }
}

#[test]
fn moments_are_as_old_as_they_were() {
    let section = Section {
        from: ms(450),
        ..Section::default()
    };
    let mut player = Player::new(flight(), section, at(0)).expect("messages");
    let mut ages = Vec::new();
    while let Some(next) = player.deadline() {
        let now = next.max(at(0));
        while let Some(due) = player.next(now) {
            let flight = Arc::clone(player.flight());
            let Some(PlayedContent::Sample(0, sample)) = flight.content(due.index) else {
                continue;
            };
            let mut sample = sample.to_vec();
            due.timeline.translate(&mut sample, &[16], now);
            let moment = u64::from_le_bytes(*sample[16..].first_chunk().expect("a moment"));
            ages.push((now.0 - moment) / 1_000_000);
        }
    }
    // The first one is that before the section.
    assert_eq!(ages, [51, 1, 1, 1, 1, 1, 1]);
}

#[test]
fn a_section_begins_with_the_latest_sample_of_each_topic() {
    let section = Section {
        from: ms(450),
        to: Some(ms(600)),
        ..Section::default()
    };
    let mut player = Player::new(flight(), section, at(0)).expect("messages");
    assert_eq!(
        played(&mut player, 0, 10_000),
        [(0, 100), (0, 4), (50, 5), (150, 6)]
    );
    let empty = Section {
        from: ms(1001),
        ..Section::default()
    };
    let error = Player::new(flight(), empty, at(0)).expect_err("no messages");
    assert_eq!(error, EmptySection { length: ms(1000) });
    assert_eq!(
        error.to_string(),
        "there is no message in this section: the flight has 1.000 s"
    );
}

#[test]
fn a_loop_begins_again_for_ever() {
    let section = Section {
        from: ms(900),
        is_looped: true,
        ..Section::default()
    };
    let mut player = Player::new(flight(), section, at(0)).expect("messages");
    let all = played(&mut player, 0, 450);
    let lap = |start: u64| [(start, 100), (start, 8), (start, 9), (start + 100, 10)];
    assert_eq!(all, [lap(0), lap(200), lap(400)].concat()[..11]);
    assert_eq!((player.laps(), player.is_ended()), (2, false));
}

#[test]
fn a_pause_stops_time_and_steps_go_one_by_one() {
    let mut player = Player::new(flight(), Section::default(), at(0)).expect("messages");
    assert_eq!(played(&mut player, 0, 110), [(0, 0), (100, 1)]);
    player.toggle_pause(at(120));
    assert!(player.is_paused());
    assert_eq!(
        (player.deadline(), player.position(at(5_000))),
        (None, ms(120))
    );
    assert_eq!(due(&mut player, at(5_000)), []);
    for (now, value, position) in [(6_000, 100, 140), (7_000, 2, 200)] {
        player.step(at(now));
        assert_eq!(player.deadline(), Some(MonotonicNs(0)), "at once");
        assert_eq!(due(&mut player, at(now)), [value]);
        assert_eq!(player.position(at(now + 500)), ms(position));
    }
    player.toggle_pause(at(8_000));
    assert_eq!(played(&mut player, 8_000, 8_250), [(8_100, 3), (8_200, 4)]);
    // A step while it plays stops there.
    player.step(at(8_250));
    assert_eq!(due(&mut player, at(9_000)), [5]);
    assert!(player.is_paused());
    for _ in 0..5 {
        player.step(at(9_000));
    }
    assert_eq!(due(&mut player, at(9_000)), [6, 7, 8, 9, 10]);
    player.step(at(9_000));
    assert!(player.is_ended() && due(&mut player, at(9_000)).is_empty());
}

#[test]
fn what_comes_much_too_late_does_not_come_at_once() {
    let mut player = Player::new(flight(), Section::default(), at(0)).expect("messages");
    assert_eq!(due(&mut player, at(0)), [0]);
    // Late by less: all of it, at once.
    assert_eq!(due(&mut player, at(340)), [1, 100, 2, 3]);
    // The process was suspended.
    assert_eq!(due(&mut player, at(10_000)), [4]);
    assert_eq!(
        played(&mut player, 10_000, 10_250),
        [(10_100, 5), (10_200, 6)]
    );
}
