//! Which topic a caller means, and an [`Inbox`] that hands on its samples one at a time.

use std::time::{Duration, Instant};

use ipc_types::dynamic::schema_of;
use ipc_types::service::{self, Contract, Pattern, ServiceId};
use ipc_types::waiter::SAFETY_BOUND;
use ipc_types::{DynamicPublisher, DynamicSubscriber, Ipc, Schema, Wake};

use crate::error::Error;

/// Longest wait: what a caller means who waits without a limit.
pub const FOREVER: Duration = Duration::from_secs(u32::MAX as u64);

/// A topic as a caller names it.
#[derive(Clone, Copy, Debug, Default)]
pub struct TopicName<'a> {
    /// Last part of the service's name.
    pub key: &'a str,
    /// The hash of the layout that the caller was built with, 16 hexadecimal digits.
    pub layout_hash: Option<&'a str>,
    /// The text of the schema that the caller was built with.
    pub schema: Option<&'a str>,
    /// Size of the caller's struct, bytes; 0 when it has none.
    pub size: usize,
}

impl TopicName<'_> {
    /// What the caller expects in the topic: its own schema; of the robot's own topics what this library was built with; else
    /// what lies beside the topic.
    fn schema(&self, ipc: &Ipc) -> Result<Schema, Error> {
        let schema = match (self.schema, own(self.key)) {
            (Some(text), _) => Schema::parse(text)?,
            (None, Some(contract)) => Schema::from_layout(contract.payload),
            (None, None) => schema_of(ipc, self.key)?,
        };
        self.check(&schema)?;
        Ok(schema)
    }

    fn check(&self, schema: &Schema) -> Result<(), Error> {
        let hash = format!("{:016x}", schema.layout_hash());
        if self.layout_hash.is_some_and(|wanted| wanted != hash) {
            return Err(Error::Layout(format!(
                "`{}` carries `{} {hash}`, this program was built for {}: use header and library of the same version",
                self.key,
                schema.type_name(),
                self.layout_hash.unwrap_or_default(),
            )));
        }
        if self.size != 0 && self.size != schema.size() {
            return Err(Error::Layout(format!(
                "a sample of `{}` has {} bytes, the struct of this program has {}",
                self.key,
                schema.size(),
                self.size
            )));
        }
        Ok(())
    }

    /// Becomes the publisher of the topic.
    ///
    /// # Errors
    ///
    /// See [`DynamicPublisher::open`]; a module's topic needs a schema.
    pub fn publisher(&self, ipc: &Ipc) -> Result<DynamicPublisher, Error> {
        let text = match (self.schema, own(self.key)) {
            (Some(text), _) => text.to_owned(),
            (None, Some(contract)) => contract.schema(),
            (None, None) => {
                return Err(Error::Invalid(format!(
                    "`{}` needs a schema to be published",
                    self.key
                )));
            }
        };
        self.check(&Schema::parse(&text)?)?;
        Ok(DynamicPublisher::open(ipc, self.key, &text)?)
    }
}

/// The robot's own topic with this key.
fn own(key: &str) -> Option<&'static Contract> {
    service::own(key)
        .map(ServiceId::contract)
        .filter(|contract| contract.pattern == Pattern::PublishSubscribe)
}

/// A subscriber that hands on its samples one at a time: those of one drain wait in a buffer.
pub struct Inbox {
    subscriber: DynamicSubscriber,
    /// Samples that were drained, one after the other.
    buffer: Vec<u8>,
    /// Where the next sample begins in it.
    next: usize,
    size: usize,
}

impl Inbox {
    /// Subscribes to a topic. The topic of a module may be there later than the subscriber only if the caller has its schema.
    ///
    /// # Errors
    ///
    /// When the topic carries something else than the caller expects.
    pub fn open(ipc: &Ipc, topic: &TopicName<'_>) -> Result<Inbox, Error> {
        let schema = topic.schema(ipc)?;
        Ok(Inbox {
            subscriber: DynamicSubscriber::open(ipc, topic.key, &schema)?,
            buffer: Vec::new(),
            next: 0,
            size: schema.size(),
        })
    }

    /// The subscriber below, for what needs no buffer.
    pub fn subscriber(&self) -> &DynamicSubscriber {
        &self.subscriber
    }

