//! The flight as JSON for the page's script.
//!
//! Its size is bounded whatever the length of the flight: of a curve, [`COLUMNS`] columns with the first, least,
//! greatest and last value each; texts of [`MOST_LETTERS`]; lists of [`MOST_ITEMS`]. So no peak is lost, and a page has
//! at most some megabytes. Texts of files are made harmless.

use serde_json::{Value, json};

use super::flight::{Curve, Data, FlightReport, Plot};

/// Columns of a curve: more than a plot is wide on most screens and on paper.
pub const COLUMNS: usize = 1500;

/// Most characters of a text: a person reads no more, and a damaged file may have megabytes. What is longer ends in an
/// ellipsis.
pub const MOST_LETTERS: usize = 400;

/// Most characters of what the recording says of itself, such as a list of columns.
const MOST_LETTERS_OF_METADATA: usize = 2000;

/// Most items of a list, more than any list of a collected flight has; further ones are left out.
const MOST_ITEMS: usize = 24_000;

/// No number of a flight is greater; a damaged one is shown as this.
const LARGEST: f64 = 1e12;

/// The JSON, in which no `<` is: nothing in it ends or begins an element.
pub fn json(flight: &FlightReport) -> String {
    let span_s = flight.span_s();
    let mut all = serde_json::to_value(flight).unwrap_or_default();
    let plots = flight.plots.iter().map(|plot| self::plot(plot, span_s));
    all["plots"] = plots.collect();
    all["span_s"] = json!(span_s);
    all["start_unix_ms"] = json!(flight.start_unix_ns.map(|ns| ns / 1_000_000));
    let mut metadata = all["metadata"].take();
    bound(&mut all, MOST_LETTERS);
    bound(&mut metadata, MOST_LETTERS_OF_METADATA);
    all["metadata"] = metadata;
    all.to_string().replace('<', "\\u003c")
}

/// Shortens texts and lists, and rounds numbers to what is seen: a centimetre of a place in degrees.
fn bound(value: &mut Value, letters: usize) {
    match value {
        Value::String(text) => *text = short(text, letters),
        Value::Number(number) => {
            if let Some(float) = number.as_f64().filter(|_| number.is_f64()) {
                *value = json!(rounded(float, 1e7));
            }
        }
        Value::Array(items) => {
            items.truncate(MOST_ITEMS);
            items.iter_mut().for_each(|item| bound(item, letters));
        }
        Value::Object(fields) => fields.values_mut().for_each(|field| bound(field, letters)),
        Value::Null | Value::Bool(_) => {}
    }
}

fn rounded(value: f64, parts: f64) -> f64 {
    let value = value.clamp(-LARGEST, LARGEST);
    let rounded = (value * parts).round() / parts;
    // No `-0`.
    rounded + 0.0
}

fn plot(plot: &Plot, span_s: f64) -> Value {
    let curves = plot.curves.iter().filter(|curve| !curve.is_empty());
    let curves: Vec<Value> = curves.map(|curve| self::curve(curve, span_s)).collect();
    json!({
        "id": plot.id,
        "title": plot.title,
        "unit": plot.unit,
        "scale": plot.scale,
        "about": plot.about,
        "curves": curves,
        "limits": plot.limits,
    })
}

fn curve(curve: &Curve, span_s: f64) -> Value {
    let (kind, points) = match &curve.data {
        Data::Line(values) => ("line", values.lines(span_s, COLUMNS)),
        Data::Dashes(values) => ("dashes", values.lines(span_s, COLUMNS)),
        Data::Bars(counts) => {
            let bars = counts.rates(span_s).filter(|(_, rate)| *rate > 0.0);
            let bars: Vec<[f64; 3]> = bars
                .map(|([from_s, to_s], rate)| [from_s, to_s, rate])
                .collect();
            return json!({
                "name": curve.name,
                "ink": curve.ink,
                "kind": "bars",
                "bars": bars,
                "total": counts.total(),
            });
        }
    };
    let (mut t_ms, mut values) = (Vec::new(), Vec::new());
    // Two values of one moment both stay: the later one is drawn a millisecond later.
    let mut last_ms = -1_i64;
    for line in points {
        if last_ms >= 0 {
            last_ms += 1;
            t_ms.push(last_ms);
            values.push(Value::Null);
        }
        for point in line {
            last_ms = ((point.at_s.min(LARGEST) * 1000.0) as i64).max(last_ms + 1);
            t_ms.push(last_ms);
            values.push(json!(rounded(point.value, 1e4)));
        }
    }
    json!({ "name": curve.name, "ink": curve.ink, "kind": kind, "t_ms": t_ms, "values": values })
}

