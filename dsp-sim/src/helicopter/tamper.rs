//! What a test or a script of faults does to the helicopter ([`crate::faults`]). Nothing here happens by itself.

use std::time::Duration;

use super::pilot::PilotSwitch;
use super::{Helicopter, Phase};

impl Helicopter {
    /// Moves the pilot's switch and leaves it there.
    pub fn set_switch(&mut self, switch: PilotSwitch) {
        self.pilot.set(switch);
        self.stop_for_pilot();
    }

    /// Moves the pilot's switch to manual for `length`.
    pub fn take_over(&mut self, length: Duration) {
        self.pilot.take_over(self.now().saturating_add(length));
        self.stop_for_pilot();
    }

    /// Sets the voltage of the battery at rest; in a hover it reads 0.4 V less.
    pub fn set_battery_v(&mut self, volts: f64) {
        self.energy.set_battery_v(volts);
    }

    /// Sets what is left of the fuel, %.
    pub fn set_fuel_percent(&mut self, percent: f64) {
        self.energy.set_fuel_percent(percent);
    }

    /// Takes the fix from the GPS for `length`.
    pub fn lose_gps_fix(&mut self, length: Duration) {
        self.gps.lose_fix(self.now().saturating_add(length));
    }

    /// Lets the altitude of the GPS drift at `rate_mps` for `length`; the error that it has reached then stays.
    pub fn drift_gps_altitude(&mut self, rate_mps: f64, length: Duration) {
        self.gps.drift(self.now(), rate_mps, length);
    }

    /// Leaves the path when the pilot has taken over. The waypoints stay in the buffer.
    fn stop_for_pilot(&mut self) {
        if self.switch() == PilotSwitch::Manual && self.phase == Phase::FollowingPath {
            self.guidance.brake();
        }
    }
}
