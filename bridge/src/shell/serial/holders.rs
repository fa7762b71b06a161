//! Who uses a terminal device: the processes that have it open, locked or as their controlling terminal, and the
//! kernel's console. The device is only examined from outside, so that no process is disturbed.
//!
//! What cannot be seen: the open files of other users' processes (their controlling terminals and locks can), and
//! processes that `/proc` hides, such as those outside of the container in which this process runs.

use std::ffi::OsString;
use std::fs::{self, Metadata};
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;

use rustix::fs::{major, minor};

/// Where the kernel shows the processes.
const PROC: &str = "/proc";

/// Device number of the pseudo-terminals' slaves: this major, and their index as the minor.
const PTY_MAJOR: u32 = 136;

/// A terminal device as the kernel knows it, whatever name it was reached by.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TerminalDevice {
    /// Major and minor device number.
    number: (u32, u32),
    /// The file system on which the device lies: containers have pseudo-terminals of equal numbers on their own.
    file_system: u64,
    inode: u64,
    file_name: OsString,
}

impl TerminalDevice {
    /// The device at `path`, to which `metadata` belongs; `None` if it is no terminal that can be a serial port.
    pub fn new(path: &Path, metadata: &Metadata) -> Option<TerminalDevice> {
        if !metadata.file_type().is_char_device() {
            return None;
        }
        let number = (major(metadata.rdev()), minor(metadata.rdev()));
        // Screens (`/dev/tty1`), and names for whatever terminal or console the process has.
        if matches!(number, (4, 0..=63) | (5, 0..=2)) {
            return None;
        }
        // The kernel reports the kind of a device, except of pseudo-terminals.
        let class = fs::read_link(format!("/sys/dev/char/{}:{}/subsystem", number.0, number.1));
        if class.is_ok_and(|class| class.file_name().is_some_and(|name| name != "tty")) {
            return None;
        }
        let resolved = fs::canonicalize(path);
        let resolved = resolved.as_deref().unwrap_or(path);
        Some(TerminalDevice {
            number,
            file_system: metadata.dev(),
            inode: metadata.ino(),
            file_name: resolved.file_name().unwrap_or_default().to_owned(),
        })
    }

    /// Whether it is the slave of a pseudo-terminal, whose number another one gets when it is gone.
    pub fn is_pty(&self) -> bool {
        self.number.0 == PTY_MAJOR
    }

    /// Whether the file with this metadata is the same device, or another container's of the same number.
    fn compare(&self, other: &Metadata) -> Sameness {
        if !other.file_type().is_char_device()
            || self.number != (major(other.rdev()), minor(other.rdev()))
        {
            Sameness::Other
        } else if self.is_pty() && self.file_system != other.dev() {
            Sameness::SameNumber
        } else {
            Sameness::Same
        }
    }

    /// Whether an open file with this path may be the device. Only such files are looked at: a look at a file on a
    /// network that does not answer would not come back.
    fn may_be_at(&self, path: &Path) -> bool {
        path.starts_with("/dev") || path.file_name() == Some(&self.file_name)
    }
}

#[derive(PartialEq)]
enum Sameness {
    Same,
    SameNumber,
    Other,
}

/// How a process holds a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// It is the process's controlling terminal: a person works there, or a login waits there.
    Controlling,
    /// The process has it open.
    Open,
    /// The process has a lock on it. Its open files cannot be seen.
    Locked,
    /// The process has the master of this pseudo-terminal, as a simulator does. It may have the slave open, too.
    OtherEnd,
}

/// A process that holds a terminal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// Its process.
    pub pid: u32,
    /// Its program.
    pub program: String,
    /// How it holds the terminal; the most telling way if there are several.
    pub hold: Hold,
    /// Whether the process leads its session, as a login shell does.
    pub leads_session: bool,
}

/// Everything that is known to hold a terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Holders {
    /// The processes, by number.
    pub processes: Vec<Holder>,
    /// Whether the kernel writes its messages there.
    pub is_console: bool,
    /// Processes whose open files could not be seen: they are other users'.
    pub hidden: usize,
}

/// Who keeps a port from being opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortHolder {
    /// The kernel, whose console it is.
    Kernel,
    /// A process.
    Process(Holder),
    /// A process that cannot be seen.
    Unseen,
}

