//! Words that were written wrong, and which were meant.

/// The reader's message, with a suggestion for a word that it does not know.
pub(super) fn explain(message: &str) -> String {
    // The parser's own messages may have several lines; one is the rule for errors.
    let message = message.trim().replace('\n', ", ");
    match suggestion(&message) {
        Some(word) => format!("{message}; did you mean `{word}`?"),
        None => message,
    }
}

/// The expected word that is nearest to the unknown one that serde's message names.
///
/// serde's messages are ``unknown field `x`, expected one of `a`, `b` `` and the same with `variant`.
fn suggestion(message: &str) -> Option<&str> {
    let rest = message
        .strip_prefix("unknown field `")
        .or_else(|| message.strip_prefix("unknown variant `"))?;
    let mut words = rest.split('`').step_by(2);
    let unknown = words.next()?;
    nearest(unknown, words)
}

/// Of the `expected` words the one nearest to `unknown`, if it is near enough to be a slip of the keyboard: for "did you
/// mean".
pub fn nearest<'a>(unknown: &str, expected: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // One wrong letter in three is still a slip; more is another word.
    let length = |word: &str| word.chars().count();
    let near = |expected: &str| length(unknown).max(length(expected)).div_ceil(3);
    expected
        .into_iter()
        .filter(|expected| !expected.is_empty())
        .map(|expected| (edit_distance(unknown, expected), expected))
        .filter(|(distance, expected)| *distance <= near(expected))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, expected)| expected)
}

/// How many letters must be inserted, deleted or replaced to make `b` of `a` (Levenshtein).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, a) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, b) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suggestion_is_made_only_for_a_slip() {
        let message = |word: &str| format!("unknown field `{word}`, expected `gain` or `device`");
        for (word, expected) in [
            ("gian", Some("gain")),
            ("Gain", Some("gain")),
            ("devices", Some("device")),
            ("speed", None),
            ("", None),
        ] {
            assert_eq!(suggestion(&message(word)), expected, "{word}");
        }
        assert_eq!(suggestion("something else"), None);
        assert_eq!(suggestion("unknown field `a`, there are no fields"), None);
    }
}
