//! `ril hz`, `ril delay`, `ril bw`: measure samples as they come, show the figures anew each second on a terminal, and
//! give them once at the end.
//!
//! Samples that were published before this command began are not measured: a late joiner gets the latest one at once,
//! whose age says nothing about the way of a sample.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use ipc_types::{Losses, MonotonicNs};
use runtime::exit::Failure;

use super::meter::bandwidth::BandwidthMeter;
use super::meter::delay::DelayMeter;
use super::meter::rate::RateMeter;
use super::meter::{Detail, Meter, Of, RelayedTimes, Report};
use super::options::{MeasureArgs, MeasureOptions};
use super::stream::{self, Watched, Watcher};
use super::watch_timeout::{Limits, Next};
use crate::render::json_line;
use crate::render::stamps::StampReader;
use crate::render::terminal::{Block, Size};
use crate::robot::relay_link::LinkWatch;
use crate::session::{Session, configuration};

/// From one drawing to the next: long enough to read.
const REDRAW_PERIOD: Duration = Duration::from_secs(1);

/// How long the end waits for the state of the relay's link, which the relay publishes once a second.
const LINK_TIMEOUT: Duration = Duration::from_secs(2);

/// `ril hz`
///
/// # Errors
///
/// Code 3 when no process publishes, 4 when the publisher says nothing. What was measured until then is given all the same.
pub fn hz(args: &MeasureArgs) -> Result<(), Failure> {
    measure::<RateMeter>(args)
}

/// `ril delay`
///
/// # Errors
///
/// As [`hz`].
pub fn delay(args: &MeasureArgs) -> Result<(), Failure> {
    measure::<DelayMeter>(args)
}

/// `ril bw`
///
/// # Errors
///
/// As [`hz`].
pub fn bw(args: &MeasureArgs) -> Result<(), Failure> {
    measure::<BandwidthMeter>(args)
}

fn measure<M: Meter>(args: &MeasureArgs) -> Result<(), Failure> {
    run::<M>(&args.options, |_| Ok(Watched::own(args.topic)))
}

/// `ril topic hz`, `ril topic delay`, `ril topic bw`, by the meter.
///
/// # Errors
///
/// As [`hz`]; code 3 also for a topic that is not there.
pub fn any<M: Meter>(key: &str, options: &MeasureOptions) -> Result<(), Failure> {
    run::<M>(options, |session| Watched::find(session, key))
}

fn run<M: Meter>(
    options: &MeasureOptions,
    find: impl FnOnce(&Session) -> Result<Watched, Failure>,
) -> Result<(), Failure> {
    let Some(config) = configuration(&options.common)? else {
        return Ok(());
    };
    let session = &Session::join(&options.common)?;
    let watched = &find(session)?;
    let mut samples = watched.open(session)?;
    let limits = Limits {
        count: options.count,
        duration: options.duration,
        timeout: options.timeout.unwrap_or_else(|| config.observe.timeout()),
    };
    // What came while the port was made has waited for it; its age would be that of the port.
    let began = MonotonicNs::now();
    tracing::debug!(service = watched.key, "subscribed");
    let mut source = SourceWatch {
        session,
        key: &watched.key,
        link: LinkWatch::default(),
    };
    source.look::<M>()?;
    let is_live = !options.json && io::stdout().is_terminal();
    let mut display = Display {
        meter: M::begin(watched.schema.size()),
        stamps: StampReader::of(&watched.schema),
        source,
        began,
        has_come: false,
        is_empty: true,
        detail: match options.histogram {
            true => Detail::Histograms,
            false => Detail::Figures,
        },
        block: Block::default(),
        redraw_at: is_live.then(|| began + REDRAW_PERIOD),
    };
    let end = stream::watch(session, watched, &mut samples, limits, &mut display)?;
    display.finish(samples.losses(), options.json)?;
    match end {
        Next::Nothing => Err(watched.nothing_came(session, limits.timeout)?),
        _ => Ok(()),
    }
}

/// Whose samples are measured, and whether they come from another machine.
struct SourceWatch<'a> {
    session: &'a Session,
    key: &'a str,
    link: LinkWatch,
}

impl SourceWatch<'_> {
    /// Looks where the samples come from, if the measurement `M` shows their ages, and how the link to that machine is.
    fn look<M: Meter>(&mut self) -> Result<(), Failure> {
        if M::SHOWS_AGES {
            self.link.look(self.session, self.key)?;
            self.link.drain();
        }
        Ok(())
    }

    /// Waits for the state of the link, if there is one.
    fn wait(&mut self) -> Result<(), Failure> {
        self.link.wait(self.session, LINK_TIMEOUT)
    }

    fn of(&self) -> Of<'_> {
        let link = self.link.newest();
        Of {
            robot: self.session.ipc.robot().get(),
            service: self.key,
            relayed: self.link.is_relayed().then(|| RelayedTimes {
                uncertainty_s: link.and_then(|link| link.clock_uncertainty()),
            }),
        }
    }
}

/// The measurement and where it is shown.
struct Display<'a, M> {
    meter: M,
    stamps: StampReader,
    source: SourceWatch<'a>,
    began: MonotonicNs,
    /// Whether a sample has come, measured or not.
    has_come: bool,
    is_empty: bool,
    detail: Detail,
    block: Block,
    /// When to draw next; `None` if there is no terminal.
    redraw_at: Option<MonotonicNs>,
}

impl<M: Meter> Watcher for Display<'_, M> {
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
                self.source.look::<M>()?;
            }
            self.meter.take(&stamps, now);
            self.is_empty = false;
        }
        Ok(is_new)
    }

    fn woken(&mut self, losses: Losses, now: MonotonicNs) -> Result<(), Failure> {
        if !self.is_empty && self.redraw_at.is_some_and(|at| now >= at) {
            self.source.look::<M>()?;
            let report = self.meter.report(self.source.of(), losses);
            let text = report.text(self.detail).to_string();
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

impl<M: Meter> Display<'_, M> {
    /// Gives the figures, unless nothing was measured.
    fn finish(mut self, losses: Losses, json: bool) -> Result<(), Failure> {
        if self.is_empty {
            return Ok(());
        }
        self.source.look::<M>()?;
        self.source.wait()?;
        let mut out = io::stdout().lock();
        let report = self.meter.report(self.source.of(), losses);
        if json {
            return json_line(&mut out, &report);
        }
        self.block.clear(&mut out).map_err(Failure::output)?;
        write!(out, "{}", report.text(self.detail)).map_err(Failure::output)
    }
}
