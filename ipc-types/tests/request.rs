//! Requests: streams of reports, clients and servers that come and go, full buffers and tables.

use std::collections::HashSet;
use std::fs;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{ModuleControl, MovementData, RequestReport, WaypointPosition};
use ipc_types::server::MAX_OPEN_TICKETS;
use ipc_types::service::{MAX_CLIENTS, MAX_OUTSTANDING, RESPONSE_BUFFER};
use ipc_types::{
    Client, MonotonicNs, ReportError, Request, SendError, Server, Source, Ticket, Waiter, Wake,
    fresh_request_id,
};

use crate::support::{WATCHDOG, in_domain, in_robot, in_service, join, until};

const A_MOMENT: Duration = Duration::from_millis(200);

fn start() -> ModuleControl {
    ModuleControl::new(fresh_request_id(), ControlCommand::Start)
}

/// The requests that are there.
fn take<R: Request>(server: &mut Server<R>) -> Vec<(Ticket, R)> {
    let mut requests = Vec::new();
    server
        .drain(|ticket, request| requests.push((ticket, *request)))
        .unwrap();
    requests
}

/// The reports that are there: request, stage, reason.
fn reports<R: Request>(client: &mut Client<R>) -> Vec<(u64, Stage, Reason)> {
    let mut reports = Vec::new();
    client.drain(|report| {
        let stage = report.stage().expect("a stage of the contract");
        let reason = report.reason().expect("a reason of the contract");
        reports.push((report.request_id, stage, reason));
    });
    reports
}

fn report(stage: Stage) -> RequestReport {
    RequestReport::new(stage, Reason::None)
}

#[test]
fn a_request_is_accepted_goes_on_and_has_a_final_report() {
    in_service(|mut client: Client<MovementData>, mut server| {
        let request = MovementData::take_off(fresh_request_id(), 12.5);
        client.send(&request).unwrap();
        assert!(server.wait(WATCHDOG).unwrap().is_ready());
        let requests = take(&mut server);
        let [(ticket, received)] = requests[..] else {
            panic!("{requests:?}");
        };
        assert_eq!(received, request);

        for (stage, outstanding) in [(Stage::Accepted, 1), (Stage::Progress, 1), (Stage::Done, 0)] {
            server.report(ticket, &report(stage)).unwrap();
            assert!(client.wait(WATCHDOG).unwrap().is_ready());
            let expected = [(request.request_id, stage, Reason::None)];
            assert_eq!(reports(&mut client), expected);
            assert_eq!(client.outstanding(), outstanding);
        }
        assert_eq!(server.open_tickets(), 0);
        assert_eq!(
            server.report(ticket, &report(Stage::Progress)),
            Err(ReportError::NotOpen)
        );
        assert_eq!(client.wait(Duration::ZERO).unwrap(), Wake::TimedOut);
    });
}

#[test]
fn a_request_that_does_not_say_when_it_was_issued_is_issued_when_it_is_sent() {
    in_service(|mut client: Client<MovementData>, mut server| {
        let issued = MovementData::hold(fresh_request_id());
        let unissued = MovementData {
            request_id: fresh_request_id(),
            issued_ns: 0,
            ..issued
        };
        client.send(&issued).unwrap();
        let before = MonotonicNs::now().0;
        client.send(&unissued).unwrap();
        let after = MonotonicNs::now().0;
        let requests = take(&mut server);
        let [(_, first), (_, second)] = requests[..] else {
            panic!("{requests:?}");
        };
        assert_eq!(first, issued, "as it says");
        assert!((before..=after).contains(&second.issued_ns), "{second:?}");
        let issued_ns = second.issued_ns;
        let stamped = MovementData {
            issued_ns,
            ..unissued
        };
        assert_eq!(second, stamped, "and nothing else is changed");
    });
}

