//! Ctrl+C, SIGTERM and the end of the terminal (SIGHUP) as a file descriptor, so that they wake the one wait of a
//! process like any other input; and the signal of a file that may not grow, which must end no process.
//!
//! Nothing here runs code in a signal handler but the setting of a flag and a one-byte write, and nothing ends the
//! process by itself.

use std::io::{self, Read, Write};
use std::mem;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::low_level::{pipe, unregister};
use signal_hook::{SigId, flag};

/// What ends a process in order.
const SIGNALS: [i32; 3] = [SIGINT, SIGTERM, SIGHUP];

/// In the place of a signal: the wish came from a [`TerminationRequest`].
const BY_HAND: usize = usize::MAX;

/// Whether a [`Termination`] of this process owns the signals.
static OWNED: AtomicBool = AtomicBool::new(false);

/// Which signal came to the owner, also after it was dropped; 0 is none.
static CAME: OnceLock<Arc<AtomicUsize>> = OnceLock::new();

/// Whether a signal came since a [`Termination`] of this process owns them.
pub(crate) fn has_come() -> bool {
    let came = CAME.get();
    came.is_some_and(|signal| signal.load(Ordering::Acquire) != 0)
}

/// The wish that this process end. Put [`as_fd`](AsFd::as_fd) into the wait; it becomes readable when the wish comes.
///
/// A process has one owner of signals: libraries that install handlers of their own must be told not to.
#[derive(Debug)]
pub struct Termination {
    receiver: UnixStream,
    /// Which signal came, or [`BY_HAND`]; 0 is none. Set before the descriptor becomes readable. A process asks it at
    /// every wake, so it costs no system call.
    signal: Arc<AtomicUsize>,
    is_owner: bool,
    handlers: Vec<SigId>,
}

/// Why the signals could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum SignalError {
    /// Another part of this process owns the signals.
    #[error("SIGINT, SIGTERM and SIGHUP already have an owner in this process")]
    AlreadyOwned,
    /// The operating system refused.
    #[error("the handlers of SIGINT, SIGTERM and SIGHUP cannot be installed")]
    System(#[from] io::Error),
}

impl Termination {
    /// Takes SIGINT, SIGTERM and, unless it is ignored (`nohup`), SIGHUP. From now on they no longer end the process by
    /// themselves, not even after this value was dropped.
    pub fn install() -> Result<Termination, SignalError> {
        let (receiver, sender) = pair()?;
        if OWNED.swap(true, Ordering::AcqRel) {
            return Err(SignalError::AlreadyOwned);
        }
        let signal = Arc::clone(CAME.get_or_init(Arc::default));
        signal.store(0, Ordering::Release);
        let mut termination = Termination {
            receiver,
            signal,
            is_owner: true,
            handlers: Vec::new(),
        };
        // From the first handler on a signal does not end the process, but what is to be done with it is not known
        // before all are registered. Until then it waits.
        #[allow(unsafe_code)]
        let _waiting = BlockedSignals::begin(|set| {
            for signal in SIGNALS {
                // SAFETY: the set is there and the numbers are those of signals.
                unsafe { libc::sigaddset(set, signal) };
            }
        })?;
        // The handlers of a signal run in the order of their registration.
        for signal in SIGNALS {
            if signal == SIGHUP && is_ignored(signal) {
                continue;
            }
            let which = Arc::clone(&termination.signal);
            let handler = flag::register_usize(signal, which, signal as usize)?;
            termination.handlers.push(handler);
            let sender = sender.try_clone()?;
            termination.handlers.push(pipe::register(signal, sender)?);
        }
        Ok(termination)
    }

    /// A termination without signals, and the handle that requests it: for tests, and for a program that runs a
    /// process's loop in a thread.
    pub fn by_hand() -> io::Result<(Termination, TerminationRequest)> {
        let (receiver, sender) = pair()?;
        let signal = Arc::default();
        let request = TerminationRequest {
            sender,
            signal: Arc::clone(&signal),
        };
        let termination = Termination {
            receiver,
            signal,
            is_owner: false,
            handlers: Vec::new(),
        };
        Ok((termination, request))
    }

    /// The signal that came last; `None` if none did.
    pub fn signal(&self) -> Option<i32> {
        let signal = self.signal.load(Ordering::Acquire);
        // `BY_HAND` is no number of a signal.
        i32::try_from(signal).ok().filter(|signal| *signal != 0)
    }

    /// Whether the process should end. Never blocks; empties the descriptor, so that it wakes no thread again until the
    /// next signal.
    pub fn requested(&self) -> bool {
        let requested = self.is_set();
        if requested {
            // One read takes more signals than the three kinds can have pending; what is left wakes the next wait.
            let mut signals = [0; 64];
            let _ = (&self.receiver).read(&mut signals);
        }
        requested
    }

    fn is_set(&self) -> bool {
        self.signal.load(Ordering::Acquire) != 0
    }
}

/// Lets signals wait, for the calling thread, until it is dropped. Processes take their signals before they have other
/// threads, but for those that [`block_all`] keeps away from them.
#[derive(Debug)]
pub(crate) struct BlockedSignals {
    before: libc::sigset_t,
}

impl BlockedSignals {
    #[allow(unsafe_code)]
    fn begin(fill: impl FnOnce(&mut libc::sigset_t)) -> io::Result<BlockedSignals> {
        // SAFETY: a set is filled by the call before it is read, and each call is given sets of this function alone.
        let (before, error) = unsafe {
            let (mut set, mut before) = (mem::zeroed(), mem::zeroed());
            libc::sigemptyset(&mut set);
            fill(&mut set);
            let error = libc::pthread_sigmask(libc::SIG_BLOCK, &set, &mut before);
            (before, error)
        };
        match error {
            0 => Ok(BlockedSignals { before }),
            error => Err(io::Error::from_raw_os_error(error)),
        }
    }
}

