//! [`StandInTopic`]: in the place of whoever publishes a topic, whatever its struct is.

use std::sync::Arc;

use ipc_types::{Domain, Ipc, Patience, Publisher, RobotId, Source, Topic};

use super::flow::Flow;
use super::worker::{Ports, Worker};

/// In the place of the module that publishes `T`: it publishes what it is given.
///
/// It waits for its subscribers: a script that is longer than a queue loses nothing, also when one thread publishes all
/// of it before the first sample is read. As long as there is no subscriber, it publishes what the first one will get,
/// [`HISTORY`](ipc_types::service::HISTORY) samples. What has no room stays with the stand-in, which publishes it as
/// soon as there is room, up to [`WAIT_LIMIT`](crate::process::WAIT_LIMIT) later. When the stand-in is dropped, that is
/// lost. When 65,536 samples wait, publishing waits.
///
/// [`StandInTopic::start_lossy`] does not wait, as a module does not: of what a subscriber has not read the oldest
/// gives way to the newest, and [`losses`](ipc_types::Subscriber::losses) counts it.
pub struct StandInTopic<T: Topic> {
    worker: Worker<TopicPorts<T>>,
    flow: Arc<Flow>,
}

struct TopicPorts<T: Topic> {
    topic: Publisher<T>,
    flow: Arc<Flow>,
}

impl<T: Topic> StandInTopic<T> {
    /// Stands in for robot 1's publisher in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start(domain: &Domain) -> StandInTopic<T> {
        StandInTopic::start_for(domain, RobotId::DEFAULT)
    }

    /// Stands in for `robot`'s publisher in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_for(domain: &Domain, robot: RobotId) -> StandInTopic<T> {
        StandInTopic::start_as(domain, robot, T::PROVIDER, false)
    }

    /// Stands in for `robot`'s publisher in `domain`, and does not wait for subscribers.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_lossy(domain: &Domain, robot: RobotId) -> StandInTopic<T> {
        StandInTopic::start_as(domain, robot, T::PROVIDER, true)
    }

    /// Stands in for `robot`'s publisher in `domain`, as the process `name`, which waits for subscribers or `is_lossy`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_as(
        domain: &Domain,
        robot: RobotId,
        name: &'static str,
        is_lossy: bool,
    ) -> StandInTopic<T> {
        let flow = Arc::<Flow>::default();
        let of_ports = Arc::clone(&flow);
        let open = move |ipc: &Ipc| {
            let topic = match is_lossy {
                true => ipc.publisher()?,
                false => {
                    let of_queues = Arc::clone(&of_ports);
                    ipc.patient_publisher(Patience::new(move |waited| of_queues.hold_up(waited)))?
                }
            };
            let flow = of_ports;
            Ok(TopicPorts { topic, flow })
        };
        StandInTopic {
            worker: Worker::start(domain, robot, name, open),
            flow,
        }
    }

    /// Publishes `sample` and returns its number in the sequence.
    ///
    /// # Panics
    ///
    /// When it cannot be published.
    #[track_caller]
    pub fn publish(&self, sample: &T) -> u64 {
        let sample = *sample;
        self.publish_with(move |slot| *slot = sample)
    }

    /// Publishes what `fill` makes of zeros when there is room, and returns its number in the sequence.
    ///
    /// # Panics
    ///
    /// When it cannot be published.
    #[track_caller]
    pub fn publish_with(&self, fill: impl FnOnce(&mut T) + Send + 'static) -> u64 {
        let order = || self.worker.order(move |ports| ports.publish(fill));
        self.flow
            .give(order)
            .expect("a sample that can be published")
    }

    /// Waits until there was room for everything, if the test reads on another thread.
    ///
    /// # Panics
    ///
    /// When a sample could not be published.
    #[track_caller]
    pub fn settle(&self) {
        assert!(self.flow.settle(), "a sample could not be published");
    }
}

impl<T: Topic> Drop for StandInTopic<T> {
    fn drop(&mut self) {
        self.flow.end();
    }
}

impl<T: Topic> TopicPorts<T> {
    fn publish(&mut self, fill: impl FnOnce(&mut T)) {
        self.topic
            .publish(fill)
            .expect("a sample that can be published");
        self.flow.publish();
    }
}

impl<T: Topic> Ports for TopicPorts<T> {
    fn sources(&mut self) -> Vec<&mut dyn Source> {
        vec![&mut self.topic]
    }

    fn drain(&mut self) -> bool {
        true
    }
}

impl<T: Topic> Drop for TopicPorts<T> {
    fn drop(&mut self) {
        self.flow.gone();
    }
}
