//! [`Subscriber`]: the reading end of a published service; it sleeps, drains and counts what it missed. What it does with
//! bytes, `BytesSubscriber` does, which knows nothing of structs.

use std::hint;
use std::marker::PhantomData;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::service::marker::CustomPayloadMarker;

use crate::doorbell::{Channel, Place, place};
use crate::event::Event;
use crate::follow::Follower;
use crate::generation::Generation;
use crate::iox::Svc;
use crate::open::{self, Expected, OpenError};
use crate::sequence::{Losses, SequenceTracker};
use crate::service::{
    Contract, EPOCH_OFFSET, HISTORY, LATEST, MAX_SUBSCRIBERS, SEQUENCE_OFFSET, SUBSCRIBER_BUFFER,
    Topic,
};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::{self, WaitError, Waiter, Wake, sealed};
use crate::wake::{WakeReceiver, WakeSender};

/// Most samples of one [`Subscriber::drain`] and generation: a full buffer. What comes meanwhile waits for the next.
const MAX_SAMPLES_PER_DRAIN: usize = SUBSCRIBER_BUFFER;

/// A timeout that nobody lives to see the end of.
const FOR_EVER: Duration = Duration::from_secs(1 << 32);

/// How often [`Subscriber::spin`] looks for samples before it looks at the clock, which takes about as long as a look.
const SPINS_PER_LOOK: u32 = 16;

/// Samples could not be received.
#[derive(Debug, thiserror::Error)]
#[error("samples of {key} cannot be received ({reason}); the next call tries again")]
pub struct ReceiveError {
    key: String,
    reason: String,
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
pub struct Subscriber<T: Topic> {
    bytes: BytesSubscriber,
    payload: PhantomData<fn() -> T>,
}

impl<T: Topic> Subscriber<T> {
    pub(crate) fn open(session: &Arc<Session>) -> Result<Subscriber<T>, OpenError> {
        let expected = Expected::of(&Contract::of_topic::<T>(), session.robot());
        Ok(Subscriber {
            bytes: BytesSubscriber::open(session, T::KEY, expected, size_of::<T>())?,
            payload: PhantomData,
        })
    }

    /// Hands on every sample that is there, in order, and says how many those were.
    ///
    /// # Errors
    ///
    /// [`ReceiveError`] when the publisher cannot be reached; what was handed on before counts. The next call tries again.
    pub fn drain(&mut self, mut take: impl FnMut(&T)) -> Result<usize, ReceiveError> {
        self.bytes.drain(|bytes| {
            // SAFETY: the service carries this very layout, by its type name, size, alignment and hash; every pattern of
            // bits is a value of it. The bytes are as many, and lie where the publisher has put a `T`.
            #[allow(unsafe_code)]
            take(unsafe { &*bytes.as_ptr().cast::<T>() });
        })
    }

    /// The oldest sample that was not handed on yet, or nothing when there is none.
    ///
    /// # Errors
    ///
    /// As [`Subscriber::drain`].
    pub fn try_recv(&mut self) -> Result<Option<T>, ReceiveError> {
        let mut next = None;
        self.bytes
            .drain_at_most(1, |bytes| next = T::from_bytes(bytes))?;
        Ok(next)
    }

    /// As [`Subscriber::try_recv`], but sleeps until there is a sample or `timeout` has passed. A signal does not end it.
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
            self.bytes.wait(deadline.since(now))?;
        }
    }

    /// The samples as they come, for ever: `for sample in telemetry.iter()`. Sleeps while there is none.
    ///
    /// Each item is [`Subscriber::recv_timeout`] without a timeout, so an error does not end it.
    pub fn iter(&mut self) -> impl Iterator<Item = Result<T, RecvError>> {
        std::iter::from_fn(|| {
            loop {
                match self.recv_timeout(FOR_EVER) {
                    Ok(None) => {}
                    Ok(Some(sample)) => return Some(Ok(sample)),
                    Err(error) => return Some(Err(error)),
                }
            }
        })
    }

    /// The newest sample that was not handed on yet, or nothing when there is no new one. Older ones are dropped.
    ///
    /// # Errors
    ///
    /// As [`Subscriber::drain`].
    pub fn latest(&mut self) -> Result<Option<T>, ReceiveError> {
        let mut latest = None;
        self.drain(|sample| latest = Some(*sample))?;
        Ok(latest)
    }

    /// Sleeps until there is a sample, a signal comes or `timeout` has passed. A sample that came before returns at
    /// once.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        self.bytes.wait(timeout)
    }

    /// As [`Subscriber::wait`], but keeps the processor busy instead of sleeping: for a consumer that has one of its own.
    /// A signal does not end it.
    pub fn spin(&mut self, timeout: Duration) -> Wake {
        self.bytes.spin(timeout)
    }

    /// A file descriptor that can be read once there are samples, for a reactor of the caller's own such as `epoll` or an
    /// asynchronous runtime; [`Subscriber::drain`] empties it. Nothing else may read it. Nothing while there has been no
    /// publisher; another one after [`Subscriber::generations`] has changed.
    ///
    /// Drain after every wake, whatever caused it, and at least every [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND):
    /// iceoryx2 can lose a wake-up.
    ///
    /// # Errors
    ///
    /// When there are more listeners than the contract allows.
    pub fn descriptor(&self) -> Result<Option<BorrowedFd<'_>>, OpenError> {
        self.bytes.descriptor()
    }

    /// What was received and missed so far.
    pub fn losses(&self) -> Losses {
        self.bytes.tracker.losses()
    }

    /// Generations of shared memory that this subscriber has entered.
    pub fn generations(&self) -> u64 {
        self.bytes.generations
    }

    /// As [`Waiter::missed`], of this subscriber's own [`wait`](Subscriber::wait).
    pub fn missed_wakeups(&self) -> u64 {
        self.bytes.waiter.missed()
    }
}

