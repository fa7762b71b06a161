//! [`Outbox`]: what waits for one page, by the newest rules: states, events and reports in order, of `now` the newest.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use ipc_types::MonotonicNs;

/// Texts that wait in order. A robot's states are 3 a second, so this is more than a minute of them. Beyond it all are
/// dropped, and the page gets all anew when its line is free.
pub const MAX_TEXTS: usize = 256;

/// Bytes of these texts, for the same reason. The largest, `past`, has 300 kB.
const MAX_BYTES: usize = 1 << 20;

/// Messages `now` that were sent and not seen. A browser takes all that comes into its memory, so this is what holds
/// the server back.
pub const MAX_UNSEEN: usize = 2;

/// What a page has drawn may be so old when it orders a movement by it. The numbers of `now` are remembered for so long
/// at least.
pub const SEEN_AGE: Duration = Duration::from_secs(2);

/// Most of them: 20 a second would be 40, and as many again.
const MAX_SENT: usize = 80;

/// Values per second that a page gets at most, and at least.
const RATE_HZ: (f64, f64) = (1.0, 20.0);

/// The part of the period that must have passed. A shell that speaks 20 times a second is sometimes 5 ms early.
const PERIOD_PART: f64 = 0.9;

/// A `now` that is written once for all pages, up to the count of those that were left out.
#[derive(Clone, Debug)]
pub(crate) struct NowText {
    n: u64,
    made: MonotonicNs,
    head: Arc<str>,
}

impl NowText {
    /// `text` is the JSON of a [`Now`](crate::page::Now) whose last field is a `left_out` of 0.
    pub fn new(n: u64, made: MonotonicNs, text: &str) -> NowText {
        let head = text.strip_suffix("0}").unwrap_or(text);
        NowText {
            n,
            made,
            head: Arc::from(head),
        }
    }
}

/// What waits for one page: states, events and reports in order, of `now` the newest.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    texts: VecDeque<Arc<str>>,
    bytes: usize,
    /// Too much waited: no text is taken until the connection is free.
    has_overflowed: bool,
    now: Option<NowText>,
    /// States of `now` that were replaced since one was sent.
    left_out: u64,
    /// Numbers of the states that were sent, with the moments when they were made: the newest last.
    sent: VecDeque<(u64, MonotonicNs)>,
    /// The newest one that was drawn.
    seen: u64,
    /// When the newest one was sent.
    sent_at: Option<MonotonicNs>,
    period: Duration,
}

impl Outbox {
    /// Sets how many `now` there are a second at most.
    pub fn set_rate(&mut self, rate_hz: f64) {
        // NaN stands for the highest rate.
        let rate_hz = if rate_hz.is_nan() { RATE_HZ.1 } else { rate_hz };
        let rate_hz = rate_hz.clamp(RATE_HZ.0, RATE_HZ.1);
        self.period = Duration::from_secs_f64(PERIOD_PART / rate_hz);
    }

    /// Begins `now` anew. What was sent before is forgotten if the page looks at another robot.
    pub fn restart_now(&mut self, is_another_robot: bool) {
        self.now = None;
        self.left_out = 0;
        self.sent_at = None;
        if is_another_robot {
            self.sent.clear();
            self.seen = 0;
        }
    }

    /// Drops a `now` that waits: the page is hidden.
    pub fn drop_now(&mut self) {
        self.now = None;
    }

    /// Puts a text behind the others.
    pub fn push(&mut self, text: Arc<str>) {
        if self.has_overflowed {
            return;
        }
        self.bytes += text.len();
        self.texts.push_back(text);
        if self.texts.len() > MAX_TEXTS || self.bytes > MAX_BYTES {
            self.texts.clear();
            self.bytes = 0;
            self.now = None;
            self.has_overflowed = true;
        }
    }

