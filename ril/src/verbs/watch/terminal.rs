//! [`Terminal`]: takes the terminal, and gives it back as it was, whatever ends the process: its own end, a signal, a
//! panic.
//!
//! Writing never waits: a terminal that takes nothing, such as an ssh connection that hangs, must not keep the process
//! from its orders and its end. What it has not taken is written later, and no other picture before it is through. A
//! picture is the bytes that change what the terminal shows from one buffer to the next, in ANSI sequences that every
//! terminal of today knows.

use std::fs::OpenOptions;
use std::io::{self, ErrorKind, IsTerminal, Read};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixStream;
use std::panic;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ipc_types::Descriptor;
use operator::render::terminal::Size;
use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier};
use runtime::exit::Failure;
use rustix::fs::OFlags;
use rustix::io::Errno;
use rustix::process::{Signal, getpgrp, getsid, kill_current_process_group};
use rustix::stdio::{stdin, stdout};
use rustix::termios::{
    OptionalActions, QueueSelector, Termios, tcflush, tcgetattr, tcsetattr, ttyname,
};
use signal_hook::consts::{SIGCONT, SIGHUP, SIGQUIT, SIGTSTP, SIGWINCH};
use signal_hook::low_level::{pipe, unregister};
use signal_hook::{SigId, flag};

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

/// The terminal while it is taken. Writing never waits; dropping gives the terminal back as it was.
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
            pending: ENTER.to_vec(),
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
        if self.signals.stops.swap(false, Ordering::AcqRel) {
            self.suspend();
        }
        // A shell to which the process was suspended has set the terminal as it likes it.
        if self.guard.set_raw().is_err() {
            self.is_gone = true;
        }
        self.area = area();
        self.pending.extend_from_slice(ENTER);
        self.forget();
        true
    }

    /// Gives the terminal to the shell, as Ctrl+Z does elsewhere, and returns when the shell has given it back. Says
    /// whether there is one.
    pub fn suspend(&mut self) -> bool {
        // The leader's group is no job of a shell: nothing would let it go on.
        if getsid(None).is_ok_and(|session| session == getpgrp()) {
            return false;
        }
        self.write();
        self.guard.saved.give_back();
        // As the terminal does: with a script that has started it, for which the shell waits. [`Terminal::take_resize`]
        // takes the SIGCONT that ends it.
        kill_current_process_group(Signal::STOP).is_ok()
    }

    /// Draws all anew with the next picture.
    pub fn forget(&mut self) {
        self.shown = None;
    }

    /// Rings the bell.
    pub fn ring(&mut self) {
        self.pending.extend_from_slice(BELL);
        self.write();
    }

    /// Shows `buffer`; says whether the terminal takes pictures. When it does not, the next one is for later.
    pub fn show(&mut self, buffer: Buffer) -> bool {
        self.write();
        if !self.pending.is_empty() {
            return false;
        }
        changes(
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

/// The terminal of standard output, opened anew: that writing does not wait must be no matter of the shell, which
/// shares ours.
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
    /// SIGTSTP came: another process asks for what Ctrl+Z does.
    stops: Arc<AtomicBool>,
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
            stops: Arc::default(),
            handlers: Vec::new(),
        };
        // The handlers of a signal run in the order of their registration.
        for (signal, flag) in [
            (SIGHUP, &signals.ends),
            (SIGQUIT, &signals.ends),
            (SIGTSTP, &signals.stops),
        ] {
            let handler = flag::register(signal, Arc::clone(flag))?;
            signals.handlers.push(handler);
        }
        for signal in [SIGWINCH, SIGCONT, SIGTSTP, SIGHUP, SIGQUIT] {
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

/// Gives the terminal back when it is dropped, and before a panic is reported.
struct Guard {
    raw: Termios,
    saved: Arc<SavedTerminal>,
}

/// How the terminal was.
struct SavedTerminal {
    settings: Termios,
    is_taken: AtomicBool,
}

impl Guard {
    pub fn enter() -> io::Result<Guard> {
        let settings = tcgetattr(stdin())?;
        let mut raw = settings.clone();
        raw.make_raw();
        let saved = Arc::new(SavedTerminal {
            settings,
            is_taken: AtomicBool::new(false),
        });
        let guard = Guard {
            raw,
            saved: Arc::clone(&saved),
        };
        guard.set_raw()?;
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            // What is printed on the other screen goes with it.
            saved.give_back();
            before(info);
        }));
        Ok(guard)
    }

    pub fn set_raw(&self) -> io::Result<()> {
        self.saved.is_taken.store(true, Ordering::Release);
        Ok(tcsetattr(stdin(), OptionalActions::Now, &self.raw)?)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.saved.give_back();
    }
}

