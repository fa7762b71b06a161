//! A flight in one file.

use std::fmt::Write as _;

use proptest::prelude::*;
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use view::page::{ChartArea, Weight};
use view::report::envelope::{Bins, Envelope};
use view::report::flight::{
    Curve, Event, Ink, Lane, Limit, Map, Outcome, Plot, RequestRow, Scale, Span, Table,
};
use view::report::{FlightReport, page};

fn span(from_s: f64, to_s: f64, name: &str, ink: Ink) -> Span {
    Span {
        from_s,
        to_s,
        name: name.to_owned(),
        ink,
    }
}

fn event(at_s: f64, weight: Weight, text: &str, place: Option<[f64; 2]>) -> Event {
    Event {
        at_s,
        weight,
        text: text.to_owned(),
        place,
    }
}

/// Two minutes with everything that a report can show. Each text of it is made by `text` of a usual one.
fn flight(text: impl Fn(&str) -> String) -> FlightReport {
    let mut altitude = Envelope::new(1.0);
    let mut samples = Bins::default();
    for index in 0..6000 {
        let at_s = f64::from(index) / 50.0;
        if !(60.0..64.0).contains(&at_s) {
            altitude.push(at_s, 10.0 + (at_s / 10.0).sin() * 5.0);
            samples.add(at_s, 1.0);
        }
    }
    let mut flight = FlightReport::new(text("Flight of robot 1"), 120.0);
    flight.lead = vec![text("2026-11-22 11:54:43 to 11:56:43 UTC")];
    flight.summary = vec![text("The helicopter took off once.")];
    flight.facts = vec![(text("duration"), text("2m00s, 5800 rows"))];
    flight.start_unix_ns = Some(1_795_348_483_000_000_000);
    flight.phases = vec![
        span(0.0, 10.0, &text("on the ground"), Ink::Grey),
        span(10.0, 120.0, &text("flying the path"), Ink::Blue),
    ];
    flight.lanes = vec![Lane {
        name: text("link"),
        spans: vec![span(0.0, 60.0, &text("up"), Ink::Green)],
    }];
    flight.requests = vec![RequestRow {
        from_s: 9.0,
        to_s: Some(95.0),
        name: text("goto, 4 waypoints"),
        sender: text("ril (812)"),
        outcome: Outcome::Aborted,
        reason: text("path-replaced"),
    }];
    flight.events = vec![
        event(10.0, Weight::Note, &text("took off"), None),
        event(
            60.0,
            Weight::Alarm,
            &text("no sample for 4.0 s in flight"),
            Some([37.4112, -6.001]),
        ),
    ];
    flight.events_left_out = 7;
    flight.gaps = vec![[60.0, 64.0]];
    let scale = Scale::Auto { least_span: 2.0 };
    let mut height = Plot::new("altitude", text("Altitude"), "m", scale);
    height.about = text("With the zero of telemetry.");
    height.curves = vec![
        Curve::line(text("GPS"), Ink::Blue, altitude.clone()),
        Curve::dashes(text("asked for"), Ink::Purple, altitude),
    ];
    height.limits = vec![Limit {
        name: text("ceiling"),
        value: 14.0,
    }];
    let scale = Scale::FromZero { least_top: 10.0 };
    let mut link = Plot::new("link", text("Link"), "1/s", scale);
    link.curves = vec![Curve::bars(text("samples"), Ink::Grey, samples)];
    let empty = Plot::new("fuel", text("Fuel"), "%", scale);
    flight.plots = vec![height, link, empty];
    flight.map = Map {
        track: vec![[37.411, -6.001], [37.4115, -6.001]],
        track_s: vec![10.0, 100.0],
        plan: vec![[37.411, -6.001]],
        fence: vec![ChartArea {
            name: text("field"),
            inclusion: true,
            floor_m: None,
            ceiling_m: Some(80.0),
            corners: vec![[37.41, -6.002], [37.42, -6.002], [37.42, -6.0]],
        }],
    };
    flight.metadata = vec![Table {
        title: text("The log"),
        rows: vec![(text("file"), text("log/hero(1)_22_11_26-11_54_43.tsv"))],
    }];
    flight.remarks = vec![text("One line is damaged.")];
    flight
}

const DATA: &str = "<script type=\"application/json\" id=\"flight\">";

/// The page around the flight, and the flight's text in it.
fn parts(page: &str) -> ([&str; 2], &str) {
    let (before, rest) = page.split_once(DATA).expect("the flight");
    let (data, after) = rest.split_once("</script>").expect("its end");
    ([before, after], data)
}

fn data(page: &str) -> Value {
    serde_json::from_str(parts(page).1).expect("JSON")
}

