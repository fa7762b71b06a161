//! The typed ports of `ipc-types`, in each of the ways in which a consumer can wait.

use std::io::{self, PipeReader, PipeWriter};
use std::os::fd::AsFd;

use anyhow::Result;
use ipc_types::payload::HeroTelemetry;
use ipc_types::{Descriptor, Domain, Ipc, Publisher, RobotId, Subscriber, Waiter};

use super::{Mark, PATIENCE};

fn join(process: &str) -> Result<Ipc> {
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

impl super::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        self.0.publish(|slot| *slot = *sample)?;
        Ok(())
    }
}

/// A consumer that does nothing else.
pub struct Blocking(Subscriber<HeroTelemetry>);

impl Blocking {
    pub fn new() -> Result<Blocking> {
        Ok(Blocking(join("bench-receiver")?.subscriber()?))
    }
}

impl super::Receiver for Blocking {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        self.0.wait(PATIENCE)?;
        self.0.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }
}

/// A consumer with a core of its own.
pub struct Spinning(Subscriber<HeroTelemetry>);

impl Spinning {
    pub fn new() -> Result<Spinning> {
        Ok(Spinning(join("bench-receiver")?.subscriber()?))
    }
}

impl super::Receiver for Spinning {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        self.0.spin(PATIENCE);
        self.0.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }
}

/// A consumer that waits for a file descriptor as well.
pub struct Waiting {
    subscriber: Subscriber<HeroTelemetry>,
    waiter: Waiter,
    other: PipeReader,
    /// Open, so that the other end has not hung up.
    _writer: PipeWriter,
}

impl Waiting {
    pub fn new() -> Result<Waiting> {
        let (other, _writer) = io::pipe()?;
        Ok(Waiting {
            subscriber: join("bench-receiver")?.subscriber()?,
            waiter: Waiter::new(),
            other,
            _writer,
        })
    }
}

impl super::Receiver for Waiting {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        let other = Descriptor::new(self.other.as_fd());
        self.waiter
            .wait(&[&self.subscriber, &other], Some(PATIENCE))?;
        self.subscriber.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }
}
