//! Processes that are killed, stopped and interrupted: what the others notice, and that nothing is left.
//!
//! The program starts itself again in the roles below; the roles talk by lines on their standard streams.

mod support;

use std::collections::HashSet;
use std::fs;
use std::io::BufRead;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{DspTelemetry, ModuleControl, ModuleState, RequestReport};
use ipc_types::{
    Domain, Ipc, JoinError, MonotonicNs, Publisher, Removal, ReportError, RobotId, Server, Ticket,
    Waiter, Wake, files, fresh_request_id,
};
use rustix::fs::{CWD, Mode, OFlags, mkfifoat, open};
use rustix::process::{
    Pid, Resource, Rlimit, Signal, WaitOptions, kill_process, set_parent_process_death_signal,
    setrlimit, waitpid,
};

use support::{Role, WATCHDOG, in_domain, join, open_descriptors, until};

// The longest come first, so that none of them is left alone at the end.
const TESTS: &[(&str, fn())] = support::tests![
    clients_that_are_killed_in_groups_leave_nothing_at_the_server,
    clients_that_leave_with_requests_in_every_state_leave_nothing_at_the_server,
    consumers_that_die_faster_than_their_places_are_given_back_keep_none_from_starting,
    a_removal_that_hangs_holds_up_neither_ports_nor_the_end,
    a_killed_publisher_is_noticed_at_once_and_its_successor_is_heard,
    a_killed_server_ends_every_request_without_a_clean_up,
    the_kernel_tells_of_each_death,
    a_killed_client_is_seen_as_vanished,
    a_stopped_subscriber_holds_up_no_other,
    a_signal_ends_a_wait,
    kills_during_start_up_do_not_keep_the_next_from_starting,
    a_generation_that_has_vanished_is_no_publisher_and_no_error,
    consumers_that_are_killed_while_they_start_cost_their_neighbours_nothing,
    a_generation_that_wears_out_costs_no_request,
    a_provider_that_crashes_in_a_loop_leaves_few_generations,
    what_a_provider_that_was_killed_had_half_announced_is_gone_with_the_next,
    a_root_outside_of_shared_memory_leaves_nothing_there_after_kills,
    a_process_that_is_held_up_while_it_leaves_or_joins_takes_no_folder_of_the_living,
    a_client_that_breaks_the_server_s_port_costs_the_others_no_more_than_to_ask_again,
    an_order_is_answered_though_subscribers_took_all_descriptors,
    a_forked_child_takes_nothing_from_its_parent_and_is_refused,
    a_child_that_is_forked_while_other_threads_open_ports_is_refused_at_once,
    a_provider_that_ends_makes_room_though_a_child_of_it_lives_on,
    what_the_dead_left_is_removed_by_the_next_process,
    ; as_root:
    another_folder_under_the_same_root_in_another_mount_namespace_harms_nobody,
];

fn main() -> ExitCode {
    support::run(TESTS, play)
}

