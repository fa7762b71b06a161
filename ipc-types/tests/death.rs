//! Processes that are killed, stopped and interrupted: what the others notice, and that nothing is left.
//!
//! The program starts itself again in the roles below; the roles talk by lines on their standard streams.

mod support;

use std::collections::HashSet;
use std::io::BufRead;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::Duration;

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::inspect::Life;
use ipc_types::payload::{DspTelemetry, ModuleControl, RequestReport};
use ipc_types::{
    Domain, Ipc, Removal, ReportError, RobotId, Server, ServiceId, Source, Ticket, Waiter, Wake,
    fresh_request_id,
};
use rustix::fs::{AtFlags, CWD, Timespec, Timestamps, utimensat};
use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process};

use support::{Role, WATCHDOG, in_domain, join, open_descriptors, until};

const TESTS: &[(&str, fn())] = &[
    (
        "a_killed_publisher_is_noticed_at_once_and_its_successor_is_heard",
        a_killed_publisher_is_noticed_at_once_and_its_successor_is_heard,
    ),
    (
        "a_killed_server_ends_every_request_though_nobody_cleans_up",
        a_killed_server_ends_every_request_though_nobody_cleans_up,
    ),
    (
        "a_killed_client_is_seen_as_vanished_after_cleaning_up",
        a_killed_client_is_seen_as_vanished_after_cleaning_up,
    ),
    (
        "clients_that_leave_with_requests_in_every_state_leave_nothing_at_the_server",
        clients_that_leave_with_requests_in_every_state_leave_nothing_at_the_server,
    ),
    (
        "clients_that_are_killed_in_groups_leave_nothing_at_the_server",
        clients_that_are_killed_in_groups_leave_nothing_at_the_server,
    ),
    (
        "a_stopped_subscriber_holds_up_nobody",
        a_stopped_subscriber_holds_up_nobody,
    ),
    ("a_signal_ends_a_wait", a_signal_ends_a_wait),
    (
        "kills_during_start_up_do_not_keep_the_next_from_starting",
        kills_during_start_up_do_not_keep_the_next_from_starting,
    ),
    (
        "kills_during_start_up_leave_nothing_beside_a_live_neighbour",
        kills_during_start_up_leave_nothing_beside_a_live_neighbour,
    ),
    (
        "a_connection_that_the_dead_left_half_made_holds_up_nobody",
        a_connection_that_the_dead_left_half_made_holds_up_nobody,
    ),
    (
        "a_service_that_the_dead_left_half_made_holds_up_nobody",
        a_service_that_the_dead_left_half_made_holds_up_nobody,
    ),
    (
        "places_that_a_killed_cleaner_has_half_given_back_are_given_back",
        places_that_a_killed_cleaner_has_half_given_back_are_given_back,
    ),
    (
        "repairing_removes_the_dead_and_leaves_the_living_alone",
        repairing_removes_the_dead_and_leaves_the_living_alone,
    ),
    (
        "what_the_dead_left_is_removed_by_whoever_comes_next",
        what_the_dead_left_is_removed_by_whoever_comes_next,
    ),
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
            std::io::stdin().lines().for_each(drop);
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
            let subscriber = ipc.subscriber::<DspTelemetry>().expect("subscriber");
            let waiter = Waiter::new();
            println!("asleep");
            let wake = waiter
                .wait(&[&subscriber as &dyn Source], None)
                .expect("wait");
            println!("{wake:?}");
        }
        other => panic!("no role {other}"),
    }
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
            let provider = ipc.provider(ServiceId::DspTelemetry).unwrap().unwrap();
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
            assert_eq!(ipc.provider(ServiceId::DspTelemetry).unwrap(), None);
        }
        assert_eq!(heard, [1, 2, 3, 1, 2, 3, 1, 2, 3]);
        epochs.dedup();
        assert_eq!(epochs.len(), 3);
        let losses = subscriber.losses();
        assert_eq!((losses.lost, losses.publisher_changes), (0, 2));
        // The last one's remains are still there: nobody came after it.
        assert_eq!((ipc.clean_dead().removed, ipc.clean_dead().removed), (1, 0));
    });
}

fn a_killed_server_ends_every_request_though_nobody_cleans_up() {
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

fn a_killed_client_is_seen_as_vanished_after_cleaning_up() {
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
        assert_eq!(ipc.clean_dead().removed, 1);
        assert!(server.wait(WATCHDOG).unwrap().is_ready(0));
        let mut gone = Vec::new();
        server.vanished(|_, request_id| gone.push(request_id));
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

/// A request that is on its way when its client leaves stays with iceoryx2 until the server has read it. iceoryx2 ends the
/// process when 128 such clients are kept.
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
            assert!(server.wait(WATCHDOG).unwrap().is_ready(0));
            drop(clients);
            assert!(take(&mut server).is_empty(), "nobody waits for them");
            let mut gone = 0;
            server.vanished(|ticket, _| {
                assert!(open.iter().any(|(open, _)| *open == ticket));
                gone += 1;
            });
            assert_eq!(gone, 3, "round {round}");
            // Whatever iceoryx2 keeps until the next look is given back by it.
            assert!(take(&mut server).is_empty());
            let descriptors = open_descriptors();
            assert_eq!(
                *before.get_or_insert(descriptors),
                descriptors,
                "round {round}"
            );
        }
        assert_eq!(server.open_tickets(), 0);
        assert!(!server.is_worn());
    });
}

