//! [`Publisher`]: the writing end of a published service.
//!
//! Publishing never blocks: a subscriber that does not read loses its oldest samples, and a stopped one costs nothing.
//! Nothing here allocates; iceoryx2 makes a handle of 104 bytes on the heap for each sample.

use std::cell::Cell;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{BackpressureAction, BackpressureInfo, DegradationAction};
use iceoryx2::prelude::{BackpressureStrategy, PortFactory};
use iceoryx2::service::marker::{CustomHeaderMarker, CustomPayloadMarker};

use crate::doorbell::ServiceEvent;
use crate::generation::{self, Generation};
use crate::housekeeper::Maintained;
use crate::iox::{Members, Svc, TopicService};
use crate::open::{self, Offer, OpenError};
use crate::patience::Patience;
use crate::pollable::Pollable;
use crate::port::{self, Payload, Port};
use crate::provider::ProviderLock;
use crate::reserve;
use crate::sequence::stamp;
use crate::service::{HISTORY, MAX_PROVIDERS, service_name};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::sealed;
use crate::wake::{Event, WakeReceiver, WakeSender};

/// How long a publisher feeds its former generation beside the new one. Subscribers change within a
/// [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND); this is four of them.
const OVERLAP: Duration = Duration::from_secs(1);

/// Former generations that are fed at once. They become several when very many processes die; with one more the present
/// one would have to serve until the oldest has had its time.
const MAX_FORMER: usize = 3;

/// Samples of a batch for which subscribers are woken once: few enough that one that sleeps loses none of them.
const BATCH: usize = 16;

/// How long after a failure the publisher tries again to begin a new generation.
const RETRY: Duration = Duration::from_secs(1);

/// A sample could not be published. Its number in the sequence may be missing then, as that of any lost sample.
#[derive(Debug, thiserror::Error)]
#[error("a sample of {service} could not be published ({reason})")]
pub struct PublishError {
    service: String,
    reason: String,
}

/// The writing end of a published service, of which a robot has one.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let robot = ipc_types::Ipc::connect("status")?;
/// let mut telemetry = robot.publisher::<ipc_types::payload::HeroTelemetry>()?;
/// telemetry.publish(|sample| sample.geodetic.altitude_m = 25.0)?;
/// # Ok(())
/// # }
/// ```
///
/// Give it to the [`Waiter`](crate::Waiter) as well: subscribers that join between two samples then get the latest at
/// once, not with the next one.
pub type Publisher<T> = Port<BytesPublisher, T>;

impl<P: Payload> Publisher<P> {
    /// Fills in a sample where it lies in shared memory, and sends it. Returns its number in the sequence, from 1.
    ///
    /// The sample begins as all zeros. `sequence` and `epoch_ns` are written after `fill`.
    ///
    /// # Errors
    ///
    /// [`PublishError`] when there is no memory for it, which does not happen with the settings of the table, or when
    /// a connection is broken.
    pub fn publish(&mut self, fill: impl FnOnce(&mut P::View)) -> Result<u64, PublishError> {
        self.core.publish(|bytes| {
            // SAFETY: the service was made for the payload, so the bytes are as many and as aligned; they are
            // initialized.
            #[allow(unsafe_code)]
            fill(unsafe { P::view_mut(bytes) });
        })
    }

    /// As [`publish`](Publisher::publish), for one of several samples that come together: subscribers are woken for the
    /// first, for each sixteenth after it, and for the rest by [`end_batch`](Publisher::end_batch).
    ///
    /// # Errors
    ///
    /// As [`publish`](Publisher::publish).
    pub fn publish_batched(
        &mut self,
        fill: impl FnOnce(&mut P::View),
    ) -> Result<u64, PublishError> {
        self.core.publish_batched(|bytes| {
            // SAFETY: see `publish`.
            #[allow(unsafe_code)]
            fill(unsafe { P::view_mut(bytes) });
        })
    }

