//! Numbers and paragraphs as people read them.

use std::io;

use crate::live::Size;

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

/// Metres, such as `950 m`, `12.3 km`.
pub fn distance(metres: f64) -> String {
    match metres {
        metres if metres.abs() < 9_999.5 => format!("{metres:.0} m"),
        metres => format!("{:.1} km", metres / 1000.0),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

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
    fn numbers_have_the_digits_that_matter() {
        assert_eq!(distance(949.6), "950 m");
        assert_eq!(distance(12_345.0), "12.3 km");
        let times: Vec<String> = [0.4, 59.6, 725.0, 3725.0, f64::NAN].map(duration).into();
        assert_eq!(times, ["0s", "1m00s", "12m05s", "1h02m05s", "0s"]);
        assert_eq!(items(&[3]), "item 3");
        assert_eq!(items(&[3, 4, 7]), "items 3, 4 and 7");
        assert_eq!(items(&[1, 2, 3, 4, 5, 6, 7]), "items 1, 2, 3, 4 and 3 more");
    }
}
