//! [`StandInStatus`]: publishes the robot's telemetry.

use ipc_fixtures::StandInTopic;
use ipc_types::payload::HeroTelemetry;
use ipc_types::{Domain, MonotonicNs, RobotId};

/// What the process of a stand-in is called.
const NAME: &str = "stand-in-status";

/// In the place of status: it publishes the [`HeroTelemetry`] that it is given, and waits for its subscribers as a
/// [`StandInTopic`] does.
pub struct StandInStatus {
    topic: StandInTopic<HeroTelemetry>,
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
            topic: StandInTopic::start_as(domain, robot, NAME, false),
        }
    }

    /// Stands in for `robot`'s status in `domain`, and does not wait for subscribers: as of status itself, one that
    /// reads only after a long script gets its last samples, and [`losses`](ipc_types::Subscriber::losses) counts the
    /// others.
    ///
    /// # Panics
    ///
    /// When that is not possible, with the reason.
    pub fn start_lossy(domain: &Domain, robot: RobotId) -> StandInStatus {
        StandInStatus {
            topic: StandInTopic::start_as(domain, robot, NAME, true),
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
        self.topic.publish_with(move |slot| {
            let now = MonotonicNs::now().0;
            *slot = sample;
            for time in [&mut slot.received_ns, &mut slot.published_ns] {
                *time = if *time == 0 { now } else { *time };
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::WAIT_LIMIT;
    use crate::script::Script;
    use crate::{TestDomain, Watchdog, expect};

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
    fn of_a_script_that_is_longer_than_a_queue_nothing_is_lost() {
        let domain = TestDomain::new();
        let ipc = domain.join("consumer");
        let mut telemetry = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
        let status = StandInStatus::start(&domain);
        let script = Script::at(37.0, -6.0, 10.0).stand(40.0).hero();
        for (sample, number) in script.iter().zip(1..) {
            assert_eq!(status.publish(sample), number);
        }
        let read = expect::samples(&mut telemetry, script.len());
        let times = |samples: &[HeroTelemetry]| -> Vec<f64> {
            samples.iter().map(|sample| sample.dsp_time_s).collect()
        };
        assert_eq!(times(&read), times(&script));
        expect::nothing_lost(&telemetry);
    }

    #[test]
    fn where_nothing_waits_each_sample_of_a_long_script_is_received_or_counted() {
        let domain = TestDomain::new();
        let ipc = domain.join("consumer");
        let mut telemetry = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
        let status = StandInStatus::start_lossy(&domain, RobotId::DEFAULT);
        let script = Script::at(37.0, -6.0, 10.0).stand(20.0).hero();
        let mut late = ipc.subscriber::<HeroTelemetry>().expect("a subscriber");
        for sample in &script {
            status.publish(sample);
        }
        for (subscriber, was_there) in [(&mut telemetry, true), (&mut late, false)] {
            // The first wake-up may be that of the publisher's beginning.
            while subscriber.losses().received == 0 {
                assert!(subscriber.wait(WAIT_LIMIT).expect("a wait").is_ready());
                subscriber.drain(|_| {}).expect("samples");
            }
            let losses = subscriber.losses();
            let missed = if was_there {
                losses.lost
            } else {
                losses.joined_late
            };
            assert!(losses.received > 0 && missed > 0, "{losses:?}");
            assert_eq!(losses.received + missed, script.len() as u64, "{losses:?}");
        }
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