    /// Ends a batch: wakes subscribers if samples came after they were woken last.
    pub fn end_batch(&mut self) {
        self.core.end_batch();
    }

    /// Gives the latest sample to subscribers that joined since the last call, and begins a new generation when the
    /// present one is worn. Costs next to nothing when there is nothing to do. A [`Waiter`](crate::Waiter) does it in
    /// every wait.
    pub fn service(&mut self) {
        self.core.look_for_strangers();
        self.core.service();
    }

    /// Number of the last sample, 0 before the first.
    pub fn sequence(&self) -> u64 {
        self.core.sequence
    }

    /// When this publisher began, host monotonic ns; it is in every sample.
    pub fn epoch_ns(&self) -> u64 {
        self.core.epoch_ns
    }

    /// Subscribers that are there now, in all processes. Costs a few nanoseconds.
    pub fn subscribers(&self) -> usize {
        self.core.ports().map(PublisherPort::subscribers).sum()
    }

    /// Whether a subscriber is there, in any process. One that came since the last [`service`](Publisher::service) may
    /// not count yet. Costs less than [`subscribers`](Publisher::subscribers) while there is none.
    pub fn has_subscribers(&self) -> bool {
        self.core.ports().any(PublisherPort::has_subscribers)
    }

    /// How often [`service`](Publisher::service) has met subscribers that joined.
    pub fn joins(&self) -> u64 {
        self.core.joins
    }

    /// Generations of shared memory that this publisher has begun, the first included.
    pub fn generations(&self) -> u64 {
        self.core.generations
    }

    /// Begins a new generation at the next [`Publisher::service`], as if the present one were worn: for tests.
    #[doc(hidden)]
    pub fn wear_out(&self) {
        self.core.port.maintained.wear_out("it was asked for");
    }
}

/// The writing end of a published service whose samples are bytes.
pub struct BytesPublisher {
    port: PublisherPort,
    /// The former generations, oldest first, and until when each is fed.
    former: Vec<(PublisherPort, MonotonicNs)>,
    /// When to try again to begin a new generation.
    retry: MonotonicNs,
    generations: u64,
    joins: u64,
    /// Whether subscribers may have come that did not ring the doorbell.
    has_strangers: Cell<bool>,
    pollable: Pollable,
    /// A copy of the last sample, for those that come to a new generation before the next one.
    latest: Vec<u8>,
    /// Samples of the present batch.
    batch: usize,
    epoch_ns: u64,
    sequence: u64,
    offer: Offer,
    lock: Arc<ProviderLock>,
    session: Arc<Session>,
}

/// A publisher's part in one generation.
struct PublisherPort {
    /// Where the next sample will be filled in. Lent as soon as the one before is on its way: taking what subscribers
    /// gave back costs more than the rest of publishing, and no subscriber waits for it then.
    preloaned: Option<Preloaned>,
    port: iceoryx2::port::publisher::Publisher<Svc, [CustomPayloadMarker], CustomHeaderMarker>,
    service: TopicService,
    samples: WakeSender,
    subscribers: WakeReceiver,
    /// Subscribers that [`Publisher::service`] has served, as the doorbell counts them.
    served: u32,
    maintained: Arc<Maintained>,
    max_subscribers: usize,
    /// Subscribers that there were when they were last connected. Those that do not ring the doorbell are found by it.
    known: Cell<usize>,
    key: String,
    // Last: its node must outlive the ports.
    _generation: Generation,
}

/// All of its bytes are initialized.
type Preloaned = iceoryx2::sample_mut::SampleMut<Svc, [CustomPayloadMarker], CustomHeaderMarker>;

/// The marker is one byte; it stands for any payload.
fn bytes_of(sample: &mut Preloaned) -> &mut [u8] {
    let payload = sample.payload_mut();
    // SAFETY: a marker has the size of a byte and holds one, and the slice is borrowed for as long.
    #[allow(unsafe_code)]
    unsafe {
        std::slice::from_raw_parts_mut(payload.as_mut_ptr().cast(), payload.len())
    }
}

