//! Latencies as bars in an SVG, which the library `plotters` draws: the median, a line to the 99th percentile, and a
//! dot at the 99.9th, on a logarithmic axis.

use anyhow::{Result, anyhow};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width of the picture, height of a row, and room for the title and the axis, pixels.
const WIDTH: u32 = 860;
const ROW: u32 = 30;
const HEAD: u32 = 90;

/// The RIL's own ways, other ways, and what lies beyond the median.
const OURS: RGBColor = RGBColor(0x1f, 0x5f, 0xa8);
const OTHERS: RGBColor = RGBColor(0x88, 0x88, 0x88);
const BEYOND: RGBColor = RGBColor(0x55, 0x55, 0x55);

/// A way, in the order from top to bottom.
pub struct Bar {
    /// What stands on the left.
    pub name: String,
    /// Ours have a colour of their own.
    pub is_ours: bool,
    /// Median, 99th and 99.9th percentile, µs.
    pub us: [f64; 3],
}

/// The picture.
///
/// # Errors
/// The library cannot draw it.
pub fn svg(title: &str, bars: &[Bar]) -> Result<String> {
    let mut text = String::new();
    let values = || bars.iter().flat_map(|bar| bar.us);
    let least = values().fold(f64::INFINITY, f64::min).clamp(0.01, 1.0) / 2.0;
    let most = values().fold(10.0, f64::max) * 1.5;
    let height = HEAD + ROW * bars.len() as u32;
    let root = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE).map_err(failed)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(35)
        .y_label_area_size(170)
        .build_cartesian_2d((least..most).log_scale(), 0.4..bars.len() as f64 + 0.6)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .x_desc("µs, logarithmic; bar: median, line: to the 99th percentile, dot: 99.9th")
        .draw()
        .map_err(failed)?;
    // Rows count from the bottom.
    let rows = || {
        bars.iter().enumerate().map(|(index, bar)| {
            let us = bar.us.map(|us| us.max(least));
            (bar, us, (bars.len() - index) as f64)
        })
    };
    let boxes = rows().map(|(bar, [p50, ..], y)| {
        let colour = if bar.is_ours { OURS } else { OTHERS };
        Rectangle::new([(least, y - 0.3), (p50, y + 0.3)], colour.filled())
    });
    chart.draw_series(boxes).map_err(failed)?;
    let lines = rows().map(|(_, [p50, p99, _], y)| PathElement::new([(p50, y), (p99, y)], BEYOND));
    chart.draw_series(lines).map_err(failed)?;
    let dots = rows().map(|(_, [.., p999], y)| Circle::new((p999, y), 2, BEYOND.filled()));
    chart.draw_series(dots).map_err(failed)?;
    let right = Pos::new(HPos::Right, VPos::Center);
    let names = rows().map(|(bar, [p50, ..], y)| {
        let style = ("sans-serif", 12).into_font().color(&BLACK).pos(right);
        let name = format!("{}  {p50:.1}", bar.name);
        EmptyElement::at((least, y)) + Text::new(name, (-8, 0), style)
    });
    chart.draw_series(names).map_err(failed)?;
    root.present().map_err(failed)?;
    drop(chart);
    drop(root);
    Ok(text)
}

fn failed(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("{error}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_is_drawn() {
        let bar = |p50: f64| Bar {
            name: format!("way {p50} < b"),
            is_ours: p50 < 1.0,
            us: [p50, p50 * 2.0, p50 * 3.0],
        };
        for values in [&[0.9, 12.0, 50.0] as &[f64], &[0.0], &[]] {
            let bars: Vec<Bar> = values.iter().map(|p50| bar(*p50)).collect();
            let svg = svg("a & b", &bars).unwrap();
            assert_eq!(svg.matches("<circle").count(), values.len());
            assert_eq!(svg.matches("&lt; b").count(), values.len());
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
    }
}
