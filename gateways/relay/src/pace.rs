//! [`Pace`]: how many bytes of samples a second go out, by what stations say of the delay. A pure value.
//!
//! | state | becomes | when |
//! |---|---|---|
//! | all goes out | starting | a station speaks and none had for some time: what the narrowest link carries |
//! | starting | starting | its exchanges are not late: twice as much |
//! | starting | paced | they are late: half |
//! | all goes out | paced | every station's exchanges have been late for some time: half of what went out |
//! | paced | slower | they still are, and not less than before: half |
//! | paced | faster | those of a station are not late: an eighth more |
//! | starting, paced | all goes out | nothing was held back for some time, or no station speaks any more |
//!
//! A link that is too slow collects what is sent in buffers that the relay does not see: of the kernel, of QUIC, of a radio. Orders and
//! their reports would wait behind it. Samples that are held back cost nothing, because the newest is sent when there is room again.
//!
//! A sample goes to all stations alike, so the one with the best link decides: one on a bad link holds up no other one. The copies for
//! ROS 2 nodes do not count: they go to other sessions.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// An exchange that takes so much longer than the quickest one has waited behind samples.
const LATE_MS: u32 = 300;

/// So much that the way is to become empty first.
const VERY_LATE_MS: u32 = 1000;

/// An exchange that is later by less than this has met an empty way.
const PROMPT_MS: u32 = 100;

/// From one decision to the next: a ping.
const PERIOD: Duration = Duration::from_millis(500);

/// A station that has said nothing for so long does not decide.
const SILENT: Duration = Duration::from_millis(3000);

/// Rate at which a link begins, bytes a second: beside it a link of 64 kbit/s still carries the descriptions of the services.
const FIRST: u64 = 3000;

/// Least rate, bytes a second: a state every second and some telemetry.
const LEAST: u64 = 1500;

/// Bytes that each sample takes beside its own: its attachment, and the headers of Zenoh, TCP and IP.
const OVERHEAD: u64 = 120;

/// What was sent is paid for after this time at the latest, however long a sample is.
const LONGEST_DEBT: Duration = Duration::from_secs(2);

/// Decisions in a row without a sample that was held back, after which all goes out.
const FREE_AFTER: u32 = 20;

/// The same while a link begins: the rate has doubled to more than what is published.
const FREE_AT_FIRST: u32 = 2;

/// What goes out may be paid for so much later: topics that are published together go out together.
const CREDIT: Duration = Duration::from_millis(20);

/// Most stations that are remembered.
const STATIONS: usize = 16;

/// See the module's documentation.
#[derive(Clone, Debug, Default)]
pub struct Pace {
    /// Bytes a second; `None` if all goes out.
    rate: Option<u64>,
    /// The rate doubles.
    is_starting: bool,
    /// When what was sent has been paid for.
    paid: MonotonicNs,
    /// When all stations have been silent for so long that none decides.
    alone: MonotonicNs,
    /// What stations said last: instance, by how much they are late, when.
    heard: Vec<(u64, u32, MonotonicNs)>,
    /// When it was decided, and when it is again.
    begun: MonotonicNs,
    next: MonotonicNs,
    /// Not slower before then: a station has to see what the last decision did.
    settled: MonotonicNs,
    /// By how much the best station was late at the last decision.
    late_ms: u32,
    /// Bytes since the last decision.
    sent: u64,
    was_held: bool,
    free: u32,
}

impl Pace {
    /// A station says by how much longer than its quickest exchange the last one took.
    pub fn hear(&mut self, station: u64, late_ms: u32, now: MonotonicNs) {
        self.heard
            .retain(|(other, _, at)| *other != station && now.since(*at) < SILENT);
        self.heard.push((station, late_ms, now));
        if self.heard.len() > STATIONS {
            // However many there are: the one that is latest decides nothing.
            let latest = (0..self.heard.len()).max_by_key(|index| self.heard[*index].1);
            latest.map(|index| self.heard.swap_remove(index));
        }
        let was_alone = now >= self.alone;
        self.alone = now + SILENT;
        if was_alone {
            self.begin(now);
        } else if now >= self.next {
            self.decide(now);
        }
    }

    /// The first station speaks: what its link carries is not known.
    fn begin(&mut self, now: MonotonicNs) {
        *self = Pace {
            rate: Some(FIRST),
            is_starting: true,
            paid: now,
            alone: self.alone,
            heard: std::mem::take(&mut self.heard),
            begun: now,
            next: now + PERIOD,
            ..Pace::default()
        };
    }

