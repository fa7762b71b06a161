//! What the tests share: a domain of their own with a watchdog, waiting with a limit, and the program itself as a child
//! process in a role.

use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command, ExitCode, Stdio};
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

/// As [`in_robot`], with the publisher and a subscriber of the same topic, which has entered the publisher's generation.
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

/// The tests of a program with a main function of its own, by their names.
#[allow(unused_macros)]
macro_rules! tests {
    ($($test:ident),* $(,)?) => {
        &[$((stringify!($test), $test as fn())),*]
    };
}

#[allow(unused_imports)]
pub(crate) use tests;

/// The main function of a test program that starts itself again in roles: plays the role that it is asked for, or runs
/// the tests whose names contain one of the arguments.
#[allow(dead_code)]
pub fn run(tests: &[(&str, fn())], play: fn(&str)) -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [role, name] = &arguments[..]
        && role == "--role"
    {
        play(name);
        return ExitCode::SUCCESS;
    }
    let wanted = |name: &str| {
        let mut filters = arguments
            .iter()
            .filter(|word| !word.starts_with('-'))
            .peekable();
        filters.peek().is_none() || filters.any(|filter| name.contains(filter.as_str()))
    };
    if arguments.iter().any(|word| word == "--list") {
        for (name, _) in tests {
            println!("{name}: test");
        }
        return ExitCode::SUCCESS;
    }
    let mut failed = 0;
    for (name, test) in tests.iter().filter(|(name, _)| wanted(name)) {
        // The panic's message is on the standard error stream already.
        let result = std::panic::catch_unwind(test);
        println!(
            "test {name} ... {}",
            if result.is_ok() { "ok" } else { "FAILED" }
        );
        failed += usize::from(result.is_err());
    }
    println!("test result: {failed} failed");
    ExitCode::from(u8::from(failed > 0))
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
