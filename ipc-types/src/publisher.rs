//! [`Publisher`]: the writing end of a published service.
//!
//! Publishing never blocks: a subscriber that does not read loses its oldest samples, and a stopped one costs nothing.
//! Nothing here allocates; iceoryx2 makes a handle of 104 bytes on the heap for each sample.

use std::sync::Arc;
use std::time::Duration;

use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::BackpressureStrategy;

use crate::doorbell::{Place, place};
use crate::event::{Channel, Event};
use crate::generation::Generation;
use crate::housekeeper::Tended;
use crate::iox::Svc;
use crate::open::{self, OpenError};
use crate::provider::ProviderLock;
use crate::service::{Contract, MAX_PROVIDERS, Topic};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::sealed;
use crate::wake::{WakeReceiver, WakeSender};

/// How long a publisher feeds its former generation beside the new one. Subscribers change within a
/// [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND); this is four of them.
const OVERLAP: Duration = Duration::from_secs(1);

/// How long after a failure the publisher tries again to begin a new generation.
const RETRY: Duration = Duration::from_secs(1);

/// A sample could not be published. Its number in the sequence may be missing then, as that of any lost sample.
#[derive(Debug, thiserror::Error)]
#[error("a sample of {service} could not be published ({reason})")]
pub struct PublishError {
    service: &'static str,
    reason: String,
}

/// The writing end of a published service, of which a robot has one.
///
/// Give it to the [`Waiter`](crate::Waiter) as well and call [`Publisher::tend`] after every wake: subscribers that
/// join between two samples then get the latest at once, not with the next one.
pub struct Publisher<T: Topic> {
    port: Port<T>,
    /// The former generation, and until when it is fed.
    former: Option<(Port<T>, MonotonicNs)>,
    /// When to try again to begin a new generation.
    retry: MonotonicNs,
    generations: u64,
    /// A copy of the last sample, for those that come to a new generation before the next one.
    latest: T,
    epoch_ns: u64,
    sequence: u64,
    place: Place,
    _lock: ProviderLock,
    session: Arc<Session>,
}

/// A publisher's part in one generation.
struct Port<T: Topic> {
    /// Where the next sample will be filled in. Lent as soon as the one before is on its way: taking what subscribers gave
    /// back costs more than the rest of publishing, and then nobody waits for it.
    preloaned: Option<Preloaned<T>>,
    port: iceoryx2::port::publisher::Publisher<Svc, T, ()>,
    samples: WakeSender,
    subscribers: WakeReceiver,
    /// Subscribers that [`Publisher::tend`] has served, as the doorbell counts them.
    served: u32,
    tended: Arc<Tended>,
    // Last: its node must outlive the ports.
    _generation: Generation,
}

type Preloaned<T> = iceoryx2::sample_mut::SampleMut<Svc, T, ()>;

