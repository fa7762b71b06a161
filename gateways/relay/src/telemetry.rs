//! Telemetry keeps the newest: what a robot sends of a topic ([`SampleSender`]), and what a station takes of it
//! ([`SampleReceiver`]).
//!
//! Losses are counted apart, because each has another cure:
//!
//! | lost | where it is counted | cure |
//! |---|---|---|
//! | left out on purpose | [`SampleSender`]: the configured rate, or the [`Pace`] of a narrow link | a higher rate, a better link |
//! | in the relay | by the sequence of the topic's publisher on the robot | a faster robot |
//! | on the air | [`SampleReceiver`]: by the numbers that the sender gave | a better link, a lower rate |
//! | at the consumer | by the sequence of the topic on the station's machine | a faster consumer |

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::message::SampleHeader;
use crate::pace::Pace;

/// Samples of one wake that are all sent. When more have piled up, the relay was held up, and only the newest of them
/// goes out: at 50 samples a second this is 0.3 s.
pub const MAX_BACKLOG: usize = 16;

/// Pieces that wait for a way out; of further ones the oldest is left out. A topic in pieces is published as a whole
/// again later.
pub const MAX_PIECES: usize = 128;

/// Which samples of a topic go out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// All, and the newest when more have piled up.
    All,
    /// The newest of each period.
    Newest(Duration),
    /// All, however slowly: each is a piece of something that only all of them are.
    Pieces,
}

/// One topic on its way out of the robot.
#[derive(Debug)]
pub struct SampleSender {
    robot_instance: u64,
    selection: Selection,
    /// Not before then.
    next: MonotonicNs,
    /// Samples that came and were not sent yet, oldest first. With a period only the newest is kept.
    waiting: Vec<Vec<u8>>,
    /// The sample that was sent last.
    latest: Option<Vec<u8>>,
    is_latest_wanted: bool,
    number: u64,
    left_out: u64,
}

impl SampleSender {
    /// A topic of which nothing has come yet.
    pub fn new(robot_instance: u64, selection: Selection) -> SampleSender {
        SampleSender {
            robot_instance,
            selection,
            next: MonotonicNs(0),
            waiting: Vec::new(),
            latest: None,
            is_latest_wanted: false,
            number: 0,
            left_out: 0,
        }
    }

    /// A sample has come.
    pub fn take(&mut self, sample: &[u8]) {
        let waiting = self.waiting.len();
        let dropped = match self.selection {
            Selection::Newest(_) => waiting,
            Selection::All if waiting >= MAX_BACKLOG => waiting,
            Selection::Pieces if waiting >= MAX_PIECES => 1,
            Selection::All | Selection::Pieces => 0,
        };
        self.left_out += dropped as u64;
        self.waiting.drain(..dropped);
        self.waiting.push(sample.to_vec());
    }

    /// Hands on each sample that is to be sent now. Of those that `pace` holds back, the newest goes later and the
    /// others are left out. `lost` counts the samples that the topic's publisher has published and the relay has
    /// missed.
    pub fn send(
        &mut self,
        now: MonotonicNs,
        lost: u64,
        pace: &mut Pace,
        mut send: impl FnMut(&SampleHeader, &[u8]),
    ) {
        if self.waiting.is_empty() {
            return self.send_latest(now, lost, pace, &mut send);
        }
        if now < self.next {
            return;
        }
        if self.selection == Selection::Pieces {
            let mut pieces = std::mem::take(&mut self.waiting).into_iter();
            while pieces.len() > 0
                && pace.is_open(now)
                && let Some(piece) = pieces.next()
            {
                self.send_one(piece, now, lost, pace, &mut send);
            }
            self.waiting = pieces.collect();
            if !self.waiting.is_empty() {
                pace.hold();
            }
            return;
        }
        if !pace.is_open(now) {
            pace.hold();
            let older = self.waiting.len() - 1;
            self.left_out += older as u64;
            self.waiting.drain(..older);
            return;
        }
        if let Selection::Newest(period) = self.selection {
            // On the grid of the period, so that a sample that comes a little early is not left out for it.
            let on_grid = self.next + period;
            self.next = if on_grid > now { on_grid } else { now + period };
        }
        for sample in std::mem::take(&mut self.waiting) {
            self.send_one(sample, now, lost, pace, &mut send);
        }
    }

    fn send_one(
        &mut self,
        sample: Vec<u8>,
        now: MonotonicNs,
        lost: u64,
        pace: &mut Pace,
        send: &mut impl FnMut(&SampleHeader, &[u8]),
    ) {
        self.number += 1;
        pace.spend(sample.len(), now);
        send(&self.header(lost), &sample);
        self.latest = Some(sample);
        self.is_latest_wanted = false;
    }

    /// Hands on the sample that was sent last, under its own number, if it is wanted and the pace lets it.
    fn send_latest(
        &mut self,
        now: MonotonicNs,
        lost: u64,
        pace: &mut Pace,
        send: &mut impl FnMut(&SampleHeader, &[u8]),
    ) {
        let Some(latest) = self.latest.as_ref().filter(|_| self.is_latest_wanted) else {
            return;
        };
        if !pace.is_open(now) {
            return pace.hold();
        }
        pace.spend(latest.len(), now);
        send(&self.header(lost), latest);
        self.is_latest_wanted = false;
    }

