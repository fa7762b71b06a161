//! Texts of files, made harmless.

/// The text without characters that change how what follows is read: controls, and those that turn the direction of text. Each
/// becomes a replacement character, so that it is seen that something was there.
fn plain(text: &str) -> String {
    let shown = |character: char| match character {
        '\t' | '\n' => ' ',
        '\u{200e}'
        | '\u{200f}'
        | '\u{202a}'..='\u{202e}'
        | '\u{2066}'..='\u{2069}'
        | '\u{feff}' => '\u{fffd}',
        // No characters of Unicode texts.
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
}
