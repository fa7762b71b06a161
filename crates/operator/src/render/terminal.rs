//! [`Block`]: lines at the end of a terminal that are shown anew in their place. The caller
//! makes sure that there is a terminal: nothing of this may go into a file or a pipe.

use std::io::{self, Write};
use std::os::fd::AsFd;

use rustix::io::Errno;
use rustix::stdio::stdin;

/// How much a terminal shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Characters in a line.
    pub columns: usize,
    /// Lines.
    pub rows: usize,
}

impl Size {
    /// The size of `terminal`, or the classic one if it does not say.
    pub fn of(terminal: impl AsFd) -> Size {
        let said = rustix::termios::tcgetwinsize(terminal).ok();
        let said = said.filter(|size| size.ws_col > 0 && size.ws_row > 0);
        said.map_or(
            Size {
                columns: 80,
                rows: 24,
            },
            |size| Size {
                columns: size.ws_col.into(),
                rows: size.ws_row.into(),
            },
        )
    }
}

/// The lines that stand on the terminal now.
#[derive(Debug, Default)]
pub struct Block {
    lines_up: usize,
}

impl Block {
    /// Shows `lines` in the place of the last ones, which are gone.
    ///
    /// What does not fit is cut off: a line that wraps, or a block that scrolls, could not be taken away again.
    ///
    /// # Errors
    ///
    /// When `out` cannot be written.
    pub fn show<L: AsRef<str>>(
        &mut self,
        out: &mut impl Write,
        size: Size,
        lines: impl IntoIterator<Item = L>,
    ) -> io::Result<()> {
        self.clear(out)?;
        // The last row is where the cursor stands afterwards.
        for line in lines.into_iter().take(size.rows.saturating_sub(1)) {
            let line: String = line.as_ref().chars().take(size.columns).collect();
            writeln!(out, "{line}")?;
            self.lines_up += 1;
        }
        out.flush()
    }

    /// Takes the lines away.
    ///
    /// # Errors
    ///
    /// When `out` cannot be written.
    pub fn clear(&mut self, out: &mut impl Write) -> io::Result<()> {
        if self.lines_up > 0 {
            // Up to the block's first line, then erase to the end of the screen.
            write!(out, "\x1b[{}A\x1b[J", self.lines_up)?;
            self.lines_up = 0;
        }
        Ok(())
    }
}

/// Longest control sequence that is read as one, bytes; of a longer one the rest is taken as characters. Terminals send
/// at most about twenty.
const MAX_SEQUENCE: usize = 32;

/// Most bytes of keys that one read takes; what is more wakes the next wait.
const MAX_KEYS: usize = 256;

/// The keys that wait at standard input; `None` if it is gone. To be called when the wait says so: else it waits for
/// one.
pub fn read_keys() -> Option<Vec<Key>> {
    let mut bytes = [0; MAX_KEYS];
    match rustix::io::read(stdin(), &mut bytes) {
        Ok(0) => None,
        Ok(count) => Some(keys(&bytes[..count])),
        Err(Errno::INTR | Errno::AGAIN) => Some(Vec::new()),
        Err(_) => None,
    }
}

/// A key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// A character.
    Char(char),
    /// Enter.
    Enter,
    /// Tab.
    Tab,
    /// Shift and Tab.
    BackTab,
    /// The arrow to the right.
    Right,
    /// Escape.
    Escape,
    /// Backspace or Delete.
    Backspace,
    /// Ctrl+C, Ctrl+D or Ctrl+\: the wish to end.
    Interrupt,
    /// Ctrl+L: the wish to draw the screen anew.
    Redraw,
    /// Ctrl+Z: the wish for the shell.
    Suspend,
}

