//! File names of logs: robot, date and time, in one of two formats.
//!
//! The time is UTC: it does not jump with summer time, and logs of machines in several zones are in order.
//!
//! The name alone says to which log a file belongs: a log removes old files of its own [`Series`] only. That is why a
//! number that tells two files of the same second apart begins with a dot, which no log's name has. Flight records,
//! which `ril record` writes, are named in the same way with another ending.

use std::fmt::Write;
use std::path::Path;

use ipc_types::RobotId;

use super::clock::Utc;
use super::config::{FileNameFormat, LogConfig, LogName};

/// What a file holds, which the end of its name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Rows of tab-separated values: a log of status.
    Tsv,
    /// A flight record in the format MCAP.
    Mcap,
}

impl FileKind {
    /// All kinds.
    pub const ALL: [FileKind; 2] = [FileKind::Tsv, FileKind::Mcap];

    /// Ends every name of a file of this kind.
    pub const fn extension(self) -> &'static str {
        match self {
            FileKind::Tsv => ".tsv",
            FileKind::Mcap => ".mcap",
        }
    }
}

/// When a file was created, as its name says; of two files of a series, the later is the greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Stamp {
    /// The second.
    pub at: Utc,
    /// Which file of that second, from 1.
    pub number: u32,
}

/// All files that one log has written, and will write, in its directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Series {
    robot: RobotId,
    name: LogName,
    format: FileNameFormat,
    kind: FileKind,
}

impl Series {
    /// The files of the log `config` of `robot`.
    pub fn new(robot: RobotId, config: &LogConfig) -> Series {
        Series {
            robot,
            name: config.name.clone(),
            format: config.file_name,
            kind: FileKind::Tsv,
        }
    }

    /// The flight records of `robot`, whose names are in the order of time.
    pub fn of_records(robot: RobotId) -> Series {
        Series {
            robot,
            name: LogName::default(),
            format: FileNameFormat::Sortable,
            kind: FileKind::Mcap,
        }
    }

    /// The beginning of a new file's name: robot, time, and the log's name if it has one.
    pub fn stem(&self, at: Utc) -> String {
        self.with_time(self.format, &time(self.format, at))
    }

    /// What the log is called in messages that are about no single file: `directory` and the files' names as a shell's
    /// pattern.
    pub fn label(&self, directory: &Path) -> String {
        let pattern = file_name(&self.with_time(self.format, "*"), 1, self.kind);
        directory.join(pattern).display().to_string()
    }

    /// When the file of this name was created; `None` if it is not of this series. Names in every format are of it.
    pub fn stamp(&self, name: &str) -> Option<Stamp> {
        FileNameFormat::ALL.into_iter().find_map(|format| {
            let rest = name.strip_prefix(&prefix(format, self.robot))?;
            let (text, rest) = rest.split_at_checked(time_chars(format))?;
            let at = parse_time(format, text)?;
            let (_, number) = rest
                .strip_suffix(self.kind.extension())?
                .split_once('.')
                .unwrap_or(("", "1"));
            let number = number.parse().ok()?;
            // The name is of this series only if this series could give it.
            let stem = self.with_time(format, &time(format, at));
            let own = at.unix_s().is_some() && file_name(&stem, number, self.kind) == name;
            own.then_some(Stamp { at, number })
        })
    }

    /// The robot whose files these are.
    pub fn robot(&self) -> RobotId {
        self.robot
    }

    /// What the files hold.
    pub fn kind(&self) -> FileKind {
        self.kind
    }

    /// The log's name; empty when it has none.
    pub fn name(&self) -> &str {
        self.name.as_str()
    }

    fn with_time(&self, format: FileNameFormat, time: &str) -> String {
        let mut stem = prefix(format, self.robot) + time;
        if !self.name.as_str().is_empty() {
            // Writing to a string cannot fail.
            let _ = write!(stem, "_{}", self.name);
        }
        stem
    }
}

/// The series that a file of this name belongs to, and when it was created; `None` if no log gives such a name.
///
/// A name can be read in two ways only if a log's own name looks like a time; the shortest name of a log is then taken.
pub fn recognize(name: &str) -> Option<(Series, Stamp)> {
    let (robot, rest) = name.strip_prefix("hero")?.split_once('_')?;
    let digits = robot
        .strip_prefix('(')
        .and_then(|robot| robot.strip_suffix(')'));
    let robot = RobotId::new(digits.unwrap_or(robot).parse().ok()?)?;
    let (kind, stem) = FileKind::ALL.into_iter().find_map(|kind| {
        let stem = rest.strip_suffix(kind.extension())?;
        Some((kind, stem.split_once('.').map_or(stem, |(stem, _)| stem)))
    })?;
    FileNameFormat::ALL.into_iter().find_map(|format| {
        let (_, log) = stem.split_at_checked(time_chars(format))?;
        let series = Series {
            robot,
            name: log.strip_prefix('_').unwrap_or(log).parse().ok()?,
            format,
            kind,
        };
        let stamp = series.stamp(name)?;
        Some((series, stamp))
    })
}

