//! [`Pace`]: how many bytes of samples a second go out, by what stations say of the delay. A pure value.
//!
//! | state | becomes | when |
//! |---|---|---|
//! | all goes out | starting | a station is connected, or speaks and none had for some time: next to nothing until one has all descriptions, then what the narrowest link carries |
//! | starting | starting | its exchanges are not late: twice as much; none has ended yet: the same |
//! | starting | paced | they are late: half |
//! | all goes out | paced | every station's exchanges have been late for some time: half of what went out |
//! | paced | slower | they still are, and not less than before: half |
//! | paced | probing | half of it changes nothing, or they stay as late for some time, or are very late: the least rate |
//! | probing | paced | they become less late: what waited were samples |
//! | probing | as before they were late | they stay as late: nothing waits, and the way has become longer |
//! | paced | faster | those of a station are not late: an eighth more; near the rate that was too much, a little more |
//! | starting, paced | all goes out | nothing was held back for some time, or no station speaks any more |
//!
//! A link that is too slow collects what is sent in buffers that the relay does not see: of the kernel, of QUIC, of a
//! radio. Orders and their reports would wait behind it. Samples that are held back cost nothing, because the newest is
//! sent when there is room again.
//!
//! That exchanges take longer proves no such queue: a link that changes from Wi-Fi to a mobile network or a tunnel has
//! longer round trips for good. A queue of samples becomes shorter while next to none are sent, the way does not.
//!
//! Nor does one that takes longer and is followed by a prompt one: a mobile network's round trips waver by tenths of a
//! second. By how much they do, without a change of the rate, is taken off what exchanges are late.
//!
//! A sample goes to all stations alike, so the one with the best link decides: one on a bad link holds up no other one.
//! The copies for ROS 2 nodes do not count: they go to other sessions.

use std::time::Duration;

use ipc_types::MonotonicNs;

/// An exchange that takes so much longer than the quickest one has waited behind samples.
const LATE_MS: u32 = 300;

/// So much that the way is to become empty first.
const VERY_LATE_MS: u32 = 1000;

/// An exchange that is later by less than this has met an empty way.
const PROMPT_MS: u32 = 100;

/// Decisions in a row in which exchanges are late, but not so late that the rate is changed, after which the least rate
/// shows whether samples wait.
const LEVEL_AFTER: u32 = 10;

/// From one decision to the next: a ping.
const PERIOD: Duration = Duration::from_millis(500);

/// A station that has said nothing for so long does not decide.
const SILENT: Duration = Duration::from_millis(3000);

/// Rate at which a link begins, bytes a second: beside it a link of 64 kbit/s still carries the descriptions of the
/// services.
const FIRST: u64 = 3000;

/// Rate while no station has all descriptions, bytes a second: it can use no sample, and each is in the way of what it
/// needs.
const DESCRIBING: u64 = 300;

/// Least rate, bytes a second: a state every second and some telemetry.
const LEAST: u64 = 1500;

/// Bytes that each sample takes beside its own: its attachment, and the headers of Zenoh, TCP and IP.
const OVERHEAD: u64 = 120;

/// What was sent is paid for after this time at the latest, however long a sample is.
const LONGEST_DEBT: Duration = Duration::from_secs(2);

/// Decisions in a row without a sample that was held back, after which all goes out.
const FREE_AFTER: u32 = 20;

/// Decisions in a row without a sample that was held back, after which all goes out while a link begins: the rate has
/// doubled to more than what is published.
const FREE_AT_FIRST: u32 = 2;

/// What goes out may be paid for so much later: topics that are published together go out together.
const CREDIT: Duration = Duration::from_millis(20);

/// Most stations that are remembered.
const STATIONS: usize = 16;

/// How many bytes of samples a second go out, by what stations say of the delay.
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
    /// What stations said last.
    exchanges: Vec<Told>,
    /// When a station that has all descriptions said something last, if one did since the pace began.
    described: Option<MonotonicNs>,
    /// When it was decided, and when it is again.
    begun: MonotonicNs,
    next: MonotonicNs,
    /// Not slower before then: a station has to see what the last decision did.
    settled: MonotonicNs,
    /// By how much the best station was late at the last decision.
    late_ms: u32,
    /// By how much exchanges waver: what was latest between two prompt ones, on average.
    wavers_ms: u32,
    /// The latest since the last prompt one; `None` if the rate was changed for it.
    latest_ms: Option<u32>,
    /// Bytes since the last decision.
    sent: u64,
    was_held: bool,
    free: u32,
    /// The rate that was too much last.
    limit: Option<u64>,
    /// It was slowed down since exchanges became late.
    slowed: Option<Slowed>,
    probe: Option<Probe>,
    /// Decisions in a row that found exchanges late and changed nothing.
    level: u32,
}