// SAFETY: it owns all that shares its counts of references, see [`Svc`]; no other thread has any of it.
#[allow(unsafe_code)]
unsafe impl Send for PublisherPort {}

impl PublisherPort {
    fn make(
        session: &Arc<Session>,
        lock: &Arc<ProviderLock>,
        offer: &Offer,
    ) -> Result<PublisherPort, OpenError> {
        session.begin(lock, offer, |generation, maintained| {
            let robot = session.robot();
            let key = offer.key.as_str();
            let service = open::create_topic(&generation, offer, robot)?;
            let event = |channel| Event::create(&generation, robot, key, channel);
            let subscribers = WakeReceiver::new(event(ServiceEvent::Subscribers)?);
            // Consumers in other languages announce themselves by this alone.
            subscribers.listener()?;
            subscribers.leave_to_waiters();
            let samples = event(ServiceEvent::Samples)?;
            let failing = Arc::clone(&maintained);
            let port = open::port(
                &service_name(robot, key),
                ("publishers", MAX_PROVIDERS),
                |error| error == PublisherCreateError::ExceedsMaxSupportedPublishers,
                || {
                    let builder = service
                        .publisher_builder()
                        .max_loaned_samples(1)
                        // Without effect while the oldest gives way to the newest, but never anything that waits.
                        .backpressure_strategy(BackpressureStrategy::DiscardData)
                        .set_degradation_handler(move |_, _: &_| {
                            failing.note_unconnected();
                            // The others are served.
                            DegradationAction::Ignore
                        });
                    match offer.patience.clone() {
                        None => builder.create(),
                        Some(patience) => builder
                            .set_backpressure_handler(move |full: &BackpressureInfo| match patience
                                .is_left(full.elapsed_time)
                            {
                                true => BackpressureAction::Retry,
                                false => BackpressureAction::DiscardData,
                            })
                            .create(),
                    }
                },
            )?;
            Ok(PublisherPort {
                preloaned: None,
                port,
                service,
                samples: WakeSender::make(session, samples)?,
                subscribers,
                served: session.doorbell().joined(offer.slot),
                maintained,
                max_subscribers: offer.max_subscribers,
                known: Cell::new(0),
                key: key.to_owned(),
                _generation: generation,
            })
        })
    }

    fn loan(&mut self) -> Result<Preloaned, PublishError> {
        match self.preloaned.take() {
            Some(preloaned) => Ok(preloaned),
            None => self.loan_zeros(),
        }
    }

    fn loan_zeros(&self) -> Result<Preloaned, PublishError> {
        // SAFETY: one element, as the service's type is one of fixed size.
        #[allow(unsafe_code)]
        let loaned = unsafe { self.port.loan_custom_payload(1) };
        let mut sample = loaned.map_err(|error| publish_error(&self.key, error))?;
        sample
            .payload_mut()
            .fill_with(std::mem::MaybeUninit::zeroed);
        // SAFETY: all bytes were written in the line above, and a marker is any byte.
        #[allow(unsafe_code)]
        Ok(unsafe { sample.assume_init() })
    }

    fn send(&self, sample: Preloaned) -> Result<(), PublishError> {
        let sent = sample.send();
        sent.map(|_| ())
            .map_err(|error| publish_error(&self.key, error))
    }

    fn wake(&mut self) {
        self.samples.wake();
        // After the wake-up, which others wait for. Without one, the next call tries again and says why.
        if self.preloaned.is_none() {
            self.preloaned = self.loan_zeros().ok();
        }
    }

    fn subscribers(&self) -> usize {
        self.service.dynamic_config().number_of_subscribers()
    }

    fn has_subscribers(&self) -> bool {
        self.known.get() > 0 && self.subscribers() > 0
    }

