//! Published services: late joiners, losses, robots side by side, subscribers that do not read.

use std::collections::HashSet;
use std::io::Write;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use ipc_types::payload::{BridgeJournal, DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::service::{HISTORY, MAX_SUBSCRIBERS, SUBSCRIBER_BUFFER};
use ipc_types::waiter::MAX_SOURCES;
use ipc_types::{
    Descriptor, Ipc, Losses, OpenError, Patience, Publisher, RobotId, ServiceId, Source,
    Subscriber, Topic, WaitError, Waiter, Wake,
};

use crate::support::{WATCHDOG, in_domain, in_robot, in_topic, join, until};

/// Lets a subscriber that was there first enter the publisher's generation, in which nothing was published yet.
fn enter<T: Topic>(subscriber: &mut Subscriber<T>) {
    assert_eq!(subscriber.drain(|_| {}).unwrap(), 0);
}

const A_MOMENT: Duration = Duration::from_millis(200);

#[test]
fn a_sample_wakes_the_subscriber_and_arrives_as_it_was_filled_in() {
    in_topic(|mut publisher: Publisher<DspTelemetry>, mut subscriber| {
        let sequence = publisher
            .publish(|sample| {
                sample.rotor_rpm = 1500;
                sample.geographic.latitude_deg = 37.4;
                sample.sequence = 99;
            })
            .unwrap();
        assert_eq!(sequence, 1);
        assert!(subscriber.wait(WATCHDOG).unwrap().is_ready());
        let sample = subscriber.latest().unwrap().unwrap();
        assert_eq!(sample.rotor_rpm, 1500);
        assert_eq!(sample.geographic.latitude_deg, 37.4);
        assert_eq!(
            (sample.sequence, sample.epoch_ns),
            (1, publisher.epoch_ns())
        );
        assert_eq!(subscriber.latest().unwrap(), None);
        assert_eq!(subscriber.wait(Duration::ZERO).unwrap(), Wake::TimedOut);
    });
}

#[test]
fn a_sample_begins_as_zeros_whatever_lay_there_before() {
    in_topic(|mut publisher: Publisher<DspTelemetry>, mut subscriber| {
        // More samples than there are chunks, so that each has been used before.
        for round in 0..2 * SUBSCRIBER_BUFFER * MAX_SUBSCRIBERS {
            let dirty = round % 2 == 0;
            publisher
                .publish(|sample| {
                    sample.sonar_adc = if dirty { u32::MAX } else { sample.sonar_adc }
                })
                .unwrap();
            let sample = subscriber.latest().unwrap().unwrap();
            assert_eq!(sample.sonar_adc, if dirty { u32::MAX } else { 0 });
        }
    });
}

#[test]
fn a_late_joiner_gets_the_latest_at_once() {
    in_robot(|ipc| {
        let mut publisher = ipc.publisher::<ModuleState>().unwrap();
        for status in 1..=3 {
            publisher.publish(|sample| sample.status = status).unwrap();
        }
        let mut late = ipc.subscriber::<ModuleState>().unwrap();
        // The publisher publishes nothing more: it hands the latest on in its wait, which goes on.
        let waiter = Waiter::new();
        let mut latest = None;
        until("the sample", || {
            let ports: &mut [(_, &mut dyn Source)] =
                &mut [("publisher", &mut publisher), ("late", &mut late)];
            let wake = waiter.wait(ports, Some(WATCHDOG)).unwrap();
            assert!(wake.is_only("late"), "{wake:?}");
            latest = late.latest().unwrap();
            latest.is_some()
        });
        let sample = latest.unwrap();
        assert_eq!((sample.status, sample.sequence), (3, 3));
        assert_eq!(late.losses().lost, 0);
        let quiet = waiter.wait(&mut [((), &mut publisher)], Some(A_MOMENT));
        assert_eq!(quiet.unwrap(), Wake::TimedOut);
    });
}

#[test]
fn a_subscriber_may_be_there_first() {
    in_domain(|domain| {
        let ipc = join(domain, "consumer");
        let mut subscriber = ipc.subscriber::<HeroTelemetry>().unwrap();
        assert_eq!(ipc.provider("hero_telemetry").unwrap(), None);
        let (seen, is_seen) = mpsc::channel::<()>();
        let domain = domain.clone();
        let status = thread::spawn(move || {
            let ipc = join(&domain, "status");
            let mut publisher = ipc.publisher::<HeroTelemetry>().unwrap();
            publisher.publish(|sample| sample.dsp_time_s = 1.5).unwrap();
            publisher.publish(|sample| sample.dsp_time_s = 2.5).unwrap();
            // The subscriber enters when it likes; the publisher is woken by that and hands on what was published.
            let waiter = Waiter::new();
            while is_seen.try_recv().is_err() {
                let wake = waiter.wait(&mut [((), &mut publisher)], Some(A_MOMENT));
                assert_eq!(wake.unwrap(), Wake::TimedOut);
            }
        });
        let mut samples = Vec::new();
        until("the sample", || {
            subscriber.wait(A_MOMENT).unwrap();
            subscriber
                .drain(|sample| samples.push(sample.dsp_time_s))
                .unwrap();
            samples.len() >= 2
        });
        seen.send(()).unwrap();
        status.join().unwrap();
        assert_eq!(samples, [1.5, 2.5]);
        assert_eq!(subscriber.losses().lost, 0);
    });
}

/// The first samples wait for nobody, because the first subscriber gets them; one more would push one out.
#[test]
fn a_patient_publisher_that_nobody_hears_waits_when_its_history_is_full() {
    in_robot(|ipc| {
        let asked = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&asked);
        let patience =
            Patience::new(move |_| counted.fetch_add(1, Ordering::Relaxed).is_multiple_of(2));
        let mut publisher = ipc.patient_publisher::<DspTelemetry>(patience).unwrap();
        let history = HISTORY as u64;
        for sample in 1..=history + 2 {
            assert_eq!(publisher.publish(|_| {}).unwrap(), sample);
            let expected = 2 * sample.saturating_sub(history) as usize;
            assert_eq!(asked.load(Ordering::Relaxed), expected);
        }
        assert_eq!((publisher.subscribers(), publisher.joins()), (0, 0));
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        assert_eq!(subscriber.drain(|_| {}).unwrap(), 0);
        publisher.publish(|_| {}).unwrap();
        assert_eq!(asked.load(Ordering::Relaxed), 4, "there is one");
        assert_eq!(
            (publisher.subscribers(), publisher.sequence()),
            (1, history + 3)
        );
        publisher.service();
        assert_eq!(
            (publisher.joins(), subscriber.drain(|_| {}).unwrap()),
            (1, 2)
        );
    });
}

