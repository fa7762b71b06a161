//! [`OwnTopic`]: what the gateway publishes of itself, for `ril mavlink status` and `ril doctor`.

use std::time::Duration;

use ipc_types::payload::{MavlinkStation, MavlinkStations};
use ipc_types::{Ipc, MonotonicNs, Publisher, Source};
use mavlink_gateway::Gateway;
use runtime::exit::{ExitCode, Failure, OrFail};

/// How often it is published though nothing has changed. Counts alone are no change, so that a flood is none.
const PERIOD: Duration = Duration::from_millis(900);

/// See the module's documentation.
pub(super) struct OwnTopic {
    port: Publisher<MavlinkStations>,
    last: MavlinkStations,
    next: MonotonicNs,
    /// Datagrams that a full socket did not take.
    pub dropped: u64,
}

impl OwnTopic {
    /// # Errors
    ///
    /// Another gateway of this robot runs, or shared memory cannot be used.
    pub fn open(ipc: &Ipc) -> Result<OwnTopic, Failure> {
        Ok(OwnTopic {
            port: ipc.publisher().or_fail(ExitCode::Internal)?,
            last: MavlinkStations::default(),
            next: MonotonicNs(0),
            dropped: 0,
        })
    }

    /// What to wait for.
    pub fn source(&mut self) -> &mut dyn Source {
        &mut self.port
    }

    /// When it is published at the latest.
    pub fn deadline(&self) -> MonotonicNs {
        self.next
    }

    /// Publishes it when it has changed, or is due.
    pub fn tend(&mut self, gateway: &Gateway, now: MonotonicNs) {
        self.port.tend();
        let mut sample = self.last;
        gateway.describe(&mut sample, now);
        sample.datagrams_dropped = self.dropped;
        if now < self.next && shown(&sample) == shown(&self.last) {
            return;
        }
        self.last = sample;
        self.next = now + PERIOD;
        if let Err(error) = self.port.publish(|place| *place = sample) {
            tracing::debug!(%error, "the stations cannot be published");
        }
    }
}

/// What is published at once when it changes.
fn shown(sample: &MavlinkStations) -> (u32, Vec<[u64; 7]>) {
    let station = |one: &MavlinkStation| {
        [
            one.since_ns,
            one.commands,
            one.system.into(),
            one.component.into(),
            one.may_command.into(),
            one.is_lost.into(),
            one.has_movement.into(),
        ]
    };
    (
        sample.vehicle,
        sample.stations().iter().map(station).collect(),
    )
}
