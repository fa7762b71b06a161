//! File names of logs: robot, date, time, as in the source's `hero(1)_28_08_06-20_39_26`.
//!
//! The time is UTC: it does not jump with summer time, and logs of machines in several zones lie in order.

use std::fmt::Write;
use std::time::{SystemTime, UNIX_EPOCH};

use ipc_types::RobotId;

/// A date and time of day, UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// The file name of a log without its extension: `hero(ROBOT)_DD_MM_YY-HH_MM_SS`, and `_NAME` if it has a name.
pub fn stem(robot: RobotId, at: Utc, name: &str) -> String {
    let Utc {
        year,
        month,
        day,
        hour,
        minute,
        second,
    } = at;
    let year = year % 100;
    let mut stem =
        format!("hero({robot})_{day:02}_{month:02}_{year:02}-{hour:02}_{minute:02}_{second:02}");
    if !name.is_empty() {
        // Writing to a string cannot fail.
        let _ = write!(stem, "_{name}");
    }
    stem
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_source() {
        let at = Utc::from_unix(1_156_797_566);
        assert_eq!(stem(RobotId::DEFAULT, at, ""), "hero(1)_28_08_06-20_39_26");
        let robot = RobotId::new(12).unwrap();
        assert_eq!(stem(robot, at, "imu"), "hero(12)_28_08_06-20_39_26_imu");
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
