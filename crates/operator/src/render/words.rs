//! Numbers, times, paragraphs and names as people read them. Pure but for the width of the terminal.

use std::fmt::Display;
use std::io;

use ipc_types::code::{ImiCode, ModuleStatus};

use runtime::plain::plain_name;

use crate::render::terminal::Size;

/// `1 sample`, `2 samples`: the plural is the singular with an s.
pub fn count<N: Display + PartialEq + From<u8>>(number: N, singular: &str) -> String {
    count_irregular(number, singular, &format!("{singular}s"))
}

/// `1 thing half removed`, `2 things half removed`: of things whose plural is another.
pub fn count_irregular<N: Display + PartialEq + From<u8>>(
    number: N,
    singular: &str,
    plural: &str,
) -> String {
    let noun = if number == N::from(1) {
        singular
    } else {
        plural
    };
    format!("{number} {noun}")
}

/// What a module says of itself: the wire's words, such as *ended* of one that is ready, are those of programs. `None`
/// for a number that is not in the contract.
pub fn module_words(status: Option<ModuleStatus>, is_blocked: bool) -> Option<&'static str> {
    Some(match status? {
        ModuleStatus::WaitingDataToStart => "not started",
        ModuleStatus::Ended if is_blocked => "stopped",
        ModuleStatus::Running => "started",
        ModuleStatus::Ended => "ready",
        ModuleStatus::Aborted => "aborted",
    })
}

/// The error of a module.
pub fn error_words(error: ImiCode) -> String {
    match error.is_none() {
        true => "no error".to_owned(),
        false => error.to_string(),
    }
}

/// What there is, or a dash.
pub fn or_dash(shown: Option<impl Display>) -> String {
    shown.map_or_else(|| "-".to_owned(), |shown| shown.to_string())
}

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

/// A duration in words, with tenths of a second below a minute, such as `4.5s`.
pub fn duration_with_tenths(seconds: f64) -> String {
    match seconds < 60.0 {
        true => format!("{seconds:.1}s"),
        false => duration(seconds),
    }
}

/// Metres, such as `950 m`, `12.3 km`, `4810 km`.
pub fn distance(metres: f64) -> String {
    match metres {
        metres if metres.abs() < 9_999.5 => format!("{metres:.0} m"),
        metres if metres.abs() >= 99_950.0 => format!("{:.0} km", metres / 1000.0),
        metres => format!("{:.1} km", metres / 1000.0),
    }
}

/// Numbers of items, such as `item 3`, `items 3, 4 and 7`, `items 3, 4, 5 and 12 more`.
pub fn items(numbers: &[u32]) -> String {
    const MOST: usize = 5;
    let list = |numbers: &[u32]| {
        let texts: Vec<String> = numbers.iter().map(u32::to_string).collect();
        texts.join(", ")
    };
    match numbers {
        [] => "the plan".to_owned(),
        [one] => format!("item {one}"),
        [first @ .., last] if numbers.len() <= MOST => {
            format!("items {} and {last}", list(first))
        }
        _ => format!(
            "items {} and {} more",
            list(&numbers[..MOST - 1]),
            numbers.len() - MOST + 1
        ),
    }
}

/// Narrowest and widest text, columns: below, words no longer fit; above, lines are hard to read.
const COLUMNS: std::ops::RangeInclusive<usize> = 60..=120;

/// How wide text on standard output is.
pub fn columns() -> usize {
    Size::of(io::stdout())
        .columns
        .clamp(*COLUMNS.start(), *COLUMNS.end())
}

/// Words in lines of at most `columns`, the first after `first`, the others after as many spaces.
pub fn wrap(first: &str, words: &str, columns: usize) -> String {
    let indent = first.chars().count();
    let mut text = first.to_owned();
    let mut column = indent;
    for word in words.split_whitespace() {
        let length = word.chars().count();
        if column > indent && column + 1 + length > columns {
            text.push('\n');
            text.push_str(&" ".repeat(indent));
            column = indent;
        } else if column > indent {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        column += length;
    }
    text.push('\n');
    text
}

/// Quotes a name so that a shell reads it as one word: a log's name of the original software has parentheses, and a
/// plan's name may have blanks. What a terminal would obey stands there in words that bash understands.
pub fn shell_word(word: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "/._-+,:".contains(letter);
    if plain_name(word) != word {
        return ansi_c(word);
    }
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// `word` as bash reads it behind `$`: with names for all that a terminal would obey.
pub fn ansi_c(word: &str) -> String {
    let mut quoted = "$'".to_owned();
    for letter in word.chars() {
        match letter {
            '\'' | '\\' => quoted.extend(['\\', letter]),
            letter if plain_name(letter.encode_utf8(&mut [0; 4])).len() > letter.len_utf8() => {
                quoted.push_str(&format!("\\u{:04x}", u32::from(letter)));
            }
            letter => quoted.push(letter),
        }
    }
    quoted + "'"
}

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
    fn one_is_singular() {
        let texts = [0, 1, 2].map(|number: u64| count(number, "sample"));
        assert_eq!(texts, ["0 samples", "1 sample", "2 samples"]);
        let texts =
            [1, 2].map(|number: usize| count_irregular(number, "piece left", "pieces left"));
        assert_eq!(texts, ["1 piece left", "2 pieces left"]);
    }

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

    #[test]
    fn numbers_have_the_digits_that_matter() {
        assert_eq!(distance(949.6), "950 m");
        assert_eq!(distance(12_345.0), "12.3 km");
        assert_eq!(distance(4_810_400.0), "4810 km");
        assert_eq!(items(&[3]), "item 3");
        assert_eq!(items(&[3, 4, 7]), "items 3, 4 and 7");
        assert_eq!(items(&[1, 2, 3, 4, 5, 6, 7]), "items 1, 2, 3, 4 and 3 more");
    }

    #[test]
    fn words_are_wrapped_behind_their_heading() {
        assert_eq!(wrap("a  ", "one two three", 10), "a  one two\n   three\n");
        assert_eq!(
            wrap("a  ", "incomprehensibly long", 10),
            "a  incomprehensibly\n   long\n"
        );
        assert_eq!(wrap("", "", 10), "\n");
    }

    #[test]
    fn what_a_shell_would_not_read_as_one_word_is_quoted() {
        for (word, expected) in [
            ("log/flight-1.mcap", "log/flight-1.mcap"),
            ("hero(1)_22_11_26.tsv", "'hero(1)_22_11_26.tsv'"),
            ("my plan.gpx", "'my plan.gpx'"),
            ("it's", r"'it'\''s'"),
            ("", "''"),
        ] {
            assert_eq!(shell_word(word), expected);
        }
    }

    #[test]
    fn a_day_begins_at_midnight() {
        let times = [0, 86_399, 86_400 + 3_661].map(time_of_day);
        assert_eq!(times, ["00:00:00", "23:59:59", "01:01:01"]);
    }
}
