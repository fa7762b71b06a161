//! The plots of the page, with marks where something happened. Each is drawn twice: for wide screens and paper, and for telephones.

use maud::{Markup, PreEscaped, html};

use super::alt;
use crate::flight::{Data, Flight, Ink, Plot, Weight};
use crate::plot::canvas::{DrawError, Drawing, Look};
use crate::plot::{lanes, map, time};
use crate::text::plain;

/// The looks of the page, each with its class.
const LOOKS: [(Look, &str); 2] = [(Look::Wide, "wide"), (Look::Narrow, "narrow")];

/// The flight from above; nothing when no place is known.
pub fn track(flight: &Flight) -> Result<Markup, DrawError> {
    let mut drawings = Vec::new();
    for (look, class) in LOOKS {
        match map::draw(flight, look)? {
            Some(drawing) => drawings.push((drawing, class)),
            None => return Ok(html! {}),
        }
    }
    let alt = alt::map(&flight.map);
    let map = &flight.map;
    let has = |is_inclusion: bool| {
        map.fence
            .iter()
            .any(|area| area.is_inclusion == is_inclusion)
    };
    let marked = |weight: Weight| {
        let mut events = map
            .events
            .iter()
            .filter_map(|(index, _)| flight.events.get(*index));
        events.any(|event| event.weight == weight)
    };
    let keys = [
        (!map.track.is_empty(), "track", Ink::Blue, "line"),
        (!map.plan.is_empty(), "plan", Ink::Purple, "dashes"),
        (has(true), "fence: stay inside", Ink::Green, "line"),
        (has(false), "fence: stay outside", Ink::Red, "span"),
        (marked(Weight::Alarm), "alarm", Ink::Red, "ring"),
        (marked(Weight::Warning), "warning", Ink::Yellow, "ring"),
    ];
    Ok(html! {
        section aria-labelledby="track" {
            h2 #track { "Track" }
            figure {
                figcaption {
                    ul.key { @for (is_there, name, ink, kind) in keys { @if is_there { (key(name, ink, kind)) } } }
                    p.about {
                        "North up. "
                        @if let Some([latitude, longitude]) = map.zero_deg {
                            "The zero is the first place of the track, " (format!("{latitude:.6}°, {longitude:.6}°")) ". "
                        }
                        @if marked(Weight::Alarm) || marked(Weight::Warning) { "Numbers beside rings are those of the " a href="#events" { "events" } "." }
                    }
                }
                @for (drawing, class) in &drawings { (embedded(drawing, class, &alt, &html! {})) }
            }
        }
    })
}

/// Phases, requests and states; nothing when none is known.
pub fn timeline(flight: &Flight) -> Result<Markup, DrawError> {
    let lanes = lanes::lanes(flight);
    if lanes.is_empty() {
        return Ok(html! {});
    }
    let alt = alt::lanes(&lanes);
    let mut drawings = Vec::new();
    for (look, class) in LOOKS {
        drawings.push((lanes::draw(flight, look)?, class));
    }
    // The same name has the same colour.
    let mut names: Vec<(&str, Ink)> = Vec::new();
    for span in &flight.phases {
        if !names.iter().any(|(name, _)| *name == span.name) {
            names.push((span.name.as_str(), span.ink));
        }
    }
    Ok(html! {
        figure #timeline {
            figcaption {
                h3 { "What it did" }
                ul.key {
                    @for (name, ink) in names { (key(name, ink, "span")) }
                    @if !flight.gaps.is_empty() { (key("no sample", Ink::Grey, "span")) }
                    @for weight in [Weight::Alarm, Weight::Warning] {
                        @if flight.events.iter().any(|event| event.weight == weight) { (key(weight.name(), weight_ink(weight), "dashes")) }
                    }
                    @if !flight.requests.is_empty() { (key("request", Ink::Purple, "dashes")) }
                }
            }
            @for (drawing, class) in &drawings { (embedded(drawing, class, &alt, &marks(flight, drawing))) }
        }
    })
}

