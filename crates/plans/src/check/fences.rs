//! Each leg, and each end of a climb, against the robot's fence and against the plan's own, both as the bridge judges
//! them.

use bridge::BridgeConfig;
use bridge::safety::fence::{
    Area, AreaConfig, AreaKind, Breach, Fence, FenceConfig, FenceRule, Speeds,
};
use dsp_protocol::Waypoint;

use crate::finding::Findings;
use crate::flight::{Flight, Step};
use crate::model::{Action, FenceArea, FenceShape, Plan, Position};
use crate::site::{Site, Start};
use runtime::finding::{Finding, Severity};

/// Checks the flight against the fence that the robot has.
pub fn check_robot(rules: &BridgeConfig, flight: &Flight, site: &Site, findings: &mut Findings) {
    let fence = NamedFence {
        fence: &rules.fence,
        speeds: Some(rules.parameters.speeds()),
        prefix: "",
        owner: "the robot's fence",
        remedy: "change the plan, or `[fence]` of bridge.toml and `ril fence reload`",
    };
    fence.check(flight, site, findings);
}

/// Checks that no waypoint but that of a landing lies within the fence's margin of the ground of the take-off: a good
/// GPS strays so far.
pub fn check_ground(
    rules: &BridgeConfig,
    plan: &Plan,
    flight: &Flight,
    site: &Site,
    findings: &mut Findings,
) {
    if rules.safety.below_take_off {
        return;
    }
    let margin_m = FenceConfig::from(rules.fence.clone()).margin_m;
    for leg in &flight.legs {
        let action = plan
            .items
            .get(leg.item as usize - 1)
            .map(|item| &item.action);
        let is_landing = matches!(action, Some(Action::Land { .. } | Action::ReturnToLaunch));
        let ground_m = site.home.altitude_m;
        let near = || Breach::of_ground(&leg.to, ground_m + margin_m).filter(|_| !is_landing);
        let (breach, text) = match (Breach::of_ground(&leg.to, ground_m), near()) {
            (Some(breach), _) => (
                breach,
                "is reached below the ground of the take-off".to_owned(),
            ),
            (None, Some(breach)) => {
                let text =
                    "is reached less than the fence's margin above the ground of the take-off";
                (breach, format!("{text}, {margin_m} m"))
            }
            (None, None) => continue,
        };
        let finding = Finding::new(Severity::Error, "below-take-off", text).by_m(breach.amount_m);
        let remedy = "change its altitude; where the field falls away, set `below_take_off` in `[safety]` of bridge.toml";
        findings.push(
            finding
                .with_next_step(remedy)
                .about(leg.item)
                .on_leg(leg.number),
        );
    }
}

/// Checks the flight against the plan's own fence.
pub fn check_plan(plan: &Plan, flight: &Flight, site: &Site, findings: &mut Findings) {
    let fence = plan_fence(plan, findings);
    let fence = NamedFence {
        fence: &fence,
        // Where the plan's author wanted it to end: what stops in time is the robot's own.
        speeds: None,
        prefix: "plan-",
        owner: "the plan's own fence",
        remedy: "change the plan",
    };
    fence.check(flight, site, findings);
}

/// A fence, and how findings call it.
struct NamedFence<'a> {
    fence: &'a Fence,
    /// How fast the legs are flown, where the room to stop counts.
    speeds: Option<Speeds>,
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
        let mut step = None;
        for leg in &flight.legs {
            // Each path begins in a hover.
            let is_first = step.replace(leg.step) != Some(leg.step);
            for breach in self.fence.breaches_of_leg(&leg.from, &leg.to) {
                let finding = self.finding(&breach, "is reached");
                findings.push(finding.about(leg.item).on_leg(leg.number));
            }
            let speeds = self.speeds.map(|speeds| Speeds {
                cruise_mps: flight.speed_before(leg.step).unwrap_or(speeds.cruise_mps),
                begin_mps: if is_first { 0.0 } else { f64::INFINITY },
                ..speeds
            });
            let ahead =
                speeds.and_then(|speeds| self.fence.check_flight(&leg.from, &leg.to, &speeds));
            if let Some(breach) = ahead.filter(|breach| breach.rule == FenceRule::Ahead) {
                let finding = self.finding(&breach, "is reached");
                findings.push(finding.about(leg.item).on_leg(leg.number));
            }
        }
    }

    fn finding(&self, breach: &Breach, what: &str) -> Finding {
        let rule = match (self.prefix, breach.rule) {
            ("", FenceRule::Unjudgeable) => "fence-unjudgeable",
            ("", FenceRule::Floor) => "fence-floor",
            ("", FenceRule::Ceiling) => "fence-ceiling",
            ("", FenceRule::Exclusion) => "fence-exclusion",
            ("", FenceRule::Inclusion) => "fence-inclusion",
            (_, FenceRule::Ahead) => "fence-ahead",
            (_, FenceRule::Ground) => "below-take-off",
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
            (FenceRule::Ahead, _) => {
                format!("{what} too near to {owner}, or too fast to stop before it")
            }
            (FenceRule::Ground, _) => format!("{what} below the ground of the take-off"),
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
        Finding::new(Severity::Error, rule, text)
            .by_m(breach.amount_m)
            .with_next_step(self.remedy)
    }
}

/// The plan's own fence as the bridge judges it. An area that the bridge does not take is a finding.
fn plan_fence(plan: &Plan, findings: &mut Findings) -> Fence {
    let mut config = FenceConfig::default();
    for area in &plan.fence {
        match Area::try_from(area_config(area)) {
            Ok(area) => config.area.push(area),
            Err(error) => findings.push(
                Finding::new(
                    Severity::Error,
                    "plan-fence",
                    format!("the plan's own fence is not valid: {error}"),
                )
                .with_next_step("correct the fence in the program that made the plan"),
            ),
        }
    }
    Fence::try_from(config).unwrap_or_else(|error| {
        let text = format!("the plan's own fence is not valid: {error}");
        findings.push(Finding::new(Severity::Error, "plan-fence", text));
        Fence::default()
    })
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
            let pair = |at: &Position| [at.latitude_deg, at.longitude_deg];
            config.polygon = Some(vertices.iter().map(pair).collect());
        }
        FenceShape::Circle { centre, radius_m } => {
            config.centre = Some([centre.latitude_deg, centre.longitude_deg]);
            config.radius_m = Some(*radius_m);
        }
    }
    config
}
