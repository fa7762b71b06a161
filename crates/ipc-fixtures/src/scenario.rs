//! [`Scenario`]: what a topic says over time, written down, and played by a stand-in.

use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::{Domain, Topic};

use crate::garbage::Garbage;
use crate::stand_in::StandInTopic;

/// What a publisher of `T` does, step by step.
///
/// Samples are published as fast as the subscribers read them: the moment of each is what the caller writes into it.
/// Only a [`stall`](Scenario::stall) takes its time.
#[derive(Clone, Debug)]
pub struct Scenario<T> {
    period: Duration,
    /// How long the samples so far last.
    length: Duration,
    steps: Vec<Step<T>>,
}

#[derive(Clone, Debug)]
enum Step<T> {
    Sample(T),
    Stall(Duration),
    Restart,
}

impl<T: Topic> Scenario<T> {
    /// One sample in each `period`.
    ///
    /// # Panics
    ///
    /// When that is 0.
    pub fn every(period: Duration) -> Scenario<T> {
        assert!(!period.is_zero(), "samples need a period");
        Scenario {
            period,
            length: Duration::ZERO,
            steps: Vec::new(),
        }
    }

    /// Samples for `length`, each of the time since the scenario's first one.
    pub fn run(mut self, length: Duration, mut value: impl FnMut(Duration) -> T) -> Scenario<T> {
        let end = self.length + length;
        while self.length < end {
            self.steps.push(Step::Sample(value(self.length)));
            self.length += self.period;
        }
        self
    }

    /// So many samples of any bit pattern, as a faulty publisher may send them; always the same for the same seed.
    pub fn garbage(mut self, seed: u64, samples: usize) -> Scenario<T> {
        let mut garbage = Garbage::new(seed);
        self.steps
            .extend((0..samples).map(|_| Step::Sample(garbage.payload())));
        self.length += self.period * samples as u32;
        self
    }

    /// The publisher lives and is silent for so long.
    pub fn stall(mut self, length: Duration) -> Scenario<T> {
        self.steps.push(Step::Stall(length));
        self.length += length;
        self
    }

    /// The publisher dies without a word when everything before was taken, and another one begins, which counts from 1.
    pub fn restart(mut self) -> Scenario<T> {
        self.steps.push(Step::Restart);
        self
    }

    /// The samples, in order.
    pub fn samples(&self) -> impl Iterator<Item = &T> {
        self.steps.iter().filter_map(|step| match step {
            Step::Sample(sample) => Some(sample),
            Step::Stall(_) | Step::Restart => None,
        })
    }

    /// Plays it in `domain` for robot 1, on a thread of its own.
    ///
    /// # Panics
    ///
    /// When the topic cannot be stood in for, with the reason.
    pub fn play(self, domain: &Domain) -> Playing<T> {
        let (stop, stopped) = mpsc::channel::<()>();
        let domain = domain.clone();
        let mut stand_in = StandInTopic::start(&domain);
        let thread = thread::spawn(move || {
            for step in &self.steps {
                match step {
                    Step::Sample(sample) => _ = stand_in.publish(sample),
                    Step::Stall(length) => {
                        if stopped.recv_timeout(*length) != Err(RecvTimeoutError::Timeout) {
                            break;
                        }
                    }
                    Step::Restart => {
                        stand_in.settle();
                        drop(stand_in);
                        stand_in = StandInTopic::start(&domain);
                    }
                }
            }
            stand_in
        });
        Playing {
            _stop: stop,
            thread,
        }
    }
}

/// A scenario that is being played. Its publisher stays when the last sample is published.
#[derive(Debug)]
pub struct Playing<T: Topic> {
    /// Dropping it ends a stall.
    _stop: Sender<()>,
    thread: JoinHandle<StandInTopic<T>>,
}

impl<T: Topic> Playing<T> {
    /// Waits until all was published, and gives the stand-in that is there in the end. To be called when the program
    /// under test has read, or reads on another thread.
    ///
    /// # Panics
    ///
    /// When a sample could not be published.
    pub fn finish(self) -> StandInTopic<T> {
        let stand_in = self
            .thread
            .join()
            .expect("a scenario that is played to its end");
        stand_in.settle();
        stand_in
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::StateOf;
    use ipc_types::module::State;

    use super::*;
    use crate::{TestDomain, expect};

    struct Belt;
    ipc_types::module!(Belt, "belt", 1000);

    #[test]
    fn a_scenario_is_played_with_its_stalls_and_deaths_and_nothing_is_lost() {
        let second = Duration::from_secs(1);
        let belt = |at: Duration| {
            StateOf::<Belt>::new(State {
                published_ns: at.as_nanos() as u64,
                ..State::default()
            })
        };
        let scenario = Scenario::every(Duration::from_millis(5))
            .run(second, belt)
            .stall(Duration::from_millis(20))
            .garbage(7, 3)
            .restart()
            .run(second, belt);
        let written: Vec<_> = scenario
            .samples()
            .map(|sample| sample.published_ns)
            .collect();
        assert_eq!(written.len(), 200 + 3 + 200);

        let domain = TestDomain::new();
        let mut states = domain
            .join("consumer")
            .subscriber::<StateOf<Belt>>()
            .unwrap();
        let playing = scenario.play(&domain);
        let read = expect::samples(&mut states, written.len());
        let read: Vec<_> = read.iter().map(|sample| sample.published_ns).collect();
        assert_eq!(read, written);
        let stand_in = playing.finish();
        expect::nothing_lost(&states);
        assert_eq!(states.losses().publisher_restarts, 1);
        drop((states, stand_in));
    }
}
