//! Take-off and landing as the PC orders and reads them: ports 10121 and 10122 (`docs/protocol.md` section 8.5).

use std::time::Duration;

use crate::helicopter::{Helicopter, Phase};

use super::Dsp;

impl Dsp {
    /// Whether port 10121 reads 1: from the order until the first flow control with 1, which ends the
    /// take-off. With following off no flow control comes, and the end of the climb is the end.
    pub fn is_taking_off(&self, helicopter: &Helicopter) -> bool {
        let climbs = matches!(helicopter.phase(), Phase::SpinningUp | Phase::TakingOff);
        climbs || (self.take_off.awaits_flow_control && self.is_following())
    }

    /// Whether port 10122 reads 1: from the order until the rotor has stopped.
    pub fn is_landing(&self, helicopter: &Helicopter) -> bool {
        matches!(helicopter.phase(), Phase::Landing | Phase::SpinningDown)
    }

    /// Takes off, or will do so after the delay of the firmware; false when it is refused.
    pub(super) fn order_take_off(&mut self, now: Duration, helicopter: &mut Helicopter) -> bool {
        if self.firmware.refuses_take_off_before_start_up && !self.started_up {
            return false;
        }
        // Repeating the order changes nothing.
        if self.take_off.begins_at.is_some() || self.is_taking_off(helicopter) {
            return true;
        }
        if self.firmware.take_off_delay.is_zero() {
            return self.begin_take_off(helicopter);
        }
        let is_possible = helicopter.may_take_off();
        self.take_off.begins_at = is_possible.then(|| now + self.firmware.take_off_delay);
        is_possible
    }

    /// Begins the take-off whose delay is over.
    pub(super) fn begin_late_take_off(&mut self, helicopter: &mut Helicopter) {
        self.take_off.begins_at = None;
        self.begin_take_off(helicopter);
    }

    fn begin_take_off(&mut self, helicopter: &mut Helicopter) -> bool {
        let has_begun = helicopter.take_off().is_ok();
        self.take_off.awaits_flow_control |= has_begun;
        has_begun
    }

    /// Lands; false when it is refused.
    pub(super) fn order_landing(&self, helicopter: &mut Helicopter) -> bool {
        !self.is_taking_off(helicopter) && helicopter.land().is_ok()
    }
}
