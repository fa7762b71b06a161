//! [`Screen`]: standard output: requests as they pass, and on a terminal a line with the position in the flight.

use std::io::{self, IsTerminal, Stdout, Write};
use std::time::Duration;

use ipc_types::MonotonicNs;
use recording::play::Player;

use super::request::ReplayedRequest;
use crate::live::{Block, Size};

/// Shortest time between two drawings of the position.
const REDRAW_PERIOD: Duration = Duration::from_millis(200);

/// Standard output.
pub(super) struct Screen {
    out: Stdout,
    has_json: bool,
    /// The line with the position; `None` if it is no terminal.
    block: Option<Block>,
    next_drawing: MonotonicNs,
}

impl Screen {
    pub(super) fn new(has_json: bool) -> Screen {
        let out = io::stdout();
        let has_block = out.is_terminal() && !has_json;
        Screen {
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
