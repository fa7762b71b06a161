//! [`OwnTopics`]: what the relay publishes on the robot about itself: its state, and its stations.

use std::time::Duration;

use ipc_types::code::ModuleStatus;
use ipc_types::module::{State, doing_bytes};
use ipc_types::payload::{RelayStation, RelayStations};
use ipc_types::{Ipc, Module, MonotonicNs, OpenError, Publisher, RelayModule, StateOf};
use module_kit::process::Sources;

/// How often state and stations are published though nothing has changed.
const PUBLISH_PERIOD: Duration = Duration::from_millis(900);

/// The relay's topics on the robot.
pub struct OwnTopics {
    state: Publisher<StateOf<RelayModule>>,
    stations: Publisher<RelayStations>,
    since: MonotonicNs,
    was_relaying: bool,
    next: MonotonicNs,
}

impl OwnTopics {
    /// Becomes the relay of the robot.
    ///
    /// # Errors
    ///
    /// Another relay of the robot runs, or its shared memory cannot be used.
    pub fn open(ipc: &Ipc) -> Result<OwnTopics, OpenError> {
        let now = MonotonicNs::now();
        Ok(OwnTopics {
            state: ipc.publisher()?,
            stations: ipc.publisher()?,
            since: now,
            was_relaying: false,
            next: now,
        })
    }

    /// Adds what is to be waited for.
    pub fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.port(&mut self.state);
        sources.port(&mut self.stations);
    }

    /// Something has changed: it is published at the next occasion.
    pub fn hasten(&mut self, now: MonotonicNs) {
        self.next = self.next.min(now);
    }

    /// When something is to be published.
    pub fn deadline(&self) -> MonotonicNs {
        self.next
    }

    /// Publishes the state, and the stations.
    pub fn publish(&mut self, is_relaying: bool, rows: Vec<RelayStation>, now: MonotonicNs) {
        if is_relaying != self.was_relaying {
            self.since = now;
            self.was_relaying = is_relaying;
        }
        let (functionality, doing) = match is_relaying {
            true => (RelayModule::RELAYING, "relaying to stations"),
            false => (RelayModule::WAITING, "waiting for a station"),
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
        let stations = self.stations.publish(|sample| {
            sample.published_ns = now.0;
            sample.count = rows.len() as u32;
            for (place, row) in sample.stations.iter_mut().zip(rows) {
                *place = row;
            }
        });
        if let Err(error) = published.and(stations) {
            tracing::debug!(%error, "the state cannot be published");
        }
        self.next = now + PUBLISH_PERIOD;
    }
}
