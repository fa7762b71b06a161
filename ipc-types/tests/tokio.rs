//! Ports in the event loop of tokio.

mod support;

use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleControl, RequestReport};
use ipc_types::{Async, Client, Server, WaitError};
use tokio::time::timeout;

use support::{WATCHDOG, in_domain, join};

/// The runtime of a program with one thread.
fn block_on<T>(future: impl Future<Output = T>) -> T {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async { timeout(WATCHDOG, future).await.expect("in time") })
}

/// Status in ten lines: each sample is sent on, over generations of both publishers, beside a task that does the same
/// work.
#[test]
fn samples_are_sent_on_from_task_to_task() {
    const SAMPLES: u64 = 200;
    in_domain(|domain| {
        let [bridge, status, consumer] =
            ["bridge", "status", "consumer"].map(|name| join(domain, name));
        block_on(async {
            let mut dsp = Async::new(bridge.publisher::<DspTelemetry>().unwrap()).unwrap();
            let mut input = Async::new(status.subscriber::<DspTelemetry>().unwrap()).unwrap();
            let mut output = status.publisher::<HeroTelemetry>().unwrap();
            let mut hero = Async::new(consumer.subscriber::<HeroTelemetry>().unwrap()).unwrap();
            let bridge = async {
                for sequence in 1..=SAMPLES {
                    let port = dsp.get_mut();
                    port.publish(|sample| sample.dsp_time_ms = sequence as u32)
                        .unwrap();
                    if sequence % 50 == 0 {
                        port.wear_out();
                        port.service();
                    }
                    tokio::time::sleep(Duration::from_millis(1)).await;
                }
                // Subscribers that come late are served as well.
                dsp.until(|_| None::<()>).await.unwrap();
            };
            let status = async {
                loop {
                    let sample = input.recv().await.unwrap();
                    let publish = |hero: &mut HeroTelemetry| hero.source_sequence = sample.sequence;
                    output.publish(publish).unwrap();
                    if sample.sequence % 70 == 0 {
                        output.wear_out();
                    }
                    output.service();
                }
            };
            let consumer = async {
                let mut seen = Vec::new();
                while seen.last() != Some(&SAMPLES) {
                    seen.push(hero.recv().await.unwrap().source_sequence);
                }
                assert!(seen.is_sorted());
                assert_eq!((hero.get().losses().lost, input_is_whole(&seen)), (0, true));
            };
            tokio::select! {
                () = bridge => unreachable!("it tends its subscribers for ever"),
                () = status => unreachable!("it has no end"),
                () = consumer => {}
            }
        });
    });
}

/// Whether nothing is missing behind the first.
fn input_is_whole(seen: &[u64]) -> bool {
    seen.windows(2).all(|pair| pair[1] == pair[0] + 1)
}

/// What a task that was dropped in the middle of its wait had not taken is there for the next.
#[test]
fn a_wait_that_is_cancelled_loses_nothing() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        block_on(async {
            let mut subscriber = Async::new(ipc.subscriber::<DspTelemetry>().unwrap()).unwrap();
            for sequence in 1..=20 {
                let nothing = timeout(Duration::from_micros(300), subscriber.recv()).await;
                assert!(nothing.is_err());
                publisher.publish(|_| {}).unwrap();
                assert_eq!(subscriber.recv().await.unwrap().sequence, sequence);
            }
        });
    });
}

#[test]
fn requests_are_served_and_followed_in_tasks() {
    const REQUESTS: usize = 20;
    in_domain(|domain| {
        let ipc = join(domain, "test");
        block_on(async {
            let mut server = Async::new(ipc.server::<ModuleControl>().unwrap()).unwrap();
            let mut client = Async::new(ipc.client::<ModuleControl>().unwrap()).unwrap();
            let serving = async {
                for served in 0..REQUESTS {
                    let take = |server: &mut Server<ModuleControl>| {
                        let mut taken = None;
                        server.drain(|ticket, _| taken = Some(ticket)).unwrap();
                        taken
                    };
                    let ticket = server.until(take).await.unwrap();
                    let done = RequestReport::new(Stage::Done, Reason::None);
                    server.get_mut().report(ticket, &done).unwrap();
                    if served % 8 == 0 {
                        server.get().wear_out();
                    }
                }
            };
            let following = async {
                for id in 1..=REQUESTS as u64 {
                    let request = ModuleControl::new(id, ControlCommand::Start);
                    client.get_mut().send(&request).unwrap();
                    let take = |client: &mut Client<ModuleControl>| {
                        let mut last = None;
                        client.drain(|report| last = Some(report.request_id));
                        last
                    };
                    assert_eq!(client.until(take).await.unwrap(), id);
                }
            };
            tokio::join!(serving, following);
        });
    });
}

#[test]
#[should_panic(expected = "reactor")]
fn outside_of_a_runtime_there_is_no_event_loop() {
    in_domain(|domain| {
        let subscriber = join(domain, "test").subscriber::<DspTelemetry>().unwrap();
        let _: Result<_, WaitError> = Async::new(subscriber);
    });
}
