//! [`Block`]: lines at the end of a terminal that are shown anew in their place. Whether there is a terminal at all is the
//! caller's to know: nothing of this may go into a file or a pipe.

use std::io::{self, Write};
use std::os::fd::AsFd;

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
}
