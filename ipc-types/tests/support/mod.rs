//! What the tests share: a domain of their own with a watchdog, waiting with a limit, and the program itself as a child
//! process in a role.

use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command, ExitCode, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use ipc_types::{
    Client, Domain, Ipc, Publisher, Request, RobotId, Server, Subscriber, Topic, files,
};
use rustix::process::{Pid, Signal, kill_process};

/// Far longer than any test takes; only a test that hangs meets it.
pub const WATCHDOG: Duration = Duration::from_secs(300);

/// Runs a test in a domain of its own, on a thread of its own because ports stay on one, and checks that nothing is
/// left of the domain.
pub fn in_domain(test: impl FnOnce(&Domain) + Send + 'static) {
    let domain = Domain::isolated();
    let (sender, receiver) = mpsc::channel::<()>();
    let thread = {
        let domain = domain.clone();
        thread::spawn(move || {
            // Dropped when the test ends, also when it fails.
            let _sender = sender;
            test(&domain);
        })
    };
    if receiver.recv_timeout(WATCHDOG) == Err(RecvTimeoutError::Timeout) {
        // The thread cannot be ended: say so, and let the process end with an error.
        eprintln!("a test in {} hangs", domain.root().display());
        std::process::abort();
    }
    let result = thread.join();
    let residue = domain.residue();
    // A failed test leaves nothing either, unless a process is still in there.
    let _ = domain.remove_if_dead();
    if let Err(failure) = result {
        std::panic::resume_unwind(failure);
    }
    assert!(residue.is_empty(), "left behind: {residue:?}");
}

/// As [`in_domain`], with this process's part in it for robot 1.
#[allow(dead_code)]
pub fn in_robot(test: impl FnOnce(Ipc) + Send + 'static) {
    in_domain(|domain| test(join(domain, "test")));
}

/// As [`in_robot`], with a client and the server of the same requests.
#[allow(dead_code)]
pub fn in_service<R: Request>(test: impl FnOnce(Client<R>, Server<R>) + Send + 'static) {
    in_robot(|ipc| {
        let server = ipc.server().expect("the server");
        test(ipc.client().expect("a client"), server);
    });
}

/// As [`in_robot`], with the publisher and a subscriber of the same topic, which has entered the publisher's
/// generation.
#[allow(dead_code)]
pub fn in_topic<T: Topic>(test: impl FnOnce(Publisher<T>, Subscriber<T>) + Send + 'static) {
    in_robot(|ipc| {
        let publisher = ipc.publisher().expect("the publisher");
        test(publisher, ipc.subscriber().expect("a subscriber"));
    });
}

/// A part in the domain for robot 1.
#[allow(dead_code)]
pub fn join(domain: &Domain, process: &str) -> Ipc {
    Ipc::join(domain, RobotId::DEFAULT, process).expect("join")
}

/// Descriptors of this process.
#[allow(dead_code)]
pub fn open_descriptors() -> usize {
    std::fs::read_dir("/proc/self/fd").expect("proc").count()
}

/// Repeats `step`, which waits for something, until it says true; fails after the watchdog's time.
#[allow(dead_code)]
pub fn until(what: &str, mut step: impl FnMut() -> bool) {
    let end = Instant::now() + WATCHDOG / 2;
    while !step() {
        assert!(Instant::now() < end, "never: {what}");
    }
}

/// The tests of a program with a main function of its own, by their names. Those after `as_root` are named as if they
/// were in a module of that name: `.ci/as-user` runs them as root, too.
#[allow(unused_macros)]
macro_rules! tests {
    ($($test:ident,)* $(; as_root: $($as_root:ident,)*)?) => {
        &[
            $((stringify!($test), $test as fn()),)*
            $($((concat!("as_root::", stringify!($as_root)), $as_root as fn()),)*)?
        ]
    };
}

#[allow(unused_imports)]
pub(crate) use tests;