/// The number of this process as `/proc` has it: a container may have the `/proc` of those outside.
pub fn own_number() -> u32 {
    let own = fs::read_link(format!("{PROC}/self")).ok();
    let own = own.and_then(|own| own.to_str()?.parse().ok());
    own.unwrap_or_else(std::process::id)
}

/// Whether the kernel shows the processes.
pub fn has_proc() -> bool {
    Path::new(PROC).join("self").exists()
}

impl Holders {
    /// Looks who holds `terminal`.
    ///
    /// # Errors
    /// When there is no `/proc`.
    pub fn find(terminal: &TerminalDevice) -> io::Result<Holders> {
        let consoles = fs::read_to_string(format!("{PROC}/consoles")).unwrap_or_default();
        let locks = fs::read_to_string(format!("{PROC}/locks")).unwrap_or_default();
        let lock_holders = lock_holders(&locks, terminal);
        let mut holders = Holders {
            is_console: is_console(&consoles, terminal),
            ..Holders::default()
        };
        for entry in fs::read_dir(PROC)?.flatten() {
            let name = entry.file_name();
            if let Some(pid) = name.to_str().and_then(|name| name.parse().ok()) {
                holders.look_at(&entry.path(), pid, terminal, lock_holders.contains(&pid));
            }
        }
        holders.processes.sort_by_key(|holder| holder.pid);
        Ok(holders)
    }

    /// Looks at one process, which may end meanwhile.
    fn look_at(&mut self, process: &Path, pid: u32, terminal: &TerminalDevice, has_lock: bool) {
        let Some(session) = fs::read_to_string(process.join("stat"))
            .ok()
            .and_then(|stat| ProcessSession::parse(&stat))
        else {
            return;
        };
        let (files, are_hidden) = match OpenFiles::find(process, terminal) {
            Ok(files) => (files, false),
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                self.hidden += 1;
                (OpenFiles::default(), true)
            }
            Err(_) => return,
        };
        let controls = session.terminal == terminal.number
            && !(terminal.is_pty() && is_elsewhere(process, &files, are_hidden));
        let hold = if controls {
            Hold::Controlling
        } else if files.has_master {
            Hold::OtherEnd
        } else if files.has_terminal {
            Hold::Open
        } else if has_lock {
            Hold::Locked
        } else {
            return;
        };
        self.processes.push(Holder {
            pid,
            program: program(process),
            hold,
            leads_session: session.id == pid,
        });
    }

    /// Who keeps the process `own` from using the terminal; `None` if it may. A session's leader comes before its other
    /// processes, and low process numbers before high ones: the same holder is named each time, so that it is logged
    /// once.
    pub fn holder(&self, own: u32) -> Option<PortHolder> {
        let controlling = self
            .processes
            .iter()
            .filter(|holder| holder.hold == Hold::Controlling)
            .min_by_key(|holder| (!holder.leads_session, holder.pid));
        if let Some(holder) = controlling {
            return Some(PortHolder::Process(holder.clone()));
        }
        if self.is_console {
            return Some(PortHolder::Kernel);
        }
        self.processes
            .iter()
            .find(|holder| holder.pid != own && holder.hold != Hold::OtherEnd)
            .map(|holder| PortHolder::Process(holder.clone()))
    }
}

/// Whether a process whose controlling terminal has the pseudo-terminal's number has another one, in a container.
fn is_elsewhere(process: &Path, files: &OpenFiles, are_hidden: bool) -> bool {
    if !are_hidden {
        return files.has_same_number && !files.has_terminal;
    }
    // A person who enters a container from this terminal leaves a shell outside of the container, and that is found.
    let status = fs::read_to_string(process.join("status")).unwrap_or_default();
    has_own_process_numbers(&status)
}

/// What a process has open of a terminal.
#[derive(Default)]
struct OpenFiles {
    has_terminal: bool,
    has_master: bool,
    /// A pseudo-terminal of the same number on another file system.
    has_same_number: bool,
}

