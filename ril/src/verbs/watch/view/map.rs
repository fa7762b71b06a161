//! Draws the map: north up, as many metres to a line as to two characters.

use operator::robot::chart::ChartArea;
use operator::robot::geo::{Place, offset_m};
use operator::robot::model::WatchedRobot;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::{Marker, border};
use ratatui::text::Span;
use ratatui::widgets::canvas::{Canvas, Line};
use ratatui::widgets::{Block, Widget};

use super::pen::{Glyphs, OLD, TITLE, put};
use crate::verbs::watch::app::{App, Zoom};

/// Least width and height of what is shown, m: a robot that stands still is not drawn larger than its error.
const LEAST_SPAN_M: f64 = 20.0;

/// Width of what is shown of a robot's surroundings, m.
const NEAR_M: f64 = 50.0;

/// How much wider than its content the map is.
const MARGIN: f64 = 1.15;

/// A line of a frame for consoles that have nothing but ASCII.
const ASCII_BORDER: border::Set<'static> = border::Set {
    top_left: "+",
    top_right: "+",
    bottom_left: "+",
    bottom_right: "+",
    vertical_left: "|",
    vertical_right: "|",
    horizontal_top: "-",
    horizontal_bottom: "-",
};

/// A part of the map, metres east and north of its origin.
struct Extent {
    east_m: [f64; 2],
    north_m: [f64; 2],
}

impl Extent {
    /// What shows all `points`, as an area of this many characters.
    fn around(points: &[(f64, f64)], width: u16, height: u16) -> Extent {
        let (mut least, mut most) = ((0.0_f64, 0.0_f64), (0.0_f64, 0.0_f64));
        if let Some(first) = points.first() {
            (least, most) = (*first, *first);
        }
        for (east, north) in points {
            least = (least.0.min(*east), least.1.min(*north));
            most = (most.0.max(*east), most.1.max(*north));
        }
        let (columns, rows) = (f64::from(width.max(1)), f64::from(height.max(1)) * 2.0);
        let span = |least: f64, most: f64| (most - least).max(LEAST_SPAN_M) * MARGIN;
        // A line is as high as two characters are wide.
        let metres = (span(least.0, most.0) / columns).max(span(least.1, most.1) / rows);
        let middle = ((least.0 + most.0) / 2.0, (least.1 + most.1) / 2.0);
        let (half_width, half_height) = (columns * metres / 2.0, rows * metres / 2.0);
        Extent {
            east_m: [middle.0 - half_width, middle.0 + half_width],
            north_m: [middle.1 - half_height, middle.1 + half_height],
        }
    }
}

/// Draws the map of the robot in detail.
pub(super) fn draw(app: &App, glyphs: Glyphs, area: Rect, buffer: &mut Buffer) {
    let robot = app.robot();
    let set = glyphs.pick(border::PLAIN, ASCII_BORDER);
    let block = Block::bordered().border_set(set).border_style(OLD);
    let inner = block.inner(area);
    let last = robot.last_place.map(|(place, _)| place);
    let origin = robot.pilot.place.or(last);
    let origin = origin.or_else(|| app.path().first().copied());
    let Some(origin) = origin else {
        block.title("map").render(area, buffer);
        put(buffer, inner, 1, "no position yet", OLD);
        return;
    };
    let extent = Extent::around(&shown(app, origin), inner.width, inner.height);
    let wide_m = extent.east_m[1] - extent.east_m[0];
    let title = format!(" {}: {wide_m:.0} m wide, north up ", app.zoom.name());
    let (dot, dots) = (glyphs.pick("·", "."), glyphs.pick("⠶", "*"));
    let is_of_file = robot.held.is_none() && !app.chart.fence.is_empty();
    let legend = match (is_of_file, robot.is_held_outdated()) {
        (true, _) => format!(" #x fence of file {dot} path {dots} track "),
        // The pieces of the one that holds are on their way.
        (_, true) => format!(" #x fence ? {dot} path ? {dots} track "),
        _ => format!(" #x fence {dot} path {dots} track H home "),
    };
    block
        .title(Span::styled(title, TITLE))
        .title_bottom(Span::styled(legend, OLD))
        .render(area, buffer);
    let mut sheet = Sheet {
        origin,
        extent,
        inner,
        buffer,
    };
    sheet.chart(app, glyphs);
    sheet.track(robot, glyphs);
    sheet.marks(app, glyphs);
}

/// The places that the map must show.
fn shown(app: &App, origin: Place) -> Vec<(f64, f64)> {
    let robot = app.robot();
    let last = robot.last_place.map(|(place, _)| place);
    let here = robot.pilot.place.or(last).unwrap_or(origin);
    let (east, north) = offset_m(origin, here);
    if app.zoom == Zoom::Near {
        let half = NEAR_M / 2.0;
        return vec![(east - half, north - half), (east + half, north + half)];
    }
    let mut places: Vec<Place> = vec![here];
    places.extend(robot.home.map(|home| home.place));
    places.extend(robot.track.points());
    places.extend(app.path());
    if app.zoom == Zoom::Fence {
        places.extend(app.fence().iter().flat_map(corners));
    }
    places
        .iter()
        .map(|place| offset_m(origin, *place))
        .collect()
}

fn corners(area: &ChartArea) -> impl Iterator<Item = Place> {
    let corner =
        |[latitude_deg, longitude_deg]: &[f64; 2]| Place::new(*latitude_deg, *longitude_deg);
    area.corners.iter().filter_map(corner)
}

/// The inside of the map's frame, and which part of the world it shows.
struct Sheet<'a> {
    origin: Place,
    extent: Extent,
    inner: Rect,
    buffer: &'a mut Buffer,
}

