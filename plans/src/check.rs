//! The checks of a flight, before anything of it is sent: the limits of the bridge and of the DSP, the fences, time and fuel.
//!
//! What the bridge checks when a request comes is asked of the bridge's own code: how it reads requests, how it measures
//! distances, and its geofence. So a plan without a finding is refused by none of these rules.

use bridge::BridgeConfig;
use bridge::flight::request::{RequestKey, parse_movement};
use bridge::safety::fence::{Area, AreaConfig, AreaKind, Breach, Fence, FenceConfig};
use dsp_protocol::{Command, Waypoint, port};
use ipc_types::payload::{MovementData, WaypointPosition};

use crate::finding::{Finding, Findings, Severity};
use crate::flight::{Flight, Leg, Step, ground_m};
use crate::model::{FenceArea, FenceShape, Plan};
use crate::site::{Endurance, HomeSource, Site, Start};
use crate::timeline::{Mark, timeline};

/// A planned home farther away than this from the point of take-off is worth a word, m.
const HOME_MOVED_M: f64 = 100.0;

/// So far may telemetry's altitude at home and the planned one be apart, m: a good GPS altitude and a map's.
const HOME_HEIGHT_M: f64 = 15.0;

/// All findings about `plan`, which becomes `flight` at `site`; the most severe first. `rules` is the bridge's configuration,
/// if it is known.
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
        findings.push(Finding::forbids(
            "empty",
            "there is nothing in it that can be flown",
        ));
    }
    let limits = Limits {
        bridge: rules.unwrap_or(&defaults),
        endurance,
    };
    limits.check(flight, &mut findings);
    match rules {
        Some(rules) => {
            let fence = NamedFence {
                fence: &rules.fence,
                prefix: "",
                owner: "the robot's fence",
                remedy: "change the plan, or `[fence]` of bridge.toml and `ril fence reload`",
            };
            fence.check(flight, site, &mut findings);
        }
        None => findings.push(
            Finding::not_checked(
                "robot-rules",
                "the robot's geofence is not known, and its limits are taken to be the defaults",
            )
            .remedy("name its configuration: `--bridge bridge.toml`"),
        ),
    }
    let own = plan_fence(plan, &mut findings);
    let own = NamedFence {
        fence: &own,
        prefix: "plan-",
        owner: "the plan's own fence",
        remedy: "change the plan",
    };
    own.check(flight, site, &mut findings);
    check_endurance(flight, endurance, &mut findings);
    findings.sorted()
}

fn check_home(plan: &Plan, site: &Site, findings: &mut Findings) {
    if site.home_source == HomeSource::Assumed {
        let (severity, text) = match site.is_for_flight {
            true => (
                Severity::Forbids,
                "home is not known: the helicopter is in the air already",
            ),
            false => (
                Severity::NotChecked,
                "home is not known: the take-off is taken to be below the first place of the plan, at altitude 0",
            ),
        };
        findings.push(
            Finding::new(severity, "home-unknown", text)
                .remedy("say where the take-off was, or will be: `--home LAT,LON,ALT`"),
        );
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
            Finding::warns(
                "home-moved",
                "the plan was made for another place of take-off",
            )
            .by_m(distance_m),
        );
    }
    let height_m = planned.above_sea_m.map(|above_sea_m| {
        site.home.altitude_m + site.zero_above_sea_m.unwrap_or(0.0) - above_sea_m
    });
    if let Some(height_m) = height_m.filter(|height_m| height_m.abs() > HOME_HEIGHT_M) {
        findings.push(
            Finding::warns(
                "home-height",
                "home is not as high above sea level as the plan has it",
            )
            .by_m(height_m.abs())
            .remedy("check `[plan] zero_above_sea_m` in ril.toml"),
        );
    }
}

/// The limits of the bridge's `[movement]` and of the DSP.
struct Limits<'a> {
    bridge: &'a BridgeConfig,
    endurance: &'a Endurance,
}

