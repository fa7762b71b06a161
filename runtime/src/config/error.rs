//! [`ConfigError`]: why a configuration was refused.

use std::io;
use std::path::{Path, PathBuf};

/// Longest configuration file, bytes: a hundred times the annotated examples. A longer one is refused; it is surely
/// something else.
pub(super) const MAX_FILE_BYTES: u64 = 1 << 20;

/// Longest piece of a line that an error repeats, characters: it stays readable on a terminal.
const MAX_EXCERPT_CHARS: usize = 60;

/// Why a configuration was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("{}: cannot be read{}", .file.display(), .next_step)]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What to do, as the end of a sentence.
        next_step: &'static str,
        /// What the operating system says.
        source: io::Error,
    },
    /// Something else stands in the place of the file.
    #[error("{}: is {what}, not a regular file; name a configuration file", .file.display())]
    NotAFile {
        /// The path.
        file: PathBuf,
        /// What is there.
        what: &'static str,
    },
    /// The file is far too long to be a configuration.
    #[error("{}: is longer than {MAX_FILE_BYTES} bytes; name a configuration file", .file.display())]
    TooLong {
        /// The file.
        file: PathBuf,
    },
    /// The content is wrong.
    #[error("{}:{line}: {reason}{}", .file.display(), in_line(.excerpt))]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong, and what would be right.
        reason: String,
        /// What the line says, shortened.
        excerpt: String,
    },
    /// A value is wrong that the file does not have: it is the built-in default, or came from the command line.
    #[error("{reason}")]
    Unfit {
        /// What is wrong, and what would be right.
        reason: String,
    },
}

/// The refusal of what stands at `start` in `text`.
pub(super) fn invalid(text: &[u8], start: usize, reason: String, file: &Path) -> ConfigError {
    let before = &text[..start.min(text.len())];
    let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
    let content = text.split(|&byte| byte == b'\n').nth(line - 1);
    let content = String::from_utf8_lossy(content.unwrap_or_default());
    let mut excerpt: String = content.trim().chars().take(MAX_EXCERPT_CHARS).collect();
    if excerpt.len() < content.trim().len() {
        excerpt.push('…');
    }
    ConfigError::Invalid {
        file: file.to_owned(),
        line,
        reason,
        excerpt,
    }
}

/// What the line says, as the end of an error.
fn in_line(excerpt: &str) -> String {
    match excerpt {
        "" => String::new(),
        _ => format!(", in `{excerpt}`"),
    }
}
