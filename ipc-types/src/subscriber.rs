//! [`Subscriber`]: the reading end of a published service; it sleeps, drains and counts what it missed.

use std::hint;
use std::marker::PhantomData;
use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::prelude::PortFactory;
use iceoryx2::service::marker::CustomPayloadMarker;

use crate::doorbell::ServiceEvent;
use crate::follow::{Follower, until_room};
use crate::forked::Owned;
use crate::generation::Generation;
use crate::iox::Svc;
use crate::open::{self, Offer, OpenError};
use crate::pollable::Pollable;
use crate::port::{self, Payload, Port};
use crate::sequence::{EPOCH_OFFSET, Losses, SEQUENCE_OFFSET, SequenceTracker, word};
use crate::service::{HISTORY, SUBSCRIBER_BUFFER, Topic, service_name};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::{WaitError, sealed};
use crate::wake::{Event, WakeReceiver, WakeSender};

/// Most samples of one [`Subscriber::drain`]: a full buffer of each of two generations. What comes meanwhile waits for
/// the next.
const MAX_SAMPLES_PER_DRAIN: usize = 2 * SUBSCRIBER_BUFFER;

/// How often [`Subscriber::spin`] looks for samples before it looks at the clock, which takes about as long as a look.
const SPINS_PER_LOOK: u32 = 16;

/// Samples could not be received.
#[derive(Debug, thiserror::Error)]
#[error("samples of {key} cannot be received ({reason}); the next call tries again")]
pub struct ReceiveError {
    key: String,
    reason: String,
    is_full: bool,
}

impl ReceiveError {
    /// Whether the topic has as many subscribers as it can have. A subscriber that is there before the publisher learns
    /// it when the publisher comes.
    pub fn is_full(&self) -> bool {
        self.is_full
    }
}

/// The next sample could not be waited for or received.
#[derive(Debug, thiserror::Error)]
pub enum RecvError {
    /// See [`ReceiveError`].
    #[error(transparent)]
    Receive(#[from] ReceiveError),
    /// See [`WaitError`].
    #[error(transparent)]
    Wait(#[from] WaitError),
}

/// The reading end of a published service.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let robot = ipc_types::Ipc::connect("altimeter")?;
/// for sample in robot.subscriber::<ipc_types::payload::HeroTelemetry>()?.iter() {
///     println!("{:.1} m", sample?.geodetic.altitude_m);
/// }
/// # Ok(())
/// # }
/// ```
///
/// It may be there before its publisher, and stays over the publisher's restarts.
pub type Subscriber<T> = Port<BytesSubscriber, T>;

impl<P: Payload> Subscriber<P> {
    /// Hands on every sample that is there, in order, and says how many those were. It is valid for the call alone.
    ///
    /// # Errors
    ///
    /// [`ReceiveError`] when the publisher cannot be reached; what was handed on before counts. The next call tries
    /// again.
    pub fn drain(&mut self, mut take: impl FnMut(&P::View)) -> Result<usize, ReceiveError> {
        self.core.drain(|bytes| {
            // SAFETY: as many bytes as the service's samples have, where the publisher has put one.
            #[allow(unsafe_code)]
            take(unsafe { P::view(bytes) });
        })
    }

    /// As [`Subscriber::drain`], of the samples' bytes, but the [`descriptor`](Port::descriptor) stays readable, and a
    /// publisher that finds it so does not notify this subscriber again, which spares it a system call for each sample.
    /// For a process that looks at the time while samples flow. Before it waits for the descriptor, it drains as usual.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn drain_quietly(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        self.core.drain_quietly(take)
    }

    /// The oldest sample that was not handed on yet, where it lies in shared memory: no copy is made. It stays as it is
    /// for as long as it is held, whatever is published meanwhile; the publisher goes on.
    ///
    /// # Errors
    ///
    /// As [`Subscriber::drain`].
    pub fn try_borrow(&mut self) -> Result<Option<Sample<'_, P>>, ReceiveError> {
        let sample = self.core.next()?;
        Ok(sample.map(|sample| Sample {
            sample: Owned::new(sample),
            borrowed: PhantomData,
        }))
    }

