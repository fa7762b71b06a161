//! [`Terminal`]: keys of standard input, one at a time and without an echo. It is given back as it was, whatever ends the process.

use std::io::{self, IsTerminal};

use ipc_types::Descriptor;
use rustix::process::getpgrp;
use rustix::stdio::stdin;
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcgetpgrp, tcsetattr};

use crate::keys::{Key, keys};

/// Most bytes of keys that one read takes; what is more wakes the next wait.
const MAX_KEYS: usize = 256;

/// Standard input as keys.
pub(super) struct Terminal {
    before: Termios,
}

impl Terminal {
    /// Takes standard input, if it is a terminal in whose foreground this process is.
    pub(super) fn enter() -> Option<Terminal> {
        if !io::stdin().is_terminal() || tcgetpgrp(stdin()).ok()? != getpgrp() {
            return None;
        }
        let before = tcgetattr(stdin()).ok()?;
        let mut keys = before.clone();
        // Signals such as Ctrl+C stay signals, and what is printed is printed as before.
        keys.local_modes
            .remove(LocalModes::ICANON | LocalModes::ECHO);
        tcsetattr(stdin(), OptionalActions::Now, &keys).ok()?;
        Some(Terminal { before })
    }

    /// What to wait for.
    pub(super) fn source(&self) -> Descriptor<'_> {
        Descriptor::new(stdin())
    }

    /// What the keys that are there ask for; `None` if the terminal is gone. To be called when the wait says so: else it waits
    /// for a key.
    pub(super) fn read(&mut self) -> Option<Vec<PlayerKey>> {
        let mut bytes = [0; MAX_KEYS];
        match rustix::io::read(stdin(), &mut bytes) {
            Ok(0) => None,
            Ok(count) => Some(player_keys(&bytes[..count])),
            Err(rustix::io::Errno::INTR | rustix::io::Errno::AGAIN) => Some(Vec::new()),
            Err(_) => None,
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // Best effort: a terminal that is gone needs nothing.
        let _ = tcsetattr(stdin(), OptionalActions::Now, &self.before);
    }
}

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlayerKey {
    /// Stand still, or go on.
    Pause,
    /// Play the next message, and stand still.
    Step,
    /// End.
    Quit,
}

/// The keys in `bytes` that mean something, which one read of the terminal gave.
fn player_keys(bytes: &[u8]) -> Vec<PlayerKey> {
    let player_key = |key| match key {
        Key::Char(' ') => Some(PlayerKey::Pause),
        Key::Char('.') | Key::Right => Some(PlayerKey::Step),
        // Ctrl+D ends input. Ctrl+C is a signal.
        Key::Char('q' | 'Q') | Key::Interrupt => Some(PlayerKey::Quit),
        _ => None,
    };
    keys(bytes).into_iter().filter_map(player_key).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_read() {
        for (bytes, expected) in [
            (&b" "[..], &[PlayerKey::Pause][..]),
            (b"..", &[PlayerKey::Step, PlayerKey::Step]),
            (b"\x1b[C\x1bOC", &[PlayerKey::Step, PlayerKey::Step]),
            (b"\x1b[Aq", &[PlayerKey::Quit]),
            (b"x\x1b", &[]),
            (b"\x04", &[PlayerKey::Quit]),
            (b"", &[]),
        ] {
            assert_eq!(player_keys(bytes), expected, "{bytes:?}");
        }
    }
}