#[test]
fn a_client_that_waits_or_drains_renews_the_lease_of_its_path_until_that_ends() {
    in_robot(|ipc| {
        let mut server = ipc.server::<MovementData>().unwrap();
        let mut client = ipc.client::<MovementData>().unwrap();
        let at = WaypointPosition {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 20.0,
        };
        let [opening, closing] = [(true, false), (false, true)].map(|(first, last)| MovementData {
            lease_ms: 500,
            ..MovementData::waypoint(fresh_request_id(), 77, at, first, last)
        });
        assert_eq!(ipc.lease_renewed(77), None);
        client.send(&opening).unwrap();
        let sent = ipc.lease_renewed(77).expect("a lease");
        let seen = client.wait(2 * A_MOMENT).unwrap();
        assert_eq!(seen, Wake::TimedOut);
        let waited = ipc.lease_renewed(77).expect("a lease");
        assert!(waited > sent, "{waited:?} {sent:?}");
        assert!(reports(&mut client).is_empty());
        assert!(ipc.lease_renewed(77) > Some(waited));

        client.send(&closing).unwrap();
        for (ticket, _) in take(&mut server) {
            assert!(ipc.lease_renewed(77).is_some());
            server.report(ticket, &report(Stage::Done)).unwrap();
        }
        assert_eq!(reports(&mut client).len(), 2);
        assert_eq!(ipc.lease_renewed(77), None);

        client.send(&closing).unwrap();
        assert!(ipc.lease_renewed(77).is_some());
        client.give_up();
        assert_eq!(ipc.lease_renewed(77), None);

        let own = std::process::id();
        assert_eq!(ipc.members().shares_clock_with(own), Some(true));
        let stranger = ipc.members().shares_clock_with(1);
        assert_eq!(stranger, None, "of no process of the robot");
    });
}

#[test]
fn without_a_server_nothing_is_sent() {
    in_robot(|ipc| {
        let mut client = ipc.client::<ModuleControl>().unwrap();
        assert!(!client.is_server_alive());
        let error = client.send(&start()).unwrap_err();
        assert!(matches!(error, SendError::NoServer { robot: 1, .. }));
        assert!(error.to_string().contains("start its bridge"), "{error}");
        assert_eq!(client.outstanding(), 0);

        // A server that comes later knows nothing of it, and takes the next.
        let mut server = ipc.server::<ModuleControl>().unwrap();
        assert!(client.is_server_alive());
        assert!(take(&mut server).is_empty());
        client.send(&start()).unwrap();
        assert_eq!(take(&mut server).len(), 1);
    });
}

#[test]
fn a_client_that_is_dropped_or_gives_up_is_seen_as_vanished() {
    in_robot(|ipc| {
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut dropped = ipc.client::<ModuleControl>().unwrap();
        let mut giving_up = ipc.client::<ModuleControl>().unwrap();
        let mut staying = ipc.client::<ModuleControl>().unwrap();
        let sent = [start(), start(), start()];
        dropped.send(&sent[0]).unwrap();
        giving_up.send(&sent[1]).unwrap();
        staying.send(&sent[2]).unwrap();
        let requests = take(&mut server);
        assert_eq!(requests.len(), 3);
        assert_eq!(server.wait(Duration::ZERO).unwrap(), Wake::TimedOut);

        drop(dropped);
        giving_up.give_up();
        assert!(server.wait(WATCHDOG).unwrap().is_ready());
        let mut gone = Vec::new();
        server.vanished(|_, request_id| gone.push(request_id));
        gone.sort_unstable();
        let mut expected = [sent[0].request_id, sent[1].request_id];
        expected.sort_unstable();
        assert_eq!(gone, expected);
        assert_eq!(server.open_tickets(), 1);

        server.vanished(|_, request_id| panic!("{request_id} vanished again"));
        for (ticket, request) in requests {
            let result = server.report(ticket, &report(Stage::Done));
            let expected = if request == sent[2] {
                Ok(())
            } else {
                Err(ReportError::NotOpen)
            };
            assert_eq!(result, expected);
        }
    });
}

/// The server's table gives the place of an ended request to the next one.
#[test]
fn an_old_ticket_never_stands_for_a_new_request() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        client.send(&start()).unwrap();
        let (old, _) = take(&mut server)[0];
        server.report(old, &report(Stage::Done)).unwrap();
        client.send(&start()).unwrap();
        let (new, _) = take(&mut server)[0];
        assert_ne!(old, new);
        let by_number = Ticket::from_bits(old.to_bits());
        for ticket in [
            old,
            by_number,
            Ticket::from_bits(0),
            Ticket::from_bits(u64::MAX),
        ] {
            let result = server.report(ticket, &report(Stage::Done));
            assert_eq!(result, Err(ReportError::NotOpen));
        }
        let by_number = Ticket::from_bits(new.to_bits());
        server.report(by_number, &report(Stage::Done)).unwrap();
    });
}