    /// As [`Port::wait`], but keeps the processor busy instead of sleeping: for a consumer that has one of its own.
    /// A signal does not end it. Says whether there is something.
    pub fn spin(&mut self, timeout: Duration) -> bool {
        self.core.spin(timeout)
    }

    /// What was received and missed so far.
    pub fn losses(&self) -> Losses {
        self.core.tracker.losses()
    }

    /// Generations of shared memory that this subscriber has entered.
    pub fn generations(&self) -> u64 {
        self.core.generations
    }
}

impl<T: Topic> Subscriber<T> {
    /// A copy of the oldest sample that was not handed on yet, or `None` if there is none.
    ///
    /// # Errors
    ///
    /// As [`Subscriber::drain`].
    pub fn try_recv(&mut self) -> Result<Option<T>, ReceiveError> {
        Ok(self.try_borrow()?.map(|sample| *sample))
    }

    /// As [`Subscriber::try_recv`], but sleeps until there is a sample or `timeout` has passed. A signal does not end
    /// it.
    ///
    /// # Errors
    ///
    /// See [`RecvError`].
    pub fn recv_timeout(&mut self, timeout: Duration) -> Result<Option<T>, RecvError> {
        let deadline = MonotonicNs::now() + timeout;
        loop {
            if let Some(sample) = self.try_recv()? {
                return Ok(Some(sample));
            }
            let now = MonotonicNs::now();
            if now >= deadline {
                return Ok(None);
            }
            self.wait(deadline.since(now))?;
        }
    }

    /// The samples as they come, for ever: `for sample in telemetry.iter()`. Sleeps while there is none.
    ///
    /// Each item is [`Subscriber::recv_timeout`] without a timeout, so an error does not end it.
    pub fn iter(&mut self) -> impl Iterator<Item = Result<T, RecvError>> {
        std::iter::from_fn(|| {
            loop {
                match self.recv_timeout(Duration::MAX) {
                    Ok(None) => {}
                    Ok(Some(sample)) => return Some(Ok(sample)),
                    Err(error) => return Some(Err(error)),
                }
            }
        })
    }

    /// The newest sample that was not handed on yet, or `None` if there is no new one. Older ones are dropped.
    ///
    /// # Errors
    ///
    /// As [`Subscriber::drain`].
    pub fn latest(&mut self) -> Result<Option<T>, ReceiveError> {
        let mut latest = None;
        self.drain(|sample| latest = Some(*sample))?;
        Ok(latest)
    }
}

/// A sample that lies in shared memory, until it is dropped. Made by [`Subscriber::try_borrow`].
pub struct Sample<'subscriber, P> {
    sample: Owned<BytesSample>,
    /// It shares counts of references with the port, so it stays in the thread.
    borrowed: PhantomData<(&'subscriber mut Subscriber<P>, *const P)>,
}

impl<P: Payload> Deref for Sample<'_, P> {
    type Target = P::View;

    fn deref(&self) -> &P::View {
        // SAFETY: as in `Subscriber::drain`; the sample is held.
        #[allow(unsafe_code)]
        unsafe {
            P::view(bytes(self.sample.payload()))
        }
    }
}

/// The reading end of a published service whose samples are bytes.
pub struct BytesSubscriber {
    /// `None` while no publisher has been there.
    port: Option<SubscriberPort>,
    /// The port of the former generation, while there are samples in it.
    former: Option<SubscriberPort>,
    /// What it expects of its service.
    offer: Offer,
    /// Bytes of a sample.
    size: usize,
    follower: Follower,
    pollable: Pollable,
    tracker: SequenceTracker,
    generations: u64,
    session: Arc<Session>,
}

/// A subscriber's part in one generation.
struct SubscriberPort {
    port: iceoryx2::port::subscriber::Subscriber<Svc, [CustomPayloadMarker], ()>,
    samples: WakeReceiver,
    /// Announces the subscriber to publishers that listen to events.
    _joined: WakeSender,
    // Last: its node must outlive the ports.
    generation: Generation,
}

// SAFETY: it owns all that shares its counts of references, see [`Svc`]; no other thread has any of it.
#[allow(unsafe_code)]
unsafe impl Send for SubscriberPort {}