/// The part of a child process. Each says when it is where the test wants it, and then goes on until it is killed.
fn play(role: &str) {
    let domain = Domain::from_environment().expect("the test's domain");
    let ipc = Ipc::join(&domain, RobotId::DEFAULT, role).expect("join");
    match role {
        "publisher" => {
            let mut publisher = ipc.publisher::<DspTelemetry>().expect("publisher");
            for _ in 0..3 {
                publisher.publish(|_| {}).expect("publish");
            }
            println!("published");
            // Those that come later get what was published before.
            let waiter = Waiter::new();
            loop {
                waiter
                    .wait(&mut [((), &mut publisher)], None)
                    .expect("wait");
            }
        }
        "subscriber" => {
            let mut subscriber = ipc.subscriber::<DspTelemetry>().expect("subscriber");
            println!("subscribed");
            loop {
                subscriber.wait(WATCHDOG).expect("wait");
                subscriber.drain(|_| {}).expect("drain");
            }
        }
        "server" => {
            let mut server = ipc.server::<ModuleControl>().expect("server");
            println!("serving");
            loop {
                server.wait(WATCHDOG).expect("wait");
                let mut tickets = Vec::new();
                server
                    .drain(|ticket, _| tickets.push(ticket))
                    .expect("drain");
                for ticket in tickets {
                    let accepted = RequestReport::new(Stage::Accepted, Reason::None);
                    server.report(ticket, &accepted).expect("report");
                }
            }
        }
        "client" => {
            let mut client = ipc.client::<ModuleControl>().expect("client");
            client.send(&start()).expect("send");
            println!("sent");
            loop {
                client.wait(WATCHDOG).expect("wait");
                client.drain(|_| {});
            }
        }
        "sleeper" => {
            let is_signalled = Arc::new(AtomicBool::new(false));
            signal_hook::flag::register(Signal::USR1.as_raw(), is_signalled).expect("a handler");
            let mut subscriber = ipc.subscriber::<DspTelemetry>().expect("subscriber");
            let waiter = Waiter::new();
            println!("asleep");
            let wake = waiter
                .wait(&mut [((), &mut subscriber)], None)
                .expect("wait");
            println!("{wake:?}");
        }
        "passer_by" => drop(ipc),
        "limited" => {
            let mut publisher = ipc.publisher::<DspTelemetry>().expect("publisher");
            let mut server = ipc.server::<ModuleControl>().expect("server");
            server.drain(|_, _| ()).expect("drain");
            let limit = Some(open_descriptors() as u64 + 14);
            let limits = Rlimit {
                current: limit,
                maximum: limit,
            };
            setrlimit(Resource::Nofile, limits).expect("a lower limit");
            let third = ipc.publisher::<ModuleState>().err();
            println!("{}", third.map(text).unwrap_or_default());
            let waiter = Waiter::new();
            loop {
                let ports: &mut [(_, &mut dyn ipc_types::Source)] =
                    &mut [((), &mut publisher), ((), &mut server)];
                waiter.wait(ports, None).expect("wait");
                let mut tickets = Vec::new();
                server
                    .drain(|ticket, _| tickets.push(ticket))
                    .expect("drain");
                server.vanished(|_, _| ());
                for ticket in tickets {
                    let done = RequestReport::new(Stage::Done, Reason::None);
                    server.report(ticket, &done).expect("report");
                }
            }
        }
        "sturdy_server" => {
            let mut server = ipc.server::<ModuleControl>().expect("server");
            println!("serving");
            let mut generations = server.generations();
            loop {
                server.wait(WATCHDOG).expect("wait");
                let mut tickets = Vec::new();
                // Either may be the one that meets the broken port.
                let drained = server.drain(|ticket, _| tickets.push(ticket));
                server.vanished(|_, _| println!("gone"));
                if server.generations() != generations {
                    generations = server.generations();
                    println!("generation {generations}");
                } else {
                    drained.expect("drain");
                }
                for ticket in tickets {
                    let accepted = RequestReport::new(Stage::Accepted, Reason::None);
                    server.report(ticket, &accepted).expect("report");
                }
            }
        }
        "parent" => play_parent(&domain, ipc),
        "survived" => play_survived(ipc),
        other => panic!("no role {other}"),
    }
}

/// Has one port of each kind when it forks. The child tries everything with them, drops them and ends as a program that
/// returns from `main`; the parent goes on.
fn play_parent(domain: &Domain, ipc: Ipc) {
    let mut publisher = ipc.publisher::<DspTelemetry>().expect("publisher");
    let mut subscriber = ipc.subscriber::<DspTelemetry>().expect("subscriber");
    let mut server = ipc.server::<ModuleControl>().expect("server");
    let mut client = ipc.client::<ModuleControl>().expect("client");
    client.send(&start()).expect("send");
    publisher.publish(|_| {}).expect("publish");
    let borrowed = subscriber.try_borrow().expect("receive").expect("a sample");
    // SAFETY: the child uses nothing of the other threads.
    #[allow(unsafe_code)]
    let child = unsafe { libc::fork() };
    if child == 0 {
        drop(borrowed);
        let errors = [
            Ipc::join(domain, RobotId::DEFAULT, "child").err().map(text),
            ipc.publisher::<ModuleState>().err().map(text),
            ipc.subscriber::<DspTelemetry>().err().map(text),
            publisher.publish(|_| {}).err().map(text),
            subscriber.drain(|_| {}).err().map(text),
            subscriber.wait(WATCHDOG).err().map(text),
            server.drain(|_, _| {}).err().map(text),
            server.wait(WATCHDOG).err().map(text),
            client.send(&start()).err().map(text),
            client.wait(WATCHDOG).err().map(text),
            Waiter::new()
                .wait(&mut [((), &mut client)], None)
                .err()
                .map(text),
        ];
        let is_said = |error: &Option<String>| error.as_ref().is_some_and(|it| it.contains("fork"));
        println!("{}", errors.iter().filter(|error| is_said(error)).count());
        publisher.service();
        server.vanished(|_, _| println!("vanished"));
        client.give_up();
        drop((publisher, subscriber, server, client, ipc));
        std::process::exit(0);
    }
    drop(borrowed);
    let child = Pid::from_raw(child).expect("a child");
    let (_, status) = waitpid(Some(child), WaitOptions::empty())
        .expect("wait")
        .expect("it has ended");
    println!("child {:?}", status.exit_status());
    publisher.publish(|_| {}).expect("publish");
    let heard = subscriber.drain(|_| {}).expect("drain");
    let mut served = 0;
    server.drain(|_, _| served += 1).expect("drain");
    println!("heard {heard}, served {served}");
    let waiter = Waiter::new();
    loop {
        waiter
            .wait(&mut [((), &mut publisher)], None)
            .expect("wait");
    }
}