#[test]
fn reporting_to_a_client_that_is_gone_says_so_once() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        client.send(&start()).unwrap();
        let (ticket, _) = take(&mut server)[0];
        drop(client);
        let mut tell = || server.report(ticket, &report(Stage::Progress));
        assert_eq!(tell(), Err(ReportError::Vanished));
        assert_eq!(tell(), Err(ReportError::NotOpen));
        server.vanished(|_, request_id| panic!("{request_id} vanished again"));
    });
}

#[test]
fn a_request_whose_sender_is_gone_is_never_seen() {
    in_service(|mut client: Client<MovementData>, mut server| {
        client
            .send(&MovementData::take_off(fresh_request_id(), 5.0))
            .unwrap();
        drop(client);
        assert!(take(&mut server).is_empty());
    });
}

#[test]
fn a_client_follows_every_generation_while_a_request_is_open_in_the_first() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        let open = start();
        client.send(&open).unwrap();
        assert_eq!(server.drain(|_, _| ()).unwrap(), 1);
        // A generation is followed by the next after a second at least, and served for another one.
        let end = Instant::now() + Duration::from_secs(5);
        while Instant::now() < end {
            server.wear_out();
            let request = start();
            client.send(&request).unwrap();
            let mut done = false;
            until("done", || {
                server.wait(A_MOMENT).unwrap();
                let mut tickets = Vec::new();
                server.drain(|ticket, _| tickets.push(ticket)).unwrap();
                for ticket in tickets {
                    server.report(ticket, &report(Stage::Done)).unwrap();
                }
                client.wait(A_MOMENT).unwrap();
                client.drain(|report| {
                    assert_eq!(report.request_id, request.request_id);
                    done = true;
                });
                done
            });
        }
        assert!(server.generations() > 3, "{}", server.generations());
        assert_eq!(client.outstanding(), 1);
    });
}

#[test]
fn when_the_server_goes_every_open_request_ends_as_unknown() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        let sent = [start(), start(), start()];
        for request in &sent {
            client.send(request).unwrap();
        }
        let requests = take(&mut server);
        // What the server still said comes out first.
        server.report(requests[0].0, &report(Stage::Done)).unwrap();
        server
            .report(requests[1].0, &report(Stage::Accepted))
            .unwrap();
        drop(server);
        assert!(client.wait(WATCHDOG).unwrap().is_ready());
        let mut told = reports(&mut client);
        told.sort_by_key(|(id, stage, _)| {
            let order = sent.iter().position(|request| request.request_id == *id);
            (order, stage.code())
        });
        let expected = [
            (sent[0].request_id, Stage::Done, Reason::None),
            (sent[1].request_id, Stage::Accepted, Reason::None),
            (sent[1].request_id, Stage::Unknown, Reason::BridgeGone),
            (sent[2].request_id, Stage::Unknown, Reason::BridgeGone),
        ];
        assert_eq!(told, expected);
        assert_eq!(client.outstanding(), 0);
        assert!(!client.is_server_alive());
    });
}

#[test]
fn the_last_words_of_a_server_reach_everybody_though_it_goes_at_once() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        for _ in 0..MAX_OUTSTANDING {
            client.send(&start()).unwrap();
        }
        let last_words = RequestReport::new(Stage::Aborted, Reason::BridgeEnding);
        // All but the first, which has nothing to read when the server goes.
        for (ticket, _) in take(&mut server).into_iter().skip(1) {
            server.report(ticket, &last_words).unwrap();
        }
        drop(server);
        let told = reports(&mut client);
        let count = |stage| told.iter().filter(|(_, told, _)| *told == stage).count();
        assert_eq!(
            (count(Stage::Unknown), count(Stage::Aborted)),
            (1, MAX_OUTSTANDING - 1)
        );
    });
}

