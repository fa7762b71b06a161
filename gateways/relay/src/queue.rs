//! [`Queue`]: what has arrived and was not taken yet. Neither many messages nor long ones fill the memory: the newest stay.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

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
pub struct Queue<T> {
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
    pub fn new(room: Room) -> Queue<T> {
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
    pub fn push(&self, bytes: usize, message: T) -> bool {
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
    pub fn dropped(&self) -> u64 {
        let waiting = self.waiting.lock();
        waiting.unwrap_or_else(PoisonError::into_inner).dropped
    }

    /// Takes all that is there at this moment, oldest first. What comes meanwhile waits for the next time, so that a flood keeps
    /// nothing else from being done.
    pub fn take(&self) -> impl Iterator<Item = T> {
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
