//! The page: one HTML file that needs nothing else.
//!
//! * here: its outline; [`sections`]: summary, tables; [`figures`]: plots with their marks; [`style`]: the style sheet.
//!
//! `maud` writes the elements and escapes every text. The page holds no script, and its policy forbids every one.

mod alt;
mod figures;
mod sections;
mod style;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::flight::Flight;
use crate::plot::DrawError;
use crate::text::plain;

/// Nothing may be loaded, sent or run.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// The report of `flight` as a page.
///
/// # Errors
///
/// None that depends on values.
pub fn page(flight: &Flight) -> Result<String, DrawError> {
    let track = figures::track(flight)?;
    let timeline = figures::timeline(flight)?;
    let plots = figures::plots(flight)?;
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="color-scheme" content="light dark";
                title { (plain(&flight.title)) }
                style { (PreEscaped(style::sheet(flight.events.len()))) }
            }
            body {
                (sections::header(flight))
                main {
                    (sections::summary(flight))
                    (track)
                    (anchors(flight))
                    section.plots aria-labelledby="over-time" {
                        h2 #over-time { "Over time" }
                        (timeline)
                        (plots)
                        (sections::values(flight))
                    }
                    (sections::events(flight))
                    (sections::requests(flight))
                    (sections::about(flight))
                }
                footer { "Times without a date count from the first sample of the recording. Made by the HERO RIL; the page loads nothing and runs nothing." }
            }
        }
    };
    Ok(markup.into_string())
}

/// Where links to a time lead: above the plots, in all of which the time is then marked.
fn anchors(flight: &Flight) -> Markup {
    html! {
        @for index in 0..flight.events.len() { span.jump id={ "t" (index + 1) } {} }
    }
}
