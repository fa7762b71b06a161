//! The flight in sentences, of the same summary that `ril log summary` prints.

use operator::render::words::duration_with_tenths as duration;

use crate::verbs::log::summary::{Course, Summary};

/// Titles of the summary's lines that the report shows elsewhere.
const ELSEWHERE: [&str; 5] = ["file", "robot", "start", "end", "requests"];

/// Heading of the report.
pub fn title(summary: &Summary) -> String {
    match summary.robot {
        Some(robot) => format!("Flight of robot {robot}"),
        None => "Flight of a robot".to_owned(),
    }
}

/// What stands below the heading.
pub fn lead(summary: &Summary) -> Vec<String> {
    let time = match (&summary.start_utc, &summary.end_utc) {
        (Some(start), Some(end)) => {
            let note = match summary.utc_source {
                Some("file-name") => ", counted from the file's name; true times may be later",
                _ => "",
            };
            format!(
                "{} to {} UTC{note}",
                to_the_second(start),
                time_of(start, end)
            )
        }
        _ => "When it was is not known".to_owned(),
    };
    vec![time, summary.file.clone()]
}

/// `2026-11-22 11:54:43` of a time with microseconds.
fn to_the_second(utc: &str) -> String {
    utc.split('.').next().unwrap_or_default().replace('T', " ")
}

/// The end, without its date when that is the one of the start.
fn time_of(start: &str, end: &str) -> String {
    let date = |utc: &str| utc.split('T').next().unwrap_or_default().to_owned();
    let end_s = to_the_second(end);
    match date(start) == date(end) {
        true => end_s.split(' ').nth(1).unwrap_or_default().to_owned(),
        false => end_s,
    }
}

/// The flight in sentences.
pub fn sentences(summary: &Summary) -> Vec<String> {
    if summary.rows == 0 {
        return vec!["The recording has no sample.".to_owned()];
    }
    let mut sentences = vec![flown(summary)];
    sentences.extend(supply(summary));
    sentences.push(quality(summary));
    sentences
}

fn flown(summary: &Summary) -> String {
    let whole = duration(summary.duration_s);
    if summary.flight_s == 0.0 && summary.take_offs == 0 {
        return format!("The helicopter stayed on the ground for the {whole} of the recording.");
    }
    let take_offs = match summary.take_offs {
        1 => "took off once".to_owned(),
        times => format!("took off {times} times"),
    };
    let way = summary.distance_m.map_or_else(String::new, |way_m| {
        format!(" and flew {way_m:.0} m over ground")
    });
    let mut text = format!(
        "The helicopter {take_offs}{way}; it was in the air for {} of {whole}.",
        duration(summary.flight_s)
    );
    let height = match (summary.max_height_m, summary.max_altitude_m) {
        (Some(height_m), _) => Some(format!("{height_m:.1} m above take-off")),
        (None, Some(altitude_m)) => Some(format!("at an altitude of {altitude_m:.1} m")),
        (None, None) => None,
    };
    let speed = summary
        .max_speed_mps
        .map(|speed_mps| format!("{speed_mps:.1} m/s fast over ground"));
    let most: Vec<String> = [height, speed].into_iter().flatten().collect();
    if !most.is_empty() {
        text += &format!(" It was at most {}.", most.join(" and "));
    }
    text
}

fn supply(summary: &Summary) -> Option<String> {
    let course = |name: &str, unit: &str, course: Option<Course>| {
        let Course { first, last, min } = course?;
        let least = if min < last - 0.05 {
            format!(", minimum {min:.1}\u{a0}{unit}")
        } else {
            String::new()
        };
        Some(format!(
            "the {name} went from {first:.1}\u{a0}{unit} to {last:.1}\u{a0}{unit}{least}"
        ))
    };
    let courses = [
        course("battery", "V", summary.battery_v),
        course("fuel", "%", summary.fuel_percent),
    ];
    let courses: Vec<String> = courses.into_iter().flatten().collect();
    let text = courses.join("; ");
    let (first, rest) = text.split_at_checked(1)?;
    Some(format!("{}{rest}.", first.to_uppercase()))
}

fn quality(summary: &Summary) -> String {
    let errors = summary.dsp_errors.unwrap_or(0);
    let is_well = summary.lost_samples == 0 && summary.gaps == 0 && summary.bridge_restarts == 0;
    if is_well && errors == 0 && summary.is_whole() {
        return format!(
            "All {} samples that the bridge published are there, without a gap, a restart of the bridge or an error of the DSP.",
            summary.rows
        );
    }
    let mut parts = Vec::new();
    let (all, percent) = summary.published();
    let lost = match summary.lost_samples {
        0 => format!("None of the {all} samples that the bridge published was lost"),
        lost => {
            format!(
                "{lost} of the {all} samples that the bridge published were lost ({percent:.2} %)"
            )
        }
    };
    let mut count = |number: u64, one: &str, many: &str| match number {
        0 => {}
        1 => parts.push(one.to_owned()),
        number => parts.push(format!("{number} {many}")),
    };
    let longest = duration(summary.longest_gap_s);
    let one_gap = format!("one gap of {longest}");
    let gaps = format!("gaps, the longest of {longest}");
    count(summary.gaps.into(), &one_gap, &gaps);
    count(
        summary.bridge_restarts.into(),
        "one restart of the bridge",
        "restarts of the bridge",
    );
    count(errors, "one error of the DSP", "errors of the DSP");
    count(summary.damaged_lines, "one damaged line", "damaged lines");
    match (summary.lost_samples, parts.is_empty()) {
        (_, true) => format!("{lost}."),
        (0, false) if parts == [one_gap.as_str()] => format!("{lost}, but there was {one_gap}."),
        (0, false) => format!("{lost}, but there were faults: {}.", parts.join(", ")),
        (_, false) => format!("{lost}; other faults: {}.", parts.join(", ")),
    }
}

/// The summary as names and values.
pub fn facts(summary: &Summary) -> Vec<(String, String)> {
    let lines = summary.lines().into_iter();
    let shown = lines.filter(|(title, _)| !ELSEWHERE.contains(title));
    shown
        .map(|(title, text)| (title.to_owned(), text))
        .collect()
}

/// A log of status as names and values.
pub fn log(summary: &Summary, columns: &[String]) -> Vec<(String, String)> {
    let text = |text: &str| text.to_owned();
    let mut rows = vec![(text("file"), summary.file.clone())];
    rows.push((text("format"), text("log of status, tab-separated values")));
    rows.push((text("samples"), summary.rows.to_string()));
    rows.push((text("columns"), columns.join(", ")));
    let requests = "not in a log of status; the audit trail in the bridge's log has them";
    rows.push((text("requests"), text(requests)));
    rows
}
