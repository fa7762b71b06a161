//! Names in commands that people copy into a shell.

/// As a shell reads it as one word: the name of a record has parentheses, and that of a plan may have blanks.
pub fn shell_word(word: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "/._-+,:".contains(letter);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_shell_would_not_read_as_one_word_is_quoted() {
        for (word, expected) in [
            ("log/flight-1.mcap", "log/flight-1.mcap"),
            ("hero(1)_2026-11-22.mcap", "'hero(1)_2026-11-22.mcap'"),
            ("my plan.gpx", "'my plan.gpx'"),
            ("it's", r"'it'\''s'"),
            ("", "''"),
        ] {
            assert_eq!(shell_word(word), expected);
        }
    }
}