    /// The sample that was sent last is to be sent again, for a station that may not have it. A newer one serves as
    /// well.
    pub fn want_latest(&mut self) {
        self.is_latest_wanted = self.latest.is_some();
    }

    fn header(&self, lost: u64) -> SampleHeader {
        SampleHeader {
            robot_instance: self.robot_instance,
            number: self.number,
            left_out: self.left_out,
            lost,
        }
    }

    /// When a sample is due that has come already.
    pub fn deadline(&self, pace: &Pace) -> Option<MonotonicNs> {
        match self.waiting.is_empty() {
            true => self.is_latest_wanted.then(|| pace.opens()),
            false => Some(self.next.max(pace.opens())),
        }
    }

    /// Samples that were sent.
    pub fn sent(&self) -> u64 {
        self.number
    }
}

/// One topic on its way into a station.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleReceiver {
    robot_instance: u64,
    number: u64,
    counts: SampleCounts,
    /// What earlier instances of the robot's relay have counted.
    former: SampleCounts,
}

/// Samples of a topic, counted apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SampleCounts {
    /// Taken.
    pub received: u64,
    /// Sent by the robot and not received.
    pub lost_on_air: u64,
    /// Lost on the robot, before they were sent.
    pub lost_in_relay: u64,
    /// Left out on purpose.
    pub left_out: u64,
}

impl SampleCounts {
    /// Both together.
    #[must_use]
    pub fn plus(self, other: SampleCounts) -> SampleCounts {
        SampleCounts {
            received: self.received.saturating_add(other.received),
            lost_on_air: self.lost_on_air.saturating_add(other.lost_on_air),
            lost_in_relay: self.lost_in_relay.saturating_add(other.lost_in_relay),
            left_out: self.left_out.saturating_add(other.left_out),
        }
    }
}

impl SampleReceiver {
    /// Whether this sample is newer than all before it. A repetition, and a sample that was overtaken, is none.
    ///
    /// What is overtaken was counted as lost on the air, and stays so: the newest rules.
    pub fn take(&mut self, header: &SampleHeader) -> bool {
        if header.robot_instance != self.robot_instance {
            self.former = self.counts();
            self.counts = SampleCounts::default();
            self.robot_instance = header.robot_instance;
            // What was sent before this station listened is no loss.
            self.number = header.number.saturating_sub(1);
        }
        if header.number <= self.number {
            return false;
        }
        self.counts.received += 1;
        let lost = header.number - self.number - 1;
        self.counts.lost_on_air = self.counts.lost_on_air.saturating_add(lost);
        self.counts.lost_in_relay = header.lost;
        self.counts.left_out = header.left_out;
        self.number = header.number;
        true
    }