impl<T: Topic> sealed::Source for Subscriber<T> {
    fn has_something(&self) -> bool {
        self.bytes.has_something()
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

/// The reading end of a published service whose samples are bytes.
pub(crate) struct BytesSubscriber {
    /// Nothing while no publisher has been there.
    port: Option<Port>,
    /// The port of the former generation, while there are samples in it.
    former: Option<Port>,
    key: String,
    expected: Expected,
    /// Bytes of a sample.
    size: usize,
    follower: Follower,
    waiter: Waiter,
    tracker: SequenceTracker,
    generations: u64,
    place: Place,
    session: Arc<Session>,
}

/// A subscriber's part in one generation.
struct Port {
    port: iceoryx2::port::subscriber::Subscriber<Svc, [CustomPayloadMarker], ()>,
    samples: WakeReceiver,
    /// Announces the subscriber to publishers that listen to events.
    _joined: WakeSender,
    // Last: its node must outlive the ports.
    generation: Generation,
}

// SAFETY: it owns all that shares its counts of references, see [`Svc`]; no other thread has any of it.
#[allow(unsafe_code)]
unsafe impl Send for Port {}

impl Port {
    /// `history` samples of those that were published before come at once.
    fn open(
        session: &Arc<Session>,
        generation: Generation,
        key: &str,
        expected: &Expected,
        history: usize,
    ) -> Result<Port, OpenError> {
        let robot = session.robot();
        let service = open::open_topic(&generation, expected)?;
        let event = |channel| Event::open(&generation, robot, key, channel);
        let samples = WakeReceiver::new(event(Channel::Samples)?);
        let subscribers = event(Channel::Subscribers)?;
        let port = open::port(
            &expected.name,
            ("subscribers", MAX_SUBSCRIBERS),
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
        let joined = WakeSender::make(session, subscribers, place(key), Channel::Subscribers)?;
        session.doorbell().join(place(key));
        Ok(Port {
            port,
            samples,
            _joined: joined,
            generation,
        })
    }

    /// Hands on at most so many samples that the tracker accepts, and says how many those were.
    fn drain(
        &self,
        tracker: &mut SequenceTracker,
        size: usize,
        most: usize,
        mut take: impl FnMut(&[u8]),
    ) -> Result<usize, String> {
        self.samples.take();
        let mut taken = 0;
        for _ in 0..MAX_SAMPLES_PER_DRAIN {
            if taken == most {
                break;
            }
            match self.port.receive() {
                Ok(None) => break,
                Ok(Some(sample)) => {
                    let sample = bytes(sample.payload());
                    if sample.len() == size
                        && tracker.accept(word(sample, EPOCH_OFFSET), word(sample, SEQUENCE_OFFSET))
                    {
                        take(sample);
                        taken += 1;
                    }
                }
                Err(error) => return Err(format!("{error:?}")),
            }
        }
        Ok(taken)
    }

    /// Trouble counts as something: draining then says what it is.
    fn has_samples(&self) -> bool {
        self.port.has_samples().unwrap_or(true)
    }
}

/// The marker is one byte; it stands for any payload.
fn bytes(payload: &[CustomPayloadMarker]) -> &[u8] {
    // SAFETY: a marker has the size of a byte and holds one, and the slice is borrowed for as long.
    #[allow(unsafe_code)]
    unsafe {
        std::slice::from_raw_parts(payload.as_ptr().cast(), payload.len())
    }
}

/// The number at an offset of a sample; every sample begins with two of them.
fn word(sample: &[u8], offset: usize) -> u64 {
    let bytes = sample.get(offset..offset + 8);
    bytes
        .and_then(|bytes| bytes.try_into().ok())
        .map_or(0, u64::from_ne_bytes)
}

impl BytesSubscriber {
    pub(crate) fn open(
        session: &Arc<Session>,
        key: &str,
        expected: Expected,
        size: usize,
    ) -> Result<BytesSubscriber, OpenError> {
        let mut subscriber = BytesSubscriber {
            port: None,
            former: None,
            key: key.to_owned(),
            expected,
            size,
            follower: Follower::new(session, key),
            waiter: Waiter::new(),
            tracker: SequenceTracker::default(),
            generations: 0,
            place: place(key),
            session: Arc::clone(session),
        };
        match subscriber.follow(LATEST) {
            // Its publisher has gone in this moment, or goes: the next one will be followed.
            Err(error @ (OpenError::Failed { .. } | OpenError::Domain(_))) => {
                tracing::debug!(%error, "there is no publisher yet");
            }
            result => result?,
        }
        Ok(subscriber)
    }

    /// Enters another generation if there is one. Samples that the former one got go first; from now on the publisher feeds
    /// the new one.
    fn follow(&mut self, history: usize) -> Result<(), OpenError> {
        let present = self.port.as_ref().map(|port| port.generation.name());
        let open = |session: &_, generation| {
            Port::open(session, generation, &self.key, &self.expected, history)
        };
        if let Some(port) = self.follower.follow(present, open)? {
            self.generations += 1;
            self.former = self.port.replace(port);
        }
        Ok(())
    }

    /// Hands on every sample that is there, in order, and says how many those were.
    pub(crate) fn drain(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        self.drain_at_most(usize::MAX, take)
    }

    /// As [`BytesSubscriber::drain`], but stops after so many samples.
    fn drain_at_most(
        &mut self,
        most: usize,
        mut take: impl FnMut(&[u8]),
    ) -> Result<usize, ReceiveError> {
        // While there is a former generation, its samples are on the way.
        let followed = match self.former {
            None => self.follow(HISTORY),
            Some(_) => Ok(()),
        };
        let mut taken = 0;
        if let Some(former) = &self.former {
            let drained = former.drain(&mut self.tracker, self.size, most, &mut take);
            taken = drained.unwrap_or(0);
            if taken == most {
                return Ok(taken);
            }
            if let Some(former) = self.former.take() {
                // The last member of a generation deletes it, among everybody's segments.
                self.session.housekeeper().drop_later(former);
            }
        }
        taken += self.drain_port(most - taken, take)?;
        match followed {
            Ok(()) => Ok(taken),
            Err(error) => Err(self.failed(error.to_string())),
        }
    }

    fn drain_port(&mut self, most: usize, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        let Some(port) = &self.port else {
            return Ok(0);
        };
        port.drain(&mut self.tracker, self.size, most, take)
            .map_err(|reason| {
                // iceoryx2 does not try a failed connection again until the publishers change; a new port does.
                self.port = None;
                self.follower.forget();
                self.failed(reason)
            })
    }

    fn failed(&self, reason: String) -> ReceiveError {
        ReceiveError {
            key: self.key.clone(),
            reason,
        }
    }

    pub(crate) fn wait(&self, timeout: Duration) -> Result<Wake, WaitError> {
        self.waiter.wait(&[self], Some(timeout))
    }

    fn spin(&self, timeout: Duration) -> Wake {
        let deadline = MonotonicNs::now() + timeout;
        loop {
            for _ in 0..SPINS_PER_LOOK {
                let ready = waiter::look(&[self]);
                if !ready.is_empty() {
                    return Wake::Ready(ready);
                }
                hint::spin_loop();
            }
            if MonotonicNs::now() >= deadline {
                return Wake::TimedOut;
            }
        }
    }

    pub(crate) fn generations(&self) -> u64 {
        self.generations
    }

    pub(crate) fn descriptor(&self) -> Result<Option<BorrowedFd<'_>>, OpenError> {
        self.port
            .as_ref()
            .map(|port| port.samples.lend_descriptor())
            .transpose()
    }

    pub(crate) fn losses(&self) -> Losses {
        self.tracker.losses()
    }
}

impl sealed::Source for BytesSubscriber {
    fn has_something(&self) -> bool {
        self.port.as_ref().is_some_and(Port::has_samples)
            || self.former.is_some()
            || self.follower.is_due()
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Port {
            doorbell: self.session.doorbell(),
            bits: self.place.bits(Channel::Samples),
            receiver: self.port.as_ref().map(|port| &port.samples),
            by_descriptor: false,
        }
    }
}
