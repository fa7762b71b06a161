//! [`OwnTopics`]: what a relay publishes on its machine about itself: its state, and its stations or its link.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use ipc_types::code::ModuleStatus;
use ipc_types::module::{State, doing_bytes};
use ipc_types::{
    Ipc, Module, MonotonicNs, OpenError, Publisher, RelayModule, StateOf, Topic, WaitError,
};
use module_kit::process::Sources;

/// How often both are published though nothing has changed, and services that another process provided here are tried
/// again.
const PUBLISH_PERIOD: Duration = Duration::from_millis(900);

/// The state of a relay, and the topic `T` with its details.
pub struct OwnTopics<T: Topic> {
    state: Publisher<StateOf<RelayModule>>,
    details: Publisher<T>,
    since: MonotonicNs,
    was_relaying: bool,
    next: MonotonicNs,
}

impl<T: Topic> OwnTopics<T> {
    /// Becomes the relay of the robot on this machine.
    ///
    /// # Errors
    ///
    /// Another process is, or shared memory cannot be used.
    pub fn open(ipc: &Ipc) -> Result<OwnTopics<T>, OpenError> {
        let now = MonotonicNs::now();
        Ok(OwnTopics {
            state: ipc.publisher()?,
            details: ipc.publisher()?,
            since: now,
            was_relaying: false,
            next: now,
        })
    }

    /// Adds what to wait for.
    pub fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.port(&mut self.state);
        sources.port(&mut self.details);
    }

    /// The descriptors of both ports, for a set of ports, after which [`service`](OwnTopics::service) is to be called.
    pub fn ports(&self) -> [Result<BorrowedFd<'_>, WaitError>; 2] {
        [self.state.descriptor(), self.details.descriptor()]
    }

    /// Gives late joiners the latest samples.
    pub fn service(&mut self) {
        self.state.service();
        self.details.service();
    }

    /// Something has changed: it is published at the next occasion.
    pub fn hasten(&mut self, now: MonotonicNs) {
        self.next = self.next.min(now);
    }

    /// When something is to be published.
    pub fn deadline(&self) -> MonotonicNs {
        self.next
    }

    /// Publishes the state, and the details, which `fill` writes.
    pub fn publish(&mut self, is_relaying: bool, now: MonotonicNs, fill: impl FnOnce(&mut T)) {
        self.next = now + PUBLISH_PERIOD;
        if is_relaying != self.was_relaying {
            self.since = now;
            self.was_relaying = is_relaying;
        }
        let (functionality, doing) = match is_relaying {
            true => (RelayModule::RELAYING, "relaying"),
            false => (RelayModule::WAITING, "waiting for the other side"),
        };
        let state = State {
            published_ns: now.0,
            since_ns: self.since.0,
            module_id: RelayModule::ID,
            status: ModuleStatus::Running.code(),
            functionality,
            doing: doing_bytes(doing),
            ..State::default()
        };
        let published = self.state.publish(|sample| *sample = StateOf::new(state));
        if let Err(error) = published.and(self.details.publish(fill)) {
            tracing::debug!(%error, "the state of the relay cannot be published");
        }
    }
}
