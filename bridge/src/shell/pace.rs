//! [`Pace`]: for how long the line is left alone while the rest of a message is on its way. A line brings a status in
//! pieces, and each would wake the bridge; after its first bytes the length of the message is known, and the speed of
//! the line.
//!
//! | line | the message goes on | its time is over | it is whole | a long one has begun |
//! |---|---|---|---|---|
//! | is left alone | until the same moment | watched, piece by piece | watched | left alone for its rest |
//! | is watched | watched | watched | watched | left alone for its rest |
//!
//! What follows a message on the line comes after it, so nothing waits behind this. A byte that is lost, or a damaged
//! one that looks like the beginning of a long message, delays what follows by the time of one message. `VMIN` would
//! wake the bridge with the last byte, but a driver may talk to its adapter, and wait for it, whenever a terminal's
//! settings change: that of FTDI does.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::config::SerialConfig;
use crate::link::line::Line;

/// Rests that are shorter, 1.4 ms at 115200 baud, come with the next piece: a usual UART hands on 8 to 16 bytes at
/// once.
const SHORTEST_REST: usize = 16;

/// How much later than it came from the line a byte may be read, while the line was watched: an adapter keeps it back
/// for up to 16 ms. What comes sooner than a line of this speed can bring it is not paced, such as that of a
/// pseudo-terminal.
const LATE: Duration = Duration::from_millis(20);

/// For how long a line that brought too much is not taken for a paced one.
const LONGEST_DEBT: Duration = Duration::from_secs(1);

/// The rest of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct RestOfMessage {
    /// When it has come.
    whole: MonotonicNs,
    /// Bytes that are missing.
    len: usize,
}

/// What is known of the pace of the line.
#[derive(Debug)]
pub(super) struct Pace {
    line: Line,
    /// When the line was found empty last.
    empty: MonotonicNs,
    /// Until when a line of this speed takes for what was read.
    busy: MonotonicNs,
    rest: Option<RestOfMessage>,
    /// When to read it, while the line is left alone.
    due: Option<MonotonicNs>,
}

impl Pace {
    pub fn new(config: &SerialConfig) -> Pace {
        Pace {
            line: Line {
                byte: config.byte_time(),
                ..Line::default()
            },
            empty: MonotonicNs(0),
            busy: MonotonicNs(0),
            rest: None,
            due: None,
        }
    }

    /// When the line is to be read although nothing of it wakes the bridge; `None` while it is watched.
    pub fn due(&self) -> Option<MonotonicNs> {
        self.due
    }

    /// `len` bytes were read; of the message that has begun with the last of them, so many are `missing`. The line is
    /// empty, or has more.
    pub fn read(&mut self, now: MonotonicNs, len: usize, missing: usize, is_empty: bool) {
        let rest = self.rest.take().map(|rest| RestOfMessage {
            len: rest.len.saturating_sub(len),
            ..rest
        });
        let goes_on = rest.filter(|rest| rest.len > 0 && missing > 0);
        let busy = self.busy.max(self.empty) + self.line.time_of(len);
        self.busy = busy.min(now + LONGEST_DEBT);
        self.empty = now;
        let is_paced = is_empty && self.busy <= now + LATE;
        self.rest = goes_on.or_else(|| {
            let whole = now + self.line.time_of(missing);
            (is_paced && missing >= SHORTEST_REST).then_some(RestOfMessage {
                whole,
                len: missing,
            })
        });
        let whole = self.rest.map(|rest| rest.whole);
        self.due = whole.filter(|whole| *whole > now && is_paced);
    }

    /// The port is another one, or is gone: its line is watched.
    pub fn forget(&mut self) {
        (self.rest, self.due) = (None, None);
    }
}

#[cfg(test)]
mod tests {
    use dsp_protocol::{Decoder, Downlink, MAX_FRAME_LEN};

    use super::*;
    use crate::translate::tests::full;

    /// A line that takes 100 µs for a byte, and has been empty since a second ago.
    fn pace() -> (Pace, MonotonicNs) {
        let config = SerialConfig {
            baud_rate: 100_000,
            ..SerialConfig::default()
        };
        let mut pace = Pace::new(&config);
        let start = MonotonicNs(5_000_000_000);
        pace.read(start, 0, 0, true);
        (pace, start + Duration::from_secs(1))
    }

    fn us(count: u64) -> Duration {
        Duration::from_micros(count)
    }

    /// Reads at these moments after the first, µs, with bytes and what is missing; when the next one is due, if the
    /// line is left alone.
    #[track_caller]
    fn check(reads: &[(u64, usize, usize, Option<u64>)]) {
        let (mut pace, start) = pace();
        for (at, len, missing, due) in reads {
            pace.read(start + us(*at), *len, *missing, true);
            assert_eq!(pace.due(), due.map(|due| start + us(due)), "at {at}");
        }
    }

    #[test]
    fn a_long_message_is_waited_for_once_and_what_is_short_never() {
        // A status of 128 bytes, then another one.
        check(&[
            (0, 16, 112, Some(11_200)),
            (11_200, 112, 0, None),
            (20_000, 16, 112, Some(31_200)),
        ]);
        // An acknowledgement of 6 bytes, cut; and a message that nearly is there.
        check(&[(0, 2, 4, None), (400, 4, 0, None)]);
        check(&[(0, 120, SHORTEST_REST - 1, None)]);
        // Of the header alone the length is not known.
        check(&[(0, 1, 5, None), (600, 6, 121, Some(12_700))]);
    }

