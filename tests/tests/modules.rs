//! Modules by `module-kit`, with clients that are processes of their own.

use std::process::Command;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use ipc_types::{Client, Ipc, Waiter, request, shared_struct};
use module_kit::Requests;
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::{Process, TestDomain};

shared_struct! {
    /// Asks for work that takes a while.
    pub struct Job("worker.Job.v1") = 8 {
        /// Chosen by the sender.
        pub request_id: u64,
    }
}
request!(Job, "worker/jobs");

const JOB: Job = Job { request_id: 7 };

/// With this variable this program is the client that is killed.
const IS_CLIENT: &str = "RIL_TESTS_CLIENT_OF_MODULE";

/// A module that accepts each job, and a note of each that it has begun.
struct Worker {
    jobs: Requests<Job>,
    begun: Vec<u64>,
}

impl Worker {
    fn serve(&mut self) {
        let begun = &mut self.begun;
        self.jobs.serve(|job| {
            begun.push(job.request_id);
            RequestReport::new(Stage::Accepted, Reason::None)
        });
    }

    /// Serves at the next wake, which a request is, and the end of a client.
    fn serve_next(&mut self) {
        let mut sources = [((), self.jobs.source())];
        Waiter::new().wait(&mut sources, Some(WAIT_LIMIT)).unwrap();
        self.serve();
    }
}

/// The reports that the worker gives to one more request with the same id.
fn ask(client: &mut Client<Job>, worker: &mut Worker) -> Vec<(Option<Stage>, Option<Reason>)> {
    client.send(&JOB).unwrap();
    worker.serve();
    reports(client)
}

fn reports(client: &mut Client<Job>) -> Vec<(Option<Stage>, Option<Reason>)> {
    let mut reports = Vec::new();
    client.drain(|report| reports.push((report.stage(), report.reason())));
    reports
}

#[test]
fn a_client_that_is_killed_after_accepted_and_asks_again_gets_the_end_of_the_same_work() {
    if std::env::var_os(IS_CLIENT).is_some() {
        return ask_and_wait_for_ever();
    }
    let domain = TestDomain::new();
    let ipc = domain.join("worker");
    let mut worker = Worker {
        jobs: Requests::open(&ipc).unwrap(),
        begun: Vec::new(),
    };
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args([
        "modules::a_client_that_is_killed_after_accepted_and_asks_again_gets_the_end_of_the_same_work",
        "--exact",
        "--nocapture",
    ]);
    command.env(IS_CLIENT, "1");
    let mut first = Process::spawn(&domain, command);
    while worker.begun.is_empty() {
        worker.serve_next();
    }
    first.wait_for_text("accepted");
    first.signal(Signal::KILL);
    first.wait_status();

    let second = domain.join("second");
    let mut client = second.client::<Job>().unwrap();
    let still_open = (Some(Stage::Refused), Some(Reason::StillOpen));
    let accepted = (Some(Stage::Accepted), Some(Reason::None));
    let done = (Some(Stage::Done), Some(Reason::None));
    let mut answer = ask(&mut client, &mut worker);
    // Until the worker has noticed that the first one is gone.
    while answer == [still_open] {
        worker.serve_next();
        answer = ask(&mut client, &mut worker);
    }
    assert_eq!((answer, &worker.begun), (vec![accepted], &vec![7]));

    let end = RequestReport::new(Stage::Done, Reason::None);
    assert!(worker.jobs.report(7, &end), "the work was under way");
    assert_eq!(reports(&mut client), [done]);
    assert_eq!(ask(&mut client, &mut worker), [done], "from memory");
    assert_eq!(worker.begun, [7]);
    drop((client, second, worker, ipc));
    domain.sweep();
}

/// What the client does that is killed.
fn ask_and_wait_for_ever() {
    let mut client = Ipc::connect("first").unwrap().client::<Job>().unwrap();
    let mut handle = client.request(&JOB).unwrap();
    for report in handle.feedback() {
        println!("{}", report.unwrap().stage().unwrap());
    }
}