/// The keys in `bytes`, which one read gave. A sequence that is cut by the end is taken for Escape and characters:
/// Escape only ever cancels, so that does no harm. Function keys and the other arrows are ignored.
pub fn keys(bytes: &[u8]) -> Vec<Key> {
    let mut keys = Vec::new();
    let mut rest = bytes;
    while let Some((first, after)) = rest.split_first() {
        rest = after;
        match first {
            0x1b => match sequence(after) {
                Some(len) => {
                    match &after[..len] {
                        b"[Z" => keys.push(Key::BackTab),
                        b"[C" | b"OC" => keys.push(Key::Right),
                        _ => {}
                    }
                    rest = &after[len..];
                }
                None => keys.push(Key::Escape),
            },
            b'\r' | b'\n' => keys.push(Key::Enter),
            b'\t' => keys.push(Key::Tab),
            0x7f | 0x08 => keys.push(Key::Backspace),
            0x03 | 0x04 | 0x1c => keys.push(Key::Interrupt),
            0x0c => keys.push(Key::Redraw),
            0x1a => keys.push(Key::Suspend),
            letter @ 0x20..0x7f => keys.push(Key::Char(char::from(*letter))),
            // Nothing here has a meaning outside ASCII.
            _ => {}
        }
    }
    keys
}

/// How many of the bytes after an Escape belong to its sequence; `None` if Escape stands alone.
fn sequence(after: &[u8]) -> Option<usize> {
    match after {
        [b'O', _, ..] => Some(2),
        [b'[', parameters @ ..] => {
            let is_final = |byte: &u8| (0x40..=0x7e).contains(byte);
            let end = parameters.iter().take(MAX_SEQUENCE).position(is_final)?;
            Some(end + 2)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        columns: 4,
        rows: 3,
    };

    #[test]
    fn new_lines_take_the_place_of_the_old_ones() {
        let (mut block, mut out) = (Block::default(), Vec::new());
        block.show(&mut out, SIZE, ["a", "b"]).unwrap();
        block.show(&mut out, SIZE, ["c"]).unwrap();
        block.clear(&mut out).unwrap();
        block.clear(&mut out).unwrap();
        assert_eq!(out, b"a\nb\n\x1b[2A\x1b[Jc\n\x1b[1A\x1b[J");
    }

    #[test]
    fn what_does_not_fit_is_cut_off() {
        let (mut block, mut out) = (Block::default(), Vec::new());
        block
            .show(&mut out, SIZE, ["ab…de", "b", "c", "d"])
            .unwrap();
        block.clear(&mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        assert_eq!(text, "ab…d\nb\n\x1b[2A\x1b[J");
    }

    #[test]
    fn what_is_no_terminal_has_the_classic_size() {
        let (file, _) = io::pipe().unwrap();
        assert_eq!((Size::of(&file).columns, Size::of(&file).rows), (80, 24));
    }

    #[test]
    fn keys_are_read_and_sequences_that_mean_nothing_are_dropped() {
        for (bytes, expected) in [
            (&b"h\r"[..], &[Key::Char('h'), Key::Enter][..]),
            (b"\x1b", &[Key::Escape]),
            (b"\t\x1b[Z\x7f", &[Key::Tab, Key::BackTab, Key::Backspace]),
            (b"\x1b[A\x1bOPq\x1b[1;5C", &[Key::Char('q')]),
            (b"\x1b[C\x1bOC", &[Key::Right, Key::Right]),
            (
                b"\x03\x0c\x1a",
                &[Key::Interrupt, Key::Redraw, Key::Suspend],
            ),
            (b"\x1b\x1b", &[Key::Escape, Key::Escape]),
            ("é\u{1f600}".as_bytes(), &[]),
            (b"", &[]),
        ] {
            assert_eq!(keys(bytes), expected, "{bytes:?}");
        }
    }

    #[test]
    fn a_sequence_without_end_is_no_sequence() {
        let mut bytes = b"\x1b[".to_vec();
        bytes.extend([b'1'; 1000]);
        let keys = keys(&bytes);
        assert_eq!(keys[0], Key::Escape);
        assert_eq!(keys.len(), 1002);
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_are_read(bytes: Vec<u8>) {
            assert!(keys(&bytes).len() <= bytes.len());
        }
    }
}
