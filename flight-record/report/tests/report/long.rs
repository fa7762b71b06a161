//! Flights of every length, and numbers that no flight has.

use flight_report::Flight;
use flight_report::bins::Bins;
use flight_report::envelope::Envelope;
use flight_report::flight::{Curve, Event, Ink, Place, Plot, Scale, Weight};
use proptest::prelude::*;
use roxmltree::Document;

use crate::sample::elements;

#[test]
fn an_hour_at_50_hz_is_a_page_of_bounded_size() {
    let mut flight = Flight::new("An hour", 3600.0);
    for id in ["altitude", "speed", "battery", "fuel", "rotor", "ages"] {
        let mut values = Envelope::new(1.0);
        let mut random = fastrand::Rng::with_seed(1);
        for index in 0..180_000 {
            values.push(f64::from(index) / 50.0, 65.5 * random.f64());
        }
        let mut plot = Plot::new(id, id, "m", Scale::Auto { least_span: 1.0 });
        plot.curves.push(Curve::line("noise", Ink::Blue, values));
        flight.plots.push(plot);
    }
    let page = flight_report::page(&flight).unwrap();
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
    let lines = elements(&page)
        .into_iter()
        .filter(|element| element.name == "polyline");
    let points = lines.filter_map(|line| Some(line.attributes.get("points")?.split(' ').count()));
    assert!(points.max().unwrap() <= 4 * 800 + 1);
}

#[test]
fn nothing_at_all_is_a_page_that_says_so() {
    for duration_s in [0.0, f64::NAN, f64::INFINITY, -1.0] {
        let flight = Flight::new("", duration_s);
        let page = flight_report::page(&flight).unwrap();
        assert!(page.contains("The recording tells of none."), "{page}");
        assert!(!page.contains("<svg"));
        assert!(flight_report::papers(&flight).unwrap().is_empty());
    }
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        -1e3..1e3_f64,
        proptest::num::f64::ANY,
        Just(0.0),
        Just(f64::MAX),
        Just(f64::MIN_POSITIVE)
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_numbers_are_drawn(
        numbers in proptest::collection::vec((any_number(), any_number()), 0..20),
        duration_s in any_number(),
        scale in 0..3_u8,
    ) {
        let mut flight = Flight::new("Any", duration_s);
        let (mut values, mut counts) = (Envelope::new(1.0), Bins::default());
        for (index, (at_s, value)) in numbers.iter().enumerate() {
            values.push(*at_s, *value);
            counts.add(*at_s, *value);
            flight.map.track.push(Place { east_m: *at_s, north_m: *value });
            flight.map.events.push((index, Place { east_m: *value, north_m: *at_s }));
            flight.gaps.push([*at_s, *value]);
            flight.events.push(Event { at_s: *at_s, weight: Weight::Alarm, text: String::new() });
        }
        let scale = match scale {
            0 => Scale::Auto { least_span: 1.0 },
            1 => Scale::FromZero { least_top: 1.0 },
            _ => Scale::Logarithmic { least: 0.1 },
        };
        let mut plot = Plot::new("any", "Any", "m", scale);
        plot.curves = vec![Curve::line("line", Ink::Blue, values), Curve::bars("bars", Ink::Red, counts)];
        flight.plots.push(plot);
        flight_report::page(&flight).unwrap();
        for paper in flight_report::papers(&flight).unwrap() {
            prop_assert!(Document::parse(&paper.svg).is_ok());
        }
    }
}
