//! What a replay shows and takes: on standard output requests as they pass ([`ReplayedRequest`]), and a line with the
//! position in the flight; of standard input keys, one at a time and without an echo.

use std::fmt;
use std::io::{self, IsTerminal, Stdout, Write};
use std::time::Duration;

use ipc_types::{Descriptor, MonotonicNs};
use operator::render::terminal::{Block, Key, Size, read_keys};
use recording::RequestEvent;
use recording::play::Player;
use rustix::process::getpgrp;
use rustix::stdio::stdin;
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcgetpgrp, tcsetattr};
use serde::Serialize;

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

    /// What the keys that are there ask for; `None` if the terminal is gone. To be called when the wait says so: else
    /// it waits for a key.
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

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.ReplayedRequest.v1";

/// A request that passes in a replay, or a report about one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReplayedRequest {
    schema: &'static str,
    /// Time since the first message of the flight, ms.
    at_ms: u64,
    request_id: u64,
    path_id: u64,
    /// Process that sent it; 0 when that is not known.
    sender_pid: u32,
    /// Station whose order the relay handed on; empty when there is none.
    station: String,
    /// `request`, `report` or `sender-gone`.
    event: String,
    /// `control`, `movement` or `parameter`.
    service: String,
    command: String,
    stage: String,
    reason: String,
    text: String,
}

impl ReplayedRequest {
    /// Reads a message of the type `hero_msgs/msg/RequestEvent`, which passes at `at`; `None` if it is another message.
    pub fn read(message: &[u8], at: Duration) -> Option<ReplayedRequest> {
        let event = RequestEvent::read(message)?;
        // Without what a terminal would obey.
        let plain = |text: &str| text.replace(char::is_control, "?");
        Some(ReplayedRequest {
            schema: SCHEMA,
            at_ms: u64::try_from(at.as_millis()).unwrap_or(u64::MAX),
            request_id: event.request_id,
            path_id: event.path_id,
            sender_pid: event.sender_pid,
            station: plain(event.station),
            event: plain(event.event),
            service: plain(event.service),
            command: plain(event.command),
            stage: plain(event.stage),
            reason: plain(event.reason),
            text: plain(event.text),
        })
    }
}

impl fmt::Display for ReplayedRequest {
    /// One line, without its end: `12.300 s  request 7: takeoff, from process 812`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, ms) = (self.at_ms / 1000, self.at_ms % 1000);
        let (event, id, command) = (&self.event, self.request_id, &self.command);
        if self.text.starts_with(&format!("{command} requested")) {
            return write!(f, "{seconds}.{ms:03} s  {event} {id}: {}", self.text);
        }
        write!(f, "{seconds}.{ms:03} s  {event} {id}: {command}")?;
        let is_success = self.reason.is_empty() || self.reason == "none";
        match (self.stage.is_empty(), is_success) {
            (true, _) => {}
            (false, true) => write!(f, " {}", self.stage)?,
            (false, false) => write!(f, " {} ({})", self.stage, self.reason)?,
        }
        if !self.text.is_empty() && self.text != self.command {
            write!(f, ", {}", self.text)?;
        }
        match (self.station.as_str(), self.sender_pid) {
            ("", 0) => Ok(()),
            ("", pid) => write!(f, ", from process {pid}"),
            (station, _) => write!(f, ", from station {station}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use operator::render::terminal::keys;

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

#[cfg(test)]
mod request_tests {
    use ipc_types::schema::CDR_HEADER;

    use super::*;

    /// A message in the form that `ril record` writes.
    fn message(texts: [&str; 6], sender_pid: u32, station: &str) -> Vec<u8> {
        let [event, service, command, stage, reason, text] = texts;
        let request = RequestEvent {
            at_ns: 1,
            request_id: 7,
            path_id: 0,
            sender_pid,
            event,
            service,
            command,
            stage,
            reason,
            text,
            position: [f64::NAN; 3],
            station,
        };
        request.write()
    }

    #[test]
    fn a_request_is_a_line() {
        #[rustfmt::skip]
        let cases = [
            (["request", "movement", "takeoff", "", "", "takeoff"], 812, "", "12.300 s  request 7: takeoff, from process 812"),
            (["request", "movement", "land", "", "", "land"], 812, "gcs", "12.300 s  request 7: land, from station gcs"),
            (["report", "movement", "goto", "refused", "busy", ""], 0, "", "12.300 s  report 7: goto refused (busy)"),
            (["report", "movement", "goto", "done", "none", "a\x1b[2J"], 0, "", "12.300 s  report 7: goto done, a?[2J"),
        ];
        for (texts, pid, station, line) in cases {
            let bytes = message(texts, pid, station);
            let request = ReplayedRequest::read(&bytes, Duration::from_millis(12_300)).unwrap();
            assert_eq!(request.to_string(), line);
            for len in 0..bytes.len() {
                let _ = ReplayedRequest::read(&bytes[..len], Duration::ZERO);
            }
            assert_eq!(ReplayedRequest::read(&bytes[..40], Duration::ZERO), None);
        }
    }

    #[test]
    fn the_names_of_a_recording_are_those_that_are_played() {
        use recording::play::{REQUEST_EVENT, key_of};
        assert_eq!(recording::REQUEST_EVENT, REQUEST_EVENT);
        let robot = ipc_types::RobotId::DEFAULT;
        for key in [
            "dsp_telemetry",
            "hero_telemetry",
            "module_state",
            "status/state",
        ] {
            let topic = recording::topic_of(robot, key);
            assert_eq!(key_of(&topic), Some((robot, key)));
        }
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_are_read(mut bytes: Vec<u8>) {
            bytes.splice(..0, CDR_HEADER);
            let _ = ReplayedRequest::read(&bytes, Duration::ZERO);
        }
    }
}
