//! [`Inbox`]: what arrives, until the relay's one thread takes it. It waits in a [`Queue`], of which neither many
//! messages nor long ones fill the memory: the newest stay.

use std::cell::Cell;
use std::collections::VecDeque;
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, PoisonError};

use ipc_types::MonotonicNs;
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::sample::Sample;

use crate::failure::NetworkError;

/// What arrives under a key expression.
pub struct Inbox {
    queues: Arc<Queues>,
    key: String,
    /// At how many dropped messages the next line is logged.
    next_line: Cell<u64>,
    _subscriber: zenoh::pubsub::Subscriber<()>,
}

/// A sample, and when it came.
type TimedSample = (MonotonicNs, Sample);

/// A message that has come.
pub struct ReceivedMessage<'a> {
    /// Where it was sent to.
    pub key: &'a str,
    /// When it came.
    pub at: MonotonicNs,
    /// Its bytes.
    pub payload: &'a [u8],
    /// What was attached; empty when nothing was.
    pub attachment: &'a [u8],
}

/// What has arrived: under keys that were named, and under others.
struct Queues {
    own_keys: Vec<String>,
    own: Queue<TimedSample>,
    others: Queue<TimedSample>,
}

impl Queues {
    fn push(&self, sample: Sample) -> bool {
        let bytes = sample.payload().len() + sample.attachment().map_or(0, ZBytes::len);
        let key = sample.key_expr().as_str();
        let queue = match self.own_keys.iter().any(|own| own == key) {
            true => &self.own,
            false => &self.others,
        };
        queue.push(bytes, (MonotonicNs::now(), sample))
    }
}

impl Inbox {
    /// See [`Network::receive`](super::Network::receive). `arrivals` can be read when something has come.
    pub(super) fn open(
        session: &zenoh::Session,
        arrivals: &Arc<OwnedFd>,
        key: &str,
        own: Vec<String>,
        room: Room,
    ) -> Result<Inbox, NetworkError> {
        let queues = Arc::new(Queues {
            own_keys: own,
            own: Queue::new(room),
            others: Queue::new(room),
        });
        let (arriving, arrivals) = (Arc::clone(&queues), Arc::clone(arrivals));
        let callback = move |sample: Sample| {
            if arriving.push(sample) {
                // It fails when it has been written 2⁶⁴ − 2 times, and can be read then.
                let _ = rustix::io::write(&*arrivals, &1_u64.to_ne_bytes());
            }
        };
        let subscriber = session
            .declare_subscriber(key.to_owned())
            .callback(callback)
            .wait()
            .map_err(|error| {
                NetworkError::new(format!("nothing can be received at {key}"), error)
            })?;
        Ok(Inbox {
            queues,
            key: key.to_owned(),
            next_line: Cell::new(1),
            _subscriber: subscriber,
        })
    }

    /// Hands on every message that is there, those under named keys first, each kind in the order of arrival, and none
    /// that comes meanwhile.
    pub fn drain(&self, mut take: impl FnMut(&ReceivedMessage<'_>)) {
        for (at, sample) in self.queues.own.take().chain(self.queues.others.take()) {
            let payload = sample.payload().to_bytes();
            let attachment = sample.attachment().map(|bytes| bytes.to_bytes());
            take(&ReceivedMessage {
                key: sample.key_expr().as_str(),
                at,
                payload: &payload,
                attachment: attachment.as_deref().unwrap_or_default(),
            });
        }
        self.note_dropped();
    }

    /// Said once, and then each time that their number has doubled: what the relay did not take in time is no loss of
    /// the link.
    fn note_dropped(&self) {
        let count = self.queues.own.dropped() + self.queues.others.dropped();
        if count >= self.next_line.get() {
            self.next_line.set(count.saturating_mul(2));
            tracing::warn!(
                key = self.key,
                count,
                "messages were dropped because this relay did not take them in time"
            );
        }
    }
}

/// How much may wait in a `Queue`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Messages.
    pub messages: usize,
    /// Bytes of all messages together.
    pub bytes: usize,
    /// Bytes of one message; a longer one is no message, and is dropped before anything is done with it.
    pub longest: usize,
}

/// A queue between the threads of the network and the relay's own.
#[derive(Debug)]
struct Queue<T> {
    room: Room,
    waiting: Mutex<Waiting<T>>,
}

#[derive(Debug)]
struct Waiting<T> {
    messages: VecDeque<(usize, T)>,
    bytes: usize,
    dropped: u64,
}

impl<T> Queue<T> {
    /// An empty one.
    fn new(room: Room) -> Queue<T> {
        Queue {
            room,
            waiting: Mutex::new(Waiting {
                messages: VecDeque::new(),
                bytes: 0,
                dropped: 0,
            }),
        }
    }

    /// Adds a message of so many bytes. The oldest ones go when there is no room. Says whether it was added.
    fn push(&self, bytes: usize, message: T) -> bool {
        if bytes > self.room.longest {
            return false;
        }
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        while waiting.messages.len() >= self.room.messages
            || waiting.bytes + bytes > self.room.bytes
        {
            match waiting.messages.pop_front() {
                Some((oldest, _)) => {
                    waiting.bytes -= oldest;
                    waiting.dropped += 1;
                }
                None => return false,
            }
        }
        waiting.bytes += bytes;
        waiting.messages.push_back((bytes, message));
        true
    }

    /// Messages that went because there was no room, since the beginning.
    fn dropped(&self) -> u64 {
        let waiting = self.waiting.lock();
        waiting.unwrap_or_else(PoisonError::into_inner).dropped
    }

    /// Takes all that is there at this moment, oldest first. What comes meanwhile waits for the next time, so that a
    /// flood keeps nothing else from being done.
    fn take(&self) -> impl Iterator<Item = T> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.bytes = 0;
        let messages = std::mem::take(&mut waiting.messages);
        messages.into_iter().map(|(_, message)| message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn queue() -> Queue<u32> {
        Queue::new(Room {
            messages: 3,
            bytes: 100,
            longest: 60,
        })
    }

    #[test]
    fn the_newest_stay_when_there_are_too_many() {
        let queue = queue();
        for message in 0..10 {
            assert!(queue.push(1, message));
        }
        assert_eq!(queue.take().collect::<Vec<_>>(), [7, 8, 9]);
        assert_eq!(queue.dropped(), 7);
        assert_eq!(queue.take().count(), 0);
    }

    #[test]
    fn the_newest_stay_when_there_are_too_many_bytes_and_longer_ones_than_the_longest_are_dropped()
    {
        let queue = queue();
        assert!(queue.push(40, 1) && queue.push(40, 2) && queue.push(60, 3));
        assert!(!queue.push(61, 4));
        assert_eq!(queue.take().collect::<Vec<_>>(), [2, 3]);
        assert!(
            queue.push(60, 5) && queue.push(40, 6),
            "the room is free again"
        );
        assert_eq!(queue.take().count(), 2);
    }
}