/// The text without characters that change how what follows is read: controls, and those that turn the direction of
/// text. Each becomes a replacement character, so that it is seen that something was there.
fn plain(text: &str) -> String {
    let shown = |character: char| match character {
        '\t' | '\n' => ' ',
        '\u{200e}'
        | '\u{200f}'
        | '\u{202a}'..='\u{202e}'
        | '\u{2066}'..='\u{2069}'
        | '\u{feff}' => '\u{fffd}',
        // No characters of Unicode texts.
        '\u{fffe}' | '\u{ffff}' => '\u{fffd}',
        character if character.is_control() => '\u{fffd}',
        character => character,
    };
    text.chars().map(shown).collect()
}

/// The text as the page may show it, at most `most` characters of it; what is cut off is an ellipsis.
pub fn short(text: &str, most: usize) -> String {
    let text = plain(text);
    if text.chars().count() <= most {
        return text;
    }
    text.chars()
        .take(most.saturating_sub(1))
        .chain(['…'])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::envelope::Envelope;
    use super::super::flight::{Ink, Scale};
    use super::*;

    #[test]
    fn values_of_one_moment_and_both_ends_of_a_gap_stay() {
        let mut values = Envelope::new(1.0);
        for (at_s, value) in [
            (0.0, 1.0),
            (0.0, 9.0),
            (0.0, 2.0),
            (5.0, 3.0),
            (f64::MAX, 4.0),
        ] {
            values.push(at_s, value);
        }
        let mut flight = FlightReport::new("x", 6.0);
        let mut plot = Plot::new("p", "P", "m", Scale::Auto { least_span: 1.0 });
        plot.curves = vec![Curve::line("c", Ink::Blue, values)];
        flight.plots = vec![plot];
        let all: Value = serde_json::from_str(&json(&flight)).unwrap();
        let curve = &all["plots"][0]["curves"][0];
        assert_eq!(
            curve["values"],
            json!([1.0, 9.0, 2.0, null, 3.0, null, 4.0])
        );
        assert_eq!(
            curve["t_ms"],
            json!([0, 1, 2, 3, 5000, 5001, 1_000_000_000_000_000_i64])
        );
    }

    #[test]
    fn texts_are_cut_numbers_are_round_and_no_tag_is_left() {
        let mut flight = FlightReport::new("</script><script>", f64::NAN);
        flight.summary = vec!["x".repeat(1_000_000)];
        flight.map.track = vec![[37.412_345_678_9, -6.000_000_01]];
        flight.start_unix_ns = Some(1_795_348_483_000_000_000);
        let text = json(&flight);
        assert!(!text.contains('<') && text.len() < 2000, "{text}");
        let all: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(all["title"], "</script><script>");
        assert_eq!(all["map"]["track"], json!([[37.412_345_7, -6.0]]));
        assert_eq!(
            (&all["span_s"], &all["start_unix_ms"]),
            (&json!(1.0), &json!(1_795_348_483_000_u64))
        );
    }
}

#[cfg(test)]
mod text_tests {
    use super::*;

    #[test]
    fn nothing_that_is_obeyed_stays() {
        assert_eq!(
            plain("a\u{1b}[2Jb\u{202e}c\0\tä"),
            "a\u{fffd}[2Jb\u{fffd}c\u{fffd} ä"
        );
        assert_eq!(short("abcdef", 4), "abc…");
        assert_eq!(short("abcd", 4), "abcd");
    }
}
