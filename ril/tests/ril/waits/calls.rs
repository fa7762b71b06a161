//! [`LIST`]: the system calls that a process' loop may make between its start and its end, and for each why it cannot
//! wait. [`Trace`] reads what strace has seen of a process.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::time::Duration;

/// What a system call is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum About {
    /// Nothing outside of the process and the kernel's own memory.
    Nothing,
    /// `/dev/shm`: segments, locks and sockets' names of the domain; and `/dev`, which is in memory as well.
    SharedMemory,
    /// What the kernel says of this process, in `/proc/self`, of itself and of the network.
    Proc,
    /// What it says of others, in `/proc`: links of a process lead to files of any disk.
    OtherProc,
    /// An eventfd, a timer, an inotify, an epoll, a descriptor of a process.
    Event,
    /// A socket whose calls do not wait, as was asked for at the socket or at the call.
    Socket,
    /// A socket whose calls may wait.
    WaitingSocket,
    /// The serial line, or its other end.
    Line,
    /// A wait of this thread without an end, for what is not its own: one that the loop does not begin with.
    Sleep,
    /// A futex that wakes others.
    Wake,
    /// A futex on which a process sleeps that others can wake: the doorbell.
    Doorbell,
    /// A futex, or a file's lock, on which a thread waits for another one.
    Lock,
    /// The lock of the C library's memory.
    Allocator,
    /// A pipe, such as standard error.
    Pipe,
    /// Anything else, such as a file of a disk.
    File,
}

/// Calls that cannot wait.
pub struct Row {
    /// The processes whose loop may make them; empty for all.
    of: &'static [&'static str],
    about: About,
    calls: &'static str,
    /// Why they cannot wait: for the reader of the list.
    #[allow(dead_code)]
    why: &'static str,
}

const ALL: &[&str] = &[];

/// What a loop may call. There is nothing on it of a file of a disk, of standard output and standard error, and of a
/// lock.
#[rustfmt::skip]
pub const LIST: &[Row] = &[
    Row { of: ALL, about: About::Socket, calls: "ppoll", why: "the one wait" },
    Row { of: &["bridge"], about: About::Event, calls: "ppoll", why: "asks with a limit of 0 whether a process has ended" },
    Row { of: &["bridge"], about: About::Line, calls: "ppoll", why: "the line alone, after a standstill: for at most 10 ms, while a backlog comes" },
    Row { of: &["status"], about: About::Doorbell, calls: "futex", why: "the one wait of a process that has publishers and subscribers alone" },
    Row { of: &["relay-robot", "relay-station"], about: About::Lock, calls: "futex", why: "the inbox, and queues of Zenoh: their other threads have these locks for a moment and wait for nothing meanwhile; a sample that finds no room is dropped after WAIT_FOR_ROOM_US" },
    Row { of: ALL, about: About::Allocator, calls: "futex", why: "memory of the process: another thread has the lock while the kernel gives it some or takes it back" },
    Row { of: ALL, about: About::Wake, calls: "futex", why: "wakes others and goes on" },
    Row { of: ALL, about: About::Nothing, calls: "brk mmap munmap mremap madvise mprotect", why: "memory of the process: the kernel gives it or does not" },
    Row { of: ALL, about: About::Nothing, calls: "clock_gettime getpid gettid getsid getuid geteuid getrandom sched_yield umask rt_sigreturn rt_sigprocmask restart_syscall", why: "an answer from the kernel's memory" },
    Row { of: ALL, about: About::Nothing, calls: "kill pidfd_open", why: "signal 0: asks whether a process lives" },
    Row { of: ALL, about: About::Nothing, calls: "eventfd2 epoll_create1 timerfd_create socket", why: "a new descriptor" },
    Row { of: ALL, about: About::SharedMemory, calls: "openat access statx newfstatat fstat lstat statfs fcntl fchmod ftruncate fallocate mmap close unlink unlinkat rename renameat mkdir mkdirat rmdir readlink getdents64 read pread64 write pwrite64 lseek fsync", why: "tmpfs: memory alone, where forcing does nothing; files of this user that members of the domain have made" },
    Row { of: ALL, about: About::SharedMemory, calls: "flock", why: "with LOCK_NB" },
    Row { of: ALL, about: About::Proc, calls: "openat statx newfstatat read close fcntl readlink", why: "the kernel's own memory, of this process, of its sockets and of its settings: the C library looks there how much memory it may give back" },
    Row { of: ALL, about: About::Event, calls: "read write close fcntl timerfd_settime epoll_pwait epoll_ctl ioctl", why: "made with the flag not to wait; an epoll is asked with a limit of 0, the one wait is elsewhere" },
    Row { of: ALL, about: About::Socket, calls: "sendto recvfrom sendmsg recvmsg read write accept4 getsockopt setsockopt getsockname getpeername shutdown bind connect listen close fcntl ioctl", why: "asked not to wait: what finds no room fails at once" },
    Row { of: ALL, about: About::WaitingSocket, calls: "fcntl ioctl setsockopt getsockopt bind close connect", why: "datagrams of the same machine: joining and leaving is a matter of the kernel's memory" },
    Row { of: &["bridge", "sim"], about: About::Line, calls: "read write", why: "opened with O_NONBLOCK: what finds no room or no byte fails at once, and waits only for the kernel's own worker that brings the bytes" },
    Row { of: &["bridge", "sim"], about: About::Line, calls: "ioctl", why: "empties a queue of the kernel (TCFLSH)" },
];

