//! Fence, plan and track as a map: metres from the first place of the flight.

use flight_report::flight::{Area, Limit, Map};

use crate::chart::Chart;
use crate::geo::Place;
use crate::geo::offset_m;

/// Most waypoints and corners that are drawn; a survey has some hundreds.
const MAX_POINTS: usize = 5000;

/// The map of a track with what files say of its surroundings, and with the places of events by their number.
pub fn map(track: &[Place], chart: &Chart, events: impl Iterator<Item = (usize, Place)>) -> Map {
    let corners = chart.fence.iter().flat_map(|area| &area.corners);
    let Some(zero) = track
        .iter()
        .chain(&chart.path)
        .chain(corners)
        .next()
        .copied()
    else {
        return Map::default();
    };
    let places = |places: &[Place]| -> Vec<flight_report::flight::Place> {
        places
            .iter()
            .take(MAX_POINTS)
            .map(|place| at(zero, *place))
            .collect()
    };
    Map {
        track: places(track),
        plan: places(&chart.path),
        fence: chart
            .fence
            .iter()
            .map(|area| Area {
                is_inclusion: area.is_inclusion,
                corners: places(&area.corners),
            })
            .collect(),
        events: events
            .map(|(number, place)| (number, at(zero, place)))
            .collect(),
        zero_deg: Some([zero.latitude_deg, zero.longitude_deg]),
    }
}

/// Floor and ceiling of the fence.
pub fn limits(chart: &Chart) -> Vec<Limit> {
    let limits = [
        ("floor of the fence", chart.floor_m),
        ("ceiling of the fence", chart.ceiling_m),
    ];
    let known = limits.into_iter().filter_map(|(name, value)| {
        Some(Limit {
            name: name.to_owned(),
            value: value?,
        })
    });
    known.collect()
}

fn at(zero: Place, place: Place) -> flight_report::flight::Place {
    let (east_m, north_m) = offset_m(zero, place);
    flight_report::flight::Place { east_m, north_m }
}
