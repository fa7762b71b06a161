//! Creating files in a process that opens ports.
//!
//! iceoryx2 changes the umask while it binds the socket of a listener, and sets it back afterwards. The umask belongs
//! to the whole process, not to a thread. So another thread that creates a folder at that moment gets one that no
//! process can enter (mode 600), a file gets mode 600, and a child process that is started then keeps the wrong umask
//! for good. And of two threads that bind sockets at once, the second saves what the first has set: when they set it
//! back in the wrong order, the umask of the process stays wrong. Root may enter every folder, and therefore does not
//! notice.
//!
//! Therefore this crate makes nodes, services, ports and files of its own under one lock of the process. It is the only
//! lock in the RIL, because the umask is the only state that the threads of a process cannot divide among them. A
//! thread that holds it waits for no file lock of another process, and nothing that carries data takes it: the segments
//! that iceoryx2 makes while samples are sent and received get their modes explicitly, whatever the umask is. Nor does
//! the housekeeper's removal of dead members, which can take long: it binds no socket.
//!
//! A program with other threads that create files, or start processes, has two ways:
//!
//! * [`while_no_port_opens`] takes the same lock, so ports wait for what it runs;
//! * [`create_new`] and [`create_dir_all`] create first, and begin anew if a port was opened meanwhile: no port waits
//!   for a slow disk. They set no modes themselves, so that default access lists and group folders keep working.
//!
//! A child that was forked from a process that had joined opens no port, so it needs no lock, and takes none: another
//! thread of its parent may have had it.

use std::cell::Cell;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::forked::is_forked;

/// The lock of the process: held while iceoryx2 may have changed the umask, and while files are created.
static UMASK: Mutex<()> = Mutex::new(());

/// How often [`UMASK`] was taken by a thread that may change the umask.
static TURNS: AtomicU64 = AtomicU64::new(0);

/// How often [`create_new`] and [`create_dir_all`] begin anew before they take the lock. A process opens its ports in
/// milliseconds and then hardly ever another one, so that the second attempt is rare and a third one is not expected.
const ATTEMPTS: u32 = 8;

thread_local! {
    /// Whether this thread has the lock already.
    static IS_HELD: Cell<bool> = const { Cell::new(false) };
}

/// Runs `make` while no other thread of this process opens a port, so that the umask is the one that the process has
/// chosen.
///
/// Use it to create files and to start processes, and make it short: threads that open ports wait meanwhile. `make` may
/// open ports itself.
pub fn while_no_port_opens<T>(make: impl FnOnce() -> T) -> T {
    if IS_HELD.get() || is_forked() {
        return make();
    }
    let _lock = lock();
    TURNS.fetch_add(1, Ordering::SeqCst);
    let _held = Held::begin();
    make()
}

fn lock() -> MutexGuard<'static, ()> {
    // A thread that panicked has set the umask back: iceoryx2 does that while unwinding.
    UMASK.lock().unwrap_or_else(PoisonError::into_inner)
}

/// This thread has the lock, until this is dropped.
struct Held;

impl Held {
    fn begin() -> Held {
        IS_HELD.set(true);
        Held
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        IS_HELD.set(false);
    }
}

/// As [`File::create_new`], but other threads may open ports meanwhile, which do not wait for the disk.
///
/// # Errors
///
/// As [`File::create_new`].
pub fn create_new(path: &Path) -> io::Result<File> {
    create_undisturbed(|| File::create_new(path), || fs::remove_file(path))
}

/// As [`fs::create_dir_all`], but other threads may open ports meanwhile, which do not wait for the disk.
///
/// # Errors
///
/// As [`fs::create_dir_all`].
pub fn create_dir_all(path: &Path) -> io::Result<()> {
    let create = || create_undisturbed(|| fs::create_dir(path), || fs::remove_dir(path));
    let result = match (create(), path.parent()) {
        (Err(error), Some(parent)) if error.kind() == io::ErrorKind::NotFound => {
            create_dir_all(parent)?;
            create()
        }
        (result, _) => result,
    };
    match result {
        Err(_) if path.is_dir() => Ok(()),
        result => result,
    }
}

/// Creates something with the right umask, without keeping ports from being opened meanwhile.
fn create_undisturbed<T>(
    create: impl Fn() -> io::Result<T>,
    remove: impl Fn() -> io::Result<()>,
) -> io::Result<T> {
    if IS_HELD.get() || is_forked() {
        return create();
    }
    for _ in 0..ATTEMPTS {
        let turns = {
            let _lock = lock();
            TURNS.load(Ordering::SeqCst)
        };
        let created = create()?;
        if TURNS.load(Ordering::SeqCst) == turns {
            return Ok(created);
        }
        // Its mode may be wrong. No other process knows of it yet.
        remove()?;
    }
    while_no_port_opens(create)
}

/// A folder of a test, beside which others open ports. In `/tmp`, because the names of sockets must be short.
#[cfg(test)]
pub(crate) fn test_folder() -> tempfile::TempDir {
    while_no_port_opens(|| tempfile::tempdir_in("/tmp")).expect("a temporary folder")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_created_with_those_above_and_may_be_there() {
        let folder = test_folder();
        let deep = folder.path().join("a/b/c");
        for _ in 0..2 {
            create_dir_all(&deep).unwrap();
            assert!(deep.is_dir());
        }
        let file = folder.path().join("file");
        create_new(&file).unwrap();
        assert_eq!(
            create_new(&file).unwrap_err().kind(),
            io::ErrorKind::AlreadyExists
        );
        assert!(create_dir_all(&file).is_err());
        assert!(create_dir_all(&file.join("below")).is_err());
    }

    #[test]
    fn what_was_created_while_a_port_was_opened_is_created_anew() {
        let (attempts, removals) = (Cell::new(0), Cell::new(0));
        let open_port = || std::thread::spawn(|| while_no_port_opens(|| ())).join();
        let create = || {
            attempts.set(attempts.get() + 1);
            if attempts.get() == 1 {
                open_port().unwrap();
            }
            Ok(attempts.get())
        };
        let remove = || {
            removals.set(removals.get() + 1);
            Ok(())
        };
        let created = create_undisturbed(create, remove).unwrap();
        // Tests beside this one may open ports too.
        assert!(created >= 2);
        assert!((created - 1..=created).contains(&removals.get()));
    }

    #[test]
    fn the_lock_can_be_taken_again_by_its_thread_and_is_given_back_by_a_panic() {
        assert_eq!(while_no_port_opens(|| while_no_port_opens(|| 1)), 1);
        let panicked = std::thread::spawn(|| while_no_port_opens(|| panic!("meant to be")));
        assert!(panicked.join().is_err());
        assert_eq!(while_no_port_opens(|| 2), 2);
    }
}
