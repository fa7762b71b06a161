//! The processes of the demonstration: each a child of its own, in a process group of its own so that Ctrl+C reaches
//! only the demonstration, which ends them in order. None of them outlives it.

use std::fs::{self, File};
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ipc_types::Domain;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::signal::WITH_PARENT;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

/// How long a process may take to end after SIGTERM before it is killed. It takes milliseconds; machines stall.
pub const END_WITHIN: Duration = Duration::from_secs(10);

/// Lines of a process's own output that are shown when it failed.
const SHOWN_LINES: usize = 5;

/// This program, to be started once more.
fn own() -> Result<Command, Failure> {
    let program = std::env::current_exe().or_fail(ExitCode::Internal)?;
    Ok(Command::new(program))
}

/// A running process.
#[derive(Debug)]
pub struct ChildProcess {
    name: &'static str,
    child: Child,
    pidfd: OwnedFd,
    output: PathBuf,
    /// Its exit code once it was waited for; `None` inside if a signal killed it.
    ended: Option<Option<i32>>,
}

/// Where processes are started.
#[derive(Debug)]
pub struct Spawner<'a> {
    /// The shared memory that they use.
    pub domain: &'a Domain,
    /// The robot.
    pub robot: u32,
    /// Folder for their configurations and outputs.
    pub folder: &'a Path,
    /// Where they say that they are ready.
    pub readiness: &'a Readiness,
}

impl Spawner<'_> {
    /// Where the configuration of the process `name` lies.
    pub fn config_file(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.toml"))
    }

    /// Starts the process `name` by `ril run` with its configuration. It says on [`Readiness`] when it is ready.
    pub fn start(&self, name: &'static str, args: &[&str]) -> Result<ChildProcess, Failure> {
        let mut command = own()?;
        command.args(["run", name, "--config"]);
        command.arg(self.config_file(name)).args(args);
        self.spawn(name, command)
    }

    /// Starts the recorder, which records the configurations along.
    pub fn start_recorder(&self) -> Result<ChildProcess, Failure> {
        let mut command = own()?;
        // A few megabytes, however full the disk is.
        command.args(["record", "--min-free", "0", "--output"]);
        command.arg(self.folder);
        for name in ["bridge", "status"] {
            command.arg(format!("--{name}")).arg(self.config_file(name));
        }
        self.spawn("record", command)
    }

    /// Starts the relay of this `side`, `robot` or `station`, with its configuration.
    pub fn start_relay(&self, side: &str, args: &[&str]) -> Result<ChildProcess, Failure> {
        let mut command = own()?;
        command.args(["relay", side, "--config"]);
        command.arg(self.config_file("relay")).args(args);
        self.spawn("relay", command)
    }

    /// Gives a command of the operator, in the folder, where no configuration of the user's is. It is patient: a
    /// machine may stall.
    pub fn order(&self, name: &'static str, words: &[&str]) -> Result<ChildProcess, Failure> {
        let mut command = own()?;
        command
            .args(words)
            .args(["--timeout", "60s", "--deadline", "60s"]);
        command.current_dir(self.folder);
        self.spawn(name, command)
    }

    fn spawn(&self, name: &'static str, command: Command) -> Result<ChildProcess, Failure> {
        let spawned = self.try_spawn(name, command);
        spawned.or_fail_with(
            ExitCode::Internal,
            format!("the process {name} cannot be started"),
        )
    }

    fn try_spawn(&self, name: &'static str, mut command: Command) -> io::Result<ChildProcess> {
        let output = self.folder.join(format!("{name}.out"));
        let out = File::create(&output)?;
        command
            .args(["--robot", &self.robot.to_string()])
            .envs(self.domain.environment())
            .env(WITH_PARENT, "1")
            .env("NOTIFY_SOCKET", self.readiness.address())
            // What was meant for a supervisor of the demonstration is not meant for its children.
            .env_remove("WATCHDOG_USEC")
            .env_remove("RIL_PORT")
            .env_remove("RIL_CONFIG")
            .stdin(Stdio::null())
            .stdout(out.try_clone()?)
            .stderr(out)
            .process_group(0);
        let child = command.spawn()?;
        let pid = Pid::from_child(&child);
        Ok(ChildProcess {
            name,
            child,
            pidfd: pidfd_open(pid, PidfdFlags::empty())?,
            output,
            ended: None,
        })
    }
}

impl ChildProcess {
    /// Its name, as behind `ril run`; that of the recorder and of the operator's commands as behind `ril`.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The number of the process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends it a signal, unless it has ended.
    pub fn signal(&self, signal: Signal) {
        // It may end at this moment.
        let _ = pidfd_send_signal(&self.pidfd, signal);
    }

    /// Whether it has ended; asking never waits.
    pub fn has_ended(&mut self) -> bool {
        if self.ended.is_none()
            && let Ok(Some(status)) = self.child.try_wait()
        {
            self.ended = Some(status.code());
        }
        self.ended.is_some()
    }

    /// Asks it to end.
    pub fn ask_to_end(&self) {
        self.signal(Signal::TERM);
        // One that was stopped takes the signal when it goes on.
        self.signal(Signal::CONT);
    }

    /// Ends it with SIGTERM, by force if it takes too long; its exit code, `None` if it had to be killed.
    pub fn end(&mut self) -> Option<i32> {
        if !self.has_ended() {
            self.ask_to_end();
            if !self.wait_ended(END_WITHIN) {
                let _ = self.child.kill();
            }
            if let Ok(status) = self.child.wait() {
                self.ended = Some(status.code());
            }
        }
        self.ended.flatten()
    }

    fn wait_ended(&self, within: Duration) -> bool {
        let deadline = Instant::now() + within;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let timeout = Timespec {
                tv_sec: left.as_secs() as i64,
                tv_nsec: i64::from(left.subsec_nanos()),
            };
            let mut ready = [PollFd::new(&self.pidfd, PollFlags::IN)];
            match poll(&mut ready, Some(&timeout)) {
                Ok(0) => return false,
                Ok(_) => return true,
                // A signal for the demonstration does not shorten the time that its children have.
                Err(rustix::io::Errno::INTR) => {}
                Err(_) => return false,
            }
        }
    }

    /// The last lines of its output, for a message.
    pub fn last_words(&self) -> String {
        let text = fs::read_to_string(&self.output).unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(SHOWN_LINES)..].join("\n")
    }
}

/// Readable when the process has ended.
impl AsFd for ChildProcess {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pidfd.as_fd()
    }
}

impl Drop for ChildProcess {
    fn drop(&mut self) {
        self.end();
    }
}

/// Where processes say that they are ready: the socket of a supervisor, in Linux's abstract namespace, so that no file
/// is left behind.
#[derive(Debug)]
pub struct Readiness {
    socket: UnixDatagram,
    name: String,
}

impl Readiness {
    /// A socket that only this process has.
    pub fn new() -> io::Result<Readiness> {
        let name = format!("hero-demo-{}", std::process::id());
        let socket = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(&name)?)?;
        socket.set_nonblocking(true)?;
        Ok(Readiness { socket, name })
    }

    /// Its address as a supervisor writes it.
    fn address(&self) -> String {
        format!("@{}", self.name)
    }

    /// How many processes have said since the last call that they are ready.
    pub fn drain(&self) -> usize {
        let mut buffer = [0; 256];
        let mut count = 0;
        while let Ok(len) = self.socket.recv(&mut buffer) {
            count += usize::from(buffer[..len].starts_with(b"READY=1"));
        }
        count
    }
}

impl AsFd for Readiness {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}
