//! The parts of the page that are words and tables.

use maud::{Markup, html};

use super::figures::weight_ink;
use crate::flight::{Data, Event, Flight, Ink, Outcome, Request, Weight};
use crate::text::{day_time, moment, number, plain, short};

/// Most characters of a text of a table: a person reads no more, and a damaged file may have megabytes.
const MOST: usize = 400;

/// Most characters of a value that the recording says of itself, such as a list of columns.
const MOST_OF_A_VALUE: usize = 2000;

/// Most alarms that are named at the beginning.
const MAX_WORST: usize = 5;

/// Heading, when and where from, and links to the parts.
pub fn header(flight: &Flight) -> Markup {
    html! {
        header {
            h1 { (short(&flight.title, MOST)) }
            @for line in &flight.lead { p { (short(line, MOST)) } }
            nav aria-label="Parts of the page" {
                a href="#summary" { "Summary" }
                @if !flight.map.track.is_empty() { a href="#track" { "Track" } }
                @for plot in flight.plots.iter().filter(|plot| !plot.is_empty()) { a href={ "#" (plot.id) } { (plain(&plot.title)) } }
                @if !flight.events.is_empty() { a href="#events" { "Events" } }
                @if !flight.requests.is_empty() { a href="#requests" { "Requests" } }
                a href="#about" { "Recording" }
            }
        }
    }
}

/// The flight in words and numbers, what went wrong first.
pub fn summary(flight: &Flight) -> Markup {
    let alarms = || {
        let events = flight.events.iter().enumerate();
        events.filter(|(_, event)| event.weight == Weight::Alarm)
    };
    let more = alarms().count().saturating_sub(MAX_WORST);
    html! {
        section aria-labelledby="summary" {
            h2 #summary { "Summary" }
            @for sentence in &flight.summary { p { (short(sentence, MOST)) } }
            @if alarms().next().is_some() {
                ul.worst.(Ink::Red.name()) {
                    @for (index, event) in alarms().take(MAX_WORST) {
                        li { a href={ "#t" (index + 1) } { (moment(event.at_s)) } " " (short(&event.text, MOST)) }
                    }
                    @if more > 0 { li { a href="#events" { (more) " more alarms" } } }
                }
            }
            @if !flight.facts.is_empty() {
                dl.facts { @for (name, value) in &flight.facts { div { dt { (short(name, MOST)) } dd { (short(value, MOST)) } } } }
            }
            @if !flight.remarks.is_empty() { ul.remarks { @for remark in &flight.remarks { li { (short(remark, MOST)) } } } }
        }
    }
}

/// The values of the plots as a table: for those who do not see the plots, and for print.
pub fn values(flight: &Flight) -> Markup {
    let curves = || {
        let plots = flight.plots.iter();
        plots.flat_map(|plot| plot.curves.iter().map(move |curve| (plot, curve)))
    };
    let rows = curves().filter_map(|(plot, curve)| {
        let values = match &curve.data {
            Data::Line(values) | Data::Dashes(values) => values,
            Data::Bars(_) => return None,
        };
        let (least, greatest) = values.range()?;
        let (first, last) = values.ends()?;
        let name = format!("{}: {}", plain(&plot.title), plain(&curve.name));
        Some((name, plot.unit, [least, greatest, first.value, last.value]))
    });
    let rows: Vec<_> = rows.collect();
    html! {
        @if !rows.is_empty() {
            details {
                summary { "The values as a table" }
                .scroll {
                    table {
                        caption { "Values of the plots" }
                        thead { tr {
                            th scope="col" { "Value" } th scope="col" { "Unit" }
                            @for name in ["Least", "Greatest", "First", "Last"] { th.number scope="col" { (name) } }
                        } }
                        tbody { @for (name, unit, values) in rows { tr {
                            th scope="row" { (name) } td { (unit) }
                            @for value in values { td.number { (number(value)) } }
                        } } }
                    }
                }
            }
        }
    }
}

/// What happened, each with a link to its time in the plots.
pub fn events(flight: &Flight) -> Markup {
    html! {
        section.events aria-labelledby="events" {
            h2 #events { "Events" }
            @if flight.events.is_empty() { p { "The recording tells of none." } }
            @else {
                p { "A time leads to the plots, where a line marks it; a line of a plot leads to its row here." }
                table {
                    thead { tr {
                        th.number scope="col" { "#" }
                        th scope="col" { "Time" }
                        @if flight.start_unix_ns.is_some() { th.spare scope="col" { "UTC" } }
                        th scope="col" { "Kind" } th scope="col" { "What happened" }
                    } }
                    tbody { @for (index, event) in flight.events.iter().enumerate() { (event_row(flight, index + 1, event)) } }
                }
            }
            @if flight.events_left_out > 0 {
                p { "Of kinds that came too often, " (flight.events_left_out) " more events are not shown." }
            }
        }
    }
}

fn event_row(flight: &Flight, number: usize, event: &Event) -> Markup {
    html! {
        tr id={ "e" (number) } {
            td.number { (number) }
            td.time { a href={ "#t" (number) } { (moment(event.at_s)) } }
            @if let Some(start_ns) = flight.start_unix_ns { td.time.spare { (day_time(start_ns, event.at_s)) } }
            td { span.weight.(weight_ink(event.weight).name()) { (event.weight.name()) } }
            td { (short(&event.text, MOST)) }
        }
    }
}

/// What the helicopter was asked for.
pub fn requests(flight: &Flight) -> Markup {
    html! {
        @if !flight.requests.is_empty() {
            section aria-labelledby="requests" {
                h2 #requests { "Requests" }
                table {
                    thead { tr {
                        th scope="col" { "Time" } th scope="col" { "Request" } th.spare scope="col" { "Sender" }
                        th scope="col" { "Outcome" } th.number.spare scope="col" { "Took" }
                    } }
                    tbody { @for (index, request) in flight.requests.iter().enumerate() { (request_row(index + 1, request)) } }
                }
            }
        }
    }
}

fn request_row(number: usize, request: &Request) -> Markup {
    let ink = match request.outcome {
        Outcome::Done => Ink::Green,
        Outcome::Refused | Outcome::Aborted => Ink::Red,
        Outcome::Open => Ink::Grey,
    };
    let took = request
        .to_s
        .map(|to_s| moment((to_s - request.from_s).max(0.0)));
    html! {
        tr id={ "q" (number) } {
            td.time { (moment(request.from_s)) }
            td { (short(&request.name, MOST)) }
            td.spare { (short(&request.sender, MOST)) }
            td {
                span.weight.(ink.name()) { (request.outcome.name()) }
                @if !request.reason.is_empty() { ": " (short(&request.reason, MOST)) }
            }
            td.number.spare { (took.unwrap_or_default()) }
        }
    }
}

/// What the recording says of itself.
pub fn about(flight: &Flight) -> Markup {
    html! {
        section aria-labelledby="about" {
            h2 #about { "Recording" }
            @if flight.metadata.is_empty() { p { "It says nothing of itself." } }
            @for table in &flight.metadata {
                table.meta {
                    caption { (short(&table.title, MOST)) }
                    tbody { @for (name, value) in &table.rows { tr { th scope="row" { (short(name, MOST)) } td { (short(value, MOST_OF_A_VALUE)) } } } }
                }
            }
        }
    }
}
