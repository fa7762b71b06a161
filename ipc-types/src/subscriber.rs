//! [`Subscriber`]: the reading end of a published service; it sleeps, drains and counts what it missed. What it does with
//! bytes, `BytesSubscriber` does, which knows nothing of structs.

use std::marker::PhantomData;
use std::ops::Deref;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Duration;
use std::{hint, mem};

use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::prelude::PortFactory;
use iceoryx2::service::marker::CustomPayloadMarker;

use crate::doorbell::{Channel, Place, place};
use crate::event::Event;
use crate::follow::{Follower, until_room};
use crate::forked::Owned;
use crate::generation::Generation;
use crate::iox::Svc;
use crate::open::{self, Expected, OpenError};
use crate::pollable::Pollable;
use crate::sequence::{Losses, SequenceTracker};
use crate::service::{
    Contract, EPOCH_OFFSET, HISTORY, LATEST, SEQUENCE_OFFSET, SUBSCRIBER_BUFFER, Topic, word,
};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::{WaitError, Waiter, Wake, sealed};
use crate::wake::{WakeReceiver, WakeSender};

/// Most samples of one [`Subscriber::drain`]: a full buffer of each of two generations. What comes meanwhile waits for the next.
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
    /// Whether the topic has as many subscribers as it can have. A subscriber that is there before the publisher learns it when the
    /// publisher comes.
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
pub struct Subscriber<T: Topic> {
    bytes: Owned<BytesSubscriber>,
    payload: PhantomData<fn() -> T>,
}

impl<T: Topic> Subscriber<T> {
    pub(crate) fn open(session: &Arc<Session>) -> Result<Subscriber<T>, OpenError> {
        let expected = Expected::of(&Contract::of_topic::<T>(), session.robot());
        Ok(Subscriber {
            bytes: BytesSubscriber::open(session, T::KEY, expected, size_of::<T>(), LATEST)?,
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

    /// A copy of the oldest sample that was not handed on yet, or nothing when there is none.
    ///
    /// # Errors
    ///
    /// As [`Subscriber::drain`].
    pub fn try_recv(&mut self) -> Result<Option<T>, ReceiveError> {
        Ok(self.try_borrow()?.map(|sample| *sample))
    }

    /// The oldest sample that was not handed on yet, where it lies in shared memory: no copy is made. It stays as it is for as
    /// long as it is held, whatever is published meanwhile; the publisher goes on.
    ///
    /// # Errors
    ///
    /// As [`Subscriber::drain`].
    pub fn try_borrow(&mut self) -> Result<Option<Sample<'_, T>>, ReceiveError> {
        let sample = self.bytes.next()?;
        Ok(sample.map(|sample| Sample {
            sample: Owned::new(sample),
            borrowed: PhantomData,
        }))
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
                match self.recv_timeout(Duration::MAX) {
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
    /// A signal does not end it. Says whether there is something.
    pub fn spin(&mut self, timeout: Duration) -> bool {
        self.bytes.spin(timeout)
    }

    /// A file descriptor for an event loop of the caller's own, such as `epoll` or an asynchronous runtime: it can be read when
    /// there may be samples, and every [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND) in any case. Drain the port then; nothing else
    /// may read the descriptor. It is the same for as long as the port lives.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors, or the service more listeners than the contract allows.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
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
    fn has_something(&self, look: sealed::Look) -> bool {
        self.bytes.has_something(look)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.bytes.sense()
    }
}

/// A sample that lies in shared memory, until it is dropped. Made by [`Subscriber::try_borrow`].
pub struct Sample<'subscriber, T: Topic> {
    sample: Owned<BytesSample>,
    /// It shares counts of references with the port, so it stays in the thread.
    borrowed: PhantomData<(&'subscriber mut Subscriber<T>, *const T)>,
}

impl<T: Topic> Deref for Sample<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: as in `Subscriber::drain`; the sample is held.
        #[allow(unsafe_code)]
        unsafe {
            &*self.sample.payload().as_ptr().cast::<T>()
        }
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
    pollable: Pollable,
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
        let joined = WakeSender::make(session, subscribers, place(key), Channel::Subscribers)?;
        session.doorbell().join(place(key));
        Ok(Port {
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
        key: &str,
        expected: Expected,
        size: usize,
        history: usize,
    ) -> Result<Owned<BytesSubscriber>, OpenError> {
        let mut subscriber = BytesSubscriber {
            port: None,
            former: None,
            key: key.to_owned(),
            expected,
            size,
            follower: Follower::new(session, key),
            waiter: Waiter::new(),
            pollable: Pollable::default(),
            tracker: SequenceTracker::default(),
            generations: 0,
            place: place(key),
            session: Arc::clone(session),
        };
        match until_room(session, key, || subscriber.follow(history)) {
            // Its publisher has gone in this moment, or goes: the next one will be followed.
            Err(error) if error.may_pass() => {
                tracing::debug!(%error, "there is no publisher yet");
            }
            result => result?,
        }
        Ok(Owned::new(subscriber))
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
            self.pollable.change(&port.samples);
            self.former = self.port.replace(port);
        }
        Ok(())
    }

    /// Hands on every sample that is there, in order, and says how many those were.
    pub(crate) fn drain(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
        let begun = self.begin();
        self.drain_begun(begun, take)
    }

    /// The same without emptying what has woken the port.
    pub(crate) fn drain_quietly(&mut self, take: impl FnMut(&[u8])) -> Result<usize, ReceiveError> {
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

    /// Hands on the oldest sample that was not handed on yet, and says whether there was one.
    pub(crate) fn take_next(&mut self, take: impl FnOnce(&[u8])) -> Result<bool, ReceiveError> {
        let sample = self.next()?;
        Ok(sample.map(|sample| take(bytes(sample.payload()))).is_some())
    }

    /// Looks for another generation, and empties what has woken the port. After an error the samples that are there can be read.
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
            None => self.follow(HISTORY).map_err(|error| ReceiveError {
                is_full: matches!(error, OpenError::Full { .. }),
                ..self.failed(error.with_cause())
            }),
            Some(_) => Ok(()),
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
            key: self.key.clone(),
            reason,
            is_full: false,
        }
    }

    pub(crate) fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        let waiter = mem::take(&mut self.waiter);
        let wake = waiter.wait_for_one(self, timeout);
        self.waiter = waiter;
        wake
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

    pub(crate) fn generations(&self) -> u64 {
        self.generations
    }

    pub(crate) fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        self.session.check_process()?;
        let receiver = self.port.as_ref().map(|port| &port.samples);
        self.pollable.descriptor(receiver)
    }

    pub(crate) fn losses(&self) -> Losses {
        self.tracker.losses()
    }
}

impl sealed::Source for BytesSubscriber {
    fn has_something(&self, _look: sealed::Look) -> bool {
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
            bound: match self.follower.is_retrying() {
                true => sealed::Bound::SHORT,
                false => sealed::Bound::LONG_BY_DOORBELL,
            },
        }
    }
}
