//! Battery and fuel: how much is left.
//!
//! Nothing stops the engine: whoever hovers for longer than the tank lasts reads 0 % and goes on.

use std::time::Duration;

/// A full battery of six cells at rest, mV.
const FULL_MV: f64 = 25_200.0;
/// An empty one, mV.
const EMPTY_MV: f64 = 21_000.0;
/// How far the voltage sags at the load of a hover, mV.
const SAG_MV: f64 = 400.0;
/// How long a battery lasts with the avionics alone.
const BATTERY_LIFE: Duration = Duration::from_secs(4 * 3_600);
/// How much faster the battery drains while the servos hold a hover.
const FLIGHT_DRAIN: f64 = 3.0;
/// How long a full tank keeps the helicopter hovering.
const TANK_LIFE: Duration = Duration::from_secs(40 * 60);
/// Fuel that an idling rotor burns, as a part of that of a hover.
const IDLE_BURN: f64 = 0.4;

/// What is left, both as parts of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Stores {
    charge: f64,
    fuel: f64,
}

impl Default for Stores {
    fn default() -> Self {
        Stores {
            charge: 1.0,
            fuel: 1.0,
        }
    }
}

impl Stores {
    /// Lets `step_s` seconds pass at `load`, the push of the rotor as a part of the weight.
    pub fn step(&mut self, load: f64, rotor_turns: bool, step_s: f64) {
        let drain = 1.0 + (FLIGHT_DRAIN - 1.0) * load;
        self.charge -= drain * step_s / BATTERY_LIFE.as_secs_f64();
        self.charge = self.charge.max(0.0);
        if rotor_turns {
            let burn = IDLE_BURN + (1.0 - IDLE_BURN) * load;
            self.fuel -= burn * step_s / TANK_LIFE.as_secs_f64();
            self.fuel = self.fuel.max(0.0);
        }
    }

    /// Voltage of the battery at `load`, mV.
    pub fn battery_mv(&self, load: f64) -> u16 {
        let rest_mv = EMPTY_MV + (FULL_MV - EMPTY_MV) * self.charge;
        (rest_mv - SAG_MV * load).round() as u16
    }

    /// Fuel, %.
    pub fn fuel_percent(&self) -> u8 {
        (100.0 * self.fuel).round() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_fall_with_time_and_load_and_never_below_nothing() {
        let mut stores = Stores::default();
        assert_eq!(
            (stores.battery_mv(0.0), stores.fuel_percent()),
            (25_200, 100)
        );
        assert!(stores.battery_mv(1.0) < stores.battery_mv(0.0));

        stores.step(0.0, false, 3_600.0);
        assert_eq!(
            stores.fuel_percent(),
            100,
            "a rotor that stands burns nothing"
        );
        assert_eq!(stores.battery_mv(0.0), 24_150);

        stores.step(1.0, true, 20.0 * 60.0);
        assert_eq!(stores.fuel_percent(), 50);
        stores.step(1.0, true, 1e6);
        assert_eq!((stores.battery_mv(0.0), stores.fuel_percent()), (21_000, 0));
    }
}