impl Limits<'_> {
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
        parse_movement(RequestKey::Movement(0), request, &self.bridge.movement)
            .1
            .is_ok()
    }

    fn take_off(&self, item: Option<u32>, height_m: f64, findings: &mut Findings) {
        if self.accepts(&MovementData::take_off(0, height_m)) {
            return;
        }
        let text = match port::port32(port::TAKE_OFF_ALTITUDE_M) {
            Some(port) => format!(
                "takes off to {height_m:.1} m; the DSP takes {} to {} m over the point of take-off",
                port.min, port.max
            ),
            None => format!("takes off to {height_m:.1} m, which the DSP does not take"),
        };
        let excess_m = port::port32(port::TAKE_OFF_ALTITUDE_M)
            .map(|port| (height_m - f64::from(port.max)).max(f64::from(port.min) - height_m));
        findings.push(Finding {
            items: item.into_iter().collect(),
            amount_m: excess_m,
            ..Finding::forbids("take-off-altitude", text)
                .remedy("take off to less, then climb on a leg")
        });
    }

    fn waypoint(&self, leg: &Leg, findings: &mut Findings) {
        let position = [WaypointPosition {
            latitude_deg: leg.to.latitude_deg,
            longitude_deg: leg.to.longitude_deg,
            altitude_m: leg.to.altitude_m,
        }];
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
            Finding::forbids(
                "altitude-range",
                format!("leads to {altitude_m:.1} m; `[movement]` of bridge.toml allows {min_m} to {max_m} m"),
            )
            .by_m((altitude_m - max_m).max(min_m - altitude_m))
            .item(leg.item)
            .leg(leg.number),
        );
    }

    fn distance(&self, leg: &Leg, findings: &mut Findings) {
        let most_m = self.bridge.movement.max_distance_m;
        let distance_m = ground_m(&leg.path_start, &leg.to);
        if distance_m > most_m {
            findings.push(
                Finding::forbids(
                    "max-distance",
                    format!("is {distance_m:.0} m from where its path is sent; the bridge takes {most_m} m"),
                )
                .by_m(distance_m - most_m)
                .remedy("put a hold in between, or raise `movement.max_distance_m` of bridge.toml")
                .item(leg.item)
                .leg(leg.number),
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
                Finding::warns(
                    "spacing",
                    format!("is {length_m:.2} m from the waypoint before it, within the DSP's acceptance radius of {radius_m} m"),
                )
                .by_m(radius_m - length_m)
                .remedy("leave one of them out")
                .item(leg.item)
                .leg(leg.number),
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
                    Finding::forbids(
                        "movement-timeout",
                        format!("ends a path that takes {:.0} s; the bridge gives it up after {limit_s:.0} s", end - begin),
                    )
                    .remedy("fly faster, or raise `movement.time_limit_s` of bridge.toml")
                    .item(last.item)
                    .leg(last.number),
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
        findings.push(Finding::forbids("speed", text).item(item));
    }
}

/// A fence, and how findings call it.
struct NamedFence<'a> {
    fence: &'a Fence,
    prefix: &'static str,
    owner: &'static str,
    remedy: &'static str,
}

impl NamedFence<'_> {
    fn check(&self, flight: &Flight, site: &Site, findings: &mut Findings) {
        let mut ground = match site.start {
            Start::Ground(at) => at,
            Start::Flying(_) => site.home,
        };
        for step in &flight.steps {
            if let Step::TakeOff { item, height_m } = step {
                let top = Waypoint {
                    altitude_m: ground.altitude_m + height_m,
                    ..ground
                };
                if let Some(breach) = self.fence.check_point(&top) {
                    let mut finding = self.finding(&breach, "ends its climb");
                    finding.items.extend(item);
                    findings.push(finding);
                }
            }
            if let Step::Path(path) = step
                && let Some(last) = path.last()
            {
                ground = Waypoint {
                    altitude_m: site.home.altitude_m,
                    ..last.waypoint
                };
            }
        }
        for leg in &flight.legs {
            for breach in self.fence.breaches_of_leg(&leg.from, &leg.to) {
                let finding = self.finding(&breach, "is reached");
                findings.push(finding.item(leg.item).leg(leg.number));
            }
        }
    }

    fn finding(&self, breach: &Breach, what: &str) -> Finding {
        use bridge::safety::fence::FenceRule;
        let rule = match (self.prefix, breach.rule) {
            ("", FenceRule::Unjudgeable) => "fence-unjudgeable",
            ("", FenceRule::Floor) => "fence-floor",
            ("", FenceRule::Ceiling) => "fence-ceiling",
            ("", FenceRule::Exclusion) => "fence-exclusion",
            ("", FenceRule::Inclusion) => "fence-inclusion",
            (_, FenceRule::Unjudgeable) => "plan-fence-unjudgeable",
            (_, FenceRule::Floor) => "plan-fence-floor",
            (_, FenceRule::Ceiling) => "plan-fence-ceiling",
            (_, FenceRule::Exclusion) => "plan-fence-exclusion",
            (_, FenceRule::Inclusion) => "plan-fence-inclusion",
        };
        let owner = self.owner;
        let area = breach.area.and_then(|area| self.fence.area_name(area));
        let text = match (breach.rule, area) {
            (FenceRule::Unjudgeable, _) => {
                format!(
                    "{what} by a leg that {owner} cannot judge: too long, or too near to a pole"
                )
            }
            (FenceRule::Floor, _) => format!("{what} below the floor of {owner}"),
            (FenceRule::Ceiling, _) => format!("{what} above the ceiling of {owner}"),
            (FenceRule::Exclusion, Some(area)) => {
                format!("{what} through the exclusion area `{area}` of {owner}")
            }
            (FenceRule::Inclusion, Some(area)) => {
                format!("{what} outside the inclusion areas of {owner}; the nearest is `{area}`")
            }
            (_, None) => format!("{what} in breach of {owner}"),
        };
        Finding::forbids(rule, text)
            .by_m(breach.amount_m)
            .remedy(self.remedy)
    }
}

