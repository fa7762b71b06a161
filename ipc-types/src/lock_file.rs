//! Folders of the user's own, and files in them whose locks say that a process is there.
//!
//! All locks are `flock`s, because the kernel drops them with the process, however it ends. None is waited for here.

use std::fs::{self, DirBuilder, DirEntry, File, Metadata, OpenOptions};
use std::io;
use std::ops::Deref;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::{FlockOperation, Mode, OFlags, openat};
use rustix::io::Errno;

use crate::domain_error::DomainError;
use crate::files;
use crate::forked::Maker;

/// An open file or folder that may be locked. Dropping it gives the lock back, even while a child process has a copy of
/// the descriptor: one that was forked and lives on, or one that has not yet called `exec`.
#[derive(Debug)]
pub(crate) struct LockFile {
    file: File,
    maker: Maker,
}

impl LockFile {
    fn new(file: File) -> LockFile {
        LockFile {
            file,
            maker: Maker::this_process(),
        }
    }
}

impl Deref for LockFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.file
    }
}

impl Drop for LockFile {
    fn drop(&mut self) {
        if self.maker.check().is_ok() {
            // Closing gives the lock back in any case, if no other process has a copy.
            let _ = rustix::fs::flock(&self.file, FlockOperation::NonBlockingUnlock);
        }
    }
}

/// Makes a folder of the user's own, unless it is there.
pub(crate) fn make_folder(folder: &Path) -> Result<(), DomainError> {
    match files::while_no_port_opens(|| DirBuilder::new().mode(0o700).create(folder)) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(DomainError::io("create", folder, error)),
    }
    let metadata = match fs::symlink_metadata(folder) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(DomainError::io("look at", folder, error)),
    };
    check_folder(folder, &metadata)
}

/// Refuses a folder in which others could put something.
fn check_folder(folder: &Path, metadata: &Metadata) -> Result<(), DomainError> {
    let refuse = |reason, next_step| {
        Err(DomainError::Unsafe {
            path: folder.to_owned(),
            reason,
            next_step,
        })
    };
    const OTHER_DOMAIN: &str = "remove it, or choose another domain with RIL_IPC_ROOT";
    if !metadata.is_dir() {
        return refuse("it is not a folder".to_owned(), OTHER_DOMAIN);
    }
    if !is_ours(metadata) {
        let uid = rustix::process::geteuid().as_raw();
        let reason = format!("it belongs to user {}, this is user {uid}", metadata.uid());
        // Robots of that user may live and fly there.
        const OTHER_USER: &str =
            "run as that user if its robots are meant, or choose another domain with RIL_IPC_ROOT";
        return refuse(reason, OTHER_USER);
    }
    if metadata.mode() & 0o022 != 0 {
        let mode = metadata.mode() & 0o777;
        let reason = format!("others may write to it (mode {mode:03o})");
        return refuse(reason, "change its mode to 700");
    }
    Ok(())
}

/// Whether something belongs to this user.
pub(crate) fn is_ours(metadata: &Metadata) -> bool {
    metadata.uid() == rustix::process::geteuid().as_raw()
}

/// Opens a folder of the user's own; `None` if there is none.
pub(crate) fn open_folder(path: &Path) -> Result<Option<LockFile>, DomainError> {
    let mut options = OpenOptions::new();
    options
        .read(true)
        .custom_flags((OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32);
    let error = match options.open(path) {
        Ok(folder) => {
            let metadata = folder.metadata();
            let metadata = metadata.map_err(|error| DomainError::io("look at", path, error))?;
            return check_folder(path, &metadata).map(|()| Some(LockFile::new(folder)));
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => error,
    };
    // What stands there instead says more.
    if let Ok(metadata) = fs::symlink_metadata(path) {
        check_folder(path, &metadata)?;
    }
    Err(DomainError::io("open", path, error))
}

/// Opens a file in a folder to lock it; `None` if there is none. `path` is the folder's.
pub(crate) fn open_lock_file_in(
    folder: &File,
    name: &str,
    path: &Path,
) -> Result<Option<LockFile>, DomainError> {
    open_in(folder, name, OFlags::empty(), path)
}

/// Opens the file `name` of `folder`, and makes it if need be; `None` if its folder was removed.
pub(crate) fn make_lock_file_in(
    folder: &File,
    name: &str,
    path: &Path,
) -> Result<Option<LockFile>, DomainError> {
    files::while_no_port_opens(|| open_in(folder, name, OFlags::CREATE, path))
}

fn open_in(
    folder: &File,
    name: &str,
    flags: OFlags,
    path: &Path,
) -> Result<Option<LockFile>, DomainError> {
    let flags = flags | OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW | OFlags::NONBLOCK;
    match openat(folder, name, flags, Mode::RUSR | Mode::WUSR) {
        Ok(file) => Ok(Some(LockFile::new(File::from(file)))),
        Err(Errno::NOENT) => Ok(None),
        Err(error) => Err(DomainError::io("open", &path.join(name), error)),
    }
}

/// Opens a file without making it, and without waiting for a pipe that stands in its place.
pub(crate) fn open_to_look(path: &Path) -> io::Result<LockFile> {
    OpenOptions::new()
        .read(true)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)
        .map(LockFile::new)
}

/// What is in a folder; empty if it cannot be read, because it is gone for example.
pub(crate) fn entries(folder: &Path) -> impl Iterator<Item = DirEntry> {
    fs::read_dir(folder).into_iter().flatten().flatten()
}

/// Locks without waiting; says whether the lock was got.
pub(crate) fn flock(
    file: &File,
    operation: FlockOperation,
    path: &Path,
) -> Result<bool, DomainError> {
    loop {
        return match rustix::fs::flock(file, operation) {
            Ok(()) => Ok(true),
            Err(Errno::WOULDBLOCK) => Ok(false),
            Err(Errno::INTR) => continue,
            Err(error) => Err(DomainError::io("lock", path, error)),
        };
    }
}

/// Whether `file` is still the one at `path`, not one that was removed or renamed meanwhile.
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    is_one(file.metadata(), fs::symlink_metadata(path))
}

/// Whether two descriptors are of one file.
pub(crate) fn is_same(one: &File, other: &File) -> bool {
    is_one(one.metadata(), other.metadata())
}

/// Whether both are of one file.
pub(crate) fn is_one(one: io::Result<Metadata>, other: io::Result<Metadata>) -> bool {
    match (one, other) {
        (Ok(one), Ok(other)) => one.dev() == other.dev() && one.ino() == other.ino(),
        _ => false,
    }
}