#[test]
fn the_file_has_all_that_the_flight_has() {
    let flight = flight(str::to_owned);
    let data = data(&page(&flight));
    let texts = serde_json::to_value(&flight).unwrap();
    for field in [
        "title",
        "lead",
        "summary",
        "facts",
        "phases",
        "lanes",
        "requests",
        "events",
        "gaps",
        "map",
        "metadata",
        "remarks",
        "events_left_out",
        "duration_s",
    ] {
        assert_eq!(data[field], texts[field], "{field}");
    }
    assert_eq!(data["requests"][0]["outcome"], "aborted");
    assert_eq!(data["events"][1]["weight"], "alarm");
    let plots = data["plots"].as_array().unwrap();
    let ids: Vec<&str> = plots
        .iter()
        .filter_map(|plot| plot["id"].as_str())
        .collect();
    assert_eq!(ids, ["altitude", "link", "fuel"]);
    assert_eq!(plots[0]["scale"]["kind"], "auto");
    assert_eq!(plots[0]["limits"][0]["value"], 14.0);
    let curve = &plots[0]["curves"][0];
    let gap = curve["values"]
        .as_array()
        .unwrap()
        .iter()
        .position(Value::is_null);
    let ms = curve["t_ms"][gap.expect("a gap")].as_i64().unwrap();
    assert!((59_980..64_000).contains(&ms), "{ms}");
    assert_eq!(plots[0]["curves"][1]["kind"], "dashes");
    assert_eq!(plots[1]["curves"][0]["total"], 5800.0);
    assert_eq!(plots[2]["curves"], serde_json::json!([]));
}

/// What a file may hold to get a script, an element, an attribute or a link into the page.
const HARM: [&str; 9] = [
    "<script>alert(1)</script>",
    "</script><script src=//evil.example/x.js></script>",
    "\"><img src=x onerror=alert(1)>",
    "javascript:alert(1)",
    "]]><!--<script>alert(1)-->",
    "&lt;script&gt; &#60;script&#62; &amp;",
    "\u{1b}]0;title\u{7}\u{0}\u{8}\u{202e}\u{feff}\u{ffff}\u{2028}",
    "{flight}\n{script}\n{policy}",
    "\\u003c/script>\\",
];

#[test]
fn no_text_of_a_file_becomes_more_than_text() {
    let usual = page(&flight(str::to_owned));
    for harm in HARM {
        let page = page(&flight(|text| format!("{text}{harm}")));
        // All that is markup or script is the same whatever the flight is.
        assert_eq!(parts(&page).0, parts(&usual).0, "{harm}");
        let text = parts(&page).1;
        assert!(
            !text.contains('<') && !text.contains(char::is_control),
            "{harm}"
        );
        let shown = data(&page)["summary"][0].as_str().unwrap().to_owned();
        let plain = shown.replace(['\u{fffd}', ' '], "");
        let letters = harm.chars().filter(|letter| {
            !letter.is_control() && !matches!(letter, ' ' | '\u{202e}' | '\u{feff}' | '\u{ffff}')
        });
        let letters: String = letters.collect();
        assert!(plain.ends_with(&letters), "{shown}");
        assert!(!shown.contains(['\u{202e}', '\u{1b}', '\u{0}']));
    }
}

/// The hash of a script as a policy writes it: base 64 of SHA-256.
fn hash(text: &str) -> String {
    let mut bits = String::new();
    for byte in Sha256::digest(text) {
        write!(bits, "{byte:08b}").unwrap();
    }
    let letters: Vec<char> = ('A'..='Z')
        .chain('a'..='z')
        .chain('0'..='9')
        .chain(['+', '/'])
        .collect();
    bits += "00";
    let sextets = bits.as_bytes().chunks(6).map(|six| {
        let six = std::str::from_utf8(six).unwrap();
        letters[usize::from_str_radix(six, 2).unwrap()]
    });
    let text: String = sextets.collect();
    format!("'sha256-{text}='")
}

