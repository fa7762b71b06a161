//! [`Listener`]: a consumer that takes every sample as it comes, on a thread of its own, and notes when.

use std::os::fd::AsFd;
use std::sync::mpsc::{self, Receiver};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::{Descriptor, Domain, Ipc, Losses, MonotonicNs, RobotId, Topic, Waiter};
use ril_tests::process::WAIT_LIMIT;
use runtime::signal::{Termination, TerminationRequest};

use measure::Times;

/// A sample as it came.
#[derive(Clone, Copy, Debug)]
pub struct Heard<K> {
    /// When it came.
    pub at: MonotonicNs,
    /// What was kept of it.
    pub kept: K,
}

/// A consumer on a thread of its own that notes when each sample came.
pub struct Listener<K> {
    heard: Receiver<Heard<K>>,
    request: TerminationRequest,
    thread: JoinHandle<Losses>,
}

impl<K: Send + 'static> Listener<K> {
    /// Begins to listen to a robot's topic. `keep` says what of a sample is of interest.
    pub fn start<T: Topic>(
        domain: &Domain,
        robot: RobotId,
        mut keep: impl FnMut(&T) -> K + Send + 'static,
    ) -> Listener<K> {
        let (sender, heard) = mpsc::channel();
        let (termination, request) = Termination::by_hand().expect("a socket");
        let domain = domain.clone();
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, robot, "listener").expect("a part");
            let mut samples = ipc.subscriber::<T>().expect("a subscriber");
            // What was there before it began says nothing of now.
            let _ = samples.latest();
            let waiter = Waiter::new();
            while !termination.requested() {
                let mut ending = Descriptor::new(termination.as_fd());
                waiter
                    .wait(&mut [((), &mut samples), ((), &mut ending)], None)
                    .expect("a wait");
                // What cannot be received now can be by the next call, says the subscriber.
                let _ = samples.drain(|sample| {
                    let (at, kept) = (MonotonicNs::now(), keep(sample));
                    // At the end the other side may be gone.
                    let _ = sender.send(Heard { at, kept });
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
    pub fn next(&self) -> Heard<K> {
        self.heard.recv_timeout(WAIT_LIMIT).expect("telemetry")
    }

    /// The samples that come until this moment.
    pub fn until(&self, moment: MonotonicNs) -> Vec<Heard<K>> {
        let left = || moment.since(MonotonicNs::now());
        let next = || self.heard.recv_timeout(left()).ok();
        std::iter::from_fn(next).collect()
    }

    /// Waits for so many samples, and says how far apart they came.
    #[track_caller]
    pub fn gaps(&self, samples: usize) -> Times {
        let heard: Vec<_> = (0..=samples).map(|_| self.next()).collect();
        gaps(&heard).collect()
    }

    /// Ends. Gives what came that was not taken before, and how many samples came and did not in all.
    pub fn end(self) -> (Vec<Heard<K>>, Losses) {
        self.request.request();
        let losses = self.thread.join().expect("it ends in order");
        (self.heard.try_iter().collect(), losses)
    }
}

/// Between each two samples.
pub fn gaps<K>(heard: &[Heard<K>]) -> impl Iterator<Item = Duration> {
    heard.windows(2).map(|pair| pair[1].at.since(pair[0].at))
}
