//! Paragraphs of lines of a width.

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
}
