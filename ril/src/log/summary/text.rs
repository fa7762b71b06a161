//! A summary as text: a line for each thing, with a title.

use std::fmt;

use super::{Course, Summary};
use crate::log::duration::duration;

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.file_and_times(f)?;
        self.flight(f)?;
        self.supply(f)?;
        self.losses(f)?;
        self.damage(f)
    }
}

impl Summary {
    fn file_and_times(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unknown = || "unknown".to_owned();
        let robot = self.robot.map(|robot| robot.to_string());
        let note = match self.utc_source {
            Some("file-name") => " (from the file's name; true times may be later)",
            _ => "",
        };
        let (start, end) = (self.start_utc.clone(), self.end_utc.clone());
        writeln!(f, "file        {}", self.file)?;
        writeln!(f, "robot       {}", robot.unwrap_or_else(unknown))?;
        writeln!(f, "start       {}{note}", start.unwrap_or_else(unknown))?;
        writeln!(f, "end         {}", end.unwrap_or_else(unknown))?;
        writeln!(
            f,
            "duration    {}, {}",
            duration(self.duration_s),
            plural(self.rows, "row")
        )
    }

    fn flight(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let take_offs = plural(self.take_offs.into(), "take-off");
        let height = self.max_height_m.map_or_else(String::new, |height_m| {
            format!(", {height_m:.1} m over the point of take-off")
        });
        let distance = known(self.distance_m, |m| format!("{m:.0} m over ground"));
        let altitude = known(self.max_altitude_m, |m| format!("at most {m:.1} m{height}"));
        let speed = known(self.max_speed_mps, |mps| {
            format!("at most {mps:.1} m/s over ground")
        });
        let in_the_air = duration(self.flight_s);
        writeln!(f, "flight      {in_the_air} in the air, {take_offs}")?;
        writeln!(f, "distance    {distance}")?;
        writeln!(f, "altitude    {altitude}")?;
        writeln!(f, "speed       {speed}")
    }

    fn supply(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let used = |course: Course, unit: &str| {
            let Course { first, last, min } = course;
            let used = first - last;
            format!(
                "{first:.1} {unit} to {last:.1} {unit}, {used:.1} {unit} used, at least {min:.1} {unit}"
            )
        };
        let battery = known(self.battery_v, |course| used(course, "V"));
        let fuel = known(self.fuel_percent, |course| used(course, "%"));
        writeln!(f, "battery     {battery}")?;
        writeln!(f, "fuel        {fuel}")
    }

    fn losses(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.rows + self.lost_samples;
        let percent = self.lost_samples as f64 * 100.0 / all.max(1) as f64;
        let lost = plural(self.lost_samples, "sample");
        let restarts = plural(self.bridge_restarts.into(), "restart");
        writeln!(
            f,
            "losses      {lost} of {all} ({percent:.2} %), {restarts} of the bridge"
        )?;
        let gaps = match self.gaps {
            0 => "none longer than 1 s".to_owned(),
            gaps => format!(
                "{gaps} longer than 1 s, the longest {}",
                duration(self.longest_gap_s)
            ),
        };
        let errors = known(self.dsp_errors, |errors| errors.to_string());
        writeln!(f, "gaps        {gaps}")?;
        writeln!(f, "DSP errors  {errors}")?;
        writeln!(
            f,
            "requests    not in this log; the audit trail in the bridge's log has them"
        )
    }

    fn damage(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.damaged_lines > 0 {
            let first = self.first_damage.as_deref().unwrap_or("-");
            let lines = plural(self.damaged_lines, "line");
            writeln!(f, "damage      {lines} without a row; first {first}")?;
        }
        if self.unfinished_bytes > 0 {
            let bytes = plural(self.unfinished_bytes as u64, "byte");
            writeln!(f, "unfinished  {bytes} of a last row that is cut off")?;
        }
        Ok(())
    }
}

/// A value in words; what the log's columns do not tell is said to be missing.
fn known<T>(value: Option<T>, words: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "not in this log".to_owned(), words)
}

/// A number with its noun.
fn plural(number: u64, noun: &str) -> String {
    let ending = if number == 1 { "" } else { "s" };
    format!("{number} {noun}{ending}")
}
