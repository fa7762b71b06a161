//! Values over time, over what the helicopter did.

use plotters::chart::SeriesLabelPosition;
use plotters::element::{PathElement, Rectangle};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::{Color, ShapeStyle};

use super::axis::Axis;
use super::canvas::{Chart, DrawError, Drawing, Frame, Look, stroke, text_style, units};
use super::colour::{GRID, PAGE, TEXT};
use crate::flight::{Curve, Data, Flight, Ink, Plot, Scale, Span};
use crate::text::short;

/// Most letters of a name.
const MAX_LETTERS: usize = 60;

/// How strong the background of a phase is.
const PHASE: f64 = 0.13;

/// How strong the background of a span without samples is.
const GAP: f64 = 0.30;

/// Most spans that are drawn in one plot; an hour of phases has some dozens.
pub const MAX_SPANS: usize = 1000;

/// Draws `plot` of `flight`.
///
/// # Errors
///
/// None that depends on values.
pub fn draw(flight: &Flight, plot: &Plot, look: Look) -> Result<Drawing, DrawError> {
    let span_s = flight.span_s();
    let y = axis(plot, span_s, look);
    let frame = Frame {
        look,
        height: look.height(),
        x: Axis::time(span_s, look.time_ticks()),
        names: names(plot, look),
        y: y.clone(),
    };
    frame.draw(
        |chart| background(chart, flight, [y.from, y.to]),
        |chart| {
            limits(chart, plot, &y, span_s)?;
            for curve in &plot.curves {
                draw_curve(chart, curve, plot.scale, &y, span_s, look)?;
            }
            if look == Look::Paper {
                legend(chart, look)?;
            }
            Ok(())
        },
    )
}

fn names(plot: &Plot, look: Look) -> [String; 2] {
    match look {
        Look::Paper => [
            "time since the beginning".to_owned(),
            format!(
                "{} ({})",
                short(&plot.title, MAX_LETTERS).to_lowercase(),
                plot.unit
            ),
        ],
        Look::Wide | Look::Narrow => [String::new(), String::new()],
    }
}

/// The axis on which all values of the plot lie.
fn axis(plot: &Plot, span_s: f64, look: Look) -> Axis {
    // What was asked for must not hide what was: its dashes end where the plot ends.
    let is_measured = |curve: &&Curve| !matches!(curve.data, Data::Dashes(_));
    let has_measured = plot
        .curves
        .iter()
        .filter(is_measured)
        .any(|curve| !curve.is_empty());
    let shown = |curve: &&Curve| is_measured(curve) || !has_measured;
    let ranges = || {
        plot.curves
            .iter()
            .filter(shown)
            .filter_map(|curve| curve.range(span_s))
    };
    let least = ranges().map(|(least, _)| least).reduce(f64::min);
    let greatest = ranges().map(|(_, greatest)| greatest).reduce(f64::max);
    let (least, greatest) = (least.unwrap_or(0.0), greatest.unwrap_or(1.0));
    let ticks = if look == Look::Narrow { 4 } else { 5 };
    match plot.scale {
        Scale::Auto { least_span } => {
            let lacking = (least_span - (greatest - least)).max(0.0) / 2.0;
            Axis::values(least - lacking, greatest + lacking, ticks)
        }
        Scale::FromZero { least_top } => Axis::values(0.0, greatest.max(least_top), ticks),
        Scale::Logarithmic { least } => Axis::decades(least, greatest),
    }
}

