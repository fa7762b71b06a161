//! A station at the other end of a narrow link, from the moment it is connected: its [`RobotLink`] measures, the
//! robot's pace follows.
//!
//! The link is QUIC's worst case: it keeps all that waits, and samples, which are datagrams, pass before answers.

use std::collections::VecDeque;

use super::*;
use crate::message::{Ping, Pong, Service, ServicesPage};
use crate::station::RobotLink;
use crate::telemetry::{SampleSender, Selection};

/// Instances of both relays.
const ROBOT: u64 = 1;
const STATION: u64 = 2;

/// One way, ms.
const DELAY_MS: u64 = 100;

/// The other way from the 100th second on: another 0.4 s there and back.
const LONGER_FROM_MS: u64 = 100_000;
const LONGER_MS: u64 = 300;

fn delay_ms(ms: u64) -> u64 {
    match ms < LONGER_FROM_MS {
        true => DELAY_MS,
        false => LONGER_MS,
    }
}

/// Bytes of a question, an order, an answer or a report, with all headers.
const MESSAGE: u64 = 200;

/// What comes to the station.
#[derive(Debug)]
enum Passing {
    /// By when the robot had it.
    Sample(u64),
    Pong(Pong),
    Part(crate::message::Part),
    /// By when it was ordered.
    Report(u64),
}

/// The way from the robot to the station.
struct Way {
    bytes_per_ms: u64,
    /// Samples, and all others.
    waiting: [VecDeque<(u64, Passing)>; 2],
    /// When what left last has left.
    free_ms: u64,
    passing: VecDeque<(u64, Passing)>,
}

impl Way {
    fn send(&mut self, bytes: u64, what: Passing) {
        let others = usize::from(!matches!(what, Passing::Sample(_)));
        self.waiting[others].push_back((bytes, what));
    }

    /// What arrives by then.
    fn pass(&mut self, ms: u64) -> Option<Passing> {
        while self.free_ms <= ms
            && let Some((bytes, what)) = self.waiting.iter_mut().find_map(VecDeque::pop_front)
        {
            self.free_ms = self.free_ms.max(ms) + bytes / self.bytes_per_ms;
            self.passing.push_back((self.free_ms + delay_ms(ms), what));
        }
        let arrives = self.passing.front().is_some_and(|(at, _)| *at <= ms);
        arrives.then(|| self.passing.pop_front().expect("it is there").1)
    }
}

/// What a station saw, ms.
#[derive(Debug, Default)]
struct Seen {
    up_after: u64,
    outages: u32,
    orders: Vec<u64>,
    /// Ages of the samples of the last thirty seconds.
    ages: Vec<u64>,
}