    fn decide(&mut self, now: MonotonicNs) {
        let passed = now.since(self.begun).max(PERIOD);
        let sent_per_s = (self.sent as f64 / passed.as_secs_f64()) as u64;
        (self.begun, self.next) = (now, now + PERIOD);
        self.sent = 0;
        let was_held = std::mem::take(&mut self.was_held);
        let best = self.heard.iter().map(|(_, late_ms, _)| *late_ms).min();
        let late_ms = best.unwrap_or_default();
        let before_ms = std::mem::replace(&mut self.late_ms, late_ms);
        let is_late = late_ms >= LATE_MS;
        // What falls is what was sent before the last decision, and goes by. What has just been doubled does not.
        let is_growing = is_late && before_ms >= LATE_MS && late_ms >= before_ms;
        if is_late && self.is_starting || is_growing && now >= self.settled {
            let present = self
                .rate
                .map_or(sent_per_s, |rate| rate.min(sent_per_s.max(LEAST)));
            self.rate = Some((present / 2).max(LEAST));
            self.is_starting = false;
            self.settled = now + 2 * PERIOD;
            self.free = 0;
        } else if late_ms < PROMPT_MS {
            let (more, free_after) = match self.is_starting {
                true => (1, FREE_AT_FIRST),
                false => (8, FREE_AFTER),
            };
            self.free = if was_held { 0 } else { self.free + 1 };
            let faster = self.rate.map(|rate| rate + rate / more);
            self.rate = faster.filter(|_| self.free < free_after);
            self.is_starting &= self.rate.is_some();
        }
    }

    /// Whether a sample may go out now.
    pub fn is_open(&self, now: MonotonicNs) -> bool {
        now >= self.opens()
    }

    /// A sample is held back, since the pace is not open.
    pub fn hold(&mut self) {
        self.was_held = true;
    }

    /// When a sample that is held back may go out.
    pub fn opens(&self) -> MonotonicNs {
        match self.rate {
            Some(_) => {
                let room = MonotonicNs(self.paid.0.saturating_sub(CREDIT.as_nanos() as u64));
                room.min(self.alone)
            }
            None => MonotonicNs(0),
        }
    }

    /// A sample of so many bytes goes out.
    pub fn spend(&mut self, bytes: usize, now: MonotonicNs) {
        let bytes = bytes as u64 + OVERHEAD;
        self.sent += bytes;
        if let Some(rate) = self.rate(now) {
            let cost = Duration::from_nanos(bytes.saturating_mul(1_000_000_000) / rate);
            self.paid = (self.paid.max(now) + cost).min(now + LONGEST_DEBT);
        }
    }

    /// Bytes a second that go out at most; `None` if all do.
    pub fn rate(&self, now: MonotonicNs) -> Option<u64> {
        let is_draining = self.late_ms >= VERY_LATE_MS;
        let rate = self.rate.filter(|_| now < self.alone);
        rate.map(|rate| if is_draining { LEAST } else { rate })
    }

