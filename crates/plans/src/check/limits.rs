//! The limits of the bridge's `[movement]`, and of the DSP.

use bridge::flight::request::{RequestKey, parse_movement};
use bridge::{BridgeConfig, Sender};
use dsp_protocol::port;
use ipc_types::MonotonicNs;
use ipc_types::payload::MovementData;

use crate::finding::Findings;
use crate::flight::{Flight, Leg, Step, ground_m};
use crate::site::Endurance;
use crate::steps::position;
use crate::timeline::timeline;
use runtime::finding::{Finding, Severity};

/// Checks it, the times only when the cruise speed is known.
pub fn check(
    bridge: &BridgeConfig,
    flight: &Flight,
    endurance: &Endurance,
    findings: &mut Findings,
) {
    PlanLimits { bridge, endurance }.check(flight, findings);
}

struct PlanLimits<'a> {
    bridge: &'a BridgeConfig,
    endurance: &'a Endurance,
}

/// A waypoint that is farther away is none of the site: beyond the range of a flight.
pub const ANOTHER_SITE_M: f64 = 50_000.0;

/// Metres, of a long distance kilometres.
fn distance(metres: f64) -> String {
    match metres < ANOTHER_SITE_M {
        true => format!("{metres:.0} m"),
        false => format!("{:.0} km", metres / 1000.0),
    }
}

impl PlanLimits<'_> {
    fn check(&self, flight: &Flight, findings: &mut Findings) {
        for step in &flight.steps {
            match step {
                Step::TakeOff { item, height_m } => self.take_off(*item, *height_m, findings),
                Step::Speed { item, speed_mps } => check_speed(*item, *speed_mps, findings),
                _ => {}
            }
        }
        for leg in &flight.legs {
            self.waypoint(leg, findings);
            self.distance(leg, findings);
            self.spacing(leg, findings);
        }
        if self.endurance.cruise_speed_mps.is_some() {
            self.time_limit(flight, findings);
        }
    }

    /// Whether the bridge would take the request.
    fn accepts(&self, request: &MovementData) -> bool {
        let (key, now) = (RequestKey::Movement(0), MonotonicNs(request.issued_ns));
        parse_movement(
            (key, Sender::default()),
            request,
            &self.bridge.movement,
            now,
        )
        .1
        .is_ok()
    }

    fn take_off(&self, item: Option<u32>, height_m: f64, findings: &mut Findings) {
        if self.accepts(&MovementData::take_off(0, height_m)) {
            return;
        }
        let text = match port::port32(port::TAKE_OFF_ALTITUDE_M) {
            Some(port) => format!(
                "takes off to {height_m:.1} m; the DSP takes {} to {} m above take-off",
                port.min, port.max
            ),
            None => format!("takes off to {height_m:.1} m, which the DSP does not take"),
        };
        let excess_m = port::port32(port::TAKE_OFF_ALTITUDE_M)
            .map(|port| (height_m - f64::from(port.max)).max(f64::from(port.min) - height_m));
        findings.push(Finding {
            items: item.into_iter().collect(),
            amount_m: excess_m,
            ..Finding::new(Severity::Error, "take-off-altitude", text)
                .with_next_step(
                    "take off lower and climb on a leg; if the plan's heights are above sea, set `zero_above_sea_m` in `[plan]` of ril.toml",
                )
        });
    }

    fn waypoint(&self, leg: &Leg, findings: &mut Findings) {
        let position = [position(&leg.to)];
        let mut requests = MovementData::path(1, &position, || 1);
        let is_taken = requests.all(|request| self.accepts(&request)) && leg.to.is_plausible();
        if is_taken {
            return;
        }
        let (min_m, max_m) = (
            self.bridge.movement.min_altitude_m,
            self.bridge.movement.max_altitude_m,
        );
        let altitude_m = leg.to.altitude_m;
        findings.push(
            Finding::new(Severity::Error,
                "altitude-range",
                format!("leads to {altitude_m:.1} m; `[movement]` of bridge.toml allows {min_m} to {max_m} m"),
            )
            .by_m((altitude_m - max_m).max(min_m - altitude_m))
            .about(leg.item)
            .on_leg(leg.number),
        );
    }

    fn distance(&self, leg: &Leg, findings: &mut Findings) {
        let most_m = self.bridge.movement.max_distance_m;
        let distance_m = ground_m(&leg.path_start, &leg.to);
        if distance_m > most_m {
            findings.push(
                Finding::new(
                    Severity::Error,
                    "max-distance",
                    format!(
                        "is {} from where its path begins; the limit is {most_m} m",
                        distance(distance_m)
                    ),
                )
                .by_m(distance_m - most_m)
                .with_next_step(match distance_m < ANOTHER_SITE_M {
                    true => {
                        "put a hold in between, or raise `movement.max_distance_m` of bridge.toml"
                    }
                    false => "is this plan for another site? Are latitude and longitude swapped?",
                })
                .about(leg.item)
                .on_leg(leg.number),
            );
        }
    }

    /// Waypoints within the acceptance radius of each other are passed at once.
    fn spacing(&self, leg: &Leg, findings: &mut Findings) {
        let is_first = leg.from == leg.path_start;
        let radius_m = self.bridge.parameters.acceptance_radius_m();
        let length_m = leg.length_m();
        if !is_first && length_m < radius_m {
            findings.push(
                Finding::new(Severity::Warning,
                    "spacing",
                    format!("is {length_m:.2} m from the waypoint before it, within the DSP's acceptance radius of {radius_m} m"),
                )
                .by_m(radius_m - length_m)
                .with_next_step("leave one of them out")
                .about(leg.item)
                .on_leg(leg.number),
            );
        }
    }

    /// The bridge gives up a movement that takes too long.
    fn time_limit(&self, flight: &Flight, findings: &mut Findings) {
        let marks = timeline(flight, self.endurance);
        let time_of = |leg: u32| marks.iter().find(|mark| mark.leg == Some(leg));
        for (index, step) in flight.steps.iter().enumerate() {
            let Step::Path(_) = step else { continue };
            let legs = || flight.legs.iter().filter(|leg| leg.step == index);
            let (Some(first), Some(last)) = (legs().next(), legs().next_back()) else {
                continue;
            };
            let length_m: f64 = legs().map(Leg::length_m).sum();
            let limit_s = self.bridge.movement.time_limit(length_m).as_secs_f64();
            let begin = marks
                .iter()
                .take_while(|mark| mark.leg != Some(first.number))
                .last()
                .and_then(|mark| mark.time_s)
                .unwrap_or(0.0);
            let end = time_of(last.number).and_then(|mark| mark.time_s);
            if let Some(end) = end.filter(|end| end - begin > limit_s) {
                findings.push(
                    Finding::new(Severity::Error,
                        "movement-timeout",
                        format!("ends a path that takes {:.0} s; the bridge gives it up after {limit_s:.0} s", end - begin),
                    )
                    .with_next_step("fly faster, or raise `movement.time_limit_s` of bridge.toml")
                    .about(last.item)
                    .on_leg(last.number),
                );
            }
        }
    }
}

fn check_speed(item: u32, speed_mps: f64, findings: &mut Findings) {
    let Some(port) = port::port32(port::CRUISE_SPEED_MPS) else {
        return;
    };
    if !port.accepts(speed_mps as f32) {
        let text = format!(
            "asks for {speed_mps} m/s; the DSP takes {} to {} m/s",
            port.min, port.max
        );
        findings.push(Finding::new(Severity::Error, "speed", text).about(item));
    }
}
