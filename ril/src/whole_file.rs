//! [`replace`]: a file is replaced as a whole, so that there is always the old one or the new one, whenever the process or the machine ends.

use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// What a process has done of a file when it ends too early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Begun,
    Written,
    Synced,
    Renamed,
}

/// Replaces a file, or makes it and its folder. Links and permissions stay. It waits for the disk, milliseconds as a rule.
///
/// # Errors
///
/// When it cannot be written, or another process is just writing it.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    replace_by(path, bytes, |_| Ok(()))
}

/// The same; `done` is told of each step.
fn replace_by(
    path: &Path,
    bytes: &[u8],
    mut done: impl FnMut(Step) -> io::Result<()>,
) -> io::Result<()> {
    let (path, permissions) = match fs::canonicalize(path) {
        Ok(path) => {
            let permissions = fs::metadata(&path)?.permissions();
            (path, Some(permissions))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => (path.to_owned(), None),
        Err(error) => return Err(error),
    };
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder)?;
    let (mut file, new) = begin(&path)?;
    done(Step::Begun)?;
    if let Some(permissions) = permissions {
        file.set_permissions(permissions)?;
    }
    file.write_all(bytes)?;
    done(Step::Written)?;
    file.sync_all()?;
    done(Step::Synced)?;
    fs::rename(&new, &path)?;
    done(Step::Renamed)?;
    // A power cut could otherwise take the new name.
    File::open(folder)?.sync_all()
}

/// An empty file beside `path`, for this process alone. Its name is always the same, so that what a process has left half is written anew.
fn begin(path: &Path) -> io::Result<(File, PathBuf)> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".new");
    let new = path.with_file_name(name);
    let busy = || io::Error::new(ErrorKind::WouldBlock, "another process is writing it");
    let file = File::options()
        .write(true)
        .create(true)
        .truncate(false)
        .open(&new)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(busy()),
        Err(TryLockError::Error(error)) => return Err(error),
    }
    // The process that had the lock before may have given the file its final name.
    let is_there = fs::metadata(&new).is_ok_and(|there| {
        let own = file.metadata();
        own.is_ok_and(|own| (own.dev(), own.ino()) == (there.dev(), there.ino()))
    });
    if !is_there {
        return Err(busy());
    }
    file.set_len(0)?;
    Ok((file, new))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_process_that_ends_at_any_step_leaves_the_old_file_or_the_new_one() {
        for step in [Step::Begun, Step::Written, Step::Synced, Step::Renamed] {
            let parent = tempfile::tempdir().unwrap();
            let folder = parent.path().join("state/ril");
            let path = folder.join("robot-7.mission");
            replace(&path, b"old").unwrap();
            let ended = replace_by(&path, b"new", |done| match done == step {
                true => Err(io::Error::other("killed")),
                false => Ok(()),
            });
            assert!(ended.is_err());
            let kept = if step == Step::Renamed { "new" } else { "old" };
            assert_eq!(fs::read_to_string(&path).unwrap(), kept, "{step:?}");
            // The next one does not mind what was left, however long it is.
            replace(&path, b"n").unwrap();
            assert_eq!(fs::read(&path).unwrap(), b"n");
            assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        }
    }

    #[test]
    fn two_processes_do_not_mix_and_links_and_permissions_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a.toml"), folder.path().join("link"));
        replace(&path, b"old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        symlink("a.toml", &link).unwrap();
        let mut second = None;
        let first = replace_by(&path, b"first", |done| {
            if done == Step::Written {
                second = replace(&link, b"second").err().map(|error| error.kind());
            }
            Ok(())
        });
        assert!(first.is_ok());
        assert_eq!(second, Some(ErrorKind::WouldBlock));
        replace(&link, b"third").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"third");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(
            fs::metadata(&path).unwrap().permissions().mode() & 0o777,
            0o640
        );
    }
}
