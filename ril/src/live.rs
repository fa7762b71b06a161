//! [`Block`]: lines at the end of a terminal that are shown anew in their place. Whether there is a terminal at all is the
//! caller's to know: nothing of this may go into a file or a pipe.

use std::io::{self, Write};

/// The lines that stand on the terminal now.
#[derive(Debug, Default)]
pub struct Block {
    lines_up: usize,
}

impl Block {
    /// Shows `lines` in the place of the last ones, which are gone.
    ///
    /// # Errors
    ///
    /// When `out` cannot be written.
    pub fn show<L: AsRef<str>>(
        &mut self,
        out: &mut impl Write,
        lines: impl IntoIterator<Item = L>,
    ) -> io::Result<()> {
        self.clear(out)?;
        for line in lines {
            writeln!(out, "{}", line.as_ref())?;
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

    #[test]
    fn new_lines_take_the_place_of_the_old_ones() {
        let (mut block, mut out) = (Block::default(), Vec::new());
        block.show(&mut out, ["a", "b"]).unwrap();
        block.show(&mut out, ["c"]).unwrap();
        block.clear(&mut out).unwrap();
        block.clear(&mut out).unwrap();
        assert_eq!(out, b"a\nb\n\x1b[2A\x1b[Jc\n\x1b[1A\x1b[J");
    }
}
