//! [`Healthy`]: a consumer that does everything right, and hears what the others cost it.

use std::fs;
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};

use ipc_types::service::Topic;
use ipc_types::{Descriptor, Domain, Ipc, Losses, MonotonicNs, RobotId, Waiter};
use runtime::signal::{Termination, TerminationRequest};

use crate::spread::Spread;

/// What a healthy consumer got.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    /// Samples that came and that did not.
    pub losses: Losses,
    /// Between two samples.
    pub gaps: Spread,
    /// Between two samples with another generation in between, or right after it.
    pub gaps_at_generations: Spread,
}

/// A consumer that takes every sample as it comes, on a thread of its own, and notes how far apart they came.
pub struct Healthy {
    request: TerminationRequest,
    thread: JoinHandle<Heard>,
}

impl Healthy {
    /// Begins to listen.
    pub fn start<T: Topic>(domain: &Domain) -> Healthy {
        let (termination, request) = Termination::by_hand().expect("a socket");
        let domain = domain.clone();
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, RobotId::DEFAULT, "healthy").expect("a part");
            let mut samples = ipc.subscriber::<T>().expect("a subscriber");
            let waiter = Waiter::new();
            let mut clock = Clock::new(domain.root(), T::KEY);
            while !termination.requested() {
                let mut ending = Descriptor::new(termination.as_fd());
                waiter
                    .wait(&mut [((), &mut samples), ((), &mut ending)], None)
                    .expect("a wait");
                samples.drain(|_| clock.tick()).expect("samples");
            }
            Heard {
                losses: samples.losses(),
                ..clock.heard
            }
        });
        Healthy { request, thread }
    }

    /// Ends, and says what came.
    pub fn end(self) -> Heard {
        self.request.request();
        self.thread.join().expect("it ends in order")
    }
}

/// Notes when samples come, and of which generation the service is then.
struct Clock {
    current: PathBuf,
    generation: String,
    last: Option<MonotonicNs>,
    /// Whether the gap before this one had another generation in it.
    has_changed: bool,
    heard: Heard,
}

impl Clock {
    fn new(root: &Path, key: &str) -> Clock {
        let robot = root.join(RobotId::DEFAULT.to_string());
        Clock {
            current: robot.join(key).join("current"),
            generation: String::new(),
            last: None,
            has_changed: false,
            heard: Heard::default(),
        }
    }

    fn tick(&mut self) {
        let now = MonotonicNs::now();
        let generation = fs::read_to_string(&self.current).unwrap_or_default();
        let changes = generation != self.generation;
        self.generation = generation;
        if let Some(last) = self.last.replace(now) {
            let gap = now.since(last);
            self.heard.gaps.push(gap);
            if changes || self.has_changed {
                self.heard.gaps_at_generations.push(gap);
            }
            self.has_changed = changes;
        }
    }
}