impl SavedTerminal {
    /// Once for each time that it was taken.
    fn give_back(&self) {
        if !self.is_taken.swap(false, Ordering::AcqRel) {
            return;
        }
        // Best effort: a terminal that is gone needs nothing. What was typed and not read is not the shell's: it may be
        // the rest of a word that confirms an order.
        let _ = tcflush(stdin(), QueueSelector::IFlush);
        let _ = write_without_waiting(stdout(), LEAVE);
        let _ = tcsetattr(stdin(), OptionalActions::Now, &self.settings);
    }
}

/// Writes `bytes` if the terminal takes them at once, or after what it has not taken was thrown away.
fn write_without_waiting(to: BorrowedFd<'_>, bytes: &[u8]) -> io::Result<()> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let takes = || {
        let mut polled = [PollFd::from_borrowed_fd(to, PollFlags::OUT)];
        let now = Timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        poll(&mut polled, Some(&now)).is_ok_and(|ready| ready > 0)
    };
    if !takes() {
        tcflush(to, QueueSelector::OFlush)?;
    }
    if takes() {
        rustix::io::write(to, bytes)?;
    }
    Ok(())
}

/// Takes the terminal: the other screen, no cursor, no wrapping of lines.
pub const ENTER: &[u8] = b"\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[0m\x1b[2J";

/// Gives it back as it was.
pub const LEAVE: &[u8] = b"\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l";

/// Rings the bell.
pub const BELL: &[u8] = b"\x07";

/// Adds to `out` what turns `before` into `after`; without `before`, all is drawn anew. Nothing is added when nothing
/// changed.
pub fn changes(before: Option<&Buffer>, after: &Buffer, colour: bool, out: &mut Vec<u8>) {
    let empty;
    let before = match before {
        Some(before) if before.area == after.area => before,
        _ => {
            out.extend_from_slice(b"\x1b[0m\x1b[2J");
            empty = Buffer::empty(after.area);
            &empty
        }
    };
    let mut style = String::new();
    let mut next = None;
    for (x, y, cell) in before.diff(after) {
        if next != Some((x, y)) {
            out.extend_from_slice(format!("\x1b[{};{}H", y + 1, x + 1).as_bytes());
        }
        let wanted = sgr(cell, colour);
        if style != wanted {
            out.extend_from_slice(wanted.as_bytes());
            style = wanted;
        }
        out.extend_from_slice(cell.symbol().as_bytes());
        // A wide character moves the cursor by two: the next cell gets a place of its own.
        next = cell.symbol().is_ascii().then_some((x + 1, y));
    }
    if next.is_some() || !style.is_empty() {
        out.extend_from_slice(b"\x1b[0m");
    }
}

/// The sequence that selects the style of `cell`.
fn sgr(cell: &Cell, colour: bool) -> String {
    let mut text = "\x1b[0".to_owned();
    for (modifier, code) in [
        (Modifier::BOLD, ";1"),
        (Modifier::DIM, ";2"),
        (Modifier::UNDERLINED, ";4"),
        (Modifier::REVERSED, ";7"),
    ] {
        if cell.modifier.contains(modifier) {
            text += code;
        }
    }
    if colour {
        text += &colour_code(cell.fg, 30);
        text += &colour_code(cell.bg, 40);
    }
    text.push('m');
    text
}