/// Forks a child that lives on and has a copy of every descriptor, then ends all its ports.
fn play_survived(ipc: Ipc) {
    let publisher = ipc.publisher::<DspTelemetry>().expect("publisher");
    let server = ipc.server::<ModuleControl>().expect("server");
    // SAFETY: the child only sleeps.
    #[allow(unsafe_code)]
    let child = unsafe { libc::fork() };
    if child == 0 {
        set_parent_process_death_signal(Some(Signal::KILL)).expect("it ends with its parent");
        loop {
            thread::sleep(WATCHDOG);
        }
    }
    drop((publisher, server, ipc));
    println!("ended");
    loop {
        thread::sleep(WATCHDOG);
    }
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn start() -> ModuleControl {
    ModuleControl::new(fresh_request_id(), ControlCommand::Start)
}

fn a_killed_publisher_is_noticed_at_once_and_its_successor_is_heard() {
    in_domain(|domain| {
        let ipc = join(domain, "consumer");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let mut heard = Vec::new();
        let mut epochs = Vec::new();
        for round in 1..=3 {
            let mut publisher = Role::ready(domain, "publisher", "published");
            let provider = ipc.provider("dsp_telemetry").unwrap().unwrap();
            assert_eq!(provider.pid, publisher.child.id());
            until("three samples", || {
                subscriber.wait(WATCHDOG).unwrap();
                subscriber
                    .drain(|sample| {
                        heard.push(sample.sequence);
                        epochs.push(sample.epoch_ns);
                    })
                    .unwrap();
                heard.len() >= 3 * round
            });
            publisher.kill();
            assert_eq!(ipc.provider("dsp_telemetry").unwrap(), None);
        }
        assert_eq!(heard, [1, 2, 3, 1, 2, 3, 1, 2, 3]);
        epochs.dedup();
        assert_eq!(epochs.len(), 3);
        let losses = subscriber.losses();
        assert_eq!((losses.lost, losses.publisher_restarts), (0, 2));
    });
}

fn a_killed_server_ends_every_request_without_a_clean_up() {
    in_domain(|domain| {
        let ipc = join(domain, "operator");
        let mut client = ipc.client::<ModuleControl>().unwrap();
        let mut server = Role::ready(domain, "server", "serving");
        let request = start();
        client.send(&request).unwrap();
        let mut told = Vec::new();
        until("accepted", || {
            client.wait(WATCHDOG).unwrap();
            client.drain(|report| told.push((report.request_id, report.stage(), report.reason())));
            !told.is_empty()
        });
        server.kill();
        until("gone", || {
            client.wait(WATCHDOG).unwrap();
            client.drain(|report| told.push((report.request_id, report.stage(), report.reason())));
            client.outstanding() == 0
        });
        let expected = [
            (Some(Stage::Accepted), Some(Reason::None)),
            (Some(Stage::Unknown), Some(Reason::BridgeGone)),
        ];
        assert_eq!(
            told,
            expected.map(|(stage, reason)| (request.request_id, stage, reason))
        );

        // The next server is another one: it takes new requests.
        let _server = Role::ready(domain, "server", "serving");
        client.send(&start()).unwrap();
        until("accepted by the next server", || {
            client.wait(WATCHDOG).unwrap();
            client.drain(|report| assert_eq!(report.stage(), Some(Stage::Accepted))) > 0
        });
    });
}

/// One look comes by itself a second after the start, the next one a minute later.
fn the_kernel_tells_of_each_death() {
    const LIMIT: Duration = Duration::from_secs(30);
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let begun = MonotonicNs::now();
        for _ in 0..3 {
            let mut subscriber = Role::ready(domain, "subscriber", "subscribed");
            assert_eq!(publisher.subscribers(), 1);
            subscriber.kill();
            until("its place is given back", || {
                publisher.service();
                // No event says that a place is free.
                thread::sleep(Duration::from_millis(5));
                publisher.subscribers() == 0
            });
        }
        assert!(MonotonicNs::now().since(begun) < LIMIT);
    });
}

fn a_killed_client_is_seen_as_vanished() {
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut client = Role::ready(domain, "client", "sent");
        let mut requests = Vec::new();
        until("the request", || {
            server.wait(WATCHDOG).unwrap();
            server
                .drain(|_, request| requests.push(request.request_id))
                .unwrap();
            !requests.is_empty()
        });
        server.vanished(|_, _| panic!("vanished while alive"));
        client.kill();
        let mut gone = Vec::new();
        until("the client's death", || {
            server.wait(WATCHDOG).unwrap();
            server.vanished(|_, request_id| gone.push(request_id));
            !gone.is_empty()
        });
        assert_eq!(gone, requests);
        assert_eq!(server.open_tickets(), 0);
    });
}

/// The requests that are there.
fn take(server: &mut Server<ModuleControl>) -> Vec<(Ticket, ModuleControl)> {
    let mut requests = Vec::new();
    server
        .drain(|ticket, request| requests.push((ticket, *request)))
        .unwrap();
    requests
}

