//! [`Screen`]: `ril` on a pseudo-terminal of which it is the foreground process, and what that terminal shows.

use ril_tests::{Sandbox, pty};
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Instant;

use ipc_types::files;
use ril_tests::process::{Signal, WAIT_LIMIT};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::ioctl_fionbio;
use rustix::process::{Pid, kill_process};
use rustix::termios::{Action, Termios, Winsize, tcflow, tcgetattr, tcsetwinsize};

/// A running `ril` and its terminal.
pub struct Screen {
    master: File,
    /// Keeps the terminal's settings when the process has ended.
    slave: File,
    child: Child,
    terminal: vt100::Parser,
    /// All that was written.
    pub bytes: Vec<u8>,
    before: Termios,
    errors: PathBuf,
}

impl Screen {
    /// Starts `ril` with these words on a terminal of this size.
    pub fn start(rig: &Sandbox, args: &str, columns: u16, rows: u16) -> Screen {
        Screen::start_with(rig, args, columns, rows, &[("TERM", "xterm-256color")])
    }

    /// Starts `ril` with these words on a terminal of this size, in an environment with these variables.
    pub fn start_with(
        rig: &Sandbox,
        args: &str,
        columns: u16,
        rows: u16,
        variables: &[(&str, &str)],
    ) -> Screen {
        let (master, name) = pty::open();
        set_size(&master, columns, rows);
        let slave = File::options().read(true).write(true).open(&name).unwrap();
        let before = tcgetattr(&slave).unwrap();
        let errors = rig.folder().join("watch.err");
        // The program that `setsid` becomes leads a session of which this is the terminal, as a shell's is.
        let mut command = Command::new("setsid");
        command
            .args(["--ctty", env!("CARGO_BIN_EXE_ril")])
            .args(args.split_whitespace());
        let mut command = rig.place(command);
        command
            .env_remove("NO_COLOR")
            .envs(rig.domain.environment())
            .envs(variables.iter().copied())
            .stdin(Stdio::from(OwnedFd::from(slave.try_clone().unwrap())))
            .stdout(Stdio::from(OwnedFd::from(slave.try_clone().unwrap())))
            .stderr(Stdio::from(OwnedFd::from(File::create(&errors).unwrap())));
        let child = files::while_no_port_opens(|| command.spawn()).unwrap();
        ioctl_fionbio(&master, true).unwrap();
        Screen {
            master,
            slave,
            child,
            terminal: vt100::Parser::new(rows, columns, 0),
            bytes: Vec::new(),
            before,
            errors,
        }
    }

    /// What the terminal shows.
    pub fn text(&self) -> String {
        self.terminal.screen().contents()
    }

    /// How often the bell rang.
    pub fn bells(&self) -> usize {
        self.bytes.iter().filter(|byte| **byte == 7).count()
    }

    /// Waits until the terminal shows `text`.
    #[track_caller]
    pub fn shows(&mut self, text: &str) {
        self.until(text, |screen| screen.contains(text));
    }

    /// Waits until the terminal shows `text` no more.
    #[track_caller]
    pub fn hides(&mut self, text: &str) {
        self.until(text, |screen| !screen.contains(text));
    }

    #[track_caller]
    pub fn until(&mut self, what: &str, is_right: impl Fn(&str) -> bool) {
        self.until_with(what, || {}, is_right);
    }