#[test]
fn a_subscriber_that_does_not_read_keeps_the_newest_and_counts_what_it_lost() {
    in_topic(|mut publisher: Publisher<DspTelemetry>, mut subscriber| {
        publisher.publish(|_| {}).unwrap();
        assert_eq!(subscriber.drain(|_| {}).unwrap(), 1);
        const MISSED: usize = 50;
        for _ in 0..SUBSCRIBER_BUFFER + MISSED {
            publisher.publish(|_| {}).unwrap();
        }
        let mut sequences = Vec::new();
        subscriber
            .drain(|sample| sequences.push(sample.sequence))
            .unwrap();
        let newest = publisher.sequence();
        let kept: Vec<_> = (newest + 1 - SUBSCRIBER_BUFFER as u64..=newest).collect();
        assert_eq!(sequences, kept);
        let losses = Losses {
            received: 1 + SUBSCRIBER_BUFFER as u64,
            lost: MISSED as u64,
            ..Losses::default()
        };
        assert_eq!(subscriber.losses(), losses);
    });
}

#[test]
fn two_robots_in_one_domain_do_not_hear_one_another() {
    in_domain(|domain| {
        let robots = [1, 101].map(|id| RobotId::new(id).unwrap());
        // Robots 1 and 101 share their slot numbers: the name must keep them apart.
        let slots = robots.map(|robot| ServiceId::DspTelemetry.slot(robot));
        assert_eq!(slots[0], slots[1]);
        let mut there = Vec::new();
        let mut ports = robots.map(|robot| {
            let ipc = Ipc::join(domain, robot, "test").unwrap();
            let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
            let publisher = ipc.publisher::<DspTelemetry>().unwrap();
            enter(&mut subscriber);
            there.push(domain.residue().into_iter().collect::<HashSet<PathBuf>>());
            (subscriber, publisher, ipc)
        });
        // The second has as much as the first, and all but the root is its own: a folder, and segments.
        let added: Vec<_> = there[1].difference(&there[0]).collect();
        let [root, own] = [domain.root().to_owned(), domain.root().join("101")];
        assert!(there[0].is_subset(&there[1]) && there[0].contains(&root));
        assert_eq!(added.len(), there[0].len() - 1, "{there:#?}");
        for path in added {
            let is_own = path.starts_with(&own) || !path.starts_with(&root);
            assert!(is_own, "{path:?}");
        }
        for (robot, (_, publisher, _)) in robots.iter().zip(&mut ports) {
            publisher
                .publish(|sample| sample.rotor_rpm = robot.get())
                .unwrap();
        }
        for (robot, (subscriber, ..)) in robots.iter().zip(&mut ports) {
            let mut heard = Vec::new();
            subscriber
                .drain(|sample| heard.push(sample.rotor_rpm))
                .unwrap();
            assert_eq!(heard, [robot.get()]);
        }
    });
}

