//! [`PiecePort`]: a topic on which something goes that is larger than one sample, piece by piece; [`Rounds`]: when,
//! which is pure.
//!
//! | | pieces are sent |
//! |---|---|
//! | no subscriber | never |
//! | another whole is to be sent, or a subscriber has come | all, from the first on; what was under way of another one ends |
//! | nothing of that for 10 s, or 2 s for each piece when that is longer | all again |
//!
//! So a consumer that missed a piece, or stands behind a relay that came later, has the whole of a usual fence within
//! 10 s, and a narrow radio carries at most half a kilobyte a second for it.

use std::ops::Range;
use std::time::Duration;

use ipc_types::{Ipc, MonotonicNs, OpenError, Publisher, Source, Topic};

/// Pieces that are sent at once: as many as wait in a relay, and few beside what waits for a subscriber.
const BURST: usize = 16;

/// Shortest time between two bursts.
const REST: Duration = Duration::from_millis(20);

/// Shortest time until all pieces are sent again.
const AGAIN: Duration = Duration::from_secs(10);

/// Time until then for each piece.
const AGAIN_PER_PIECE: Duration = Duration::from_secs(2);

/// The publisher of a topic on which something goes piece by piece.
pub struct PiecePort<P: Topic> {
    /// Its place for former generations makes it large, as that of a journal.
    publisher: Box<Publisher<P>>,
    rounds: Rounds,
    /// The last piece could not be published.
    is_failing: bool,
}

impl<P: Topic> PiecePort<P> {
    /// Opens the topic.
    ///
    /// # Errors
    /// See [`OpenError`]; another process may publish it.
    pub fn open(ipc: &Ipc) -> Result<PiecePort<P>, OpenError> {
        Ok(PiecePort {
            publisher: Box::new(ipc.publisher()?),
            rounds: Rounds::default(),
            is_failing: false,
        })
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        &mut *self.publisher
    }

    /// Publishes what is due now of the whole `number`, which has so many `pieces`. What cannot be published comes with
    /// the next round.
    pub fn publish(
        &mut self,
        now: MonotonicNs,
        (number, pieces): (u64, usize),
        piece: impl Fn(usize) -> Option<P>,
    ) {
        let listeners = (self.publisher.has_subscribers(), self.publisher.joins());
        let due = self.rounds.due(now, (number, pieces), listeners);
        // A large sample is made within the loop alone: a round of no pieces touches none.
        for index in due {
            let Some(piece) = piece(index) else { break };
            let published = self.publisher.publish_batched(|sample| *sample = piece);
            let was_failing = std::mem::replace(&mut self.is_failing, published.is_err());
            if let Err(error) = published {
                if !was_failing {
                    tracing::warn!(%error, topic = P::KEY, "a piece was not published");
                }
                break;
            }
        }
        self.publisher.end_batch();
    }

    /// When [`PiecePort::publish`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.rounds.deadline()
    }
}

/// Which pieces are sent when: see the table of this file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rounds {
    /// What the last round was of: the number of the whole, and how often subscribers had joined.
    of: Option<(u64, u64)>,
    /// The next piece of the round under way.
    next: Option<usize>,
    /// The next burst is not before.
    rested: MonotonicNs,
    /// All pieces are sent again then.
    again: MonotonicNs,
}

impl Rounds {
    /// The pieces to send now, of the whole `number` with so many. They count as sent.
    pub fn due(
        &mut self,
        now: MonotonicNs,
        (number, pieces): (u64, usize),
        (has_subscribers, joins): (bool, u64),
    ) -> Range<usize> {
        if !has_subscribers {
            *self = Rounds::default();
            return 0..0;
        }
        let of = Some((number, joins));
        if self.of != of || now >= self.again {
            self.of = of;
            self.next = Some(0);
            self.again = now + AGAIN.max(AGAIN_PER_PIECE * pieces as u32);
        }
        match self.next {
            Some(first) if now >= self.rested => {
                let end = (first + BURST).min(pieces);
                self.next = (end < pieces).then_some(end);
                self.rested = now + REST;
                first..end
            }
            _ => 0..0,
        }
    }

    /// When the round under way goes on. The next one begins with any later wake of the process: its state is published
    /// each second.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.next.map(|_| self.rested)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_sent_at_a_change_to_who_comes_and_again_in_time() {
        let ms = |ms: u64| MonotonicNs(ms * 1_000_000);
        // Moment in ms, number and pieces, whether there are subscribers and joins, what is sent, when it goes on.
        type Row = (u64, (u64, usize), (bool, u64), Range<usize>, Option<u64>);
        let table: [Row; 14] = [
            (0, (1, 4), (false, 0), 0..0, None),
            (10, (1, 4), (true, 1), 0..4, None),
            (20, (1, 4), (true, 1), 0..0, None),
            (40, (2, 4), (true, 1), 0..4, None),
            (60, (2, 4), (true, 2), 0..4, None),
            (10_059, (2, 4), (true, 2), 0..0, None),
            (10_060, (2, 4), (true, 2), 0..4, None),
            // A large one goes in bursts, and a change begins it again.
            (10_080, (3, 40), (true, 2), 0..16, Some(10_100)),
            (10_090, (3, 40), (true, 2), 0..0, Some(10_100)),
            (10_100, (3, 40), (true, 2), 16..32, Some(10_120)),
            (10_110, (4, 20), (true, 2), 0..0, Some(10_120)),
            (10_120, (4, 20), (true, 2), 0..16, Some(10_140)),
            (10_150, (4, 20), (true, 2), 16..20, None),
            (50_109, (4, 20), (true, 2), 0..0, None),
        ];
        let mut rounds = Rounds::default();
        for (at, outline, subscribers, sent, next) in table {
            let due = rounds.due(ms(at), outline, subscribers);
            assert_eq!((due, rounds.deadline()), (sent, next.map(ms)), "{at} ms");
        }
        assert_eq!(rounds.due(ms(50_110), (4, 20), (true, 2)), 0..16);
        assert_eq!(rounds.due(ms(50_120), (4, 20), (false, 2)), 0..0);
        assert_eq!(
            rounds.due(ms(50_130), (4, 20), (true, 3)),
            0..16,
            "one that comes later has all"
        );
    }
}
