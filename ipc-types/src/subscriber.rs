//! [`Subscriber`]: the reading end of a published service; it sleeps, drains and counts what it missed.

use std::hint;
use std::os::fd::BorrowedFd;
use std::rc::Rc;
use std::time::Duration;

use iceoryx2::port::subscriber::SubscriberCreateError;

use crate::continuity::{Continuity, Losses};
use crate::ear::{Ear, Signal};
use crate::event::Channel;
use crate::iox::{Svc, TopicService};
use crate::open::{self, OpenError};
use crate::service::{HISTORY, MAX_PROVIDERS, MAX_SUBSCRIBERS, SUBSCRIBER_BUFFER, Topic};
use crate::session::Session;
use crate::time::MonotonicNs;
use crate::waiter::{self, WaitError, Waiter, Wake, sealed};

/// Most samples of one [`Subscriber::drain`]: all buffers full. What comes meanwhile waits for the next.
const MAX_SAMPLES_PER_DRAIN: usize = SUBSCRIBER_BUFFER * MAX_PROVIDERS;

/// How often [`Subscriber::spin`] looks for samples before it looks at the clock, which takes about as long as a look.
const SPINS_PER_LOOK: u32 = 16;

/// Samples could not be received.
#[derive(Debug, thiserror::Error)]
#[error("samples of {service} cannot be received ({reason}); the next call tries again")]
pub struct ReceiveError {
    service: &'static str,
    reason: String,
}

/// The reading end of a published service.
///
/// It may be there before its publisher, and stays over the publisher's restarts.
pub struct Subscriber<T: Topic> {
    port: Port<T>,
    ear: Ear,
    waiter: Waiter,
    continuity: Continuity,
    reconnects: u64,
    service: TopicService<T>,
    arrival: Signal,
    session: Rc<Session>,
}

type Port<T> = iceoryx2::port::subscriber::Subscriber<Svc, T, ()>;

impl<T: Topic> Subscriber<T> {
    pub(crate) fn open(session: &Rc<Session>) -> Result<Subscriber<T>, OpenError> {
        let robot = session.robot();
        let service = open::topic::<T>(session, robot)?;
        let ear = Ear::make(session, T::SERVICE, Channel::Samples)?;
        let port = make_port(session, &service)?;
        // Last, because it announces the subscriber to the publisher, which then gives it the latest sample.
        let arrival = Signal::make(session, T::SERVICE, Channel::Subscribers)?;
        announce::<T>(session);
        Ok(Subscriber {
            port,
            ear,
            waiter: Waiter::new(),
            continuity: Continuity::default(),
            reconnects: 0,
            service,
            arrival,
            session: Rc::clone(session),
        })
    }

    /// Hands on every sample that is there, in order, and says how many those were.
    ///
    /// # Errors
    ///
    /// [`ReceiveError`] when the publisher cannot be reached; what was handed on before counts. The port is then made
    /// again by the next call.
    pub fn drain(&mut self, mut take: impl FnMut(&T)) -> Result<usize, ReceiveError> {
        self.ear.take();
        let mut taken = 0;
        for _ in 0..MAX_SAMPLES_PER_DRAIN {
            match self.port.receive() {
                Ok(None) => break,
                Ok(Some(sample)) => {
                    let (epoch_ns, sequence) = (sample.epoch_ns(), sample.sequence());
                    if self.continuity.accept(MonotonicNs::now, epoch_ns, sequence) {
                        take(&sample);
                        taken += 1;
                    }
                }
                Err(error) => {
                    // iceoryx2 does not try a failed connection again until the publishers change; a new port does.
                    self.reconnect();
                    return Err(ReceiveError {
                        service: T::SERVICE.spec().key,
                        reason: format!("{error:?}"),
                    });
                }
            }
        }
        Ok(taken)
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
        self.waiter.wait(&[&*self], Some(timeout))
    }

    /// As [`Subscriber::wait`], but keeps the processor busy instead of sleeping: for a consumer that has one of its own.
    /// A signal does not end it.
    pub fn spin(&mut self, timeout: Duration) -> Wake {
        let deadline = MonotonicNs::now() + timeout;
        loop {
            for _ in 0..SPINS_PER_LOOK {
                let ready = waiter::look(&[&*self]);
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

    /// A file descriptor that can be read once there are samples, for a reactor of the caller's own such as `epoll` or an
    /// asynchronous runtime; [`Subscriber::drain`] empties it. Nothing else may read it.
    ///
    /// Drain after every wake, whatever caused it, and at least every [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND):
    /// iceoryx2 can lose a wake-up.
    ///
    /// # Errors
    ///
    /// When there are more listeners than the contract allows.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, OpenError> {
        self.ear.lend_descriptor()
    }

    /// What was received and missed so far.
    pub fn losses(&self) -> Losses {
        self.continuity.losses()
    }

    /// How often the port had to be made again because a publisher could not be reached.
    pub fn reconnects(&self) -> u64 {
        self.reconnects
    }

    /// As [`Waiter::missed`], of this subscriber's own [`wait`](Subscriber::wait).
    pub fn missed_wakeups(&self) -> u64 {
        self.waiter.missed()
    }

    fn reconnect(&mut self) {
        self.reconnects += 1;
        match make_port(&self.session, &self.service) {
            Ok(port) => {
                self.port = port;
                announce::<T>(&self.session);
                self.arrival.raise();
            }
            Err(error) => tracing::debug!(%error, "the subscriber was not made again"),
        }
    }
}

fn make_port<T: Topic>(session: &Session, service: &TopicService<T>) -> Result<Port<T>, OpenError> {
    open::port(
        session,
        &T::SERVICE.name(session.robot()),
        ("subscribers", MAX_SUBSCRIBERS),
        |error| error == SubscriberCreateError::ExceedsMaxSupportedSubscribers,
        || {
            service
                .subscriber_builder()
                .buffer_size(SUBSCRIBER_BUFFER)
                .history_request(HISTORY)
                .create()
        },
    )
}

/// Asks the publisher for the latest sample, by the bell; listeners are told when a notifier is made or notifies.
fn announce<T: Topic>(session: &Session) {
    if let Some(bell) = session.bell() {
        bell.arrive(T::SERVICE);
    }
}

/// Trouble counts as something: draining then says what it is.
fn has_samples<T: Topic>(port: &Port<T>) -> bool {
    port.has_samples().unwrap_or(true)
}

impl<T: Topic> sealed::Source for Subscriber<T> {
    fn has_something(&self) -> bool {
        has_samples(&self.port)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        sealed::Sense::Ear(&self.ear)
    }
}