    #[test]
    fn a_request_in_between_does_not_move_the_moment_and_a_late_rest_is_watched() {
        check(&[
            (0, 16, 112, Some(11_200)),
            (3_000, 30, 82, Some(11_200)),
            (11_200, 66, 16, None),
            (12_800, 16, 0, None),
        ]);
    }

    #[test]
    fn a_lost_byte_costs_nothing_more_and_the_next_message_is_waited_for() {
        check(&[
            (0, 16, 112, Some(11_200)),
            // One byte was lost, and an acknowledgement follows, whose header ends the message.
            (11_200, 111, 1, None),
            (11_500, 3, 0, None),
            (20_000, 16, 112, Some(31_200)),
            // The next message comes at once; its first bytes stand in for those that were lost.
            (31_200, 111, 1, None),
            (32_800, 16, 113, Some(44_100)),
        ]);
    }

    #[test]
    fn what_follows_a_whole_message_at_once_is_waited_for_by_itself() {
        check(&[
            (0, 16, 112, Some(11_200)),
            (13_200, 132, 108, Some(24_000)),
            (24_000, 108, 0, None),
        ]);
    }

    #[test]
    fn a_line_that_brings_more_than_its_speed_allows_is_not_left_alone() {
        let (mut pace, mut now) = pace();
        // A frame of 12.8 ms each millisecond, with the beginning of the next one.
        let mut was_left_alone = 0;
        for _ in 0..50 {
            now = now + us(1_000);
            pace.read(now, 128, 100, true);
            was_left_alone += u32::from(pace.due().is_some());
        }
        assert!(was_left_alone <= 2, "{was_left_alone}");
        // It is one again some time after it was slow again.
        now = now + 2 * LONGEST_DEBT;
        pace.read(now, 16, 112, true);
        assert!(pace.due().is_some());
        // What was read is not all that is there.
        pace.forget();
        now = now + LONGEST_DEBT;
        pace.read(now, 4096, 112, false);
        assert_eq!(pace.due(), None);
    }

    /// When each message of a line is read after its last byte came, µs, by its length. The line brings eight bytes at
    /// once, of which each is lost, or damaged, once in `fault`.
    fn read_after(seed: u64, fault: Option<u64>) -> Vec<(usize, u64)> {
        let mut random = fastrand::Rng::with_seed(seed);
        let (mut pace, start) = pace();
        let mut decoder = Decoder::<Downlink>::new();
        let ack = Downlink::Ack { command: 5 };
        // What waits on the line, with the moment at which it came, and which messages are whole.
        let (mut line, mut whole) = (vec![], vec![]);
        let (mut at, mut after) = (0, vec![]);
        for _ in 0..400 {
            at += random.u64(..20_000);
            let message = match random.bool() {
                true => Downlink::Status(full()),
                false => ack,
            };
            let frame = message.encode();
            let mut is_sound = true;
            for byte in frame.as_bytes() {
                at += 100;
                let is_faulty = fault.is_some_and(|fault| random.u64(..fault) == 0);
                is_sound &= !is_faulty;
                match is_faulty {
                    true if random.bool() => {}
                    true => line.push((at, random.u8(..))),
                    false => line.push((at, *byte)),
                }
            }
            if is_sound {
                whole.push((at, frame.as_bytes().len()));
            }
        }
        let mut line = &line[..];
        while let [(first, _), ..] = line {
            let piece = line[line.len().min(8) - 1].0.min(first + 700);
            let due = pace.due().map(|due| due.since(start).as_micros() as u64);
            let now = due.unwrap_or(piece);
            let there = line.partition_point(|(came, _)| *came <= now);
            let bytes: Vec<u8> = line[..there].iter().map(|(_, byte)| *byte).collect();
            line = &line[there..];
            let mut input = &bytes[..];
            while !input.is_empty() {
                let (taken, _) = decoder.decode(input);
                input = &input[taken..];
            }
            pace.read(start + us(now), there, decoder.missing(), true);
            let read = whole.partition_point(|(came, _)| *came <= now);
            after.extend(whole.drain(..read).map(|(came, len)| (len, now - came)));
        }
        after
    }

    #[test]
    fn no_message_waits_for_longer_than_a_piece_and_after_a_fault_than_a_message() {
        for seed in 0..50 {
            for (len, after) in read_after(seed, None) {
                assert!(after <= 800, "seed {seed}: {len} bytes after {after} µs");
            }
            for (len, after) in read_after(seed, Some(100)) {
                let longest = 100 * MAX_FRAME_LEN as u64 + 800;
                assert!(
                    after <= longest,
                    "seed {seed}: {len} bytes after {after} µs"
                );
            }
        }
    }

    #[test]
    fn what_an_adapter_kept_back_is_of_a_paced_line() {
        // FTDI: 62 bytes, or 16 ms.
        check(&[(16_000, 10, 118, Some(27_800)), (27_800, 118, 0, None)]);
    }
}