/// A request that is on its way when its client leaves stays with iceoryx2 until the server has read it. iceoryx2 ends
/// the process when 128 such clients are kept.
fn clients_that_leave_with_requests_in_every_state_leave_nothing_at_the_server() {
    const ROUNDS: usize = 60;
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut before = None;
        for round in 0..ROUNDS {
            let mut clients: Vec<_> = (0..6)
                .map(|_| ipc.client::<ModuleControl>().unwrap())
                .collect();
            // Half of them have an open request, all have one that the server knows of and has not read.
            for client in clients.iter_mut().step_by(2) {
                client.send(&start()).unwrap();
            }
            let open = take(&mut server);
            assert_eq!(open.len(), 3, "round {round}");
            for client in &mut clients {
                client.send(&start()).unwrap();
            }
            assert!(server.wait(WATCHDOG).unwrap().is_ready());
            drop(clients);
            assert!(take(&mut server).is_empty(), "no client waits for them");
            let mut gone = 0;
            server.vanished(|ticket, _| {
                assert!(open.iter().any(|(open, _)| *open == ticket));
                gone += 1;
            });
            assert_eq!(gone, 3, "round {round}");
            // Whatever iceoryx2 keeps until the next look is given back by it.
            assert!(take(&mut server).is_empty());
            let before = *before.get_or_insert_with(open_descriptors);
            until("no descriptor more", || open_descriptors() <= before);
        }
        assert_eq!(server.open_tickets(), 0);
        assert_eq!(server.generations(), 1);
    });
}

/// As an operator's scripts end: several at once, each with a request that the server has read, or has not. The clients
/// that come next clean up after those that went, while the server is reading.
fn clients_that_are_killed_in_groups_leave_nothing_at_the_server() {
    const GROUPS: usize = 10;
    const GROUP: usize = 6;
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut before = None;
        let mut open = HashSet::new();
        for _ in 0..GROUPS {
            let mut clients: Vec<_> = (0..GROUP).map(|_| Role::start(domain, "client")).collect();
            for (index, client) in clients.iter_mut().enumerate() {
                assert_eq!(client.next_line(), "sent");
                if index % 2 == 0 {
                    serve(&mut server, &mut open);
                }
            }
            for client in &mut clients {
                client.kill();
            }
            until("the dead are seen", || {
                server.wait(WATCHDOG).unwrap();
                serve(&mut server, &mut open);
                open.is_empty()
            });
            let before = *before.get_or_insert_with(open_descriptors);
            until("no descriptor more", || {
                serve(&mut server, &mut open);
                open_descriptors() <= before
            });
        }
        assert_eq!(server.generations(), 1);
        let mut client = ipc.client::<ModuleControl>().unwrap();
        client.send(&start()).unwrap();
        assert_eq!(take(&mut server).len(), 1);
    });
}

/// One round of a server; `open` has the requests that it knows of.
fn serve(server: &mut Server<ModuleControl>, open: &mut HashSet<u64>) {
    server.vanished(|_, request_id| assert!(open.remove(&request_id)));
    for (ticket, request) in take(server) {
        assert!(open.insert(request.request_id));
        let accepted = RequestReport::new(Stage::Accepted, Reason::None);
        match server.report(ticket, &accepted) {
            Ok(()) => {}
            Err(ReportError::Vanished) => assert!(open.remove(&request.request_id)),
            Err(error) => panic!("{error}"),
        }
    }
}

fn a_stopped_subscriber_holds_up_no_other() {
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut reader = ipc.subscriber::<DspTelemetry>().unwrap();
        let mut stopped = Role::ready(domain, "subscriber", "subscribed");
        stopped.signal(Signal::STOP);
        let mut heard = 0;
        for _ in 0..3_000 {
            publisher.publish(|_| {}).unwrap();
            heard += reader.drain(|_| {}).unwrap();
        }
        stopped.kill();
        for _ in 0..3_000 {
            publisher.publish(|_| {}).unwrap();
            heard += reader.drain(|_| {}).unwrap();
        }
        assert_eq!((heard, reader.losses().lost), (6_000, 0));
    });
}

fn a_signal_ends_a_wait() {
    in_domain(|domain| {
        let mut sleeper = Role::ready(domain, "sleeper", "asleep");
        let (done, is_done) = std::sync::mpsc::channel();
        thread::scope(|scope| {
            let pid = Pid::from_child(&sleeper.child);
            let says = &mut sleeper.says;
            scope.spawn(move || {
                let mut line = String::new();
                says.read_line(&mut line).expect("a line");
                done.send(line).expect("the test waits");
            });
            // A signal that comes before the sleep does not end it: so again and again.
            let mut line = None;
            until("interrupted", || {
                kill_process(pid, Signal::USR1).expect("a signal");
                line = is_done.recv_timeout(Duration::from_millis(20)).ok();
                line.is_some()
            });
            let interrupted = format!("{:?}\n", Wake::<()>::Interrupted);
            assert_eq!(line, Some(interrupted));
        });
        assert!(sleeper.child.wait().unwrap().success());
    });
}

