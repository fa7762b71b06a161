//! [`StandInStatus`]: publishes the robot's telemetry.

use ipc_types::payload::HeroTelemetry;
use ipc_types::{Domain, MonotonicNs, RobotId};

use super::own::TopicPorts;
use super::worker::Worker;

/// In the place of status: it publishes the [`HeroTelemetry`] that it is given.
pub struct StandInStatus {
    worker: Worker<TopicPorts<HeroTelemetry>>,
}

impl StandInStatus {
    /// Stands in for robot 1's status in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start(domain: &Domain) -> StandInStatus {
        StandInStatus::start_for(domain, RobotId::DEFAULT)
    }

    /// Stands in for `robot`'s status in `domain`.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_for(domain: &Domain, robot: RobotId) -> StandInStatus {
        StandInStatus {
            worker: Worker::start(domain, robot, "stand-in-status", |_| {}),
        }
    }

    /// Publishes `sample` and returns its number in the sequence. Times of the host that are 0 become the present.
    ///
    /// # Panics
    ///
    /// When it cannot be published.
    #[track_caller]
    pub fn publish(&self, sample: &HeroTelemetry) -> u64 {
        let sample = *sample;
        let published = self.worker.call(move |ports| {
            let now = MonotonicNs::now().0;
            ports.topic.publish(|slot| {
                *slot = sample;
                for time in [&mut slot.received_ns, &mut slot.published_ns] {
                    *time = if *time == 0 { now } else { *time };
                }
            })
        });
        published.expect("a sample that can be published")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::WAIT_LIMIT;
    use crate::script::Script;
    use crate::{TestDomain, Watchdog};

    #[test]
    fn a_consumer_gets_the_script_and_a_late_one_its_end() {
        let domain = TestDomain::new();
        let status = StandInStatus::start(&domain);
        let ipc = domain.join("consumer");
        let mut telemetry = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
        let script = Script::at(37.0, -6.0, 10.0).stand(1.0).hero();
        let mut seen = Vec::new();
        for sample in &script {
            status.publish(sample);
            assert!(telemetry.wait(WAIT_LIMIT).expect("a wait").is_ready());
            telemetry
                .drain(|sample| seen.push(*sample))
                .expect("samples");
        }
        let times = |samples: &[HeroTelemetry]| -> Vec<f64> {
            samples.iter().map(|sample| sample.dsp_time_s).collect()
        };
        assert_eq!(times(&seen), times(&script));
        assert!(seen.iter().all(|sample| sample.received_ns > 0));

        let mut late = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
        assert!(late.wait(WAIT_LIMIT).expect("a wait").is_ready());
        let sample = late.latest().expect("samples").expect("the last one");
        assert_eq!(sample.sequence, script.len() as u64);
    }

    #[test]
    #[should_panic(expected = "could not be started")]
    fn two_of_one_robot_are_refused() {
        let _watchdog = Watchdog::start();
        let domain = Domain::isolated();
        let _first = StandInStatus::start(&domain);
        StandInStatus::start(&domain);
    }
}
