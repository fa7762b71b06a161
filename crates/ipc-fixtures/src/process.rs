//! [`Process`]: a child process in a test's domain, whose lines are read in the background.
//!
//! It is the leader of a process group of its own, so that whatever it starts can be killed with it, and so that a
//! Ctrl+C can be played to all of them as a terminal would. Nothing here polls: lines, the ends of the streams and the
//! exit of the process all arrive over one channel.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use ipc_types::{Domain, files};
use rustix::io::Errno;
use rustix::process::{Pid, WaitId, WaitIdOptions, kill_process, kill_process_group, waitid};

pub use rustix::process::Signal;

/// How long a wait of this module lasts at most. Shorter than the watchdog's limit, because the failure of a wait shows
/// what the process has printed.
pub const WAIT_LIMIT: Duration = Duration::from_secs(90);

/// Longest line, bytes; a longer one comes in pieces.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// Most lines that are kept of one process: half an hour of a sample each, fifty a second, and some more. What comes
/// after that is read and dropped, so that the process never blocks.
const MAX_LINES: usize = 100_000;

/// Lines that are shown of a process when a test fails.
const SHOWN_LINES: usize = 60;

/// Where a line was printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Standard output: data.
    Stdout,
    /// Standard error: diagnostics.
    Stderr,
}

/// A line that a process has printed, without its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Where.
    pub stream: Stream,
    /// What; bytes that are not UTF-8 are replaced.
    pub text: String,
}

/// How a process ended, and everything that it has printed.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Program and arguments.
    pub command: String,
    /// Exit code or signal.
    pub status: ExitStatus,
    /// Lines of standard output.
    pub stdout: Vec<String>,
    /// Lines of standard error.
    pub stderr: Vec<String>,
}

impl Finished {
    /// The exit code, or `None` if a signal ended the process.
    pub fn code(&self) -> Option<i32> {
        self.status.code()
    }

    /// Asserts that a line of standard output contains `text`.
    #[track_caller]
    pub fn out_says(&self, text: impl AsRef<str>) -> &Finished {
        let text = text.as_ref();
        assert!(says(&self.stdout, text), "{text}: {self:#?}");
        self
    }

    /// Asserts that a line of standard error contains `text`.
    #[track_caller]
    pub fn err_says(&self, text: impl AsRef<str>) -> &Finished {
        let text = text.as_ref();
        assert!(says(&self.stderr, text), "{text}: {self:#?}");
        self
    }
}

/// Whether one of the lines contains `text`.
pub fn says(lines: &[String], text: &str) -> bool {
    lines.iter().any(|line| line.contains(text))
}

/// What the threads in the background report.
enum Event {
    Line(Line),
    StreamEnded,
    Exited,
}

/// A child process in a process group of its own. Killed when dropped, with everything that it has started.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    group: Pid,
    events: Receiver<Event>,
    lines: Vec<Line>,
    /// Of each line, whether a wait has returned it.
    found: Vec<bool>,
    open_streams: usize,
    exited: bool,
    status: Option<ExitStatus>,
}

impl Process {
    /// Starts `program` with `args` in `domain`.
    ///
    /// # Panics
    ///
    /// When it cannot be started, with the reason.
    pub fn start<A: AsRef<std::ffi::OsStr>>(
        domain: &Domain,
        program: impl AsRef<std::ffi::OsStr>,
        args: impl IntoIterator<Item = A>,
    ) -> Process {
        let mut command = Command::new(program);
        command.args(args);
        Process::spawn(domain, command)
    }

    /// Starts `command` in `domain`: for those who set more than arguments. Its standard input is empty, its output is
    /// captured.
    ///
    /// # Panics
    ///
    /// When it cannot be started, with the reason.
    pub fn spawn(domain: &Domain, command: Command) -> Process {
        Process::spawn_with_stderr(domain, command, Stdio::piped())
    }

    /// As [`Process::spawn`], with this standard error, of which only a pipe is captured.
    ///
    /// # Panics
    ///
    /// When it cannot be started, with the reason.
    pub fn spawn_with_stderr(domain: &Domain, mut command: Command, stderr: Stdio) -> Process {
        let name = describe(&command);
        command
            .envs(domain.environment())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(stderr)
            .process_group(0);
        // It inherits the umask.
        let mut child = match files::while_no_port_opens(|| command.spawn()) {
            Ok(child) => child,
            Err(error) => panic!("`{name}` cannot be started: {error}"),
        };
        let group = Pid::from_child(&child);
        registry().insert(group.as_raw_pid(), name.clone());
        let (sender, events) = mpsc::channel();
        let stdout = child.stdout.take().expect("it is piped");
        read_lines(Stream::Stdout, stdout, sender.clone());
        let stderr = child.stderr.take();
        let open_streams = 1 + usize::from(stderr.is_some());
        if let Some(stderr) = stderr {
            read_lines(Stream::Stderr, stderr, sender.clone());
        }
        await_exit(group, sender);
        Process {
            name,
            child,
            group,
            events,
            lines: Vec::new(),
            found: Vec::new(),
            open_streams,
            exited: false,
            status: None,
        }
    }

