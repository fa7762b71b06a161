//! The frame of a plot: its size, its axes, and the SVG that comes out.

use std::ops::Range;

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::prelude::SVGBackend;
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, TextStyle};

use super::axis::Axis;
use super::colour::{AXIS, GRID, TEXT};

/// The drawing library failed, which it does for no [`Flight`](crate::Flight): it is an error of this program.
#[derive(Debug, thiserror::Error)]
#[error("a plot cannot be drawn: {0}")]
pub struct DrawError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for DrawError {
    fn from(error: DrawingAreaErrorKind<E>) -> DrawError {
        DrawError(error.to_string())
    }
}

/// What the plot is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// A page on a wide screen, or printed.
    Wide,
    /// A page on a telephone.
    Narrow,
    /// A file of its own, with all that a page says around a plot.
    Paper,
}

/// Units of the drawing for each pixel of the page: the library draws with integers, and so lines are smooth.
const UNITS: u32 = 2;

/// How much larger the library takes fonts than it writes them.
const FONT_FACTOR: f64 = 1.24;

impl Look {
    /// Width, pixels.
    pub fn width(self) -> u32 {
        match self {
            Look::Wide | Look::Paper => 960,
            Look::Narrow => 360,
        }
    }

    /// Height of a plot that is as high as others are, pixels.
    pub fn height(self) -> u32 {
        match self {
            Look::Wide => 250,
            Look::Narrow => 210,
            Look::Paper => 320,
        }
    }

    /// Columns of values: more than the eye tells apart.
    pub fn columns(self) -> usize {
        match self {
            Look::Wide | Look::Paper => 800,
            Look::Narrow => 300,
        }
    }

    /// Most ticks on the time axis.
    pub fn time_ticks(self) -> usize {
        match self {
            Look::Wide | Look::Paper => 12,
            Look::Narrow => 5,
        }
    }

    /// Size of the letters, pixels.
    pub fn letters(self) -> u32 {
        match self {
            Look::Wide => 14,
            Look::Narrow => 12,
            Look::Paper => 15,
        }
    }

    /// Space for what stands left of the axis, pixels.
    fn left(self) -> u32 {
        match self {
            Look::Wide => 74,
            Look::Narrow => 62,
            Look::Paper => 78,
        }
    }
}

/// Pixels of the page as units of the drawing.
pub const fn units(pixels: u32) -> u32 {
    pixels * UNITS
}

/// The area in which values are drawn, in which both axes are numbers.
pub type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<Coordinate, Coordinate>>;

/// An axis as the library takes it: linear, with the ticks of ours.
pub struct Coordinate {
    line: RangedCoordf64,
    ticks: Vec<f64>,
}

impl Coordinate {
    fn of(axis: &Axis) -> Coordinate {
        Coordinate {
            line: (axis.from..axis.to).into(),
            ticks: axis.ticks.clone(),
        }
    }
}

impl Ranged for Coordinate {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.line.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match hint.weight().allow_light_points() {
            true => Vec::new(),
            false => self.ticks.clone(),
        }
    }

    fn range(&self) -> Range<f64> {
        self.line.range()
    }
}

/// What a plot is drawn into.
pub type Root<'b> = DrawingArea<SVGBackend<'b>, Shift>;

/// The axes of a plot and its size.
pub struct Frame {
    /// What it is for.
    pub look: Look,
    /// Height, pixels.
    pub height: u32,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// What the axes say: to the right, upwards; may be empty.
    pub names: [String; 2],
}

/// A plot that was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Width and height, units.
    pub size: [u32; 2],
    /// What stands inside of the SVG element.
    pub body: String,
    /// Left, right, top, bottom of the area in which values lie, units.
    pub area: [i32; 4],
}

impl Frame {
    /// Draws the plot: `below` what lies below the grid, `above` what lies above it.
    ///
    /// # Errors
    ///
    /// None that depends on values.
    pub fn draw(
        &self,
        below: impl FnOnce(&mut Chart<'_>) -> Result<(), DrawError>,
        above: impl FnOnce(&mut Chart<'_>) -> Result<(), DrawError>,
    ) -> Result<Drawing, DrawError> {
        let size = [units(self.look.width()), units(self.height)];
        let mut svg = String::new();
        let root: Root<'_> =
            SVGBackend::with_string(&mut svg, (size[0], size[1])).into_drawing_area();
        let letters = self.look.letters();
        let mut chart = ChartBuilder::on(&root)
            .margin_top(units(8))
            .margin_right(units(letters * 3 / 2))
            .x_label_area_size(units(
                letters * if self.names[0].is_empty() { 2 } else { 7 / 2 },
            ))
            .y_label_area_size(units(self.look.left()))
            .build_cartesian_2d(Coordinate::of(&self.x), Coordinate::of(&self.y))?;
        below(&mut chart)?;
        self.mesh(&mut chart)?;
        above(&mut chart)?;
        let (left, bottom) = chart.backend_coord(&(self.x.from, self.y.from));
        let (right, top) = chart.backend_coord(&(self.x.to, self.y.to));
        drop(chart);
        root.present()?;
        drop(root);
        Ok(Drawing {
            size,
            body: body(&svg).to_owned(),
            area: [left, right, top, bottom],
        })
    }

    fn mesh(&self, chart: &mut Chart<'_>) -> Result<(), DrawError> {
        let text = text_style(self.look, TEXT.paper);
        let line = |colour: RGBColor| colour.stroke_width(UNITS);
        let x = |value: &f64| self.x.label(*value);
        let y = |value: &f64| self.y.label(*value);
        let mut mesh = chart.configure_mesh();
        mesh.bold_line_style(line(GRID.paper))
            .axis_style(line(AXIS.paper))
            .label_style(text.clone())
            .axis_desc_style(text)
            .x_label_formatter(&x)
            .y_label_formatter(&y)
            .set_all_tick_mark_size(units(4));
        if !self.names[0].is_empty() {
            mesh.x_desc(self.names[0].as_str());
        }
        if self.look != Look::Narrow && !self.names[1].is_empty() {
            mesh.y_desc(self.names[1].as_str());
        }
        mesh.draw()?;
        Ok(())
    }
}

/// How texts in a plot are written.
pub fn text_style(look: Look, colour: RGBColor) -> TextStyle<'static> {
    sized_text_style(look.letters(), colour)
}

/// The same with letters of this size, pixels.
pub fn sized_text_style(letters: u32, colour: RGBColor) -> TextStyle<'static> {
    let size = f64::from(units(letters)) * FONT_FACTOR;
    ("sans-serif", size).into_font().color(&colour)
}

/// About how wide a text is, pixels.
pub fn text_width(letters: u32, text: &str) -> f64 {
    /// Of the letters of usual fonts.
    const MEAN: f64 = 0.54;
    text.chars().count() as f64 * f64::from(letters) * MEAN
}

/// A line of this width, pixels.
pub fn stroke(colour: RGBColor, width: f64) -> ShapeStyle {
    colour.stroke_width((width * f64::from(UNITS)).round() as u32)
}

/// What stands inside of the SVG element that the library writes.
fn body(svg: &str) -> &str {
    let begin = svg.find('>').map_or(0, |end| end + 1);
    let end = svg.rfind("</svg>").unwrap_or(svg.len());
    svg.get(begin..end).unwrap_or_default().trim()
}
