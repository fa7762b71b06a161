//! `[[log]]` in `status.toml`: what one log writes, where, and how much.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::groups::LogGroups;

/// Longest name of a log, characters; a file name has room for it ten times over.
const MAX_NAME_CHARS: usize = 24;

const MIB: u64 = 1024 * 1024;

runtime::ranged! {
    fn max_file_mib(u64) in 1..=4095;
    fn max_total_mib(u64) in 2..=1_048_576;
    fn min_free_mib(u64) in 0..=1_048_576;
}

/// What a log may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogLimits {
    /// No file becomes longer, bytes.
    pub max_file_bytes: u64,
    /// All files of the log together take no more, bytes.
    pub max_total_bytes: u64,
    /// If less is free on the disk, nothing is written, bytes.
    pub min_free_bytes: u64,
}

impl LogLimits {
    /// How much must be free so that something is written, bytes. To go on after a pause takes an eighth more, so that
    /// other programs that use and free room at the limit do not make the log pause repeatedly.
    pub const fn needed_bytes(&self, is_pausing: bool) -> u64 {
        match is_pausing {
            true => self.min_free_bytes.saturating_add(self.min_free_bytes / 8),
            false => self.min_free_bytes,
        }
    }
}

/// How the files of a log are called.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FileNameFormat {
    /// Names of the original software: `hero(1)_28_08_06-20_39_26.tsv`, day first.
    #[default]
    Source,
    /// Names in the order of time: `hero1_2006-08-28T20-39-26Z.tsv`.
    Sortable,
}

impl FileNameFormat {
    /// All formats. A log recognises its old files in each, so that a change of the format strands none.
    pub const ALL: [FileNameFormat; 2] = [FileNameFormat::Source, FileNameFormat::Sortable];
}

/// One log.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct LogConfig {
    /// Distinguishes the file from those of other logs.
    pub name: LogName,
    /// Where the file goes; created when it is absent. A relative path starts at the working directory.
    pub directory: PathBuf,
    /// What is logged; nothing is created when this is empty.
    pub groups: LogGroups,
    /// Whether each row has the time in UTC.
    pub utc: bool,
    /// How the files are called.
    pub file_name: FileNameFormat,
    /// Longest file, MiB; the next one follows. Less than the 4 GiB that memory cards' file systems can hold.
    #[serde(deserialize_with = "max_file_mib")]
    pub max_file_mib: u64,
    /// Most for all files of this log, MiB, at least two files' worth; beyond it the oldest are removed.
    #[serde(deserialize_with = "max_total_mib")]
    pub max_total_mib: u64,
    /// Room on the disk that is left to other programs, MiB; if less is free, nothing is written.
    #[serde(deserialize_with = "min_free_mib")]
    pub min_free_mib: u64,
}

impl LogConfig {
    /// The limits in bytes.
    pub fn limits(&self) -> LogLimits {
        LogLimits {
            max_file_bytes: self.max_file_mib * MIB,
            max_total_bytes: self.max_total_mib * MIB,
            min_free_bytes: self.min_free_mib * MIB,
        }
    }
}

impl Default for LogConfig {
    fn default() -> Self {
        LogConfig {
            name: LogName::default(),
            directory: PathBuf::from("log"),
            groups: LogGroups::default(),
            utc: false,
            file_name: FileNameFormat::default(),
            max_file_mib: 64,
            max_total_mib: 1024,
            min_free_mib: 256,
        }
    }
}

/// Part of a file name: up to 24 letters, digits, dashes and underscores.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogName(String);

impl LogName {
    /// The name; empty when the log has none.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// The text cannot be part of a file name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a name for a log: it must be up to {MAX_NAME_CHARS} letters, digits, `-` and `_`"
)]
pub struct InvalidLogName(String);

impl FromStr for LogName {
    type Err = InvalidLogName;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if text.len() <= MAX_NAME_CHARS && text.chars().all(plain) {
            Ok(LogName(text.to_owned()))
        } else {
            Err(InvalidLogName(text.to_owned()))
        }
    }
}

impl fmt::Display for LogName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl Serialize for LogName {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&self.0)
    }
}

impl<'de> Deserialize<'de> for LogName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(D::Error::custom)
    }
}
