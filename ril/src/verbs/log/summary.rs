//! What a log says of a flight: [`Summarizer`] takes the rows one after the other and keeps none of them.

use std::fmt;

use serde::Serialize;
use status::log::clock::IsoTime;
use status::log::file_name::FileKind;

use super::recording::{Damage, Row};
use super::row::{UtcSource, UtcTimes};
use crate::render::words::{count, duration_with_tenths as duration};
use crate::robot::geo::{Place, distance_m};

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.LogSummary.v1";

/// Two rows with more between them than this have a gap: telemetry comes at least once a second, or is stale.
const GAP_NS: u64 = 1_000_000_000;

/// The way over ground is measured in steps of at least this length, m. The noise of a GPS moves a helicopter that hovers by
/// centimetres with each sample; shorter steps would add them up to a way.
const STEP_M: f64 = 1.0;

/// A step longer than this is none of a helicopter, m: a damaged number, or the next fix after a time without one.
const MAX_STEP_M: f64 = 1000.0;

/// A value at the beginning and the end, and its extreme between.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Course {
    /// The first one.
    pub first: f64,
    /// The last one.
    pub last: f64,
    /// The least one.
    pub min: f64,
}

/// What a log says of a flight. What its columns do not have is `None`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    schema: &'static str,
    /// The file.
    pub file: String,
    /// The robot, as the file's name says.
    pub robot: Option<u32>,
    /// Time of the first row, UTC.
    pub start_utc: Option<String>,
    /// Time of the last row, UTC.
    pub end_utc: Option<String>,
    /// Where the times come from: `column` or `file-name`.
    pub utc_source: Option<&'static str>,
    /// Rows.
    pub rows: u64,
    /// From the first row to the last, s.
    pub duration_s: f64,
    /// Time in the air, s.
    pub flight_s: f64,
    /// How often the helicopter took off.
    pub take_offs: u32,
    /// Way over ground in the air, m.
    pub distance_m: Option<f64>,
    /// Greatest telemetry altitude, m.
    pub max_altitude_m: Option<f64>,
    /// Greatest height over the place where the helicopter last stood before, m; `None` if it was in the air in all rows.
    pub max_height_m: Option<f64>,
    /// Greatest speed over ground, m/s.
    pub max_speed_mps: Option<f64>,
    /// Battery, V.
    pub battery_v: Option<Course>,
    /// Fuel, %.
    pub fuel_percent: Option<Course>,
    /// Samples that the bridge published and that are no row, by their numbers.
    pub lost_samples: u64,
    /// How often the bridge began anew.
    pub bridge_restarts: u32,
    /// Times of more than 1 s without a row.
    pub gaps: u32,
    /// The longest of them, s.
    pub longest_gap_s: f64,
    /// DSP errors that came during the log.
    pub dsp_errors: Option<u64>,
    /// Lines that are no rows.
    pub damaged_lines: u64,
    /// The first of them, in words.
    pub first_damage: Option<String>,
    /// Bytes of a last line without its end.
    pub unfinished_bytes: usize,
}

impl Summary {
    /// Whether every byte of the file belongs to a row.
    pub fn is_whole(&self) -> bool {
        self.damaged_lines == 0 && self.unfinished_bytes == 0
    }
}

/// The columns that a summary needs.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    latitude: Option<usize>,
    longitude: Option<usize>,
    altitude: Option<usize>,
    speed: Option<usize>,
    battery: Option<usize>,
    fuel: Option<usize>,
    dsp_errors: Option<usize>,
    quality: Option<usize>,
}

/// Makes a summary of rows.
pub struct Summarizer {
    summary: Summary,
    places: Places,
    times: UtcTimes,
    last: Option<Last>,
    /// Altitude where the helicopter stood last, m.
    ground_m: Option<f64>,
    /// The end of the last step of the way.
    step_from: Option<Place>,
    dsp_errors: Option<u64>,
}

/// The row before.
#[derive(Clone, Copy, Debug)]
struct Last {
    received_ns: u64,
    sequence: u64,
    flying: bool,
}

impl Summarizer {
    /// Begins with a file whose log has `columns` and takes its times from `source`.
    pub fn new(
        file: String,
        robot: Option<u32>,
        columns: &[String],
        source: UtcSource,
    ) -> Summarizer {
        let place = |name: &str| columns.iter().position(|column| column == name);
        Summarizer {
            summary: Summary {
                schema: SCHEMA,
                file,
                robot,
                start_utc: None,
                end_utc: None,
                utc_source: source.name(),
                rows: 0,
                duration_s: 0.0,
                flight_s: 0.0,
                take_offs: 0,
                distance_m: None,
                max_altitude_m: None,
                max_height_m: None,
                max_speed_mps: None,
                battery_v: None,
                fuel_percent: None,
                lost_samples: 0,
                bridge_restarts: 0,
                gaps: 0,
                longest_gap_s: 0.0,
                dsp_errors: None,
                damaged_lines: 0,
                first_damage: None,
                unfinished_bytes: 0,
            },
            places: Places {
                latitude: place("latitude_deg"),
                longitude: place("longitude_deg"),
                altitude: place("altitude_m"),
                speed: place("gps_horizontal_speed_mps"),
                battery: place("battery_mv"),
                fuel: place("fuel_percent"),
                dsp_errors: place("dsp_errors"),
                quality: place("gps_quality"),
            },
            times: UtcTimes::new(source),
            last: None,
            ground_m: None,
            step_from: None,
            dsp_errors: None,
        }
    }

