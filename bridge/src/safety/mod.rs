//! The rules of flight safety that the bridge enforces itself, whatever a module asks for (requirement H7;
//! `docs/safety.md`): the pilot's switch, the geofence, battery and fuel, and the reaction to a lost position or link.
//!
//! A pure judge: it is given positions, supplies and requests, and says which rule is broken and what is to be done.
//! [`Flight`](crate::flight::Flight) does it. `config` has the limits; [`fence`] judges points and legs. Nothing is
//! enforced against a landing but the pilot's switch: the ground is where a helicopter in trouble belongs.

mod config;
pub mod fence;

use std::time::Duration;

use dsp_protocol::Waypoint;
use dsp_protocol::downlink::{Geographic, Supply};
use ipc_types::MonotonicNs;
use ipc_types::code::{PilotSwitch, Reason, SafetyAction, SafetyRule};
use ipc_types::payload::{PortInfo, SafetyState};
use serde::{Deserialize, Serialize};

pub use config::{BreachAction, SafetyConfig, SupplyLimits};

use crate::geodesy::here;
use fence::{Breach, Fence, FenceRule, Speeds, Velocity};

/// The name of an area of the geofence as it lies in a report: what does not fit is cut off.
pub type AreaName = [u8; 32];

/// A rule that is broken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Violation {
    /// The rule that is broken.
    pub rule: SafetyRule,
    /// What is to be done.
    pub action: SafetyAction,
    /// By how much, in the rule's unit.
    pub amount: f64,
}

impl Violation {
    /// The reason that a report gives.
    pub fn reason(self) -> Reason {
        match self.rule {
            SafetyRule::PilotSwitch => Reason::PilotHasControl,
            SafetyRule::FenceInclusion
            | SafetyRule::FenceExclusion
            | SafetyRule::FenceFloor
            | SafetyRule::FenceCeiling
            | SafetyRule::FenceUnjudgeable
            | SafetyRule::FenceAhead
            | SafetyRule::BelowTakeOff => Reason::FenceBreach,
            SafetyRule::Battery | SafetyRule::Fuel => Reason::SupplyLow,
            SafetyRule::LinkLoss => Reason::LinkLost,
            SafetyRule::PositionLost => Reason::NoPosition,
        }
    }
}

/// What is known of the helicopter now; what is too old is `None`.
#[derive(Clone, Copy, Debug, Default)]
pub struct SafetyFacts {
    /// Where it is.
    pub position: Option<Geographic>,
    /// The last sample had a position.
    pub has_position: bool,
    /// How it moves.
    pub velocity: Option<Velocity>,
    /// Battery, fuel and the pilot's switch.
    pub supply: Option<Supply>,
}

/// What is judged now of the rules about places.
#[derive(Clone, Copy, Debug)]
pub struct Judged {
    /// Whether the helicopter is inside the geofence.
    pub fence: bool,
    /// Whether it could stop before it is outside.
    pub ahead: bool,
    /// Whether its position is lost.
    pub position: bool,
}

/// A movement that a broken rule refuses or ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intervention {
    /// The rule.
    pub violation: Violation,
    /// The leg that breaks it, by the number of the waypoint at its end, counted from 1; 0 for none.
    pub leg: u32,
    /// The area of the geofence, as a report names it; empty for another rule.
    pub area: AreaName,
}

/// The judge of the rules.
#[derive(Debug, Serialize, Deserialize)]
pub struct Safety {
    #[serde(skip)]
    config: SafetyConfig,
    /// The geofence in force: that of the configuration, or the one that was read since. A snapshot has it apart from
    /// this.
    #[serde(skip)]
    pub(crate) fence: Fence,
    battery: SupplyWatch,
    fuel: SupplyWatch,
    position: PositionWatch,
    /// When a path was lost with the link; `None` once the reaction has begun.
    path_lost: Option<MonotonicNs>,
    /// The pilot's switch was on manual when the helicopter was last looked at.
    is_manual: bool,
    /// The most severe rule that is broken now.
    pub(crate) present: Option<Violation>,
    interventions: u32,
}