impl OpenFiles {
    fn find(process: &Path, terminal: &TerminalDevice) -> io::Result<OpenFiles> {
        let mut found = OpenFiles::default();
        for entry in fs::read_dir(process.join("fd"))?.flatten() {
            let Ok(path) = fs::read_link(entry.path()) else {
                continue;
            };
            if terminal.is_pty() && path.ends_with("ptmx") {
                let info = process.join("fdinfo").join(entry.file_name());
                let info = fs::read_to_string(info).unwrap_or_default();
                found.has_master |= master_index(&info) == Some(terminal.number.1);
            } else if terminal.may_be_at(&path)
                && let Ok(metadata) = fs::metadata(entry.path())
            {
                let sameness = terminal.compare(&metadata);
                found.has_terminal |= sameness == Sameness::Same;
                found.has_same_number |= sameness == Sameness::SameNumber;
            }
        }
        Ok(found)
    }
}

/// Session and controlling terminal of a process.
#[derive(Debug, PartialEq)]
struct ProcessSession {
    id: u32,
    terminal: (u32, u32),
}

impl ProcessSession {
    /// From `/proc/PID/stat`.
    fn parse(stat: &str) -> Option<ProcessSession> {
        // The program's name, in parentheses, may have any character in it.
        let (_, rest) = stat.rsplit_once(')')?;
        // State, parent, process group, session, terminal.
        let mut fields = rest.split_ascii_whitespace().skip(3);
        let id = fields.next()?.parse().ok()?;
        let number: i32 = fields.next()?.parse().ok()?;
        // The 32 bits of the number, of which a big minor takes the sign's.
        let number = number as u32;
        let terminal = (
            (number >> 8) & 0xfff,
            (number & 0xff) | ((number >> 12) & 0xf_ff00),
        );
        Some(ProcessSession { id, terminal })
    }
}

/// The index of the pseudo-terminal of which `/proc/PID/fdinfo/FD` describes the master.
fn master_index(info: &str) -> Option<u32> {
    let index = info
        .lines()
        .find_map(|line| line.strip_prefix("tty-index:"))?;
    index.trim().parse().ok()
}

/// Whether `/proc/PID/status` shows a process in a container: it has more than one process number.
fn has_own_process_numbers(status: &str) -> bool {
    status
        .lines()
        .find_map(|line| line.strip_prefix("NSpid:"))
        .is_some_and(|numbers| numbers.split_ascii_whitespace().count() > 1)
}

/// Whether `/proc/consoles` names the terminal as one that is enabled.
fn is_console(consoles: &str, terminal: &TerminalDevice) -> bool {
    consoles.lines().any(|line| {
        let is_enabled = line
            .split_once('(')
            .is_some_and(|(_, flags)| flags.starts_with('E'));
        let number = line.split_ascii_whitespace().last();
        let number = number.and_then(|number| number.split_once(':'));
        is_enabled
            && number.is_some_and(|(major, minor)| {
                (major.parse(), minor.parse()) == (Ok(terminal.number.0), Ok(terminal.number.1))
            })
    })
}

/// The processes that have a lock on the terminal, from `/proc/locks`.
fn lock_holders(locks: &str, terminal: &TerminalDevice) -> Vec<u32> {
    let file = format!(
        "{:02x}:{:02x}:{}",
        major(terminal.file_system),
        minor(terminal.file_system),
        terminal.inode
    );
    locks
        .lines()
        .filter_map(|line| {
            // Number, kind, strictness, access, process, file. Those that wait for a lock have an arrow before the
            // kind.
            let mut fields = line.split_ascii_whitespace().skip(4);
            let pid = fields.next()?.parse().ok()?;
            (fields.next()? == file).then_some(pid)
        })
        .collect()
}