/// Four times as many requests as may be open: each has its final report before the next is sent, and the program reads
/// none.
#[test]
fn requests_that_have_ended_do_not_count_as_open_though_their_reports_were_not_read() {
    const SENT: usize = 4 * MAX_OUTSTANDING;
    in_service(|mut client: Client<ModuleControl>, mut server| {
        let mut sent = Vec::new();
        for _ in 0..SENT {
            let request = start();
            client.send(&request).unwrap();
            sent.push(request.request_id);
            for (ticket, _) in take(&mut server) {
                for stage in [Stage::Accepted, Stage::Progress, Stage::Done] {
                    server.report(ticket, &report(stage)).unwrap();
                }
            }
        }
        // Every final report is there; of the others the oldest gave way.
        let told = reports(&mut client);
        let done = told.iter().filter(|(_, stage, _)| *stage == Stage::Done);
        assert_eq!(done.map(|(id, ..)| *id).collect::<Vec<_>>(), sent);
        assert!(told.len() < 3 * SENT, "{}", told.len());
        assert_eq!(client.outstanding(), 0);
    });
}

#[test]
fn a_path_and_more_may_be_open_at_once_and_one_too_many_is_refused() {
    in_service(|mut client: Client<MovementData>, mut server| {
        let position = WaypointPosition {
            latitude_deg: 37.4,
            longitude_deg: -5.9,
            altitude_m: 20.0,
        };
        let path: Vec<_> =
            MovementData::path(7, &[position; MAX_OUTSTANDING], fresh_request_id).collect();
        for request in &path {
            client.send(request).unwrap();
        }
        assert_eq!(client.outstanding(), MAX_OUTSTANDING);
        assert_eq!(client.send(&path[0]), Err(SendError::TooManyOutstanding));

        let requests = take(&mut server);
        let received: Vec<_> = requests.iter().map(|(_, request)| *request).collect();
        assert_eq!(received, path, "in order");
        for (ticket, _) in &requests {
            server.report(*ticket, &report(Stage::Accepted)).unwrap();
        }
        for (ticket, _) in requests.iter().rev() {
            server.report(*ticket, &report(Stage::Done)).unwrap();
        }
        let mut told = reports(&mut client);
        told.sort_by_key(|(id, stage, _)| (*id, stage.code()));
        let mut expected: Vec<_> = path
            .iter()
            .flat_map(|request| {
                [Stage::Accepted, Stage::Done]
                    .map(|stage| (request.request_id, stage, Reason::None))
            })
            .collect();
        expected.sort_by_key(|(id, stage, _)| (*id, stage.code()));
        assert_eq!(told, expected);
        // The places are free again, many times over.
        for _ in 0..3 * MAX_OUTSTANDING {
            client.send(&path[0]).unwrap();
            let (ticket, _) = take(&mut server)[0];
            server.report(ticket, &report(Stage::Done)).unwrap();
            assert_eq!(reports(&mut client).len(), 1);
        }
    });
}

/// Tickets of requests that were given up stay until their owner has asked who vanished.
#[test]
fn one_request_too_many_is_refused_by_the_server_s_port() {
    in_robot(|ipc| {
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut tickets = Vec::new();
        while tickets.len() < MAX_OPEN_TICKETS as usize {
            let mut client = ipc.client::<ModuleControl>().unwrap();
            for _ in 0..MAX_OUTSTANDING {
                client.send(&start()).unwrap();
            }
            tickets.extend(take(&mut server));
        }
        assert_eq!(server.open_tickets(), MAX_OPEN_TICKETS as usize);

        let mut client = ipc.client::<ModuleControl>().unwrap();
        let late = start();
        client.send(&late).unwrap();
        assert!(take(&mut server).is_empty());
        assert_eq!(server.refused_full(), 1);
        let refusal = (late.request_id, Stage::Refused, Reason::TooManyRequests);
        assert_eq!(reports(&mut client), [refusal]);

        // Who is told of the others makes room.
        let mut gone = 0;
        server.vanished(|_, _| gone += 1);
        assert_eq!((gone, server.open_tickets()), (tickets.len(), 0));
        client.send(&late).unwrap();
        assert_eq!(take(&mut server).len(), 1);
    });
}

