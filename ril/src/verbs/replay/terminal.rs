//! The terminal of a replay: keys of standard input, one at a time and without an echo; on standard output requests as they pass, and a line
//! with the position in the flight.

use std::io::{self, IsTerminal, Stdout, Write};
use std::time::Duration;

use ipc_types::{Descriptor, MonotonicNs};
use recording::play::Player;
use rustix::process::getpgrp;
use rustix::stdio::stdin;
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcgetpgrp, tcsetattr};

use super::request::ReplayedRequest;
use crate::render::terminal::{Block, Key, Size, read_keys};

/// Shortest time between two drawings of the position.
const REDRAW_PERIOD: Duration = Duration::from_millis(200);

/// Standard output.
pub(super) struct ReplayScreen {
    out: Stdout,
    has_json: bool,
    /// The line with the position; `None` if it is no terminal.
    block: Option<Block>,
    next_drawing: MonotonicNs,
}

impl ReplayScreen {
    pub(super) fn new(has_json: bool) -> ReplayScreen {
        let out = io::stdout();
        let has_block = out.is_terminal() && !has_json;
        ReplayScreen {
            out,
            has_json,
            block: has_block.then(Block::default),
            next_drawing: MonotonicNs(0),
        }
    }

    /// The next drawing is not put off: a key has changed something.
    pub(super) fn change(&mut self) {
        self.next_drawing = MonotonicNs(0);
    }

    /// Prints a request.
    pub(super) fn print(&mut self, request: &ReplayedRequest) -> io::Result<()> {
        self.clear()?;
        let mut out = self.out.lock();
        match self.has_json {
            true => {
                serde_json::to_writer(&mut out, request)?;
                writeln!(out)?;
            }
            false => writeln!(out, "{request}")?,
        }
        self.next_drawing = MonotonicNs(0);
        out.flush()
    }

    /// Shows where the flight is. It wakes nothing: while nothing is played, nothing moves.
    pub(super) fn show(&mut self, player: &Player, now: MonotonicNs) -> io::Result<()> {
        let Some(block) = &mut self.block else {
            return Ok(());
        };
        if now < self.next_drawing {
            return Ok(());
        }
        self.next_drawing = now + REDRAW_PERIOD;
        let size = Size::of(&self.out);
        block.show(&mut self.out.lock(), size, [line(player, now)])
    }

    /// Takes the position away.
    pub(super) fn clear(&mut self) -> io::Result<()> {
        match &mut self.block {
            Some(block) => block.clear(&mut self.out.lock()),
            None => Ok(()),
        }
    }
}

fn line(player: &Player, now: MonotonicNs) -> String {
    let (position, end) = (player.position(now), player.end());
    let state = match player.is_paused() {
        true => "paused",
        false => "playing",
    };
    format!(
        "{state} {:.3} s of {:.3} s   space: pause or go on   . next message   q end",
        position.as_secs_f64(),
        end.as_secs_f64()
    )
}

/// Standard input as keys.
pub(super) struct ReplayKeys {
    before: Termios,
}

impl ReplayKeys {
    /// Takes standard input, if it is a terminal in whose foreground this process is.
    pub(super) fn enter() -> Option<ReplayKeys> {
        if !io::stdin().is_terminal() || tcgetpgrp(stdin()).ok()? != getpgrp() {
            return None;
        }
        let before = tcgetattr(stdin()).ok()?;
        let mut keys = before.clone();
        // Signals such as Ctrl+C stay signals, and what is printed is printed as before.
        keys.local_modes
            .remove(LocalModes::ICANON | LocalModes::ECHO);
        tcsetattr(stdin(), OptionalActions::Now, &keys).ok()?;
        Some(ReplayKeys { before })
    }

    /// What to wait for.
    pub(super) fn source(&self) -> Descriptor<'_> {
        Descriptor::new(stdin())
    }

    /// What the keys that are there ask for; `None` if the terminal is gone. To be called when the wait says so: else it waits
    /// for a key.
    pub(super) fn read(&mut self) -> Option<Vec<PlayerKey>> {
        read_keys().map(player_keys)
    }
}

impl Drop for ReplayKeys {
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

/// What keys ask for, of those that mean something.
fn player_keys(keys: Vec<Key>) -> Vec<PlayerKey> {
    let player_key = |key| match key {
        Key::Char(' ') => Some(PlayerKey::Pause),
        Key::Char('.') | Key::Right => Some(PlayerKey::Step),
        // Ctrl+D ends input. Ctrl+C is a signal.
        Key::Char('q' | 'Q') | Key::Interrupt => Some(PlayerKey::Quit),
        _ => None,
    };
    keys.into_iter().filter_map(player_key).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::terminal::keys;

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
            assert_eq!(player_keys(keys(bytes)), expected, "{bytes:?}");
        }
    }
}
