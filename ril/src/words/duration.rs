//! Durations as people read them.

/// A time, such as `45s`, `12m05s`, `1h02m05s`.
pub fn duration(seconds: f64) -> String {
    // A float becomes the nearest of the integer's range.
    let seconds = seconds.round() as u64;
    let (hours, minutes, rest) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    match (hours, minutes) {
        (0, 0) => format!("{rest}s"),
        (0, _) => format!("{minutes}m{rest:02}s"),
        _ => format!("{hours}h{minutes:02}m{rest:02}s"),
    }
}

/// The same with tenths of a second below a minute, such as `4.5s`.
pub fn duration_with_tenths(seconds: f64) -> String {
    match seconds < 60.0 {
        true => format!("{seconds:.1}s"),
        false => duration(seconds),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_seconds_are_rounded() {
        let times: Vec<String> = [0.4, 59.6, 725.0, 3725.0, f64::NAN].map(duration).into();
        assert_eq!(times, ["0s", "1m00s", "12m05s", "1h02m05s", "0s"]);
    }

    #[test]
    fn durations_are_short() {
        for (seconds, expected) in [
            (0.0, "0.0s"),
            (59.94, "59.9s"),
            (60.0, "1m00s"),
            (3599.4, "59m59s"),
            (7325.0, "2h02m05s"),
        ] {
            assert_eq!(duration_with_tenths(seconds), expected);
        }
    }
}
