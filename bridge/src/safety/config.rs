//! `[safety]` of `bridge.toml`: the limits of the rules; those of the geofence are `[fence]`.

use ipc_types::code::SafetyAction;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

runtime::ranged! {
    fn seconds(f64) in 0.1..=86_400.0;
}

/// `[safety]`: the rules that the bridge enforces in flight (`docs/safety.md`).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyConfig {
    /// Whether the pilot's switch on manual refuses movements and ends the one under way.
    pub pilot_switch: bool,
    /// Whether a waypoint may lie below the ground of the take-off.
    pub below_take_off: bool,
    /// What happens when the helicopter itself is outside the geofence.
    pub fence_breach: BreachAction,
    /// What happens when the position is lost in flight.
    pub position_lost: BreachAction,
    /// How long the position must be unknown before it is lost, and known again before it is found.
    #[serde(deserialize_with = "seconds")]
    pub position_lost_s: f64,
    /// What happens when the link comes back after it was lost on a path or in a hold.
    pub link_loss: BreachAction,
    /// How long a supply must be below a limit before the rule acts.
    #[serde(deserialize_with = "seconds")]
    pub supply_for_s: f64,
    /// Battery limits, V.
    #[serde(deserialize_with = "falling")]
    pub battery_v: SupplyLimits,
    /// Fuel limits, %.
    #[serde(deserialize_with = "falling")]
    pub fuel_percent: SupplyLimits,
}

impl Default for SafetyConfig {
    fn default() -> Self {
        SafetyConfig {
            pilot_switch: true,
            below_take_off: false,
            fence_breach: BreachAction::Hold,
            // What PX4 (descend) and ArduPilot (FS_EKF_ACTION) do: a hover without a position drifts without a bound.
            position_lost: BreachAction::Land,
            // For so long PX4 goes on without aid (EKF2_NOAID_TOUT).
            position_lost_s: 5.0,
            link_loss: BreachAction::Hold,
            supply_for_s: 2.0,
            battery_v: SupplyLimits::default(),
            fuel_percent: SupplyLimits::default(),
        }
    }
}

/// What is done about a broken rule in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BreachAction {
    /// It is shown and logged.
    Warn,
    /// A path is ended; the helicopter hovers.
    Hold,
    /// A path is ended, and the bridge orders a landing.
    Land,
}

/// Limits of a supply; one that is not given is not watched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct SupplyLimits {
    /// Below this it is shown and logged.
    pub warn: Option<f64>,
    /// Below this no movement begins but landing.
    pub refuse: Option<f64>,
    /// Below this a path is ended; the helicopter hovers.
    pub hold: Option<f64>,
    /// Below this a path is ended, and the bridge orders a landing.
    pub land: Option<f64>,
}

/// Reads limits and checks them together.
fn falling<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SupplyLimits, D::Error> {
    let limits = SupplyLimits::deserialize(deserializer)?;
    limits.check().map_err(D::Error::custom)?;
    Ok(limits)
}

impl SupplyLimits {
    /// The limits from mild to severe, those that are given.
    pub fn steps(&self) -> impl Iterator<Item = (SafetyAction, f64)> {
        [
            (SafetyAction::Warn, self.warn),
            (SafetyAction::Refuse, self.refuse),
            (SafetyAction::Hold, self.hold),
            (SafetyAction::Land, self.land),
        ]
        .into_iter()
        .filter_map(|(action, limit)| limit.map(|limit| (action, limit)))
    }

    /// A milder action comes first, so its limit is the higher one.
    fn check(&self) -> Result<(), String> {
        if let Some((_, limit)) = self
            .steps()
            .find(|(_, limit)| !(0.0..=100.0).contains(limit))
        {
            return Err(format!("{limit} is out of range: 0 to 100"));
        }
        let falls = self
            .steps()
            .zip(self.steps().skip(1))
            .all(|((_, mild), (_, severe))| mild >= severe);
        if falls {
            Ok(())
        } else {
            Err("the limits must fall in the order warn, refuse, hold, land".to_owned())
        }
    }
}