impl Safety {
    /// Nothing has been seen.
    pub fn new(config: &SafetyConfig, fence: &Fence) -> Self {
        Safety {
            config: config.clone(),
            fence: fence.clone(),
            battery: SupplyWatch::new(SafetyRule::Battery, config.battery_v),
            fuel: SupplyWatch::new(SafetyRule::Fuel, config.fuel_percent),
            position: PositionWatch::default(),
            path_lost: None,
            is_manual: false,
            present: None,
            interventions: 0,
        }
    }

    /// After a snapshot: takes over what the configuration says, and the geofence in force.
    pub(crate) fn configure(&mut self, config: &SafetyConfig, fence: Fence) {
        self.config = config.clone();
        self.battery.limits = config.battery_v;
        self.fuel.limits = config.fuel_percent;
        self.fence = fence;
    }

    /// The first leg of `path`, flown from `from`, that the geofence forbids.
    pub(crate) fn check_path(
        &self,
        from: &Geographic,
        path: &[Waypoint],
    ) -> Option<(usize, Breach)> {
        self.fence.check_path(&here(from), path)
    }

    /// A path ended because the link or the DSP was lost.
    pub fn movement_lost(&mut self, reason: Reason, now: MonotonicNs) {
        if reason == Reason::CommunicationFatalError {
            self.path_lost = Some(now);
        }
    }

    /// The DSP can be reached again. If a path was lost with the link, gives the rule about that, with the configured
    /// action.
    pub(crate) fn link_back(&mut self, now: MonotonicNs) -> Option<Violation> {
        let lost = self.path_lost.take()?;
        Some(Violation {
            rule: SafetyRule::LinkLoss,
            action: action_of(self.config.link_loss),
            amount: now.since(lost).as_secs_f64(),
        })
    }

    /// Whether the rules allow this kind of movement now. Legs are checked by themselves.
    ///
    /// # Errors
    /// The refusal, with the rule.
    pub fn check_movement(
        &mut self,
        is_hold_or_landing: bool,
        facts: &SafetyFacts,
    ) -> Result<(), Intervention> {
        if let Some(violation) = self.pilot(facts) {
            return Err(self.intervene(violation, 0, AreaName::default()));
        }
        if let Some(violation) = self.position.violation
            && violation.action != SafetyAction::Warn
            && !is_hold_or_landing
        {
            return Err(self.intervene(violation, 0, AreaName::default()));
        }
        match self.present {
            Some(violation) if !is_hold_or_landing && is_about_supply(violation) => {
                Err(self.intervene(violation, 0, AreaName::default()))
            }
            _ => Ok(()),
        }
    }

    /// Whether the geofence allows to hover where the take-off ends.
    ///
    /// # Errors
    /// The refusal, with the rule and by how much it would be broken.
    pub fn check_take_off(&mut self, from: &Geographic, height_m: f32) -> Result<(), Intervention> {
        let top = Waypoint {
            altitude_m: from.altitude_m + f64::from(height_m),
            ..here(from)
        };
        match self.fence.check_point(&top) {
            Some(breach) => Err(self.breach(breach, 0)),
            None => Ok(()),
        }
    }

    /// Whether the geofence, and the ground of the take-off, allow the leg, which leads to the waypoint `leg`, counted
    /// from 1.
    ///
    /// # Errors
    /// The refusal, with the rule, the leg and by how much the rule would be broken.
    pub fn check_leg(
        &mut self,
        from: &Waypoint,
        to: &Waypoint,
        leg: usize,
        speeds: &Speeds,
        ground_m: Option<f64>,
    ) -> Result<(), Intervention> {
        let ground_m = ground_m.filter(|_| !self.config.below_take_off);
        let into_ground = ground_m.and_then(|ground_m| Breach::of_ground(to, ground_m));
        match into_ground.or_else(|| self.fence.check_flight(from, to, speeds)) {
            Some(breach) => Err(self.breach(breach, leg)),
            None => Ok(()),
        }
    }

