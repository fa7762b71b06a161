//! `ril hz`, `ril delay`, `ril bw`: measure samples as they come, show the figures anew each second on a terminal, and
//! give them once at the end.
//!
//! Samples that were published before this command began are not measured: a late joiner gets the latest one at once,
//! whose age says nothing about the way of a sample.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Losses, MonotonicNs};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::patience::{Limits, Next};
use super::stream::{self, Watcher};
use super::{Session, configuration, json_line};
use crate::cli::{MeasureArgs, Topic};
use crate::live::{Block, Size};
use crate::measure::bandwidth::BandwidthMeter;
use crate::measure::delay::DelayMeter;
use crate::measure::rate::RateMeter;
use crate::measure::{Measured, Meter, Of};

/// From one drawing to the next: long enough to read.
const REDRAW_PERIOD: Duration = Duration::from_secs(1);

/// `ril hz`
///
/// # Errors
///
/// Code 3 when nobody publishes, 4 when the publisher says nothing. What was measured until then is given all the same.
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
    match args.topic {
        Topic::Dsp => run::<DspTelemetry, M>(args),
        Topic::Hero => run::<HeroTelemetry, M>(args),
        Topic::State => run::<ModuleState, M>(args),
    }
}

fn run<T: Measured, M: Meter>(args: &MeasureArgs) -> Result<(), Failure> {
    let Some(config) = configuration(&args.common)? else {
        return Ok(());
    };
    let limits = Limits {
        count: args.count,
        duration: args.duration,
        timeout: args.timeout.unwrap_or_else(|| config.observe.timeout()),
    };
    let session = Session::join(&args.common)?;
    let mut samples = session.ipc.subscriber::<T>().or_fail(ExitCode::Internal)?;
    // What came while the port was made has waited for it; its age would be that of the port.
    let began = MonotonicNs::now();
    tracing::debug!(service = T::SERVICE.spec().key, "subscribed");
    let of = Of {
        robot: session.ipc.robot().get(),
        service: T::SERVICE.spec().key,
    };
    let is_live = !args.json && io::stdout().is_terminal();
    let mut desk = Desk {
        meter: M::begin(size_of::<T>()),
        of,
        began,
        is_empty: true,
        block: Block::default(),
        redraw_at: is_live.then(|| began + REDRAW_PERIOD),
    };
    let end = stream::watch(&session, &mut samples, limits, &mut desk)?;
    desk.finish(samples.losses(), args.json)?;
    match end {
        Next::Nothing => Err(session.nothing_came(T::SERVICE, limits.timeout)?),
        _ => Ok(()),
    }
}

/// The measurement and where it is shown.
struct Desk<M> {
    meter: M,
    of: Of,
    began: MonotonicNs,
    is_empty: bool,
    block: Block,
    /// When to draw next; nothing when there is no terminal.
    redraw_at: Option<MonotonicNs>,
}

impl<T: Measured, M: Meter> Watcher<T> for Desk<M> {
    fn sample(&mut self, sample: &T) -> Result<bool, Failure> {
        let now = MonotonicNs::now();
        let stamps = sample.stamps();
        let is_new = stamps.sent >= self.began;
        if is_new {
            if self.is_empty {
                tracing::debug!(sequence = stamps.sequence, "first sample");
            }
            self.meter.take(&stamps, now);
            self.is_empty = false;
        }
        Ok(is_new)
    }

    fn woken(&mut self, losses: Losses, now: MonotonicNs) -> Result<(), Failure> {
        if !self.is_empty && self.redraw_at.is_some_and(|at| now >= at) {
            let text = self.meter.report(self.of, losses).to_string();
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

impl<M: Meter> Desk<M> {
    /// Gives the figures, unless nothing was measured.
    fn finish(mut self, losses: Losses, json: bool) -> Result<(), Failure> {
        if self.is_empty {
            return Ok(());
        }
        let mut out = io::stdout().lock();
        let report = self.meter.report(self.of, losses);
        if json {
            return json_line(&mut out, &report);
        }
        self.block.clear(&mut out).map_err(Failure::output)?;
        write!(out, "{report}").map_err(Failure::output)
    }
}