/// What a station said last.
#[derive(Clone, Copy, Debug)]
struct Told {
    station: u64,
    /// By how much its last exchange took longer than its quickest one, if it knows.
    late_ms: Option<u32>,
    /// How much of that is the way, which has become longer since the quickest one.
    way_ms: u32,
    at: MonotonicNs,
}

impl Told {
    /// By how much the last exchange waited.
    fn waited_ms(&self) -> Option<u32> {
        self.late_ms.map(|late_ms| late_ms - self.way_ms)
    }
}

/// What there was before the pace was slowed down.
#[derive(Clone, Copy, Debug)]
struct Slowed {
    rate: Option<u64>,
    is_starting: bool,
    limit: Option<u64>,
    /// By how much exchanges were late then, or at the end of the last probe.
    late_ms: u32,
}

/// The least rate, to see whether what waits becomes less.
#[derive(Clone, Copy, Debug)]
struct Probe {
    /// By how much exchanges were late at its beginning.
    late_ms: u32,
    /// They have been as late at another decision since.
    has_lasted: bool,
    /// By then a queue would have become shorter.
    until: MonotonicNs,
}

impl Probe {
    /// A queue of `late_ms` becomes shorter by a quarter of it in that time, over a link that carries a third more than
    /// the least rate. A station says so with its next ping, about an exchange that began one ping before.
    fn begin(late_ms: u32, now: MonotonicNs) -> Probe {
        Probe {
            late_ms,
            has_lasted: false,
            until: now + 2 * PERIOD + 2 * Duration::from_millis(late_ms.into()),
        }
    }
}

/// Whether exchanges that were late by `before_ms` and are by `late_ms` have become quicker: by more than the round
/// trip of a path wavers.
fn has_fallen(before_ms: u32, late_ms: u32) -> bool {
    late_ms < before_ms - before_ms / 4
}

impl Pace {
    /// Another process was connected, and may be a station that speaks soon. What is sent until then lies in front of
    /// the answer to its first question, and it would take that for the length of the way.
    pub fn note_newcomer(&mut self, now: MonotonicNs) {
        if now >= self.alone {
            self.alone = now + SILENT;
            self.described = None;
            self.begin(now);
        }
    }

    /// A station says that it does not have all descriptions yet.
    pub fn note_describing(&mut self, station: u64, now: MonotonicNs) {
        let described = self.described.filter(|at| now.since(*at) < SILENT);
        self.note_exchange(station, None, now);
        self.described = described;
    }

    /// A station that has all descriptions says by how much longer than its quickest exchange the last one took. `None`
    /// if it does not know.
    pub fn note_exchange(&mut self, station: u64, late_ms: Option<u32>, now: MonotonicNs) {
        let earlier = self.exchanges.iter().find(|told| told.station == station);
        let way_ms = earlier.map_or(0, |told| told.way_ms);
        let told = Told {
            station,
            late_ms,
            // What was taken for the way and is not there any more was none.
            way_ms: late_ms.map_or(way_ms, |late_ms| way_ms.min(late_ms)),
            at: now,
        };
        self.exchanges
            .retain(|told| told.station != station && now.since(told.at) < SILENT);
        self.exchanges.push(told);
        if self.exchanges.len() > STATIONS {
            // However many there are: the one that is latest decides nothing, and one that knows nothing even less.
            let waited_ms = |index: &usize| self.exchanges[*index].waited_ms().unwrap_or(u32::MAX);
            let latest = (0..self.exchanges.len()).max_by_key(waited_ms);
            latest.map(|index| self.exchanges.swap_remove(index));
        }
        let was_alone = now >= self.alone;
        self.alone = now + SILENT;
        self.described = Some(now);
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
            exchanges: std::mem::take(&mut self.exchanges),
            described: self.described,
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
        let known = self.exchanges.iter().filter_map(Told::waited_ms);
        let Some(late_ms) = known.min() else {
            return;
        };
        let late_ms = late_ms.saturating_sub(self.wavering_ms(late_ms));
        let before_ms = std::mem::replace(&mut self.late_ms, late_ms);
        if let Some(probe) = self.probe {
            return self.judge(probe, now);
        }
        let is_late = late_ms >= LATE_MS;
        // What falls is what was sent before the last decision, and goes by. What has just been doubled does not.
        let is_growing = is_late && before_ms >= LATE_MS && late_ms >= before_ms;
        if late_ms < PROMPT_MS {
            (self.slowed, self.level) = (None, 0);
            self.free = if was_held { 0 } else { self.free + 1 };
            let free_after = match self.is_starting {
                true => FREE_AT_FIRST,
                false => FREE_AFTER,
            };
            let is_free = self.free >= free_after;
            self.rate = self.rate.filter(|_| !is_free).map(|rate| self.faster(rate));
            self.is_starting &= self.rate.is_some();
        } else if is_late && self.is_starting
            || is_growing && self.slowed.is_none() && now >= self.settled
        {
            let went_out = |rate: u64| rate.min(sent_per_s.max(LEAST));
            self.slow_down(self.rate.map_or(sent_per_s, went_out), now);
        } else if self.rate.is_some() {
            self.level += 1;
        }
        match &mut self.slowed {
            Some(slowed) if has_fallen(slowed.late_ms, late_ms) => {
                slowed.late_ms = late_ms;
                self.settle(now);
            }
            Some(_) if now >= self.settled => self.level = LEVEL_AFTER,
            _ => {}
        }
        let is_very_late = late_ms >= VERY_LATE_MS && self.rate.is_some();
        if is_very_late || self.level >= LEVEL_AFTER {
            (self.level, self.latest_ms) = (0, None);
            self.probe = Some(Probe::begin(late_ms, now));
        }
    }

