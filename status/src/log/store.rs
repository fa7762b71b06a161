//! Where log files are created. A test puts another [`Store`] in the place of the file system.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// How many names are tried when files of that name exist: far more logs than a process has within one second. Beyond
/// it the log is given up; nothing is ever overwritten.
const MAX_TRIES: u32 = 100;

/// What takes the bytes of a log.
pub type Sink = Box<dyn Write>;

/// Creates log files.
pub trait Store {
    /// Creates a new file in `directory` whose name begins with `stem`.
    ///
    /// # Errors
    /// The directory or the file cannot be created.
    fn create(&mut self, directory: &Path, stem: &str) -> io::Result<(PathBuf, Sink)>;
}

/// The file system.
#[derive(Clone, Copy, Debug, Default)]
pub struct FileStore;

impl Store for FileStore {
    fn create(&mut self, directory: &Path, stem: &str) -> io::Result<(PathBuf, Sink)> {
        fs::create_dir_all(directory)?;
        let mut result = Err(io::ErrorKind::AlreadyExists.into());
        for number in 1..=MAX_TRIES {
            let name = match number {
                1 => format!("{stem}.tsv"),
                _ => format!("{stem}_{number}.tsv"),
            };
            let path = directory.join(name);
            match File::create_new(&path) {
                Ok(file) => return Ok((path, Box::new(file))),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => {
                    result = Err(error);
                    break;
                }
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_existing_file_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let directory = folder.path().join("a/b");
        for expected in ["x.tsv", "x_2.tsv", "x_3.tsv"] {
            let (path, mut sink) = FileStore.create(&directory, "x").unwrap();
            sink.write_all(expected.as_bytes()).unwrap();
            assert_eq!(path, directory.join(expected));
        }
        let first = fs::read_to_string(directory.join("x.tsv")).unwrap();
        assert_eq!(first, "x.tsv");
    }

    #[test]
    fn names_run_out_before_anything_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        for _ in 0..MAX_TRIES {
            FileStore.create(folder.path(), "x").unwrap();
        }
        let error = FileStore.create(folder.path(), "x").err().unwrap();
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
    }

    #[test]
    fn a_directory_that_cannot_be_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        assert!(FileStore.create(&file.join("log"), "x").is_err());
    }
}