    /// Whether there are as many subscribers as when they were last connected.
    fn knows_subscribers(&self) -> bool {
        self.subscribers() == self.known.get()
    }

    /// Connects subscribers that have joined, which gives them the latest sample.
    fn connect(&self) {
        let places = (self.subscribers(), self.max_subscribers);
        self.known.set(places.0);
        self.maintained.count_places(places, || {
            let mut members = Members::default();
            let taken = self.service.dynamic_config();
            taken.list_subscribers(|it| members.add(it.node_id));
            members.count()
        });
        self.samples.count_places(&self.maintained);
        self.subscribers.count_places(&self.maintained);
        let _held = reserve::hold_descriptors();
        if let Err(error) = self.port.update_connections() {
            crate::log::debug!(service = self.key, ?error, "a subscriber was not reached");
        }
    }
}

impl BytesPublisher {
    pub(crate) fn open(session: &Arc<Session>, offer: Offer) -> Result<BytesPublisher, OpenError> {
        let lock = session.provide(&offer.key)?;
        Ok(BytesPublisher {
            port: PublisherPort::make(session, &lock, &offer)?,
            former: Vec::with_capacity(MAX_FORMER),
            retry: MonotonicNs::default(),
            generations: 1,
            joins: 0,
            has_strangers: Cell::new(false),
            pollable: Pollable::default(),
            latest: vec![0; offer.schema.size()],
            batch: 0,
            epoch_ns: MonotonicNs::now().0,
            sequence: 0,
            offer,
            lock,
            session: Arc::clone(session),
        })
    }

    /// See [`Publisher::publish`].
    fn publish(&mut self, fill: impl FnOnce(&mut [u8])) -> Result<u64, PublishError> {
        let sequence = self.send(fill)?;
        self.wake();
        Ok(sequence)
    }

    /// See [`Publisher::publish_batched`].
    fn publish_batched(&mut self, fill: impl FnOnce(&mut [u8])) -> Result<u64, PublishError> {
        let sequence = self.send(fill)?;
        if self.batch.is_multiple_of(BATCH) {
            self.wake();
        }
        self.batch += 1;
        Ok(sequence)
    }

    /// See [`Publisher::end_batch`].
    fn end_batch(&mut self) {
        let after_first = std::mem::take(&mut self.batch).saturating_sub(1);
        if !after_first.is_multiple_of(BATCH) {
            self.wake();
        }
    }

    fn wake(&mut self) {
        for (former, _) in &mut self.former {
            former.wake();
        }
        self.port.wake();
    }

    fn send(&mut self, fill: impl FnOnce(&mut [u8])) -> Result<u64, PublishError> {
        self.session
            .check_process()
            .map_err(|forked| PublishError {
                service: self.offer.key.clone(),
                reason: forked.to_string(),
            })?;
        if let Some(patience) = self.offer.patience.clone() {
            self.await_subscriber(&patience);
        }
        let mut sample = self.port.loan()?;
        let sequence = self.sequence + 1;
        let payload = bytes_of(&mut sample);
        fill(payload);
        stamp(payload, sequence, self.epoch_ns);
        // Used up even if sending fails, because some subscribers may have got the sample.
        self.sequence = sequence;
        self.latest.copy_from_slice(payload);
        for (former, _) in &mut self.former {
            if let Ok(mut copy) = former.loan() {
                bytes_of(&mut copy).copy_from_slice(&self.latest);
                // A subscriber that still reads there is on its way to the new generation.
                let _ = former.send(copy);
            }
        }
        if !self.port.knows_subscribers() {
            // Sending connects new subscribers, too.
            self.port.connect();
        }
        self.port.send(sample)?;
        Ok(sequence)
    }

    /// In a test: the first subscriber gets what came before it.
    fn await_subscriber(&mut self, patience: &Patience) {
        let begun = MonotonicNs::now();
        while self.sequence >= HISTORY as u64
            && self.ports().all(|port| port.subscribers() == 0)
            && patience.is_left(MonotonicNs::now().since(begun))
        {
            self.look_for_strangers();
            self.service();
        }
    }