#[test]
fn a_page_loads_nothing_and_runs_only_what_it_brings_along() {
    let page = page(&flight(str::to_owned));
    let (style, rest) = page
        .split_once("<style>")
        .unwrap()
        .1
        .split_once("</style>")
        .unwrap();
    let script = rest
        .split_once("<script>")
        .unwrap()
        .1
        .split_once("</script>")
        .unwrap()
        .0;
    let policy = page
        .split_once("Content-Security-Policy\" content=\"")
        .unwrap()
        .1;
    let policy = policy.split_once('"').unwrap().0;
    let expected = format!(
        "default-src 'none'; script-src {}; style-src {}; img-src data:; base-uri 'none'; form-action 'none'",
        hash(script),
        hash(style)
    );
    assert_eq!(policy, expected);
    assert!(page.find("Content-Security-Policy").unwrap() < page.find("<style>").unwrap());
    // What is left is markup of our own: no address but those into the page, nothing that loads or runs.
    let markup = page
        .replace(script, "")
        .replace(style, "")
        .replace(parts(&page).1, "");
    for word in ["://", "src=", "stylesheet", "<iframe", "<object", "<base"] {
        assert!(!markup.contains(word), "{word}");
    }
    let attributes = markup.split_whitespace().filter(|word| word.contains('='));
    assert!(
        attributes
            .into_iter()
            .all(|attribute| !attribute.starts_with("on"))
    );
    let mut links = markup.split("href=\"").skip(1);
    assert!(links.all(|link| link.starts_with('#') || link.starts_with("data:,\"")));
    // In the style sheets of libraries there are names of pictures: none is absolute, and the policy loads none.
    for word in ["@import", "url(http", "url(\"http", "url(//"] {
        assert!(!style.contains(word), "{word}");
    }
    for word in [
        "importScripts",
        "fetch(",
        "XMLHttpRequest",
        "WebSocket",
        "sendBeacon",
        "eval(",
        ".innerHTML",
        "insertAdjacentHTML",
        "document.write",
    ] {
        let own = script.split_once("module_dom").unwrap().1;
        assert!(!own.contains(word), "{word}");
    }
}

#[test]
fn an_hour_at_50_hz_is_a_page_of_bounded_size() {
    let empty = page(&FlightReport::new("Nothing", 1.0)).len();
    let mut flight = FlightReport::new("An hour", 3600.0);
    for id in ["altitude", "speed", "battery", "fuel", "rotor", "ages"] {
        let mut values = Envelope::new(1.0);
        for index in 0..180_000_u32 {
            // No two are alike, and one stands out.
            let noise = f64::from(index.wrapping_mul(2_654_435_761)) / 65_536_000.0;
            let value = if index == 77_777 { 99.0 } else { noise };
            values.push(f64::from(index) / 50.0, value);
        }
        let mut plot = Plot::new(id, id, "m", Scale::Auto { least_span: 1.0 });
        plot.curves = vec![Curve::line("noise", Ink::Blue, values)];
        flight.plots.push(plot);
    }
    let page = page(&flight);
    assert!(page.len() - empty < 800_000, "{} bytes", page.len() - empty);
    for plot in data(&page)["plots"].as_array().unwrap() {
        let curve = &plot["curves"][0];
        let values = curve["values"].as_array().unwrap();
        assert!(
            values.len() <= 4 * 1500 && values.len() == curve["t_ms"].as_array().unwrap().len()
        );
        let peak = values
            .iter()
            .position(|value| value == 99.0)
            .expect("the peak");
        assert_eq!(curve["t_ms"][peak], 77_777 * 20);
    }
}

#[test]
fn megabytes_of_text_do_not_make_a_page_of_megabytes() {
    let usual = page(&flight(str::to_owned)).len();
    let long = "x".repeat(1_000_000);
    let page = page(&flight(|_| long.clone()));
    assert!(page.len() < usual + 20_000, "{}", page.len() - usual);
}

#[test]
fn nothing_at_all_is_a_page_too() {
    for duration_s in [0.0, f64::NAN, f64::INFINITY, -1.0] {
        let data = data(&page(&FlightReport::new("", duration_s)));
        let span_s = data["span_s"].as_f64().unwrap();
        assert!((1.0..=1e9).contains(&span_s));
        assert_eq!(data["plots"], serde_json::json!([]));
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
    fn any_numbers_are_data_in_the_order_of_time(
        numbers in proptest::collection::vec((any_number(), any_number()), 0..20),
        duration_s in any_number(),
    ) {
        let mut flight = FlightReport::new("Any", duration_s);
        let (mut values, mut counts) = (Envelope::new(1.0), Bins::default());
        for (at_s, value) in &numbers {
            values.push(*at_s, *value);
            counts.add(*at_s, *value);
            flight.map.track.push([*at_s, *value]);
            flight.map.track_s.push(*at_s);
            flight.gaps.push([*at_s, *value]);
            flight.events.push(event(*at_s, Weight::Alarm, "", Some([*value, *at_s])));
        }
        let mut plot = Plot::new("any", "Any", "m", Scale::Logarithmic { least: 0.1 });
        plot.curves = vec![Curve::line("line", Ink::Blue, values), Curve::bars("bars", Ink::Red, counts)];
        flight.plots.push(plot);
        let data = data(&page(&flight));
        for curve in data["plots"][0]["curves"].as_array().unwrap() {
            let times = curve["t_ms"].as_array().into_iter().flatten().map(|ms| ms.as_i64().unwrap());
            let times: Vec<i64> = times.collect();
            prop_assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
        }
        prop_assert!(data["span_s"].as_f64().unwrap() >= 1.0);
    }
}
