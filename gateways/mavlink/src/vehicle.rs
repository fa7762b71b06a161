//! [`Vehicle`]: the newest samples of the helicopter, and whether it is heard.
//!
//! | heard | its telemetry comes and the DSP's line is up | else |
//! |---|---|---|
//! | never | → heard | never |
//! | heard | heard | → lost |
//! | lost | → heard | lost |
//!
//! A sample counts by the moment when it was measured, not by that when it came.

use std::time::Duration;

use ipc_types::code::{Functionality, LinkState, MavlinkVehicle, PilotSwitch, SafetyAction};
use ipc_types::payload::{HeroTelemetry, ModuleState, WaypointPosition};
use ipc_types::{MonotonicNs, TelemetryGroup};

use crate::event::OrderKind;

/// By how much a sample may seem to be of the future: a relay translates times with an error of some milliseconds.
const CLOCK_ERROR: Duration = Duration::from_millis(100);

/// By how much longer a state holds than telemetry: it comes once a second.
const STATE_PERIOD: Duration = Duration::from_secs(1);

/// Whether the helicopter is heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// Not yet.
    Never,
    /// Now.
    Yes,
    /// Not any more.
    Lost,
}

/// The newest samples of the helicopter, and whether it is heard.
#[derive(Clone, Debug)]
pub struct Vehicle {
    lost_after: Duration,
    telemetry: Option<HeroTelemetry>,
    state: Option<ModuleState>,
    heard: Heard,
}

impl Vehicle {
    pub fn new(lost_after: Duration) -> Vehicle {
        Vehicle {
            lost_after,
            telemetry: None,
            state: None,
            heard: Heard::Never,
        }
    }

    pub fn set_telemetry(&mut self, telemetry: &HeroTelemetry) {
        self.telemetry = Some(*telemetry);
    }

    pub fn set_state(&mut self, state: &ModuleState) {
        self.state = Some(*state);
    }

    /// Looks whether it is heard; gives the new state when that has changed.
    pub fn look(&mut self, now: MonotonicNs) -> Option<Heard> {
        let heard = match (self.is_fresh(now), self.heard) {
            (true, _) => Heard::Yes,
            (false, Heard::Yes) => Heard::Lost,
            (false, before) => before,
        };
        let changed = heard != self.heard;
        self.heard = heard;
        changed.then_some(heard)
    }

    /// Whether the helicopter is heard, for programs, with the reason.
    pub fn shown(&self, now: MonotonicNs) -> MavlinkVehicle {
        if self.heard == Heard::Yes {
            return MavlinkVehicle::Heard;
        }
        match &self.state {
            Some(state) if self.is_state_fresh(state, now) => match state.link.state() {
                Some(LinkState::Up) => MavlinkVehicle::NoTelemetry,
                _ => MavlinkVehicle::LinkDown,
            },
            _ => MavlinkVehicle::NoState,
        }
    }

    /// When it is lost unless something comes.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let (Some(telemetry), Some(state), Heard::Yes) = (&self.telemetry, &self.state, self.heard)
        else {
            return None;
        };
        let measured = telemetry.received() + self.lost_after;
        // One further: at the deadline itself it is still heard.
        let until = measured.min(state.published() + self.lost_after + STATE_PERIOD);
        Some(until + Duration::from_nanos(1))
    }

    fn is_fresh(&self, now: MonotonicNs) -> bool {
        let (Some(telemetry), Some(state)) = (&self.telemetry, &self.state) else {
            return false;
        };
        is_within(telemetry.received(), self.lost_after, now)
            && self.is_state_fresh(state, now)
            && state.link.state() == Some(LinkState::Up)
    }

    fn is_state_fresh(&self, state: &ModuleState, now: MonotonicNs) -> bool {
        is_within(state.published(), self.lost_after + STATE_PERIOD, now)
    }

    /// What is known, while it is heard.
    pub fn now(&self) -> Option<Known<'_>> {
        let (Some(telemetry), Some(state), Heard::Yes) = (&self.telemetry, &self.state, self.heard)
        else {
            return None;
        };
        Some(Known { telemetry, state })
    }

    /// The newest state, however old.
    pub fn last_state(&self) -> Option<&ModuleState> {
        self.state.as_ref()
    }
}

/// Whether a moment is not of the future, and not longer ago than `limit`.
fn is_within(moment: MonotonicNs, limit: Duration, now: MonotonicNs) -> bool {
    moment <= now + CLOCK_ERROR && now.since(moment) <= limit
}

/// The newest samples of a helicopter that is heard.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    pub telemetry: &'a HeroTelemetry,
    pub state: &'a ModuleState,
}