impl SubscriberPort {
    /// `history` samples of those that were published before come at once.
    fn open(
        session: &Arc<Session>,
        generation: Generation,
        offer: &Offer,
        history: usize,
    ) -> Result<SubscriberPort, OpenError> {
        let (robot, key) = (session.robot(), offer.key.as_str());
        let service = open::open_topic(&generation, offer, robot)?;
        let event = |channel| Event::open(&generation, robot, key, channel);
        let samples = WakeReceiver::new(event(ServiceEvent::Samples)?);
        let subscribers = event(ServiceEvent::Subscribers)?;
        let port = open::port(
            &service_name(robot, key),
            ("subscribers", service.static_config().max_subscribers()),
            |error| error == SubscriberCreateError::ExceedsMaxSupportedSubscribers,
            || {
                service
                    .subscriber_builder()
                    .buffer_size(SUBSCRIBER_BUFFER)
                    .history_request(history)
                    .create()
            },
        )?;
        // Last, because it announces the subscriber to the publisher, which then gives it the latest sample.
        let joined = WakeSender::make(session, subscribers)?;
        session.doorbell().join(offer.slot);
        Ok(SubscriberPort {
            port,
            samples,
            _joined: joined,
            generation,
        })
    }

    /// The oldest of at most `left` samples that the tracker accepts.
    fn next(
        &self,
        tracker: &mut SequenceTracker,
        size: usize,
        left: &mut usize,
    ) -> Result<Option<BytesSample>, String> {
        while *left > 0 {
            *left -= 1;
            let Some(sample) = self.port.receive().map_err(|error| format!("{error:?}"))? else {
                return Ok(None);
            };
            let payload = bytes(sample.payload());
            if payload.len() == size
                && tracker.accept(word(payload, EPOCH_OFFSET), word(payload, SEQUENCE_OFFSET))
            {
                return Ok(Some(sample));
            }
        }
        Ok(None)
    }

    /// Trouble counts as something: draining then says what it is.
    fn has_samples(&self) -> bool {
        self.port.has_samples().unwrap_or(true)
    }
}

/// Any payload is a slice of markers, each of which is one byte.
type BytesSample = iceoryx2::sample::Sample<Svc, [CustomPayloadMarker], ()>;

/// The marker is one byte; it stands for any payload.
fn bytes(payload: &[CustomPayloadMarker]) -> &[u8] {
    // SAFETY: a marker has the size of a byte and holds one, and the slice is borrowed for as long.
    #[allow(unsafe_code)]
    unsafe {
        std::slice::from_raw_parts(payload.as_ptr().cast(), payload.len())
    }
}

impl BytesSubscriber {
    /// `history` samples of those that were published before come at once, when there is a publisher already.
    pub(crate) fn open(
        session: &Arc<Session>,
        offer: Offer,
        history: usize,
    ) -> Result<BytesSubscriber, OpenError> {
        let key = offer.key.clone();
        let mut subscriber = BytesSubscriber {
            port: None,
            former: None,
            size: offer.schema.size(),
            offer,
            follower: Follower::new(session, &key),
            pollable: Pollable::default(),
            tracker: SequenceTracker::new(MonotonicNs::now()),
            generations: 0,
            session: Arc::clone(session),
        };
        match until_room(session, &key, || subscriber.follow(history)) {
            // Its publisher has gone in this moment, or goes: the next one will be followed.
            Err(error) if error.may_pass() => {
                crate::log::debug!(%error, "there is no publisher yet");
            }
            result => result?,
        }
        Ok(subscriber)
    }

    /// Enters another generation if there is one. Samples that the former one got go first; from now on the publisher
    /// feeds the new one.
    fn follow(&mut self, history: usize) -> Result<(), OpenError> {
        let present = self.port.as_ref().map(|port| port.generation.name());
        let open = |session: &_, generation| {
            SubscriberPort::open(session, generation, &self.offer, history)
        };
        if let Some(port) = self.follower.follow(present, open)? {
            self.generations += 1;
            self.pollable.change(&port.samples);
            self.former = self.port.replace(port);
        }
        Ok(())
    }

    /// Hands on every sample that is there, in order, and says how many those were.
    fn drain(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        let begun = self.begin();
        self.drain_begun(begun, take)
    }

