//! What a reader hears who does not see the plots.

use crate::flight::{Data, Flight, Lane, Map, Plot};
use crate::text::{moment, number, short};

/// Most letters of a name.
const MAX_LETTERS: usize = 60;

/// Most spans of a lane that are named.
const MAX_NAMED: usize = 12;

/// The map in words.
pub fn map(map: &Map) -> String {
    let track = map.track.iter();
    let extent = |values: Vec<f64>| {
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (greatest - least).max(0.0)
    };
    let mut text = match map.track.is_empty() {
        true => "No position is known".to_owned(),
        false => format!(
            "Track seen from above, {} m from west to east and {} m from south to north",
            number(extent(track.clone().map(|place| place.east_m).collect())),
            number(extent(track.map(|place| place.north_m).collect()))
        ),
    };
    if !map.plan.is_empty() {
        text += &format!("; plan of {} waypoints", map.plan.len());
    }
    if !map.fence.is_empty() {
        text += &format!("; fence of {} areas", map.fence.len());
    }
    text
}

/// The lanes in words.
pub fn lanes(lanes: &[Lane]) -> String {
    let spans = |lane: &Lane| {
        let named = lane.spans.iter().take(MAX_NAMED);
        let named: Vec<String> = named
            .map(|span| {
                format!(
                    "{} from {}",
                    short(&span.name, MAX_LETTERS),
                    moment(span.from_s)
                )
            })
            .collect();
        let more = lane.spans.len().saturating_sub(MAX_NAMED);
        let more = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        let name = if lane.name.is_empty() {
            "also"
        } else {
            &lane.name
        };
        format!("{}: {}{more}", short(name, MAX_LETTERS), named.join(", "))
    };
    let lanes: Vec<String> = lanes.iter().map(spans).collect();
    format!("States over time. {}", lanes.join(". "))
}

/// A plot in words.
pub fn plot(flight: &Flight, plot: &Plot) -> String {
    let unit = plot.unit;
    let curves = plot.curves.iter().filter_map(|curve| {
        let name = short(&curve.name, MAX_LETTERS);
        match &curve.data {
            Data::Line(values) | Data::Dashes(values) => {
                let (least, greatest) = values.range()?;
                let (first, last) = values.ends()?;
                Some(format!(
                    "{name} between {} and {} {unit}, {} at first and {} at last",
                    number(least),
                    number(greatest),
                    number(first.value),
                    number(last.value)
                ))
            }
            Data::Bars(counts) => Some(match counts.total() {
                0.0 => format!("{name}: none"),
                total => format!(
                    "{name}: {} in all, at most {} {unit}",
                    number(total),
                    number(counts.greatest_rate(flight.span_s()))
                ),
            }),
        }
    });
    let curves: Vec<String> = curves.collect();
    format!(
        "{} over time. {}",
        short(&plot.title, MAX_LETTERS),
        curves.join(". ")
    )
}