    /// The geofence refuses or ends a movement.
    pub(crate) fn breach(&mut self, breach: Breach, leg: usize) -> Intervention {
        let area = self.name_of(&breach);
        self.intervene(refuse(breach), leg, area)
    }

    /// A rule refuses or ends a movement; `area` is that of the geofence that is broken.
    pub(crate) fn intervene(
        &mut self,
        violation: Violation,
        leg: usize,
        area: AreaName,
    ) -> Intervention {
        self.count_intervention();
        let leg = leg as u32;
        Intervention {
            violation,
            leg,
            area,
        }
    }

    /// The area of the geofence, if that is the rule that is broken now: the one that the helicopter is in or left, or
    /// comes near to.
    pub(crate) fn present_area(&self, facts: &SafetyFacts) -> AreaName {
        let is_fence = |violation: &Violation| violation.reason() == Reason::FenceBreach;
        let breach = self.present.filter(is_fence).zip(facts.position);
        let breach = breach.and_then(|(_, position)| {
            let at = here(&position);
            let ahead = || self.fence.check_ahead(&at, &facts.velocity?);
            self.fence.check_point(&at).or_else(ahead)
        });
        breach.map_or(AreaName::default(), |breach| self.name_of(&breach))
    }

    fn name_of(&self, breach: &Breach) -> AreaName {
        let name = breach.area.and_then(|area| self.fence.area_name(area));
        name.map_or(AreaName::default(), PortInfo::name_bytes)
    }

    /// # Panics
    /// When a rule is broken and the most severe one is not, which is a defect.
    pub(crate) fn assert_sound(&self) {
        let PositionWatch {
            missing_since,
            was_known,
            is_lost,
            violation,
            ..
        } = &self.position;
        debug_assert!(!is_lost || missing_since.is_some() && *was_known);
        debug_assert!(violation.is_none() || *is_lost);
        let severity = |violation: &Option<Violation>| violation.map(|one| one.action.code());
        debug_assert!(severity(violation) <= severity(&self.present), "{self:?}");
    }

    /// One more movement was refused or ended.
    pub(crate) fn count_intervention(&mut self) {
        self.interventions = self.interventions.saturating_add(1);
    }

    /// The rule that is broken, and what it does: what tells one violation from another.
    fn present_rule(&self) -> Option<(SafetyRule, SafetyAction)> {
        self.present
            .map(|violation| (violation.rule, violation.action))
    }

    /// Judges all rules, keeps the most severe one that is broken, and returns whether that is another rule or action
    /// than before. A changed amount does not count.
    pub(crate) fn look(&mut self, facts: &SafetyFacts, now: MonotonicNs, judged: Judged) -> bool {
        let before = self.present_rule();
        let supply = facts.supply;
        let hold_for = Duration::from_secs_f64(self.config.supply_for_s);
        let battery_v = supply.map(|supply| f64::from(supply.battery_mv) / 1000.0);
        let fuel_percent = supply.map(|supply| f64::from(supply.fuel_percent));
        let violations = [
            self.pilot(facts),
            self.battery.look(battery_v, now, hold_for),
            self.fuel.look(fuel_percent, now, hold_for),
            self.look_for_position(facts, now, judged.position),
            self.outside(facts).filter(|_| judged.fence),
            self.ahead(facts, judged.ahead),
        ];
        // Of several rules of one severity, the first one counts: `max_by_key` gives the last.
        self.present = violations
            .into_iter()
            .rev()
            .flatten()
            .max_by_key(|violation| violation.action.code());
        before != self.present_rule()
    }

    /// No status has come for so long that nothing is known any more. Judges the position alone, unless the pilot flew;
    /// what another rule said stays, if it is more severe. Returns what [`look`](Self::look) returns.
    pub(crate) fn miss_position(&mut self, now: MonotonicNs, is_judged: bool) -> bool {
        let before = self.present_rule();
        let nothing = SafetyFacts::default();
        let lost = self.look_for_position(&nothing, now, is_judged && !self.is_manual);
        let severity = |violation: Option<Violation>| violation.map(|one| one.action.code());
        if lost.is_some() && severity(self.present) <= severity(lost) {
            self.present = lost;
        }
        before != self.present_rule()
    }