    /// Counts the subscribers, which is how those are found that do not ring the doorbell. Costs more than all else
    /// that a publisher looks at, and they announce themselves by an event: so a waiter counts seldom.
    fn look_for_strangers(&self) {
        if !self.knows_subscribers() {
            self.has_strangers.set(true);
        }
    }

    /// See [`Publisher::service`].
    fn service(&mut self) {
        if self.session.check_process().is_err() {
            return;
        }
        self.change_generation();
        self.pollable.drained();
        let joined = self.joined();
        let announced: u64 = self.ports().map(|port| port.subscribers.take()).sum();
        let has_strangers = self.has_strangers.take();
        if announced == 0 && joined == self.port.served && !has_strangers {
            return;
        }
        self.port.served = joined;
        self.joins += 1;
        self.port.connect();
        for (former, _) in &self.former {
            former.connect();
        }
        if self.sequence > 0 {
            self.port.samples.wake();
        }
    }

    fn change_generation(&mut self) {
        if self.former.is_empty() && !self.port.maintained.is_worn() {
            return;
        }
        let now = MonotonicNs::now();
        while self.former.first().is_some_and(|(_, until)| now >= *until) {
            let (former, _) = self.former.remove(0);
            self.pollable.forget(&former.subscribers);
            self.session.housekeeper().drop_later(former);
        }
        if self.former.len() >= MAX_FORMER || !self.port.maintained.is_worn() || now < self.retry {
            return;
        }
        self.retry = now + RETRY;
        match PublisherPort::make(&self.session, &self.lock, &self.offer) {
            Ok(mut port) => {
                self.generations += 1;
                if self.sequence > 0
                    && let Ok(mut copy) = port.loan()
                {
                    bytes_of(&mut copy).copy_from_slice(&self.latest);
                    // When it fails, late joiners wait for the next sample.
                    let _ = port.send(copy);
                    port.wake();
                }
                self.pollable.change(&port.subscribers);
                let former = std::mem::replace(&mut self.port, port);
                self.former.push((former, now + OVERLAP));
            }
            Err(error) => crate::log::warn!(%error, "the generation stays as it is"),
        }
    }

    fn ports(&self) -> impl Iterator<Item = &PublisherPort> {
        let former = self.former.iter().map(|(former, _)| former);
        former.chain([&self.port])
    }

    /// Whether each generation has as many subscribers as when they were last connected.
    fn knows_subscribers(&self) -> bool {
        self.ports().all(PublisherPort::knows_subscribers)
    }

    /// Subscribers that have come so far, as the doorbell counts them.
    fn joined(&self) -> u32 {
        self.session.doorbell().joined(self.offer.slot)
    }
}

impl Drop for BytesPublisher {
    fn drop(&mut self) {
        generation::withdraw(&self.lock);
    }
}

fn publish_error(key: &str, error: impl std::fmt::Debug) -> PublishError {
    PublishError {
        service: key.to_owned(),
        reason: format!("{error:?}"),
    }
}

impl sealed::Source for BytesPublisher {
    fn has_something(&self, look: sealed::Look) -> bool {
        if look == sealed::Look::Thorough {
            self.look_for_strangers();
        }
        self.port.subscribers.is_pending()
            || self.joined() != self.port.served
            || self.has_strangers.get()
            || self.port.maintained.is_worn() && MonotonicNs::now() >= self.retry
    }

    fn service(&mut self) -> bool {
        BytesPublisher::service(self);
        true
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: self.offer.slot.bits(ServiceEvent::Subscribers),
            receiver: Some(&self.port.subscribers),
            by_descriptor: false,
            bound: sealed::Bound::LONG,
        }
    }
}

port::core!(BytesPublisher);