/// All plots that have values, and the names of those that have none.
pub fn plots(flight: &Flight) -> Result<Markup, DrawError> {
    let mut figures = Vec::new();
    for plot in flight.plots.iter().filter(|plot| !plot.is_empty()) {
        figures.push(figure(flight, plot)?);
    }
    let missing: Vec<String> = flight
        .plots
        .iter()
        .filter(|plot| plot.is_empty())
        .map(|plot| plain(&plot.title).to_lowercase())
        .collect();
    Ok(html! {
        @for figure in figures { (figure) }
        @if !missing.is_empty() { p { "Nothing to draw: " (missing.join(", ")) "." } }
    })
}

fn figure(flight: &Flight, plot: &Plot) -> Result<Markup, DrawError> {
    let alt = alt::plot(flight, plot);
    let mut drawings = Vec::new();
    for (look, class) in LOOKS {
        drawings.push((time::draw(flight, plot, look)?, class));
    }
    let kind = |data: &Data| match data {
        Data::Line(_) => "line",
        Data::Dashes(_) => "dashes",
        Data::Bars(_) => "bars",
    };
    Ok(html! {
        figure id=(plot.id) {
            figcaption {
                h3 { (plain(&plot.title)) " " span.unit { "in " (plot.unit) } }
                ul.key {
                    @for curve in plot.curves.iter().filter(|curve| !curve.is_empty()) {
                        (key(&curve.name, curve.ink, kind(&curve.data)))
                    }
                    @for limit in &plot.limits { (key(&format!("{}: {:.1} {}", limit.name, limit.value, plot.unit), Ink::Red, "dashes")) }
                }
                @if !plot.about.is_empty() { p.about { (plain(&plot.about)) } }
            }
            @for (drawing, class) in &drawings { (embedded(drawing, class, &alt, &marks(flight, drawing))) }
        }
    })
}

fn key(name: &str, ink: Ink, kind: &str) -> Markup {
    html! { li { span.swatch.(kind).(ink.name()) aria-hidden="true" {} (plain(name)) } }
}

/// A drawing as a part of the page.
fn embedded(drawing: &Drawing, class: &str, alt: &str, marks: &Markup) -> Markup {
    let [width, height] = drawing.size;
    html! {
        svg.(class) viewBox=(format!("0 0 {width} {height}")) role="img" aria-label=(alt) {
            // The library escapes the texts that it writes.
            (PreEscaped(&drawing.body))
            (marks)
        }
    }
}

/// A line at the time of each request and event, which leads to its row.
fn marks(flight: &Flight, drawing: &Drawing) -> Markup {
    let [left, right, top, bottom] = drawing.area;
    let span_s = flight.span_s();
    let x = |at_s: f64| {
        let part = if at_s.is_finite() {
            (at_s / span_s).clamp(0.0, 1.0)
        } else {
            0.0
        };
        f64::from(left) + part * f64::from(right - left)
    };
    html! {
        g aria-hidden="true" {
            @for (index, request) in flight.requests.iter().enumerate() {
                @let x = format!("{:.1}", x(request.from_s));
                a href={ "#q" (index + 1) } tabindex="-1" {
                    line.mark.request.(Ink::Purple.name()) x1=(x) x2=(x) y1=(top) y2=(bottom) {}
                }
            }
            @for (index, event) in flight.events.iter().enumerate() {
                @let number = index + 1;
                @let x = format!("{:.1}", x(event.at_s));
                a href={ "#e" (number) } tabindex="-1" {
                    line.mark.(event.weight.name()).{ "m" (number) }.(weight_ink(event.weight).name()) x1=(x) x2=(x) y1=(top) y2=(bottom) {}
                }
            }
        }
    }
}

/// The colour of a weight.
pub fn weight_ink(weight: Weight) -> Ink {
    match weight {
        Weight::Note => Ink::Grey,
        Weight::Warning => Ink::Yellow,
        Weight::Alarm => Ink::Red,
    }
}