    /// Takes the next row.
    pub fn row(&mut self, row: &Row<'_>) {
        let cells: Vec<&str> = row.cells().collect();
        let value = |place: Option<usize>| -> Option<f64> {
            let number: f64 = cells.get(place?)?.parse().ok()?;
            number.is_finite().then_some(number)
        };
        self.time(row);
        let summary = &mut self.summary;
        summary.rows += 1;
        // Without a fix the GPS says zero for everything.
        let has_fix = value(self.places.quality) != Some(0.0);
        let by_gps = |place| value(place).filter(|_| has_fix);
        greatest(&mut summary.max_speed_mps, by_gps(self.places.speed));
        let battery_v = value(self.places.battery).map(|mv| mv / 1000.0);
        course(&mut summary.battery_v, battery_v);
        course(&mut summary.fuel_percent, value(self.places.fuel));
        if let Some(altitude) = by_gps(self.places.altitude) {
            self.altitude(altitude, row.flying);
        }
        let degrees = by_gps(self.places.latitude).zip(by_gps(self.places.longitude));
        let place = degrees.and_then(|(latitude, longitude)| Place::new(latitude, longitude));
        match place {
            Some(place) if row.flying => self.step(place),
            // The way goes on from where the helicopter takes off next.
            _ if !row.flying => self.step_from = place.or(self.step_from),
            _ => {}
        }
        if let Some(errors) = value(self.places.dsp_errors) {
            self.errors(errors as u64);
        }
        self.last = Some(Last {
            received_ns: row.received_ns,
            sequence: row.sequence,
            flying: row.flying,
        });
    }

    /// Takes a line that is no row.
    pub fn damage(&mut self, damage: &Damage) {
        self.summary.damaged_lines += 1;
        let first = &mut self.summary.first_damage;
        first.get_or_insert_with(|| damage.to_string());
    }

    /// Everything, with the bytes that the file ends with and that are no row.
    pub fn finish(mut self, unfinished_bytes: usize) -> Summary {
        self.summary.unfinished_bytes = unfinished_bytes;
        self.summary
    }

    fn time(&mut self, row: &Row<'_>) {
        let time = self.times.of(row).map(|time: IsoTime| time.to_string());
        let summary = &mut self.summary;
        if self.last.is_none() {
            summary.start_utc.clone_from(&time);
        }
        summary.end_utc = time;
        let Some(last) = self.last else {
            summary.take_offs = u32::from(row.flying);
            return;
        };
        // The clock of the robot's host goes back when that was restarted.
        let elapsed_ns = row.received_ns.saturating_sub(last.received_ns);
        let elapsed_s = elapsed_ns as f64 / 1e9;
        summary.duration_s += elapsed_s;
        if last.flying {
            summary.flight_s += elapsed_s;
        } else if row.flying {
            summary.take_offs += 1;
        }
        if elapsed_ns > GAP_NS {
            summary.gaps += 1;
            summary.longest_gap_s = summary.longest_gap_s.max(elapsed_s);
        }
        match row.sequence.checked_sub(last.sequence) {
            Some(steps @ 1..) => summary.lost_samples += steps - 1,
            Some(0) | None => summary.bridge_restarts += 1,
        }
    }

    fn altitude(&mut self, altitude_m: f64, is_flying: bool) {
        greatest(&mut self.summary.max_altitude_m, Some(altitude_m));
        if !is_flying {
            self.ground_m = Some(altitude_m);
        } else if let Some(ground_m) = self.ground_m {
            greatest(&mut self.summary.max_height_m, Some(altitude_m - ground_m));
        }
    }

    fn step(&mut self, to: Place) {
        let way_m = self.summary.distance_m.get_or_insert(0.0);
        let from = *self.step_from.get_or_insert(to);
        let length_m = distance_m(from, to);
        if length_m >= STEP_M {
            if length_m <= MAX_STEP_M {
                *way_m += length_m;
            }
            self.step_from = Some(to);
        }
    }

    fn errors(&mut self, errors: u64) {
        // A bridge that began anew counts from 0 again.
        let new = match self.dsp_errors {
            None => 0,
            Some(before) if errors < before => errors,
            Some(before) => errors - before,
        };
        *self.summary.dsp_errors.get_or_insert(0) += new;
        self.dsp_errors = Some(errors);
    }
}

