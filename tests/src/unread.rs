//! [`UnreadOutput`]: standard error that nobody reads. A process whose log it is must go on as if somebody did.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::{UnixDatagram, UnixStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{CWD, Mode, OFlags, fcntl_setfl, mkfifoat};
use rustix::net::{SendFlags, send};
use rustix::termios::{Action, tcflow};

use crate::process::{Process, WAIT_LIMIT};
use crate::pty;
use crate::sandbox::Sandbox;

/// What standard error is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// A named pipe in the folder of the sandbox.
    Pipe,
    /// One end of a connection, as journald gives it to services.
    Socket,
    /// A terminal, whose output Ctrl+S stops.
    Terminal,
}

/// Standard error of the processes that it starts.
#[derive(Debug)]
pub struct UnreadOutput {
    kind: OutputKind,
    /// The processes' end.
    writer: OwnedFd,
    /// The other end, which is there as long as this.
    other: File,
    /// Reads it until the flag is set, and says how many bytes came.
    reader: Option<(Arc<AtomicBool>, JoinHandle<usize>)>,
}

impl UnreadOutput {
    /// Name of the pipe, for the redirections of a shell.
    pub const NAME: &'static str = "unread";

    /// A pipe that is full.
    ///
    /// # Panics
    ///
    /// When it cannot be made.
    pub fn full(sandbox: &Sandbox) -> UnreadOutput {
        let unread = UnreadOutput::new(sandbox, OutputKind::Pipe);
        unread.fill();
        unread
    }

    /// One that is read until [`stop_reading`](UnreadOutput::stop_reading).
    ///
    /// # Panics
    ///
    /// When it cannot be made.
    pub fn read(sandbox: &Sandbox, kind: OutputKind) -> UnreadOutput {
        let mut unread = UnreadOutput::new(sandbox, kind);
        let mut other = unread.other.try_clone().expect("a descriptor");
        let is_over = Arc::<AtomicBool>::default();
        let stop = Arc::clone(&is_over);
        let reader = thread::spawn(move || {
            let (mut bytes, mut count) = (vec![0; 1 << 16], 0);
            while !is_over.load(Ordering::Relaxed) {
                // Processes that trace their wakes always have something more.
                let _ = poll(&mut [PollFd::new(&other, PollFlags::IN)], None);
                count += other.read(&mut bytes).unwrap_or(0);
            }
            count
        });
        unread.reader = Some((stop, reader));
        unread
    }

    fn new(sandbox: &Sandbox, kind: OutputKind) -> UnreadOutput {
        let path = sandbox.path(UnreadOutput::NAME);
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        let (writer, other): (OwnedFd, File) = match kind {
            OutputKind::Pipe => {
                mkfifoat(CWD, &path, Mode::RUSR | Mode::WUSR).expect("a named pipe");
                let other = options.open(&path).expect("it opens");
                let writer = OpenOptions::new().write(true).open(path);
                (writer.expect("it opens").into(), other)
            }
            OutputKind::Socket => {
                let (writer, other) = UnixStream::pair().expect("a connection");
                (writer.into(), OwnedFd::from(other).into())
            }
            OutputKind::Terminal => {
                let (other, terminal) = pty::open();
                options.custom_flags(OFlags::NOCTTY.bits() as i32);
                (options.open(terminal).expect("it opens").into(), other)
            }
        };
        fcntl_setfl(&other, OFlags::NONBLOCK).expect("an end that does not wait");
        UnreadOutput {
            kind,
            writer,
            other,
            reader: None,
        }
    }

    fn fill(&self) {
        let some = [b'x'; 4096];
        match self.kind {
            OutputKind::Pipe => {
                for size in [some.len(), 1] {
                    while (&self.other).write(&some[..size]).is_ok() {}
                }
            }
            OutputKind::Socket => while send(&self.writer, &some, SendFlags::DONTWAIT).is_ok() {},
            OutputKind::Terminal => tcflow(&self.writer, Action::OOff).expect("a terminal"),
        }
    }

    /// From here on nobody reads it, and it is full, or stopped.
    ///
    /// # Panics
    ///
    /// When nothing was read until now.
    #[track_caller]
    pub fn stop_reading(&mut self) {
        let (stop, reader) = self.reader.take().expect("it is read");
        stop.store(true, Ordering::Relaxed);
        assert!(
            reader.join().expect("a reader") > 0,
            "something was printed"
        );
        self.fill();
    }

    /// Starts `ril` with this standard error, to which it traces everything, and returns when its supervisor knows that
    /// it is ready. `args` are words of a shell.
    ///
    /// # Panics
    ///
    /// When it is not ready in time.
    #[track_caller]
    pub fn start(&self, sandbox: &Sandbox, args: &str) -> Process {
        let name = sandbox.path("supervisor");
        let supervisor = UnixDatagram::bind(&name).expect("a socket");
        let limit = supervisor.set_read_timeout(Some(WAIT_LIMIT));
        limit.expect("a limit of time");
        let mut command = sandbox.shell(&format!("exec \"$0\" {args} -vv"));
        command.env("NOTIFY_SOCKET", &name);
        command.env("XDG_RUNTIME_DIR", sandbox.folder());
        let stderr = self.writer.try_clone().expect("a descriptor");
        let process = Process::spawn_with_stderr(&sandbox.domain, command, stderr.into());
        let mut message = [0; 64];
        match supervisor.recv(&mut message) {
            Ok(count) => assert_eq!(&message[..count], b"READY=1", "{args}"),
            Err(error) => panic!("`{args}` is not ready: {error}"),
        }
        fs::remove_file(name).expect("the socket");
        process
    }
}
