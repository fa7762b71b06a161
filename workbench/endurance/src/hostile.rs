//! [`Hostile`]: programs that send what no partner sends, at the rate that the measurement sets.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use fastrand::Rng;

use crate::site::Site;

/// Threads that send.
const SENDERS: u64 = 4;

/// Programs that send what no partner sends, at the rate that the measurement sets.
pub struct Hostile {
    over: Arc<AtomicBool>,
    sent: Arc<AtomicU64>,
    senders: Vec<JoinHandle<()>>,
}

impl Hostile {
    /// Begins to send `per_second`, each thread a row of so many at a time. `sender` makes what sends a row, and says
    /// how many of it were sent.
    pub fn start<S: FnMut(&mut Rng) -> u64 + Send + 'static>(
        site: &Site,
        per_second: u32,
        row: u32,
        sender: impl Fn() -> S,
    ) -> Hostile {
        let over = Arc::new(AtomicBool::new(false));
        let sent = Arc::new(AtomicU64::new(0));
        let period = Duration::from_secs(1) * row * SENDERS as u32 / per_second.max(1);
        let start = |number| {
            let (over, sent) = (Arc::clone(&over), Arc::clone(&sent));
            let (mut chance, mut send_row) = (site.chance(number), sender());
            thread::spawn(move || {
                let mut next = Instant::now();
                while !over.load(Ordering::Relaxed) {
                    sent.fetch_add(send_row(&mut chance), Ordering::Relaxed);
                    // What a stall of the machine has cost is not made up for.
                    next = (next + period).max(Instant::now());
                    thread::sleep(next.saturating_duration_since(Instant::now()));
                }
            })
        };
        let senders = (0..SENDERS).map(start).collect();
        Hostile {
            over,
            sent,
            senders,
        }
    }

    /// Ends, and says how many were sent.
    ///
    /// # Panics
    ///
    /// When a sender has.
    pub fn end(self) -> u64 {
        self.over.store(true, Ordering::Relaxed);
        for sender in self.senders {
            sender.join().expect("a sender that ends");
        }
        self.sent.load(Ordering::Relaxed)
    }
}
