//! [`FlightReport`]: everything that a report shows, as a plain value. Times are seconds since the beginning of the
//! recording.

use serde::Serialize;

use super::envelope::{Bins, Envelope};
use crate::page::{ChartArea, Weight};

/// A recorded flight. What the recording does not have is empty, and the report says so.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FlightReport {
    /// Heading of the report.
    pub title: String,
    /// What stands below the heading: when, which file.
    pub lead: Vec<String>,
    /// The flight in sentences.
    pub summary: Vec<String>,
    /// The flight in numbers: a name and a value each.
    pub facts: Vec<(String, String)>,
    /// From the beginning of the recording to its end, s.
    pub duration_s: f64,
    /// Time of the beginning by the wall clock, ns since 1970, UTC, if it is known.
    pub start_unix_ns: Option<u64>,
    /// What the helicopter did, one after the other: the background of the plots.
    pub phases: Vec<Span>,
    /// Further states over time, such as that of the link.
    pub lanes: Vec<Lane>,
    /// What the helicopter was asked for.
    pub requests: Vec<RequestRow>,
    /// What happened, in the order of time.
    pub events: Vec<Event>,
    /// Events that were left out, because there were too many of their kind.
    pub events_left_out: u64,
    /// Spans without a sample, from and to, s.
    pub gaps: Vec<[f64; 2]>,
    /// Values over time.
    #[serde(skip)]
    pub plots: Vec<Plot>,
    /// The flight seen from above.
    pub map: Map,
    /// What the recording says of itself.
    pub metadata: Vec<Table>,
    /// What is missing or damaged, in sentences.
    pub remarks: Vec<String>,
}

impl FlightReport {
    /// A flight of this length, s, of which nothing else is known.
    pub fn new(title: impl Into<String>, duration_s: f64) -> FlightReport {
        FlightReport {
            title: title.into(),
            duration_s,
            ..FlightReport::default()
        }
    }

    /// What the plots span, s: at least a second, so that there is an axis.
    pub(crate) fn span_s(&self) -> f64 {
        /// Thirty years: what lasts longer is a damaged number.
        const LONGEST_S: f64 = 1e9;
        if self.duration_s.is_finite() {
            self.duration_s.clamp(1.0, LONGEST_S)
        } else {
            1.0
        }
    }
}

/// A colour by its role; the page has each in a light and a dark shade.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ink {
    /// The first value of a plot.
    Blue,
    /// The second one.
    Orange,
    /// What is in order.
    Green,
    /// What was planned or asked for.
    Purple,
    /// What changes.
    Yellow,
    /// What is wrong.
    Red,
    /// What is of no interest.
    Grey,
}

/// A state that lasts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Span {
    /// Its beginning, s.
    pub from_s: f64,
    /// Its end, s.
    pub to_s: f64,
    /// Its name, such as `landing`.
    pub name: String,
    /// Its colour; the same name has the same colour.
    pub ink: Ink,
}

/// A state over time, with a name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lane {
    /// What it is the state of, such as `link`.
    pub name: String,
    /// One after the other.
    pub spans: Vec<Span>,
}

/// How a request ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The request was carried out.
    Done,
    /// The request was not taken.
    Refused,
    /// The request was taken, and ended early.
    Aborted,
    /// Unknown: the recording does not have it.
    Open,
}

/// What the helicopter was asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RequestRow {
    /// When it came, s.
    pub from_s: f64,
    /// When it ended, s; `None` if the recording does not have it.
    pub to_s: Option<f64>,
    /// What was asked for, such as `goto, 4 waypoints`.
    pub name: String,
    /// The process that asked, if it is known.
    pub sender: String,
    /// How it ended.
    pub outcome: Outcome,
    /// Why; may be empty.
    pub reason: String,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// When, s.
    pub at_s: f64,
    /// How much it matters.
    pub weight: Weight,
    /// What.
    pub text: String,
    /// Where, degrees north and east; `None` if it is not known.
    pub place: Option<[f64; 2]>,
}

/// How the values of a plot become heights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Scale {
    /// From the least value to the greatest.
    Auto {
        /// Least range that is shown, so that noise does not look like a climb.
        least_span: f64,
    },
    /// From zero.
    FromZero {
        /// Least end of the axis.
        least_top: f64,
    },
    /// Each decade as high as the next. Values below `least` are shown as `least`.
    Logarithmic {
        /// Beginning of the axis, greater than 0.
        least: f64,
    },
}

/// Values of one unit over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Name of its file and its anchor: letters and `-`.
    pub id: &'static str,
    /// Its title.
    pub title: String,
    /// The unit, such as `m/s`.
    pub unit: &'static str,
    /// How its values become heights.
    pub scale: Scale,
    /// What a reader must know of it; may be empty.
    pub about: String,
    /// The values.
    pub curves: Vec<Curve>,
    /// Lines across the plot, such as the ceiling of the fence. They are drawn where they lie in the range of the
    /// values.
    pub limits: Vec<Limit>,
}

impl Plot {
    /// A plot without curves.
    pub fn new(
        id: &'static str,
        title: impl Into<String>,
        unit: &'static str,
        scale: Scale,
    ) -> Plot {
        Plot {
            id,
            title: title.into(),
            unit,
            scale,
            about: String::new(),
            curves: Vec::new(),
            limits: Vec::new(),
        }
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.curves.iter().all(Curve::is_empty)
    }
}

/// A curve of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// Its colour.
    pub ink: Ink,
    /// Its values.
    pub data: Data,
}

/// The values of a curve.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// Joined by a line.
    Line(Envelope),
    /// Joined by a line of dashes: what was asked for, beside what is.
    Dashes(Envelope),
    /// Bars, 1/s.
    Bars(Bins),
}

impl Curve {
    /// A line.
    pub fn line(name: impl Into<String>, ink: Ink, values: Envelope) -> Curve {
        Curve {
            name: name.into(),
            ink,
            data: Data::Line(values),
        }
    }

    /// Dashes.
    pub fn dashes(name: impl Into<String>, ink: Ink, values: Envelope) -> Curve {
        Curve {
            name: name.into(),
            ink,
            data: Data::Dashes(values),
        }
    }

    /// Bars.
    pub fn bars(name: impl Into<String>, ink: Ink, counts: Bins) -> Curve {
        Curve {
            name: name.into(),
            ink,
            data: Data::Bars(counts),
        }
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        match &self.data {
            Data::Line(values) | Data::Dashes(values) => values.is_empty(),
            Data::Bars(counts) => counts.total() == 0.0,
        }
    }
}

/// A line across a plot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// Its name.
    pub name: String,
    /// Where it lies, in the unit of the plot.
    pub value: f64,
}

/// The flight seen from above. Places are degrees north and east.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Map {
    /// Where the helicopter was, in order.
    pub track: Vec<[f64; 2]>,
    /// When it was there, s; beside each place of `track`.
    pub track_s: Vec<f64>,
    /// Waypoints of a plan, in order.
    pub plan: Vec<[f64; 2]>,
    /// The fence.
    pub fence: Vec<ChartArea>,
}

/// A table of names and values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// What it is about.
    pub title: String,
    /// A name and a value each.
    pub rows: Vec<(String, String)>,
}
