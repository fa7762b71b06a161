//! [`Topic`]: one topic of the robot on its way to the stations.

use ipc_types::schema::CDR_HEADER;
use ipc_types::{DynamicSubscriber, MonotonicNs};

use super::ros2_outlet::Ros2Outlet;
use crate::message::encode;
use crate::network::Outbox;
use crate::telemetry::Outlet;

/// A topic that is carried.
pub struct Topic {
    subscriber: DynamicSubscriber,
    outlet: Outlet,
    outbox: Outbox,
    is_failing: bool,
}

impl Topic {
    /// Sends what `subscriber` reads, as `outlet` decides.
    pub fn new(subscriber: DynamicSubscriber, outlet: Outlet, outbox: Outbox) -> Topic {
        Topic {
            subscriber,
            outlet,
            outbox,
            is_failing: false,
        }
    }

    /// Reads what has been published, and sends what is due. Says how many samples went out.
    pub fn send(&mut self, now: MonotonicNs, mut ros2: Option<&mut Ros2Outlet>) -> u64 {
        let outlet = &mut self.outlet;
        let drained = self.subscriber.drain(|sample| outlet.take(sample));
        let was_failing = std::mem::replace(&mut self.is_failing, drained.is_err());
        if let Err(error) = drained
            && !was_failing
        {
            tracing::warn!(key = self.subscriber.key(), %error, "a topic cannot be read");
        }
        // What waits goes out when the network has opened the way, and wakes the process for it.
        if !self.outbox.is_open() {
            return 0;
        }
        let lost = self.subscriber.losses().lost;
        let before = self.outlet.sent();
        let (key, outbox) = (self.subscriber.key(), &self.outbox);
        self.outlet.send(now, lost, |header, sample| {
            outbox.send(with_cdr_header(sample), encode(header));
            if let Some(ros2) = &mut ros2 {
                ros2.send(key, sample);
            }
        });
        self.outlet.sent() - before
    }

    /// Sends the latest sample again.
    pub fn send_latest(&self) {
        let lost = self.subscriber.losses().lost;
        self.outlet.send_again(lost, |header, sample| {
            self.outbox.send(with_cdr_header(sample), encode(header));
        });
    }

    /// When a sample is due that has come already.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.outlet.deadline().filter(|_| self.outbox.is_open())
    }
}

/// A sample as it goes over the network: a CDR message, which ROS 2 and recorders read as it is.
fn with_cdr_header(sample: &[u8]) -> Vec<u8> {
    [&CDR_HEADER[..], sample].concat()
}