/// The argument that has the program run the test of the name after it, and nothing else.
#[allow(dead_code)]
const ONE: &str = "--one";

/// The main function of a test program that starts itself again in roles: plays the role that it is asked for, or runs
/// the tests whose names contain one of the arguments.
///
/// Each test has a process of its own, because some count this process's descriptors. As many run at once as in other
/// test programs.
#[allow(dead_code)]
pub fn run(tests: &[(&str, fn())], play: fn(&str)) -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments[..] {
        [role, name] if role == "--role" => {
            play(name);
            return ExitCode::SUCCESS;
        }
        [one, name] if one == ONE => {
            let (_, test) = tests.iter().find(|(of, _)| of == name).expect("its name");
            test();
            return ExitCode::SUCCESS;
        }
        _ => {}
    }
    let filters: Vec<&String> = arguments
        .iter()
        .filter(|word| !word.starts_with('-'))
        .collect();
    let wanted = |name: &&str| {
        filters.is_empty() || filters.iter().any(|filter| name.contains(filter.as_str()))
    };
    let names: Vec<&str> = tests.iter().map(|(name, _)| *name).filter(wanted).collect();
    if arguments.iter().any(|word| word == "--list") {
        for name in names {
            println!("{name}: test");
        }
        return ExitCode::SUCCESS;
    }
    let program = std::env::current_exe().expect("this program");
    let next = Mutex::new(names.iter());
    let failed = AtomicU8::new(0);
    thread::scope(|scope| {
        for _ in 0..threads() {
            scope.spawn(|| {
                let take = || next.lock().expect("no thread has panicked").next();
                while let Some(name) = take() {
                    // A panic's message is on the standard error stream already.
                    let status = Command::new(&program).args([ONE, name]).status();
                    let is_ok = status.expect("a child process").success();
                    println!("test {name} ... {}", if is_ok { "ok" } else { "FAILED" });
                    failed.fetch_add(u8::from(!is_ok), Ordering::Relaxed);
                }
            });
        }
    });
    let failed = failed.into_inner();
    println!("test result: {failed} failed");
    ExitCode::from(u8::from(failed > 0))
}

/// How many tests run at once: what `RUST_TEST_THREADS` says, or one for each processor.
fn threads() -> usize {
    let asked = std::env::var("RUST_TEST_THREADS").ok();
    let asked = asked.and_then(|threads| threads.parse().ok());
    asked.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from))
}

/// A child process, which is killed with the test.
#[allow(dead_code)]
pub struct Role {
    pub child: Child,
    pub says: BufReader<ChildStdout>,
}

#[allow(dead_code)]
impl Role {
    pub fn start(domain: &Domain, role: &str) -> Role {
        let program = std::env::current_exe().expect("this program");
        Role::spawn(domain, role, Command::new(program))
    }

    /// Starts a role with a command that names a copy of this program, or another user.
    pub fn spawn(domain: &Domain, role: &str, mut command: Command) -> Role {
        command
            .args(["--role", role])
            .envs(domain.environment())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        // It inherits the umask.
        let child = files::while_no_port_opens(|| command.spawn());
        let mut child = child.expect("a child process");
        let says = BufReader::new(child.stdout.take().expect("its output"));
        Role { child, says }
    }

    /// Starts a role and waits until it is where the test wants it.
    pub fn ready(domain: &Domain, role: &str, says: &str) -> Role {
        let mut started = Role::start(domain, role);
        assert_eq!(started.next_line(), says, "{role}");
        started
    }

    pub fn next_line(&mut self) -> String {
        let mut line = String::new();
        self.says.read_line(&mut line).expect("a line");
        line.trim_end().to_owned()
    }

    pub fn signal(&self, signal: Signal) {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, signal).expect("a child that is not yet waited for takes signals");
    }

    /// `kill -9`, and waits until the kernel has done it.
    pub fn kill(&mut self) {
        self.child.kill().expect("kill");
        self.child.wait().expect("wait");
    }
}

impl Drop for Role {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
