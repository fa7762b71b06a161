//! [`UnreadPipe`]: standard error that nobody reads. A process whose log it is must go on as if somebody did.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixDatagram;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{CWD, Mode, OFlags, mkfifoat};

use crate::process::{Process, WAIT_LIMIT};
use crate::sandbox::Sandbox;

/// A named pipe in the folder of a sandbox, which is standard error of the processes that it starts.
#[derive(Debug)]
pub struct UnreadPipe {
    pipe: File,
    /// Reads it until the flag is set, and says how many bytes came.
    reader: Option<(Arc<AtomicBool>, JoinHandle<usize>)>,
}

impl UnreadPipe {
    /// Its name, for the redirections of a shell.
    pub const NAME: &'static str = "unread";

    /// One that is full.
    ///
    /// # Panics
    ///
    /// When it cannot be made.
    pub fn full(sandbox: &Sandbox) -> UnreadPipe {
        let unread = UnreadPipe::new(sandbox);
        unread.fill();
        unread
    }

    /// One that is read until [`stop_reading`](UnreadPipe::stop_reading).
    ///
    /// # Panics
    ///
    /// When it cannot be made.
    pub fn read(sandbox: &Sandbox) -> UnreadPipe {
        let mut unread = UnreadPipe::new(sandbox);
        let mut pipe = unread.pipe.try_clone().expect("a descriptor");
        let is_over = Arc::<AtomicBool>::default();
        let stop = Arc::clone(&is_over);
        let reader = thread::spawn(move || {
            let (mut bytes, mut count) = (vec![0; 1 << 16], 0);
            while !is_over.load(Ordering::Relaxed) {
                // Processes that trace their wakes always have something more.
                let _ = poll(&mut [PollFd::new(&pipe, PollFlags::IN)], None);
                count += pipe.read(&mut bytes).unwrap_or(0);
            }
            count
        });
        unread.reader = Some((stop, reader));
        unread
    }

    fn new(sandbox: &Sandbox) -> UnreadPipe {
        let path = sandbox.path(UnreadPipe::NAME);
        mkfifoat(CWD, &path, Mode::RUSR | Mode::WUSR).expect("a named pipe");
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        options.custom_flags(OFlags::NONBLOCK.bits() as i32);
        let pipe = options.open(path).expect("it opens");
        UnreadPipe { pipe, reader: None }
    }

    fn fill(&self) {
        for size in [4096, 1] {
            while (&self.pipe).write(&vec![b'x'; size]).is_ok() {}
        }
    }

    /// From here on nobody reads it, and it is full.
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

    /// Starts `ril` with this pipe as its standard error, to which it traces everything, and returns when its
    /// supervisor knows that it is ready. `args` are words of a shell.
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
        let mut command = sandbox.shell(&format!("exec \"$0\" {args} -vv 2>{}", UnreadPipe::NAME));
        command.env("NOTIFY_SOCKET", &name);
        command.env("XDG_RUNTIME_DIR", sandbox.folder());
        let process = sandbox.spawn(command);
        let mut message = [0; 64];
        match supervisor.recv(&mut message) {
            Ok(count) => assert_eq!(&message[..count], b"READY=1", "{args}"),
            Err(error) => panic!("`{args}` is not ready: {error}"),
        }
        fs::remove_file(name).expect("the socket");
        process
    }
}
