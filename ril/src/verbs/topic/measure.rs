//! `ril hz`, `ril delay`, `ril bw`: measure samples as they come, show the figures anew each second on a terminal, and
//! give them once at the end.
//!
//! Samples that were published before this command began are not measured: a late joiner gets the latest one at once,
//! whose age says nothing about the way of a sample.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use clap::Args;
use ipc_types::payload::RelayLink;
use ipc_types::{Losses, MonotonicNs};
use operator::options::EXIT_CODES;
use operator::render::json_line;
use operator::render::stamps::StampReader;
use operator::render::terminal::{Block, Size};
use operator::robot::relay_link::LinkWatch;
use operator::session::Topics;
use runtime::exit::Failure;

use super::histogram::Detail;
use super::meter::{Meter, MeterReport, Of, Quantity, Relayed};
use super::stream::{Stream, StreamArgs, Watched, Watcher};

/// `ril hz`, `ril delay`, `ril bw`
///
/// On a terminal the figures are shown anew each second; elsewhere once, at the end.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
#[group(id = "end", multiple = true, args = ["count", "duration"])]
pub struct MeasureArgs {
    /// The samples.
    #[command(flatten)]
    pub stream: StreamArgs,

    /// End after so many samples, of which a rate needs two
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    pub count: Option<u64>,

    /// Show the histograms too, which takes more than 24 lines; JSON always has them
    #[arg(long)]
    pub histogram: bool,

    /// Print one JSON object at the end; needs --count, --duration or both
    #[arg(long, requires = "end")]
    pub json: bool,
}

/// From one drawing to the next: long enough to read.
const REDRAW_PERIOD: Duration = Duration::from_secs(1);

/// How long the end waits for the state of the relay's link, which the relay publishes once a second.
const LINK_TIMEOUT: Duration = Duration::from_secs(2);

/// `ril hz`, `ril delay`, `ril bw`, by what is measured.
///
/// # Errors
///
/// Code 3 when there is no such topic or no process publishes it, 4 when the publisher says nothing. What was measured
/// until then is given all the same.
pub fn measure(quantity: Quantity, args: &MeasureArgs) -> Result<(), Failure> {
    let (watched, stream) = Stream::open(&args.stream, args.count)?;
    // What came while the port was made has waited for it; its age would be that of the port.
    let began = MonotonicNs::now();
    tracing::debug!(service = watched.key, "subscribed");
    let is_live = !args.json && io::stdout().is_terminal();
    let mut display = Display {
        watched: &watched,
        link: LinkWatch::default(),
        link_at_first: None,
        meter: Meter::new(quantity, watched.schema.size()),
        stamps: StampReader::of(&watched.schema),
        began,
        has_come: false,
        is_empty: true,
        detail: match args.histogram {
            true => Detail::Histograms,
            false => Detail::Figures,
        },
        block: Block::default(),
        redraw_at: is_live.then(|| began + REDRAW_PERIOD),
    };
    display.look()?;
    stream.watch(&watched, display, |display, losses| {
        display.finish(losses, args.json)
    })
}

/// The measurement and where it is shown.
struct Display<'a> {
    watched: &'a Watched,
    /// The link to the machine that the samples come from.
    link: LinkWatch,
    /// What it was when the measurement began; `None` before its first sample.
    link_at_first: Option<RelayLink>,
    meter: Meter,
    stamps: StampReader,
    began: MonotonicNs,
    /// Whether a sample has come, measured or not.
    has_come: bool,
    is_empty: bool,
    detail: Detail,
    block: Block,
    /// When to draw next; `None` if there is no terminal.
    redraw_at: Option<MonotonicNs>,
}

impl Watcher for Display<'_> {
    fn sample(&mut self, payload: &[u8]) -> Result<bool, Failure> {
        let now = MonotonicNs::now();
        let stamps = self.stamps.read(payload, now);
        // A struct without times does not say whether the first sample is the latest one of before.
        let is_dated = stamps.received.or(stamps.published).is_some();
        let is_first = !std::mem::replace(&mut self.has_come, true);
        let is_new = stamps.sent >= self.began && (is_dated || !is_first);
        if is_new {
            if self.is_empty {
                tracing::debug!(sequence = stamps.sequence, "first sample");
                self.look()?;
            }
            self.meter.take(&stamps, now);
            self.is_empty = false;
        }
        Ok(is_new)
    }

    fn woken(&mut self, losses: Losses, now: MonotonicNs) -> Result<(), Failure> {
        if self.link.is_missing() {
            self.take_link();
        }
        if !self.is_empty && self.redraw_at.is_some_and(|at| now >= at) {
            self.look()?;
            let text = self.report(losses).text(self.detail);
            self.block
                .show(
                    &mut io::stdout().lock(),
                    Size::of(io::stdout()),
                    text.lines(),
                )
                .map_err(Failure::output)?;
        }
        // Also without anything to show, so that the next wake lies ahead.
        if self.redraw_at.is_some_and(|at| now >= at) {
            self.redraw_at = Some(now + REDRAW_PERIOD);
        }
        Ok(())
    }

    fn wake_at(&self) -> Option<MonotonicNs> {
        self.redraw_at
    }
}

impl Display<'_> {
    /// Looks where the samples come from, and how the link to that machine is.
    fn look(&mut self) -> Result<(), Failure> {
        self.link.look(&self.watched.session, &self.watched.key)?;
        self.take_link();
        Ok(())
    }

    fn take_link(&mut self) {
        self.link.drain();
        self.link_at_first = self.link_at_first.or_else(|| self.link.newest().copied());
    }

    fn report(&self, losses: Losses) -> MeterReport {
        let newest = self.link.newest();
        let of = Of {
            robot: self.watched.session.ipc.robot().get(),
            service: &self.watched.key,
            relayed: self.link.is_relayed().then(|| Relayed {
                uncertainty_s: newest.and_then(RelayLink::clock_uncertainty),
                air: newest
                    .zip(self.link_at_first.as_ref())
                    .and_then(|(link, first)| link.since(first)),
            }),
        };
        self.meter.report(of, losses)
    }

    /// Gives the figures, unless nothing was measured.
    fn finish(mut self, losses: Losses, json: bool) -> Result<(), Failure> {
        if self.is_empty {
            return Ok(());
        }
        self.look()?;
        self.link.wait(&self.watched.session, LINK_TIMEOUT)?;
        let mut out = io::stdout().lock();
        let report = self.report(losses);
        if json {
            return json_line(&mut out, &report);
        }
        self.block.clear(&mut out).map_err(Failure::output)?;
        out.write_all(report.text(self.detail).as_bytes())
            .map_err(Failure::output)
    }
}