impl Known<'_> {
    pub fn has(&self, group: TelemetryGroup) -> bool {
        self.telemetry.valid(group)
    }

    pub fn is_flying(&self) -> bool {
        self.telemetry.is_flying()
    }

    /// "Armed" means: will act on a movement.
    pub fn is_armed(&self) -> bool {
        self.is_started() || self.is_flying()
    }

    pub fn is_started(&self) -> bool {
        !self.state.is_blocked()
    }

    /// Where it is, altitudes with telemetry's zero.
    pub fn position(&self) -> Option<WaypointPosition> {
        let geodetic = &self.telemetry.geodetic;
        self.has(TelemetryGroup::Geographic)
            .then(|| WaypointPosition {
                latitude_deg: geodetic.latitude_rad.to_degrees(),
                longitude_deg: geodetic.longitude_rad.to_degrees(),
                altitude_m: geodetic.altitude_m,
            })
    }

    pub fn is_holding(&self) -> bool {
        matches!(
            self.state.functionality(),
            Some(Functionality::Holding | Functionality::AtRest)
        )
    }

    /// Whether a take-off or a path has begun, also before it leaves the ground.
    pub fn is_under_way(&self) -> bool {
        matches!(
            self.state.functionality(),
            Some(
                Functionality::ReceivingPath
                    | Functionality::TakingOff
                    | Functionality::FollowingPath
            )
        )
    }

    pub fn is_landing(&self) -> bool {
        self.state.functionality() == Some(Functionality::Landing)
    }

    pub fn is_manual(&self) -> bool {
        self.state.safety.pilot_switch() == Some(PilotSwitch::Manual)
    }

    /// Whether a safety rule keeps it from beginning a flight.
    pub fn is_restrained(&self) -> bool {
        !matches!(self.state.safety.action(), None | Some(SafetyAction::Warn))
    }

    /// The orders for a path. After an abort in flight the module is started for it.
    ///
    /// # Errors
    ///
    /// Why it is not.
    pub fn started_for(
        &self,
        path: OrderKind,
    ) -> Result<(OrderKind, Option<OrderKind>), &'static str> {
        match self.not_ready() {
            _ if self.is_started() => Ok((path, None)),
            _ if !self.is_flying() => Err("the helicopter is on the ground: take off first"),
            Some(why) => Err(why),
            None => Ok((OrderKind::Start, Some(path))),
        }
    }

    /// Why a take-off would not be taken now; `None` if it would. That the module is not started does not count: arming
    /// ends it.
    pub fn not_ready(&self) -> Option<&'static str> {
        if self.state.is_replayed() {
            Some("this is a recorded flight")
        } else if self.is_manual() {
            Some("the pilot's switch is on manual")
        } else if !self.has(TelemetryGroup::Geographic) {
            Some("the position is not known")
        } else if self.is_restrained() {
            Some("a safety rule is violated")
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    fn telemetry(received_ns: u64) -> HeroTelemetry {
        HeroTelemetry {
            received_ns,
            ..HeroTelemetry::default()
        }
    }

    fn state(published_ns: u64, link: LinkState) -> ModuleState {
        let mut state = ModuleState {
            published_ns,
            ..ModuleState::default()
        };
        state.link.state = link.code();
        state
    }

    #[test]
    fn it_is_heard_while_both_are_new_and_the_line_is_up() {
        let mut vehicle = Vehicle::new(Duration::from_secs(2));
        let at = |seconds: u64| MonotonicNs(seconds * SECOND);
        vehicle.set_telemetry(&telemetry(10 * SECOND));
        assert_eq!(vehicle.look(at(10)), None, "no state yet");
        assert_eq!(vehicle.shown(at(10)), MavlinkVehicle::NoState);
        vehicle.set_state(&state(10 * SECOND, LinkState::Silent));
        assert_eq!(vehicle.look(at(10)), None, "the line is silent");
        assert_eq!(vehicle.shown(at(10)), MavlinkVehicle::LinkDown);
        vehicle.set_state(&state(10 * SECOND, LinkState::Up));
        assert_eq!(vehicle.look(at(10)), Some(Heard::Yes));
        assert!(vehicle.now().is_some());
        assert_eq!(vehicle.shown(at(10)), MavlinkVehicle::Heard);

        let deadline = vehicle.deadline().unwrap();
        assert_eq!(vehicle.look(at(12)), None);
        assert_eq!(vehicle.look(deadline), Some(Heard::Lost));
        assert!(vehicle.now().is_none() && vehicle.deadline().is_none());
        assert_eq!(vehicle.shown(at(12)), MavlinkVehicle::NoTelemetry);
        // A sample that came late is as old as it is.
        vehicle.set_telemetry(&telemetry(11 * SECOND));
        assert_eq!(vehicle.look(at(14)), None);
        // So is one that claims to be of the future.
        vehicle.set_telemetry(&telemetry(20 * SECOND));
        assert_eq!(vehicle.look(at(14)), None);
        vehicle.set_telemetry(&telemetry(14 * SECOND));
        vehicle.set_state(&state(14 * SECOND, LinkState::Up));
        assert_eq!(vehicle.look(at(14)), Some(Heard::Yes));
        // Telemetry goes on, and the bridge's state does not.
        vehicle.set_telemetry(&telemetry(18 * SECOND));
        assert_eq!(vehicle.look(at(18)), Some(Heard::Lost));
    }
}
