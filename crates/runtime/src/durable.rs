//! Files that must survive: [`replace`] writes one as a whole, so that a process that is killed and a power cut leave
//! the old content or the new one.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Puts `bytes` in the place of what `path` has; its folder is made if there is none. When this returns, they are on
/// the disk, which can take a second and more on a slow card. A link and the file's permissions stay.
///
/// The new content is written beside it, as `.NAME.new`. What a killed process has left there is written over; what
/// another process is writing at this moment is refused.
///
/// # Errors
///
/// The old content is there as it was; only when the folder cannot be forced onto the disk, the new one is, and a power
/// cut may bring the old one back.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let path = match fs::canonicalize(path) {
        Ok(path) => path,
        Err(error) if error.kind() == ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    let name = path.file_name().ok_or(ErrorKind::InvalidInput)?;
    let folder = folder_of(&path);
    fs::create_dir_all(folder)?;
    let mut new_name = OsString::from(".");
    new_name.push(name);
    new_name.push(".new");
    let new = folder.join(new_name);
    // Not truncated before it is locked.
    let mut options = File::options();
    let mut file = options
        .write(true)
        .create(true)
        .truncate(false)
        .open(&new)?;
    let is_ours = file.try_lock().is_ok() && is_there(&file, &new);
    if !is_ours {
        let why = "another process replaces it at this moment";
        return Err(io::Error::new(ErrorKind::ResourceBusy, why));
    }
    let written = write(&mut file, &path, bytes).and_then(|()| fs::rename(&new, &path));
    if written.is_err() {
        // Half of it takes room on a disk that is full.
        let _ = fs::remove_file(&new);
    }
    written.and_then(|()| sync_folder(folder))
}

/// Writes what is to be in the place of `path`, with its permissions.
fn write(file: &mut File, path: &Path, bytes: &[u8]) -> io::Result<()> {
    file.set_len(0)?;
    if let Ok(old) = fs::metadata(path) {
        file.set_permissions(old.permissions())?;
    }
    file.write_all(bytes)?;
    file.sync_all()
}

/// Forces the names in a folder onto the disk: before that, a power cut can take a new file with all that is in it.
///
/// # Errors
///
/// The disk refuses. A file system that cannot do that is no error.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder)?.sync_all() {
        Err(error) if error.kind() == ErrorKind::InvalidInput => Ok(()),
        synced => synced,
    }
}

/// The folder in which a file of this path lies.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Whether `path` is this file still: the process before may have given it its name.
fn is_there(file: &File, path: &Path) -> bool {
    let number = |found: fs::Metadata| (found.dev(), found.ino());
    let (own, there) = (file.metadata(), fs::symlink_metadata(path));
    own.ok().map(number) == there.ok().map(number)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn the_content_is_replaced_and_link_and_permissions_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/state");
        replace(&path, b"one, which is longer").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o604)).unwrap();
        let link = folder.path().join("link");
        symlink(&path, &link).unwrap();
        replace(&link, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        let mode = fs::metadata(&path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode, 0o604);
        assert!(link.is_symlink());
        assert_eq!(fs::read_dir(folder.path().join("a")).unwrap().count(), 1);
    }

    #[test]
    fn what_a_killed_process_left_is_written_over_and_a_live_one_is_not_disturbed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let new = folder.path().join(".state.new");
        fs::write(&new, "what a killed process has left").unwrap();
        replace(&path, b"one").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one");
        assert!(!new.exists());
        let other = File::create(&new).unwrap();
        other.lock().unwrap();
        let refused = replace(&path, b"two").unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::ResourceBusy);
        assert_eq!(fs::read(&path).unwrap(), b"one");
        drop(other);
        replace(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
    }

    #[test]
    fn what_cannot_be_written_leaves_the_old_content() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        replace(&file, b"one").unwrap();
        assert!(replace(&file.join("below"), b"two").is_err());
        assert!(replace(Path::new("/"), b"two").is_err());
        assert_eq!(fs::read(&file).unwrap(), b"one");
        assert_eq!(folder_of(Path::new("state")), Path::new("."));
    }
}
