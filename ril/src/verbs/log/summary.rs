//! What a log says of a flight: [`Summarizer`] takes the samples one after the other and keeps none of them.
//!
//! [`SampleStep`]: what lies between two samples, for the summary and for the report.

use std::fmt;

use ipc_types::TelemetryGroup;
use ipc_types::payload::DspTelemetry;
use operator::render::words::{count, duration_with_tenths as duration};
use operator::robot::geo::{Place, distance_m};
use runtime::plain::plain_name;
use serde::Serialize;
use status::log::clock::IsoTime;
use status::log::file_name::FileKind;

use super::recording::{Damage, Row};
use super::row::{UtcSource, UtcTimes};

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.LogSummary.v1";

/// Two samples with more between them than this have a gap, s: telemetry comes at least once a second, or is stale.
pub const GAP_S: f64 = 1.0;

/// The way over ground is measured in steps of at least this length, m. The noise of a GPS moves a helicopter that
/// hovers by centimetres with each sample; shorter steps would add them up to a way.
const STEP_M: f64 = 1.0;

/// A step longer than this is none of a helicopter, m: a damaged number, or the next fix after a time without one.
pub const MAX_STEP_M: f64 = 1000.0;

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
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
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
    /// Greatest height over the place where the helicopter last stood before, m; `None` if it was in the air in all
    /// rows.
    pub max_height_m: Option<f64>,
    /// Greatest speed over ground, m/s.
    pub max_speed_mps: Option<f32>,
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

/// What lies between two samples that follow each other in a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleStep {
    /// Time from the one to the other, s; 0 if the clock went back, because the robot's host was restarted.
    pub elapsed_s: f64,
    /// Samples that the bridge published between them, by their numbers.
    pub lost: u64,
    /// Whether the bridge began anew.
    pub is_restart: bool,
    /// Errors that the DSP reported. A bridge that began anew counts from 0 again.
    pub new_errors: u32,
}

impl SampleStep {
    /// From `before` to `dsp`.
    pub fn between(before: &DspTelemetry, dsp: &DspTelemetry) -> SampleStep {
        let steps = dsp.sequence.checked_sub(before.sequence);
        let steps = steps.filter(|steps| *steps > 0 && before.epoch_ns == dsp.epoch_ns);
        let errors = dsp.dsp_errors.checked_sub(before.dsp_errors);
        SampleStep {
            elapsed_s: dsp.received_ns.saturating_sub(before.received_ns) as f64 / 1e9,
            lost: steps.map_or(0, |steps| steps - 1),
            is_restart: steps.is_none(),
            new_errors: errors.unwrap_or(dsp.dsp_errors),
        }
    }
}

/// Makes a summary of samples.
pub struct Summarizer {
    summary: Summary,
    times: UtcTimes,
    last: Option<DspTelemetry>,
    /// Altitude where the helicopter stood last, m.
    ground_m: Option<f64>,
    /// The end of the last step of the way.
    step_from: Option<Place>,
}

impl Summarizer {
    /// Begins with a file whose log has `columns` and takes its times from `source`.
    pub fn new(
        file: String,
        robot: Option<u32>,
        columns: &[String],
        source: UtcSource,
    ) -> Summarizer {
        let has_errors = columns.iter().any(|name| name == "dsp_errors");
        Summarizer {
            summary: Summary {
                schema: SCHEMA,
                file,
                robot,
                utc_source: source.name(),
                dsp_errors: has_errors.then_some(0),
                ..Summary::default()
            },
            times: UtcTimes::new(source),
            last: None,
            ground_m: None,
            step_from: None,
        }
    }

    /// Takes the next row.
    pub fn row(&mut self, row: &Row<'_>) {
        let dsp = row.sample;
        self.time(row);
        let summary = &mut self.summary;
        summary.rows += 1;
        let speed_mps = dsp.gps_velocity.horizontal_speed_mps;
        if dsp.valid(TelemetryGroup::GpsVelocity) && speed_mps.is_finite() {
            greatest(&mut summary.max_speed_mps, speed_mps);
        }
        if dsp.valid(TelemetryGroup::Supply) {
            let battery_v = f64::from(dsp.supply.battery_mv) / 1000.0;
            course(&mut summary.battery_v, battery_v);
            course(&mut summary.fuel_percent, dsp.supply.fuel_percent.into());
        }
        let geographic = dsp.geographic;
        let has_place = dsp.valid(TelemetryGroup::Geographic);
        if has_place && geographic.altitude_m.is_finite() {
            self.altitude(geographic.altitude_m, dsp.is_flying());
        }
        let place = Place::new(geographic.latitude_deg, geographic.longitude_deg);
        match place.filter(|_| has_place) {
            Some(place) if dsp.is_flying() => self.step(place),
            // The way goes on from where the helicopter takes off next.
            place if !dsp.is_flying() => self.step_from = place.or(self.step_from),
            _ => {}
        }
        self.last = Some(*dsp);
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
        let (summary, dsp) = (&mut self.summary, row.sample);
        if self.last.is_none() {
            summary.start_utc.clone_from(&time);
        }
        summary.end_utc = time;
        let Some(last) = &self.last else {
            summary.take_offs = u32::from(dsp.is_flying());
            return;
        };
        let step = SampleStep::between(last, dsp);
        summary.duration_s += step.elapsed_s;
        if last.is_flying() {
            summary.flight_s += step.elapsed_s;
        } else if dsp.is_flying() {
            summary.take_offs += 1;
        }
        if step.elapsed_s > GAP_S {
            summary.gaps += 1;
            summary.longest_gap_s = summary.longest_gap_s.max(step.elapsed_s);
        }
        summary.lost_samples = summary.lost_samples.saturating_add(step.lost);
        summary.bridge_restarts += u32::from(step.is_restart);
        if let Some(errors) = &mut summary.dsp_errors {
            *errors += u64::from(step.new_errors);
        }
    }

    fn altitude(&mut self, altitude_m: f64, is_flying: bool) {
        greatest(&mut self.summary.max_altitude_m, altitude_m);
        if !is_flying {
            self.ground_m = Some(altitude_m);
        } else if let Some(ground_m) = self.ground_m {
            greatest(&mut self.summary.max_height_m, altitude_m - ground_m);
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
}

fn greatest<T: PartialOrd>(of: &mut Option<T>, value: T) {
    if of.as_ref().is_none_or(|greatest| value > *greatest) {
        *of = Some(value);
    }
}

fn course(of: &mut Option<Course>, value: f64) {
    let course = of.get_or_insert(Course {
        first: value,
        last: value,
        min: value,
    });
    course.last = value;
    course.min = course.min.min(value);
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
            ("file", plain_name(&self.file).into_owned()),
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

    /// The samples that the bridge published, those of the log and the lost ones, and how many of 100 were lost.
    pub fn published(&self) -> (u64, f64) {
        let all = self.rows.saturating_add(self.lost_samples);
        (all, self.lost_samples as f64 * 100.0 / all.max(1) as f64)
    }

    fn losses(&self) -> Vec<(&'static str, String)> {
        let (all, percent) = self.published();
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
