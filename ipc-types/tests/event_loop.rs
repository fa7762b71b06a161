//! Ports in an event loop of the caller's own: one descriptor for as long as the port lives.

use std::os::fd::{AsRawFd, BorrowedFd};
use std::thread;
use std::time::{Duration, Instant};

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{DspTelemetry, ModuleControl, RequestReport};
use ipc_types::{Client, DynamicSubscriber, Publisher, Schema, Topic, fresh_request_id};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::support::{WATCHDOG, in_domain, in_robot, in_service, in_topic, join, until};

/// Sleeps until the descriptor can be read.
fn wait_until_readable(descriptor: BorrowedFd<'_>) {
    let mut polled = [PollFd::from_borrowed_fd(descriptor, PollFlags::IN)];
    let limit = Timespec::try_from(WATCHDOG).unwrap();
    assert_eq!(poll(&mut polled, Some(&limit)), Ok(1), "not readable");
}

fn is_readable(descriptor: BorrowedFd<'_>) -> bool {
    let mut polled = [PollFd::from_borrowed_fd(descriptor, PollFlags::IN)];
    poll(&mut polled, Some(&Timespec::default())).unwrap() == 1
}

/// Without a publisher, with one, in its next generation, and with the next publisher.
#[test]
fn the_descriptor_of_a_subscriber_outlives_publishers_and_generations() {
    in_robot(|ipc| {
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let number = subscriber.descriptor().unwrap().as_raw_fd();
        let mut seen = 0;
        for _ in 0..2 {
            let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
            for generation in 1..=2 {
                publisher.publish(|_| {}).unwrap();
                until("the sample", || {
                    wait_until_readable(subscriber.descriptor().unwrap());
                    publisher.service();
                    seen += subscriber.drain(|_| {}).unwrap();
                    subscriber.losses().received == seen as u64 && seen % 2 == generation % 2
                });
                publisher.wear_out();
            }
        }
        assert_eq!(seen, 4);
        assert_eq!(subscriber.descriptor().unwrap().as_raw_fd(), number);
    });
}

/// It becomes readable for a sample and for the safety bound, and is not readable any more when the port was drained.
#[test]
fn draining_a_subscriber_makes_its_descriptor_unreadable() {
    in_topic(|mut publisher: Publisher<DspTelemetry>, mut subscriber| {
        let mut samples = 0;
        // A machine that stalls for longer than the bound between drain and look sees the bound.
        until("quiet", || {
            publisher.publish(|_| {}).unwrap();
            wait_until_readable(subscriber.descriptor().unwrap());
            samples += subscriber.drain(|_| {}).unwrap();
            !is_readable(subscriber.descriptor().unwrap())
        });
        // Nothing is published: the bound alone.
        wait_until_readable(subscriber.descriptor().unwrap());
        assert!(samples > 0);
    });
}

/// Subscribers that leave a generation notify the publisher's listener there, which stays in the set for a second more.
#[test]
fn a_batch_wakes_for_its_first_sample_for_each_sixteenth_after_it_and_for_the_rest_at_its_end() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        subscriber.drain(|_| {}).unwrap();
        publisher.service();
        for len in [1, 2, 16, 17, 18, 33] {
            let mut expected: Vec<_> = [1, 17, 33].into_iter().filter(|at| *at <= len).collect();
            if !expected.contains(&len) {
                expected.push(len + 1);
            }
            // A machine that stalls for longer than the bound between drain and look sees the bound.
            until("the expected wake-ups", || {
                let mut woken = Vec::new();
                for number in 1..=len + 2 {
                    match number <= len {
                        true => publisher.publish_batched(|_| {}).map(|_| ()).unwrap(),
                        false => publisher.end_batch(),
                    }
                    if is_readable(subscriber.descriptor().unwrap()) {
                        woken.push(number);
                        subscriber.drain(|_| {}).unwrap();
                    }
                }
                woken == expected
            });
        }
        assert_eq!(subscriber.losses().lost, 0);
    });
}

#[test]
fn subscribers_that_leave_a_former_generation_do_not_keep_the_publisher_awake() {
    in_topic(|mut publisher: Publisher<DspTelemetry>, mut subscriber| {
        wait_until_readable(publisher.descriptor().unwrap());
        publisher.service();
        publisher.wear_out();
        publisher.service();
        publisher.publish(|_| {}).unwrap();
        let mut received = 0;
        until("a sample of the next generation", || {
            publisher.service();
            received += subscriber.drain(|_| {}).unwrap();
            received > 0
        });
        assert_eq!(subscriber.generations(), 2);
        let mut wakes = 0;
        let end = Instant::now() + Duration::from_secs(1);
        while Instant::now() < end {
            wait_until_readable(publisher.descriptor().unwrap());
            publisher.service();
            wakes += 1;
        }
        // The safety bound has its part, and each notification.
        assert!(wakes < 20, "{wakes}");
    });
}

