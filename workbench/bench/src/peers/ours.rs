//! The typed ports of `ipc-types`, in each of the ways in which a consumer can wait.

use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;

use anyhow::Result;
use ipc_types::payload::HeroTelemetry;
use ipc_types::{Descriptor, Domain, Ipc, Losses, Publisher, RobotId, Subscriber, Topic, Waiter};

use super::ends::{Mark, PATIENCE};

/// Takes part in the domain of the environment.
pub fn join(process: &str) -> Result<Ipc> {
    Ok(Ipc::join(
        &Domain::from_environment()?,
        RobotId::DEFAULT,
        process,
    )?)
}

/// As status publishes.
pub struct Sender(Publisher<HeroTelemetry>);

impl Sender {
    pub fn new() -> Result<Sender> {
        Ok(Sender(join("bench-sender")?.publisher()?))
    }
}

impl super::ends::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        self.0.publish(|slot| *slot = *sample)?;
        Ok(())
    }
}

/// A consumer that does nothing else.
pub struct Blocking<T: Topic>(Subscriber<T>);

impl<T: Topic> Blocking<T> {
    pub fn new() -> Result<Blocking<T>> {
        Ok(Blocking(join("bench-receiver")?.subscriber()?))
    }

    /// Sleeps until there is a sample, and hands on all that are there.
    pub fn wait_and_drain(&mut self, take: impl FnMut(&T)) -> Result<()> {
        self.0.wait(PATIENCE)?;
        self.0.drain(take)?;
        Ok(())
    }

    /// What was received and missed so far.
    pub fn losses(&self) -> Losses {
        self.0.losses()
    }
}

impl super::ends::Receiver for Blocking<HeroTelemetry> {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        self.wait_and_drain(|sample| take(Mark::of(sample)))
    }
}

/// A consumer with a core of its own.
pub struct Spinning(Subscriber<HeroTelemetry>);

impl Spinning {
    pub fn new() -> Result<Spinning> {
        Ok(Spinning(join("bench-receiver")?.subscriber()?))
    }
}

impl super::ends::Receiver for Spinning {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        self.0.spin(PATIENCE);
        self.0.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }
}

/// A consumer that waits for a file descriptor as well, which says nothing here.
pub struct Waiting {
    subscriber: Subscriber<HeroTelemetry>,
    waiter: Waiter,
    other: UnixStream,
    _far_end: UnixStream,
}

impl Waiting {
    pub fn new() -> Result<Waiting> {
        let (other, far_end) = UnixStream::pair()?;
        Ok(Waiting {
            subscriber: join("bench-receiver")?.subscriber()?,
            waiter: Waiter::new(),
            other,
            _far_end: far_end,
        })
    }
}

impl super::ends::Receiver for Waiting {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        let mut other = Descriptor::new(self.other.as_fd());
        self.waiter.wait(
            &mut [((), &mut self.subscriber), ((), &mut other)],
            Some(PATIENCE),
        )?;
        self.subscriber.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }
}
