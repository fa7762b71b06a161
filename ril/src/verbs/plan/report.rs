//! The result of the checks, as text and as JSON; and the items of a plan as rows: what, where, how high, how long,
//! when.

use std::io::Write;
use std::path::Path;

use operator::render::words::{count, distance, duration, wrap};
use operator::render::{finding, json_line};
use plans::finding::effect;
use plans::flight::ground_m;
use plans::model::{Action, Altitude, Item};
use plans::site::HomeSource;
use plans::timeline::{Mark, timeline};
use runtime::exit::{ExitCode, Failure};
use runtime::plain::plain_path;
use serde::Serialize;

use super::gather::KnownPlan;

/// How wide the headings are.
const HEADING: usize = 13;

/// A checked plan.
pub struct PlanReport<'a> {
    file: &'a Path,
    known: &'a KnownPlan,
    length_m: f64,
    time_s: Option<f64>,
    highest_m: Option<f64>,
    farthest_m: Option<f64>,
}

/// One finding for programs.
#[derive(Serialize)]
struct FindingObject<'a> {
    schema: &'static str,
    severity: &'static str,
    rule: &'a str,
    items: &'a [u32],
    leg: Option<u32>,
    amount_m: Option<f64>,
    text: &'a str,
    next_step: &'a str,
}

/// The whole for programs.
#[derive(Serialize)]
pub struct PlanSummary {
    schema: &'static str,
    file: String,
    format: &'static str,
    items: usize,
    home_latitude_deg: f64,
    home_longitude_deg: f64,
    home_altitude_m: Option<f64>,
    home_source: &'static str,
    length_m: f64,
    time_s: Option<f64>,
    cruise_speed_mps: Option<f64>,
    highest_over_home_m: Option<f64>,
    farthest_from_home_m: Option<f64>,
    forbids: usize,
    warns: usize,
    not_checked: usize,
}