/// How a file's name begins. A sortable name has no character that a shell would not take as it is.
fn prefix(format: FileNameFormat, robot: RobotId) -> String {
    match format {
        FileNameFormat::Source => format!("hero({robot})_"),
        FileNameFormat::Sortable => format!("hero{robot}_"),
    }
}

/// The time in a file's name.
fn time(format: FileNameFormat, at: Utc) -> String {
    let Utc {
        year,
        month,
        day,
        hour,
        minute,
        second,
    } = at;
    match format {
        FileNameFormat::Source => {
            let year = year % 100;
            format!("{day:02}_{month:02}_{year:02}-{hour:02}_{minute:02}_{second:02}")
        }
        FileNameFormat::Sortable => {
            format!("{year:04}-{month:02}-{day:02}T{hour:02}-{minute:02}-{second:02}Z")
        }
    }
}

/// How long the time in a file's name is.
const fn time_chars(format: FileNameFormat) -> usize {
    match format {
        FileNameFormat::Source => "DD_MM_YY-HH_MM_SS".len(),
        FileNameFormat::Sortable => "YYYY-MM-DDTHH-MM-SSZ".len(),
    }
}

/// Reads the numbers of a time; whether it is written exactly so, the caller finds out by writing it again.
fn parse_time(format: FileNameFormat, text: &str) -> Option<Utc> {
    let mut numbers = text
        .split(['_', '-', 'T', 'Z'])
        .map(|digits| digits.parse().ok());
    let mut next = || numbers.next().flatten();
    let (first, month, third) = (next()?, next()?, next()?);
    let (year, day) = match format {
        // Without a clock of its own a machine begins in 1970.
        FileNameFormat::Source if third < 70 => (2000 + third, first),
        FileNameFormat::Source => (1900 + third, first),
        FileNameFormat::Sortable => (first, third),
    };
    Some(Utc {
        year,
        month,
        day,
        hour: next()?,
        minute: next()?,
        second: next()?,
    })
}