/// What the helicopter did, and where nothing is known.
fn background(chart: &mut Chart<'_>, flight: &Flight, y: [f64; 2]) -> Result<(), DrawError> {
    let span_s = flight.span_s();
    let band = |from_s: f64, to_s: f64, style: ShapeStyle| {
        let [from_s, to_s] = [from_s, to_s].map(|at_s| at_s.clamp(0.0, span_s));
        Rectangle::new([(from_s, y[0]), (to_s, y[1])], style)
    };
    let phase = |span: &Span| {
        let colour = span.ink.shade().paper.mix(PHASE);
        band(span.from_s, span.to_s, colour.filled())
    };
    let gap =
        |[from_s, to_s]: &[f64; 2]| band(*from_s, *to_s, Ink::Grey.shade().paper.mix(GAP).filled());
    chart.draw_series(flight.phases.iter().take(MAX_SPANS).map(phase))?;
    chart.draw_series(flight.gaps.iter().take(MAX_SPANS).map(gap))?;
    Ok(())
}

/// Limits that lie where values are.
fn limits(chart: &mut Chart<'_>, plot: &Plot, y: &Axis, span_s: f64) -> Result<(), DrawError> {
    let colour = Ink::Red.shade().paper;
    for limit in &plot.limits {
        if (y.from..=y.to).contains(&limit.value) {
            let line = [(0.0, limit.value), (span_s, limit.value)];
            let style = stroke(colour, 1.0);
            chart.draw_series(DashedLineSeries::new(line, units(6), units(4), style))?;
        }
    }
    Ok(())
}

fn draw_curve(
    chart: &mut Chart<'_>,
    curve: &Curve,
    scale: Scale,
    y: &Axis,
    span_s: f64,
    look: Look,
) -> Result<(), DrawError> {
    let colour = curve.ink.shade().paper;
    let height = |value: f64| match scale {
        Scale::Logarithmic { least } => value.max(least).log10(),
        Scale::Auto { .. } | Scale::FromZero { .. } => value,
    };
    let height = |value: f64| height(value).clamp(y.from, y.to);
    let time = |at_s: f64| at_s.clamp(0.0, span_s);
    let style = stroke(colour, 1.5);
    let mut series = Vec::new();
    match &curve.data {
        Data::Line(values) | Data::Dashes(values) => {
            for line in values.lines(span_s, look.columns()) {
                let points = line.into_iter();
                series.push(
                    points
                        .map(|point| (time(point.at_s), height(point.value)))
                        .collect(),
                );
            }
        }
        Data::Bars(counts) => {
            let rates = counts.rates(span_s).filter(|(_, rate)| *rate > 0.0);
            let bar = |([from_s, to_s], rate): ([f64; 2], f64)| {
                Rectangle::new(
                    [(time(from_s), 0.0), (time(to_s), height(rate))],
                    colour.mix(0.75).filled(),
                )
            };
            chart.draw_series(rates.map(bar))?;
        }
    }
    let is_dashed = matches!(curve.data, Data::Dashes(_));
    for points in &series {
        let points: &Vec<(f64, f64)> = points;
        match points[..] {
            // A single value is no line; it is drawn as wide as a line is.
            [(at_s, value)] => {
                let end_s = (at_s + span_s / look.columns() as f64).min(span_s);
                chart.draw_series(LineSeries::new([(at_s, value), (end_s, value)], style))?;
            }
            _ if is_dashed => {
                let dashes = DashedLineSeries::new(points.clone(), units(5), units(4), style);
                chart.draw_series(dashes)?;
            }
            _ => {
                chart.draw_series(LineSeries::new(points.clone(), style))?;
            }
        }
    }
    // A name for the legend, without another line.
    let none: [PathElement<(f64, f64)>; 0] = [];
    let annotation = chart.draw_series(none)?;
    annotation
        .label(short(&curve.name, MAX_LETTERS))
        .legend(move |(x, y)| {
            let end = x + units(18) as i32;
            PathElement::new([(x, y), (end, y)], stroke(colour, 2.0))
        });
    Ok(())
}

fn legend(chart: &mut Chart<'_>, look: Look) -> Result<(), DrawError> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(PAGE.paper.mix(0.85))
        .border_style(stroke(GRID.paper, 0.5))
        .legend_area_size(units(24))
        .margin(units(6))
        .label_font(text_style(look, TEXT.paper))
        .draw()?;
    Ok(())
}
