//! The plots of a flight as SVG files of their own, for papers.

use super::canvas::{DrawError, Drawing, Look};
use super::colour::{PAGE, hex};
use super::{lanes, map, time};
use crate::flight::Flight;
use crate::text;

/// A plot as a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Paper {
    /// Its name, without the ending.
    pub name: &'static str,
    /// The SVG, black on white.
    pub svg: String,
}

/// The plots that have values: `track`, `timeline`, and one for each plot by its [`id`](crate::flight::Plot::id).
///
/// # Errors
///
/// None that depends on values.
pub fn papers(flight: &Flight) -> Result<Vec<Paper>, DrawError> {
    let mut papers = Vec::new();
    let mut add = |name: &'static str, title: &str, drawing: &Drawing| {
        papers.push(Paper {
            name,
            svg: file(&format!("{}: {title}", flight.title), drawing),
        });
    };
    if let Some(drawing) = map::draw(flight, Look::Paper)? {
        add("track", "track", &drawing);
    }
    if !lanes::lanes(flight).is_empty() {
        add(
            "timeline",
            "phases and states",
            &lanes::draw(flight, Look::Paper)?,
        );
    }
    for plot in flight.plots.iter().filter(|plot| !plot.is_empty()) {
        add(
            plot.id,
            &plot.title,
            &time::draw(flight, plot, Look::Paper)?,
        );
    }
    Ok(papers)
}

fn file(title: &str, drawing: &Drawing) -> String {
    let [width, height] = drawing.size;
    let title = maud::html! { (text::plain(title)) }.into_string();
    let page = hex(PAGE.paper);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{}\" height=\"{}\" role=\"img\">\n\
         <title>{title}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"{page}\"/>\n{}\n</svg>\n",
        width / 2,
        height / 2,
        drawing.body
    )
}
