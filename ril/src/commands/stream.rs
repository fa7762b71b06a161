//! What all commands that watch a stream of samples share: the loop that waits, drains and knows when it is enough.

use ipc_types::{Losses, MonotonicNs, Subscriber, Topic};
use runtime::exit::Failure;

use super::Session;
use super::patience::{Limits, Next, Patience};

/// What is done with the samples.
pub(super) trait Watcher<T> {
    /// Takes a sample, and says whether it counts as one of those that were asked for.
    fn sample(&mut self, sample: &T) -> Result<bool, Failure>;

    /// Called after every wake, when all samples that were there have been taken.
    fn woken(&mut self, losses: Losses, now: MonotonicNs) -> Result<(), Failure>;

    /// When to be woken even if nothing comes.
    fn wake_at(&self) -> Option<MonotonicNs> {
        None
    }
}

/// Hands samples on until it is enough, nothing comes any more, or a signal comes; the latter is enough, too.
pub(super) fn watch<T: Topic>(
    session: &Session,
    samples: &mut Subscriber<T>,
    limits: Limits,
    watcher: &mut impl Watcher<T>,
) -> Result<Next, Failure> {
    let mut patience = Patience::new(limits, MonotonicNs::now());
    while !session.termination.requested() {
        let count = take(samples, patience.wanted(), watcher)?;
        let now = MonotonicNs::now();
        patience.came(count, now);
        watcher.woken(samples.losses(), now)?;
        match patience.next(now) {
            Next::Wait(until) => {
                let until = watcher.wake_at().map_or(until, |at| until.min(at));
                session.wait(&[&*samples], Some(until))?;
            }
            Next::Look => {
                patience.provider(session.is_provided(T::SERVICE)?, now);
            }
            end => return Ok(end),
        }
    }
    Ok(Next::Enough)
}

/// Hands on what is there, at most `wanted` samples that count, and says how many those were.
fn take<T: Topic>(
    samples: &mut Subscriber<T>,
    wanted: u64,
    watcher: &mut impl Watcher<T>,
) -> Result<u64, Failure> {
    let mut count = 0;
    let mut result = Ok(());
    let received = samples.drain(|sample| {
        if count < wanted && result.is_ok() {
            match watcher.sample(sample) {
                Ok(counts) => count += u64::from(counts),
                Err(failure) => result = Err(failure),
            }
        }
    });
    if let Err(error) = received {
        tracing::warn!(%error, "samples could not be received");
    }
    result.map(|()| count)
}