/// The plan's own fence as the bridge judges it. An area that the bridge does not take is a finding.
fn plan_fence(plan: &Plan, findings: &mut Findings) -> Fence {
    let mut config = FenceConfig::default();
    for area in &plan.fence {
        match bridge_area(area) {
            Ok(area) => config.area.push(area),
            Err(error) => findings.push(
                Finding::forbids(
                    "plan-fence",
                    format!("the plan's own fence is not valid: {error}"),
                )
                .remedy("mend the fence in the program that made the plan"),
            ),
        }
    }
    Fence::try_from(config).unwrap_or_else(|error| {
        let text = format!("the plan's own fence is not valid: {error}");
        findings.push(Finding::forbids("plan-fence", text));
        Fence::default()
    })
}

/// An area as the bridge's configuration has it.
///
/// # Errors
///
/// What the bridge does not take.
pub fn bridge_area(area: &FenceArea) -> Result<Area, String> {
    Area::try_from(area_config(area)).map_err(|error| error.to_string())
}

/// An area with the members of `[[fence.area]]`.
pub fn area_config(area: &FenceArea) -> AreaConfig {
    let mut config = AreaConfig {
        name: area.name.clone(),
        kind: match area.is_inclusion {
            true => AreaKind::Inclusion,
            false => AreaKind::Exclusion,
        },
        polygon: None,
        centre: None,
        radius_m: None,
        floor_m: None,
        ceiling_m: None,
    };
    match &area.shape {
        FenceShape::Polygon(vertices) => {
            let pair = |at: &crate::model::Position| [at.latitude_deg, at.longitude_deg];
            config.polygon = Some(vertices.iter().map(pair).collect());
        }
        FenceShape::Circle { centre, radius_m } => {
            config.centre = Some([centre.latitude_deg, centre.longitude_deg]);
            config.radius_m = Some(*radius_m);
        }
    }
    config
}

fn check_endurance(flight: &Flight, endurance: &Endurance, findings: &mut Findings) {
    let marks = timeline(flight, endurance);
    let (Some(last), Some(endurance_s)) = (marks.last(), endurance.endurance_s) else {
        if !flight.steps.is_empty() {
            findings.push(
                Finding::not_checked(
                    "endurance",
                    "whether battery and fuel last is not checked: how long they do is not configured",
                )
                .remedy("set `endurance_s` and `cruise_speed_mps` under `[plan]` of ril.toml"),
            );
        }
        return;
    };
    let Some(total_s) = last.time_s else {
        findings.push(
            Finding::not_checked(
                "endurance",
                "whether battery and fuel last is not checked: the cruise speed is not known",
            )
            .remedy("set `cruise_speed_mps` under `[plan]` of ril.toml"),
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
        ..Finding::forbids(
            "endurance",
            format!(
                "is reached too late: the flight takes {total_s:.0} s, battery and fuel last {endurance_s:.0} s, of which {:.0} s \
                 are reserve",
                endurance.reserve_s
            ),
        )
        .by_m(left_m)
        .remedy("divide the plan, or correct `[plan]` of ril.toml")
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
