//! What the demonstration shows while it runs: a live block on a terminal, plain lines elsewhere, nothing for JSON.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use ipc_types::MonotonicNs;
use operator::render::terminal::{Block, Size};
use runtime::exit::Failure;

use super::seen::Seen;

/// Shortest time between two drawings: what the eye can follow.
const REDRAW_PERIOD: Duration = Duration::from_millis(100);

/// Where and how to show.
#[derive(Debug)]
pub(super) struct Screen {
    kind: ScreenKind,
    drawn: Option<Instant>,
    live: Block,
    /// The operator's command that is under way.
    pub order: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ScreenKind {
    Live,
    Plain,
    Silent,
}

impl Screen {
    /// A screen on standard output; a silent one when the output is to be one JSON document.
    pub fn new(json: bool) -> Screen {
        let kind = match (json, io::stdout().is_terminal()) {
            (true, _) => ScreenKind::Silent,
            (false, true) => ScreenKind::Live,
            (false, false) => ScreenKind::Plain,
        };
        Screen {
            kind,
            drawn: None,
            live: Block::default(),
            order: None,
        }
    }

    /// One line that stays.
    pub fn line(&mut self, line: &str) -> Result<(), Failure> {
        if self.kind == ScreenKind::Silent {
            return Ok(());
        }
        let mut out = io::stdout().lock();
        let shown = self.live.clear(&mut out);
        shown
            .and_then(|()| writeln!(out, "{line}"))
            .map_err(Failure::output)
    }

    /// Draws the live block, not more often than the eye can follow.
    pub fn draw(&mut self, seen: &Seen) -> Result<(), Failure> {
        let is_recent = self
            .drawn
            .is_some_and(|drawn| drawn.elapsed() < REDRAW_PERIOD);
        if self.kind != ScreenKind::Live || is_recent {
            return Ok(());
        }
        let phase = self.order.as_deref().unwrap_or("starting");
        let block = block(phase, seen, MonotonicNs::now());
        self.drawn = Some(Instant::now());
        self.live
            .show(&mut io::stdout().lock(), Size::of(io::stdout()), &block)
            .map_err(Failure::output)
    }

    /// Takes the live block away.
    pub fn end(&mut self) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        let cleared = self.live.clear(&mut out);
        cleared.and_then(|()| out.flush()).map_err(Failure::output)
    }
}

fn block(phase: &str, seen: &Seen, now: MonotonicNs) -> Vec<String> {
    let mut lines = vec![format!("  phase     {phase}")];
    if let Some(hero) = &seen.hero {
        let g = &hero.geodetic;
        lines.push(format!(
            "  position  {:.7}° {:.7}°, {:.2} m, {:.1} m/s over ground",
            g.latitude_rad.to_degrees(),
            g.longitude_rad.to_degrees(),
            g.altitude_m,
            hero.velocity.ground_speed_mps,
        ));
    }
    if let Some(state) = &seen.state {
        let movement = &state.movement;
        let to_go = match movement.distance_to_go() {
            Some(distance_m) => format!(
                "{distance_m:.1} m to go, waypoint {} of {}",
                movement.waypoints_reached, movement.waypoints_total
            ),
            None => "-".to_owned(),
        };
        let link = state.link.state().map_or("?", |link| link.name());
        let age = state.link.last_message().map_or_else(
            || "never".to_owned(),
            |last| format!("{} ms ago", now.since(last).as_millis()),
        );
        lines.push(format!("  path      {to_go}"));
        lines.push(format!(
            "  link      {link}, last message {age}, {} received",
            state.link.messages_received
        ));
    }
    let (dsp, hero) = (seen.counts.dsp, seen.counts.hero);
    lines.push(format!(
        "  samples   {} raw, {} robot, {} lost",
        dsp.received,
        hero.received,
        dsp.lost + hero.lost
    ));
    lines
}