    /// Whether the pilot has just taken over, whatever rule is the most severe one.
    pub(crate) fn is_taken_over(&mut self, facts: &SafetyFacts) -> bool {
        let is_manual = self.pilot(facts).is_some();
        let was_manual = std::mem::replace(&mut self.is_manual, is_manual);
        is_manual && !was_manual
    }

    fn pilot(&self, facts: &SafetyFacts) -> Option<Violation> {
        (self.config.pilot_switch && switch(facts) == PilotSwitch::Manual).then_some(Violation {
            rule: SafetyRule::PilotSwitch,
            action: SafetyAction::Hold,
            amount: 0.0,
        })
    }

    /// Whether the position is lost. While the pilot flies, the bridge does not need it.
    fn look_for_position(
        &mut self,
        facts: &SafetyFacts,
        now: MonotonicNs,
        is_judged: bool,
    ) -> Option<Violation> {
        let lasts = Duration::from_secs_f64(self.config.position_lost_s);
        let lost_for = self.position.look(facts.has_position, now, lasts);
        let is_judged = is_judged && switch(facts) != PilotSwitch::Manual;
        let lost_for = lost_for.filter(|_| is_judged);
        self.position.violation = lost_for.map(|lost_for| Violation {
            rule: SafetyRule::PositionLost,
            action: action_of(self.config.position_lost),
            amount: lost_for.as_secs_f64(),
        });
        self.position.violation
    }

    /// Whether the helicopter would leave the fence if it flew on and then stopped. It is held and not landed, because
    /// it is still inside. A breach that was found on a path is shown until it is over.
    fn ahead(&self, facts: &SafetyFacts, is_judged: bool) -> Option<Violation> {
        let was_found =
            self.present.map(|violation| violation.rule) == Some(SafetyRule::FenceAhead);
        let breach = self
            .fence
            .check_ahead(&here(&facts.position?), &facts.velocity?);
        let breach = breach.filter(|_| is_judged || was_found)?;
        let action = match self.config.fence_breach {
            BreachAction::Warn => SafetyAction::Warn,
            BreachAction::Hold | BreachAction::Land => SafetyAction::Hold,
        };
        Some(Violation {
            action,
            ..refuse(breach)
        })
    }

    fn outside(&self, facts: &SafetyFacts) -> Option<Violation> {
        let position = facts.position?;
        let breach = self.fence.check_point(&here(&position))?;
        Some(Violation {
            action: action_of(self.config.fence_breach),
            ..refuse(breach)
        })
    }

    /// What is published about the rules.
    pub fn published(&self, facts: &SafetyFacts) -> SafetyState {
        SafetyState {
            amount: self.present.map_or(0.0, |violation| violation.amount),
            rule: self.present.map_or(0, |violation| violation.rule.code()),
            action: self.present.map_or(0, |violation| violation.action.code()),
            pilot_switch: switch(facts).code(),
            fence_areas: self.fence.areas() as u32,
            interventions: self.interventions,
            reserved: 0,
        }
    }
}

/// Whether the position is lost: unknown for a configured time. It is found again when it was known for that long.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct PositionWatch {
    /// Since when it is lost, or seems to be.
    missing_since: Option<MonotonicNs>,
    /// Since when it is known; `None` while it is not.
    known_since: Option<MonotonicNs>,
    /// Whether it was ever known: only then can it be lost.
    was_known: bool,
    is_lost: bool,
    /// What the rule says now.
    violation: Option<Violation>,
}

impl PositionWatch {
    /// For how long it has been lost; `None` if it is not.
    fn look(&mut self, is_known: bool, now: MonotonicNs, lasts: Duration) -> Option<Duration> {
        self.was_known |= is_known;
        if is_known {
            let since = *self.known_since.get_or_insert(now);
            if !self.is_lost || now.since(since) >= lasts {
                self.is_lost = false;
                self.missing_since = None;
            }
        } else if self.was_known {
            self.known_since = None;
            let since = *self.missing_since.get_or_insert(now);
            self.is_lost |= now.since(since) >= lasts;
        }
        let since = self.missing_since.filter(|_| self.is_lost)?;
        Some(now.since(since))
    }
}

