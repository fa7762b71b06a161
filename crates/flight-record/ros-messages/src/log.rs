//! `rcl_interfaces/msg/Log`: a line of a process's log, which every viewer of ROS 2 knows.

use crate::cdr::{Reader, Writer};
use crate::header::stamp;

/// How grave a line of a log is, with the numbers of ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// For developers.
    Debug = 10,
    /// Something went as it should.
    Info = 20,
    /// Something to look at.
    Warn = 30,
    /// Something failed.
    Error = 40,
    /// The process ends because of it.
    Fatal = 50,
}

impl Level {
    /// All of them.
    const ALL: [Level; 5] = [
        Level::Debug,
        Level::Info,
        Level::Warn,
        Level::Error,
        Level::Fatal,
    ];

    /// The level with this number.
    fn of(number: u8) -> Option<Level> {
        Level::ALL.into_iter().find(|level| *level as u8 == number)
    }
}

/// A line of a process's log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log<'a> {
    /// When: Unix time, ns.
    pub unix_ns: i64,
    /// How grave.
    pub level: Level,
    /// The process, such as `bridge`.
    pub process: &'a str,
    /// The line.
    pub text: &'a str,
    /// Path of the module in the source, such as `bridge::link`; empty when unknown.
    pub module: &'a str,
}

impl<'a> Log<'a> {
    /// Name of the type in ROS 2.
    pub const TYPE_NAME: &'static str = "rcl_interfaces/msg/Log";

    /// The message in CDR. Line and file of the source are left empty; the module stands for the function.
    pub fn write(&self) -> Vec<u8> {
        let texts = self.process.len() + self.text.len() + self.module.len();
        let mut writer = Writer::with_capacity(texts + 48);
        stamp(&mut writer, self.unix_ns);
        writer.u8(self.level as u8);
        writer.string(self.process);
        writer.string(self.text);
        writer.string("");
        writer.string(self.module);
        writer.u32(0);
        writer.finish()
    }

    /// The line that [`write`](Log::write) wrote; `None` of other bytes.
    pub fn read(message: &'a [u8]) -> Option<Log<'a>> {
        let mut reader = Reader::new(message)?;
        let (seconds, nanoseconds) = (reader.i32()?, reader.u32()?);
        let level = Level::of(reader.u8()?)?;
        let (process, text) = (reader.string()?, reader.string()?);
        let (_file, module) = (reader.string()?, reader.string()?);
        reader.u32()?;
        Some(Log {
            unix_ns: i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds),
            level,
            process,
            text,
            module,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_written_field_by_field() {
        let log = Log {
            unix_ns: 1_000_000_002,
            level: Level::Warn,
            process: "bridge",
            text: "no",
            module: "m",
        };
        let expected = [
            0, 1, 0, 0, // header of CDR
            1, 0, 0, 0, 2, 0, 0, 0, // stamp
            30, 0, 0, 0, // level, alignment
            7, 0, 0, 0, b'b', b'r', b'i', b'd', b'g', b'e', 0, 0, // name
            3, 0, 0, 0, b'n', b'o', 0, 0, // msg
            1, 0, 0, 0, 0, 0, 0, 0, // file
            2, 0, 0, 0, b'm', 0, 0, 0, // function
            0, 0, 0, 0, // line
        ];
        assert_eq!(log.write(), expected);
        assert_eq!(Log::read(&expected), Some(log));
        for len in 0..expected.len() {
            assert_eq!(Log::read(&expected[..len]), None, "{len}");
        }
    }
}
