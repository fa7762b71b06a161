//! A summary as text: a line for each thing, with a title.

use std::fmt;

use status::log::file_name::FileKind;

use super::{Course, Summary};
use crate::words::{count, duration_with_tenths as duration};

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

/// A value in words; what the log's columns do not tell is said to be missing.
fn known<T>(value: Option<T>, words: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "not in this log".to_owned(), words)
}