/// A robot whose topics take 34 kB/s, and a station that orders something twice a second when it is up, for so long.
fn fly(bytes_per_ms: u64, seconds: u64) -> Seen {
    let mut random = fastrand::Rng::with_seed(1);
    let described = Service {
        key: "a".to_owned(),
        takes_requests: false,
        // 7 kB when it is packed.
        schema: (0..9000).map(|_| random.alphanumeric()).collect(),
    };
    let pages = ServicesPage::of(&[described]);
    // Length and period of each topic.
    let topics = [(184, 20), (256, 20), (500, 1000), (700, 1000), (900, 1000)];
    let mut senders = topics.map(|_| SampleSender::new(ROBOT, Selection::All));
    let (mut pace, mut first) = (Pace::default(), 0);
    let mut link = RobotLink::new(STATION, Duration::from_millis(2500), at(0));
    let mut way = Way {
        bytes_per_ms,
        waiting: Default::default(),
        free_ms: 0,
        passing: VecDeque::new(),
    };
    let mut to_robot: VecDeque<(u64, Result<Ping, Passing>)> = VecDeque::new();
    let mut seen = Seen::default();
    pace.note_newcomer(at(0));
    for ms in 1..seconds * 1000 {
        let now = at(ms);
        while let Some((arrives, _)) = to_robot.front()
            && *arrives <= ms
        {
            match to_robot.pop_front().expect("it is there").1 {
                Ok(ping) => {
                    match ping.has_all {
                        true => pace.note_exchange(STATION, ping.late_ms, now),
                        false => pace.note_describing(STATION, now),
                    }
                    way.send(MESSAGE, Passing::Pong(pong(&ping, now, pages.len())));
                }
                Err(Passing::Part(part)) => {
                    let bytes = part.bytes.len() as u64 + MESSAGE;
                    way.send(bytes, Passing::Part(part));
                }
                Err(other) => way.send(MESSAGE, other),
            }
        }
        for place in 0..topics.len() {
            let index = (first + place) % topics.len();
            let ((len, period), sender) = (topics[index], &mut senders[index]);
            if ms % period == 0 {
                let mut sample = vec![0; len];
                sample[..8].copy_from_slice(&ms.to_le_bytes());
                sender.take(&sample);
            }
            sender.send(now, 0, &mut pace, |_, sample| {
                let had_ms = u64::from_le_bytes(sample[..8].try_into().expect("eight bytes"));
                way.send(sample.len() as u64 + OVERHEAD, Passing::Sample(had_ms));
                first = index + 1;
            });
        }
        while let Some(what) = way.pass(ms) {
            match what {
                Passing::Sample(had_ms) => {
                    link.note_sample();
                    if ms > seconds * 1000 - 30_000 {
                        seen.ages.push(ms - had_ms);
                    }
                }
                Passing::Pong(pong) => drop(link.take(&pong, now, 0)),
                Passing::Part(part) => drop(link.take_part(&part)),
                Passing::Report(ordered_ms) => seen.orders.push(ms - ordered_ms),
            }
        }
        link.note_complete();
        seen.outages += u32::from(link.tick(now));
        let is_shown_up = link.shown_state() == ipc_types::code::RelayLinkState::Up;
        if is_shown_up && seen.up_after == 0 {
            seen.up_after = ms;
        }
        let arrives = ms + delay_ms(ms);
        if let Some(ping) = link.ping(now, 0) {
            to_robot.push_back((arrives, Ok(ping)));
        }
        if let Some((_, question)) = link.question(now) {
            let page = &pages[usize::from(question.index)];
            let part = page.part(ROBOT, question.index, question.from);
            to_robot.push_back((arrives, Err(Passing::Part(part.expect("it is there")))));
        }
        if is_shown_up && ms % 500 == 0 {
            to_robot.push_back((arrives, Err(Passing::Report(ms))));
        }
    }
    seen
}

fn pong(ping: &Ping, now: MonotonicNs, pages: usize) -> Pong {
    Pong {
        robot_instance: ROBOT,
        station_instance: STATION,
        ping_sent_ns: ping.sent_ns,
        ping_suspended_ns: 0,
        received_ns: now.0,
        sent_ns: now.0,
        suspended_ns: 0,
        session: 2,
        pages: pages as u16,
    }
}

fn median(mut times: Vec<u64>) -> u64 {
    times.sort_unstable();
    times[times.len() / 2]
}

#[test]
fn over_64_kbit_per_s_a_station_is_up_soon_and_stays_it_its_orders_are_prompt_and_telemetry_is_new()
{
    let seen = fly(8, 60);
    assert_eq!(seen.outages, 0);
    assert!((1..10_000).contains(&seen.up_after), "{}", seen.up_after);
    assert!(seen.orders.len() > 90, "{}", seen.orders.len());
    let (order, count) = (median(seen.orders), seen.ages.len());
    assert!(order < 600, "{order} ms");
    let age = median(seen.ages);
    assert!(age < 500, "{age} ms");
    // Five samples a second at the least, of 8 kB/s.
    assert!(count > 30 * 5, "{count}");
}

#[test]
fn over_a_wide_link_all_telemetry_comes_at_once() {
    let seen = fly(1000, 60);
    assert_eq!(seen.outages, 0);
    assert!(seen.up_after < 4000, "{}", seen.up_after);
    assert!(seen.ages.len() >= 30 * 102, "{}", seen.ages.len());
    assert!(median(seen.ages) < DELAY_MS + 5);
}

#[test]
fn after_a_change_to_a_way_that_is_longer_by_400_ms_all_telemetry_comes_again() {
    let seen = fly(1000, 150);
    assert_eq!(seen.outages, 0);
    assert!(seen.ages.len() >= 30 * 102, "{}", seen.ages.len());
    assert!(median(seen.ages) < LONGER_MS + 5);
}
