//! The wall clock in logs: dates, and one anchor for each file.

use std::fmt;

use ipc_types::MonotonicNs;
use time::{Date, PrimitiveDateTime, Time, UtcDateTime};

const NS_PER_S: u64 = 1_000_000_000;

/// What wall clock and monotonic clock showed at the same moment.
///
/// A file takes one anchor when it is created, and all its rows count from that. So a wall clock that is set meanwhile
/// neither reorders nor repeats times; the next file has the new time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockAnchor {
    /// Nanoseconds since the beginning of 1970, UTC.
    pub unix_ns: u64,
    /// What the monotonic clock showed at `unix_ns`.
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

    /// Reads a time as it is shown; `None` if it is written otherwise.
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
        Utc::from_unix(self.unix_ns / NS_PER_S).write_to_second(f)?;
        write!(f, ".{:06}Z", self.unix_ns % NS_PER_S / 1000)
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
    /// The moment `unix_s` seconds after the beginning of 1970; its beginning after the year 9999.
    pub fn from_unix(unix_s: u64) -> Utc {
        let at = i64::try_from(unix_s).map(UtcDateTime::from_unix_timestamp);
        let at = at
            .ok()
            .and_then(Result::ok)
            .unwrap_or(UtcDateTime::UNIX_EPOCH);
        Utc {
            year: u64::from(at.year().unsigned_abs()),
            month: u8::from(at.month()).into(),
            day: at.day().into(),
            hour: at.hour().into(),
            minute: at.minute().into(),
            second: at.second().into(),
        }
    }

    /// Seconds since the beginning of 1970; `None` for a time before that, or one that no clock shows.
    pub fn unix_s(self) -> Option<u64> {
        let byte = |number: u64| u8::try_from(number).ok();
        let month = byte(self.month)?.try_into().ok()?;
        let year = i32::try_from(self.year).ok()?;
        let date = Date::from_calendar_date(year, month, byte(self.day)?).ok()?;
        let (hour, minute, second) = (byte(self.hour)?, byte(self.minute)?, byte(self.second)?);
        let time = Time::from_hms(hour, minute, second).ok()?;
        let unix_s = PrimitiveDateTime::new(date, time)
            .assume_utc()
            .unix_timestamp();
        unix_s.try_into().ok()
    }

    /// By ISO 8601, without the letter of the time zone.
    fn write_to_second(self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Utc {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = self;
        write!(
            f,
            "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}"
        )
    }
}

impl fmt::Display for Utc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write_to_second(f)?;
        f.write_str("Z")
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
}