fn kills_during_start_up_do_not_keep_the_next_from_starting() {
    const KILLS: u64 = 60;
    in_domain(|domain| {
        // As long as this one lives, no process may remove the robot's folder as a whole.
        let ipc = join(domain, "consumer");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        for kill in 0..KILLS {
            for role in ["publisher", "server"] {
                let mut starting = Role::start(domain, role);
                // The moment of the kill is this test's input: 0 … 12 ms after the start.
                thread::sleep(Duration::from_micros(kill * 200));
                starting.kill();
                subscriber.drain(|_| {}).unwrap();
            }
        }
        let _server = Role::ready(domain, "server", "serving");
        let before = subscriber.losses().received;
        let _publisher = Role::ready(domain, "publisher", "published");
        until("three samples", || {
            subscriber.wait(WATCHDOG).unwrap();
            subscriber.drain(|_| {}).unwrap();
            subscriber.losses().received >= before + 3
        });
    });
}

/// A publisher is killed, and its last consumer takes the generation away, which is still announced.
fn a_generation_that_has_vanished_is_no_publisher_and_no_error() {
    in_domain(|domain| {
        let ipc = join(domain, "consumer");
        // It looks for the first time when everything is gone.
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let mut publisher = Role::ready(domain, "publisher", "published");
        let other = join(domain, "other");
        let last = other.subscriber::<DspTelemetry>().unwrap();
        publisher.kill();
        drop((last, other));
        let service = domain.root().join("1/dsp_telemetry");
        let is_folder = |entry: fs::DirEntry| entry.path().is_dir();
        until("the generation has vanished", || {
            !fs::read_dir(&service).unwrap().flatten().any(is_folder)
        });
        assert!(service.join("current").exists());
        for _ in 0..2 {
            assert_eq!(subscriber.drain(|_| {}).unwrap(), 0);
        }
        let _next = Role::ready(domain, "publisher", "published");
        until("three samples", || {
            subscriber.wait(WATCHDOG).unwrap();
            subscriber.drain(|_| {}).unwrap();
            subscriber.losses().received >= 3
        });
    });
}

/// Places of the dead are found out once a second; many more than there are places die in that time.
fn consumers_that_die_faster_than_their_places_are_given_back_keep_none_from_starting() {
    const DEATHS: usize = 4 * ipc_types::service::MAX_SUBSCRIBERS;
    in_domain(|domain| {
        let mut publisher = Role::ready(domain, "publisher", "published");
        for _ in 0..DEATHS {
            Role::ready(domain, "subscriber", "subscribed").kill();
        }
        publisher.kill();
        domain.remove_if_dead().unwrap();
    });
}

fn consumers_that_are_killed_while_they_start_cost_their_neighbours_nothing() {
    const KILLS: u64 = 60;
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let neighbour = join(domain, "neighbour");
        let mut subscriber = neighbour.subscriber::<DspTelemetry>().unwrap();
        let mut received = 0;
        let mut publish = |publisher: &mut Publisher<DspTelemetry>| {
            publisher.service();
            publisher.publish(|_| {}).unwrap();
            received += subscriber.drain(|_| {}).unwrap();
            assert_eq!(
                (received as u64, subscriber.losses().lost),
                (publisher.sequence(), 0)
            );
        };
        publish(&mut publisher);
        let (before, descriptors) = (domain.residue().len(), open_descriptors());
        for kill in 0..KILLS {
            let mut starting = Role::start(domain, "subscriber");
            // The moment of the kill is this test's input: 0 … 12 ms after the start.
            thread::sleep(Duration::from_micros(kill * 200));
            publish(&mut publisher);
            starting.kill();
            publish(&mut publisher);
        }
        // What is left behind by those that were killed before they were known is deleted with the generation.
        publisher.wear_out();
        until("nothing is left", || {
            publish(&mut publisher);
            // The period of a publisher at 50 Hz. No event says that files are gone and descriptors are closed, so the
            // test looks once a period; the watchdog bounds it.
            thread::sleep(Duration::from_millis(20));
            publisher.generations() > 1
                && domain.residue().len() <= before
                && open_descriptors() <= descriptors
        });
    });
}

/// A request that is open when a new generation begins is answered where it was asked.
fn a_generation_that_wears_out_costs_no_request() {
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let operator = join(domain, "operator");
        let mut client = operator.client::<ModuleControl>().unwrap();
        let (early, late) = (start(), start());
        client.send(&early).unwrap();
        let mut open = take(&mut server);
        server.wear_out();
        assert!(take(&mut server).is_empty());
        assert_eq!(server.generations(), 2);
        client.send(&late).unwrap();
        open.extend(take(&mut server));
        assert_eq!(open.len(), 2);
        let done = RequestReport::new(Stage::Done, Reason::None);
        for (ticket, _) in &open {
            server.report(*ticket, &done).unwrap();
        }
        let mut finals = Vec::new();
        until("both reports", || {
            client.drain(|report| finals.push((report.request_id, report.stage())));
            finals.len() == 2
        });
        let done = Some(Stage::Done);
        assert_eq!(finals, [(early.request_id, done), (late.request_id, done)]);
        assert_eq!((client.outstanding(), server.open_tickets()), (0, 0));
    });
}