fn is_listed(process: &str, call: &str, about: About) -> bool {
    LIST.iter().any(|row| {
        row.about == about
            && row.calls.split(' ').any(|listed| listed == call)
            && (row.of.is_empty() || row.of.contains(&process))
    })
}

/// What strace has seen of the thread with the loop.
#[derive(Default)]
pub struct Trace {
    /// Its folder in `/proc`.
    own: String,
    /// Where the C library's data lie, with the lock of the memory that threads share first.
    c_library: Vec<Range<u64>>,
    /// Sockets whose calls do not wait.
    unwaiting: BTreeSet<String>,
    /// Every kind of call.
    pub seen: BTreeSet<(String, About)>,
    /// Calls that are not on the list: an example, and how many.
    pub others: BTreeMap<(String, About), (String, u32)>,
}

impl Trace {
    /// Of the process `name` with the number `id`, between these moments: `text` is what `strace -f -ttt -y` has
    /// written, and `maps` its file in `/proc`.
    pub fn read(text: &str, maps: &str, name: &str, id: u32, [from, to]: [Duration; 2]) -> Trace {
        let address = |text: &str| u64::from_str_radix(text, 16).ok();
        let c_library = maps.lines().filter(|line| line.contains("/libc.so"));
        let c_library = c_library.filter_map(|line| {
            let (from, to) = line.split_once(' ')?.0.split_once('-')?;
            Some(address(from)?..address(to)?)
        });
        let mut trace = Trace {
            own: format!("/proc/{id}"),
            c_library: c_library.collect(),
            ..Trace::default()
        };
        let id = id.to_string();
        let mut has_begun = false;
        for line in text.lines() {
            let mut words = line.splitn(3, ' ');
            let thread = words.next().unwrap_or_default();
            let Some((at, call)) = line[thread.len()..].trim_start().split_once(' ') else {
                continue;
            };
            let call = call.trim_start();
            let (Ok(at), Some((call, rest))) = (
                at.parse().map(Duration::from_secs_f64),
                call.split_once('('),
            ) else {
                continue;
            };
            trace.note_socket(call, rest);
            // The end of a call that is there already.
            if call.starts_with('<') {
                continue;
            }
            let about = trace.about(call, rest);
            // What a process does once it says that it is ready, and before it sleeps for the first time, is its start.
            let is_wait = call == "ppoll" || about == About::Doorbell;
            has_begun |= thread == id && at >= from && is_wait;
            if thread == id && has_begun && at < to {
                trace.seen.insert((call.to_owned(), about));
                if !is_listed(name, call, about) {
                    let first = || (line.to_owned(), 0);
                    let other = trace.others.entry((call.to_owned(), about));
                    other.or_insert_with(first).1 += 1;
                }
            }
        }
        trace
    }