fn greatest(of: &mut Option<f64>, value: Option<f64>) {
    if let Some(value) = value {
        *of = Some(of.map_or(value, |greatest| greatest.max(value)));
    }
}

fn course(of: &mut Option<Course>, value: Option<f64>) {
    if let Some(value) = value {
        let course = of.get_or_insert(Course {
            first: value,
            last: value,
            min: value,
        });
        course.last = value;
        course.min = course.min.min(value);
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (title, text) in self.lines() {
            writeln!(f, "{title:<11} {text}")?;
        }
        Ok(())
    }
}

impl Summary {
    /// A title and a text for each thing.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let mut lines = self.file_and_times();
        lines.extend(self.flight());
        lines.extend(self.supply());
        lines.extend(self.losses());
        lines.extend(self.damage());
        lines
    }

    fn file_and_times(&self) -> Vec<(&'static str, String)> {
        let unknown = || "unknown".to_owned();
        let robot = self.robot.map(|robot| robot.to_string());
        let note = match self.utc_source {
            Some("file-name") => " (from the file's name; true times may be later)",
            _ => "",
        };
        let (start, end) = (self.start_utc.clone(), self.end_utc.clone());
        vec![
            ("file", self.file.clone()),
            ("robot", robot.unwrap_or_else(unknown)),
            ("start", format!("{}{note}", start.unwrap_or_else(unknown))),
            ("end", end.unwrap_or_else(unknown)),
            (
                "duration",
                format!("{}, {}", duration(self.duration_s), count(self.rows, "row")),
            ),
        ]
    }

    fn flight(&self) -> Vec<(&'static str, String)> {
        let take_offs = count(self.take_offs, "take-off");
        let height = self.max_height_m.map_or_else(String::new, |height_m| {
            format!(", {height_m:.1} m above take-off")
        });
        let distance = known(self.distance_m, |m| format!("{m:.0} m over ground"));
        let altitude = known(self.max_altitude_m, |m| format!("at most {m:.1} m{height}"));
        let speed = known(self.max_speed_mps, |mps| {
            format!("at most {mps:.1} m/s over ground")
        });
        let in_the_air = duration(self.flight_s);
        vec![
            ("flight", format!("{in_the_air} in the air, {take_offs}")),
            ("distance", distance),
            ("altitude", altitude),
            ("speed", speed),
        ]
    }

    fn supply(&self) -> Vec<(&'static str, String)> {
        let used = |course: Course, unit: &str| {
            let Course { first, last, min } = course;
            let used = first - last;
            format!(
                "{first:.1} {unit} to {last:.1} {unit}, {used:.1} {unit} used, at least {min:.1} {unit}"
            )
        };
        let battery = known(self.battery_v, |course| used(course, "V"));
        let fuel = known(self.fuel_percent, |course| used(course, "%"));
        vec![("battery", battery), ("fuel", fuel)]
    }

    fn losses(&self) -> Vec<(&'static str, String)> {
        let all = self.rows + self.lost_samples;
        let percent = self.lost_samples as f64 * 100.0 / all.max(1) as f64;
        let lost = count(self.lost_samples, "sample");
        let restarts = count(self.bridge_restarts, "restart");
        let gaps = match self.gaps {
            0 => "none longer than 1 s".to_owned(),
            gaps => format!(
                "{gaps} longer than 1 s, the longest {}",
                duration(self.longest_gap_s)
            ),
        };
        let errors = known(self.dsp_errors, |errors| errors.to_string());
        let requests = match self.file.ends_with(FileKind::Mcap.extension()) {
            true => "in the record's topic `requests`; `ril log report` shows them",
            false => "not in this log; the audit trail in the bridge's log has them",
        };
        vec![
            (
                "losses",
                format!("{lost} of {all} ({percent:.2} %), {restarts} of the bridge"),
            ),
            ("gaps", gaps),
            ("DSP errors", errors),
            ("requests", requests.to_owned()),
        ]
    }

    fn damage(&self) -> Vec<(&'static str, String)> {
        let mut damage = Vec::new();
        if self.damaged_lines > 0 {
            let first = self.first_damage.as_deref().unwrap_or("-");
            let lines = count(self.damaged_lines, "line");
            damage.push(("damage", format!("{lines} without a row; first {first}")));
        }
        if self.unfinished_bytes > 0 {
            let bytes = count(self.unfinished_bytes, "byte");
            damage.push((
                "unfinished",
                format!("{bytes} of a last row that is cut off"),
            ));
        }
        damage
    }
}

/// A value in words; what the log's columns do not have is reported as missing.
fn known<T>(value: Option<T>, words: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "not in this log".to_owned(), words)
}