impl Drop for BlockedSignals {
    #[allow(unsafe_code)]
    fn drop(&mut self) {
        // SAFETY: the set is the one that the kernel gave, and nothing is to be given back.
        unsafe {
            libc::pthread_sigmask(libc::SIG_SETMASK, &self.before, std::ptr::null_mut());
        }
    }
}

/// Lets every signal wait, for the calling thread and for threads that it starts, until what is returned is dropped.
#[allow(unsafe_code)]
pub(crate) fn block_all() -> io::Result<BlockedSignals> {
    // SAFETY: the set is there.
    BlockedSignals::begin(|set| _ = unsafe { libc::sigfillset(set) })
}

/// Whether the process that started this one had it ignore the signal.
#[allow(unsafe_code)]
fn is_ignored(signal: i32) -> bool {
    // SAFETY: without a new action the call only fills the structure that it is given.
    unsafe {
        let mut action: libc::sigaction = mem::zeroed();
        libc::sigaction(signal, std::ptr::null(), &mut action) == 0
            && action.sa_sigaction == libc::SIG_IGN
    }
}

/// Makes the descriptor readable. A full socket means that the wish is known; a closed one, that the end has come.
fn wake(mut sender: &UnixStream) {
    let _ = sender.write(b"T");
}

/// Ends this process by `signal`, as if nothing had ever handled it: a parent that waits for the process, such as a
/// shell or a loop in a script, then sees that it was interrupted. It returns only when the operating system refuses.
pub fn end_by(signal: i32) {
    let _ = signal_hook::low_level::emulate_default_handler(signal);
}

/// Lets a limit on the size of files (`ulimit -f`, `LimitFSIZE=`) be the error `EFBIG` of the write or of the segment
/// that is too long, which its caller reports. By default the limit's signal ends the process without a word.
///
/// A handler and not "ignore": programs that this process starts would inherit the latter, and not expect it.
///
/// # Errors
/// The operating system refuses the handler.
pub fn survive_file_size_limits() -> io::Result<()> {
    // A handler must do something; the flag is read by no one.
    let flag = Arc::new(AtomicBool::new(false));
    flag::register(SIGXFSZ, flag).map(|_handler| ())
}

/// Environment variable that makes a process of the RIL end with the process that started it, even when that is killed.
pub const WITH_PARENT: &str = "RIL_ENDS_WITH_PARENT";

/// Makes this process end with its parent, if [`WITH_PARENT`] asks for that.
///
/// # Errors
/// The operating system refuses, or the parent has gone already.
pub fn end_with_parent() -> io::Result<()> {
    if std::env::var_os(WITH_PARENT).is_none() {
        return Ok(());
    }
    set_parent_process_death_signal(Some(Signal::TERM))?;
    // A parent that has gone meanwhile sends no signal any more.
    if getppid().is_none_or(Pid::is_init) {
        return Err(io::Error::other(
            "the process that started this one is gone",
        ));
    }
    Ok(())
}

fn pair() -> io::Result<(UnixStream, UnixStream)> {
    let (receiver, sender) = UnixStream::pair()?;
    receiver.set_nonblocking(true)?;
    sender.set_nonblocking(true)?;
    Ok((receiver, sender))
}

impl AsFd for Termination {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.receiver.as_fd()
    }
}

impl Drop for Termination {
    fn drop(&mut self) {
        for handler in self.handlers.drain(..) {
            unregister(handler);
        }
        if self.is_owner {
            OWNED.store(false, Ordering::Release);
        }
    }
}

/// Requests a [`Termination`] by hand. Dropping it does so too: nothing else could request it.
#[derive(Debug)]
pub struct TerminationRequest {
    sender: UnixStream,
    signal: Arc<AtomicUsize>,
}

impl TerminationRequest {
    /// Requests the end.
    pub fn request(&self) {
        self.signal.store(BY_HAND, Ordering::Release);
        wake(&self.sender);
    }
}

impl Drop for TerminationRequest {
    fn drop(&mut self) {
        self.request();
    }
}

#[cfg(test)]
mod tests {
    use signal_hook::low_level::raise;

    use super::*;

    #[test]
    fn each_signal_requests_the_end_and_has_one_owner() {
        for signal in SIGNALS {
            let termination = Termination::install().unwrap();
            assert_eq!(termination.signal(), None);
            assert!(matches!(
                Termination::install(),
                Err(SignalError::AlreadyOwned)
            ));
            assert!(!termination.requested());
            raise(signal).unwrap();
            assert!(termination.requested());
            assert!(termination.requested(), "the wish stays");
            assert_eq!(termination.signal(), Some(signal));
        }
    }

    #[test]
    fn the_signal_of_a_file_that_may_not_grow_ends_nobody() {
        survive_file_size_limits().unwrap();
        raise(SIGXFSZ).unwrap();
    }

    #[test]
    fn a_request_by_hand_is_seen_and_so_is_its_loss() {
        let (termination, request) = Termination::by_hand().unwrap();
        assert!(!termination.requested());
        request.request();
        assert!(termination.requested());
        assert_eq!(termination.signal(), None);

        let (termination, request) = Termination::by_hand().unwrap();
        drop(request);
        assert!(termination.requested());
    }
}