impl<'a> PlanReport<'a> {
    /// The report about the plan of `file`.
    pub fn new(file: &'a Path, known: &'a KnownPlan) -> PlanReport<'a> {
        let marks = timeline(&known.flight, &known.endurance);
        let home = &known.site.home;
        let most = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
        let legs = || known.flight.legs.iter();
        PlanReport {
            file,
            known,
            length_m: marks.last().map_or(0.0, |mark| mark.distance_m),
            time_s: marks.last().and_then(|mark| mark.time_s),
            highest_m: most(&mut legs().map(|leg| leg.to.altitude_m - home.altitude_m)),
            farthest_m: most(&mut legs().map(|leg| ground_m(home, &leg.to))),
        }
    }

    /// Success unless a finding forbids the flight.
    ///
    /// # Errors
    ///
    /// Code 8.
    pub fn verdict(&self) -> Result<(), Failure> {
        match self.count("forbids") {
            0 => Ok(()),
            count => {
                let which = match count {
                    1 => "1 finding forbids it".to_owned(),
                    count => format!("{count} findings forbid it"),
                };
                let name = plain_path(self.file);
                let text = format!("{name} cannot be flown as it is: {which}");
                Err(Failure::new(ExitCode::NotInOrder, text))
            }
        }
    }

    /// All of it for people.
    pub fn text(&self, columns: usize) -> String {
        let mut text = self.heading(columns);
        text += &self.findings(columns);
        let count = |effect| self.count(effect);
        text += &format!(
            "\n{} the flight, {} warn, {} not checked\n",
            match count("forbids") {
                1 => "1 finding forbids".to_owned(),
                count => format!("{count} findings forbid"),
            },
            count("warns"),
            count("not-checked")
        );
        text
    }

    /// The findings for people, an empty line before each.
    pub fn findings(&self, columns: usize) -> String {
        let texts = self
            .known
            .findings
            .iter()
            .map(|finding| finding::of_plan(finding, HEADING, columns));
        texts.map(|text| format!("\n{text}")).collect()
    }

    fn heading(&self, columns: usize) -> String {
        let KnownPlan {
            plan, site, rules, ..
        } = self.known;
        let line = |name: &str, text: &str| wrap(&format!("{name:<HEADING$}"), text, columns);
        let home = &site.home;
        let source = match site.home_source {
            HomeSource::Robot => "where the robot stands",
            HomeSource::Operator => "as --home says",
            HomeSource::Plan => "as the plan has it",
            HomeSource::Assumed => "assumed: below the first place of the plan",
        };
        let rules = match rules {
            Some((rules, origin)) => {
                format!(
                    "{origin} with {}",
                    count(rules.fence.areas() as u64, "area")
                )
            }
            None => "not known".to_owned(),
        };
        let mut text = line(
            "plan",
            &format!(
                "{}: {}, {}",
                plain_path(self.file),
                plan.format,
                count(plan.items.len() as u64, "item")
            ),
        );
        let altitude = match site.is_home_altitude_known {
            true => format!("{:.1} m", home.altitude_m),
            false => "altitude not known".to_owned(),
        };
        text += &line(
            "home",
            &format!(
                "{:.7}, {:.7}, {altitude}: {source}",
                home.latitude_deg, home.longitude_deg
            ),
        );
        text += &line(
            "rules",
            &format!(
                "of the robot: {rules}; the plan's own fence has {}",
                count(plan.fence.len() as u64, "area")
            ),
        );
        text + &line("flight", &self.flight())
    }

    fn flight(&self) -> String {
        let speed = self.known.endurance.cruise_speed_mps;
        let time = match (self.time_s, speed) {
            (Some(time_s), Some(speed)) => {
                format!("about {} at {speed:.1} m/s", duration(time_s))
            }
            (Some(time_s), None) => format!("about {}", duration(time_s)),
            (None, _) => "time not known".to_owned(),
        };
        let mut text = format!("{}, {time}", distance(self.length_m));
        if let (Some(highest_m), Some(farthest_m)) = (self.highest_m, self.farthest_m) {
            text += &format!(
                "; at most {highest_m:.1} m above take-off and {} away from it",
                distance(farthest_m)
            );
        }
        text
    }

    /// Findings and summary for programs.
    ///
    /// # Errors
    ///
    /// When `out` cannot be written.
    pub fn write_json(&self, out: &mut impl Write) -> Result<(), Failure> {
        for finding in &self.known.findings {
            let object = FindingObject {
                schema: "ril.PlanFinding.v1",
                severity: effect(finding),
                rule: finding.id,
                items: &finding.items,
                leg: finding.leg,
                amount_m: finding.amount_m,
                text: &finding.text,
                next_step: finding.next_step.as_deref().unwrap_or_default(),
            };
            json_line(out, &object)?;
        }
        json_line(out, &self.summary())
    }

    /// The whole for programs.
    pub fn summary(&self) -> PlanSummary {
        let KnownPlan {
            plan,
            site,
            endurance,
            ..
        } = self.known;
        PlanSummary {
            schema: "ril.PlanSummary.v1",
            file: self.file.display().to_string(),
            format: plan.format.name(),
            items: plan.items.len(),
            home_latitude_deg: site.home.latitude_deg,
            home_longitude_deg: site.home.longitude_deg,
            home_altitude_m: site.is_home_altitude_known.then_some(site.home.altitude_m),
            home_source: match site.home_source {
                HomeSource::Robot => "robot",
                HomeSource::Operator => "operator",
                HomeSource::Plan => "plan",
                HomeSource::Assumed => "assumed",
            },
            length_m: self.length_m,
            time_s: self.time_s,
            cruise_speed_mps: endurance.cruise_speed_mps,
            highest_over_home_m: self.highest_m,
            farthest_from_home_m: self.farthest_m,
            forbids: self.count("forbids"),
            warns: self.count("warns"),
            not_checked: self.count("not-checked"),
        }
    }

    fn count(&self, wanted: &str) -> usize {
        let findings = self.known.findings.iter();
        findings.filter(|finding| effect(finding) == wanted).count()
    }
}

/// One item.
#[derive(Serialize)]
pub struct ItemRow {
    schema: &'static str,
    number: u32,
    origin: String,
    label: String,
    action: String,
    /// Whether the helicopter does it.
    flown: bool,
    latitude_deg: Option<f64>,
    longitude_deg: Option<f64>,
    altitude_m: Option<f64>,
    altitude_above: Option<&'static str>,
    /// Telemetry altitude at the end of the item, m.
    telemetry_altitude_m: Option<f64>,
    hold_s: Option<f64>,
    speed_mps: Option<f64>,
    legs: Vec<u32>,
    step_m: f64,
    distance_m: Option<f64>,
    time_s: Option<f64>,
    ignored: Vec<String>,
}

/// The rows of a plan.
pub fn rows(known: &KnownPlan) -> Vec<ItemRow> {
    let marks = timeline(&known.flight, &known.endurance);
    let row = |item: &Item| {
        let own: Vec<&Mark> = marks
            .iter()
            .filter(|mark| mark.item == Some(item.number))
            .collect();
        new_row(known, item, &own)
    };
    known.plan.items.iter().map(row).collect()
}

