//! [`Publisher`]: the writing end of a published service.
//!
//! Publishing never blocks: a subscriber that does not read loses its oldest samples, and a stopped one costs nothing.
//! Nothing here allocates; iceoryx2 makes a handle of 48 bytes on the heap for each sample.

use std::cell::Cell;
use std::rc::Rc;

use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::BackpressureStrategy;

use crate::domain::OwnerLock;
use crate::ear::{Ear, Signal};
use crate::event::Channel;
use crate::iox::Svc;
use crate::open::{self, OpenError};
use crate::service::{MAX_PROVIDERS, Topic};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::sealed;

/// A sample could not be published. Its number in the sequence may be missing then, as that of any lost sample.
#[derive(Debug, thiserror::Error)]
#[error("a sample of {service} could not be published ({reason})")]
pub struct PublishError {
    service: &'static str,
    reason: String,
}

/// The writing end of a published service, of which a robot has one.
///
/// Give it to the [`Waiter`](crate::Waiter) as well and call [`Publisher::welcome`] after every wake: subscribers that
/// join between two samples then get the latest at once, not with the next one.
pub struct Publisher<T: Topic> {
    /// Where the next sample will be filled in. Lent as soon as the one before is on its way: taking what subscribers gave
    /// back costs more than the rest of publishing, and then nobody waits for it.
    blank: Option<Blank<T>>,
    port: iceoryx2::port::publisher::Publisher<Svc, T, ()>,
    samples: Signal,
    subscribers: Ear,
    /// Arrivals that [`Publisher::welcome`] has seen, as the bell counts them.
    welcomed: Cell<u32>,
    epoch_ns: u64,
    sequence: u64,
    _owner: OwnerLock,
    _session: Rc<Session>,
}

type Blank<T> = iceoryx2::sample_mut::SampleMut<Svc, T, ()>;

impl<T: Topic> Publisher<T> {
    pub(crate) fn open(session: &Rc<Session>) -> Result<Publisher<T>, OpenError> {
        let robot = session.robot();
        let owner = session.provide(T::SERVICE)?;
        let service = open::topic::<T>(session, robot)?;
        let subscribers = Ear::make(session, T::SERVICE, Channel::Subscribers)?;
        // Consumers in other languages announce themselves by this alone.
        subscribers.listener()?;
        let port = open::port(
            session,
            &T::SERVICE.name(robot),
            ("publishers", MAX_PROVIDERS),
            |error| error == PublisherCreateError::ExceedsMaxSupportedPublishers,
            || {
                service
                    .publisher_builder()
                    .max_loaned_samples(1)
                    // Without effect while the oldest gives way to the newest, but never anything that waits.
                    .backpressure_strategy(BackpressureStrategy::DiscardData)
                    .create()
            },
        )?;
        // Last, because it announces the publisher.
        let samples = Signal::make(session, T::SERVICE, Channel::Samples)?;
        Ok(Publisher {
            blank: None,
            port,
            samples,
            subscribers,
            welcomed: Cell::new(0),
            epoch_ns: MonotonicNs::now().0,
            sequence: 0,
            _owner: owner,
            _session: Rc::clone(session),
        })
    }

    /// Fills in a sample where it lies in shared memory, and sends it. Returns its number in the sequence, from 1.
    ///
    /// The sample begins as all zeros. `sequence` and `epoch_ns` are written after `fill`.
    ///
    /// # Errors
    ///
    /// [`PublishError`] when there is no memory for it, which does not happen with the settings of the table, or when
    /// a connection is broken.
    pub fn publish(&mut self, fill: impl FnOnce(&mut T)) -> Result<u64, PublishError> {
        let mut sample = match self.blank.take() {
            Some(blank) => blank,
            None => self.port.loan().map_err(publish_error::<T>)?,
        };
        let sequence = self.sequence + 1;
        let payload = sample.payload_mut();
        fill(payload);
        payload.stamp(sequence, self.epoch_ns);
        // Used up even if sending fails, because some subscribers may have got the sample.
        self.sequence = sequence;
        sample.send().map_err(publish_error::<T>)?;
        self.samples.raise();
        // Without one, the next call tries again and says why.
        self.blank = self.port.loan().ok();
        Ok(sequence)
    }

    /// Gives the latest sample to subscribers that joined since the last call. Costs next to nothing when none did.
    pub fn welcome(&mut self) {
        let has_arrivals = self.has_arrivals();
        if self.subscribers.take() == 0 && !has_arrivals {
            return;
        }
        self.welcomed.set(self.arrivals());
        if let Err(error) = self.port.update_connections() {
            tracing::debug!(
                service = T::SERVICE.spec().key,
                ?error,
                "a subscriber was not reached"
            );
        }
        if self.sequence > 0 {
            self.samples.raise();
        }
    }

    /// Subscribers that have come so far, as the bell counts them.
    fn arrivals(&self) -> u32 {
        let bell = self.subscribers.bell();
        bell.map_or(0, |(bell, _)| bell.arrivals(T::SERVICE))
    }

    fn has_arrivals(&self) -> bool {
        self.arrivals() != self.welcomed.get()
    }

    /// Number of the last sample, 0 before the first.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// When this publisher began, host monotonic ns; it is in every sample.
    pub fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }
}

fn publish_error<T: Topic>(error: impl std::fmt::Debug) -> PublishError {
    PublishError {
        service: T::SERVICE.spec().key,
        reason: format!("{error:?}"),
    }
}

impl<T: Topic> sealed::Source for Publisher<T> {
    fn has_something(&self) -> bool {
        self.subscribers.is_pending() || self.has_arrivals()
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Ear(&self.subscribers)
    }
}