    /// The process's id, which is that of its group as well.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for a line that `predicate` accepts, and returns it. Lines that were printed before count too; each line
    /// is returned once.
    ///
    /// # Panics
    ///
    /// When the process has ended without such a line, or after [`WAIT_LIMIT`], with what it has printed.
    #[track_caller]
    pub fn wait_for_line(&mut self, predicate: impl FnMut(&Line) -> bool) -> Line {
        self.wait_for_line_within(WAIT_LIMIT, predicate)
    }

    /// As [`Process::wait_for_line`], for at most `limit`: for what is silent for longer than a test.
    ///
    /// # Panics
    ///
    /// As [`Process::wait_for_line`].
    #[track_caller]
    pub fn wait_for_line_within(
        &mut self,
        limit: Duration,
        mut predicate: impl FnMut(&Line) -> bool,
    ) -> Line {
        let deadline = Instant::now() + limit;
        let mut next = 0;
        loop {
            while let Some(line) = self.lines.get(next) {
                if !self.found[next] && predicate(line) {
                    self.found[next] = true;
                    return line.clone();
                }
                next += 1;
            }
            if self.open_streams == 0 {
                panic!("`{}` ended without the line\n{}", self.name, self.tail());
            }
            self.take_event(deadline, "prints the line");
        }
    }

    /// Waits for a line on standard output or standard error that contains `text`.
    ///
    /// # Panics
    ///
    /// As [`Process::wait_for_line`].
    #[track_caller]
    pub fn wait_for_text(&mut self, text: &str) -> Line {
        self.wait_for_line(|line| line.text.contains(text))
    }

    /// The lines that have arrived so far, of both streams, each in order.
    pub fn lines(&mut self) -> &[Line] {
        while let Ok(event) = self.events.try_recv() {
            self.note(event);
        }
        &self.lines
    }

    /// Sends `signal` to the process alone, as `kill` does.
    ///
    /// # Panics
    ///
    /// When the process has ended and its exit was taken.
    #[track_caller]
    pub fn signal(&self, signal: Signal) {
        assert!(self.status.is_none(), "`{}` has ended already", self.name);
        if let Err(error) = kill_process(self.group, signal) {
            panic!("`{}` cannot be sent {signal:?}: {error}", self.name);
        }
    }

    /// Sends `signal` to the process and everything that it has started, as a terminal does for Ctrl+C.
    ///
    /// # Panics
    ///
    /// When the process has ended and its exit was taken.
    #[track_caller]
    pub fn signal_group(&self, signal: Signal) {
        assert!(self.status.is_none(), "`{}` has ended already", self.name);
        if let Err(error) = kill_process_group(self.group, signal) {
            panic!(
                "the group of `{}` cannot be sent {signal:?}: {error}",
                self.name
            );
        }
    }

    /// Waits until the process has ended, whatever it has started.
    ///
    /// # Panics
    ///
    /// After [`WAIT_LIMIT`], with what it has printed.
    #[track_caller]
    pub fn wait_status(&mut self) -> ExitStatus {
        let deadline = Instant::now() + WAIT_LIMIT;
        while !self.exited {
            self.take_event(deadline, "ends");
        }
        self.reap()
    }

    /// Waits until the process has ended and nobody holds its output any more, and returns all of that.
    ///
    /// # Panics
    ///
    /// After [`WAIT_LIMIT`]; that something which the process has started still runs is such a case.
    #[track_caller]
    pub fn wait_exit(&mut self) -> Finished {
        let status = self.wait_status();
        let deadline = Instant::now() + WAIT_LIMIT;
        while self.open_streams > 0 {
            self.take_event(deadline, "has nothing left running that holds its output");
        }
        Finished {
            command: self.name.clone(),
            status,
            stdout: self.text_of(Stream::Stdout),
            stderr: self.text_of(Stream::Stderr),
        }
    }

    /// As [`Process::wait_exit`]; the exit code must be this one.
    #[track_caller]
    pub fn exits(&mut self, code: i32) -> Finished {
        let finished = self.wait_exit();
        assert_eq!(finished.code(), Some(code), "{finished:#?}");
        finished
    }