fn new_row(known: &KnownPlan, item: &Item, marks: &[&Mark]) -> ItemRow {
    let legs = || {
        known
            .flight
            .legs
            .iter()
            .filter(|leg| leg.item == item.number)
    };
    let position = item.action.position();
    let (altitude_m, altitude_above) = match item.action.altitude() {
        Some(Altitude::AboveTakeOff(metres)) => (Some(metres), Some("take-off")),
        Some(Altitude::AboveSea(metres)) => (Some(metres), Some("sea")),
        Some(Altitude::AboveTerrain(metres)) => (Some(metres), Some("terrain")),
        Some(Altitude::Unstated(metres)) => (metres, None),
        None => (None, None),
    };
    ItemRow {
        schema: "ril.PlanItem.v1",
        number: item.number,
        origin: item.origin.clone(),
        label: item.label.clone(),
        action: item.action.name().to_owned(),
        flown: known.flight.is_flown(item.number),
        latitude_deg: position.map(|position| position.latitude_deg),
        longitude_deg: position.map(|position| position.longitude_deg),
        altitude_m,
        altitude_above,
        telemetry_altitude_m: legs().next_back().map(|leg| leg.to.altitude_m),
        hold_s: match item.action {
            Action::Waypoint { hold_s, .. } => Some(hold_s).filter(|seconds| *seconds > 0.0),
            Action::Hold { duration_s, .. } => duration_s,
            _ => None,
        },
        speed_mps: match item.action {
            Action::Speed { speed_mps } => Some(speed_mps),
            _ => None,
        },
        legs: legs().map(|leg| leg.number).collect(),
        step_m: marks.iter().map(|mark| mark.step_m).sum(),
        distance_m: marks.last().map(|mark| mark.distance_m),
        time_s: marks.last().and_then(|mark| mark.time_s),
        ignored: item.ignored.iter().map(|one| one.text.clone()).collect(),
    }
}

/// The rows for people, in 80 columns.
pub fn table(rows: &[ItemRow]) -> String {
    let mut text = line([
        "ITEM",
        "ACTION",
        "LATITUDE",
        "LONGITUDE",
        "ALTITUDE",
        "STEP_M",
        "TOTAL_M",
        "TIME",
    ]);
    for row in rows {
        text += &row.text();
    }
    text += "ALTITUDE: m above take-off (+), sea level (sea), terrain (gnd), unknown (?).\n";
    text += "Items in brackets are not flown.\n";
    text
}

impl ItemRow {
    fn text(&self) -> String {
        let number = |value: Option<f64>, decimals: usize| {
            value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
        };
        let altitude = match (self.altitude_m, self.altitude_above) {
            (Some(metres), Some("take-off")) => format!("{metres:+.1}"),
            (Some(metres), Some("sea")) => format!("{metres:.1} sea"),
            (Some(metres), Some(_)) => format!("{metres:.1} gnd"),
            (Some(metres), None) => format!("{metres:.1} ?"),
            (None, _) => "-".to_owned(),
        };
        let what = match (self.speed_mps, self.hold_s) {
            (Some(speed), _) => format!("{} {speed} m/s", self.action),
            (None, Some(seconds)) if self.latitude_deg.is_none() => {
                format!("{} {}", self.action, duration(seconds))
            }
            _ => self.action.clone(),
        };
        let what = match self.flown {
            true => what,
            false => format!("({what})"),
        };
        let end = [
            altitude,
            match self.flown {
                true => number(Some(self.step_m), 0),
                false => "-".to_owned(),
            },
            number(self.distance_m, 0),
            self.time_s.map_or("-".to_owned(), duration),
        ];
        let place = [number(self.latitude_deg, 7), number(self.longitude_deg, 7)];
        let [altitude, step, total, time] = end.each_ref().map(String::as_str);
        let item = self.number.to_string();
        match self.latitude_deg {
            Some(_) => {
                let short: String = what.chars().take(ACTION).collect();
                line([
                    &item, &short, &place[0], &place[1], altitude, step, total, time,
                ])
            }
            // Without a place, its columns have room for the action.
            None => {
                let short: String = what.chars().take(ACTION + 25).collect();
                format!("{item:>4} {short:<35} {altitude:>9} {step:>7} {total:>8} {time:>9}\n")
            }
        }
    }
}

/// Width of an action that stands beside a place.
const ACTION: usize = 10;

fn line(
    [
        item,
        action,
        latitude,
        longitude,
        altitude,
        step,
        total,
        time,
    ]: [&str; 8],
) -> String {
    format!(
        "{item:>4} {action:<ACTION$} {latitude:>11} {longitude:>12} {altitude:>9} {step:>7} {total:>8} {time:>9}\n"
    )
}
