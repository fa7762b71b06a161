//! What the helicopter did, was asked for and how it was connected, over time: a lane each, one above the other.

use plotters::element::{Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::canvas::{Chart, DrawError, Drawing, Frame, Look, sized_text_style, stroke, text_width};
use super::colour::TEXT;
use super::time::MAX_SPANS;
use crate::flight::{Flight, Ink, Lane, Outcome, Request, Span};
use crate::text::short;

/// Height of a lane, pixels.
const LANE: u32 = 30;

/// What lies below the lanes, pixels.
const FOOT: u32 = 36;

/// Most letters of a name.
const MAX_LETTERS: usize = 40;

/// How strong the colour of a span is.
const STRENGTH: f64 = 0.35;

/// Most lanes of requests: more at the same time are drawn over each other in the last one.
const MAX_REQUEST_LANES: usize = 3;

/// The lanes of a flight from top to bottom; none when nothing is known.
pub fn lanes(flight: &Flight) -> Vec<Lane> {
    let mut lanes = Vec::new();
    if !flight.phases.is_empty() {
        lanes.push(Lane {
            name: "phase".to_owned(),
            spans: flight.phases.clone(),
        });
    }
    lanes.extend(requests(flight));
    let known = flight.lanes.iter().filter(|lane| !lane.spans.is_empty());
    lanes.extend(known.cloned());
    lanes
}

/// Requests in as few lanes as they fit into without lying over each other.
fn requests(flight: &Flight) -> Vec<Lane> {
    let mut lanes: Vec<Lane> = Vec::new();
    for request in &flight.requests {
        let span = span(request, flight.duration_s);
        let is_free = |lane: &&mut Lane| {
            lane.spans
                .last()
                .is_none_or(|last| last.to_s <= span.from_s)
        };
        let count = lanes.len();
        if let Some(lane) = lanes.iter_mut().find(is_free) {
            lane.spans.push(span);
        } else if count < MAX_REQUEST_LANES {
            let name = if count == 0 { "requests" } else { "" };
            lanes.push(Lane {
                name: name.to_owned(),
                spans: vec![span],
            });
        } else if let Some(lane) = lanes.last_mut() {
            lane.spans.push(span);
        }
    }
    lanes
}

fn span(request: &Request, duration_s: f64) -> Span {
    Span {
        from_s: request.from_s,
        to_s: request.to_s.unwrap_or(duration_s),
        name: request.name.clone(),
        ink: match request.outcome {
            Outcome::Done => Ink::Purple,
            Outcome::Refused | Outcome::Aborted => Ink::Red,
            Outcome::Open => Ink::Grey,
        },
    }
}

/// Draws the lanes.
///
/// # Errors
///
/// None that depends on values.
pub fn draw(flight: &Flight, look: Look) -> Result<Drawing, DrawError> {
    let lanes = lanes(flight);
    let span_s = flight.span_s();
    let count = lanes.len();
    // The first lane is the uppermost.
    let middle = |index: usize| (count - index) as f64 - 0.5;
    let frame = Frame {
        look,
        height: count as u32 * LANE + FOOT,
        x: Axis::time(span_s, look.time_ticks()),
        y: Axis {
            from: 0.0,
            to: count.max(1) as f64,
            ticks: (0..count).rev().map(middle).collect(),
            labels: lanes
                .iter()
                .rev()
                .map(|lane| short(&lane.name, MAX_LETTERS))
                .collect(),
        },
        names: [String::new(), String::new()],
    };
    frame.draw(
        |_| Ok(()),
        |chart| {
            for (index, lane) in lanes.iter().enumerate() {
                for span in lane.spans.iter().take(MAX_SPANS) {
                    bar(chart, span, middle(index), span_s, look)?;
                }
            }
            Ok(())
        },
    )
}

/// A span with its name, if there is room for it.
fn bar(
    chart: &mut Chart<'_>,
    span: &Span,
    middle: f64,
    span_s: f64,
    look: Look,
) -> Result<(), DrawError> {
    const HALF: f64 = 0.40;
    let [from_s, to_s] = [span.from_s, span.to_s].map(|at_s| at_s.clamp(0.0, span_s));
    // What lasts shorter than a pixel is seen as well.
    let least_s = span_s / f64::from(look.width());
    let to_s = to_s.max(from_s + least_s);
    let colour = span.ink.shade().paper;
    let corners = [(from_s, middle - HALF), (to_s, middle + HALF)];
    chart.draw_series([
        Rectangle::new(corners, colour.mix(STRENGTH).filled()),
        Rectangle::new(corners, stroke(colour, 0.5)),
    ])?;
    let letters = look.letters() - 1;
    let room = (to_s - from_s) / span_s * f64::from(look.width()) * 0.9 - 6.0;
    let name = short(&span.name, MAX_LETTERS);
    if text_width(letters, &name) <= room {
        let style = sized_text_style(letters, TEXT.paper).pos(Pos::new(HPos::Center, VPos::Center));
        let place = ((from_s + to_s) / 2.0, middle);
        chart.draw_series([Text::new(name, place, style)])?;
    }
    Ok(())
}