/// The parameters of a colour; `base` is 30 for the foreground and 40 for the background.
fn colour_code(colour: Color, base: u8) -> String {
    let number = match colour {
        Color::Reset => return String::new(),
        Color::Indexed(index) => return format!(";{};5;{index}", base + 8),
        Color::Rgb(red, green, blue) => return format!(";{};2;{red};{green};{blue}", base + 8),
        Color::Black => 0,
        Color::Red => 1,
        Color::Green => 2,
        Color::Yellow => 3,
        Color::Blue => 4,
        Color::Magenta => 5,
        Color::Cyan => 6,
        Color::Gray => 7,
        Color::DarkGray => 60,
        Color::LightRed => 61,
        Color::LightGreen => 62,
        Color::LightYellow => 63,
        Color::LightBlue => 64,
        Color::LightMagenta => 65,
        Color::LightCyan => 66,
        Color::White => 67,
    };
    format!(";{}", base + number)
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::process::{Command, Stdio};

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::*;

    /// Set in the process that is to panic.
    const IN_CHILD: &str = "RIL_TEST_PANICS_ON_A_TERMINAL";

    #[test]
    fn a_panic_gives_the_terminal_back_before_it_is_reported() {
        if std::env::var_os(IN_CHILD).is_some() {
            let _guard = Guard::enter().unwrap();
            rustix::io::write(stdout(), ENTER).unwrap();
            panic!("tested on purpose");
        }
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap();
        let name = name.to_str().unwrap();
        let slave = || File::options().read(true).write(true).open(name).unwrap();
        let terminal = slave();
        let before = format!("{:?}", tcgetattr(&terminal).unwrap());
        // This test alone, in a process whose terminal it is.
        let (_, module) = module_path!().split_once("::").unwrap();
        let test = format!("{module}::a_panic_gives_the_terminal_back_before_it_is_reported");
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", &test, "--nocapture", "--test-threads=1"])
            .env(IN_CHILD, "1")
            .env("RUST_BACKTRACE", "0")
            .stdin(Stdio::from(slave()))
            .stdout(Stdio::from(slave()))
            .stderr(Stdio::from(slave()))
            .spawn()
            .unwrap();
        assert!(!child.wait().unwrap().success());
        assert_eq!(format!("{:?}", tcgetattr(&terminal).unwrap()), before);
        drop(terminal);
        let mut bytes = Vec::new();
        // Without a slave the end of what was written is an error.
        let _ = File::from(master).read_to_end(&mut bytes);
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let place = |what: &str| {
            text.find(what)
                .unwrap_or_else(|| panic!("{what:?} is not in {text:?}"))
        };
        let [enter, leave] = [ENTER, LEAVE].map(|bytes| std::str::from_utf8(bytes).unwrap());
        assert!(place(enter) < place(leave) && place(leave) < place("tested on purpose"));
    }
}

#[cfg(test)]
mod paint_tests {
    use ratatui::layout::Rect;
    use ratatui::style::Style;

    use super::*;

    fn buffer(text: &str, style: Style) -> Buffer {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 6, 2));
        buffer.set_string(0, 1, text, style);
        buffer
    }

    fn bytes(before: Option<&Buffer>, after: &Buffer, colour: bool) -> String {
        let mut out = Vec::new();
        changes(before, after, colour, &mut out);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn only_what_changed_is_written() {
        let before = buffer("abcdef", Style::new());
        let after = buffer("abXYef", Style::new());
        assert_eq!(
            bytes(Some(&before), &after, true),
            "\x1b[2;3H\x1b[0mXY\x1b[0m"
        );
        assert_eq!(bytes(Some(&after), &after, true), "");
    }

    #[test]
    fn without_a_buffer_before_all_is_drawn() {
        let text = bytes(None, &buffer("a", Style::new()), true);
        assert_eq!(text, "\x1b[0m\x1b[2J\x1b[2;1H\x1b[0ma\x1b[0m");
    }

    #[test]
    fn without_colour_there_is_none_but_what_stands_out_still_does() {
        let style = Style::new().fg(Color::Red).add_modifier(Modifier::REVERSED);
        let after = buffer("a", style);
        let before = Buffer::empty(after.area);
        assert!(bytes(Some(&before), &after, true).contains("\x1b[0;7;31ma"));
        assert!(bytes(Some(&before), &after, false).contains("\x1b[0;7ma"));
    }
}
