//! The wall clock in logs: dates, and one anchor for each file.

use std::fmt;

use ipc_types::MonotonicNs;

const NS_PER_S: u64 = 1_000_000_000;

/// From 0000-03-01 to 1970-01-01.
const DAYS_TO_1970: u64 = 719_468;

/// What wall clock and monotonic clock showed at the same moment.
///
/// A file takes one anchor when it is created, and all its rows count from that. So a wall clock that is set meanwhile
/// neither reorders nor repeats times; the next file has the new time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockAnchor {
    /// Nanoseconds since the beginning of 1970, UTC.
    pub unix_ns: u64,
    /// The same moment of the monotonic clock.
    pub monotonic: MonotonicNs,
}

impl ClockAnchor {
    /// Date and time of the anchor itself.
    pub fn utc(self) -> Utc {
        Utc::from_unix(self.unix_ns / NS_PER_S)
    }

    /// The time at `moment`, as ISO 8601 with microseconds.
    pub fn iso(self, moment: MonotonicNs) -> IsoTime {
        let elapsed_ns = i128::from(moment.0) - i128::from(self.monotonic.0);
        let unix_ns = i128::from(self.unix_ns) + elapsed_ns;
        IsoTime {
            unix_ns: unix_ns.clamp(0, u64::MAX.into()) as u64,
        }
    }
}

/// A time that is shown like `2006-08-28T20:39:26.000250Z`: always of the same length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IsoTime {
    unix_ns: u64,
}

impl IsoTime {
    /// The moment `unix_ns` nanoseconds after the beginning of 1970.
    pub const fn from_unix_ns(unix_ns: u64) -> IsoTime {
        IsoTime { unix_ns }
    }

    /// Nanoseconds since the beginning of 1970.
    pub const fn unix_ns(self) -> u64 {
        self.unix_ns
    }

    /// Reads a time as it is shown; nothing when it is written otherwise.
    pub fn parse(text: &str) -> Option<IsoTime> {
        let (date, time) = text.strip_suffix('Z')?.split_once('T')?;
        let (time, us) = time.split_once('.')?;
        let mut numbers = date
            .split('-')
            .chain(time.split(':'))
            .map(|digits| digits.parse().ok());
        let mut next = || numbers.next().flatten();
        let at = Utc {
            year: next()?,
            month: next()?,
            day: next()?,
            hour: next()?,
            minute: next()?,
            second: next()?,
        };
        let us: u64 = us.parse().ok()?;
        let unix_ns = at
            .unix_s()?
            .checked_mul(NS_PER_S)?
            .checked_add(us.checked_mul(1000)?)?;
        // Written again it must be the same: numbers without their leading zeros, or out of range, are no time.
        let read = IsoTime { unix_ns };
        (read.to_string() == text).then_some(read)
    }
}

impl fmt::Display for IsoTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Utc {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = Utc::from_unix(self.unix_ns / NS_PER_S);
        let us = self.unix_ns % NS_PER_S / 1000;
        write!(
            f,
            "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{us:06}Z"
        )
    }
}

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

    /// Seconds since the beginning of 1970; nothing for a time before that, or one that no clock shows.
    pub fn unix_s(self) -> Option<u64> {
        if !self.is_plausible() || !(1970..=9999).contains(&self.year) {
            return None;
        }
        // Years are counted from March, as in `date`: January and February belong to the one before.
        let (year, month) = match self.month {
            1 | 2 => (self.year - 1, self.month + 9),
            month => (self.year, month - 3),
        };
        let leap_days = year / 4 - year / 100 + year / 400;
        let days = year * 365 + leap_days + (153 * month + 2) / 5 + self.day - 1;
        let seconds = self.hour * 3600 + self.minute * 60 + self.second;
        Some((days.checked_sub(DAYS_TO_1970)?) * 86_400 + seconds)
    }

    /// Whether each number is one that a clock shows.
    pub fn is_plausible(self) -> bool {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_count_from_the_anchor() {
        let anchor = ClockAnchor {
            unix_ns: 1_156_797_566_000_250_000,
            monotonic: MonotonicNs(5_000_000_000),
        };
        for (monotonic_ns, expected) in [
            (5_000_000_000, "2006-08-28T20:39:26.000250Z"),
            (5_000_001_999, "2006-08-28T20:39:26.000251Z"),
            (39_000_000_000, "2006-08-28T20:40:00.000250Z"),
            // What came before the file was created.
            (4_999_000_000, "2006-08-28T20:39:25.999250Z"),
            (0, "2006-08-28T20:39:21.000250Z"),
            (u64::MAX, "2554-07-21T23:34:33.709551Z"),
        ] {
            let shown = anchor.iso(MonotonicNs(monotonic_ns)).to_string();
            assert_eq!(shown, expected);
        }
        let before_1970 = ClockAnchor::default().iso(MonotonicNs(0)).to_string();
        assert_eq!(before_1970, "1970-01-01T00:00:00.000000Z");
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
            assert_eq!(at.unix_s(), Some(unix_s));
        }
    }

    #[test]
    fn a_time_is_read_as_it_is_shown_and_in_no_other_way() {
        for unix_ns in [0, 1_156_797_566_000_250_000, 4_107_542_400_999_999_000] {
            let shown = IsoTime::from_unix_ns(unix_ns).to_string();
            let read = IsoTime::parse(&shown).map(IsoTime::unix_ns);
            assert_eq!(read, Some(unix_ns), "{shown}");
        }
        for text in [
            "",
            "2006-08-28T20:39:26Z",
            "2006-08-28T20:39:26.25Z",
            "2006-8-28T20:39:26.000250Z",
            "2006-02-30T20:39:26.000250Z",
            "2006-08-28T24:39:26.000250Z",
            "1969-08-28T20:39:26.000250Z",
            "9999999-08-28T20:39:26.000250Z",
            "2006-08-28T20:39:26.18446744073709551615Z",
        ] {
            assert_eq!(IsoTime::parse(text), None, "{text}");
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
