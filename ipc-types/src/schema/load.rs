//! Reads a schema that a provider has laid beside its service.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::bounds::MAX_TEXT_LEN;
use super::definition::Schema;
use super::parse::SchemaError;

/// A schema cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// No process provides such a service.
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

/// Loads the schema at `path`.
///
/// # Errors
///
/// See [`LoadError`].
pub fn load(path: &Path) -> Result<Schema, LoadError> {
    load_with_text(path).map(|(schema, _)| schema)
}

/// As [`load`], with the text itself.
///
/// # Errors
///
/// See [`LoadError`].
pub fn load_with_text(path: &Path) -> Result<(Schema, String), LoadError> {
    let path = path.to_owned();
    let text = match read(&path) {
        Ok(text) => text,
        Err(source) => return Err(LoadError::Unreadable { path, source }),
    };
    match Schema::parse(&text) {
        Ok(schema) => Ok((schema, text)),
        Err(source) => Err(LoadError::Invalid { path, source }),
    }
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