    /// The same as it is published: 0 if all do.
    pub fn shown(&self, now: MonotonicNs) -> u32 {
        let rate = self.rate(now).unwrap_or_default();
        u32::try_from(rate).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    /// A link that carries so many bytes a second, in the order in which they were sent, and keeps all that waits.
    struct Narrow {
        bytes_per_s: u64,
        free: MonotonicNs,
    }

    impl Narrow {
        /// By how much later something arrives that is sent now, ms.
        fn late_ms(&self, now: MonotonicNs) -> u32 {
            self.free.since(now).as_millis() as u32
        }
    }

    /// Sends a sample of `len` bytes every 2 ms over the link for two minutes. Returns what passed in the second minute, bytes a
    /// second, and all delays that a station told, ms, from the first one on.
    fn flood(bytes_per_s: u64, len: usize) -> (u64, Vec<u32>) {
        let mut link = Narrow {
            bytes_per_s,
            free: at(0),
        };
        let (mut pace, mut passed, mut delays) = (Pace::default(), 0, Vec::new());
        for ms in (0..120_000).step_by(2) {
            let now = at(ms);
            if ms % 500 == 0 {
                let late_ms = link.late_ms(now);
                pace.hear(7, late_ms, now);
                delays.push(late_ms);
            }
            if !pace.is_open(now) {
                pace.hold();
            } else {
                pace.spend(len, now);
                let bytes = len as u64 + OVERHEAD;
                let takes = Duration::from_nanos(bytes * 1_000_000_000 / link.bytes_per_s);
                link.free = link.free.max(now) + takes;
                passed += if ms >= 60_000 { bytes } else { 0 };
            }
        }
        (passed / 60, delays)
    }

    #[test]
    fn a_link_that_is_too_slow_is_filled_and_hardly_anything_waits_on_it() {
        for bytes_per_s in [8_000, 32_000, 125_000] {
            let (passed, delays) = flood(bytes_per_s, 300);
            let mut delays = delays[120..].to_vec();
            delays.sort_unstable();
            let median = delays[delays.len() / 2];
            assert!(median < LATE_MS, "{bytes_per_s}: {median} ms");
            assert!(passed > bytes_per_s / 2, "{bytes_per_s}: {passed}");
        }
    }

    #[test]
    fn a_link_that_takes_everything_is_not_paced() {
        let (passed, delays) = flood(10_000_000, 300);
        assert_eq!(passed, 420 * 500);
        assert!(delays.iter().all(|late_ms| *late_ms == 0));
    }

    #[test]
    fn a_link_begins_with_little_and_what_it_does_not_carry_waits_for_less_than_a_second() {
        for bytes_per_s in [8_000, 32_000, 125_000] {
            let (_, delays) = flood(bytes_per_s, 300);
            let longest = delays[..20].iter().max().unwrap();
            assert!(*longest < 1000, "{bytes_per_s}: {delays:?}");
        }
        // 34 kB a second, which a good link carries: twice as much each half second from 3 kB/s on.
        let mut pace = Pace::default();
        pace.hear(1, 0, at(0));
        assert_eq!((pace.rate(at(0)), pace.shown(at(0))), (Some(FIRST), 3000));
        let mut ms = 0;
        while pace.rate(at(ms)).is_some() {
            ms += 20;
            match pace.is_open(at(ms)) {
                true => pace.spend(680 - OVERHEAD as usize, at(ms)),
                false => pace.hold(),
            }
            if ms % 500 == 0 {
                pace.hear(1, 0, at(ms));
            }
        }
        assert_eq!((ms, pace.shown(at(ms))), (3000, 0));
    }

    #[test]
    fn without_a_station_all_goes_out_and_the_next_one_begins_anew() {
        let mut pace = Pace::default();
        pace.spend(1_000_000, at(0));
        assert!(pace.is_open(at(0)));
        for second in 0..9 {
            pace.hear(1, 1000, at(second * 1000));
        }
        pace.spend(100_000, at(8000));
        assert_eq!((pace.rate(at(8000)), pace.opens()), (Some(LEAST), at(9980)));
        let alone = 8000 + SILENT.as_millis() as u64;
        assert_eq!(
            (pace.rate(at(alone)), pace.is_open(at(alone))),
            (None, true)
        );
        pace.hear(2, 0, at(alone));
        assert_eq!(pace.rate(at(alone)), Some(FIRST));
    }

    /// A pace of which a station has said in its first seconds that its link carries all.
    fn free() -> Pace {
        let mut pace = Pace::default();
        for half in 0..5 {
            pace.hear(1, 0, at(half * 500));
        }
        assert_eq!(pace.rate(at(2000)), None);
        pace
    }

    #[test]
    fn one_late_exchange_and_a_station_on_a_bad_link_beside_a_good_one_change_nothing() {
        let mut pace = free();
        for second in 3..60 {
            let late_ms = if second == 30 { 2000 } else { 0 };
            pace.spend(30_000, at(second * 1000));
            pace.hear(1, late_ms, at(second * 1000));
            assert_eq!(pace.rate(at(second * 1000)), None);
        }
        for second in 60..120 {
            pace.spend(30_000, at(second * 1000));
            pace.hear(1, 5000, at(second * 1000));
            pace.hear(2, 10, at(second * 1000));
            assert_eq!(pace.rate(at(second * 1000)), None);
        }
        // The good one goes, and the bad one decides.
        for second in 120..130 {
            pace.spend(30_000, at(second * 1000));
            pace.hear(1, 5000, at(second * 1000));
        }
        assert!(pace.rate(at(129_000)).is_some());
    }

    #[test]
    fn unknown_stations_that_report_delays_slow_no_other_one_down() {
        let mut pace = free();
        for second in 3..60 {
            let now = at(second * 1000);
            pace.spend(30_000, now);
            for station in 100..200 {
                pace.hear(station, u32::MAX, now);
            }
            pace.hear(1, 10, now);
            assert_eq!(pace.rate(now), None);
        }
    }

    #[test]
    fn when_the_link_is_good_again_all_goes_out_again() {
        let mut pace = Pace::default();
        for second in 0..20 {
            pace.spend(30_000, at(second * 1000));
            pace.hear(1, 1000, at(second * 1000));
        }
        assert_eq!(pace.rate(at(19_000)), Some(LEAST));
        // Two topics that are published together.
        let mut free_ms = 20_000;
        while pace.rate(at(free_ms)).is_some() {
            for _ in 0..2 {
                match pace.is_open(at(free_ms)) {
                    true => pace.spend(300, at(free_ms)),
                    false => pace.hold(),
                }
            }
            free_ms += 20;
            if free_ms % 500 == 0 {
                pace.hear(1, 0, at(free_ms));
            }
        }
        // An eighth more twice a second, from 1.5 kB/s to the 42 kB/s that come, and ten seconds without a sample that was held back.
        assert!((20_000..45_000).contains(&free_ms), "{free_ms}");
    }
}