#[test]
fn a_robot_has_one_publisher_and_a_second_learns_who_it_is() {
    in_domain(|domain| {
        let first = join(domain, "bridge");
        let publisher = first.publisher::<DspTelemetry>().unwrap();
        let second = join(domain, "impostor");
        let Err(error) = second.publisher::<DspTelemetry>() else {
            panic!("two publishers");
        };
        assert!(matches!(error, OpenError::AlreadyProvided { .. }));
        let text = error.to_string();
        let process = format!("`bridge` (process {})", std::process::id());
        assert!(
            text.contains("hero/1/dsp_telemetry") && text.contains(&process),
            "{text}"
        );
        let provider = second.provider("dsp_telemetry").unwrap().unwrap();
        assert_eq!(
            (provider.pid, provider.process.as_str()),
            (std::process::id(), "bridge")
        );
        drop(publisher);
        assert_eq!(second.provider("dsp_telemetry").unwrap(), None);
        assert!(second.publisher::<DspTelemetry>().is_ok());
    });
}

#[test]
fn a_new_publisher_is_counted_as_one() {
    in_robot(|ipc| {
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let mut sequences = Vec::new();
        for _ in 0..3 {
            let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
            // Its coming wakes the subscriber, which then has it; what it says until it goes is not lost.
            assert_eq!(subscriber.drain(|_| {}).unwrap(), 0);
            publisher.publish(|_| {}).unwrap();
            publisher.publish(|_| {}).unwrap();
            drop(publisher);
            subscriber
                .drain(|sample| sequences.push(sample.sequence))
                .unwrap();
        }
        assert_eq!(sequences, [1, 2, 1, 2, 1, 2]);
        let losses = Losses {
            received: 6,
            publisher_restarts: 2,
            ..Losses::default()
        };
        assert_eq!(subscriber.losses(), losses);
        assert_eq!(subscriber.generations(), 3);
    });
}

#[test]
fn one_subscriber_too_many_is_refused_with_the_number() {
    in_robot(|ipc| {
        let _publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let subscribers: Vec<_> = (0..MAX_SUBSCRIBERS)
            .map(|_| ipc.subscriber::<DspTelemetry>().unwrap())
            .collect();
        let Err(error) = ipc.subscriber::<DspTelemetry>() else {
            panic!("more than {MAX_SUBSCRIBERS} subscribers");
        };
        assert!(
            matches!(
                error,
                OpenError::Full {
                    max: MAX_SUBSCRIBERS,
                    ..
                }
            ),
            "{error}"
        );
        let own = format!("`test` (process {}, 32 times)", std::process::id());
        assert!(error.to_string().ends_with(&own), "{error}");
        drop(subscribers);
        assert!(ipc.subscriber::<DspTelemetry>().is_ok());
    });
}

#[test]
fn one_subscriber_too_many_is_refused_also_while_samples_come() {
    in_robot(|ipc| {
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let _subscribers: Vec<_> = (0..MAX_SUBSCRIBERS)
            .map(|_| ipc.subscriber::<DspTelemetry>().unwrap())
            .collect();
        let (end, ended) = mpsc::channel::<()>();
        thread::scope(|scope| {
            scope.spawn(move || {
                // Each sample wakes whoever waits for a place.
                let period = Duration::from_millis(5);
                while ended.recv_timeout(period) == Err(mpsc::RecvTimeoutError::Timeout) {
                    publisher.publish(|_| {}).unwrap();
                }
            });
            let refused = ipc.subscriber::<DspTelemetry>().err();
            drop(end);
            assert!(
                matches!(refused, Some(OpenError::Full { .. })),
                "{refused:?}"
            );
        });
    });
}