    /// What was counted so far.
    pub fn counts(&self) -> SampleCounts {
        self.former.plus(self.counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INSTANCE: u64 = 7;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    fn sent(sender: &mut SampleSender, now: MonotonicNs) -> Vec<(u64, u8)> {
        let mut sent = Vec::new();
        sender.send(now, 0, &mut Pace::default(), |header, sample| {
            sent.push((header.number, sample[0]));
        });
        sent
    }

    fn header(number: u64) -> SampleHeader {
        SampleHeader {
            robot_instance: INSTANCE,
            number,
            ..SampleHeader::default()
        }
    }

    #[test]
    fn without_a_rate_every_sample_is_sent_in_order() {
        let mut sender = SampleSender::new(INSTANCE, Selection::All);
        for sample in 1..=3 {
            sender.take(&[sample]);
        }
        assert_eq!(sent(&mut sender, at(0)), [(1, 1), (2, 2), (3, 3)]);
        assert_eq!(sent(&mut sender, at(0)), []);
        assert_eq!(sender.deadline(&Pace::default()), None);
    }

    #[test]
    fn what_has_piled_up_is_left_out_and_the_newest_goes() {
        let mut sender = SampleSender::new(INSTANCE, Selection::All);
        for sample in 0..=MAX_BACKLOG as u8 {
            sender.take(&[sample]);
        }
        assert_eq!(sent(&mut sender, at(0)), [(1, MAX_BACKLOG as u8)]);
        assert_eq!(sender.left_out, MAX_BACKLOG as u64);
    }

    #[test]
    fn of_what_the_pace_holds_back_the_newest_goes_when_there_is_room() {
        let mut sender = SampleSender::new(INSTANCE, Selection::All);
        let mut pace = Pace::default();
        for second in 0..9 {
            pace.note_exchange(1, Some(1000 + 500 * second as u32), at(second * 1000));
        }
        let now = at(9000);
        pace.spend(3000, now);
        let mut sent = Vec::new();
        for sample in 1..=3 {
            sender.take(&[sample]);
            sender.send(now, 0, &mut pace, |header, sample| {
                sent.push((header.number, sample[0]));
            });
        }
        assert_eq!((sent.len(), sender.left_out), (0, 2));
        let room = sender.deadline(&pace).unwrap();
        assert!(room > now);
        sender.send(room, 0, &mut pace, |header, sample| {
            sent.push((header.number, sample[0]));
        });
        assert_eq!(sent, [(1, 3)]);
    }

    #[test]
    fn pieces_are_held_back_and_all_of_them_go_out_in_order() {
        let mut sender = SampleSender::new(INSTANCE, Selection::Pieces);
        let mut pace = Pace::default();
        for second in 0..9 {
            pace.note_exchange(1, Some(1000 + 500 * second as u32), at(second * 1000));
        }
        let (mut now, mut sent) = (at(9000), Vec::new());
        pace.spend(3000, now);
        for sample in 0..=MAX_PIECES as u8 {
            sender.take(&[sample; 900]);
        }
        let mut times = 0;
        while let Some(due) = sender.deadline(&pace) {
            now = due;
            pace.note_exchange(1, Some(1000), now);
            sender.send(now, 0, &mut pace, |_, sample| sent.push(sample[0]));
            times += 1;
        }
        assert_eq!(sent, (1..=MAX_PIECES as u8).collect::<Vec<_>>());
        assert_eq!((times, sender.left_out), (MAX_PIECES, 1), "one at a time");
    }

    #[test]
    fn with_a_rate_the_newest_goes_when_it_is_due() {
        let mut sender = SampleSender::new(INSTANCE, Selection::Newest(Duration::from_millis(100)));
        sender.take(&[1]);
        assert_eq!(sent(&mut sender, at(1000)), [(1, 1)]);
        sender.take(&[2]);
        sender.take(&[3]);
        assert_eq!(sent(&mut sender, at(1050)), []);
        assert_eq!(sender.deadline(&Pace::default()), Some(at(1100)));
        assert_eq!(sent(&mut sender, at(1100)), [(2, 3)]);
        assert_eq!(sender.left_out, 1);
    }

    #[test]
    fn fifty_hertz_become_ten_though_the_samples_jitter() {
        let mut sender = SampleSender::new(INSTANCE, Selection::Newest(Duration::from_millis(100)));
        let mut count = 0;
        for index in 0..500 {
            sender.take(&[0]);
            let jitter = index * 7 % 5;
            count += sent(&mut sender, at(10_000 + 20 * index + jitter)).len();
        }
        assert!((99..=101).contains(&count), "{count}");
        assert_eq!(sender.sent(), count as u64);
    }

    #[test]
    fn the_latest_is_sent_again_under_its_own_number_as_the_pace_lets_it_and_a_newer_one_serves_as_well()
     {
        let mut sender = SampleSender::new(INSTANCE, Selection::All);
        sender.want_latest();
        assert_eq!(sent(&mut sender, at(0)), [], "there is none");
        sender.take(&[9]);
        assert_eq!(sent(&mut sender, at(0)), [(1, 9)]);
        sender.want_latest();
        assert_eq!(sender.deadline(&Pace::default()), Some(at(0)));
        assert_eq!(sent(&mut sender, at(1)), [(1, 9)]);
        assert_eq!(sent(&mut sender, at(2)), [], "once");
        sender.want_latest();
        sender.take(&[10]);
        assert_eq!(sent(&mut sender, at(3)), [(2, 10)]);
        assert_eq!(sent(&mut sender, at(4)), []);
        let mut pace = Pace::default();
        pace.note_exchange(1, None, at(1000));
        pace.spend(3000, at(1000));
        sender.want_latest();
        sender.send(at(1500), 0, &mut pace, |_, _| panic!("it is held back"));
        let due = sender.deadline(&pace).unwrap();
        let mut again = None;
        sender.send(due, 3, &mut pace, |header, sample| {
            again = Some((header.number, sample[0]));
        });
        assert_eq!(again, Some((2, 10)));
        let mut receiver = SampleReceiver::default();
        assert!(receiver.take(&header(1)) && !receiver.take(&header(1)));
    }

    #[test]
    fn gaps_are_losses_and_what_was_overtaken_is_dropped() {
        let mut receiver = SampleReceiver::default();
        let taken = [5, 6, 9, 8, 9, 10].map(|number| receiver.take(&header(number)));
        assert_eq!(taken, [true, true, true, false, false, true]);
        let counts = receiver.counts();
        assert_eq!((counts.received, counts.lost_on_air), (4, 2));
    }

    #[test]
    fn another_instance_of_the_robot_s_relay_begins_to_count_anew_and_keeps_the_sums() {
        let mut receiver = SampleReceiver::default();
        receiver.take(&SampleHeader {
            left_out: 4,
            lost: 1,
            ..header(10)
        });
        receiver.take(&header(12));
        let other = SampleHeader {
            robot_instance: INSTANCE + 1,
            number: 3,
            left_out: 2,
            lost: 0,
        };
        assert!(receiver.take(&other));
        let counts = receiver.counts();
        assert_eq!((counts.received, counts.lost_on_air), (3, 1));
        assert_eq!((counts.left_out, counts.lost_in_relay), (2, 0));
    }
}
