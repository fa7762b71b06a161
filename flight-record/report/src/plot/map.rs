//! The flight from above: track, plan and fence, north up, metres alike in both directions.

use plotters::element::{Circle, EmptyElement, PathElement, Polygon, Text};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::axis::Axis;
use super::canvas::{Chart, DrawError, Drawing, Frame, Look, sized_text_style, stroke, units};
use super::colour::{PAGE, TEXT};
use crate::flight::{Area, Flight, Ink, Map, Place, Weight};

/// Least width and height of what is shown, m: a helicopter that hovers is not drawn larger than the error of its GPS.
const LEAST_SPAN_M: f64 = 20.0;

/// A place farther than this from the zero is a damaged number, m.
const FARTHEST_M: f64 = 1e7;

/// How much wider than its content the map is.
const MARGIN: f64 = 1.12;

/// Most waypoints that have a number.
const MAX_NUMBERED: usize = 99;

/// What stands around the area of the map, pixels: it makes the metres of both axes alike.
const FRAME: [u32; 2] = [100, 50];

/// Draws the map; `None` if there is nothing to show.
///
/// # Errors
///
/// None that depends on values.
pub fn draw(flight: &Flight, look: Look) -> Result<Option<Drawing>, DrawError> {
    let map = &possible(&flight.map);
    let fence = map.fence.iter().flat_map(|area| &area.corners);
    let shown: Vec<Place> = map
        .track
        .iter()
        .chain(&map.plan)
        .chain(fence)
        .copied()
        .collect();
    if shown.is_empty() {
        return Ok(None);
    }
    let (height, x, y) = extent(&shown, look);
    let frame = Frame {
        look,
        height,
        x,
        y,
        names: ["east (m)".to_owned(), "north (m)".to_owned()],
    };
    let drawing = frame.draw(
        |chart| map.fence.iter().try_for_each(|area| area_of(chart, area)),
        |chart| {
            plan(chart, map, look)?;
            track(chart, map, look)?;
            events(chart, flight, map, look)
        },
    )?;
    Ok(Some(drawing))
}

/// The map without places that no helicopter reaches.
fn possible(map: &Map) -> Map {
    let is_near =
        |place: &Place| place.east_m.abs() < FARTHEST_M && place.north_m.abs() < FARTHEST_M;
    let near = |places: &[Place]| places.iter().copied().filter(is_near).collect();
    let area = |area: &Area| Area {
        is_inclusion: area.is_inclusion,
        corners: near(&area.corners),
    };
    Map {
        track: near(&map.track),
        plan: near(&map.plan),
        fence: map.fence.iter().map(area).collect(),
        events: map
            .events
            .iter()
            .copied()
            .filter(|(_, place)| is_near(place))
            .collect(),
        zero_deg: map.zero_deg,
    }
}

/// Height of the map and its axes, so that all places are shown and a metre is as long in both directions.
fn extent(places: &[Place], look: Look) -> (u32, Axis, Axis) {
    let range = |value: fn(&Place) -> f64| {
        let least = places.iter().map(value).fold(f64::INFINITY, f64::min);
        let greatest = places.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
        let half = (greatest - least).max(LEAST_SPAN_M) * MARGIN / 2.0;
        ((least + greatest) / 2.0, half)
    };
    let (east_m, half_east_m) = range(|place| place.east_m);
    let (north_m, half_north_m) = range(|place| place.north_m);
    let width = f64::from(look.width() - FRAME[0]);
    let limits = match look {
        Look::Narrow => (200.0, 420.0),
        Look::Wide | Look::Paper => (260.0, 600.0),
    };
    let height = (width * half_north_m / half_east_m).clamp(limits.0, limits.1);
    let metres = (half_east_m * 2.0 / width).max(half_north_m * 2.0 / height);
    let ticks = |pixels: f64| (pixels / 70.0).max(2.0) as usize;
    let axis = |middle: f64, pixels: f64| {
        let half = metres * pixels / 2.0;
        let round = Axis::values(middle - half, middle + half, ticks(pixels));
        let (from, to) = (middle - half, middle + half);
        let inside = round.ticks.iter().zip(&round.labels);
        let inside = inside.filter(|(tick, _)| (from..=to).contains(*tick));
        let (ticks, labels) = inside.map(|(tick, label)| (*tick, label.clone())).unzip();
        Axis {
            from,
            to,
            ticks,
            labels,
        }
    };
    let (x, y) = (axis(east_m, width), axis(north_m, height));
    (height as u32 + FRAME[1], x, y)
}

