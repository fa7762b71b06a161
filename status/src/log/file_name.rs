//! File names of logs: robot, date, time, as in the source's `hero(1)_28_08_06-20_39_26`.
//!
//! The time is UTC: it does not jump with summer time, and logs of machines in several zones lie in order.
//!
//! A name says whose a file is, and nothing else does: a log removes old files of its own [`Series`] only. That is why a
//! number that tells two files of the same second apart begins with a dot, which no log's name has.

use std::fmt::Write;
use std::time::{SystemTime, UNIX_EPOCH};

use ipc_types::RobotId;

use crate::config::LogName;

/// Ends every name.
const EXTENSION: &str = ".tsv";

/// `DD_MM_YY-HH_MM_SS`.
const TIME_CHARS: usize = 17;

/// A date and time of day, UTC; of two, the later is the greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Utc {
    /// Year of the Gregorian calendar.
    pub year: u64,
    /// Month, 1 … 12.
    pub month: u64,
    /// Day of the month, 1 … 31.
    pub day: u64,
    /// Hour, 0 … 23.
    pub hour: u64,
    /// Minute, 0 … 59.
    pub minute: u64,
    /// Second, 0 … 59.
    pub second: u64,
}

impl Utc {
    /// The present; 1970 if the machine's clock stands before that.
    pub fn now() -> Utc {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        Utc::from_unix(since_1970.map_or(0, |duration| duration.as_secs()))
    }

    /// The moment `unix_s` seconds after the beginning of 1970.
    pub fn from_unix(unix_s: u64) -> Utc {
        let (days, second_of_day) = (unix_s / 86_400, unix_s % 86_400);
        let (year, month, day) = date(days);
        Utc {
            year,
            month,
            day,
            hour: second_of_day / 3600,
            minute: second_of_day / 60 % 60,
            second: second_of_day % 60,
        }
    }

    /// Whether each number is one that a clock shows.
    fn is_possible(self) -> bool {
        (1..=12).contains(&self.month)
            && (1..=31).contains(&self.day)
            && self.hour < 24
            && self.minute < 60
            && self.second < 60
    }
}