/// As an operator's scripts end: several at once, each with a request that the server has read, or has not. The clients that
/// come next clean up after those that went, while the server is reading.
fn clients_that_are_killed_in_groups_leave_nothing_at_the_server() {
    const GROUPS: usize = 30;
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
                // As the bridge does on its timer.
                ipc.clean_dead();
                serve(&mut server, &mut open);
                open.is_empty()
            });
            let descriptors = open_descriptors();
            assert!(descriptors <= *before.get_or_insert(descriptors));
        }
        assert!(!server.is_worn());
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

fn a_stopped_subscriber_holds_up_nobody() {
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
            let interrupted = format!("{:?}\n", Wake::Interrupted);
            assert_eq!(line, Some(interrupted));
        });
        assert!(sleeper.child.wait().unwrap().success());
    });
}

fn kills_during_start_up_do_not_keep_the_next_from_starting() {
    const KILLS: u64 = 60;
    in_domain(|domain| {
        // As long as this one lives, nobody may remove the domain as a whole.
        let ipc = join(domain, "consumer");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        for kill in 0..KILLS {
            for role in ["publisher", "server"] {
                let mut starting = Role::start(domain, role);
                // The moment of the kill is this test's input: 0 … 12 ms after the start.
                thread::sleep(Duration::from_micros(kill * 200));
                starting.kill();
                ipc.clean_dead();
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

/// Makes everything in the domain look as if it had been made long ago.
///
/// Nothing is opened for that: closing a node's own file again would give up its lock.
fn make_old(domain: &Domain) {
    let long_ago = Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    let times = Timestamps {
        last_access: long_ago,
        last_modification: long_ago,
    };
    for path in domain.residue() {
        match utimensat(CWD, &path, &times, AtFlags::SYMLINK_NOFOLLOW) {
            Ok(()) | Err(Errno::NOENT) => {}
            Err(error) => panic!("{}: {error}", path.display()),
        }
    }
}

fn kills_during_start_up_leave_nothing_beside_a_live_neighbour() {
    const KILLS: u64 = 60;
    in_domain(|domain| {
        let ipc = join(domain, "neighbour");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        // Whatever a publisher leaves for good, such as the file that names it, is there from the first one on.
        Role::ready(domain, "publisher", "published").kill();
        ipc.clean_dead();
        let (before, descriptors_before) = (domain.residue().len(), open_descriptors());
        for kill in 0..KILLS {
            let mut publisher = Role::start(domain, "publisher");
            // The moment of the kill is this test's input: 0 … 12 ms after the start.
            thread::sleep(Duration::from_micros(kill * 200));
            publisher.kill();
            let cleaning = ipc.clean_dead();
            assert_eq!(cleaning.failed, 0, "kill {kill}");
        }
        // What a dead process was connected with is let go by its partner.
        subscriber.drain(|_| {}).unwrap();
        make_old(domain);
        // At everything, which the timer's clean-up looks at only now and then.
        domain.repair().unwrap();
        let cleaning = domain.repair().unwrap().cleaning;
        assert!(
            cleaning.is_nothing(),
            "{cleaning:?}: {:#?} {:#?}",
            domain.inspect(),
            domain.residue()
        );
        let seen = domain.inspect();
        assert_eq!((seen.nodes.len(), seen.unfinished), (1, 0), "{seen:?}");
        let after = domain.residue();
        assert!(after.len() <= before, "{before} before: {after:#?}");
        assert_eq!(open_descriptors(), descriptors_before);
        // The neighbour has noticed nothing.
        let received = subscriber.losses().received;
        let _publisher = Role::ready(domain, "publisher", "published");
        until("three samples", || {
            subscriber.wait(WATCHDOG).unwrap();
            subscriber.drain(|_| {}).unwrap();
            subscriber.losses().received >= received + 3
        });
    });
}

fn a_connection_that_the_dead_left_half_made_holds_up_nobody() {
    in_domain(|domain| {
        let ipc = join(domain, "neighbour");
        let mut publisher = Role::ready(domain, "publisher", "published");
        let mut subscriber = Role::ready(domain, "subscriber", "subscribed");
        let connection = || {
            let mut segments = domain.residue().into_iter();
            segments.find(|path| path.extension().is_some_and(|kind| kind == "connection"))
        };
        until("they are connected", || connection().is_some());
        publisher.kill();
        subscriber.kill();
        // As it is between the two system calls that make it.
        let path = connection().expect("nobody has cleaned up");
        std::fs::write(&path, "").unwrap();
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o200)).unwrap();
        let cleaning = ipc.clean_dead();
        assert_eq!((cleaning.removed, cleaning.failed), (2, 0), "{cleaning:?}");
        assert_eq!(connection(), None);
    });
}

fn a_service_that_the_dead_left_half_made_holds_up_nobody() {
    in_domain(|domain| {
        let ipc = join(domain, "neighbour");
        let mut server = Role::ready(domain, "server", "serving");
        let segments = || {
            let mut segments = domain.residue();
            segments.retain(|path| path.extension().is_some_and(|kind| kind == "dynamic"));
            segments
        };
        server.kill();
        // As it is between the two system calls that make one.
        let half_made = segments();
        assert!(!half_made.is_empty(), "nobody has cleaned up");
        for path in half_made {
            std::fs::write(&path, "").unwrap();
            std::fs::set_permissions(&path, PermissionsExt::from_mode(0o200)).unwrap();
        }
        let cleaning = ipc.clean_dead();
        assert_eq!((cleaning.removed, cleaning.failed), (1, 0), "{cleaning:?}");
        assert!(segments().is_empty());
        Role::ready(domain, "server", "serving");
    });
}

fn places_that_a_killed_cleaner_has_half_given_back_are_given_back() {
    in_domain(|domain| {
        let ipc = join(domain, "neighbour");
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let entries = |folder: &Path| {
            let entries = std::fs::read_dir(folder).expect("a folder");
            entries.map(|entry| entry.expect("an entry").path())
        };
        let nodes = domain.root().join("nodes");
        let neighbours: Vec<_> = entries(&nodes).collect();
        // More of them than a service has places for publishers.
        for _ in 0..6 {
            Role::ready(domain, "publisher", "published").kill();
            let mut dead = entries(&nodes).filter(|path| path.is_dir());
            let dead = dead
                .find(|path| !neighbours.contains(path))
                .expect("nobody has cleaned up");
            // As a cleaner leaves it that is killed in the middle: the tags are gone, the places are not.
            let spare = domain
                .root()
                .join("cleaning")
                .join(dead.file_name().unwrap());
            std::fs::create_dir_all(&spare).unwrap();
            for tag in entries(&dead).filter(|path| path.extension() == Some("port_tag".as_ref())) {
                std::fs::rename(&tag, spare.join(tag.file_name().unwrap())).unwrap();
            }
            let cleaning = ipc.clean_dead();
            assert_eq!((cleaning.removed, cleaning.failed), (1, 0), "{cleaning:?}");
            assert!(!spare.exists());
            subscriber.drain(|_| {}).unwrap();
        }
        subscriber.drain(|_| {}).unwrap();
        let connection = |path: &PathBuf| path.extension() == Some("connection".as_ref());
        let left: Vec<_> = domain.residue().into_iter().filter(connection).collect();
        assert!(left.is_empty(), "{left:?}");
    });
}

fn repairing_removes_the_dead_and_leaves_the_living_alone() {
    in_domain(|domain| {
        let neighbour = Domain::isolated();
        let ipc = join(&neighbour, "neighbour");
        let _publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let living = neighbour.residue().len();

        let mut subscriber = Role::ready(domain, "subscriber", "subscribed");
        let mut publisher = Role::ready(domain, "publisher", "published");
        publisher.kill();
        let seen = domain.inspect();
        let of = |life| -> Vec<(u32, String)> {
            seen.nodes_that_are(life)
                .map(|node| (node.pid, node.process.clone()))
                .collect()
        };
        let described = |role: &Role, name: &str| vec![(role.child.id(), name.to_owned())];
        assert_eq!(of(Life::Live), described(&subscriber, "subscriber"));
        assert_eq!(of(Life::Dead), described(&publisher, "publisher"));

        let repair = domain.repair().unwrap();
        assert_eq!(repair.removal, Removal::InUse);
        assert_eq!((repair.cleaning.removed, repair.cleaning.failed), (1, 0));
        assert!(!repair.secured && !repair.renewed);
        let seen = domain.inspect();
        assert_eq!(seen.nodes_that_are(Life::Live).count(), 1);
        assert_eq!(seen.nodes.len(), 1);

        subscriber.kill();
        let repair = domain.repair().unwrap();
        assert!(matches!(repair.removal, Removal::Removed(_)), "{repair:?}");
        assert_eq!(domain.repair().unwrap().removal, Removal::Nothing);
        assert_eq!(neighbour.residue().len(), living);
        drop((_publisher, ipc));
        assert!(neighbour.residue().is_empty());
    });
}

fn what_the_dead_left_is_removed_by_whoever_comes_next() {
    in_domain(|domain| {
        let killed_alone = || {
            let mut publisher = Role::ready(domain, "publisher", "published");
            let mut subscriber = Role::ready(domain, "subscriber", "subscribed");
            assert_eq!(domain.remove_if_dead().unwrap(), Removal::InUse);
            subscriber.kill();
            publisher.kill();
            assert!(!domain.residue().is_empty());
        };
        killed_alone();
        assert!(matches!(
            domain.remove_if_dead().unwrap(),
            Removal::Removed(_)
        ));
        assert!(domain.residue().is_empty());
        killed_alone();
        // The first to join finds a clean domain, and leaves one.
        let ipc = join(domain, "next");
        assert_eq!(ipc.clean_dead().removed, 0);
        drop(ipc);
    });
}