#[test]
fn a_client_that_does_not_read_loses_progress_but_never_the_final_report() {
    in_service(|mut client: Client<MovementData>, mut server| {
        let request = MovementData::land(fresh_request_id());
        client.send(&request).unwrap();
        let (ticket, _) = take(&mut server)[0];
        for _ in 0..RESPONSE_BUFFER {
            server.report(ticket, &report(Stage::Progress)).unwrap();
        }
        let progress = server.report(ticket, &report(Stage::Progress));
        assert_eq!(progress, Err(ReportError::BufferFull));
        server.report(ticket, &report(Stage::Done)).unwrap();
        let after_final = server.report(ticket, &report(Stage::Progress));
        assert_eq!(after_final, Err(ReportError::NotOpen));
        assert_eq!(server.open_tickets(), 1, "the final report is kept");

        let progress = (request.request_id, Stage::Progress, Reason::None);
        assert_eq!(reports(&mut client), [progress; RESPONSE_BUFFER]);
        assert!(take(&mut server).is_empty());
        let done = (request.request_id, Stage::Done, Reason::None);
        assert_eq!(reports(&mut client), [done]);
        assert_eq!((server.open_tickets(), client.outstanding()), (0, 0));
    });
}

#[test]
fn a_client_that_connects_while_its_server_goes_has_no_server() {
    in_domain(|domain| {
        let ipc = join(domain, "test");
        for round in 0..50 {
            let mut client = ipc.client::<ModuleControl>().unwrap();
            let server = ipc.server::<ModuleControl>().unwrap();
            let ended = thread::spawn(move || drop(server));
            match client.send(&start()) {
                Ok(_) | Err(SendError::NoServer { .. }) => {}
                Err(error) => panic!("in round {round}: {error:?}"),
            }
            ended.join().unwrap();
        }
        // One that was killed has announced a generation, and another process removes that at this moment.
        let server = ipc.server::<ModuleControl>().unwrap();
        let announced = domain.root().join("1").join(ModuleControl::KEY);
        let announced = announced.join("current");
        let text = fs::read(&announced).unwrap();
        drop(server);
        // The client tries anew at its first request.
        let mut client = ipc.client::<ModuleControl>().unwrap();
        fs::write(&announced, text).unwrap();
        drop(ipc.server::<MovementData>().unwrap());
        let error = client.send(&start()).unwrap_err();
        assert!(matches!(error, SendError::NoServer { .. }), "{error:?}");
        fs::remove_file(announced).unwrap();
    });
}

#[test]
fn a_request_that_meets_the_end_of_its_server_is_sent_or_has_no_server() {
    in_robot(|ipc| {
        for round in 0..200 {
            let server = ipc.server::<ModuleControl>().unwrap();
            let mut client = ipc.client::<ModuleControl>().unwrap();
            let ended = thread::spawn(move || drop(server));
            for _ in 0..MAX_OUTSTANDING - 1 {
                match client.send(&start()) {
                    Ok(_) => {}
                    Err(SendError::NoServer { .. }) => break,
                    Err(error) => panic!("in round {round}: {error:?}"),
                }
            }
            ended.join().unwrap();
        }
    });
}

#[test]
fn a_server_that_does_not_read_refuses_and_a_client_that_gives_up_again_and_again_harms_nobody() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        // A request that was given up keeps its place in the queue until the server reads on.
        for _ in 0..MAX_OUTSTANDING {
            client.send(&start()).unwrap();
        }
        client.give_up();
        assert_eq!(client.send(&start()), Err(SendError::ServerFull));
        assert_eq!(client.outstanding(), 0);
        assert!(take(&mut server).is_empty(), "nobody waits for them");
        client.send(&start()).unwrap();
        assert_eq!(take(&mut server).len(), 1);
    });
}

#[test]
fn a_report_is_given_the_request_s_id_and_a_time() {
    in_service(|mut client: Client<ModuleControl>, mut server| {
        let request = start();
        client.send(&request).unwrap();
        let (ticket, _) = take(&mut server)[0];
        let mut wrong = report(Stage::Done);
        wrong.request_id = 1;
        server.report(ticket, &wrong).unwrap();
        let mut told = Vec::new();
        client.drain(|report| told.push(*report));
        assert_eq!(told.len(), 1);
        assert_eq!(told[0].request_id, request.request_id);
        assert_ne!(told[0].reported_ns, 0);
    });
}

