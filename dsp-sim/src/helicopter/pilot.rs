//! The switch with which the pilot takes the helicopter out of the DSP's hands.

use std::time::Duration;

/// Position of the pilot's switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PilotSwitch {
    /// The DSP flies.
    #[default]
    Auto,
    /// The pilot flies. The simulated pilot holds the position.
    Manual,
}

/// The pilot at the switch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pilot {
    switch: PilotSwitch,
    /// When the pilot gives the helicopter back, if there is a time for it.
    auto_at: Option<Duration>,
}

impl Pilot {
    pub(super) fn switch(&self) -> PilotSwitch {
        self.switch
    }

    /// Moves the switch and leaves it there.
    pub(super) fn set(&mut self, switch: PilotSwitch) {
        *self = Pilot {
            switch,
            auto_at: None,
        };
    }

    /// Flies until `end`, or for longer when the pilot had decided so before.
    pub(super) fn take_over(&mut self, end: Duration) {
        let is_for_good = self.switch == PilotSwitch::Manual && self.auto_at.is_none();
        if !is_for_good {
            self.switch = PilotSwitch::Manual;
            self.auto_at = self.auto_at.max(Some(end));
        }
    }

    /// Gives the helicopter back when it is time.
    pub(super) fn advance(&mut self, now: Duration) {
        if self.auto_at.is_some_and(|end| end <= now) {
            self.set(PilotSwitch::Auto);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pilot_gives_the_helicopter_back_at_the_latest_time_that_was_set() {
        let second = Duration::from_secs;
        let mut pilot = Pilot::default();
        pilot.take_over(second(5));
        pilot.take_over(second(3));
        pilot.advance(second(4));
        assert_eq!(pilot.switch(), PilotSwitch::Manual);
        pilot.advance(second(5));
        assert_eq!(pilot.switch(), PilotSwitch::Auto);

        pilot.set(PilotSwitch::Manual);
        pilot.take_over(second(6));
        pilot.advance(second(100));
        assert_eq!(pilot.switch(), PilotSwitch::Manual, "until it is moved");
        pilot.set(PilotSwitch::Auto);
        assert_eq!(pilot.switch(), PilotSwitch::Auto);
    }
}