#[test]
fn many_living_subscribers_do_not_wear_a_generation_out() {
    in_robot(|ipc| {
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut journal = ipc.publisher::<BridgeJournal>().unwrap();
        let _subscribers: Vec<_> = (0..24)
            .map(|_| ipc.subscriber::<DspTelemetry>().unwrap())
            .collect();
        let mut few: Vec<_> = (0..2)
            .map(|_| ipc.subscriber::<BridgeJournal>().unwrap())
            .collect();
        let waiter = Waiter::new();
        for _ in 0..2 {
            few.push(ipc.subscriber::<BridgeJournal>().unwrap());
            // Longer than from one look at the members to the next.
            let ports: &mut [(_, &mut dyn Source)] =
                &mut [((), &mut publisher), ((), &mut journal)];
            let wake = waiter
                .wait(ports, Some(Duration::from_millis(1500)))
                .unwrap();
            assert_eq!(wake, Wake::TimedOut);
            assert_eq!((publisher.generations(), journal.generations()), (1, 1));
        }
    });
}

/// The two ways to sleep for samples.
enum Way {
    Own,
    Waiter(Waiter),
}

/// A consumer that always sleeps gets every sample of a publisher that waits for nobody but its own pace.
fn no_sample_is_slept_through(way: fn(&Ipc) -> Way) {
    const SAMPLES: u64 = 20_000;
    in_domain(move |domain| {
        let ipc = join(domain, "consumer");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let mut confirmations = ipc.publisher::<HeroTelemetry>().unwrap();
        let producer = {
            let domain = domain.clone();
            thread::spawn(move || {
                let ipc = join(&domain, "producer");
                let mut confirmed = ipc.subscriber::<HeroTelemetry>().unwrap();
                let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
                let waiter = Waiter::new();
                let mut last = 0;
                for _ in 0..SAMPLES {
                    let sequence = publisher.publish(|_| {}).unwrap();
                    // At most a quarter of the buffer is on its way: what is missing was slept through, not dropped.
                    while sequence - last > SUBSCRIBER_BUFFER as u64 / 4 {
                        let ports: &mut [(_, &mut dyn Source)] =
                            &mut [((), &mut confirmed), ((), &mut publisher)];
                        waiter.wait(ports, Some(WATCHDOG)).unwrap();
                        confirmed
                            .drain(|sample| last = sample.source_sequence)
                            .unwrap();
                    }
                }
            })
        };
        let way = way(&ipc);
        let mut last = 0;
        while last < SAMPLES {
            let wake = match &way {
                Way::Own => subscriber.wait(WATCHDOG).unwrap(),
                Way::Waiter(waiter) => waiter
                    .wait(&mut [((), &mut subscriber)], Some(WATCHDOG))
                    .unwrap(),
            };
            assert_ne!(wake, Wake::TimedOut, "slept through after {last}");
            subscriber.drain(|sample| last = sample.sequence).unwrap();
            confirmations
                .publish(|sample| sample.source_sequence = last)
                .unwrap();
        }
        producer.join().unwrap();
        assert_eq!(subscriber.losses().lost, 0);
        assert_eq!(subscriber.losses().received, SAMPLES);
    });
}

#[test]
fn no_sample_is_slept_through_with_the_subscriber_s_own_wait() {
    no_sample_is_slept_through(|_| Way::Own);
}

#[test]
fn no_sample_is_slept_through_with_a_waiter() {
    no_sample_is_slept_through(|_| Way::Waiter(Waiter::new()));
}

#[test]
fn a_waiter_says_which_descriptor_is_ready_and_lets_it_go() {
    in_robot(|ipc| {
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let waiter = Waiter::new();
        let (reader, mut writer) = std::io::pipe().unwrap();
        {
            let mut descriptor = Descriptor::new(reader.as_fd());
            let sources: &mut [(_, &mut dyn Source)] =
                &mut [("port", &mut subscriber), ("pipe", &mut descriptor)];
            let wake = waiter.wait(sources, Some(A_MOMENT)).unwrap();
            assert_eq!(wake, Wake::TimedOut);
            writer.write_all(b"x").unwrap();
            let wake = waiter.wait(sources, Some(WATCHDOG)).unwrap();
            assert!(wake.has("pipe") && wake.is_only("pipe") && !wake.has("port"));
            drop(writer);
            // Hung up: ready for ever, until it is not waited for any more.
            assert!(waiter.wait(sources, Some(WATCHDOG)).unwrap().has("pipe"));
        }
        drop(reader);
        let wake = waiter.wait(&mut [((), &mut subscriber)], Some(A_MOMENT));
        assert_eq!(wake.unwrap(), Wake::TimedOut);
    });
}

