//! Battery and fuel: how much is left.
//!
//! Nothing stops the engine: a helicopter that hovers for longer than the tank lasts reads 0 % and flies on.

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

/// What there is at the start, and how fast it drains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyModel {
    /// Voltage of the battery at rest, V.
    pub battery_v: f64,
    /// Fuel, %.
    pub fuel_percent: f64,
    /// How many times faster than usual both drain.
    pub drain_factor: f64,
}

impl Default for EnergyModel {
    /// Both are full and drain as usual.
    fn default() -> Self {
        EnergyModel {
            battery_v: FULL_MV / 1_000.0,
            fuel_percent: 100.0,
            drain_factor: 1.0,
        }
    }
}

/// What is left.
#[derive(Clone, Debug, PartialEq)]
pub struct Energy {
    /// Of the battery: 1 full, 0 empty; less only when a test set it so.
    charge: f64,
    /// Of the fuel: 1 full, 0 empty.
    fuel: f64,
    drain_factor: f64,
}

impl Energy {
    /// What there is at the start.
    pub fn new(model: EnergyModel) -> Energy {
        let mut energy = Energy {
            charge: 1.0,
            fuel: 1.0,
            drain_factor: model.drain_factor,
        };
        energy.set_battery_v(model.battery_v);
        energy.set_fuel_percent(model.fuel_percent);
        energy
    }

    /// Sets the voltage of the battery at rest. In a hover it reads 0.4 V less.
    pub fn set_battery_v(&mut self, volts: f64) {
        self.charge = (1_000.0 * volts - EMPTY_MV) / (FULL_MV - EMPTY_MV);
    }

    /// Sets what is left of the fuel.
    pub fn set_fuel_percent(&mut self, percent: f64) {
        self.fuel = percent / 100.0;
    }

    /// Lets `step_s` seconds pass at `load`, the push of the rotor as a part of the weight.
    pub fn step(&mut self, load: f64, rotor_turns: bool, step_s: f64) {
        let step_s = step_s * self.drain_factor;
        let drain = 1.0 + (FLIGHT_DRAIN - 1.0) * load;
        let least = self.charge.min(0.0);
        self.charge = (self.charge - drain * step_s / BATTERY_LIFE.as_secs_f64()).max(least);
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
        let mut energy = Energy::new(EnergyModel::default());
        assert_eq!(
            (energy.battery_mv(0.0), energy.fuel_percent()),
            (25_200, 100)
        );
        assert!(energy.battery_mv(1.0) < energy.battery_mv(0.0));

        energy.step(0.0, false, 3_600.0);
        assert_eq!(
            energy.fuel_percent(),
            100,
            "a rotor that stands burns nothing"
        );
        assert_eq!(energy.battery_mv(0.0), 24_150);

        energy.step(1.0, true, 20.0 * 60.0);
        assert_eq!(energy.fuel_percent(), 50);
        energy.step(1.0, true, 1e6);
        assert_eq!((energy.battery_mv(0.0), energy.fuel_percent()), (21_000, 0));
    }

    #[test]
    fn both_can_be_set_and_drain_faster() {
        let model = EnergyModel {
            battery_v: 24.15,
            fuel_percent: 50.0,
            drain_factor: 10.0,
        };
        let mut energy = Energy::new(model);
        assert_eq!(
            (energy.battery_mv(0.0), energy.fuel_percent()),
            (24_150, 50)
        );
        energy.step(1.0, true, 120.0);
        assert_eq!(energy.fuel_percent(), 0);
        // Deeper than empty only when it was set so.
        energy.set_battery_v(18.0);
        energy.step(1.0, true, 1e6);
        assert_eq!(energy.battery_mv(0.0), 18_000);
    }
}
