//! Where log files live. A test puts another [`Store`] in the place of the file system.
//!
//! Nothing here decides: which file is old, what is too much and when to retry is [`LogWriter`]'s business. Every call
//! may take as long as the disk needs; only the thread of that log waits for it.
//!
//! [`LogWriter`]: super::writer::LogWriter

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use ipc_types::{MonotonicNs, files};
use runtime::durable;

use super::clock::ClockAnchor;
use super::file_name::{FileKind, file_name};
use super::tsv::whole_rows;

/// How many names are tried when files of that name exist: far more than a process creates within one second. Beyond it
/// the attempt fails; nothing is ever overwritten.
const MAX_TRIES: u32 = 100;

/// How much of a file's end is searched for the end of its last whole row. A kill or a power cut leaves there at most
/// what was written since the last time it was forced onto the disk: 5 s × 500 samples/s × 400 bytes = 1 MB. If there
/// is no end of a row in it, the file is left as it is.
const MAX_TAIL_BYTES: u64 = 1024 * 1024;

/// The directories and files of logs.
pub trait Store {
    /// A file that is being written.
    type File: LogFile;

    /// What the clocks show now, for the names of files and the times in them.
    fn clock(&self) -> ClockAnchor;

    /// Creates `directory` unless it is there.
    ///
    /// # Errors
    /// It can neither be found nor created.
    fn prepare(&mut self, directory: &Path) -> io::Result<()>;

    /// Room that is left to ordinary users where `directory` lies, bytes.
    ///
    /// # Errors
    /// The file system does not say.
    fn free_bytes(&mut self, directory: &Path) -> io::Result<u64>;

    /// Names and lengths in bytes of those regular files in `directory` whose name is `wanted`.
    ///
    /// # Errors
    /// The directory cannot be read.
    fn list(
        &mut self,
        directory: &Path,
        wanted: &dyn Fn(&str) -> bool,
    ) -> io::Result<Vec<(String, u64)>>;

    /// Removes `file`; that it is gone already is no error.
    ///
    /// # Errors
    /// It is still there.
    fn remove(&mut self, file: &Path) -> io::Result<()>;

    /// Truncates `file` behind its last whole row, unless another process is writing it; gives how many bytes went.
    ///
    /// # Errors
    /// The file is as it was.
    fn truncate_partial_row(&mut self, file: &Path) -> io::Result<u64>;

    /// Creates a new file of this kind in `directory` whose name begins with `stem`.
    ///
    /// # Errors
    /// It cannot be created.
    fn create(
        &mut self,
        directory: &Path,
        stem: &str,
        kind: FileKind,
    ) -> io::Result<(PathBuf, Self::File)>;
}

/// A file of a log. Each `write` may take a part of what it is given.
pub trait LogFile: Write {
    /// Makes the file `bytes` long.
    ///
    /// # Errors
    /// The file is as long as it was.
    fn truncate(&mut self, bytes: u64) -> io::Result<()>;

    /// Forces what was written onto the disk.
    ///
    /// # Errors
    /// What was written since the last time may not be on the disk, or another program has removed the file.
    fn sync(&mut self) -> io::Result<()>;
}

/// The file system.
#[derive(Clone, Copy, Debug, Default)]
pub struct FileStore;

impl Store for FileStore {
    type File = File;

    fn clock(&self) -> ClockAnchor {
        // 1970 if the machine's clock stands before that.
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        let unix_ns = since_1970.map_or(0, |duration| duration.as_nanos());
        ClockAnchor {
            unix_ns: u64::try_from(unix_ns).unwrap_or(u64::MAX),
            monotonic: MonotonicNs::now(),
        }
    }

    fn prepare(&mut self, directory: &Path) -> io::Result<()> {
        // Ports that status opens meanwhile neither change the modes nor wait for the disk.
        files::create_dir_all(directory)
    }

    fn free_bytes(&mut self, directory: &Path) -> io::Result<u64> {
        let system = rustix::fs::statvfs(directory)?;
        Ok(system.f_bavail.saturating_mul(system.f_frsize))
    }

    fn list(
        &mut self,
        directory: &Path,
        wanted: &dyn Fn(&str) -> bool,
    ) -> io::Result<Vec<(String, u64)>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(directory)? {
            let entry = entry?;
            let Ok(name) = entry.file_name().into_string() else {
                continue;
            };
            if !wanted(&name) {
                continue;
            }
            // Metadata of the entry itself: a link is no log. A file that vanished meanwhile needs no room.
            match entry.metadata() {
                Ok(metadata) if metadata.is_file() => found.push((name, metadata.len())),
                Ok(_) => {}
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(found)
    }

    fn remove(&mut self, file: &Path) -> io::Result<()> {
        match fs::remove_file(file) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            result => result,
        }
    }

    fn truncate_partial_row(&mut self, file: &Path) -> io::Result<u64> {
        let mut file = File::options().read(true).write(true).open(file)?;
        file.try_lock()?;
        let bytes = file.metadata()?.len();
        let tail_begin = bytes.saturating_sub(MAX_TAIL_BYTES);
        file.seek(SeekFrom::Start(tail_begin))?;
        let mut tail = Vec::new();
        Read::take(&file, MAX_TAIL_BYTES).read_to_end(&mut tail)?;
        match whole_rows(&tail) {
            0 => Ok(0),
            whole => {
                let whole_bytes = tail_begin + whole as u64;
                if whole_bytes < bytes {
                    file.set_len(whole_bytes)?;
                }
                Ok(bytes.saturating_sub(whole_bytes))
            }
        }
    }

