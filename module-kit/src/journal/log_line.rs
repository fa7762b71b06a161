//! [`LogLine`]: a line of the process's log as a record of its journal. It is no input of the core: who replays skips it.

use ipc_types::MonotonicNs;
use runtime::logging;
use tracing::Level;

use super::bytes::{Cursor, Malformed, put_bytes, put_number};

/// The first byte of such a record, in every journal.
pub const LOG_LINE: u8 = 0x30;

/// All levels, with what stands for them.
const LEVELS: [(Level, u8); 5] = [
    (Level::ERROR, 1),
    (Level::WARN, 2),
    (Level::INFO, 3),
    (Level::DEBUG, 4),
    (Level::TRACE, 5),
];

/// A line of the log of the process whose journal it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogLine<'a> {
    /// When it was logged, host monotonic.
    pub at: MonotonicNs,
    /// Lines that were lost about this time, because too many came at once.
    pub lost: u64,
    /// How grave.
    pub level: Level,
    /// Path of the module in the source, such as `bridge::shell::audit`.
    pub module: &'a str,
    /// Message and fields, as standard error has them.
    pub text: &'a str,
}

impl<'a> LogLine<'a> {
    /// A line of this process; so many were lost.
    pub fn new(line: &'a logging::LogLine, lost: u64) -> LogLine<'a> {
        LogLine {
            at: MonotonicNs(line.at_ns),
            lost,
            level: line.level,
            module: &line.module,
            text: &line.text,
        }
    }

    /// Appends the record.
    pub fn put(&self, out: &mut Vec<u8>) {
        out.push(LOG_LINE);
        put_number(out, self.at.0);
        put_number(out, self.lost);
        let level = LEVELS.iter().find(|(level, _)| *level == self.level);
        out.push(level.map_or(0, |(_, byte)| *byte));
        put_bytes(out, self.module.as_bytes());
        put_bytes(out, self.text.as_bytes());
    }

    /// The line that a record is; nothing when the record is something else.
    ///
    /// # Errors
    /// It begins as a line, and is none.
    pub fn of(record: &'a [u8]) -> Result<Option<LogLine<'a>>, Malformed> {
        let Some((&LOG_LINE, rest)) = record.split_first() else {
            return Ok(None);
        };
        let mut cursor = Cursor::new(rest);
        let (at, lost, level) = (cursor.number()?, cursor.number()?, cursor.byte()?);
        let level = LEVELS.iter().find(|(_, byte)| *byte == level);
        let line = LogLine {
            at: MonotonicNs(at),
            lost,
            level: level.ok_or(Malformed)?.0,
            module: text(&mut cursor)?,
            text: text(&mut cursor)?,
        };
        if !cursor.is_at_end() {
            return Err(Malformed);
        }
        Ok(Some(line))
    }
}

fn text<'a>(cursor: &mut Cursor<'a>) -> Result<&'a str, Malformed> {
    std::str::from_utf8(cursor.bytes()?).map_err(|_| Malformed)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_line_is_written_as_the_document_says_and_read_again() {
        let line = LogLine {
            at: MonotonicNs(300),
            lost: 2,
            level: Level::WARN,
            module: "m",
            text: "ä",
        };
        let mut record = Vec::new();
        line.put(&mut record);
        let expected = [0x30, 0xAC, 0x02, 2, 2, 1, b'm', 2, 0xC3, 0xA4];
        assert_eq!(record, expected);
        assert_eq!(LogLine::of(&record), Ok(Some(line)));
        assert_eq!(LogLine::of(&[0x12, 0]), Ok(None));
        assert_eq!(LogLine::of(&[]), Ok(None));
        record.push(0);
        assert_eq!(LogLine::of(&record), Err(Malformed));
        assert_eq!(
            LogLine::of(&[0x30, 1, 0, 9, 0, 0]),
            Err(Malformed),
            "a level"
        );
        assert_eq!(
            LogLine::of(&[0x30, 1, 0, 3, 0, 1, 0xFF]),
            Err(Malformed),
            "a text"
        );
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(mut record in prop::collection::vec(any::<u8>(), 0..64)) {
            let _ = LogLine::of(&record);
            record.insert(0, LOG_LINE);
            let _ = LogLine::of(&record);
        }
    }
}
