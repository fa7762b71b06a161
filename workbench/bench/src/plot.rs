//! Bars as SVG: for each row and series the median, a line to the 99th percentile and a dot at the 99.9th, on a
//! logarithmic axis. Pure text; readable in a dark page as well, because it brings its own ground.

use std::fmt::Write;

use crate::setting::Setting;
use crate::statistics::Times;

/// Width of the picture, of the names on its left and of the margin on its right, pixels.
const WIDTH: f64 = 860.0;
const NAMES: f64 = 210.0;
const MARGIN: f64 = 90.0;
/// Height of a bar, gap between rows, room above and below the bars, pixels.
const BAR: f64 = 12.0;
const GAP: f64 = 10.0;
const HEAD: f64 = 62.0;
const FOOT: f64 = 34.0;

/// A bar's three values, in the unit of the plot.
#[derive(Clone, Copy, Debug)]
pub struct Bar {
    /// End of the bar, also written on the right.
    pub p50: f64,
    /// End of the line.
    pub p99: f64,
    /// Place of the dot.
    pub p999: f64,
}

/// A row: one bar for each series, or nothing where it was not measured.
pub struct Row {
    /// What stands on the left.
    pub name: String,
    /// Ours are drawn in another colour.
    pub is_ours: bool,
    /// One for each series.
    pub bars: Vec<Option<Bar>>,
}

/// A whole plot.
pub struct Plot {
    /// First line.
    pub title: String,
    /// Second line: unit and meaning.
    pub subtitle: String,
    /// Names of the series; more than two cannot be told apart by their shade.
    pub series: Vec<String>,
    /// From top to bottom.
    pub rows: Vec<Row>,
}

impl Bar {
    /// The bar of `times`, µs; none when nothing was measured.
    fn of(times: &Times) -> Option<Bar> {
        (times.count() > 0).then(|| Bar {
            p50: times.p50_ns() / 1000.0,
            p99: times.quantile_ns(0.99) / 1000.0,
            p999: times.quantile_ns(0.999) / 1000.0,
        })
    }
}

impl Plot {
    /// Latencies, µs: a row for each of `cases`, of which `row` says the name and whether it is ours, and a series for each
    /// of `rates`, Hz.
    pub fn of_latencies<C: Copy>(
        title: &str,
        settings: &[Setting],
        cases: &[C],
        row: impl Fn(C) -> (&'static str, bool),
        times: impl Fn(C, Setting) -> Times,
    ) -> Plot {
        let rows = cases.iter().map(|case| {
            let (name, is_ours) = row(*case);
            let bars = settings
                .iter()
                .map(|setting| Bar::of(&times(*case, *setting)));
            Row {
                name: name.to_owned(),
                is_ours,
                bars: bars.collect(),
            }
        });
        Plot {
            title: title.to_owned(),
            subtitle: "µs, logarithmic; bar: median, line: to the 99th percentile, dot: 99.9th"
                .to_owned(),
            series: settings.iter().map(Setting::to_string).collect(),
            rows: rows.collect(),
        }
    }

    /// The plot as a file.
    pub fn to_svg(&self) -> String {
        let row_height = BAR * self.series.len() as f64 + GAP;
        let bottom = HEAD + row_height * self.rows.len() as f64;
        let axis = Axis::around(self.values());
        let mut svg = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="12" fill="#222">
<rect width="{WIDTH}" height="{height}" fill="#fff"/>
<text x="12" y="22" font-size="15" font-weight="bold">{}</text>
<text x="12" y="40" fill="#555">{}</text>"##,
            escape(&self.title),
            escape(&self.subtitle),
            height = bottom + FOOT,
        );
        self.write_axis(&mut svg, &axis, bottom);
        for (index, row) in self.rows.iter().enumerate() {
            write_row(&mut svg, row, &axis, HEAD + row_height * index as f64);
        }
        svg.push_str("</svg>\n");
        svg
    }

    fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let bars = self.rows.iter().flat_map(|row| row.bars.iter().flatten());
        bars.flat_map(|bar| [bar.p50, bar.p99, bar.p999])
    }

    fn write_axis(&self, svg: &mut String, axis: &Axis, bottom: f64) {
        for tick in axis.ticks() {
            let x = axis.place(tick);
            let _ = writeln!(
                svg,
                r##"<line x1="{x:.1}" y1="{}" x2="{x:.1}" y2="{bottom:.1}" stroke="#ddd"/><text x="{x:.1}" y="{:.1}" text-anchor="middle" fill="#555">{tick}</text>"##,
                HEAD - 6.0,
                bottom + 16.0,
            );
        }
        let _ = writeln!(
            svg,
            r##"<text x="{:.1}" y="{:.1}" font-size="10" text-anchor="end" fill="#555">p50</text>"##,
            WIDTH - MARGIN + 40.0,
            HEAD - 6.0,
        );
        for (index, name) in self.series.iter().enumerate() {
            let x = WIDTH - MARGIN - 190.0 * (self.series.len() - index) as f64 + MARGIN - 12.0;
            let _ = writeln!(
                svg,
                r##"<rect x="{x:.1}" y="14" width="12" height="10" fill="{}"/><text x="{:.1}" y="23">{}</text>"##,
                colour(false, index),
                x + 17.0,
                escape(name),
            );
        }
    }
}