    fn create(
        &mut self,
        directory: &Path,
        stem: &str,
        kind: FileKind,
    ) -> io::Result<(PathBuf, File)> {
        for number in 1..=MAX_TRIES {
            let path = directory.join(file_name(stem, number, kind));
            match files::create_new(&path) {
                Ok(file) => {
                    // Tells `truncate_partial_row` that it is being written. Without locks nothing is truncated.
                    let _ = file.try_lock();
                    // A power cut could otherwise take the file's name, and with it the file. A disk that refuses shows
                    // at the next sync.
                    let _ = durable::sync_folder(directory);
                    return Ok((path, file));
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }
}

impl LogFile for File {
    fn truncate(&mut self, bytes: u64) -> io::Result<()> {
        self.set_len(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        // The length belongs to the data; times of access do not.
        self.sync_data()?;
        if self.metadata()?.nlink() == 0 {
            let reason = "the file was removed while it was being written";
            return Err(io::Error::new(io::ErrorKind::NotFound, reason));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn an_existing_file_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let directory = folder.path().join("a/b");
        FileStore.prepare(&directory).unwrap();
        for expected in ["x.tsv", "x.2.tsv", "x.3.tsv"] {
            let (path, mut file) = FileStore.create(&directory, "x", FileKind::Tsv).unwrap();
            file.write_all(expected.as_bytes()).unwrap();
            assert_eq!(path, directory.join(expected));
        }
        let first = fs::read_to_string(directory.join("x.tsv")).unwrap();
        assert_eq!(first, "x.tsv");
    }

    #[test]
    fn names_run_out_before_anything_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        for _ in 0..MAX_TRIES {
            FileStore.create(folder.path(), "x", FileKind::Tsv).unwrap();
        }
        let error = FileStore
            .create(folder.path(), "x", FileKind::Tsv)
            .unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
    }

    #[test]
    fn a_directory_that_cannot_be_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let directory = file.join("log");
        assert!(FileStore.prepare(&directory).is_err());
        assert!(FileStore.create(&directory, "x", FileKind::Tsv).is_err());
        assert!(FileStore.list(&directory, &|_| true).is_err());
        assert!(FileStore.free_bytes(&directory).is_err());
    }

    #[test]
    fn regular_files_with_a_wanted_name_are_listed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a"), "123").unwrap();
        fs::write(at("unwanted"), "1").unwrap();
        fs::create_dir(at("folder")).unwrap();
        symlink(at("unwanted"), at("link")).unwrap();
        let wanted = |name: &str| name != "unwanted";
        let found = FileStore.list(folder.path(), &wanted).unwrap();
        assert_eq!(found, [("a".to_owned(), 3)]);
        assert!(FileStore.free_bytes(folder.path()).unwrap() > 0);
    }

    #[test]
    fn what_follows_the_last_whole_row_is_truncated() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.tsv");
        let long = format!("row\n{}", "x".repeat(MAX_TAIL_BYTES as usize));
        #[rustfmt::skip]
        let cases = [
            ("", ""), ("a\tb\n", "a\tb\n"), ("a\tb\n1", "a\tb\n"), ("a\n1\n2\n\0\0\0", "a\n1\n2\n"),
            // Nothing whole that could be kept.
            ("a\tb", "a\tb"), (&long, &long), (&long[1..], &long[1..]),
            // Just within reach.
            (&long[..long.len() - 1], "row\n"),
        ];
        for (before, after) in cases {
            fs::write(&path, before).unwrap();
            let cut = FileStore.truncate_partial_row(&path).unwrap();
            assert_eq!(cut as usize, before.len() - after.len());
            assert!(fs::read_to_string(&path).unwrap() == after);
        }
    }

    #[test]
    fn a_file_that_is_being_written_is_not_truncated() {
        let folder = tempfile::tempdir().unwrap();
        let (path, mut file) = FileStore.create(folder.path(), "x", FileKind::Tsv).unwrap();
        file.write_all(b"whole\nha").unwrap();
        assert!(FileStore.truncate_partial_row(&path).is_err());
        file.write_all(b"lf\n").unwrap();
        drop(file);
        assert_eq!(FileStore.truncate_partial_row(&path).unwrap(), 0);
        assert_eq!(fs::read(&path).unwrap(), b"whole\nhalf\n");
    }

    #[test]
    fn a_file_is_truncated_removed_and_missed() {
        let folder = tempfile::tempdir().unwrap();
        let (path, mut file) = FileStore.create(folder.path(), "x", FileKind::Tsv).unwrap();
        file.write_all(b"whole\nha").unwrap();
        file.truncate(6).unwrap();
        file.sync().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole\n");
        for _ in 0..2 {
            FileStore.remove(&path).unwrap();
        }
        assert_eq!(file.sync().unwrap_err().kind(), io::ErrorKind::NotFound);
        assert!(FileStore.remove(folder.path()).is_err());
    }
}
