//! Where schemas lie: a file for each topic, in a folder that every process of the robot can read.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::{MAX_TEXT_LEN, Schema, SchemaError};
use crate::files;
use crate::service::is_key;

/// Ends the name of a schema's file.
const SUFFIX: &str = ".msg";

/// Most files of a folder that are listed. A robot has a few dozen topics.
const MAX_LISTED: usize = 4096;

/// A schema cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Nobody has stored one.
    #[error("there is no schema of `{0}`: no running process has such a topic")]
    Missing(String),
    /// It cannot be read.
    #[error("the schema {} cannot be read", .path.display())]
    Unreadable {
        /// Where it lies.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// It is none.
    #[error("the schema {} is not usable", .path.display())]
    Invalid {
        /// Where it lies.
        path: PathBuf,
        /// What is wrong with it.
        source: SchemaError,
    },
}

/// The file of `key` in `folder`. A key's parts have no `.`, so that different keys have different files.
fn path(folder: &Path, key: &str) -> PathBuf {
    folder.join(key.replace('/', ".") + SUFFIX)
}

/// Stores the schema `text` of the topic `key` in `folder`, which is made if it is missing.
///
/// Readers find the old text or the new one, never a part: the file is written under another name and then renamed.
/// A schema is no secret and no evidence: the reader compares its hash with that of the service.
///
/// # Errors
///
/// [`io::ErrorKind::InvalidInput`] for a key that cannot be one, and what the operating system says.
pub fn store(folder: &Path, key: &str, text: &str) -> io::Result<()> {
    check_key(key)?;
    files::create_dir_all(folder)?;
    let path = path(folder, key);
    // Two processes never store the same key at once, but the remains of a killed one may lie there.
    let draft = path.with_extension(format!("{}.draft", std::process::id()));
    let _ = fs::remove_file(&draft);
    let mut file = files::create_new(&draft)?;
    let written = file
        .write_all(text.as_bytes())
        .and_then(|()| fs::rename(&draft, &path));
    if written.is_err() {
        let _ = fs::remove_file(&draft);
    }
    written
}

/// Loads the schema of the topic `key` from `folder`.
///
/// # Errors
///
/// See [`LoadError`].
pub fn load(folder: &Path, key: &str) -> Result<Schema, LoadError> {
    if check_key(key).is_err() {
        return Err(LoadError::Missing(key.to_owned()));
    }
    let path = path(folder, key);
    let text = match read(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(LoadError::Missing(key.to_owned()));
        }
        Err(source) => return Err(LoadError::Unreadable { path, source }),
    };
    Schema::parse(&text).map_err(|source| LoadError::Invalid { path, source })
}

/// The keys of the topics whose schemas are in `folder`, in alphabetical order; none when there is no folder.
///
/// # Errors
///
/// What the operating system says.
pub fn names(folder: &Path) -> io::Result<Vec<String>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut keys = Vec::new();
    for entry in entries.take(MAX_LISTED) {
        let name = entry?.file_name();
        let key = name.to_str().and_then(|name| name.strip_suffix(SUFFIX));
        let key = key.map(|key| key.replace('.', "/"));
        keys.extend(key.filter(|key| is_key(key)));
    }
    keys.sort_unstable();
    Ok(keys)
}

/// Reads no more than a schema may have, and one byte that says that there is more.
fn read(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    // Before opening it, which would wait for a writer of a pipe.
    if !fs::metadata(path)?.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    File::open(path)?
        .take(MAX_TEXT_LEN as u64 + 1)
        .read_to_string(&mut text)?;
    Ok(text)
}

fn check_key(key: &str) -> io::Result<()> {
    match is_key(key) {
        true => Ok(()),
        false => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "no key of a service",
        )),
    }
}