/// The name of the `number`-th file that begins with `stem`: `STEM.tsv`, `STEM.2.tsv`, …
pub fn file_name(stem: &str, number: u32, kind: FileKind) -> String {
    let extension = kind.extension();
    match number {
        1 => format!("{stem}{extension}"),
        _ => format!("{stem}.{number}{extension}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(robot: u32, name: &str) -> Series {
        Series {
            robot: RobotId::new(robot).unwrap(),
            name: name.parse().unwrap(),
            format: FileNameFormat::Source,
            kind: FileKind::Tsv,
        }
    }

    fn sortable(robot: u32, name: &str) -> Series {
        Series {
            format: FileNameFormat::Sortable,
            ..series(robot, name)
        }
    }

    #[test]
    fn the_example_of_the_source() {
        let at = Utc::from_unix(1_156_797_566);
        assert_eq!(series(1, "").stem(at), "hero(1)_28_08_06-20_39_26");
        assert_eq!(series(12, "imu").stem(at), "hero(12)_28_08_06-20_39_26_imu");
        let label = series(12, "imu").label(Path::new("log"));
        assert_eq!(label, "log/hero(12)_*_imu.tsv");
    }

    #[test]
    fn a_file_tells_robot_log_and_time_by_its_name() {
        let at = Utc::from_unix(1_156_797_566);
        for owner in [
            series(1, ""),
            series(12, "imu_2"),
            sortable(7, ""),
            sortable(7, "imu"),
            Series::of_records(RobotId::new(7).unwrap()),
        ] {
            for number in [1, 2, 10] {
                let name = file_name(&owner.stem(at), number, owner.kind());
                assert_eq!(
                    recognize(&name),
                    Some((owner.clone(), Stamp { at, number })),
                    "{name}"
                );
            }
        }
        for name in [
            "",
            "hero(1).tsv",
            "hero(0)_28_08_06-20_39_26.tsv",
            "hero(1)_28_13_06-20_39_26.tsv",
            "hero(1)_28_08_06-20_39_26.txt",
            "hero(1)_28_08_06-20_39_26.1.tsv",
            "hero(1)_28_08_06-20_39_26imu.tsv",
            "hero(1)_28_08_06-20_39_26_a b.tsv",
            "hero(1)_\u{e4}\u{e4}\u{e4}\u{e4}\u{e4}\u{e4}\u{e4}\u{e4}\u{e4}.tsv",
        ] {
            assert_eq!(recognize(name), None, "{name}");
        }
    }

    #[test]
    fn sortable_names_are_in_the_order_of_time() {
        let at = Utc::from_unix(1_156_797_566);
        assert_eq!(sortable(1, "").stem(at), "hero1_2006-08-28T20-39-26Z");
        assert_eq!(
            sortable(12, "imu").stem(at),
            "hero12_2006-08-28T20-39-26Z_imu"
        );
        let seconds = [0, 59, 60, 951_782_400, 1_156_797_566, 1_735_689_600];
        let names = seconds.map(|second| sortable(1, "").stem(Utc::from_unix(second)));
        assert!(names.is_sorted(), "{names:?}");
    }

    #[test]
    fn a_change_of_the_format_strands_no_old_file() {
        let at = Utc::from_unix(1_156_797_566);
        for (old, new) in [
            (series(1, "imu"), sortable(1, "imu")),
            (sortable(1, "imu"), series(1, "imu")),
        ] {
            let name = file_name(&old.stem(at), 2, FileKind::Tsv);
            assert_eq!(new.stamp(&name), Some(Stamp { at, number: 2 }), "{name}");
        }
    }

    #[test]
    fn a_name_belongs_to_one_series() {
        let all = [
            series(1, ""),
            series(11, ""),
            series(1, "imu"),
            series(1, "imu_2"),
            series(1, "2"),
            series(1, "28_08_06-20_39_26"),
            series(1, "2006-08-28T20-39-26Z"),
            sortable(2, ""),
            sortable(21, ""),
            sortable(2, "imu"),
            sortable(2, "28_08_06-20_39_26"),
            sortable(2, "2006-08-28T20-39-26Z"),
            Series::of_records(RobotId::new(2).unwrap()),
        ];
        for second in [0, 1_156_797_566, 1_709_164_800] {
            for owner in &all {
                for number in [1, 2, 10, 100] {
                    let at = Utc::from_unix(second);
                    let name = file_name(&owner.stem(at), number, owner.kind());
                    let owners = all.iter().filter(|series| series.stamp(&name).is_some());
                    assert_eq!(owners.collect::<Vec<_>>(), [owner], "{name}");
                    assert_eq!(owner.stamp(&name), Some(Stamp { at, number }));
                }
            }
        }
    }

    #[test]
    fn what_only_looks_like_a_log_is_of_no_series() {
        for name in [
            "hero(1)_28_08_06-20_39_26",
            "hero(1)_28_08_06-20_39_26.csv",
            "hero(1)_28_08_06-20_39_26.tsv.gz",
            "hero(1)_28_08_06-20_39_26.1.tsv",
            "hero(1)_28_08_06-20_39_26.02.tsv",
            "hero(1)_28_08_06-20_39_26.2.2.tsv",
            "hero(1)_28_08_06-20_39_26..tsv",
            "hero(1)_28_08_06-20_39_26.99999999999.tsv",
            "hero(1)_28_08_06-20-39-26.tsv",
            "hero(1)_28_08_06-20_39_2.tsv",
            "hero(1)_+8_08_06-20_39_26.tsv",
            "hero(1)_00_08_06-20_39_26.tsv",
            "hero(1)_28_13_06-20_39_26.tsv",
            "hero(1)_28_08_06-24_00_00.tsv",
            "hero(1)_28_08_06-20_39_26_.tsv",
            "hero(1)_28_08_06-20_39_2é.tsv",
            "hero(1)_.tsv",
            "Hero(1)_28_08_06-20_39_26.tsv",
            " hero(1)_28_08_06-20_39_26.tsv",
            "hero(01)_28_08_06-20_39_26.tsv",
            "hero(1)_2006-08-28T20-39-26Z.tsv",
            "hero1_28_08_06-20_39_26.tsv",
            "hero1_2006-08-28T20-39-26",
            "hero1_2006-08-28T20-39-26.tsv",
            "hero1_2006-08-28T20-39-26Zimu.tsv",
            "hero1_2006-08-28T20-39-26Z_imu.tsv",
            "hero1_2006-08-28 20-39-26Z.tsv",
            "hero1_2006-02-28T24-39-26Z.tsv",
            "hero1_06-08-28T20-39-26Z.tsv",
            "",
        ] {
            assert_eq!(series(1, "").stamp(name), None, "{name}");
        }
    }

    #[test]
    fn stamps_are_in_the_order_of_time() {
        let stamp = |unix_s, number| Stamp {
            at: Utc::from_unix(unix_s),
            number,
        };
        let mut last = stamp(0, 1);
        for next in [
            stamp(0, 2),
            stamp(0, 10),
            stamp(951_782_399, 1),
            stamp(951_782_400, 1),
            stamp(1_735_689_599, 3),
            stamp(1_735_689_600, 1),
        ] {
            assert!(next > last, "{next:?}");
            last = next;
        }
    }
}