/// It never lives until it looks for what others left. As long as another process of the robot lives, its folder stays.
fn a_provider_that_crashes_in_a_loop_leaves_few_generations() {
    const CRASHES: usize = 40;
    const MOST: usize = 20;
    in_domain(|domain| {
        let _ipc = join(domain, "consumer");
        let service = domain.root().join("1/dsp_telemetry");
        let generations = || {
            let entries = fs::read_dir(&service).unwrap().flatten();
            entries.filter(|entry| entry.path().is_dir()).count()
        };
        for _ in 0..CRASHES {
            Role::ready(domain, "publisher", "published").kill();
            assert!(generations() <= MOST);
        }
    });
}

fn what_a_provider_that_was_killed_had_half_announced_is_gone_with_the_next() {
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let service = domain.root().join("1/dsp_telemetry");
        files::create_dir_all(&service).unwrap();
        fs::write(service.join("current.new"), "gglq").unwrap();
        let _publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let names = fs::read_dir(&service).unwrap().flatten();
        let names = names.map(|entry| entry.file_name().into_string().unwrap());
        let drafts: Vec<String> = names.filter(|name| name.starts_with("current.")).collect();
        assert!(drafts.is_empty(), "{drafts:?}");
    });
}

/// What iceoryx2 reads of another member while it looks for dead ones can keep it waiting. Here it is a pipe.
fn a_removal_that_hangs_holds_up_neither_ports_nor_the_end() {
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let before = files_of_members(domain);
        let member = Role::ready(domain, "subscriber", "subscribed");
        let pipes: Vec<PathBuf> = files_of_members(domain)
            .difference(&before)
            .cloned()
            .collect();
        assert!(!pipes.is_empty());
        for path in &pipes {
            fs::remove_file(path).unwrap();
            mkfifoat(CWD, path, Mode::RUSR | Mode::WUSR).unwrap();
        }
        // Longer than the time in which the process looks for dead members.
        let begun = MonotonicNs::now();
        let operator = join(domain, "operator");
        while MonotonicNs::now().since(begun) < Duration::from_secs(2) {
            drop(operator.publisher::<ModuleState>().unwrap());
            files::while_no_port_opens(|| ());
        }
        drop((operator, publisher, ipc));
        // It can be opened in this way as soon as somebody waits at the other end, who then waits no longer.
        let opens = OFlags::WRONLY | OFlags::NONBLOCK;
        until("the removal came to a pipe", || {
            pipes
                .iter()
                .any(|path| open(path, opens, Mode::empty()).is_ok())
        });
        drop(member);
        domain.remove_if_dead().unwrap();
    });
}

/// What the members of the present generation of the telemetry have laid down about themselves.
fn files_of_members(domain: &Domain) -> HashSet<PathBuf> {
    let service = domain.root().join("1/dsp_telemetry");
    let current = fs::read_to_string(service.join("current")).unwrap();
    let (generation, _) = current.split_once(' ').unwrap();
    let entries = |folder: PathBuf| fs::read_dir(folder).into_iter().flatten().flatten();
    entries(service.join(generation).join("nodes"))
        .filter(|entry| entry.path().is_dir())
        .flat_map(|member| entries(member.path()))
        .filter(|entry| entry.path().is_file())
        .map(|entry| entry.path())
        .collect()
}

/// The first rename of a process that is alone gives the robot's folder its name, the second takes it away.
fn a_process_that_is_held_up_while_it_leaves_or_joins_takes_no_folder_of_the_living() {
    if Command::new("strace").arg("-V").output().is_err() {
        return eprintln!("SKIPPED: strace is not installed");
    }
    for (rename, lock_before) in [(1, "LOCK_SH"), (2, "LOCK_EX")] {
        in_domain(move |domain| {
            let folder = tempfile::tempdir_in("/tmp").unwrap();
            let trace = folder.path().join("trace");
            mkfifoat(CWD, &trace, Mode::RUSR | Mode::WUSR).unwrap();
            let renames = "rename,renameat,renameat2";
            let mut strace = Command::new("strace");
            strace
                .args(["-f", "-e", &format!("trace=flock,{renames}"), "-e"])
                .arg(format!("inject={renames}:delay_enter=700000:when={rename}"))
                .arg("-o")
                .arg(&trace)
                .arg(std::env::current_exe().unwrap());
            let mut passer_by = Role::spawn(domain, "passer_by", strace);
            let mut lines = std::io::BufReader::new(fs::File::open(&trace).unwrap()).lines();
            let mut before = (&mut lines).map(Result::unwrap);
            assert!(before.any(|line| line.contains(lock_before)), "no lock");
            // Its rename comes next, and takes 0.7 s to begin.
            let mut publisher = Role::ready(domain, "publisher", "published");
            let robot = domain.root().join("1");
            let inode = || fs::metadata(&robot).map(|it| it.ino()).ok();
            let living = inode();
            assert!(
                lines
                    .map(Result::unwrap)
                    .any(|line| line.contains("DELAYED"))
            );
            passer_by.child.wait().unwrap();
            assert_eq!(inode(), living, "rename {rename}");

            let ipc = join(domain, "another");
            let refused = ipc.publisher::<DspTelemetry>().err().map(text).unwrap();
            let pid = format!("process {}", publisher.child.id());
            assert!(refused.contains(&pid), "{refused}");
            let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
            until("the latest sample", || {
                subscriber.wait(WATCHDOG).unwrap();
                subscriber.drain(|_| {}).unwrap() > 0
            });
            publisher.kill();
        });
    }
}