    /// Ends the process in order, and returns what it has printed.
    ///
    /// # Panics
    ///
    /// When its exit code is not 0; as [`Process::wait_exit`].
    #[track_caller]
    pub fn end(mut self) -> Finished {
        self.signal(Signal::TERM);
        self.exits(0)
    }

    /// Whether the process runs, by what the kernel says at this moment.
    pub fn is_running(&self) -> bool {
        if self.status.is_some() {
            return false;
        }
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.id()));
        // The program's name, in parentheses, may have any character in it.
        let stat = stat.unwrap_or_default();
        let state = stat.rsplit(')').next().unwrap_or_default().trim_start();
        !state.is_empty() && !state.starts_with(['Z', 'X'])
    }

    /// Takes one event; fails when none comes before `deadline`.
    #[track_caller]
    fn take_event(&mut self, deadline: Instant, what: &str) {
        let remaining = deadline.saturating_duration_since(Instant::now());
        match self.events.recv_timeout(remaining) {
            Ok(event) => self.note(event),
            Err(error) => {
                let (name, tail) = (&self.name, self.tail());
                panic!("never in time: `{name}` {what} ({error})\n{tail}");
            }
        }
    }

    fn note(&mut self, event: Event) {
        match event {
            Event::Line(line) if self.lines.len() < MAX_LINES => {
                self.lines.push(line);
                self.found.push(false);
            }
            Event::Line(_) => {}
            Event::StreamEnded => self.open_streams -= 1,
            Event::Exited => self.exited = true,
        }
    }

    /// Takes the exit status, which frees the process's id.
    #[track_caller]
    fn reap(&mut self) -> ExitStatus {
        if let Some(status) = self.status {
            return status;
        }
        let status = match self.child.wait() {
            Ok(status) => status,
            Err(error) => panic!("`{}` cannot be waited for: {error}", self.name),
        };
        self.status = Some(status);
        status
    }

    fn text_of(&self, stream: Stream) -> Vec<String> {
        self.lines
            .iter()
            .filter(|line| line.stream == stream)
            .map(|line| line.text.clone())
            .collect()
    }

    /// The last lines, to be shown when a test fails.
    fn tail(&self) -> String {
        let skipped = self.lines.len().saturating_sub(SHOWN_LINES);
        let mut text = format!("--- `{}` has printed (", self.name);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{skipped} lines before that):");
        for line in &self.lines[skipped..] {
            let mark = match line.stream {
                Stream::Stdout => "out",
                Stream::Stderr => "err",
            };
            let _ = writeln!(text, "{mark} | {}", line.text);
        }
        text.push_str("---");
        text
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // A group without any process has lost its id, which may be another's by now. Whatever was started in it holds
        // the output, unless it has put it elsewhere.
        if self.status.is_none() || self.open_streams > 0 {
            let _ = kill_process_group(self.group, Signal::KILL);
        }
        if self.status.is_none() {
            let _ = self.child.wait();
        }
        registry().remove(&self.group.as_raw_pid());
        if thread::panicking() {
            while let Ok(event) = self.events.try_recv() {
                self.note(event);
            }
            eprintln!("{}", self.tail());
        }
    }
}

/// Kills every process of this module that still runs, with its group: the watchdog's last act.
pub(crate) fn kill_all() {
    for group in registry().keys().filter_map(|group| Pid::from_raw(*group)) {
        let _ = kill_process_group(group, Signal::KILL);
    }
}

/// What [`kill_all`] would kill.
pub(crate) fn list() -> Vec<String> {
    registry()
        .iter()
        .map(|(group, name)| format!("{name} (process {group})"))
        .collect()
}

/// All processes that were not dropped yet, by group. The one lock of this library: tests run on several threads, and
/// the watchdog must find the children of all of them.
fn registry() -> MutexGuard<'static, BTreeMap<i32, String>> {
    static REGISTRY: Mutex<BTreeMap<i32, String>> = Mutex::new(BTreeMap::new());
    // A test that panicked while it held the lock has not left it half changed.
    REGISTRY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The program's file name and its arguments.
fn describe(command: &Command) -> String {
    let program = std::path::Path::new(command.get_program());
    let mut name = program
        .file_name()
        .unwrap_or(command.get_program())
        .to_string_lossy()
        .into_owned();
    for argument in command.get_args() {
        name.push(' ');
        name.push_str(&argument.to_string_lossy());
    }
    name
}