#[test]
fn a_waiter_wakes_a_server_for_requests_and_a_client_for_reports() {
    const REQUESTS: usize = 2_000;
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let waiter = Waiter::new();
        let mut control = ipc.server::<ModuleControl>().unwrap();
        let mut movement = ipc.server::<MovementData>().unwrap();
        let operator = {
            let domain = domain.clone();
            thread::spawn(move || {
                let ipc = join(&domain, "operator");
                let mut client = ipc.client::<ModuleControl>().unwrap();
                for _ in 0..REQUESTS {
                    client.send(&start()).unwrap();
                    while client.outstanding() > 0 {
                        assert!(client.wait(WATCHDOG).unwrap().is_ready());
                        for (_, stage, _) in reports(&mut client) {
                            assert_eq!(stage, Stage::Done);
                        }
                    }
                }
            })
        };
        let mut served = 0;
        while served < REQUESTS {
            let servers: &mut [(_, &mut dyn Source)] =
                &mut [("movement", &mut movement), ("control", &mut control)];
            let wake = waiter.wait(servers, Some(WATCHDOG)).unwrap();
            assert!(wake.is_only("control"), "{wake:?}");
            assert!(take(&mut movement).is_empty());
            for (ticket, _) in take(&mut control) {
                control.report(ticket, &report(Stage::Done)).unwrap();
                served += 1;
            }
            control.vanished(|_, request_id| panic!("{request_id} vanished"));
        }
        operator.join().unwrap();
        // The operator's end wakes the server, which finds nothing; then it is quiet.
        until("quiet", || {
            let servers: &mut [(_, &mut dyn Source)] =
                &mut [((), &mut movement), ((), &mut control)];
            let wake = waiter.wait(servers, Some(A_MOMENT));
            assert!(take(&mut control).is_empty());
            wake.unwrap() == Wake::TimedOut
        });
    });
}

/// A client whose number in iceoryx2's list is the lowest is asked first, and can send as quickly as the server reads.
#[test]
fn every_client_is_served_whatever_the_others_send() {
    in_robot(|ipc| {
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut flooders: Vec<_> = (0..MAX_CLIENTS - 1)
            .map(|_| ipc.client::<ModuleControl>().unwrap())
            .collect();
        let mut operator = ipc.client::<ModuleControl>().unwrap();
        for flooder in &mut flooders {
            for _ in 0..MAX_OUTSTANDING {
                flooder.send(&start()).unwrap();
            }
        }
        let request = start();
        operator.send(&request).unwrap();
        let requests = take(&mut server);
        let place = requests
            .iter()
            .position(|(_, taken)| taken.request_id == request.request_id);
        let place = place.expect("it is among those of the first round");
        assert!(
            place < MAX_CLIENTS,
            "after the first of each other client at most: {place}"
        );
        let mine = |client: &Client<ModuleControl>| client.outstanding();
        assert_eq!(requests.len(), flooders.iter().map(mine).sum::<usize>() + 1);
    });
}

/// Giving up makes room for as many requests as before, while the server is still reading.
#[test]
fn a_client_that_gives_up_and_sends_again_has_one_share_in_each_round() {
    in_robot(|ipc| {
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut flooder = ipc.client::<ModuleControl>().unwrap();
        let mut operator = ipc.client::<ModuleControl>().unwrap();
        for _ in 0..3 {
            for _ in 0..MAX_OUTSTANDING {
                flooder.send(&start()).unwrap();
            }
            let open = take(&mut server);
            assert_eq!(open.len(), MAX_OUTSTANDING);
            flooder.give_up();
            for _ in 0..MAX_OUTSTANDING {
                flooder.send(&start()).unwrap();
            }
            operator.send(&start()).unwrap();
            let requests = take(&mut server);
            assert_eq!(requests.len(), MAX_OUTSTANDING + 1);
            let mut gone = 0;
            server.vanished(|_, _| gone += 1);
            assert_eq!(gone, MAX_OUTSTANDING);
            for (ticket, _) in requests {
                server.report(ticket, &report(Stage::Done)).unwrap();
            }
            assert_eq!(reports(&mut operator).len(), 1);
            assert_eq!(reports(&mut flooder).len(), MAX_OUTSTANDING);
        }
        assert_eq!((server.open_tickets(), server.refused_full()), (0, 0));
    });
}

