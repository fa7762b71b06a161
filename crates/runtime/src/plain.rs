//! Texts of others on a terminal, which would obey control characters: those of a file's name, a plan, a log.

use std::borrow::Cow;
use std::path::Path;

/// Whether a terminal obeys `letter` instead of showing it: a control character, or one that turns the direction in
/// which what follows is shown.
fn commands(letter: char) -> bool {
    let turns = matches!(letter, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    letter.is_control() || turns
}

/// `text` of one or several lines with all that a terminal would obey written out, such as `\u{1b}`. Ends of lines and
/// tabulators stay.
pub fn plain(text: &str) -> Cow<'_, str> {
    escaped(text, |letter| {
        commands(letter) && letter != '\n' && letter != '\t'
    })
}

/// A name on one line, with all that a terminal would obey written out.
pub fn plain_name(name: &str) -> Cow<'_, str> {
    escaped(name, commands)
}

/// The name of a file on one line, as [`plain_name`].
pub fn plain_path(file: &Path) -> String {
    plain_name(&file.to_string_lossy()).into_owned()
}

fn escaped(text: &str, is_written_out: impl Fn(char) -> bool) -> Cow<'_, str> {
    // Nearly every line of a log is printable ASCII, whose bytes need not be taken for letters.
    let ends = !is_written_out('\n');
    let is_simple = |byte: u8| (b' '..=b'~').contains(&byte) || ends && byte == b'\n';
    if text.bytes().all(is_simple) {
        return Cow::Borrowed(text);
    }
    if !text.chars().any(&is_written_out) {
        return Cow::Borrowed(text);
    }
    let mut plain = String::new();
    for letter in text.chars() {
        match is_written_out(letter) {
            true => plain.extend(letter.escape_default()),
            false => plain.push(letter),
        }
    }
    Cow::Owned(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_written_out_and_nothing_else() {
        let name = "a\u{1b}[2J\u{202e}\u{7f}\u{9b}\r 'é\"\\ñ\n\tb";
        let plain_text = r#"a\u{1b}[2J\u{202e}\u{7f}\u{9b}\r 'é"\ñ"#;
        assert_eq!(plain(name), format!("{plain_text}\n\tb"));
        assert_eq!(plain_name(name), format!(r"{plain_text}\n\tb"));
        assert!(matches!(plain("simple"), Cow::Borrowed(_)));
    }
}