/// A process that looks at the time while samples flow leaves its descriptor as it is, and misses nothing when it waits
/// again.
#[test]
fn draining_quietly_takes_the_samples_and_leaves_the_descriptor_readable() {
    in_robot(|ipc| {
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let schema = Schema::of::<DspTelemetry>();
        let mut subscriber = DynamicSubscriber::open(&ipc, DspTelemetry::KEY, &schema).unwrap();
        wait_until_readable(subscriber.descriptor().unwrap());
        for _ in 0..3 {
            publisher.publish(|_| {}).unwrap();
            assert_eq!(subscriber.drain_quietly(|_| {}).unwrap(), 1);
            assert!(is_readable(subscriber.descriptor().unwrap()));
        }
        // The next publisher is followed as well.
        drop(publisher);
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        assert_eq!(subscriber.drain_quietly(|_| {}).unwrap(), 0);
        publisher.publish(|_| {}).unwrap();
        assert_eq!(subscriber.drain_quietly(|_| {}).unwrap(), 1);
        // A machine that stalls for longer than the bound between drain and look sees the bound.
        until("quiet", || {
            subscriber.drain(|_| {}).unwrap();
            !is_readable(subscriber.descriptor().unwrap())
        });
        publisher.publish(|_| {}).unwrap();
        wait_until_readable(subscriber.descriptor().unwrap());
        assert_eq!(subscriber.drain(|_| {}).unwrap(), 1);
        assert_eq!(
            (subscriber.losses().lost, subscriber.losses().received),
            (0, 5)
        );
    });
}

/// An event loop of descriptors alone: the subscriber that joins gets what was published before.
#[test]
fn a_publisher_is_tended_when_its_descriptor_says_so() {
    in_domain(|domain| {
        let mut publisher = join(domain, "provider")
            .publisher::<DspTelemetry>()
            .unwrap();
        publisher.publish(|_| {}).unwrap();
        let number = publisher.descriptor().unwrap().as_raw_fd();
        let domain = domain.clone();
        let consumer = thread::spawn(move || {
            let mut late = join(&domain, "consumer")
                .subscriber::<DspTelemetry>()
                .unwrap();
            late.recv_timeout(WATCHDOG).unwrap().unwrap().sequence
        });
        while !consumer.is_finished() {
            wait_until_readable(publisher.descriptor().unwrap());
            publisher.service();
        }
        assert_eq!(consumer.join().unwrap(), 1);
        assert_eq!(publisher.descriptor().unwrap().as_raw_fd(), number);
    });
}

/// Over three servers, each with two generations: a request and its answer wake by the same two descriptors.
#[test]
fn the_descriptors_of_clients_and_servers_outlive_generations() {
    in_robot(|ipc| {
        let mut client = ipc.client::<ModuleControl>().unwrap();
        let of_client = client.descriptor().unwrap().as_raw_fd();
        for _ in 0..3 {
            let mut server = ipc.server::<ModuleControl>().unwrap();
            let of_server = server.descriptor().unwrap().as_raw_fd();
            for _ in 0..2 {
                let request = ModuleControl::new(fresh_request_id(), ControlCommand::Start);
                client.send(&request).unwrap();
                let mut tickets = Vec::new();
                until("the request", || {
                    wait_until_readable(server.descriptor().unwrap());
                    server.drain(|ticket, _| tickets.push(ticket)).unwrap() > 0
                });
                let done = RequestReport::new(Stage::Done, Reason::None);
                server.report(tickets[0], &done).unwrap();
                until("the report", || {
                    wait_until_readable(client.descriptor().unwrap());
                    client.drain(|report| assert_eq!(report.request_id, request.request_id)) > 0
                });
                server.wear_out();
            }
            assert_eq!(server.generations(), 2);
            assert_eq!(server.descriptor().unwrap().as_raw_fd(), of_server);
        }
        assert_eq!(client.descriptor().unwrap().as_raw_fd(), of_client);
    });
}

#[test]
fn draining_makes_the_descriptors_of_clients_and_servers_unreadable() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        // A machine that stalls for longer than the bound between drain and look sees the bound.
        until("quiet", || {
            wait_until_readable(client.descriptor().unwrap());
            client.drain(|_| {});
            !is_readable(client.descriptor().unwrap())
        });
        until("quiet", || {
            wait_until_readable(server.descriptor().unwrap());
            server.drain(|_, _| {}).unwrap();
            !is_readable(server.descriptor().unwrap())
        });
        wait_until_readable(client.descriptor().unwrap());
        wait_until_readable(server.descriptor().unwrap());
    });
}
