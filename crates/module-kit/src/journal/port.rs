//! [`JournalPort`]: the topic of a journal. Pieces are published while there is a subscriber; without one, a wake of
//! the process costs a look at their number. Lines of the process's log are records among the others.

use std::time::Duration;

use ipc_types::service::SUBSCRIBER_BUFFER;
use ipc_types::{Ipc, JournalPiece, JournalTail, MonotonicNs, OpenError, Publisher, Source};
use runtime::logging::LogLines;

use super::codec::LogLine;
use super::writer::{JournalWriter, Piece};

/// Pieces of one burst: a quarter of what can wait for a subscriber, so that a long snapshot does not push out its own
/// beginning.
const BURST: usize = SUBSCRIBER_BUFFER / 4;

/// Shortest time between two bursts: a recorder that looks every 40 ms has room for those of that time.
const REST: Duration = Duration::from_millis(20);

/// Bytes of a process's beginning that wait for the first subscriber: some six seconds of a flight. A recorder that
/// comes until then has the process from its start.
const MAX_BEGINNING: usize = 128 << 10;

/// The publisher of a journal.
pub struct JournalPort<P: JournalPiece> {
    /// Its place for former generations makes it large, and the process that owns this port is moved: a thread's stack
    /// has 2 MiB.
    publisher: Box<Publisher<P>>,
    /// The publisher's count of joins when it was last looked at.
    joins: u64,
    /// What the writer has begins with the process, and no subscriber has come yet.
    is_beginning: bool,
    /// When the next burst may be.
    next: MonotonicNs,
    /// The last piece could not be published.
    is_failing: bool,
    /// `None` if another journal of this process has them.
    log: Option<LogLines>,
    /// What is not published when the process is killed.
    tail: JournalTail,
}

impl<P: JournalPiece> JournalPort<P> {
    /// Opens the topic.
    ///
    /// # Errors
    /// See [`OpenError`]; another process may publish it.
    pub fn open(ipc: &Ipc) -> Result<JournalPort<P>, OpenError> {
        let port = JournalPort {
            publisher: Box::new(ipc.publisher::<P>()?),
            tail: ipc.journal_tail::<P>()?,
            joins: 0,
            is_beginning: true,
            next: MonotonicNs(0),
            is_failing: false,
            log: LogLines::claim(),
        };
        port.want_log(true);
        Ok(port)
    }

    /// A writer whose pieces fit. It is started, so that the journal has the process from its beginning.
    pub fn writer() -> JournalWriter {
        let mut writer = JournalWriter::new(P::ROOM);
        writer.start();
        writer
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        &mut *self.publisher
    }

    /// To be called before the inputs of a wake: starts the journal when a subscriber has joined, and stops it when
    /// none is left.
    pub fn follow(&mut self, writer: &mut JournalWriter) {
        if !self.publisher.has_subscribers() {
            self.is_beginning &= writer.waiting() <= MAX_BEGINNING;
            if writer.is_started() && !self.is_beginning {
                writer.stop();
                self.tail.clear();
                self.want_log(false);
                tracing::debug!(topic = P::KEY, "the journal is not recorded any more");
            }
            return;
        }
        let joins = self.publisher.joins();
        let has_joined = std::mem::replace(&mut self.joins, joins) != joins;
        // The first one gets what begins with the process, and, as each one, how it is now.
        self.is_beginning = false;
        if !writer.is_started() {
            writer.start();
            self.want_log(true);
            tracing::debug!(topic = P::KEY, "the journal is recorded");
        } else if has_joined {
            writer.ask_for_snapshot();
        }
    }

    /// To be called after the inputs of a wake: publishes the pieces that are complete. A piece that cannot be
    /// published is lost, and the journal begins again.
    pub fn publish(&mut self, writer: &mut JournalWriter, now: MonotonicNs) {
        self.record_log(writer, now);
        if !writer.is_started() || self.is_beginning {
            return;
        }
        if now >= self.next {
            self.publish_pieces(writer, now);
        }
        let (waiting, open) = writer.unpublished();
        let number = self.publisher.sequence() + waiting + 1;
        let stamps = [self.publisher.epoch_ns(), number];
        self.tail
            .keep(now, stamps, open.begins, open.beginnings, &open.bytes);
    }

    fn publish_pieces(&mut self, writer: &mut JournalWriter, now: MonotonicNs) {
        for _ in 0..BURST {
            let Some(piece) = writer.next(now) else {
                return;
            };
            let is_sent = self.send(&piece, now);
            writer.give_back(piece);
            if !is_sent {
                return writer.start();
            }
        }
        self.next = now + REST;
    }