impl<T: Topic> Port<T> {
    fn make(session: &Arc<Session>) -> Result<Port<T>, OpenError> {
        let contract = Contract::of_topic::<T>();
        session.begin(&contract, |generation, tended| {
            let robot = session.robot();
            let service = open::create_topic::<T>(&generation, robot)?;
            let event = |channel| Event::create(&generation, robot, T::KEY, channel);
            let subscribers = WakeReceiver::new(event(Channel::Subscribers)?);
            // Consumers in other languages announce themselves by this alone.
            subscribers.listener()?;
            let samples = event(Channel::Samples)?;
            let port = open::port(
                &contract.name(robot),
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
            Ok(Port {
                preloaned: None,
                port,
                samples: WakeSender::make(session, samples, place(T::KEY), Channel::Samples)?,
                subscribers,
                served: session.doorbell().joined(place(T::KEY)),
                tended,
                _generation: generation,
            })
        })
    }

    fn loan(&mut self) -> Result<Preloaned<T>, PublishError> {
        match self.preloaned.take() {
            Some(preloaned) => Ok(preloaned),
            None => self.port.loan().map_err(publish_error::<T>),
        }
    }

    fn send(&mut self, sample: Preloaned<T>) -> Result<(), PublishError> {
        sample.send().map_err(publish_error::<T>)?;
        self.samples.wake();
        // Without one, the next call tries again and says why.
        self.preloaned = self.port.loan().ok();
        Ok(())
    }

    /// Connects subscribers that have joined, which gives them the latest sample.
    fn connect(&self) {
        if let Err(error) = self.port.update_connections() {
            tracing::debug!(service = T::KEY, ?error, "a subscriber was not reached");
        }
    }
}

impl<T: Topic> Publisher<T> {
    pub(crate) fn open(session: &Arc<Session>) -> Result<Publisher<T>, OpenError> {
        let lock = session.provide(T::KEY)?;
        Ok(Publisher {
            port: Port::make(session)?,
            former: None,
            retry: MonotonicNs::default(),
            generations: 1,
            latest: T::default(),
            epoch_ns: MonotonicNs::now().0,
            sequence: 0,
            place: place(T::KEY),
            _lock: lock,
            session: Arc::clone(session),
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
        let mut sample = self.port.loan()?;
        let sequence = self.sequence + 1;
        let payload = sample.payload_mut();
        fill(payload);
        payload.stamp(sequence, self.epoch_ns);
        // Used up even if sending fails, because some subscribers may have got the sample.
        self.sequence = sequence;
        self.latest = *payload;
        if let Some((former, _)) = &mut self.former
            && let Ok(mut copy) = former.loan()
        {
            *copy.payload_mut() = self.latest;
            // Whoever still reads there is on the way to the new generation.
            let _ = former.send(copy);
        }
        self.port.send(sample)?;
        Ok(sequence)
    }

    /// Gives the latest sample to subscribers that joined since the last call, and begins a new generation when the present one
    /// is worn. Costs next to nothing when there is nothing to do.
    pub fn tend(&mut self) {
        self.change_generation();
        let joined = self.joined();
        if self.port.subscribers.take() == 0 && joined == self.port.served {
            return;
        }
        self.port.served = joined;
        self.port.connect();
        if let Some((former, _)) = &self.former {
            former.connect();
        }
        if self.sequence > 0 {
            self.port.samples.wake();
        }
    }

    fn change_generation(&mut self) {
        if self.former.is_none() && !self.port.tended.is_worn() {
            return;
        }
        let now = MonotonicNs::now();
        if let Some((former, _)) = self.former.take_if(|(_, until)| now >= *until) {
            self.session.housekeeper().drop_later(former);
        }
        if self.former.is_some() || !self.port.tended.is_worn() || now < self.retry {
            return;
        }
        self.retry = now + RETRY;
        match Port::<T>::make(&self.session) {
            Ok(mut port) => {
                self.generations += 1;
                if self.sequence > 0
                    && let Ok(mut copy) = port.loan()
                {
                    *copy.payload_mut() = self.latest;
                    // When it fails, late joiners wait for the next sample.
                    let _ = port.send(copy);
                }
                let former = std::mem::replace(&mut self.port, port);
                self.former = Some((former, now + OVERLAP));
            }
            Err(error) => tracing::warn!(%error, "the generation stays as it is"),
        }
    }

    /// Subscribers that have come so far, as the doorbell counts them.
    fn joined(&self) -> u32 {
        self.session.doorbell().joined(self.place)
    }

    /// Number of the last sample, 0 before the first.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// When this publisher began, host monotonic ns; it is in every sample.
    pub fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }

    /// Generations of shared memory that this publisher has begun, the first included.
    pub fn generations(&self) -> u64 {
        self.generations
    }

    /// Begins a new generation at the next [`Publisher::tend`], as if the present one were worn: for tests.
    #[doc(hidden)]
    pub fn wear_out(&self) {
        self.port.tended.wear_out("it was asked for");
    }
}

impl<T: Topic> Drop for Publisher<T> {
    fn drop(&mut self) {
        self.session.withdraw(T::KEY);
    }
}

fn publish_error<T: Topic>(error: impl std::fmt::Debug) -> PublishError {
    PublishError {
        service: T::KEY,
        reason: format!("{error:?}"),
    }
}

impl<T: Topic> sealed::Source for Publisher<T> {
    fn has_something(&self) -> bool {
        self.port.subscribers.is_pending()
            || self.joined() != self.port.served
            || self.port.tended.is_worn() && MonotonicNs::now() >= self.retry
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: self.place.bits(Channel::Subscribers),
            receiver: Some(&self.port.subscribers),
            by_descriptor: false,
        }
    }
}
