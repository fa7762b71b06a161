//! The time of day.

/// The time of day, UTC, such as `14:05:09`, of seconds since 1970-01-01 UTC.
pub fn time_of_day(utc_s: u64) -> String {
    let seconds = utc_s % 86_400;
    let (hours, minutes) = (seconds / 3600, seconds / 60 % 60);
    format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_day_begins_at_midnight() {
        let times = [0, 86_399, 86_400 + 3_661].map(time_of_day);
        assert_eq!(times, ["00:00:00", "23:59:59", "01:01:01"]);
    }
}