/// Year, month and day of the date `days` after 1970-01-01.
///
/// Years are counted from March: then the leap day is the last of its year, and a month's first day is a straight line
/// of its number, rounded.
fn date(days: u64) -> (u64, u64, u64) {
    const DAYS_OF_400_YEARS: u64 = 146_097;
    const DAYS_OF_100_YEARS: u64 = 36_524;
    const DAYS_OF_4_YEARS: u64 = 1_461;
    /// From 0000-03-01 to 1970-01-01.
    const DAYS_TO_1970: u64 = 719_468;

    let days = days + DAYS_TO_1970;
    let (cycle, day) = (days / DAYS_OF_400_YEARS, days % DAYS_OF_400_YEARS);
    // The last day of a cycle, and of four years, is a leap day: it still belongs to the century and year before it.
    let century = (day / DAYS_OF_100_YEARS).min(3);
    let day = day - century * DAYS_OF_100_YEARS;
    let (quad, day) = (day / DAYS_OF_4_YEARS, day % DAYS_OF_4_YEARS);
    let year = (day / 365).min(3);
    let day = day - year * 365;
    // Months from March have 31, 30, 31, 30, 31 days again and again: 153 in five.
    let month = (5 * day + 2) / 153;
    let day_of_month = day - (153 * month + 2) / 5 + 1;

    let year = 400 * cycle + 100 * century + 4 * quad + year;
    if month < 10 {
        (year, month + 3, day_of_month)
    } else {
        (year + 1, month - 9, day_of_month)
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
}

impl Series {
    /// The files of the log `name` of `robot`.
    pub fn new(robot: RobotId, name: LogName) -> Series {
        Series { robot, name }
    }

    /// The beginning of a file's name: `hero(ROBOT)_DD_MM_YY-HH_MM_SS`, and `_NAME` if the log has a name.
    pub fn stem(&self, at: Utc) -> String {
        let Utc {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = at;
        let year = year % 100;
        self.with_time(&format!(
            "{day:02}_{month:02}_{year:02}-{hour:02}_{minute:02}_{second:02}"
        ))
    }

    /// What the files are called, as a shell's pattern: for messages that are about no one file.
    pub fn pattern(&self) -> String {
        file_name(&self.with_time("*"), 1)
    }

    /// When the file of this name was created; nothing if it is not of this series.
    pub fn stamp(&self, name: &str) -> Option<Stamp> {
        let rest = name.strip_prefix(&format!("hero({})_", self.robot))?;
        let (time, rest) = rest.split_at_checked(TIME_CHARS)?;
        let mut numbers = time.split(['_', '-']).map(|digits| digits.parse().ok());
        let mut next = || numbers.next().flatten();
        let (day, month, year) = (next()?, next()?, next()?);
        let at = Utc {
            // Without a clock of its own a machine begins in 1970.
            year: if year < 70 { 2000 } else { 1900 } + year,
            month,
            day,
            hour: next()?,
            minute: next()?,
            second: next()?,
        };
        let (_, number) = rest
            .strip_suffix(EXTENSION)?
            .split_once('.')
            .unwrap_or(("", "1"));
        let number = number.parse().ok()?;
        // Whatever else the name may be, it is of this series only if this series could call it so.
        let own = at.is_possible() && file_name(&self.stem(at), number) == name;
        own.then_some(Stamp { at, number })
    }

    fn with_time(&self, time: &str) -> String {
        let mut stem = format!("hero({})_{time}", self.robot);
        if !self.name.as_str().is_empty() {
            // Writing to a string cannot fail.
            let _ = write!(stem, "_{}", self.name);
        }
        stem
    }
}

/// The name of the `number`-th file that begins with `stem`: `STEM.tsv`, `STEM.2.tsv`, …
pub fn file_name(stem: &str, number: u32) -> String {
    match number {
        1 => format!("{stem}{EXTENSION}"),
        _ => format!("{stem}.{number}{EXTENSION}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(robot: u32, name: &str) -> Series {
        Series::new(RobotId::new(robot).unwrap(), name.parse().unwrap())
    }

    #[test]
    fn the_example_of_the_source() {
        let at = Utc::from_unix(1_156_797_566);
        assert_eq!(series(1, "").stem(at), "hero(1)_28_08_06-20_39_26");
        assert_eq!(series(12, "imu").stem(at), "hero(12)_28_08_06-20_39_26_imu");
        assert_eq!(series(12, "imu").pattern(), "hero(12)_*_imu.tsv");
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
        ];
        for second in [0, 1_156_797_566, 1_709_164_800] {
            for owner in &all {
                for number in [1, 2, 10, 100] {
                    let at = Utc::from_unix(second);
                    let name = file_name(&owner.stem(at), number);
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

    #[test]
    fn dates_by_the_calendar() {
        #[rustfmt::skip]
        let cases = [
            (0, (1970, 1, 1, 0, 0, 0)),
            (86_399, (1970, 1, 1, 23, 59, 59)),
            (68_169_600, (1972, 2, 29, 0, 0, 0)),
            (951_782_399, (2000, 2, 28, 23, 59, 59)),
            (951_868_799, (2000, 2, 29, 23, 59, 59)),
            (951_868_800, (2000, 3, 1, 0, 0, 0)),
            (1_735_689_599, (2024, 12, 31, 23, 59, 59)),
            (4_107_542_399, (2100, 2, 28, 23, 59, 59)),
            (4_107_542_400, (2100, 3, 1, 0, 0, 0)),
        ];
        for (unix_s, expected) in cases {
            let at = Utc::from_unix(unix_s);
            let fields = (at.year, at.month, at.day, at.hour, at.minute, at.second);
            assert_eq!(fields, expected, "{unix_s}");
        }
    }

    #[test]
    fn every_day_of_four_centuries_follows_the_one_before() {
        let mut last = date(0);
        for days in 1..=146_097 {
            let (year, month, day) = date(days);
            let next_day = (year, month) == (last.0, last.1) && day == last.2 + 1;
            let next_month = day == 1 && year == last.0 && month == last.1 + 1 && last.2 >= 28;
            let next_year = (month, day) == (1, 1) && year == last.0 + 1 && last.1 == 12;
            assert!(next_day || next_month || next_year, "{last:?} {days}");
            last = (year, month, day);
        }
        assert_eq!(last, (2370, 1, 1));
    }
}
