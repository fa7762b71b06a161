//! The items of a plan as rows: what, where, how high, how long, when.

use plans::model::{Action, Altitude, Item};
use plans::timeline::{Mark, timeline};
use serde::Serialize;

use super::gather::KnownPlan;
use crate::render::words::duration;

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
        ignored: item.ignored.clone(),
    }
}

/// The rows for people, in 80 columns.
pub fn text(rows: &[ItemRow]) -> String {
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