    /// The process ends: publishes all that is left.
    pub fn finish(&mut self, writer: &mut JournalWriter, now: MonotonicNs) {
        self.record_log(writer, now);
        if writer.is_started() {
            if !self.is_beginning {
                writer.take_all().all(|piece| self.send(&piece, now));
            }
            writer.stop();
            self.tail.clear();
        }
    }

    fn want_log(&self, is_wanted: bool) {
        if let Some(log) = &self.log {
            log.want(is_wanted);
        }
    }

    /// Writes the lines of the log that wait. Before the first snapshot they go on waiting.
    fn record_log(&self, writer: &mut JournalWriter, now: MonotonicNs) {
        let Some(log) = self.log.as_ref().filter(|_| writer.is_on()) else {
            return;
        };
        for line in log.drain() {
            let at = MonotonicNs(line.at_ns);
            writer.line(now, at, &LogLine::new(&line, log.take_lost()));
        }
    }

    fn send(&mut self, piece: &Piece, now: MonotonicNs) -> bool {
        let published = self.publisher.publish(|sample| {
            *sample = P::ZERO;
            sample.fill(now.0, piece.begins, piece.beginnings, &piece.bytes);
        });
        let was_failing = std::mem::replace(&mut self.is_failing, published.is_err());
        match published {
            Ok(_sequence) => true,
            Err(error) => {
                if !was_failing {
                    tracing::warn!(%error, "the journal has a gap");
                }
                false
            }
        }
    }