    /// Remembers which sockets do not wait.
    fn note_socket(&mut self, call: &str, rest: &str) {
        if call == "<... socket resumed>" || matches!(call, "socket" | "socketpair" | "accept4") {
            for end in rest
                .split('<')
                .skip(1)
                .filter(|_| rest.contains("NONBLOCK"))
            {
                self.unwaiting
                    .insert(end.split('>').next().unwrap_or_default().to_owned());
            }
        }
        let is_set = match call {
            "fcntl" => rest.contains("F_SETFL") && rest.contains("O_NONBLOCK"),
            "ioctl" => rest.contains("FIONBIO, [1]"),
            _ => false,
        };
        if is_set {
            self.unwaiting.extend(first_path(rest).map(str::to_owned));
        }
    }

    /// Whether the first argument is the address of a lock of the C library's memory. What a thread has for itself
    /// begins at a multiple of 64 MiB, with its lock.
    fn is_of_allocator(&self, rest: &str) -> bool {
        const ARENA: u64 = 64 << 20;
        let address = rest
            .strip_prefix("0x")
            .and_then(|rest| rest.split(',').next());
        let address = address.and_then(|text| u64::from_str_radix(text, 16).ok());
        address.is_some_and(|at| {
            at > ARENA && at % ARENA < 64 || self.c_library.iter().any(|data| data.contains(&at))
        })
    }

    fn about(&self, call: &str, rest: &str) -> About {
        if call == "futex" {
            return match rest {
                _ if rest.contains("FUTEX_WAKE") => About::Wake,
                _ if rest.contains("PRIVATE") && self.is_of_allocator(rest) => About::Allocator,
                _ if rest.contains("PRIVATE") => About::Lock,
                _ => About::Doorbell,
            };
        }
        if call == "flock" && !rest.contains("LOCK_NB") {
            return About::Lock;
        }
        // Asked without a limit, and not of all that the process waits for.
        let is_endless = match call {
            "ppoll" => rest.contains("}], 1, ") && !rest.contains("tv_sec=0"),
            "epoll_pwait" => !rest.contains(", 0, "),
            _ => false,
        };
        if is_endless {
            return About::Sleep;
        }
        let path = match call {
            // What is named is what they make.
            "eventfd2" | "epoll_create1" | "timerfd_create" | "pidfd_open" | "socket"
            | "restart_syscall" => None,
            _ => first_path(rest),
        };
        let Some(path) = path else {
            return About::Nothing;
        };
        let does_not_wait = || self.unwaiting.contains(path) || rest.contains("MSG_DONTWAIT");
        match path {
            _ if Path::new(path).starts_with("/dev/shm") || path == "/dev" => About::SharedMemory,
            _ if ["/proc/self", "/proc/net", "/proc/sys", &self.own]
                .iter()
                .any(|own| Path::new(path).starts_with(own)) =>
            {
                About::Proc
            }
            _ if Path::new(path).starts_with("/proc") => About::OtherProc,
            _ if Path::new(path).starts_with("/dev/pts") || path == "/dev/ptmx" => About::Line,
            _ if path.starts_with("anon_inode:") => About::Event,
            _ if path.starts_with("pipe:") => About::Pipe,
            _ if call == "ppoll" && path.starts_with("socket:") => About::Socket,
            _ if path.starts_with("socket:") && does_not_wait() => About::Socket,
            _ if path.starts_with("socket:") => About::WaitingSocket,
            _ => About::File,
        }
    }
}