fn a_client_that_breaks_the_server_s_port_costs_the_others_no_more_than_to_ask_again() {
    in_domain(|domain| {
        let mut server = Role::ready(domain, "sturdy_server", "serving");
        let ipc = join(domain, "operator");
        let mut client = ipc.client::<ModuleControl>().unwrap();
        let mut told = Vec::new();
        let mut ask = |end: &dyn Fn(&[Option<Reason>]) -> bool| {
            if client.outstanding() == 0 {
                client.send(&start()).unwrap();
            }
            told.clear();
            until("the reports", || {
                client.wait(WATCHDOG).unwrap();
                client.drain(|report| told.push(report.reason()));
                end(&told)
            });
        };
        ask(&|told| *told == [Some(Reason::None)]);
        server.signal(Signal::STOP);
        let data = || {
            let entries = fs::read_dir("/dev/shm").unwrap().flatten();
            let paths = entries.map(|entry| entry.path().display().to_string());
            let is_ours = |path: &String| path.contains(&domain.tag()) && path.ends_with(".data");
            paths.filter(is_ours).collect::<HashSet<_>>()
        };
        let before = data();
        let mut vandal = Role::ready(domain, "client", "sent");
        for path in data().difference(&before) {
            // Behind the segment's own header: where iceoryx2 keeps what it computes addresses with.
            let mut bytes = fs::read(path).unwrap();
            bytes[128..].fill(0xff);
            let file = fs::OpenOptions::new().write(true).open(path).unwrap();
            file.write_all_at(&bytes, 0).unwrap();
        }
        server.signal(Signal::CONT);
        assert_eq!(server.next_line(), "gone");
        assert_eq!(server.next_line(), "generation 2");
        vandal.kill();
        ask(&|told| *told == [Some(Reason::BridgeGone)]);
        ask(&|told| *told == [Some(Reason::None)]);
        server.kill();
    });
}

fn an_order_is_answered_though_subscribers_took_all_descriptors() {
    in_domain(|domain| {
        let mut limited = Role::start(domain, "limited");
        let refused = limited.next_line();
        assert!(refused.contains("low limits: nofile "), "{refused}");
        let ipc = join(domain, "another");
        let used = || {
            let folder = format!("/proc/{}/fd", limited.child.id());
            fs::read_dir(folder).unwrap().count()
        };
        let before = used();
        let subscribers: Vec<_> = (0..24)
            .map(|_| ipc.subscriber::<DspTelemetry>().unwrap())
            .inspect(|subscriber| assert!(subscriber.descriptor().is_ok()))
            .collect();
        // One operator after the other.
        for _ in 0..3 {
            let mut client = ipc.client::<ModuleControl>().unwrap();
            let result = client.request(&start()).unwrap().result().unwrap();
            assert_eq!(result.stage(), Some(Stage::Done));
        }
        assert!(used() > before);
        drop(subscribers);
        limited.kill();
    });
}

/// Another thread may have any lock of the process when it forks.
fn a_child_that_is_forked_while_other_threads_open_ports_is_refused_at_once() {
    const OPENERS: u32 = 3;
    const CHILDREN: u32 = 40;
    in_domain(|domain| {
        let _publisher = join(domain, "status").publisher::<DspTelemetry>().unwrap();
        let is_over = AtomicBool::new(false);
        thread::scope(|scope| {
            for _ in 0..OPENERS {
                scope.spawn(|| {
                    while !is_over.load(Ordering::Relaxed) {
                        join(domain, "opener").subscriber::<DspTelemetry>().unwrap();
                    }
                });
            }
            let refused = (0..CHILDREN).filter(|_| {
                // SAFETY: what the child calls takes no lock and ends it.
                #[allow(unsafe_code)]
                let child = unsafe { libc::fork() };
                if child == 0 {
                    let joined = Ipc::join(domain, RobotId::DEFAULT, "child");
                    let is_refused = matches!(joined, Err(JoinError::Forked(_)));
                    files::while_no_port_opens(|| ());
                    // SAFETY: nothing of the parent is dropped.
                    #[allow(unsafe_code)]
                    unsafe {
                        libc::_exit(i32::from(is_refused))
                    };
                }
                let child = Pid::from_raw(child).expect("a child");
                let ended = waitpid(Some(child), WaitOptions::empty());
                let (_, status) = ended.expect("wait").expect("it has ended");
                status.exit_status() == Some(1)
            });
            let refused = refused.count();
            is_over.store(true, Ordering::Relaxed);
            assert_eq!(refused, CHILDREN as usize);
        });
    });
}

