//! Published services: late joiners, losses, robots side by side, stopped subscribers.

mod support;

use std::time::Duration;

use ipc_types::payload::{DspTelemetry, ModuleState};
use ipc_types::{Source, Wake};

use support::{in_domain, join};

const A_MOMENT: Duration = Duration::from_millis(200);
const LONG: Duration = Duration::from_secs(20);

#[test]
fn a_sample_wakes_the_subscriber_and_arrives_as_it_was_filled_in() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let sequence = publisher
            .publish(|sample| {
                sample.rotor_rpm = 1500;
                sample.geographic.latitude_deg = 37.4;
            })
            .unwrap();
        assert_eq!(sequence, 1);
        assert!(subscriber.wait(LONG).unwrap().is_ready(0));
        let sample = subscriber.latest().unwrap().unwrap();
        assert_eq!(
            (sample.rotor_rpm, sample.geographic.latitude_deg),
            (1500, 37.4)
        );
        assert_eq!(
            (sample.sequence, sample.epoch_ns),
            (1, publisher.epoch_ns())
        );
        assert_eq!(subscriber.latest().unwrap(), None);
        assert_eq!(subscriber.wait(Duration::ZERO).unwrap(), Wake::TimedOut);
    });
}

#[test]
fn a_late_joiner_gets_the_latest_at_once() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<ModuleState>().unwrap();
        for status in 1..=3 {
            publisher.publish(|sample| sample.status = status).unwrap();
        }
        let mut late = ipc.subscriber::<ModuleState>().unwrap();
        // The publisher publishes nothing more: it is woken by the arrival, and hands the latest on.
        let waiter = ipc.waiter().unwrap();
        let sources: [&dyn Source; 1] = [&publisher];
        assert!(waiter.wait(&sources, Some(LONG)).unwrap().is_ready(0));
        publisher.welcome();
        assert!(late.wait(LONG).unwrap().is_ready(0));
        let sample = late.latest().unwrap().unwrap();
        assert_eq!((sample.status, sample.sequence), (3, 3));
        assert_eq!(late.losses().lost, 0);
        let quiet = waiter.wait(&[&publisher as &dyn Source], Some(A_MOMENT));
        assert_eq!(quiet.unwrap(), Wake::TimedOut);
    });
}