    /// Puts a `now` in the place of the one that waits.
    pub fn set_now(&mut self, now: &NowText, clock: MonotonicNs) {
        if self.has_overflowed {
            return;
        }
        // One that waited for its turn, or was made just before the line was looked at, is not missed.
        let is_late = self.due().is_none_or(|due| clock >= due + self.period);
        let is_missed = self.now.is_some() && is_late;
        self.left_out += u64::from(is_missed);
        self.now = Some(now.clone());
    }

    /// When the next `now` may be sent by its rate; `None` if at once.
    fn due(&self) -> Option<MonotonicNs> {
        self.sent_at.map(|at| at + self.period)
    }

    fn may_send_now(&self, clock: MonotonicNs) -> bool {
        let unseen = self.sent.iter().filter(|(n, _)| *n > self.seen).count();
        unseen < MAX_UNSEEN && self.due().is_none_or(|due| clock >= due)
    }

    /// When a `now` that waits for its turn has it; `None` if none does. One that waits for the line has no moment of
    /// its own.
    pub fn deadline(&self, clock: MonotonicNs) -> Option<MonotonicNs> {
        let due = self
            .due()
            .filter(|due| self.now.is_some() && *due > clock)?;
        self.may_send_now(due).then_some(due)
    }

    /// What is sent next.
    pub fn next(&mut self, clock: MonotonicNs) -> Option<Arc<str>> {
        if let Some(text) = self.texts.pop_front() {
            self.bytes -= text.len();
            return Some(text);
        }
        if !self.may_send_now(clock) {
            return None;
        }
        let now = self.now.take()?;
        let text = format!("{}{}}}", now.head, self.left_out);
        self.left_out = 0;
        self.sent_at = Some(clock);
        if self.sent.len() == MAX_SENT {
            self.sent.pop_front();
        }
        self.sent.push_back((now.n, now.made));
        Some(Arc::from(text))
    }

    /// The line is free: says whether the page is to get all anew.
    pub fn recover(&mut self) -> bool {
        let has_overflowed = std::mem::take(&mut self.has_overflowed);
        if has_overflowed {
            self.left_out = 0;
        }
        has_overflowed
    }

    /// The page has drawn this one.
    pub fn seen(&mut self, n: u64, clock: MonotonicNs) {
        // What was not sent cannot have been drawn.
        let newest = self.sent.back().map_or(0, |(n, _)| *n);
        self.seen = self.seen.max(n.min(newest));
        let seen = self.seen;
        // The newest that was drawn stays, however old: an order that has waited on its way names it.
        self.sent
            .retain(|(n, made)| *n >= seen || clock.since(*made) <= SEEN_AGE);
    }

