//! Folders of the user's own, and files in them whose locks say that a process is there.
//!
//! All locks are `flock`s, because the kernel drops them with the process, however it ends. None is waited for here.

use std::fs::{self, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use rustix::fs::FlockOperation;

pub(crate) use crate::disk::{LockFile, entries, is_one, is_same};

use crate::disk;
use crate::domain_error::DomainError;

/// Makes a folder of the user's own, unless it is there.
pub(crate) fn make_folder(folder: &Path) -> Result<(), DomainError> {
    let is_new = match disk::create_folder(folder) {
        Ok(()) => true,
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => false,
        Err(error) => return Err(DomainError::io("create", folder, error)),
    };
    #[cfg(test)]
    if disk::model::is_there() {
        return Ok(());
    }
    let metadata = match fs::symlink_metadata(folder) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(DomainError::io("look at", folder, error)),
    };
    let checked = check_folder(folder, &metadata);
    if checked.is_err() && is_new {
        // Else the next process would find it.
        let _ = disk::remove_folder(folder);
    }
    checked
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
    const OTHER_DOMAIN: &str = "remove it by hand, or choose another domain with RIL_IPC_ROOT";
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
    if metadata.mode() & 0o700 != 0o700 {
        let mode = metadata.mode() & 0o777;
        let reason = format!("its own user may not use it (mode {mode:03o})");
        // So is each folder that this process makes.
        return refuse(
            reason,
            "start with a umask that leaves the user's own rights, such as 022, and change the mode of a folder that is there to 700",
        );
    }
    Ok(())
}

/// Whether something belongs to this user.
pub(crate) fn is_ours(metadata: &Metadata) -> bool {
    metadata.uid() == rustix::process::geteuid().as_raw()
}

/// Opens a folder of the user's own; `None` if there is none.
pub(crate) fn open_folder(path: &Path) -> Result<Option<LockFile>, DomainError> {
    let error = match disk::open_folder(path) {
        #[cfg(test)]
        Ok(folder) if folder.is_modelled() => return Ok(Some(folder)),
        Ok(folder) => {
            let metadata = folder.metadata();
            let metadata = metadata.map_err(|error| DomainError::io("look at", path, error))?;
            return check_folder(path, &metadata).map(|()| Some(folder));
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
    folder: &LockFile,
    name: &str,
    path: &Path,
) -> Result<Option<LockFile>, DomainError> {
    let opened = disk::open_in(folder, name);
    if opened.is_err() {
        check_file(&path.join(name))?;
    }
    unless_missing(opened, "open", &path.join(name))
}

/// What stands in place of a file says more than that it cannot be opened. Nobody but a person puts it there, and no
/// process removes it.
fn check_file(path: &Path) -> Result<(), DomainError> {
    match fs::symlink_metadata(path) {
        Ok(metadata) if !metadata.is_file() => Err(DomainError::Unsafe {
            path: path.to_owned(),
            reason: "it is not a file".to_owned(),
            next_step: "remove it by hand while no process of this robot runs",
        }),
        _ => Ok(()),
    }
}

/// Opens the file `name` of `folder`, and makes it if need be; `None` if its folder was removed.
pub(crate) fn make_lock_file_in(
    folder: &LockFile,
    name: &str,
    path: &Path,
) -> Result<Option<LockFile>, DomainError> {
    unless_missing(disk::make_in(folder, name), "open", &path.join(name))
}

/// What came of a call; `None` if what it was for is not there.
pub(crate) fn unless_missing<T>(
    result: io::Result<T>,
    action: &'static str,
    path: &Path,
) -> Result<Option<T>, DomainError> {
    match result {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(DomainError::io(action, path, error)),
    }
}

/// Locks without waiting; says whether the lock was got.
pub(crate) fn flock(
    file: &LockFile,
    operation: FlockOperation,
    path: &Path,
) -> Result<bool, DomainError> {
    match disk::flock(file, operation) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(false),
        Err(error) => Err(DomainError::io("lock", path, error)),
    }
}
