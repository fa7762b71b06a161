//! Configuration files: TOML whose every mistake is refused with file, line, reason and what to do.
//!
//! A file becomes a typed value once, here; inside a process nothing is checked again. Structures say
//! `#[serde(default, deny_unknown_fields)]`, and [`ranged!`](crate::ranged) bounds their numbers.
//!
//! [`resulting`] says for `--check-config` what a process runs with, and where each value comes from.
//!
//! Reading a configuration never waits for another process: the bridge does it in flight.

mod error;
mod fault;
mod file;
mod range;
pub mod resulting;
mod spelling;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

pub use serde::Deserializer;
use serde::de::DeserializeOwned;

pub use error::ConfigError;
use error::invalid;
pub use fault::Fault;
use file::read_or_default;
pub use range::{Number, in_range};
use spelling::explain;
pub use spelling::nearest;

/// A configuration and where it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded<T> {
    /// The configuration.
    pub value: T,
    /// The file; `None` if there was none and the built-in defaults apply.
    pub file: Option<PathBuf>,
    /// What the file says.
    text: String,
}

impl<T> Loaded<T> {
    /// The error that a fault of this configuration is, with file and line where the file has what is wrong.
    pub fn refuse(&self, fault: &Fault) -> ConfigError {
        let reason = fault.reason().to_owned();
        match (&self.file, fault.start(&self.text)) {
            (Some(file), Some(start)) => invalid(self.text.as_bytes(), start, reason, file),
            _ => ConfigError::Unfit { reason },
        }
    }
}

/// Reads the configuration from `explicit`, which must exist, or else from `default_file`, which may be absent.
///
/// # Errors
/// The file cannot be read, or its content is refused.
pub fn load<T: DeserializeOwned + Default>(
    explicit: Option<&Path>,
    default_file: &Path,
) -> Result<Loaded<T>, ConfigError> {
    let file = explicit.unwrap_or(default_file);
    Ok(match read_or_default(explicit, default_file)? {
        Some(text) => Loaded {
            value: parse(&text, file)?,
            file: Some(file.to_owned()),
            text,
        },
        None => Loaded {
            value: T::default(),
            file: None,
            text: String::new(),
        },
    })
}

/// Reads the configuration from `text`; errors call it `file_name`.
///
/// # Errors
/// The content is refused.
pub fn parse<T: DeserializeOwned>(
    text: &str,
    file_name: impl AsRef<Path>,
) -> Result<T, ConfigError> {
    toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start);
        let reason = explain(error.message());
        invalid(text.as_bytes(), start, reason, file_name.as_ref())
    })
}