    /// When this one was made; `None` if it was not sent, or is forgotten.
    pub fn made(&self, n: u64) -> Option<MonotonicNs> {
        let mut sent = self.sent.iter();
        sent.find_map(|(known, made)| (*known == n).then_some(*made))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * MS)
    }

    fn now(n: u64, ms: u64) -> NowText {
        NowText::new(n, at(ms), &format!("{{\"n\":{n},\"left_out\":0}}"))
    }

    fn outbox() -> Outbox {
        let mut outbox = Outbox::default();
        outbox.set_rate(20.0);
        outbox
    }

    #[test]
    fn two_unseen_are_the_most_and_the_third_is_replaced() {
        let mut outbox = outbox();
        let mut got = Vec::new();
        for n in 1..=10 {
            outbox.set_now(&now(n, n * 50), at(n * 50));
            got.extend(outbox.next(at(n * 50)));
        }
        assert_eq!(got.len(), MAX_UNSEEN);
        outbox.seen(1, at(500));
        assert_eq!(
            outbox.next(at(500)).as_deref(),
            Some("{\"n\":10,\"left_out\":7}")
        );
        assert_eq!(outbox.next(at(600)), None);
        // A number that was never sent makes no room for more than was sent.
        outbox.seen(u64::MAX, at(600));
        outbox.set_now(&now(11, 600), at(600));
        assert_eq!(
            outbox.next(at(600)).as_deref(),
            Some("{\"n\":11,\"left_out\":0}")
        );
    }

    #[test]
    fn the_rate_holds_and_what_waits_for_it_is_not_missed() {
        for (rate_hz, expected) in [
            (20.0, 20),
            (10.0, 10),
            (1000.0, 20),
            (0.0, 2),
            (f64::NAN, 20),
            (-1.0, 2),
        ] {
            let mut outbox = Outbox::default();
            outbox.set_rate(rate_hz);
            let mut got = 0;
            for n in 1..=20 {
                outbox.set_now(&now(n, n * 50), at(n * 50));
                if let Some(text) = outbox.next(at(n * 50)) {
                    assert!(text.ends_with("\"left_out\":0}"), "{text}");
                    outbox.seen(n, at(n * 50));
                    got += 1;
                }
            }
            assert_eq!(got, expected, "{rate_hz}");
        }
        let mut outbox = outbox();
        outbox.set_now(&now(1, 0), at(0));
        assert!(outbox.next(at(0)).is_some());
        assert_eq!(outbox.deadline(at(0)), None);
        outbox.set_now(&now(2, 10), at(10));
        assert_eq!(outbox.next(at(10)), None);
        assert_eq!(outbox.deadline(at(44)), Some(at(45)));
        assert_eq!(outbox.deadline(at(45)), None);
        assert!(outbox.next(at(45)).is_some());
        // Two are unseen: only the page makes room.
        outbox.set_now(&now(3, 60), at(60));
        assert_eq!(outbox.deadline(at(60)), None);
    }

    #[test]
    fn texts_keep_their_order_up_to_the_bound_and_then_all_goes() {
        let mut outbox = outbox();
        for index in 0..MAX_TEXTS {
            outbox.push(Arc::from(index.to_string()));
        }
        assert_eq!(outbox.next(at(0)).as_deref(), Some("0"));
        outbox.push(Arc::from("last"));
        assert!(!outbox.recover());
        let rest: Vec<_> = std::iter::from_fn(|| outbox.next(at(0))).collect();
        assert_eq!(
            (rest.len(), &*rest[0], &*rest[MAX_TEXTS - 1]),
            (MAX_TEXTS, "1", "last")
        );
        for index in 0..=MAX_TEXTS {
            outbox.push(Arc::from(index.to_string()));
        }
        outbox.set_now(&now(1, 0), at(0));
        outbox.push(Arc::from("lost"));
        assert_eq!(outbox.next(at(0)), None);
        assert!(outbox.recover() && !outbox.recover());
        outbox.push(Arc::from("anew"));
        assert_eq!(outbox.next(at(0)).as_deref(), Some("anew"));
        // By bytes, too.
        let large: Arc<str> = Arc::from("x".repeat(MAX_BYTES / 2));
        outbox.push(large.clone());
        outbox.push(large.clone());
        assert!(!outbox.recover());
        outbox.push(Arc::from("x"));
        assert!(outbox.recover());
    }

    #[test]
    fn an_order_names_what_was_sent_and_it_is_known_when_that_was_made() {
        let mut outbox = outbox();
        outbox.set_now(&now(7, 1000), at(1000));
        assert_eq!(outbox.made(7), None, "not sent yet");
        outbox.next(at(1500));
        let made = |outbox: &Outbox| [6, 7, 8].map(|n| outbox.made(n).map(|made| made.0 / MS));
        assert_eq!(made(&outbox), [None, Some(1000), None]);
        // The newest that was drawn is kept as long as no newer one is drawn.
        outbox.seen(7, at(60_000));
        assert_eq!(made(&outbox), [None, Some(1000), None]);
        outbox.restart_now(false);
        outbox.set_now(&now(8, 61_000), at(61_000));
        outbox.next(at(61_000));
        assert_eq!(made(&outbox), [None, Some(1000), Some(61_000)]);
        outbox.seen(8, at(61_000));
        assert_eq!(made(&outbox), [None, None, Some(61_000)]);
        outbox.restart_now(true);
        assert_eq!(made(&outbox), [None; 3]);
    }
}