/// What a client has not read stays in the server's memory, also when the request was given up.
#[test]
fn clients_that_never_read_leave_room_for_the_reports_to_another() {
    in_robot(|ipc| {
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut operator = ipc.client::<ModuleControl>().unwrap();
        let mut deaf: Vec<_> = (1..MAX_CLIENTS)
            .map(|_| ipc.client::<ModuleControl>().unwrap())
            .collect();
        // Until no channel of any of them has room for one more.
        let mut has_room = true;
        while has_room {
            has_room = false;
            for client in &mut deaf {
                for _ in 0..MAX_OUTSTANDING {
                    client.send(&start()).unwrap();
                }
            }
            for (ticket, _) in take(&mut server) {
                while server.report(ticket, &report(Stage::Progress)).is_ok() {
                    has_room = true;
                }
            }
            deaf.iter_mut().for_each(Client::give_up);
            server.vanished(|_, _| {});
        }
        operator.send(&start()).unwrap();
        let (ticket, _) = take(&mut server)[0];
        for _ in 1..RESPONSE_BUFFER {
            server.report(ticket, &report(Stage::Progress)).unwrap();
        }
        server.report(ticket, &report(Stage::Done)).unwrap();
        assert_eq!(reports(&mut operator).len(), RESPONSE_BUFFER);
    });
}

/// iceoryx2 tries to connect a client once, and again when another comes or goes.
#[test]
fn a_server_that_cannot_reach_a_client_serves_the_others_and_begins_anew() {
    in_domain(|domain| {
        let segments = || -> HashSet<_> {
            let mut segments = domain.residue();
            segments.retain(|path| path.extension().is_some_and(|kind| kind == "data"));
            segments.into_iter().collect()
        };
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let mut operator = ipc.client::<ModuleControl>().unwrap();
        let before = segments();
        let mut unreachable = ipc.client::<ModuleControl>().unwrap();
        let after = segments();
        let [segment] = after.difference(&before).collect::<Vec<_>>()[..] else {
            panic!("{before:?}, {after:?}");
        };
        let hidden = segment.with_extension("hidden");
        fs::rename(segment, &hidden).unwrap();
        unreachable.send(&start()).unwrap();
        operator.send(&start()).unwrap();
        let [(ticket, _)] = take(&mut server)[..] else {
            panic!("one request");
        };
        server.report(ticket, &report(Stage::Done)).unwrap();
        fs::rename(&hidden, segment).unwrap();
        assert!(take(&mut server).is_empty(), "it is not tried again");
        assert_eq!(server.generations(), 1, "it may be gone in a moment");
        let mut finals = Vec::new();
        until("a new generation, and nobody waits in the old one", || {
            server.wait(A_MOMENT).unwrap();
            assert!(take(&mut server).is_empty());
            finals.extend(reports(&mut unreachable));
            !finals.is_empty()
        });
        assert_eq!(server.generations(), 2);
        assert_eq!(finals[0].1, Stage::Unknown);
        unreachable.send(&start()).unwrap();
        assert_eq!(take(&mut server).len(), 1);
    });
}

#[test]
fn eight_clients_that_flood_keep_no_request_of_another_from_its_final_report() {
    const FLOODERS: usize = 8;
    // Each takes as long as the server and the operator wait for a processor, which on an emulated machine is a tenth
    // of a second.
    const REQUESTS: usize = 100;
    in_domain(|domain| {
        let ipc = join(domain, "bridge");
        let mut server = ipc.server::<ModuleControl>().unwrap();
        let is_over = Arc::new(AtomicBool::new(false));
        let flooders: Vec<_> = (0..FLOODERS)
            .map(|index| {
                let (domain, is_over) = (domain.clone(), Arc::clone(&is_over));
                thread::spawn(move || {
                    let ipc = join(&domain, "flooder");
                    let mut client = ipc.client::<ModuleControl>().unwrap();
                    while !is_over.load(Ordering::Relaxed) {
                        // Some read what they are told, some give up.
                        if client.send(&start()).is_err() && index % 2 == 0 {
                            client.give_up();
                        }
                        client.drain(|_| {});
                    }
                })
            })
            .collect();
        let operator = {
            let domain = domain.clone();
            thread::spawn(move || {
                let ipc = join(&domain, "operator");
                let mut client = ipc.client::<ModuleControl>().unwrap();
                for _ in 0..REQUESTS {
                    client.send(&start()).unwrap();
                    let mut told = Vec::new();
                    until("the final report", || {
                        client.wait(WATCHDOG).unwrap();
                        told.extend(reports(&mut client));
                        client.outstanding() == 0
                    });
                    assert_eq!(told.last().unwrap().1, Stage::Done);
                }
            })
        };
        while !operator.is_finished() {
            server.wait(A_MOMENT).unwrap();
            server.vanished(|_, _| {});
            for (ticket, _) in take(&mut server) {
                match server.report(ticket, &report(Stage::Done)) {
                    Ok(()) | Err(ReportError::Vanished) => {}
                    Err(error) => panic!("{error}"),
                }
            }
        }
        is_over.store(true, Ordering::Relaxed);
        operator.join().unwrap();
        for flooder in flooders {
            flooder.join().unwrap();
        }
        assert_eq!(server.refused_full(), 0);
    });
}

