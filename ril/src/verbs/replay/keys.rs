//! [`Wish`]: what the keys of a terminal ask a replay for.

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Stand still, or go on.
    Pause,
    /// Play the next message, and stand still.
    Step,
    /// End.
    Quit,
}

/// The wishes in `bytes`, which one read of the terminal gave. Other keys mean nothing.
pub fn wishes(bytes: &[u8]) -> Vec<Wish> {
    let mut wishes = Vec::new();
    let mut rest = bytes;
    while let Some((first, behind)) = rest.split_first() {
        rest = behind;
        match first {
            b' ' => wishes.push(Wish::Pause),
            b'.' => wishes.push(Wish::Step),
            // Ctrl+D ends input. Ctrl+C is a signal.
            b'q' | b'Q' | 0x04 => wishes.push(Wish::Quit),
            0x1b => {
                if let [b'[' | b'O', key, behind @ ..] = rest {
                    wishes.extend((*key == b'C').then_some(Wish::Step));
                    rest = behind;
                }
            }
            _ => {}
        }
    }
    wishes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_wishes() {
        for (bytes, expected) in [
            (&b" "[..], &[Wish::Pause][..]),
            (b"..", &[Wish::Step, Wish::Step]),
            (b"\x1b[C\x1bOC", &[Wish::Step, Wish::Step]),
            (b"\x1b[Aq", &[Wish::Quit]),
            (b"x\x1b", &[]),
            (b"\x04", &[Wish::Quit]),
            (b"", &[]),
        ] {
            assert_eq!(wishes(bytes), expected, "{bytes:?}");
        }
    }
}
