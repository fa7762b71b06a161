//! Why a file is no plan.

use std::fmt;

use crate::limits::MAX_ELEMENT_DEPTH;
use crate::limits::{MAX_AREAS, MAX_ELEMENTS, MAX_FILE_BYTES, MAX_ITEMS};

/// Where in a file a mistake is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line, from 1.
    Line(usize),
    /// An item, from 1, or another part that has a name.
    Part(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::File => f.write_str("the file"),
            Place::Line(number) => write!(f, "line {number}"),
            Place::Part(name) => f.write_str(name),
        }
    }
}

/// Why a file was not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// Neither its content nor its extension is that of a format.
    #[error(
        "neither content nor name is that of a plan: QGroundControl .plan, QGC WPL 110, GeoJSON, KML and GPX are read"
    )]
    UnknownFormat,
    /// It is longer than [`MAX_FILE_BYTES`].
    #[error("{0} bytes; at most {MAX_FILE_BYTES} are read")]
    TooLong(usize),
    /// It has more items than [`MAX_ITEMS`].
    #[error("more than {MAX_ITEMS} items; divide the plan")]
    TooManyItems,
    /// It has more fence areas than [`MAX_AREAS`].
    #[error("more than {MAX_AREAS} fence areas")]
    TooManyAreas,
    /// It has more XML elements than [`MAX_ELEMENTS`].
    #[error("more than {MAX_ELEMENTS} XML elements")]
    TooManyElements,
    /// Its XML elements lie deeper in each other than [`MAX_ELEMENT_DEPTH`].
    #[error("line {0}: XML elements lie more than {MAX_ELEMENT_DEPTH} deep in each other")]
    TooDeep(usize),
    /// It is not UTF-8.
    #[error("line {0}: the bytes are not UTF-8 text")]
    NotText(usize),
    /// Something in it is wrong.
    #[error("{place}: {reason}")]
    Wrong {
        /// Where.
        place: Place,
        /// Why.
        reason: String,
    },
}

impl ReadError {
    /// Something is wrong at a line.
    pub(crate) fn line(number: usize, reason: impl Into<String>) -> ReadError {
        ReadError::Wrong {
            place: Place::Line(number),
            reason: reason.into(),
        }
    }

    /// Something is wrong in a part of the file that has a name.
    pub(crate) fn part(name: impl Into<String>, reason: impl Into<String>) -> ReadError {
        ReadError::Wrong {
            place: Place::Part(name.into()),
            reason: reason.into(),
        }
    }

    /// Something is wrong with the file as a whole.
    pub(crate) fn file(reason: impl Into<String>) -> ReadError {
        ReadError::Wrong {
            place: Place::File,
            reason: reason.into(),
        }
    }
}