/// Battery or fuel against its limits.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct SupplyWatch {
    rule: SafetyRule,
    #[serde(skip)]
    limits: SupplyLimits,
    /// Since when the supply is below each limit, in the order of their severity.
    below_since: [Option<MonotonicNs>; 4],
}

impl SupplyWatch {
    fn new(rule: SafetyRule, limits: SupplyLimits) -> Self {
        SupplyWatch {
            rule,
            limits,
            below_since: [None; 4],
        }
    }

    /// The most severe limit that `value` has been below for `hold_for`. Without a value nothing changes: a missing
    /// group neither starts an action nor ends one.
    fn look(
        &mut self,
        value: Option<f64>,
        now: MonotonicNs,
        hold_for: Duration,
    ) -> Option<Violation> {
        let value = value?;
        let mut worst = None;
        for ((action, limit), since) in self.limits.steps().zip(&mut self.below_since) {
            if value >= limit {
                *since = None;
                continue;
            }
            if now.since(*since.get_or_insert(now)) >= hold_for {
                worst = Some(Violation {
                    rule: self.rule,
                    action,
                    amount: limit - value,
                });
            }
        }
        worst
    }
}

fn is_about_supply(violation: Violation) -> bool {
    matches!(violation.rule, SafetyRule::Battery | SafetyRule::Fuel)
        && violation.action != SafetyAction::Warn
}

fn switch(facts: &SafetyFacts) -> PilotSwitch {
    match facts.supply.map(|supply| supply.auto_switch) {
        Some(0) => PilotSwitch::Manual,
        Some(_) => PilotSwitch::Auto,
        None => PilotSwitch::Unknown,
    }
}

/// The action that the configuration names.
fn action_of(action: BreachAction) -> SafetyAction {
    match action {
        BreachAction::Warn => SafetyAction::Warn,
        BreachAction::Hold => SafetyAction::Hold,
        BreachAction::Land => SafetyAction::Land,
    }
}

