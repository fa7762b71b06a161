//! What the demonstration shows while it runs: a live block on a terminal, plain lines elsewhere, nothing for JSON.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use ipc_types::MonotonicNs;

use super::mission::{Mission, Outcome};
use super::watch::{Counts, Watch};
use crate::live::{Block, Size};

/// Shortest time between two drawings: what the eye can follow.
const REDRAW_PERIOD: Duration = Duration::from_millis(100);

/// Where and how to show.
#[derive(Debug)]
pub struct Screen {
    kind: Kind,
    drawn: Option<Instant>,
    live: Block,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Live,
    Plain,
    Silent,
}

impl Screen {
    /// A screen on standard output; a silent one when the output is to be one JSON document.
    pub fn new(json: bool) -> Screen {
        let kind = match (json, io::stdout().is_terminal()) {
            (true, _) => Kind::Silent,
            (false, true) => Kind::Live,
            (false, false) => Kind::Plain,
        };
        Screen {
            kind,
            drawn: None,
            live: Block::default(),
        }
    }

    /// One line that stays.
    pub fn say(&mut self, line: &str) -> io::Result<()> {
        if self.kind == Kind::Silent {
            return Ok(());
        }
        self.live.clear(&mut io::stdout())?;
        writeln!(io::stdout(), "{line}")
    }

    /// An order has ended.
    pub fn outcome(&mut self, outcome: &Outcome, since: Duration) -> io::Result<()> {
        let name = outcome.order.name();
        self.say(&format!(
            "{:6.2} s  {name}: {}",
            since.as_secs_f64(),
            outcome.stage
        ))
    }

    /// Draws the live block, not more often than the eye can follow.
    pub fn draw(
        &mut self,
        mission: Option<&Mission>,
        watch: &Watch,
        counts: &Counts,
    ) -> io::Result<()> {
        let recent = self
            .drawn
            .is_some_and(|drawn| drawn.elapsed() < REDRAW_PERIOD);
        if self.kind != Kind::Live || recent {
            return Ok(());
        }
        let block = block(mission, watch, counts, MonotonicNs::now());
        self.live
            .show(&mut io::stdout().lock(), Size::of(io::stdout()), &block)?;
        self.drawn = Some(Instant::now());
        Ok(())
    }

    /// Takes the live block away.
    pub fn end(&mut self) -> io::Result<()> {
        self.live.clear(&mut io::stdout())?;
        io::stdout().flush()
    }
}

fn block(
    mission: Option<&Mission>,
    watch: &Watch,
    counts: &Counts,
    now: MonotonicNs,
) -> Vec<String> {
    let phase = mission
        .and_then(Mission::current)
        .map_or_else(|| "starting".to_owned(), |order| order.name());
    let mut lines = vec![format!("  phase     {phase}")];
    if let Some(hero) = watch.last_hero() {
        let g = &hero.geodetic;
        lines.push(format!(
            "  position  {:.7}° {:.7}°, {:.2} m, {:.1} m/s over ground",
            g.latitude_rad.to_degrees(),
            g.longitude_rad.to_degrees(),
            g.altitude_m,
            hero.velocity.ground_speed_mps,
        ));
    }
    if let Some(state) = watch.last_state() {
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
    lines.push(format!(
        "  samples   {} raw, {} robot, {} lost",
        counts.dsp.received,
        counts.hero.received,
        counts.dsp.lost + counts.hero.lost
    ));
    lines
}