    /// When [`JournalPort::publish`] has something to do.
    pub fn deadline(&self, writer: &JournalWriter) -> Option<MonotonicNs> {
        match writer.has_full() {
            _ if self.is_beginning => None,
            true => Some(self.next),
            false => writer.deadline(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::journal::DELAY;
    use ipc_types::payload::StatusJournal;
    use ipc_types::{Domain, RobotId, Subscriber, Waiter};

    /// A module's journal and those who read it, in shared memory of its own and with a time that the test sets.
    struct Rig {
        ipc: Ipc,
        port: JournalPort<StatusJournal>,
        writer: JournalWriter,
        now: MonotonicNs,
        noise: u64,
    }

    impl Rig {
        fn new() -> Rig {
            let ipc = Ipc::join(&Domain::isolated(), RobotId::DEFAULT, "test").unwrap();
            let port = JournalPort::open(&ipc).unwrap();
            let (writer, now) = (
                JournalPort::<StatusJournal>::writer(),
                MonotonicNs(1_000_000_000),
            );
            Rig {
                ipc,
                port,
                writer,
                now,
                noise: 1,
            }
        }

        /// One wake of the module: it follows its readers, writes a snapshot when one is wanted, and publishes.
        fn wake(&mut self) {
            self.port.follow(&mut self.writer);
            if self.writer.wants_snapshot(self.now) {
                self.writer.snapshot(self.now, b"snapshot");
            }
            self.port.publish(&mut self.writer, self.now);
        }

        /// So many records of about a piece each, which the codec cannot make shorter.
        fn write(&mut self, records: usize) {
            for _ in 0..records {
                let bytes: [u8; 970] = std::array::from_fn(|_| {
                    self.noise = self
                        .noise
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    (self.noise >> 56) as u8
                });
                self.writer.input(self.now, &bytes.as_slice());
            }
        }

        /// A reader that the module has noticed.
        fn reader(&mut self) -> Subscriber<StatusJournal> {
            let reader = self.ipc.subscriber().unwrap();
            // The publisher notices it within a wait, which goes on to its limit.
            let (joins, limit) = (self.port.publisher.joins(), Some(REST));
            while self.port.publisher.joins() == joins {
                Waiter::new()
                    .wait(&mut [((), self.port.source())], limit)
                    .unwrap();
            }
            reader
        }

        /// The piece that a recorder would find if the module were killed now.
        fn left(&self) -> Option<u64> {
            let tail = self.ipc.left_tail::<StatusJournal>().unwrap().unwrap();
            tail.read::<StatusJournal>().map(|piece| piece.sequence)
        }

        fn later(&mut self, by: Duration) {
            self.now = self.now + by;
        }
    }

    /// What a reader got: how many pieces, and which of them begin with a snapshot.
    fn pieces(reader: &mut Subscriber<StatusJournal>) -> (usize, Vec<usize>) {
        let (mut count, mut beginnings) = (0, Vec::new());
        let take = |piece: &StatusJournal| {
            if piece.begins() {
                beginnings.push(count);
            }
            count += 1;
        };
        reader.drain(take).unwrap();
        (count, beginnings)
    }

    /// Of those that join later: the first piece may be the latest before them.
    fn ends_with_a_snapshot(reader: &mut Subscriber<StatusJournal>) -> bool {
        let (count, beginnings) = pieces(reader);
        count > 0 && beginnings.last() == Some(&(count - 1))
    }

    #[test]
    fn the_first_reader_has_the_process_from_its_beginning_and_each_one_a_snapshot() {
        let mut rig = Rig::new();
        rig.wake();
        rig.write(5);
        rig.later(DELAY);
        rig.wake();
        assert_eq!(
            (
                rig.port.deadline(&rig.writer),
                rig.port.publisher.sequence()
            ),
            (None, 0)
        );
        assert_eq!(rig.left(), None, "nobody reads");

        let mut first = rig.reader();
        rig.wake();
        rig.later(DELAY);
        rig.wake();
        let (count, beginnings) = pieces(&mut first);
        assert!(count >= 5, "{count}");
        assert_eq!(
            beginnings,
            [0, count - 1],
            "the beginning, and how it is now"
        );

        // A second one gets a snapshot of its own; for the first one the journal goes on.
        rig.write(1);
        let mut second = rig.reader();
        rig.later(DELAY);
        rig.wake();
        rig.later(DELAY);
        rig.wake();
        assert!(ends_with_a_snapshot(&mut second));
        assert_eq!((pieces(&mut first).1.len(), first.losses().lost), (1, 0));

        // Without a reader nothing is recorded, and a kill leaves nothing.
        rig.write(1);
        rig.wake();
        drop(first);
        rig.wake();
        assert!(rig.writer.is_started(), "one still reads");
        drop(second);
        rig.wake();
        assert_eq!((rig.writer.is_started(), rig.left()), (false, None));
        // The next one gets what begins with it.
        let mut third = rig.reader();
        rig.wake();
        assert!(rig.writer.is_started());
        rig.later(DELAY);
        rig.wake();
        assert!(ends_with_a_snapshot(&mut third));
    }

    #[test]
    fn a_beginning_that_nobody_reads_waits_up_to_its_bound() {
        let mut rig = Rig::new();
        rig.wake();
        rig.write(MAX_BEGINNING / 1000);
        // One that fills it to the last byte.
        let full = (1..MAX_BEGINNING).find_map(|length| {
            let mut writer = rig.writer.clone();
            writer.snapshot(rig.now, &vec![7; length]);
            (writer.waiting() == MAX_BEGINNING).then_some(writer)
        });
        rig.writer = full.unwrap();
        rig.wake();
        assert!(rig.writer.is_started());
        rig.write(1);
        rig.wake();
        assert_eq!((rig.writer.is_started(), rig.writer.waiting()), (false, 0));
    }

    #[test]
    fn bursts_are_bounded_and_the_tail_is_the_piece_that_would_be_next() {
        let mut rig = Rig::new();
        let mut reader = rig.reader();
        rig.wake();
        rig.later(DELAY);
        rig.wake();
        assert_eq!(pieces(&mut reader), (1, vec![0]));
        rig.later(REST);
        rig.write(2 * BURST);
        let before = rig.port.publisher.sequence();
        rig.wake();
        assert_eq!(pieces(&mut reader).0, BURST);
        assert_eq!(rig.port.deadline(&rig.writer), Some(rig.now + REST));
        let waiting = rig.writer.unpublished().0;
        assert_eq!(rig.left(), Some(before + BURST as u64 + waiting + 1));
        rig.wake();
        assert_eq!(pieces(&mut reader).0, 0, "between two bursts");
        rig.later(REST);
        rig.wake();
        assert_eq!(pieces(&mut reader).0, waiting as usize);
        assert_eq!(rig.port.deadline(&rig.writer), rig.writer.deadline());

        rig.write(3);
        rig.port.finish(&mut rig.writer, rig.now);
        assert!(pieces(&mut reader).0 >= 3, "the process ends");
        assert_eq!(
            (rig.writer.is_started(), rig.left(), reader.losses().lost),
            (false, None, 0)
        );
    }

    #[test]
    fn a_process_that_ends_before_a_reader_came_publishes_nothing() {
        let mut rig = Rig::new();
        rig.wake();
        rig.write(3);
        rig.port.finish(&mut rig.writer, rig.now);
        assert_eq!(
            (rig.port.publisher.sequence(), rig.writer.is_started()),
            (0, false)
        );
    }
}