/// Answers each request that comes with these stages, in a thread of its own, until it has taken `count`.
fn answering(
    mut server: Server<MovementData>,
    stages: &'static [Stage],
    count: usize,
) -> thread::JoinHandle<Server<MovementData>> {
    thread::spawn(move || {
        let mut taken = 0;
        while taken < count {
            server.wait(WATCHDOG).unwrap();
            for (ticket, _) in take(&mut server) {
                taken += 1;
                for stage in stages {
                    server.report(ticket, &report(*stage)).unwrap();
                }
            }
        }
        server
    })
}

#[test]
fn a_handle_follows_one_request_to_its_result() {
    in_robot(|ipc| {
        let mut client = ipc.client::<MovementData>().unwrap();
        let server = ipc.server::<MovementData>().unwrap();
        let serving = answering(server, &[Stage::Accepted, Stage::Progress, Stage::Done], 2);
        let order = MovementData::take_off(fresh_request_id(), 12.5);
        let mut handle = client.request(&order).unwrap();
        assert_eq!(handle.request_id(), order.request_id);
        let feedback: Vec<_> = handle
            .feedback()
            .map(|report| report.unwrap().stage().unwrap())
            .collect();
        assert_eq!(feedback, [Stage::Accepted, Stage::Progress]);
        for _ in 0..2 {
            assert_eq!(handle.result().unwrap().stage(), Some(Stage::Done));
        }
        assert_eq!(handle.recv_timeout(WATCHDOG).unwrap(), None);
        drop(handle);
        assert_eq!(client.outstanding(), 0);
        let landing = MovementData::land(fresh_request_id());
        let result = client.request(&landing).unwrap().result().unwrap();
        assert_eq!(
            (result.request_id, result.stage()),
            (landing.request_id, Some(Stage::Done))
        );
        drop(serving.join().unwrap());
    });
}

#[test]
fn a_handle_that_is_dropped_gives_up_its_request_alone() {
    in_service(|mut client: Client<MovementData>, mut server| {
        let other = MovementData::land(fresh_request_id());
        client.send(&other).unwrap();
        let given_up = MovementData::hold(fresh_request_id());
        let mut handle = client.request(&given_up).unwrap();
        let requests = take(&mut server);
        assert_eq!(requests.len(), 2);
        for (ticket, _) in &requests {
            server.report(*ticket, &report(Stage::Accepted)).unwrap();
        }
        // What comes about the other request is no wake-up for the handle, and is kept for the client.
        let first = handle.recv_timeout(WATCHDOG).unwrap().unwrap();
        assert_eq!(first.request_id, given_up.request_id);
        assert_eq!(handle.recv_timeout(A_MOMENT).unwrap(), None);
        drop(handle);
        let mut gone = Vec::new();
        server.vanished(|_, request_id| gone.push(request_id));
        assert_eq!(gone, [given_up.request_id]);
        assert!(client.wait(WATCHDOG).unwrap().is_ready());
        assert_eq!(
            reports(&mut client),
            [(other.request_id, Stage::Accepted, Reason::None)]
        );
        assert_eq!(client.outstanding(), 1);
        drop(server);
        assert!(client.wait(WATCHDOG).unwrap().is_ready());
        assert_eq!(
            reports(&mut client),
            [(other.request_id, Stage::Unknown, Reason::BridgeGone)]
        );
    });
}