/// The file of the first descriptor among the arguments, or the first name; not the folder that a name is looked up in.
fn first_path(rest: &str) -> Option<&str> {
    let rest = match rest.strip_prefix("AT_FDCWD<") {
        Some(rest) => rest.split_once('>')?.1,
        None => rest,
    };
    let at = rest.find(['<', '"'])?;
    // A folder in which a name is looked up is on the same file system.
    let end = match rest.as_bytes()[at] {
        b'<' => '>',
        _ => '"',
    };
    rest[at + 1..]
        .split(end)
        .next()
        .filter(|path| !path.starts_with("unfinished"))
}

#[test]
fn a_trace_shows_what_a_loop_calls_and_what_it_must_not() {
    let text = "\
7 1.0 ppoll([{fd=3<socket:[1]>, events=POLLIN}], 1, {tv_sec=0, tv_nsec=1}, NULL, 8) = 0 (Timeout)
7 2.1 openat(AT_FDCWD</tmp>, \"before\", O_RDONLY) = 4</tmp/before>
7 2.2 ppoll([{fd=3<socket:[1]>, events=POLLIN}], 1, {tv_sec=0, tv_nsec=1}, NULL, 8) = 0 (Timeout)
8 2.3 fsync(5</tmp/file>) = 0
7 2.3 openat(AT_FDCWD</tmp>, \"/dev/shm/a\", O_RDONLY <unfinished ...>
7 2.4 futex(0x7f, FUTEX_WAIT_BITSET_PRIVATE|FUTEX_CLOCK_REALTIME, 1, NULL) = 0
7 2.4 futex(0x7f10c60, FUTEX_WAIT_PRIVATE, 2, NULL) = 0
7 2.4 futex(0x7f4c4000030, FUTEX_WAIT_PRIVATE, 2, NULL) = 0
7 2.5 write(2<pipe:[9]>, \"a line\", 6) = 6
7 2.6 sendto(6<socket:[2]>, \"X\", 1, 0, NULL, 0) = 1
7 2.7 fcntl(6<socket:[2]>, F_SETFL, O_RDWR|O_NONBLOCK) = 0
7 2.8 sendto(6<socket:[2]>, \"X\", 1, 0, NULL, 0) = 1
7 2.9 openat(AT_FDCWD</tmp>, \"bridge.toml\", O_RDONLY) = 4</tmp/bridge.toml>
7 2.9 openat(AT_FDCWD</tmp>, \"bridge.toml\", O_RDONLY) = 4</tmp/bridge.toml>
7 2.9 ppoll([{fd=4</tmp/bridge.toml>, events=POLLIN}], 1, NULL, NULL, 8) = 1
7 2.9 read(4</proc/8/status>, \"\", 9) = 0
7 2.9 read(4</proc/7/status>, \"\", 9) = 0
7 9.0 openat(AT_FDCWD</tmp>, \"after\", O_RDONLY) = 4</tmp/after>
";
    let moments = [2, 3].map(Duration::from_secs);
    let maps = "7f10000-7f12000 rw-p 001d2000 fe:00 1 /lib/libc.so.6\n";
    let trace = Trace::read(text, maps, "bridge", 7, moments);
    let others: Vec<_> = trace
        .others
        .iter()
        .map(|((call, about), (_, count))| (call.as_str(), *about, *count))
        .collect();
    let expected = [
        ("futex", About::Lock, 1),
        ("openat", About::File, 2),
        ("ppoll", About::Sleep, 1),
        ("read", About::OtherProc, 1),
        ("sendto", About::WaitingSocket, 1),
        ("write", About::Pipe, 1),
    ];
    assert_eq!(others, expected);
    assert!(
        trace
            .seen
            .contains(&("openat".to_owned(), About::SharedMemory))
    );
    assert!(trace.seen.contains(&("sendto".to_owned(), About::Socket)));
}