    /// The same, to wait for.
    pub fn subscriber_mut(&mut self) -> &mut DynamicSubscriber {
        &mut self.subscriber
    }

    /// Whether a sample waits in the buffer.
    pub fn has_buffered(&self) -> bool {
        self.next < self.buffer.len()
    }

    /// The oldest sample that was not handed on yet, waiting for it as long as `timeout`. Nothing when there is none, or a
    /// signal came.
    ///
    /// # Errors
    ///
    /// When the publisher cannot be reached; the next call tries again.
    pub fn receive(&mut self, timeout: Duration) -> Result<Received<'_>, Error> {
        if !self.has_buffered() {
            match self.fill(timeout)? {
                Fill::Samples => {}
                Fill::Nothing => return Ok(Received::Nothing),
                Fill::Interrupted => return Ok(Received::Interrupted),
            }
        }
        let from = self.next;
        self.next += self.size;
        Ok(Received::Sample(&self.buffer[from..self.next]))
    }

    /// Waits until there is a sample, and says whether there is one.
    ///
    /// # Errors
    ///
    /// As [`Inbox::receive`].
    pub fn wait(&mut self, timeout: Duration) -> Result<bool, Error> {
        Ok(self.has_buffered() || matches!(self.fill(timeout)?, Fill::Samples))
    }

    fn fill(&mut self, timeout: Duration) -> Result<Fill, Error> {
        if timeout.is_zero() {
            return Ok(if self.drain()? {
                Fill::Samples
            } else {
                Fill::Nothing
            });
        }
        let deadline = Instant::now() + timeout;
        let mut left = timeout;
        loop {
            // Before it sleeps it looks for samples, which is cheaper than draining.
            let wake = self.subscriber.wait(left)?;
            if self.drain()? {
                return Ok(Fill::Samples);
            }
            left = deadline.saturating_duration_since(Instant::now());
            match wake {
                // What came with the signal is not lost: the next call reads it.
                Wake::Interrupted => return Ok(Fill::Interrupted),
                _ if left.is_zero() => return Ok(Fill::Nothing),
                _ => {}
            }
        }
    }

    /// Whether there are samples now.
    fn drain(&mut self) -> Result<bool, Error> {
        self.buffer.clear();
        self.next = 0;
        let buffer = &mut self.buffer;
        let drained = self
            .subscriber
            .drain(|sample| buffer.extend_from_slice(sample));
        match drained {
            Ok(_) => Ok(self.has_buffered()),
            // What came before the failure is handed on first.
            Err(_) if self.has_buffered() => Ok(true),
            Err(error) => Err(error.into()),
        }
    }

    /// The newest sample that was not handed on yet; older ones are dropped.
    ///
    /// # Errors
    ///
    /// As [`Inbox::receive`].
    pub fn latest(&mut self) -> Result<Option<&[u8]>, Error> {
        let buffer = &mut self.buffer;
        if self.next < buffer.len() {
            // Only the last one counts from here on.
            buffer.drain(..buffer.len() - self.size);
        } else {
            buffer.clear();
        }
        self.next = 0;
        self.subscriber.drain(|sample| {
            buffer.clear();
            buffer.extend_from_slice(sample);
        })?;
        self.next = self.buffer.len();
        Ok((!self.buffer.is_empty()).then_some(&self.buffer[..]))
    }

    /// Hands on every sample that is there, without a copy those that were not drained before.
    ///
    /// # Errors
    ///
    /// As [`Inbox::receive`].
    pub fn drain_into(&mut self, mut take: impl FnMut(&[u8])) -> Result<usize, Error> {
        let buffered = self.buffer[self.next..].chunks_exact(self.size);
        let mut taken = buffered.len();
        buffered.for_each(&mut take);
        self.next = self.buffer.len();
        taken += self.subscriber.drain(take)?;
        Ok(taken)
    }
}

enum Fill {
    Samples,
    Nothing,
    Interrupted,
}

/// What came of waiting for a sample.
#[derive(Debug)]
pub enum Received<'a> {
    /// A sample.
    Sample(&'a [u8]),
    /// The time is over.
    Nothing,
    /// A signal came first.
    Interrupted,
}

/// How often whoever waits on descriptors must look all the same, in milliseconds.
pub const RECHECK_MS: u32 = SAFETY_BOUND.as_millis() as u32;
