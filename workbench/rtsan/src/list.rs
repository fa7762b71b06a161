//! [`STEADY`], [`CLIENTS`]: what a loop may call in flight of which RealtimeSanitizer says that it can wait, and for
//! each why it does not.

/// Functions that do not wait where they are called from.
pub struct Row {
    /// Their names.
    calls: &'static str,
    /// A part of the name of a function above them.
    pub inside: &'static str,
    /// Why.
    pub why: &'static str,
}

/// What may be called at any time.
#[rustfmt::skip]
pub const STEADY: &[Row] = &[
    Row { calls: "ppoll", inside: "ipc_types::waiter::Sleep::poll", why: "the one wait" },
    Row { calls: "syscall", inside: "ipc_types::doorbell::Doorbell::sleep", why: "the one wait of a process that has publishers and subscribers alone: a futex" },
    Row { calls: "syscall", inside: "ipc_types::doorbell::Doorbell::ring", why: "a futex that wakes others and goes on" },
    Row { calls: "sendto", inside: "ipc_types::wake::WakeSender::wake", why: "wakes who waits for a socket, which was asked not to wait" },
    Row { calls: "read write ppoll", inside: "bridge::shell::serial::SerialPort", why: "the line was opened with O_NONBLOCK; after a standstill it is waited for at most 10 ms" },
    Row { calls: "malloc free", inside: "chunk_mut_shared_state", why: "iceoryx2's handle of a sample that is sent, at most 104 bytes" },
    Row { calls: "malloc realloc free", inside: "module_kit::journal::", why: "a journal that is followed: its buffers grow to their size, and lines of the log" },
    Row { calls: "malloc realloc free", inside: "journal::Snapshot::take", why: "a snapshot of the journal, which is made when no sample waits" },
    Row { calls: "free", inside: "journal::Journaled::", why: "a snapshot of the journal, which is made when no sample waits" },
    Row { calls: "malloc realloc free syscall", inside: "status::shell::Shell::log_events", why: "a line of the log, such as that the machine has stalled; and a futex that wakes the thread that writes it" },
    Row { calls: "malloc", inside: "status::core::Status::", why: "what that line says" },
];

/// What may be called as well when clients come, go, and give orders.
#[rustfmt::skip]
pub const CLIENTS: &[Row] = &[
    Row { calls: "malloc calloc realloc free", inside: "", why: "memory of the process; no thread of ours has its locks while it waits" },
    Row { calls: "shm_open mmap munmap fchmod fcntl close shm_unlink", inside: "ipc_types::", why: "segments and sockets of clients: tmpfs, memory alone" },
    Row { calls: "socket connect", inside: "ipc_types::wake::WakeSender::wake", why: "a socket that was asked not to wait" },
    Row { calls: "recvfrom", inside: "ipc_types::wake::drain_listener", why: "a socket that was asked not to wait" },
    Row { calls: "syscall", inside: "ipc_types::reserve::hold_descriptors", why: "new descriptors of memory" },
    Row { calls: "syscall ppoll close", inside: "bridge::shell::controller::Watched", why: "a descriptor of a process, which is asked with a limit of 0" },
    Row { calls: "syscall", inside: "runtime::output::Output::offer", why: "a futex that wakes the thread of the log" },
    Row { calls: "syscall write read", inside: "runtime::helper::Helper", why: "a futex that wakes a thread, and an eventfd that was asked not to wait" },
    Row { calls: "send", inside: "signal_hook", why: "the signal to end, into a socket that was asked not to wait" },
];

/// The row of a stack; `None` if it is not on the list.
pub fn row_of(stack: &str, lists: &[&'static [Row]]) -> Option<&'static Row> {
    let call = stack.split('`').nth(1)?;
    let is_it = |row: &&Row| {
        row.calls.split(' ').any(|listed| listed == call) && stack.contains(row.inside)
    };
    lists.iter().copied().flatten().find(is_it)
}
