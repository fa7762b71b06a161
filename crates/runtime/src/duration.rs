//! Times as people write them: `200ms`, `5s`, `1m30s`, `2h`. The one reader and the one writer for command lines and
//! messages.
//!
//! A number without a unit is refused: whether `--timeout 5` means seconds or milliseconds must not depend on the
//! option.

use std::fmt;
use std::time::Duration;

/// The units, from the longest to the shortest, with their lengths in nanoseconds.
const UNITS: [(&str, u64); 5] = [
    ("h", 3_600_000_000_000),
    ("m", 60_000_000_000),
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1_000),
];

/// Longest duration that is read, hours: a hundred years. The options have tighter bounds of their own; this one keeps
/// the arithmetic from overflowing.
const MAX_HOURS: f64 = 876_000.0;

/// Reads a duration: one or more numbers, each with its unit, the longest unit first and none twice.
///
/// # Errors
///
/// What is wrong with the text, and how it is written.
pub fn parse(text: &str) -> Result<Duration, String> {
    const EXAMPLES: &str = "such as 200ms, 5s, 1m30s or 2h";
    let with_point = text.replacen(',', ".", 1);
    if text.matches(',').count() == 1 && parse(&with_point).is_ok() {
        return Err(format!("`{text}` has a decimal comma: write {with_point}"));
    }
    let wrong = || format!("`{text}` is no duration, {EXAMPLES}");
    let mut rest = text.trim();
    if rest.is_empty() {
        return Err(wrong());
    }
    let is_number = rest
        .bytes()
        .all(|byte| byte.is_ascii_digit() || byte == b'.');
    if is_number && rest.parse::<f64>().is_ok() {
        return Err(format!("`{rest}` has no unit: write {rest}s or {rest}ms"));
    }
    let mut total_ns = 0.0;
    let mut units = UNITS.iter();
    while !rest.is_empty() {
        let number_len = rest.find(|c: char| !c.is_ascii_digit() && c != '.');
        let (number, from_unit) = rest.split_at(number_len.ok_or_else(wrong)?);
        let unit_len = from_unit.find(|c: char| c.is_ascii_digit() || c == '.');
        let (unit, behind) = from_unit.split_at(unit_len.unwrap_or(from_unit.len()));
        let number: f64 = number.parse().map_err(|_| wrong())?;
        // Going on behind the unit that was found last is what keeps them in order.
        let (_, unit_ns) = units.find(|(name, _)| *name == unit).ok_or_else(wrong)?;
        total_ns += number * *unit_ns as f64;
        rest = behind;
    }
    if total_ns > MAX_HOURS * UNITS[0].1 as f64 {
        return Err(format!("`{text}` is too long: at most {MAX_HOURS}h"));
    }
    Ok(Duration::from_nanos(total_ns.round() as u64))
}

/// A duration as [`parse`] reads it: exact to a thousandth of its shortest unit shown, which is µs below a millisecond,
/// ms below a second, else s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DurationText(pub Duration);

impl fmt::Display for DurationText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ns = self.0.as_nanos();
        if ns == 0 {
            return f.write_str("0s");
        }
        if ns < 1_000_000 {
            return write!(f, "{}us", thousandths(ns));
        }
        if ns < 1_000_000_000 {
            return write!(f, "{}ms", thousandths(ns / 1_000));
        }
        let ms = ns / 1_000_000;
        let (hours, minutes, ms) = (ms / 3_600_000, ms / 60_000 % 60, ms % 60_000);
        if hours > 0 {
            write!(f, "{hours}h")?;
        }
        if minutes > 0 {
            write!(f, "{minutes}m")?;
        }
        if ms > 0 {
            write!(f, "{}s", thousandths(ms))?;
        }
        Ok(())
    }
}

/// A number of thousandths as a decimal without zeros at its end.
fn thousandths(number: u128) -> String {
    let text = format!("{}.{:03}", number / 1_000, number % 1_000);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_is_read_again() {
        for (text, duration) in [
            ("0s", Duration::ZERO),
            ("350us", Duration::from_micros(350)),
            ("200ms", Duration::from_millis(200)),
            ("1.5ms", Duration::from_micros(1_500)),
            ("5s", Duration::from_secs(5)),
            ("2.25s", Duration::from_millis(2_250)),
            ("1m", Duration::from_secs(60)),
            ("1m30s", Duration::from_secs(90)),
            ("2h", Duration::from_secs(7_200)),
            ("2h0.5s", Duration::from_millis(7_200_500)),
            ("24h", Duration::from_secs(86_400)),
        ] {
            assert_eq!(DurationText(duration).to_string(), text);
            assert_eq!(parse(text), Ok(duration), "{text}");
        }
    }

    #[test]
    fn what_is_below_the_resolution_is_not_shown() {
        let shown = |duration| DurationText(duration).to_string();
        assert_eq!(shown(Duration::from_nanos(1_000_400)), "1ms");
        assert_eq!(shown(Duration::from_nanos(90_000_400_000)), "1m30s");
        assert_eq!(shown(Duration::from_nanos(7)), "0.007us");
    }

    #[test]
    fn a_number_without_unit_is_refused_with_what_to_write() {
        for text in ["5", " 5 ", "0", "0.5"] {
            let error = parse(text).unwrap_err();
            let expected = format!("has no unit: write {}s", text.trim());
            assert!(error.contains(&expected), "{text}: {error}");
        }
    }

    #[test]
    fn a_decimal_comma_is_refused_with_what_to_write() {
        let error = parse("1,5s").unwrap_err();
        assert_eq!(error, "`1,5s` has a decimal comma: write 1.5s");
    }

    #[test]
    fn what_is_no_duration_is_refused_with_examples() {
        for text in [
            "", "s", "5x", "5 s", "five", "-5", "1e3", "-5s", "5s5", "30s1m", "5s5s", "1..5s",
            ".s", "nan", "inf", "5µ", "5S",
        ] {
            let error = parse(text).unwrap_err();
            assert!(
                error.contains("such as 200ms, 5s, 1m30s or 2h"),
                "{text}: {error}"
            );
        }
        for text in ["876001h", "99999999999999999999999999999999h"] {
            assert!(parse(text).unwrap_err().contains("too long"), "{text}");
        }
        assert_eq!(parse(" 876000h "), Ok(Duration::from_secs(3_153_600_000)));
    }
}