fn a_forked_child_takes_nothing_from_its_parent_and_is_refused() {
    in_domain(|domain| {
        let mut parent = Role::start(domain, "parent");
        assert_eq!(parent.next_line(), "11");
        assert_eq!(parent.next_line(), "child Some(0)");
        assert_eq!(parent.next_line(), "heard 1, served 1");
        let ipc = join(domain, "another");
        for key in ["dsp_telemetry", "module_control"] {
            let provider = ipc.provider(key).unwrap().unwrap();
            assert_eq!(provider.pid, parent.child.id(), "{key}");
        }
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        until("the latest sample", || {
            subscriber.wait(WATCHDOG).unwrap();
            subscriber
                .drain(|sample| assert_eq!(sample.sequence, 2))
                .unwrap()
                > 0
        });
        // The parent's locks go with the parent.
        parent.kill();
        assert_eq!(ipc.provider("dsp_telemetry").unwrap(), None);
    });
}

fn a_provider_that_ends_makes_room_though_a_child_of_it_lives_on() {
    in_domain(|domain| {
        let _parent = Role::ready(domain, "survived", "ended");
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
        let next = [("publisher", "published"), ("server", "serving")];
        let mut next = next.map(|(role, says)| Role::ready(domain, role, says));
        next.iter_mut().for_each(Role::kill);
        domain.remove_if_dead().unwrap();
    });
}

fn what_the_dead_left_is_removed_by_the_next_process() {
    in_domain(|domain| {
        let mut roles = [
            ("publisher", "published"),
            ("subscriber", "subscribed"),
            ("server", "serving"),
        ]
        .map(|(role, says)| Role::ready(domain, role, says));
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::InUse);
        roles.iter_mut().for_each(Role::kill);
        assert!(!domain.residue().is_empty());
        let next = join(domain, "next");
        assert_eq!(next.provider("dsp_telemetry").unwrap(), None);
        drop(next);
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
    });
}

/// A domain with its root in a folder of `/tmp`, which is given as well.
fn elsewhere(test: impl FnOnce(&Domain, &Path)) {
    let folder = files::while_no_port_opens(|| tempfile::tempdir_in("/tmp")).unwrap();
    let domain = Domain::isolated_in(folder.path()).unwrap();
    test(&domain, folder.path());
    assert!(domain.residue().is_empty(), "{:?}", domain.residue());
}

fn a_root_outside_of_shared_memory_leaves_nothing_there_after_kills() {
    elsewhere(|domain, _| {
        for age_ms in 0..20 {
            let mut started =
                ["publisher", "server", "subscriber"].map(|role| Role::start(domain, role));
            // The moment of the kill is this test's input.
            thread::sleep(Duration::from_millis(age_ms));
            started.iter_mut().for_each(Role::kill);
        }
        let publisher = Role::ready(domain, "publisher", "published");
        drop(publisher);
        assert!(!domain.residue().is_empty());
        drop(join(domain, "next"));
    });
}

/// Two containers, or a service with a `/tmp` of its own, can have the same root and share the segments.
fn another_folder_under_the_same_root_in_another_mount_namespace_harms_nobody() {
    const MOUNT: &str = "mount -t tmpfs tmpfs \"$1\" && shift && exec \"$@\"";
    // Who is not root becomes root of a user namespace, which may mount.
    let flags = match rustix::process::geteuid().is_root() {
        true => "-m",
        false => "-rm",
    };
    let inside = |folder: &Path, program: &Path| {
        let mut command = Command::new("unshare");
        command.args([flags, "sh", "-c", MOUNT, "sh"]);
        command.args([folder, program]);
        command
    };
    elsewhere(|domain, folder| {
        let attempt = inside(folder, Path::new("true")).output();
        if !attempt.as_ref().is_ok_and(|output| output.status.success()) {
            eprintln!("SKIPPED: no mount namespace of its own: {attempt:?}");
            return;
        }
        let ipc = join(domain, "bridge");
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let before = domain.residue().len();
        let program = std::env::current_exe().unwrap();
        for _ in 0..3 {
            let command = inside(folder, &program);
            let mut other = Role::spawn(domain, "publisher", command);
            assert_eq!(other.next_line(), "published");
            // It has another provider's folder, and begins; its segments have this domain's tag.
            assert!(domain.residue().len() > before);
            publisher.publish(|_| {}).unwrap();
            let mut newcomer = join(domain, "operator")
                .subscriber::<DspTelemetry>()
                .unwrap();
            publisher.publish(|_| {}).unwrap();
            assert!(newcomer.drain(|_| {}).unwrap() > 0);
            drop(other.child.stdin.take());
            other.kill();
        }
        assert_eq!(subscriber.drain(|_| {}).unwrap(), 6);
        drop((subscriber, publisher, ipc));
        // What the killed ones left has no folder any more. Nothing can tell it from what is in use in a third folder.
        let left = domain.residue();
        assert!(!left.is_empty() && left.iter().all(|path| path.starts_with("/dev/shm")));
        left.iter().for_each(|path| fs::remove_file(path).unwrap());
    });
}
