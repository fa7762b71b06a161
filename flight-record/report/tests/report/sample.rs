//! A flight to draw, and a look at what came out.

use std::collections::BTreeMap;

use flight_report::Flight;
use flight_report::bins::Bins;
use flight_report::envelope::Envelope;
use flight_report::flight::{
    Area, Curve, Event, Ink, Lane, Limit, Map, Outcome, Place, Plot, Request, Scale, Span, Table,
    Weight,
};
use quick_xml::Reader;
use quick_xml::events::Event as Token;

fn span(from_s: f64, to_s: f64, name: &str, ink: Ink) -> Span {
    Span {
        from_s,
        to_s,
        name: name.to_owned(),
        ink,
    }
}

fn event(at_s: f64, weight: Weight, text: &str) -> Event {
    Event {
        at_s,
        weight,
        text: text.to_owned(),
    }
}

fn place(east_m: f64, north_m: f64) -> Place {
    Place { east_m, north_m }
}

/// Two minutes with everything that a report can show. Each text of it is made by `text` of a usual one.
pub fn flight(text: impl Fn(&str) -> String) -> Flight {
    let mut altitude = Envelope::new(1.0);
    let mut interval = Envelope::new(f64::INFINITY);
    let mut samples = Bins::default();
    for index in 0..6000 {
        let at_s = f64::from(index) / 50.0;
        if !(60.0..64.0).contains(&at_s) {
            altitude.push(at_s, 10.0 + (at_s / 10.0).sin() * 5.0);
            interval.push(at_s, 20.0);
            samples.add(at_s, 1.0);
        }
    }
    let mut flight = Flight::new(text("Flight of robot 1"), 120.0);
    flight.lead = vec![text("2026-11-22 11:54:43 to 11:56:43 UTC")];
    flight.summary = vec![text("The helicopter took off once.")];
    flight.facts = vec![(text("duration"), text("2m00s, 5800 rows"))];
    flight.start_unix_ns = Some(1_795_348_483_000_000_000);
    flight.phases = vec![
        span(0.0, 10.0, &text("on the ground"), Ink::Grey),
        span(10.0, 100.0, &text("flying the path"), Ink::Blue),
        span(100.0, 120.0, &text("landing"), Ink::Purple),
    ];
    flight.lanes = vec![Lane {
        name: text("link"),
        spans: vec![
            span(0.0, 60.0, &text("up"), Ink::Green),
            span(60.0, 64.0, &text("gone"), Ink::Red),
        ],
    }];
    flight.requests = vec![Request {
        from_s: 9.0,
        to_s: Some(95.0),
        name: text("goto, 4 waypoints"),
        sender: text("ril (812)"),
        outcome: Outcome::Aborted,
        reason: text("path-replaced"),
    }];
    flight.events = vec![
        event(10.0, Weight::Note, &text("took off")),
        event(60.0, Weight::Alarm, &text("no sample for 4.0 s in flight")),
        event(70.0, Weight::Warning, &text("3 samples were lost")),
    ];
    flight.events_left_out = 7;
    flight.gaps = vec![[60.0, 64.0]];
    let mut height = Plot::new(
        "altitude",
        text("Altitude"),
        "m",
        Scale::Auto { least_span: 2.0 },
    );
    height.about = text("With the zero of telemetry.");
    height.curves = vec![
        Curve::line(text("GPS"), Ink::Blue, altitude.clone()),
        Curve::dashes(text("asked for"), Ink::Purple, altitude),
    ];
    height.limits = vec![Limit {
        name: text("ceiling"),
        value: 14.0,
    }];
    let mut link = Plot::new(
        "link",
        text("Link"),
        "1/s",
        Scale::FromZero { least_top: 10.0 },
    );
    link.curves = vec![Curve::bars(text("samples"), Ink::Grey, samples)];
    let mut ages = Plot::new(
        "ages",
        text("Ages"),
        "ms",
        Scale::Logarithmic { least: 0.1 },
    );
    ages.curves = vec![Curve::line(
        text("between two samples"),
        Ink::Blue,
        interval,
    )];
    let empty = Plot::new(
        "fuel",
        text("Fuel"),
        "%",
        Scale::FromZero { least_top: 10.0 },
    );
    flight.plots = vec![height, link, ages, empty];
    flight.map = Map {
        track: (0..50)
            .map(|step| place(f64::from(step), f64::from(step * step) / 50.0))
            .collect(),
        plan: vec![place(0.0, 0.0), place(50.0, 50.0)],
        fence: vec![
            Area {
                is_inclusion: true,
                corners: vec![place(-10.0, -10.0), place(80.0, -10.0), place(80.0, 80.0)],
            },
            Area {
                is_inclusion: false,
                corners: vec![place(20.0, -5.0), place(30.0, -5.0), place(30.0, 5.0)],
            },
        ],
        events: vec![(1, place(25.0, 12.0))],
        zero_deg: Some([37.411, -6.001]),
    };
    flight.metadata = vec![Table {
        title: text("The log"),
        rows: vec![(text("file"), text("log/hero(1)_22_11_26-11_54_43.tsv"))],
    }];
    flight.remarks = vec![text("One line is damaged.")];
    flight
}

/// The usual flight.
pub fn usual() -> Flight {
    flight(str::to_owned)
}

/// An element of a page.
pub struct Element {
    pub name: String,
    pub attributes: BTreeMap<String, String>,
    /// The text up to the next element.
    pub text: String,
}

/// The elements of a page in order. A page is HTML, so elements need no end.
pub fn elements(page: &str) -> Vec<Element> {
    let mut reader = Reader::from_str(page);
    reader.config_mut().check_end_names = false;
    reader.config_mut().allow_unmatched_ends = true;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        match reader.read_event().expect("markup") {
            Token::Start(tag) | Token::Empty(tag) => {
                let attribute = |attribute: quick_xml::events::attributes::Attribute<'_>| {
                    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
                    (text(attribute.key.as_ref()), text(&attribute.value))
                };
                let attributes = tag
                    .html_attributes()
                    .map(|one| attribute(one.expect("an attribute")));
                elements.push(Element {
                    name: String::from_utf8_lossy(tag.name().as_ref()).into_owned(),
                    attributes: attributes.collect(),
                    text: String::new(),
                });
            }
            Token::Text(text) => {
                if let Some(last) = elements.last_mut() {
                    last.text += &String::from_utf8_lossy(&text);
                }
            }
            Token::GeneralRef(name) => {
                if let Some(last) = elements.last_mut() {
                    last.text += &format!("&{};", String::from_utf8_lossy(&name));
                }
            }
            Token::Eof => return elements,
            _ => {}
        }
    }
}