    /// By how much exchanges waver, of which the last one was late by `late_ms`.
    fn wavering_ms(&mut self, late_ms: u32) -> u32 {
        if late_ms >= PROMPT_MS {
            let late_ms = late_ms.min(VERY_LATE_MS);
            self.latest_ms = self.latest_ms.map(|latest_ms| latest_ms.max(late_ms));
        } else if let Some(latest_ms) = self.latest_ms.replace(0) {
            self.wavers_ms = (3 * self.wavers_ms + latest_ms) / 4;
        }
        self.wavers_ms
    }

    /// Half of what went out at `present`.
    fn slow_down(&mut self, present: u64, now: MonotonicNs) {
        if self.slowed.is_none() {
            self.slowed = Some(Slowed {
                rate: self.rate,
                is_starting: self.is_starting,
                limit: self.limit,
                late_ms: self.late_ms,
            });
            // At the first rate the link has not shown yet what it carries.
            self.limit = Some(present).filter(|rate| *rate > FIRST);
        }
        self.rate = Some((present / 2).max(LEAST));
        self.is_starting = false;
        (self.free, self.level, self.latest_ms) = (0, 0, None);
        self.settle(now);
    }

    /// A station sees what a decision did after two pings, and what waited.
    fn settle(&mut self, now: MonotonicNs) {
        self.settled = now + 2 * PERIOD + Duration::from_millis(self.late_ms.into());
    }

    /// What the probe has shown so far.
    fn judge(&mut self, probe: Probe, now: MonotonicNs) {
        let late_ms = self.late_ms;
        if has_fallen(probe.late_ms, late_ms) {
            self.probe = None;
            if let Some(rate) = self.rate.filter(|_| probe.has_lasted) {
                // Samples waited.
                self.slow_down(rate, now);
            }
            if let Some(slowed) = &mut self.slowed {
                (slowed.rate, slowed.late_ms) = (self.rate, late_ms);
            }
            if late_ms >= VERY_LATE_MS {
                self.probe = Some(Probe::begin(late_ms, now));
            }
        } else if late_ms > probe.late_ms.saturating_add(probe.late_ms / 4) {
            // What was sent before has come into the queue, or the way becomes longer still.
            self.probe = Some(Probe {
                has_lasted: true,
                ..Probe::begin(late_ms, now)
            });
        } else if now < probe.until {
            self.probe = Some(Probe {
                has_lasted: true,
                ..probe
            });
        } else {
            for told in &mut self.exchanges {
                told.way_ms = told.late_ms.unwrap_or(told.way_ms);
            }
            (self.probe, self.late_ms, self.free) = (None, 0, 0);
            if let Some(slowed) = self.slowed.take() {
                (self.rate, self.is_starting) = (slowed.rate, slowed.is_starting);
                self.limit = slowed.limit;
            }
        }
    }

    /// More than this rate, as exchanges are prompt.
    fn faster(&mut self, rate: u64) -> u64 {
        // Beyond the limit the link has become better.
        self.limit = self.limit.filter(|limit| rate <= limit + limit / 8);
        match self.limit {
            _ if self.is_starting => 2 * rate,
            Some(limit) if rate + rate / 8 > limit - limit / 8 => rate + rate / 32,
            _ => rate + rate / 8,
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
        let rate = self.rate.filter(|_| now < self.alone)?;
        Some(match self.described {
            None => DESCRIBING,
            Some(_) if self.probe.is_some() => LEAST,
            Some(_) => rate,
        })
    }

    /// The rate as it is published, bytes a second: 0 if all samples go out.
    pub fn shown(&self, now: MonotonicNs) -> u32 {
        let rate = self.rate(now).unwrap_or_default();
        u32::try_from(rate).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests;
