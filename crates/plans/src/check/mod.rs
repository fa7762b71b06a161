//! The checks of a flight, before anything of it is sent: the limits of the bridge and of the DSP, the fences, time and
//! fuel.
//!
//! What the bridge checks when a request comes is asked of the bridge's own code: how it reads requests, how it
//! measures distances, and its geofence. So a plan without a finding is refused by none of these rules.

mod fences;
mod limits;

use bridge::BridgeConfig;
use dsp_protocol::{Command, Waypoint};

pub use fences::area_config;
pub use limits::ANOTHER_SITE_M;

use crate::finding::Findings;
use crate::flight::{Flight, ground_m};
use crate::format::PlanFormat;
use crate::model::Plan;
use crate::site::{Endurance, HomeSource, Site};
use crate::timeline::{Mark, timeline};
use runtime::finding::{Finding, Severity};

/// A planned home farther away than this from the point of take-off is worth a word, m.
const HOME_MOVED_M: f64 = 100.0;

/// So far may telemetry's altitude at home and the planned one be apart, m: a good GPS altitude and a map's.
const HOME_HEIGHT_M: f64 = 15.0;

/// All findings about `plan`, which becomes `flight` at `site`; the most severe first. `rules` is the bridge's
/// configuration, if it is known.
pub fn check(
    plan: &Plan,
    flight: &Flight,
    site: &Site,
    rules: Option<&BridgeConfig>,
    endurance: &Endurance,
) -> Vec<Finding> {
    let defaults = BridgeConfig::default();
    let mut findings = flight.findings.clone();
    check_home(plan, site, &mut findings);
    if flight.steps.is_empty() {
        findings.push(Finding::new(
            Severity::Error,
            "empty",
            "there is nothing in it that can be flown",
        ));
    }
    limits::check(rules.unwrap_or(&defaults), flight, endurance, &mut findings);
    if site.is_home_altitude_known {
        fences::check_ground(
            rules.unwrap_or(&defaults),
            plan,
            flight,
            site,
            &mut findings,
        );
    }
    match rules {
        Some(rules) => fences::check_robot(rules, flight, site, &mut findings),
        None => findings.push(
            Finding::unchecked(
                "robot-rules",
                "the robot's geofence is not known, and its limits are taken to be the defaults",
            )
            .with_next_step("name its configuration: `--bridge bridge.toml`"),
        ),
    }
    fences::check_plan(plan, flight, site, &mut findings);
    check_endurance(flight, endurance, &mut findings);
    let mut findings = findings.sorted();
    // The items of these formats have no numbers that a person sees.
    if matches!(
        plan.format,
        PlanFormat::GeoJson | PlanFormat::Kml | PlanFormat::Gpx
    ) {
        for finding in &mut findings {
            let first = finding
                .items
                .first()
                .and_then(|number| plan.items.get(*number as usize - 1));
            finding.text += &first.map_or(String::new(), |item| {
                format!(" (item {}: {})", item.number, item.origin)
            });
        }
    }
    findings
}

fn check_home(plan: &Plan, site: &Site, findings: &mut Findings) {
    // What is not known forbids a flight, and leaves a look unchecked.
    let unknown = |for_flight: &str, for_a_look: &str| match site.is_for_flight {
        true => Finding::new(Severity::Error, "home-unknown", for_flight),
        false => Finding::unchecked("home-unknown", for_a_look),
    };
    if site.home_source == HomeSource::Assumed {
        let finding = unknown(
            "home is not known: the helicopter is in the air already",
            "home is not known: the take-off is taken to be below the first place of the plan, at altitude 0",
        );
        findings.push(
            finding
                .with_next_step("state where the take-off was, or will be: `--home LAT,LON,ALT`"),
        );
    } else if !site.is_home_altitude_known {
        let finding = unknown(
            "the telemetry altitude of home is not known",
            "the telemetry altitude of home is not known, and is taken to be 0",
        );
        findings.push(finding.with_next_step(
            "state it: `--home LAT,LON,ALT`; for the home of a plan `[plan] zero_above_sea_m` in ril.toml does as well",
        ));
    }
    let Some(planned) = plan.planned_home else {
        return;
    };
    if matches!(site.home_source, HomeSource::Plan | HomeSource::Assumed) {
        return;
    }
    let there = Waypoint {
        latitude_deg: planned.position.latitude_deg,
        longitude_deg: planned.position.longitude_deg,
        altitude_m: 0.0,
    };
    let distance_m = ground_m(&site.home, &there);
    if distance_m > HOME_MOVED_M {
        findings.push(
            Finding::new(
                Severity::Warning,
                "home-moved",
                "the plan was made for another place of take-off",
            )
            .by_m(distance_m),
        );
    }
    let height_m = planned
        .above_sea_m
        .zip(site.zero_above_sea_m)
        .filter(|_| site.is_home_altitude_known)
        .map(|(above_sea_m, zero_m)| site.home.altitude_m + zero_m - above_sea_m);
    if let Some(height_m) = height_m.filter(|height_m| height_m.abs() > HOME_HEIGHT_M) {
        findings.push(
            Finding::new(
                Severity::Warning,
                "home-height",
                "home is not as high above sea as the plan has it",
            )
            .by_m(height_m.abs())
            .with_next_step("check `[plan] zero_above_sea_m` in ril.toml"),
        );
    }
}

/// Checks whether battery and fuel last for the whole flight; what is not configured is a finding, too.
fn check_endurance(flight: &Flight, endurance: &Endurance, findings: &mut Findings) {
    let marks = timeline(flight, endurance);
    let (Some(last), Some(endurance_s)) = (marks.last(), endurance.endurance_s) else {
        if !flight.steps.is_empty() {
            findings.push(
                Finding::unchecked(
                    "endurance",
                    "whether battery and fuel last is not checked: how long they do is not configured",
                )
                .with_next_step("set `endurance_s` and `cruise_speed_mps` under `[plan]` of ril.toml"),
            );
        }
        return;
    };
    let Some(total_s) = last.time_s else {
        findings.push(
            Finding::unchecked(
                "endurance",
                "whether battery and fuel last is not checked: the cruise speed is not known",
            )
            .with_next_step("set `cruise_speed_mps` under `[plan]` of ril.toml"),
        );
        return;
    };
    let usable_s = endurance_s - endurance.reserve_s;
    if total_s <= usable_s {
        return;
    }
    let is_late = |mark: &&Mark| mark.time_s.is_some_and(|time_s| time_s > usable_s);
    let first = marks.iter().find(is_late).unwrap_or(last);
    let left_m = last.distance_m - (first.distance_m - first.step_m);
    findings.push(Finding {
        items: first.item.into_iter().collect(),
        leg: first.leg,
        ..Finding::new(Severity::Error,
            "endurance",
            format!(
                "is reached too late: the flight takes {total_s:.0} s, battery and fuel last {endurance_s:.0} s, of which {:.0} s \
                 are reserve",
                endurance.reserve_s
            ),
        )
        .by_m(left_m)
        .with_next_step("divide the plan, or correct `[plan]` of ril.toml")
    });
}

/// The parameter that the bridge writes to a 32-bit port at each start-up, if it is configured.
pub fn configured(rules: &BridgeConfig, port: u16) -> Option<f64> {
    rules.parameters.writes().find_map(|write| match write {
        Command::Write32 {
            port: number,
            value,
        } if number == port => Some(f64::from(value)),
        _ => None,
    })
}