/// The violation that a breach of the geofence is, when it refuses something.
fn refuse(breach: Breach) -> Violation {
    let rule = match breach.rule {
        FenceRule::Inclusion => SafetyRule::FenceInclusion,
        FenceRule::Exclusion => SafetyRule::FenceExclusion,
        FenceRule::Floor => SafetyRule::FenceFloor,
        FenceRule::Ceiling => SafetyRule::FenceCeiling,
        FenceRule::Unjudgeable => SafetyRule::FenceUnjudgeable,
        FenceRule::Ahead => SafetyRule::FenceAhead,
        FenceRule::Ground => SafetyRule::BelowTakeOff,
    };
    Violation {
        rule,
        action: SafetyAction::Refuse,
        amount: breach.amount_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: SupplyLimits = SupplyLimits {
        warn: Some(24.0),
        refuse: Some(23.0),
        hold: None,
        land: Some(22.0),
    };

    fn at(second: u64) -> MonotonicNs {
        MonotonicNs(second * 1_000_000_000)
    }

    #[test]
    fn a_supply_must_be_below_its_limit_for_a_time() {
        let mut watch = SupplyWatch::new(SafetyRule::Battery, LIMITS);
        let hold_for = Duration::from_secs(2);
        // Second, volts, action, by how much.
        let table = [
            (0, 24.5, None),
            (1, 22.5, None),
            (2, 24.5, None),
            (3, 22.5, None),
            (4, 22.5, None),
            (5, 22.5, Some((SafetyAction::Refuse, 0.5))),
            (6, 21.5, Some((SafetyAction::Refuse, 1.5))),
            (8, 21.5, Some((SafetyAction::Land, 0.5))),
            (9, 23.5, Some((SafetyAction::Warn, 0.5))),
            (10, 24.0, None),
        ];
        for (second, volts, expected) in table {
            let violation = watch.look(Some(volts), at(second), hold_for);
            let found = violation.map(|violation| (violation.action, violation.amount));
            assert_eq!(found, expected, "second {second}");
        }
        assert_eq!(watch.look(None, at(11), hold_for), None);
    }

    #[test]
    fn a_breach_is_told_with_its_rule_and_amount() {
        use {FenceRule as F, SafetyRule as S};
        for (rule, expected) in [
            (F::Unjudgeable, S::FenceUnjudgeable),
            (F::Floor, S::FenceFloor),
            (F::Ceiling, S::FenceCeiling),
            (F::Exclusion, S::FenceExclusion),
            (F::Inclusion, S::FenceInclusion),
            (F::Ground, S::BelowTakeOff),
            (F::Ahead, S::FenceAhead),
        ] {
            let (amount_m, area) = (2.5, None);
            let violation = refuse(Breach {
                rule,
                amount_m,
                area,
            });
            assert_eq!((violation.rule, violation.amount), (expected, amount_m));
            assert_eq!(violation.reason(), Reason::FenceBreach);
        }
    }

    #[test]
    fn a_position_is_lost_and_found_after_a_time() {
        let lasts = Duration::from_secs(5);
        // Second, whether it is known, for how long it has been lost.
        let table = [
            (0, false, None),
            (9, false, None),
            (10, true, None),
            (11, false, None),
            (15, false, None),
            (16, false, Some(5)),
            (17, true, Some(6)),
            (21, true, Some(10)),
            (21, false, Some(10)),
            (22, true, Some(11)),
            (27, true, None),
            (28, false, None),
            (29, true, None),
            (33, false, None),
        ];
        let mut watch = PositionWatch::default();
        for (second, is_known, expected) in table {
            let found = watch.look(is_known, at(second), lasts);
            assert_eq!(found, expected.map(Duration::from_secs), "second {second}");
        }
    }

    fn facts(auto_switch: u8) -> SafetyFacts {
        let mut supply = crate::translate::tests::full().supply;
        supply
            .iter_mut()
            .for_each(|supply| supply.auto_switch = auto_switch);
        SafetyFacts {
            supply,
            has_position: true,
            ..SafetyFacts::default()
        }
    }

    #[test]
    fn without_a_status_the_position_alone_is_judged_and_a_more_severe_rule_stays() {
        let config = SafetyConfig {
            position_lost: BreachAction::Hold,
            position_lost_s: 2.0,
            ..SafetyConfig::default()
        };
        let judged = Judged {
            fence: true,
            ahead: true,
            position: true,
        };
        let rule = |rule, action| Violation {
            rule,
            action,
            amount: 1.0,
        };
        let lost = Some((SafetyRule::PositionLost, SafetyAction::Hold));
        for (other, is_shown) in [
            (None, true),
            (Some(rule(SafetyRule::Battery, SafetyAction::Warn)), true),
            (
                Some(rule(SafetyRule::FenceCeiling, SafetyAction::Hold)),
                true,
            ),
            (Some(rule(SafetyRule::Fuel, SafetyAction::Land)), false),
        ] {
            for (is_judged, auto_switch) in [(true, 1), (false, 1), (true, 0)] {
                let mut safety = Safety::new(&config, &Fence::default());
                let facts = facts(auto_switch);
                safety.look(&facts, at(0), judged);
                safety.is_taken_over(&facts);
                safety.present = other;
                let before = safety.present_rule();
                for second in [1, 2, 3, 4] {
                    let is_lost = second >= 3 && is_judged && auto_switch == 1 && is_shown;
                    let expected = if is_lost { lost } else { before };
                    let is_changed = second == 3 && is_lost;
                    assert_eq!(safety.miss_position(at(second), is_judged), is_changed);
                    assert_eq!(
                        safety.present_rule(),
                        expected,
                        "{other:?}, second {second}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_pilot_takes_over_once_each_time_that_the_switch_goes_to_manual() {
        let mut safety = Safety::new(&SafetyConfig::default(), &Fence::default());
        for (auto_switch, expected) in [(1, false), (0, true), (0, false), (1, false), (0, true)] {
            assert_eq!(safety.is_taken_over(&facts(auto_switch)), expected);
        }
    }
}