fn read_lines(stream: Stream, source: impl Read + Send + 'static, events: Sender<Event>) {
    thread::spawn(move || {
        let mut reader = BufReader::new(source);
        let mut bytes = Vec::new();
        loop {
            bytes.clear();
            let read = (&mut reader)
                .take(MAX_LINE_BYTES)
                .read_until(b'\n', &mut bytes);
            // A stream that fails has ended.
            if read.unwrap_or(0) == 0 {
                break;
            }
            let text = String::from_utf8_lossy(&bytes);
            let text = text.trim_end_matches(['\n', '\r']).to_owned();
            // Nobody listens any more once the process was dropped; reading goes on until the stream's end all the
            // same.
            let _ = events.send(Event::Line(Line { stream, text }));
        }
        let _ = events.send(Event::StreamEnded);
    });
}

fn await_exit(child: Pid, events: Sender<Event>) {
    thread::spawn(move || {
        // The exit is only looked at, so that the id stays the child's until its owner takes the status.
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
        while matches!(waitid(WaitId::Pid(child), options), Err(Errno::INTR)) {}
        let _ = events.send(Event::Exited);
    });
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;
    use crate::domain::TestDomain;

    fn shell(domain: &Domain, script: &str) -> Process {
        Process::start(domain, "/bin/sh", ["-c", script])
    }

    #[test]
    fn lines_are_found_in_any_order_and_each_once() {
        let domain = TestDomain::new();
        let mut process = shell(&domain, "echo one; echo two >&2; echo one; printf three");
        assert_eq!(process.wait_for_text("two").stream, Stream::Stderr);
        assert_eq!(process.wait_for_text("one").stream, Stream::Stdout);
        process.wait_for_text("one");
        let finished = process.wait_exit();
        assert_eq!(finished.code(), Some(0));
        assert_eq!(finished.stdout, ["one", "one", "three"]);
        assert_eq!(finished.stderr, ["two"]);
        let failure = catch_unwind(AssertUnwindSafe(|| process.wait_for_text("one")));
        let failure = failure.expect_err("there is no third");
        let text = failure.downcast_ref::<String>().expect("a text");
        assert!(text.contains("ended without the line"), "{text}");
        assert!(text.contains("err | two"), "{text}");
    }

    #[test]
    fn a_child_gets_the_domain() {
        let domain = TestDomain::new();
        let mut process = shell(&domain, "echo $RIL_IPC_ROOT");
        let root = domain.root().to_str().expect("ASCII");
        assert_eq!(process.wait_exit().stdout, [root]);
    }

    #[test]
    fn a_signal_reaches_the_child_and_its_exit_says_so() {
        use std::os::unix::process::ExitStatusExt;
        let domain = TestDomain::new();
        // It runs in circles for the moment until the signal: a shell that waits can miss one just before it does. And
        // it is no SIGINT, which a shell cannot trap when the tests run in the background of another one.
        let trap = "trap 'exit 3' TERM; echo ready; while :; do :; done";
        let none = "echo ready; exec tail -f /dev/null";
        for (script, signal, code, number) in [
            (trap, Signal::TERM, Some(3), None),
            (none, Signal::TERM, None, Some(15)),
            (none, Signal::KILL, None, Some(9)),
        ] {
            let mut process = shell(&domain, script);
            process.wait_for_text("ready");
            process.signal(signal);
            let status = process.wait_exit().status;
            assert_eq!((status.code(), status.signal()), (code, number));
        }
    }

    #[test]
    fn what_a_child_has_started_outlives_it_and_ends_with_its_group() {
        let domain = TestDomain::new();
        let mut process = shell(&domain, "tail -f /dev/null & exit 4");
        assert_eq!(process.wait_status().code(), Some(4));
        assert_eq!(process.open_streams, 2, "the grandchild holds them");
        assert!(list().iter().any(|name| name.contains("tail -f")));
        let group = process.group;
        let events = std::mem::replace(&mut process.events, mpsc::channel().1);
        drop(process);
        let mut ended = 0;
        while ended < 2 {
            let events = events.recv_timeout(WAIT_LIMIT).expect("it is killed");
            ended += usize::from(matches!(events, Event::StreamEnded));
        }
        assert!(!registry().contains_key(&group.as_raw_pid()));
    }

    #[test]
    fn bytes_without_end_do_not_hold_up_the_child() {
        let domain = TestDomain::new();
        let script = "head -c 3000000 /dev/zero; yes | head -n 150000; echo done >&2";
        let mut process = shell(&domain, script);
        let finished = process.wait_exit();
        assert_eq!(finished.stdout[0].len() as u64, MAX_LINE_BYTES);
        assert!(process.lines.len() <= MAX_LINES);
    }
}
