//! Configuration files: TOML whose every mistake is refused with file, line, reason and what to do.
//!
//! A file becomes a typed value once, here; inside a process nothing is checked again. Structures say
//! `#[serde(default, deny_unknown_fields)]`, and [`ranged!`](crate::ranged) bounds their numbers.
//!
//! [`proof`] has what the tests of each configuration prove; [`resulting`] says for `--check-config` what a process
//! runs with, and where each value comes from.
//!
//! Reading a configuration never waits for another process: the bridge does it in flight. Who must not wait for a disk
//! either uses [`load_within`].

mod error;
mod file;
pub mod proof;
pub mod resulting;
#[cfg(test)]
mod tests;

use std::fmt;
use std::ops::RangeBounds;
use std::path::{Path, PathBuf};
use std::time::Duration;

pub use serde::Deserializer;
use serde::Serialize;
use serde::de::{DeserializeOwned, Error};

pub use error::{ConfigError, Fault, nearest};
use error::{explain, invalid};
use file::{read_or_default, read_within};

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

/// All of `config` as its file has it, with the tables that its serialization leaves out because the journal of the
/// process does not have them.
pub fn to_toml(
    config: &impl Serialize,
    left_out: impl IntoIterator<Item = (&'static str, Result<toml::Value, toml::ser::Error>)>,
) -> String {
    // Every value came from such a text.
    let mut table = toml::Table::try_from(config).unwrap_or_default();
    let tables = left_out.into_iter();
    table.extend(tables.filter_map(|(name, value)| Some((name.to_owned(), value.ok()?))));
    toml::to_string(&table).unwrap_or_default()
}

/// Reads the configuration from `explicit`, which must exist, or else from `default_file`, which may be absent.
///
/// # Errors
/// The file cannot be read, or its content is refused.
pub fn load<T: DeserializeOwned + Default>(
    explicit: Option<&Path>,
    default_file: &Path,
) -> Result<Loaded<T>, ConfigError> {
    let text = read_or_default(explicit, default_file)?;
    loaded(text, explicit.unwrap_or(default_file))
}

/// Reads the configuration as [`load`] does, for at most `limit`: a disk that hangs keeps the caller no longer.
///
/// # Errors
/// As [`load`], and [`ConfigError::NotInTime`].
pub fn load_within<T: DeserializeOwned + Default>(
    explicit: Option<&Path>,
    default_file: &Path,
    limit: Duration,
) -> Result<Loaded<T>, ConfigError> {
    let text = read_within(explicit, default_file, limit)?;
    loaded(text, explicit.unwrap_or(default_file))
}

/// What the text of `file` says; `None` if there is no file.
fn loaded<T: DeserializeOwned + Default>(
    text: Option<String>,
    file: &Path,
) -> Result<Loaded<T>, ConfigError> {
    Ok(match text {
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

/// Reads a number and refuses it outside `range`; floats that are not finite are outside every range.
///
/// [`ranged!`](crate::ranged) makes this a function for `#[serde(deserialize_with)]`.
///
/// # Errors
/// The value is not a number of this type, or lies outside.
pub fn in_range<'de, T: Number, D: Deserializer<'de>>(
    deserializer: D,
    range: impl RangeBounds<T> + fmt::Debug,
) -> Result<T, D::Error> {
    let number = T::deserialize(deserializer)?;
    if number.is_finite() && range.contains(&number) {
        return Ok(number);
    }
    let range = format!("{range:?}")
        .replace("..=", " to ")
        .replace("..", " to below ");
    Err(D::Error::custom(format_args!(
        "{number} is out of range: it must be from {range}"
    )))
}

/// Defines functions for `#[serde(deserialize_with = "…")]` that read a bounded number.
///
/// ```
/// runtime::ranged! {
///     /// Bits per second.
///     pub fn baud_rate(u32) in 50..=4_000_000;
///     fn tolerance_m(f64) in 0.1..=50.0;
/// }
///
/// #[derive(Debug, serde::Deserialize)]
/// struct Port {
///     #[serde(deserialize_with = "baud_rate")]
///     baud_rate: u32,
///     #[serde(deserialize_with = "tolerance_m")]
///     tolerance_m: f64,
/// }
///
/// let text = "tolerance_m = 2\nbaud_rate = 3\n";
/// let error = runtime::config::parse::<Port>(text, "bridge.toml").unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "bridge.toml:2: 3 is out of range: it must be from 50 to 4000000, in `baud_rate = 3`"
/// );
/// ```
#[macro_export]
macro_rules! ranged {
    ($( $(#[$meta:meta])* $visibility:vis fn $name:ident($number:ty) in $range:expr; )+) => {
        $(
            $(#[$meta])*
            $visibility fn $name<'de, D: $crate::config::Deserializer<'de>>(
                deserializer: D,
            ) -> ::core::result::Result<$number, D::Error> {
                $crate::config::in_range(deserializer, $range)
            }
        )+
    };
}

/// Numbers that [`in_range`] can bound.
pub trait Number: DeserializeOwned + PartialOrd + fmt::Display {
    /// Whether this is a number at all: neither infinite nor not-a-number.
    fn is_finite(&self) -> bool;
}

macro_rules! numbers {
    ($($integer:ty),+; $($float:ty),+) => {
        $(impl Number for $integer { fn is_finite(&self) -> bool { true } })+
        $(impl Number for $float { fn is_finite(&self) -> bool { <$float>::is_finite(*self) } })+
    };
}

numbers!(u8, u16, u32, u64, usize, i8, i16, i32, i64, isize; f32, f64);