#[test]
fn a_waiter_refuses_what_it_cannot_wait_for() {
    in_robot(|ipc| {
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let (pipe, _writer) = std::io::pipe().unwrap();
        let waiter = Waiter::new();
        let wait =
            |sources: &mut [((), &mut dyn Source)]| waiter.wait(sources, Some(Duration::ZERO));

        let for_ever = waiter.wait::<()>(&mut [], None);
        assert!(matches!(for_ever, Err(WaitError::NoSources)));
        assert_eq!(wait(&mut []).unwrap(), Wake::TimedOut);
        let mut many = [Descriptor::new(pipe.as_fd()); MAX_SOURCES + 1];
        let mut many: Vec<_> = many
            .iter_mut()
            .map(|one| ((), one as &mut dyn Source))
            .collect();
        assert!(matches!(wait(&mut many), Err(WaitError::TooManySources(_))));
        assert_eq!(wait(&mut [((), &mut subscriber)]).unwrap(), Wake::TimedOut);
    });
}

/// A subscriber that follows its publisher through generations loses no sample, and gets none twice.
#[test]
fn a_new_generation_costs_no_sample() {
    in_robot(|ipc| {
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let mut expected = 0;
        while publisher.generations() < 3 {
            publisher.wear_out();
            publisher.publish(|_| {}).unwrap();
            publisher.service();
            expected += 1;
            subscriber
                .drain(|sample| assert!(sample.sequence <= expected))
                .unwrap();
        }
        assert_eq!(subscriber.losses().received, expected);
        assert_eq!(subscriber.losses().lost, 0);
        // A subscriber that comes now finds the latest sample, though nothing was published since.
        let mut late = ipc.subscriber::<DspTelemetry>().unwrap();
        publisher.service();
        assert_eq!(late.latest().unwrap().unwrap().sequence, expected);
    });
}

/// Ports can be handed to other threads.
#[test]
fn ports_can_change_their_thread() {
    fn is_send<T: Send>() {}
    is_send::<Ipc>();
    is_send::<Publisher<DspTelemetry>>();
    is_send::<Subscriber<DspTelemetry>>();
    is_send::<ipc_types::Server<ipc_types::payload::MovementData>>();
    is_send::<ipc_types::Client<ipc_types::payload::MovementData>>();
    is_send::<ipc_types::DynamicSubscriber>();
    in_domain(|domain| {
        let mut publisher = join(domain, "test").publisher::<DspTelemetry>().unwrap();
        let mut subscriber = join(domain, "test").subscriber::<DspTelemetry>().unwrap();
        let sender = thread::spawn(move || publisher.publish(|_| {}).map(|_| publisher));
        let publisher = sender.join().unwrap().unwrap();
        let receiver = thread::spawn(move || subscriber.recv_timeout(WATCHDOG).unwrap());
        assert_eq!(receiver.join().unwrap().unwrap().sequence, 1);
        drop(publisher);
    });
}

/// One at a time, in order, over a change of generation: none is lost, and none comes twice.
#[test]
fn samples_are_received_one_by_one() {
    in_topic(|mut publisher: Publisher<DspTelemetry>, mut subscriber| {
        for _ in 0..3 {
            publisher.publish(|_| {}).unwrap();
        }
        publisher.wear_out();
        publisher.service();
        for _ in 0..3 {
            publisher.publish(|_| {}).unwrap();
        }
        let mut seen = Vec::new();
        while let Some(sample) = subscriber.try_recv().unwrap() {
            seen.push(sample.sequence);
            publisher.service();
        }
        assert_eq!(seen, [1, 2, 3, 4, 5, 6]);
        assert_eq!((subscriber.losses().lost, subscriber.generations()), (0, 2));
        assert_eq!(subscriber.recv_timeout(Duration::ZERO).unwrap(), None);
        publisher.publish(|_| {}).unwrap();
        let next = subscriber.iter().next().unwrap().unwrap();
        assert_eq!(next.sequence, 7);
    });
}

/// No copy: what is held stays, though every chunk of the publisher is used again meanwhile.
#[test]
fn a_sample_that_is_held_stays_as_it_was() {
    in_topic(|mut publisher: Publisher<DspTelemetry>, mut subscriber| {
        assert!(subscriber.try_borrow().unwrap().is_none());
        publisher.publish(|sample| sample.rotor_rpm = 7).unwrap();
        let held = subscriber.try_borrow().unwrap().unwrap();
        for _ in 0..2 * SUBSCRIBER_BUFFER * MAX_SUBSCRIBERS {
            publisher.publish(|sample| sample.rotor_rpm = 8).unwrap();
        }
        publisher.wear_out();
        publisher.service();
        assert_eq!((held.sequence, held.rotor_rpm), (1, 7));
        drop(held);
        let next = subscriber.try_borrow().unwrap().unwrap();
        assert_eq!(next.rotor_rpm, 8);
    });
}
