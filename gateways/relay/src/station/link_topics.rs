//! [`LinkTopics`]: what the relay publishes here about its link to one robot.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use ipc_types::code::ModuleStatus;
use ipc_types::module::{State, doing_bytes};
use ipc_types::payload::RelayLink;
use ipc_types::{Ipc, Module, MonotonicNs, OpenError, Publisher, RelayModule, StateOf, WaitError};

/// How often state and link are published though nothing has changed, and services that another process provided here are tried
/// again.
const PUBLISH_PERIOD: Duration = Duration::from_millis(900);

/// The relay's topics for one robot.
pub struct LinkTopics {
    state: Publisher<StateOf<RelayModule>>,
    link: Publisher<RelayLink>,
    next: MonotonicNs,
}

impl LinkTopics {
    /// Becomes the relay of the robot here.
    ///
    /// # Errors
    ///
    /// Another relay provides the robot here, or shared memory cannot be used.
    pub fn open(ipc: &Ipc) -> Result<LinkTopics, OpenError> {
        Ok(LinkTopics {
            state: ipc.publisher()?,
            link: ipc.publisher()?,
            next: MonotonicNs::now(),
        })
    }

    /// What to wait for.
    pub fn ports(&self) -> [Result<BorrowedFd<'_>, WaitError>; 2] {
        [self.state.descriptor(), self.link.descriptor()]
    }

    /// Gives late joiners the latest samples.
    pub fn tend(&mut self) {
        self.state.tend();
        self.link.tend();
    }

    /// Something has changed: it is published at the next occasion.
    pub fn hasten(&mut self, now: MonotonicNs) {
        self.next = self.next.min(now);
    }

    /// When something is to be published.
    pub fn deadline(&self) -> MonotonicNs {
        self.next
    }

    /// Publishes the state, and how the link is.
    pub fn publish(&mut self, is_up: bool, row: RelayLink, now: MonotonicNs) {
        self.next = now + PUBLISH_PERIOD;
        let (functionality, doing) = match is_up {
            true => (RelayModule::RELAYING, "relaying from the robot"),
            false => (RelayModule::WAITING, "waiting for the robot"),
        };
        let state = State {
            published_ns: now.0,
            since_ns: row.since_ns,
            module_id: RelayModule::ID,
            status: ModuleStatus::Running.code(),
            functionality,
            doing: doing_bytes(doing),
            ..State::default()
        };
        let published = self.state.publish(|sample| *sample = StateOf::new(state));
        let published = published.and(self.link.publish(|sample| *sample = row));
        if let Err(error) = published {
            tracing::debug!(%error, "the link cannot be published");
        }
    }
}
