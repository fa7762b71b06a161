//! [`Terminal`]: takes the terminal, and gives it back as it was, whatever ends the process: its own end, a signal, a panic.
//!
//! Writing never waits: a terminal that takes nothing, such as an ssh connection that hangs, must not keep the process from its orders
//! and its end. What it has not taken is written later, and no other picture before it is through.

mod guard;

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, IsTerminal, Read};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ipc_types::Descriptor;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use runtime::exit::Failure;
use rustix::fs::OFlags;
use rustix::io::Errno;
use rustix::stdio::{stdin, stdout};
use rustix::termios::ttyname;
use signal_hook::consts::{SIGCONT, SIGHUP, SIGQUIT, SIGWINCH};
use signal_hook::low_level::{pipe, unregister};
use signal_hook::{SigId, flag};

use super::paint;
use crate::render::terminal::Size;
use guard::Guard;

/// Largest screen that is drawn, to each side: what says to be larger is surely wrong, and would take memory.
const MAX_SIDE: u16 = 500;

/// Refuses what cannot be drawn on, and says what to do instead.
pub(super) fn refuse_others() -> Result<(), Failure> {
    let advice = "`ril status --json` and `ril status --watch` need none";
    if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
        let text = format!(
            "`ril watch` draws on a terminal, and standard input or output is not a terminal: {advice}"
        );
        return Err(Failure::usage(text));
    }
    let term = std::env::var_os("TERM").unwrap_or_default();
    if term.is_empty() || term == "dumb" {
        let text = format!(
            "`ril watch` cannot draw on a terminal of TERM={}: set TERM to what it is, such as xterm-256color; {advice}",
            term.display()
        );
        return Err(Failure::usage(text));
    }
    Ok(())
}

/// See the module's documentation.
pub(super) struct Terminal {
    guard: Guard,
    output: OwnedFd,
    /// What the terminal has not taken yet.
    pending: Vec<u8>,
    /// What it shows once that is through.
    shown: Option<Buffer>,
    area: Rect,
    has_colour: bool,
    is_gone: bool,
    signals: Signals,
}

impl Terminal {
    /// Takes standard input and output.
    pub fn enter() -> io::Result<Terminal> {
        let signals = Signals::install()?;
        let output = own_output()?;
        let guard = Guard::enter()?;
        let no_colour = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        let mut terminal = Terminal {
            guard,
            output,
            pending: paint::ENTER.to_vec(),
            shown: None,
            area: area(),
            has_colour: !no_colour,
            is_gone: false,
            signals,
        };
        terminal.write();
        Ok(terminal)
    }

    /// The place to draw.
    pub fn area(&self) -> Rect {
        self.area
    }

    /// Whether nothing more can be shown, or a signal says that the end has come.
    pub fn is_gone(&self) -> bool {
        self.is_gone || self.signals.ends.load(Ordering::Acquire)
    }

    /// What to wait for: keys, and signals about the screen.
    pub fn sources(&self) -> (Descriptor<'_>, Descriptor<'_>) {
        let changes = Descriptor::new(self.signals.receiver.as_fd());
        (Descriptor::new(stdin()), changes)
    }

    /// Whether the screen has another size, or another program had the terminal meanwhile; all is then drawn anew.
    pub fn take_resize(&mut self) -> bool {
        if !self.signals.take() {
            return false;
        }
        // A shell to which the process was suspended has set the terminal as it likes it.
        if self.guard.set_raw().is_err() {
            self.is_gone = true;
        }
        self.area = area();
        self.pending.extend_from_slice(paint::ENTER);
        self.forget();
        true
    }

    /// Draws all anew with the next picture.
    pub fn forget(&mut self) {
        self.shown = None;
    }

    /// Rings the bell.
    pub fn ring(&mut self) {
        self.pending.extend_from_slice(paint::BELL);
        self.write();
    }

    /// Shows `buffer`; says whether the terminal takes pictures. When it does not, the next one is for later.
    pub fn show(&mut self, buffer: Buffer) -> bool {
        self.write();
        if !self.pending.is_empty() {
            return false;
        }
        paint::changes(
            self.shown.as_ref(),
            &buffer,
            self.has_colour,
            &mut self.pending,
        );
        self.shown = Some(buffer);
        self.write();
        true
    }

    /// Writes what the terminal takes now.
    fn write(&mut self) {
        while !self.pending.is_empty() {
            match rustix::io::write(&self.output, &self.pending) {
                Ok(count) => drop(self.pending.drain(..count)),
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => return,
                Err(_) => {
                    self.is_gone = true;
                    self.pending.clear();
                }
            }
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // In the middle of a sequence the next one would be taken for its rest.
        self.write();
    }
}

/// The size of the terminal, within what is drawn.
fn area() -> Rect {
    let size = Size::of(stdout());
    let side = |side: usize| u16::try_from(side).unwrap_or(MAX_SIDE).min(MAX_SIDE);
    Rect::new(0, 0, side(size.columns), side(size.rows))
}

/// The terminal of standard output, opened anew: that writing does not wait must be no matter of the shell, which shares ours.
fn own_output() -> io::Result<OwnedFd> {
    let name = ttyname(stdout(), Vec::new())?;
    let path = Path::new(std::ffi::OsStr::from_bytes(name.as_bytes()));
    let flags = OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let opened = OpenOptions::new()
        .write(true)
        .custom_flags(flags.bits() as i32)
        .open(path);
    match opened {
        Ok(file) => Ok(file.into()),
        // After `su` the terminal is another user's: it can be written, but not opened.
        Err(error) if error.kind() == ErrorKind::PermissionDenied => stdout().try_clone_to_owned(),
        Err(error) => Err(error),
    }
}

/// Signals about the terminal, as a descriptor.
struct Signals {
    receiver: UnixStream,
    /// SIGHUP or SIGQUIT came: the terminal, or its user, wants the end.
    ends: Arc<AtomicBool>,
    handlers: Vec<SigId>,
}

impl Signals {
    fn install() -> io::Result<Signals> {
        let (receiver, sender) = UnixStream::pair()?;
        receiver.set_nonblocking(true)?;
        sender.set_nonblocking(true)?;
        let mut signals = Signals {
            receiver,
            ends: Arc::default(),
            handlers: Vec::new(),
        };
        // The handlers of a signal run in the order of their registration.
        for signal in [SIGHUP, SIGQUIT] {
            let ends = Arc::clone(&signals.ends);
            signals.handlers.push(flag::register(signal, ends)?);
        }
        for signal in [SIGWINCH, SIGCONT, SIGHUP, SIGQUIT] {
            let sender = sender.try_clone()?;
            signals.handlers.push(pipe::register(signal, sender)?);
        }
        Ok(signals)
    }

    /// Whether one came; empties the descriptor.
    fn take(&mut self) -> bool {
        let mut bytes = [0; 64];
        let mut came = false;
        while (&self.receiver)
            .read(&mut bytes)
            .is_ok_and(|count| count > 0)
        {
            came = true;
        }
        came
    }
}

impl Drop for Signals {
    fn drop(&mut self) {
        for handler in self.handlers.drain(..) {
            unregister(handler);
        }
    }
}