fn point(place: &Place) -> (f64, f64) {
    (place.east_m, place.north_m)
}

fn area_of(chart: &mut Chart<'_>, area: &Area) -> Result<(), DrawError> {
    let colour = match area.is_inclusion {
        true => Ink::Green.shade().paper,
        false => Ink::Red.shade().paper,
    };
    let strength = if area.is_inclusion { 0.05 } else { 0.18 };
    let corners: Vec<(f64, f64)> = area.corners.iter().map(point).collect();
    chart.draw_series([Polygon::new(corners.clone(), colour.mix(strength).filled())])?;
    let closed: Vec<(f64, f64)> = corners.iter().chain(corners.first()).copied().collect();
    chart.draw_series([PathElement::new(closed, stroke(colour, 1.5))])?;
    Ok(())
}

fn plan(chart: &mut Chart<'_>, map: &Map, look: Look) -> Result<(), DrawError> {
    let colour = Ink::Purple.shade().paper;
    let path: Vec<(f64, f64)> = map.plan.iter().map(point).collect();
    if path.len() > 1 {
        let dashes = DashedLineSeries::new(path.clone(), units(6), units(5), stroke(colour, 1.5));
        chart.draw_series(dashes)?;
    }
    for (index, place) in path.iter().enumerate() {
        chart.draw_series([Circle::new(*place, units(5), colour.mix(0.35).filled())])?;
        if index < MAX_NUMBERED {
            label(
                chart,
                *place,
                (7, -9),
                &(index + 1).to_string(),
                colour,
                look,
            )?;
        }
    }
    Ok(())
}

fn track(chart: &mut Chart<'_>, map: &Map, look: Look) -> Result<(), DrawError> {
    let colour = Ink::Blue.shade().paper;
    let line: Vec<(f64, f64)> = map.track.iter().map(point).collect();
    chart.draw_series(LineSeries::new(line.clone(), stroke(colour, 2.0)))?;
    let (Some(first), Some(last)) = (line.first(), line.last()) else {
        return Ok(());
    };
    chart.draw_series([
        Circle::new(*first, units(6), PAGE.paper.filled()),
        Circle::new(*first, units(6), stroke(colour, 2.0)),
    ])?;
    chart.draw_series([Circle::new(*last, units(4), colour.filled())])?;
    label(chart, *first, (9, 11), "start", TEXT.paper, look)?;
    let (from, to) = (chart.backend_coord(first), chart.backend_coord(last));
    let is_apart = (from.0 - to.0).abs() + (from.1 - to.1).abs() > units(40) as i32;
    if is_apart {
        label(chart, *last, (9, 11), "end", TEXT.paper, look)?;
    }
    Ok(())
}

/// Where something happened that a reader must look at.
fn events(chart: &mut Chart<'_>, flight: &Flight, map: &Map, look: Look) -> Result<(), DrawError> {
    for (index, place) in &map.events {
        let Some(event) = flight.events.get(*index) else {
            continue;
        };
        let colour = match event.weight {
            Weight::Note => continue,
            Weight::Warning => Ink::Yellow.shade().paper,
            Weight::Alarm => Ink::Red.shade().paper,
        };
        let at = point(place);
        chart.draw_series([
            Circle::new(at, units(5), PAGE.paper.filled()),
            Circle::new(at, units(5), stroke(colour, 2.0)),
        ])?;
        label(chart, at, (8, 0), &(index + 1).to_string(), colour, look)?;
    }
    Ok(())
}

/// A text beside a place, so many pixels to the right and down.
fn label(
    chart: &mut Chart<'_>,
    place: (f64, f64),
    offset: (i32, i32),
    text: &str,
    colour: RGBColor,
    look: Look,
) -> Result<(), DrawError> {
    let style =
        sized_text_style(look.letters() - 1, colour).pos(Pos::new(HPos::Left, VPos::Center));
    let offset = (offset.0 * units(1) as i32, offset.1 * units(1) as i32);
    let element = EmptyElement::at(place) + Text::new(text.to_owned(), offset, style);
    chart.draw_series([element])?;
    Ok(())
}
