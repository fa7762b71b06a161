//! `diagnostic_msgs/msg/DiagnosticArray`: what is wrong with a robot, for the diagnostics panels of viewers.

use crate::cdr::Writer;
use crate::header::header;

/// Name of the type in ROS 2.
pub const DIAGNOSTIC_ARRAY: &str = "diagnostic_msgs/msg/DiagnosticArray";

/// How bad it is, with the numbers of ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum DiagnosticLevel {
    /// Nothing is wrong.
    Ok = 0,
    /// Something to look at.
    Warn = 1,
    /// Something failed.
    Error = 2,
    /// What is known is old.
    Stale = 3,
}

/// A component and its condition. A viewer shows the newest one of each hardware and name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad it is.
    pub level: DiagnosticLevel,
    /// What it is about, such as `robot1: bridge`.
    pub name: String,
    /// What is wrong.
    pub message: String,
    /// The robot, such as `robot1`.
    pub hardware: String,
    /// More about it: key and value.
    pub values: Vec<(String, String)>,
}

/// The message in CDR: conditions at one moment, Unix time in ns.
pub fn diagnostic_array(unix_ns: i64, diagnostics: &[Diagnostic]) -> Vec<u8> {
    let mut writer = Writer::with_capacity(64 + 256 * diagnostics.len());
    header(&mut writer, unix_ns, "");
    sequence(&mut writer, diagnostics, |writer, one| {
        writer.u8(one.level as u8);
        writer.string(&one.name);
        writer.string(&one.message);
        writer.string(&one.hardware);
        sequence(writer, &one.values, |writer, (key, value)| {
            writer.string(key);
            writer.string(value);
        });
    });
    writer.finish()
}

/// Its length, and each element. A sequence has less than 2³² elements, because its elements lie in memory.
fn sequence<T>(writer: &mut Writer, elements: &[T], write: impl Fn(&mut Writer, &T)) {
    writer.u32(u32::try_from(elements.len()).unwrap_or(u32::MAX));
    for element in elements {
        write(writer, element);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cdr::Reader;

    #[test]
    fn each_condition_is_written_field_by_field() {
        let one = Diagnostic {
            level: DiagnosticLevel::Error,
            name: "robot1: bridge".to_owned(),
            message: "gone".to_owned(),
            hardware: "robot1".to_owned(),
            values: vec![("since_s".to_owned(), "3".to_owned())],
        };
        let message = diagnostic_array(1_000_000_002, &[one.clone(), one]);
        let mut reader = Reader::new(&message).unwrap();
        assert_eq!((reader.i32(), reader.u32()), (Some(1), Some(2)));
        assert_eq!((reader.string(), reader.u32()), (Some(""), Some(2)));
        for _ in 0..2 {
            assert_eq!(reader.u8(), Some(2));
            for text in ["robot1: bridge", "gone", "robot1"] {
                assert_eq!(reader.string(), Some(text));
            }
            assert_eq!(reader.u32(), Some(1));
            assert_eq!(reader.string(), Some("since_s"));
            assert_eq!(reader.string(), Some("3"));
        }
        assert!(reader.is_at_end());
    }
}