fn write_row(svg: &mut String, row: &Row, axis: &Axis, top: f64) {
    let middle = top + BAR * row.bars.len() as f64 / 2.0 + 4.0;
    let weight = if row.is_ours { "bold" } else { "normal" };
    let _ = writeln!(
        svg,
        r#"<text x="{:.1}" y="{middle:.1}" text-anchor="end" font-weight="{weight}">{}</text>"#,
        NAMES - 8.0,
        escape(&row.name),
    );
    for (index, bar) in row.bars.iter().enumerate() {
        let Some(bar) = bar else { continue };
        let y = top + BAR * index as f64;
        let (left, p50) = (axis.place(axis.least), axis.place(bar.p50));
        let (p99, p999) = (axis.place(bar.p99), axis.place(bar.p999));
        let centre = y + BAR / 2.0;
        let fill = colour(row.is_ours, index);
        let _ = writeln!(
            svg,
            r##"<rect x="{left:.1}" y="{:.1}" width="{:.1}" height="{:.1}" fill="{fill}"/><line x1="{p50:.1}" y1="{centre:.1}" x2="{p99:.1}" y2="{centre:.1}" stroke="#666"/><circle cx="{p999:.1}" cy="{centre:.1}" r="2" fill="#666"/><text x="{:.1}" y="{:.1}" font-size="10" text-anchor="end">{}</text>"##,
            y + 1.0,
            (p50 - left).max(1.0),
            BAR - 2.0,
            WIDTH - MARGIN + 40.0,
            centre + 3.5,
            figure(bar.p50),
        );
    }
}

/// A logarithmic axis in whole steps of 1, 2, 5.
struct Axis {
    least: f64,
    most: f64,
}

impl Axis {
    /// The axis on which all positive ones of `values` have a place.
    fn around(values: impl Iterator<Item = f64>) -> Axis {
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for value in values.filter(|value| *value > 0.0) {
            least = least.min(value);
            most = most.max(value);
        }
        if most == 0.0 {
            return Axis {
                least: 1.0,
                most: 10.0,
            };
        }
        let below = steps().take_while(|step| *step < least).last();
        let above = steps().find(|step| *step > most);
        Axis {
            least: below.unwrap_or(least),
            most: above.unwrap_or(most),
        }
    }

    fn place(&self, value: f64) -> f64 {
        let share = (value.max(self.least) / self.least).ln() / (self.most / self.least).ln();
        NAMES + share.min(1.0) * (WIDTH - NAMES - MARGIN)
    }

    fn ticks(&self) -> impl Iterator<Item = f64> + '_ {
        steps().filter(|step| (self.least..=self.most).contains(step))
    }
}

/// 0.01, 0.02, 0.05, 0.1 … far enough for any time or rate.
fn steps() -> impl Iterator<Item = f64> {
    (-2..8).flat_map(|exponent: i32| {
        // Divided, not multiplied by a negative power, so that 0.1 is written as 0.1.
        [1.0, 2.0, 5.0].map(|digit| match exponent {
            negative if negative < 0 => digit / 10_f64.powi(-negative),
            positive => digit * 10_f64.powi(positive),
        })
    })
}

/// Blue shades for ours, grey ones for the others; the second series is lighter.
fn colour(is_ours: bool, series: usize) -> &'static str {
    match (is_ours, series) {
        (true, 0) => "#1f5fa8",
        (true, _) => "#8db8e6",
        (false, 0) => "#777",
        (false, _) => "#bbb",
    }
}

fn figure(value: f64) -> String {
    match value {
        value if value < 10.0 => format!("{value:.1}"),
        value => format!("{value:.0}"),
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(values: &[f64]) -> Plot {
        let bar = |p50| Bar {
            p50,
            p99: p50 * 2.0,
            p999: p50 * 3.0,
        };
        Plot {
            title: "a < b".to_owned(),
            subtitle: String::new(),
            series: vec!["1 kHz".to_owned(), "100 Hz".to_owned()],
            rows: values
                .iter()
                .map(|value| Row {
                    name: format!("row {value}"),
                    is_ours: false,
                    bars: vec![Some(bar(*value)), None],
                })
                .collect(),
        }
    }

    #[test]
    fn every_row_and_measured_bar_is_drawn() {
        let svg = plot(&[0.9, 12.0, 50.0]).to_svg();
        assert_eq!(svg.matches("<circle").count(), 3);
        assert!(svg.contains("row 12") && svg.contains("a &lt; b"));
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn the_axis_reaches_from_below_the_least_to_above_the_most() {
        let axis = Axis::around([0.9, 30.0, 150.0].into_iter());
        assert_eq!((axis.least, axis.most), (0.5, 200.0));
        let ticks: Vec<_> = axis.ticks().collect();
        assert_eq!(ticks, [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0]);
        assert!(axis.place(0.5) < axis.place(0.9));
        assert!(axis.place(1e9) <= WIDTH - MARGIN);
    }

    #[test]
    fn nothing_measured_is_no_reason_to_fail() {
        assert!(!plot(&[]).to_svg().contains("NaN"));
        assert!(!plot(&[0.0]).to_svg().contains("NaN"));
    }
}