    /// Hands on every sample that is there, in order, without emptying what has woken the port.
    fn drain_quietly(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        let followed = self.follow_if_alone();
        self.drain_begun(followed, take)
    }

    fn drain_begun(
        &mut self,
        begun: Result<(), ReceiveError>,
        mut take: impl FnMut(&[u8]),
    ) -> Result<usize, ReceiveError> {
        let mut left = MAX_SAMPLES_PER_DRAIN;
        let mut taken = 0;
        while let Some(sample) = self.next_of(&mut left)? {
            take(bytes(sample.payload()));
            taken += 1;
        }
        begun.map(|()| taken)
    }

    /// The oldest sample that was not handed on yet.
    fn next(&mut self) -> Result<Option<BytesSample>, ReceiveError> {
        let begun = self.begin();
        let mut left = MAX_SAMPLES_PER_DRAIN;
        match self.next_of(&mut left)? {
            Some(sample) => Ok(Some(sample)),
            None => begun.map(|()| None),
        }
    }

    /// Looks for another generation, and empties what has woken the port. After an error the samples that are there can
    /// be read.
    fn begin(&mut self) -> Result<(), ReceiveError> {
        self.check_process()?;
        let followed = self.follow_if_alone();
        for port in self.former.iter().chain(&self.port) {
            port.samples.take();
        }
        self.pollable.drained();
        followed
    }

    /// Looks for another generation, unless there is a former one: its samples are on the way.
    fn follow_if_alone(&mut self) -> Result<(), ReceiveError> {
        match self.former {
            // Asked here as well, because what `follow` returns is as large as a port.
            None if self.follower.is_due() => self.follow(HISTORY).map_err(|error| ReceiveError {
                is_full: matches!(error, OpenError::Full { .. }),
                ..self.failed(error.with_cause())
            }),
            _ => Ok(()),
        }
    }

    /// The oldest of at most `left` samples.
    fn next_of(&mut self, left: &mut usize) -> Result<Option<BytesSample>, ReceiveError> {
        self.check_process()?;
        if let Some(former) = &self.former {
            if let Ok(Some(sample)) = former.next(&mut self.tracker, self.size, left) {
                return Ok(Some(sample));
            }
            if let Some(former) = self.former.take_if(|_| *left > 0) {
                self.pollable.forget(&former.samples);
                // The last member of a generation deletes it, among the segments of all users.
                self.session.housekeeper().drop_later(former);
            }
        }
        let Some(port) = &self.port else {
            return Ok(None);
        };
        port.next(&mut self.tracker, self.size, left)
            .map_err(|reason| {
                // iceoryx2 does not try a failed connection again until the publishers change; a new port does.
                self.port = None;
                self.follower.forget();
                self.failed(reason)
            })
    }

    fn check_process(&self) -> Result<(), ReceiveError> {
        let here = self.session.check_process();
        here.map_err(|forked| self.failed(forked.to_string()))
    }

    fn failed(&self, reason: String) -> ReceiveError {
        ReceiveError {
            key: self.offer.key.clone(),
            reason,
            is_full: false,
        }
    }

    fn spin(&self, timeout: Duration) -> bool {
        let deadline = MonotonicNs::now() + timeout;
        loop {
            for _ in 0..SPINS_PER_LOOK {
                if sealed::Source::has_something(self, sealed::Look::Quick) {
                    return true;
                }
                hint::spin_loop();
            }
            if MonotonicNs::now() >= deadline {
                return false;
            }
        }
    }
}

impl sealed::Source for BytesSubscriber {
    fn has_something(&self, _look: sealed::Look) -> bool {
        self.port.as_ref().is_some_and(SubscriberPort::has_samples)
            || self.former.is_some()
            || self.follower.is_due()
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: self.offer.slot.bits(ServiceEvent::Samples),
            receiver: self.port.as_ref().map(|port| &port.samples),
            by_descriptor: false,
            bound: match self.follower.is_retrying() {
                true => sealed::Bound::SHORT,
                false => sealed::Bound::LONG_BY_DOORBELL,
            },
        }
    }
}

port::core!(BytesSubscriber);
