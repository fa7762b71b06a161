//! [`Listener`]: a consumer that takes every sample as it comes, on a thread of its own, and notes when.

use std::fs;
use std::os::fd::AsFd;
use std::sync::mpsc::{self, Receiver};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::service::Topic;
use ipc_types::{Descriptor, Domain, Ipc, Losses, MonotonicNs, RobotId, Waiter};
use ril_tests::process::WAIT_LIMIT;
use runtime::signal::{Termination, TerminationRequest};

use crate::outcome::Times;

/// A sample as it came.
pub struct Heard {
    /// When its publisher started.
    pub publisher_ns: u64,
    /// When it came.
    pub at: MonotonicNs,
    /// The generation of shared memory that was in use then.
    generation: String,
}

/// See the module's documentation.
pub struct Listener {
    heard: Receiver<Heard>,
    request: TerminationRequest,
    thread: JoinHandle<Losses>,
}

/// What a listener got in all.
pub struct Summary {
    /// Samples that came and that did not.
    pub losses: Losses,
    /// Between two samples.
    pub gaps: Times,
    /// Between two samples with another generation in between, or right after it.
    pub gaps_at_generations: Times,
}

impl Listener {
    /// Begins to listen. `publisher_ns` reads from a sample when its publisher started.
    pub fn start<T: Topic>(domain: &Domain, publisher_ns: fn(&T) -> u64) -> Listener {
        let (sender, heard) = mpsc::channel();
        let (termination, request) = Termination::by_hand().expect("a socket");
        let domain = domain.clone();
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "listener").expect("a part");
            let mut samples = ipc.subscriber::<T>().expect("a subscriber");
            let waiter = Waiter::new();
            let robot = domain.root().join(RobotId::DEFAULT.to_string());
            let current = robot.join(T::KEY).join("current");
            while !termination.requested() {
                let mut ending = Descriptor::new(termination.as_fd());
                waiter
                    .wait(&mut [((), &mut samples), ((), &mut ending)], None)
                    .expect("a wait");
                // What cannot be received now can be by the next call, says the subscriber.
                let _ = samples.drain(|sample| {
                    // At the end the other side may be gone.
                    let _ = sender.send(Heard {
                        publisher_ns: publisher_ns(sample),
                        at: MonotonicNs::now(),
                        generation: fs::read_to_string(&current).unwrap_or_default(),
                    });
                });
            }
            samples.losses()
        });
        Listener {
            heard,
            request,
            thread,
        }
    }

    /// The next sample.
    ///
    /// # Panics
    ///
    /// After [`WAIT_LIMIT`].
    #[track_caller]
    pub fn next(&self) -> Heard {
        self.heard.recv_timeout(WAIT_LIMIT).expect("telemetry")
    }

    /// Waits for so many samples, and says how far apart they came.
    #[track_caller]
    pub fn gaps(&self, samples: usize) -> Times {
        let mut last = self.next().at;
        let mut gaps = Times::default();
        for _ in 0..samples {
            let next = self.next().at;
            gaps.push(next.since(last));
            last = next;
        }
        gaps
    }

    /// Ends, and says what came that was not taken by [`Listener::next`].
    pub fn end(self) -> Summary {
        self.request.request();
        let losses = self.thread.join().expect("it ends in order");
        let mut summary = Summary {
            losses,
            gaps: Times::default(),
            gaps_at_generations: Times::default(),
        };
        let heard: Vec<Heard> = self.heard.try_iter().collect();
        for (index, pair) in heard.windows(2).enumerate() {
            let gap = pair[1].at.since(pair[0].at);
            summary.gaps.push(gap);
            let from = index.saturating_sub(1);
            let mut near = heard[from..index + 2].windows(2);
            if near.any(|pair| pair[0].generation != pair[1].generation) {
                summary.gaps_at_generations.push(gap);
            }
        }
        summary
    }
}

impl Summary {
    /// Whether samples were lost although the listener ran: one that the machine has not let run for as long as its buffer lasts may
    /// lose what that cannot hold, and no other process has cost it that.
    pub fn is_harmed(&self, buffered: Duration) -> bool {
        self.losses.lost > 0 && self.gaps.0.iter().all(|gap| *gap <= buffered)
    }
}
