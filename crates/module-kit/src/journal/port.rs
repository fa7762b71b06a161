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
        if self.publisher.subscribers() == 0 {
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