    /// Waits until `is_right`, and does `again` meanwhile, several times a second: what a publisher does that lives.
    #[track_caller]
    pub fn until_with(
        &mut self,
        what: &str,
        mut again: impl FnMut(),
        is_right: impl Fn(&str) -> bool,
    ) {
        let deadline = Instant::now() + WAIT_LIMIT;
        loop {
            let goes_on = self.take();
            if is_right(&self.text()) {
                return;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            let errors = std::fs::read_to_string(&self.errors).unwrap_or_default();
            assert!(
                goes_on && !left.is_zero(),
                "never: {what:?}; the screen is\n{}\nand the errors\n{errors}",
                self.text()
            );
            self.wait(left);
            again();
        }
    }

    /// Ends it by its key, after a prompt that may be open.
    #[track_caller]
    pub fn quits(mut self) {
        self.types("\x1b");
        self.until("no prompt", |screen| !screen.contains("and Enter >"));
        self.types("q");
        assert_eq!(self.ends(true).code(), Some(0), "{}", self.errors());
        self.is_as_before();
        assert_eq!(self.errors(), "");
    }

    /// Types `keys`.
    pub fn types(&mut self, keys: &str) {
        self.master.write_all(keys.as_bytes()).unwrap();
    }

    /// Gives the terminal another size, of which the kernel tells the process.
    pub fn resize(&mut self, columns: u16, rows: u16) {
        self.terminal.screen_mut().set_size(rows, columns);
        set_size(&self.master, columns, rows);
    }

    /// Stops the terminal's output, or lets it go on.
    pub fn flow(&self, action: Action) {
        tcflow(&self.slave, action).unwrap();
    }

    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Waits until the process has ended; what it wrote until then is read, unless `is_read` is false.
    pub fn ends(&mut self, is_read: bool) -> ExitStatus {
        let deadline = Instant::now() + WAIT_LIMIT;
        loop {
            if is_read {
                self.take();
            }
            if let Some(status) = self.child.try_wait().unwrap() {
                self.take();
                return status;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            assert!(!left.is_zero(), "it never ends");
            self.wait(left.min(std::time::Duration::from_millis(20)));
        }
    }

    /// What it wrote to standard error.
    pub fn errors(&self) -> String {
        std::fs::read_to_string(&self.errors).unwrap()
    }

    /// Whether the terminal is as it was before: settings, screen and cursor.
    #[track_caller]
    pub fn is_as_before(&self) {
        let after = tcgetattr(&self.slave).unwrap();
        assert_eq!(format!("{:?}", self.before), format!("{after:?}"));
        let screen = self.terminal.screen();
        assert!(!screen.alternate_screen() && !screen.hide_cursor());
    }

    /// Takes what was written; says whether more may come.
    fn take(&mut self) -> bool {
        let mut buffer = [0; 4096];
        loop {
            match self.master.read(&mut buffer) {
                Ok(0) => return false,
                Ok(count) => {
                    self.bytes.extend_from_slice(&buffer[..count]);
                    self.terminal.process(&buffer[..count]);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    return self.child.try_wait().unwrap().is_none();
                }
                Err(_) => return false,
            }
        }
    }

    fn wait(&self, at_most: std::time::Duration) {
        let mut polled = [PollFd::new(&self.master, PollFlags::IN)];
        // The end of the process is no event of its terminal.
        let bound = at_most.min(std::time::Duration::from_millis(250));
        let _ = poll(&mut polled, Some(&Timespec::try_from(bound).unwrap()));
    }
}

/// What `ril` writes on a terminal of 80 × 24, line by line; it must end with `code`. Standard error is a file.
#[track_caller]
pub fn on_terminal(rig: &Sandbox, args: &str, code: i32) -> Vec<String> {
    let mut screen = Screen::start(rig, args, 80, 24);
    let status = screen.ends(true);
    let text = String::from_utf8(std::mem::take(&mut screen.bytes)).unwrap();
    assert_eq!(status.code(), Some(code), "ril {args}: {text}");
    let lines: Vec<String> = text
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect();
    for line in &lines {
        assert!(line.chars().count() <= 80, "ril {args}: {line:?} wraps");
    }
    assert!(!lines.is_empty(), "ril {args} wrote nothing");
    lines
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn set_size(master: &File, columns: u16, rows: u16) {
    let size = Winsize {
        ws_row: rows,
        ws_col: columns,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    tcsetwinsize(master, size).unwrap();
}