/// The name of a process's program.
fn program(process: &Path) -> String {
    let name = fs::read_to_string(process.join("comm")).unwrap_or_default();
    match name.trim_end() {
        "" => "unknown".to_owned(),
        name => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_knows_its_own_number_in_proc() {
        assert!(has_proc());
        assert_eq!(own_number(), std::process::id());
    }

    fn terminal(number: (u32, u32)) -> TerminalDevice {
        TerminalDevice {
            number,
            file_system: 0x1a,
            inode: 6,
            file_name: "3".into(),
        }
    }

    fn holder(pid: u32, hold: Hold, leads_session: bool) -> Holder {
        Holder {
            pid,
            program: "test".to_owned(),
            hold,
            leads_session,
        }
    }

    #[test]
    fn session_and_terminal_are_read_behind_the_name_of_the_program() {
        for (stat, expected) in [
            ("7 (bash) S 1 7 5 34819 7 4194304", Some((5, (136, 3)))),
            ("7 (a) 1 2) R 1 7 7 1088 -1", Some((7, (4, 64)))),
            ("7 (kthread) S 2 0 0 0 -1", Some((0, (0, 0)))),
            // Index 300 of the pseudo-terminals: its upper bits stand above the major.
            ("7 (bash) S 1 7 7 1083436 7", Some((7, (136, 300)))),
            ("7 (bash) S 1", None),
            ("", None),
        ] {
            let expected = expected.map(|(id, terminal)| ProcessSession { id, terminal });
            assert_eq!(ProcessSession::parse(stat), expected, "{stat}");
        }
    }

    #[test]
    fn only_enabled_consoles_count() {
        let consoles = "\
tty0                 -WU (EC  p  )    4:1
ttyS0                -W- (EC  p a)    4:64
ttyS1                -W- (    p a)    4:65
netcon0              -W- (E   p  )\n";
        assert!(is_console(consoles, &terminal((4, 64))));
        assert!(!is_console(consoles, &terminal((4, 65))));
        assert!(!is_console(consoles, &terminal((136, 3))));
        assert!(!is_console("", &terminal((4, 64))));
    }

    #[test]
    fn locks_name_the_processes_that_have_them_and_not_those_that_wait() {
        let locks = "\
1: FLOCK  ADVISORY  WRITE 700 00:1a:6 0 EOF
1: -> FLOCK  ADVISORY  WRITE 701 00:1a:6 0 EOF
2: FLOCK  ADVISORY  WRITE 702 00:1a:7 0 EOF
3: POSIX  ADVISORY  READ  703 00:1a:6 0 EOF
4: OFDLCK ADVISORY  READ  -1 00:1a:6 0 EOF\n";
        assert_eq!(lock_holders(locks, &terminal((136, 3))), [700, 703]);
    }

    #[test]
    fn masters_and_containers_are_recognised() {
        let info = "pos:\t0\nflags:\t02100002\nmnt_id:\t24\nino:\t91\ntty-index:\t12\n";
        assert_eq!(master_index(info), Some(12));
        assert_eq!(master_index("pos:\t0\n"), None);
        assert!(has_own_process_numbers("Name:\tsh\nNSpid:\t812\t1\n"));
        assert!(!has_own_process_numbers("Name:\tsh\nNSpid:\t812\n"));
        assert!(!has_own_process_numbers(""));
    }

    #[test]
    fn a_file_on_a_network_is_not_looked_at() {
        let terminal = terminal((136, 3));
        for (path, expected) in [
            ("/dev/pts/9", true),
            ("/dev/pts/3 (deleted)", true),
            ("/container/dev/pts/3", true),
            ("/net/home/dev/notes", false),
            ("socket:[3]", false),
        ] {
            assert_eq!(terminal.may_be_at(Path::new(path)), expected, "{path}");
        }
    }

    #[test]
    fn a_person_comes_before_the_console_and_programs_and_the_other_end_is_no_occupant() {
        use Hold::{Controlling, Locked, Open, OtherEnd};
        const OWN: u32 = 5;
        let kernel = Some(PortHolder::Kernel);
        let process = |holder: &Holder| Some(PortHolder::Process(holder.clone()));
        let shell = holder(9, Controlling, true);
        let editor = holder(8, Controlling, false);
        let program = holder(7, Open, false);
        let locker = holder(6, Locked, false);
        let own = holder(OWN, Open, false);
        let own_terminal = holder(OWN, Controlling, false);
        let simulator = holder(4, OtherEnd, true);
        for (processes, is_console, expected) in [
            (vec![&simulator, &own], false, None),
            (vec![&simulator, &own, &program], false, process(&program)),
            (vec![&simulator, &locker], false, process(&locker)),
            (vec![&own_terminal], false, process(&own_terminal)),
            (vec![&own], true, kernel.clone()),
            (vec![&program], true, kernel),
            (vec![&program, &editor], true, process(&editor)),
            (vec![&simulator, &editor, &shell], false, process(&shell)),
        ] {
            let holders = Holders {
                processes: processes.into_iter().cloned().collect(),
                is_console,
                hidden: 0,
            };
            assert_eq!(holders.holder(OWN), expected, "{holders:?}");
        }
    }
}
