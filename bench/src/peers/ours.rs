//! The typed ports of `ipc-types`, in each of the ways in which a consumer can wait.

use anyhow::Result;
use ipc_types::payload::HeroTelemetry;
use ipc_types::{Domain, Ipc, Publisher, RobotId, Subscriber, Waiter};

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
        while self.0.drain(|sample| take(Mark::of(sample)))? == 0 {
            std::hint::spin_loop();
        }
        Ok(())
    }
}

/// A consumer that waits for other things as well.
pub struct Waiting {
    subscriber: Subscriber<HeroTelemetry>,
    waiter: Waiter,
}

impl Waiting {
    pub fn new() -> Result<Waiting> {
        let ipc = join("bench-receiver")?;
        Ok(Waiting {
            subscriber: ipc.subscriber()?,
            waiter: ipc.waiter()?,
        })
    }
}

impl super::Receiver for Waiting {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        self.waiter.wait(&[&self.subscriber], Some(PATIENCE))?;
        self.subscriber.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }
}
