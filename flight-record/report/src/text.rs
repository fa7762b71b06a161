//! Texts of files, made harmless before they are escaped.

/// The text without characters that change how what follows is read: controls, and those that turn the direction of text. Each
/// becomes a replacement character, so that it is seen that something was there.
pub fn plain(text: &str) -> String {
    let shown = |character: char| match character {
        '\t' | '\n' => ' ',
        '\u{200e}'
        | '\u{200f}'
        | '\u{202a}'..='\u{202e}'
        | '\u{2066}'..='\u{2069}'
        | '\u{feff}' => '\u{fffd}',
        // No character of XML, not even as a reference.
        '\u{fffe}' | '\u{ffff}' => '\u{fffd}',
        character if character.is_control() => '\u{fffd}',
        character => character,
    };
    text.chars().map(shown).collect()
}

/// The same with at most `most` characters; what is cut off is an ellipsis.
pub fn short(text: &str, most: usize) -> String {
    let text = plain(text);
    if text.chars().count() <= most {
        return text;
    }
    text.chars()
        .take(most.saturating_sub(1))
        .chain(['…'])
        .collect()
}

/// A time since the beginning as people read it: `7.3 s`, `1:05`, `2:00:05`.
pub fn moment(at_s: f64) -> String {
    if at_s < 60.0 {
        return format!("{at_s:.1} s");
    }
    clock(at_s)
}

/// A time as a clock shows it: `0:07`, `1:05`, `2:00:05`.
pub fn clock(at_s: f64) -> String {
    let whole = at_s.round() as u64;
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    match hours {
        0 => format!("{minutes}:{seconds:02}"),
        _ => format!("{hours}:{minutes:02}:{seconds:02}"),
    }
}

/// The time of the day, UTC, so long after a moment in ns since 1970: `11:54:43.5`.
pub fn day_time(start_unix_ns: u64, at_s: f64) -> String {
    let tenths = start_unix_ns as f64 / 1e8 + at_s * 10.0;
    let tenths = tenths.round() as u64 % 864_000;
    let (whole, tenth) = (tenths / 10, tenths % 10);
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    format!("{hours:02}:{minutes:02}:{seconds:02}.{tenth}")
}

/// A number with as many digits as a person compares.
pub fn number(value: f64) -> String {
    let digits = match value.abs() {
        0.0 => 0,
        size if size < 0.01 => 4,
        size if size < 0.1 => 3,
        size if size < 1.0 => 2,
        size if size < 100.0 => 1,
        _ => 0,
    };
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_obeyed_stays() {
        assert_eq!(
            plain("a\u{1b}[2Jb\u{202e}c\0\tä"),
            "a\u{fffd}[2Jb\u{fffd}c\u{fffd} ä"
        );
        assert_eq!(short("abcdef", 4), "abc…");
        assert_eq!(short("abcd", 4), "abcd");
    }

    #[test]
    fn times_and_numbers_are_short() {
        for (at_s, expected) in [
            (0.0, "0.0 s"),
            (7.31, "7.3 s"),
            (65.0, "1:05"),
            (7205.0, "2:00:05"),
        ] {
            assert_eq!(moment(at_s), expected);
        }
        assert_eq!(day_time(1_795_348_483_476_936_000, 60.03), "11:55:43.5");
        for (value, expected) in [
            (0.0, "0"),
            (0.123, "0.12"),
            (24.19, "24.2"),
            (1234.5, "1234"),
            (-0.004, "-0.0040"),
        ] {
            assert_eq!(number(value), expected);
        }
    }
}
