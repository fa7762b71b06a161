//! Short texts in fields of bytes: printable ASCII, filled up with zeros.

/// `text` as it lies in a field of `N` bytes: cut to its length, with `?` for what is not printable ASCII.
pub fn ascii_bytes<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    for (place, letter) in bytes.iter_mut().zip(text.chars()) {
        let is_printable = letter.is_ascii_graphic() || letter == ' ';
        *place = if is_printable { letter as u8 } else { b'?' };
    }
    bytes
}

/// The text in `bytes` before the first zero; `None` if a byte is not printable ASCII.
///
/// A terminal can show it as it is: there are no control characters in it.
pub fn ascii_text(bytes: &[u8]) -> Option<&str> {
    let len = bytes.iter().position(|byte| *byte == 0);
    let text = std::str::from_utf8(&bytes[..len.unwrap_or(bytes.len())]).ok()?;
    let is_printable = |letter: char| letter.is_ascii_graphic() || letter == ' ';
    text.chars().all(is_printable).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_and_printable_and_comes_back() {
        assert_eq!(ascii_bytes::<6>("ab"), *b"ab\0\0\0\0");
        assert_eq!(ascii_bytes::<2>("abc"), *b"ab");
        assert_eq!(ascii_bytes::<4>("\u{e9}\n a"), *b"?? a");
        assert_eq!(ascii_text(b"ab\0c"), Some("ab"));
        assert_eq!(ascii_text(b"ab"), Some("ab"));
        assert_eq!(ascii_text(b""), Some(""));
    }

    #[test]
    fn control_characters_and_bytes_above_ascii_are_no_text() {
        for bytes in [
            b"\x1b[2J".as_slice(),
            b"a\nb",
            "caf\u{e9}".as_bytes(),
            &[0xff],
        ] {
            assert_eq!(ascii_text(bytes), None, "{bytes:?}");
        }
    }
}