impl Sheet<'_> {
    /// Fence and path, which lie below all else.
    fn chart(&mut self, app: &App, glyphs: Glyphs) {
        for area in app.fence() {
            let (letter, colour) = match area.inclusion {
                true => ("#", Color::Yellow),
                false => ("x", Color::Red),
            };
            let mut closed: Vec<Place> = corners(area).collect();
            closed.extend(closed.first().copied());
            self.lines(&closed, Some(letter), colour);
        }
        self.lines(app.path(), Some(glyphs.pick("·", ".")), Color::Cyan);
    }

    fn track(&mut self, robot: &WatchedRobot, glyphs: Glyphs) {
        let letter = glyphs.pick(None, Some("*"));
        for piece in robot.track.pieces() {
            self.lines(piece, letter, Color::Green);
        }
    }

    /// Joins `places`: with `letter`, or without one with Braille dots.
    fn lines(&mut self, places: &[Place], letter: Option<&str>, colour: Color) {
        let at = |place: &Place| offset_m(self.origin, *place);
        let points: Vec<(f64, f64)> = places.iter().map(at).collect();
        let canvas = Canvas::default()
            .marker(Marker::Braille)
            .x_bounds(self.extent.east_m)
            .y_bounds(self.extent.north_m)
            .paint(|context| {
                for leg in points.windows(2) {
                    context.draw(&line(leg[0], leg[1], colour));
                }
            });
        // Letters stand where dots would: so all lines are drawn to the same grid.
        let mut dots = Buffer::empty(self.inner);
        canvas.render(self.inner, &mut dots);
        for position in self.inner.positions() {
            let symbol = dots[position].symbol();
            if symbol != " " && symbol != "\u{2800}" {
                let cell = &mut self.buffer[position];
                cell.set_symbol(letter.unwrap_or(symbol));
                cell.set_style(Style::new().fg(colour));
            }
        }
    }

    /// Take-off, waypoints, and the robot itself.
    fn marks(&mut self, app: &App, glyphs: Glyphs) {
        let robot = app.robot();
        let waypoint = Style::new().fg(Color::Cyan).add_modifier(Modifier::BOLD);
        if let Some(home) = robot.home {
            self.mark(&home.place, "H", TITLE);
        }
        for place in &robot.reached {
            self.mark(place, "o", waypoint);
        }
        for (index, place) in app.path().iter().enumerate() {
            self.mark(place, &(index + 1).to_string(), waypoint);
        }
        let pilot = &robot.pilot;
        if let Some(place) = pilot.place {
            let direction = pilot.heading_deg.or(pilot.course_deg);
            let style = Style::new()
                .fg(Color::Magenta)
                .add_modifier(Modifier::BOLD)
                .add_modifier(Modifier::REVERSED);
            self.mark(&place, arrow(direction, glyphs), style);
        } else if let Some((place, _)) = robot.last_place {
            self.mark(
                &place,
                glyphs.pick("◌", "?"),
                Style::new().fg(Color::Magenta),
            );
        }
    }

    /// Writes `text` where the dot of `place` would be.
    fn mark(&mut self, place: &Place, text: &str, style: Style) {
        let (east, north) = offset_m(self.origin, *place);
        let dot = |value: f64, bounds: [f64; 2], dots: u16| {
            let part = (value - bounds[0]) / (bounds[1] - bounds[0]);
            (0.0..=1.0)
                .contains(&part)
                .then(|| (part * (f64::from(dots) - 1.0)).round() as u16)
        };
        let (width, height) = (self.inner.width, self.inner.height);
        let from_top = [-self.extent.north_m[1], -self.extent.north_m[0]];
        let column = dot(east, self.extent.east_m, width.saturating_mul(2));
        let row = dot(-north, from_top, height.saturating_mul(4));
        if let (Some(column), Some(row)) = (column, row) {
            let row = Rect {
                y: self.inner.y + row / 4,
                height: 1,
                ..self.inner
            };
            put(self.buffer, row, column / 2, text, style);
        }
    }
}

fn line(from: (f64, f64), to: (f64, f64), color: Color) -> Line {
    Line {
        x1: from.0,
        y1: from.1,
        x2: to.0,
        y2: to.1,
        color,
    }
}

/// An arrow in one of eight directions; a letter when the direction is not known.
fn arrow(direction_deg: Option<f64>, glyphs: Glyphs) -> &'static str {
    const ARROWS: [&str; 8] = ["↑", "↗", "→", "↘", "↓", "↙", "←", "↖"];
    let Some(direction_deg) = direction_deg.filter(|_| glyphs == Glyphs::Unicode) else {
        return "@";
    };
    let eighth = (direction_deg.rem_euclid(360.0) / 45.0).round() as usize;
    ARROWS[eighth % ARROWS.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_shows_all_and_is_as_wide_as_it_is_high() {
        let extent = Extent::around(&[(0.0, 0.0), (100.0, 10.0)], 40, 10);
        let wide = extent.east_m[1] - extent.east_m[0];
        let high = extent.north_m[1] - extent.north_m[0];
        assert!((wide - 115.0).abs() < 1e-9 && (high - 57.5).abs() < 1e-9);
        let point = Extent::around(&[(5.0, 5.0)], 40, 20);
        assert!((point.east_m[1] - point.east_m[0] - 23.0).abs() < 1e-9);
    }

    #[test]
    fn the_robot_points_to_where_it_flies() {
        for (direction, expected) in [
            (Some(0.0), "↑"),
            (Some(90.0), "→"),
            (Some(359.0), "↑"),
            (Some(-90.0), "←"),
            (None, "@"),
        ] {
            assert_eq!(arrow(direction, Glyphs::Unicode), expected);
        }
        assert_eq!(arrow(Some(90.0), Glyphs::Ascii), "@");
    }
}
