//! Folders of the user's own, and files in them whose locks say that a process is there.
//!
//! All locks are `flock`s, because the kernel drops them with the process, however it ends. None is waited for here.

use std::fs::{self, DirBuilder, DirEntry, File, Metadata, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::{FlockOperation, OFlags};
use rustix::io::Errno;

use crate::domain_error::DomainError;
use crate::files;

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
        return refuse(reason, OTHER_DOMAIN);
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

/// Opens a file to lock it, and makes it if need be. Nothing when its folder is gone.
pub(crate) fn open_lock_file(path: &Path) -> Result<Option<File>, DomainError> {
    let mut options = OpenOptions::new();
    options
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32);
    match files::while_no_port_opens(|| options.open(path)) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(DomainError::io("open", path, error)),
    }
}

/// Opens a file without making it, and without waiting for a pipe that stands in its place.
pub(crate) fn open_to_look(path: &Path) -> io::Result<File> {
    OpenOptions::new()
        .read(true)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32)
        .open(path)
}

/// What is in a folder; nothing when it cannot be read, because it is gone for example.
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
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(ours), Ok(present)) => ours.dev() == present.dev() && ours.ino() == present.ino(),
        _ => false,
    }
}
