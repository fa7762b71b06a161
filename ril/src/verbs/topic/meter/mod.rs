//! What `ril hz`, `ril delay` and `ril bw` measure, as pure values: they are given samples with the moment at which each
//! came, and say what that makes.
//!
//! Nothing here reads a clock or a port. Losses are not guessed from times: they are those that the subscriber counted by
//! sequence numbers.
//!
//! * [`rate`]: how often samples come, and how often they are published;
//! * [`delay`]: how old they are when they come;
//! * [`bandwidth`]: how many bytes that makes;
//! * [`histogram`]: percentiles and histogram of a quantity.

pub mod bandwidth;
pub mod delay;
pub mod histogram;
pub mod rate;

use std::fmt;

use ipc_types::{Losses, MonotonicNs};
use serde::Serialize;

use crate::render::stamps::Stamps;
use crate::render::words::count;

/// How much of a report is shown to people. Programs get everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// The figures, which fit a terminal of 80 columns and 24 rows.
    Figures,
    /// The histograms as well.
    Histograms,
}

/// What a measurement says to people.
pub trait Report: Serialize {
    /// Writes it as lines of at most 80 characters.
    ///
    /// # Errors
    ///
    /// Those of `f`.
    fn write(&self, detail: Detail, f: &mut fmt::Formatter<'_>) -> fmt::Result;

    /// It as something to be printed.
    fn text(&self, detail: Detail) -> Text<'_, Self>
    where
        Self: Sized,
    {
        Text(self, detail)
    }
}

/// A report as it is shown to people.
#[derive(Clone, Copy, Debug)]
pub struct Text<'a, R>(&'a R, Detail);

impl<R: Report> fmt::Display for Text<'_, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.write(self.1, f)
    }
}

/// A measurement: samples go in, a report comes out at any time.
pub trait Meter {
    /// What comes out: as text for people, as JSON for programs.
    type Report: Report;

    /// Whether it compares times of samples with the clock of this machine.
    const SHOWS_AGES: bool = false;

    /// Begins to measure samples of so many bytes.
    fn begin(payload_bytes: usize) -> Self;

    /// Takes a sample that came at `now`.
    fn take(&mut self, stamps: &Stamps, now: MonotonicNs);

    /// What was measured so far.
    fn report(&self, of: Of, losses: Losses) -> Self::Report;
}

/// Whose samples are measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Of<'a> {
    /// Robot id.
    pub robot: u32,
    /// Key of the service, such as `hero_telemetry`.
    pub service: &'a str,
    /// How true times of another machine are; `None` if the samples are of this machine.
    pub relayed: Option<RelayedTimes>,
}

/// How true the times in samples are that come from another machine: the relay translated them to this machine's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelayedTimes {
    /// How far they may be from the truth, to either side, s; `None` if the relay does not know it.
    pub uncertainty_s: Option<f64>,
}

/// What every report begins with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counts {
    /// Name of the JSON object's layout.
    pub schema: &'static str,
    /// Robot id.
    pub robot: u32,
    /// Key of the service.
    pub service: String,
    /// Samples that were measured.
    pub samples: u64,
    /// From the first to the last of them, s.
    pub seconds: f64,
    /// Samples that were published and never came, by their sequence numbers.
    pub lost: u64,
    /// The same in percent of those that should have come.
    pub lost_percent: f64,
    /// Samples that came twice; the second was dropped.
    pub repeated: u64,
    /// How often another publisher took over.
    pub publisher_restarts: u64,
}

impl Counts {
    fn new(schema: &'static str, of: Of, samples: u64, seconds: f64, losses: Losses) -> Counts {
        let due = losses.received.saturating_add(losses.lost);
        Counts {
            schema,
            robot: of.robot,
            service: of.service.to_owned(),
            samples,
            seconds: rounded(seconds, 6),
            lost: losses.lost,
            lost_percent: rounded(100.0 * losses.lost as f64 / due.max(1) as f64, 4),
            repeated: losses.repeated,
            publisher_restarts: losses.publisher_restarts,
        }
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} of robot {}: {} in {:.3} s",
            self.service,
            self.robot,
            count(self.samples, "sample"),
            self.seconds
        )?;
        writeln!(
            f,
            "{} lost ({:.2} %), {}",
            self.lost,
            self.lost_percent,
            count(self.publisher_restarts, "publisher restart")
        )
    }
}

/// A number with so many decimals: more would be noise.
fn rounded(number: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (number * scale).round() / scale
}
