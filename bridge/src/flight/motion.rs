//! [`Motion`]: what the module does. One value from which its published state follows (requirements B3, D6, D8).
//!
//! | motion | published as | start | stop | a new movement | fatal error |
//! |---|---|---|---|---|---|
//! | idle, waiting | waiting-data-to-start, blocked | → ready | → stopped | refused | noted |
//! | idle, ready | running | error 1 | → stopped | taken | → aborted |
//! | idle, done | ended | → ready | → stopped | taken | → aborted |
//! | idle, stopped | ended, blocked | → ready | → stopped | refused | noted |
//! | idle, aborted | aborted, blocked | → ready | → aborted | refused | noted |
//! | following a path | running | error 1 | → aborted | busy, or pre-empts it | → aborted |
//! | taking off, landing | running, unable to abort | error 1 | error 2 | busy | → aborted |
//! | holding | running | error 1 | → stopped | busy, or pre-empts it | → aborted |
//! | wanted hold or landing | running | error 1 | → stopped | a hold or landing replaces it | → aborted |
//! | stopping | ended or aborted, blocked | busy | busy | refused | noted |
//!
//! Error 1 is module-running-to-restart-stop-it-before, error 2 is impossible-to-stop-module. "Noted" publishes the error and
//! changes nothing else: nothing is running that could be ended. A stop at rest empties the DSP's buffer as well: the
//! operator who repeats it means it.
//!
//! **Hold and landing** are also taken while the module is blocked, as long as the helicopter flies or may fly: *waiting*, *stopped*
//! and *aborted* alike. No other movement is taken meanwhile, and the module rests afterwards as it did before. While the DSP cannot be reached they are *wanted*:
//! accepted with the reason link-down, and carried out when the DSP is heard, if that is before their moment has passed.

use ipc_types::MonotonicNs;
use ipc_types::code::{Functionality, ImiError, ModuleStatus, MovementKind};
use module_kit::rules::{OnStop, Standing};
use serde::{Deserialize, Serialize};

use super::request::RequestHeader;

/// How a module without a movement came to rest.
pub type Rest = module_kit::rules::Rest<ImiError>;

/// What the module does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// No movement; a path may be under assembly.
    Idle(Rest),
    /// A take-off.
    TakingOff(TakeOff),
    /// A landing.
    Landing(Landing),
    /// A path.
    Following(Following),
    /// The DSP's path buffer is being emptied so that the helicopter hovers; the module stays started.
    Holding {
        /// Whose request it is.
        order: Order,
    },
    /// A hold or a landing that is carried out when the DSP is heard.
    Wanted {
        /// Whose request it is.
        order: Order,
        /// It is a landing.
        lands: bool,
    },
    /// The module is being stopped.
    Stopping {
        /// Whose request it is.
        requester: RequestHeader,
        /// The DSP's error queue is empty.
        errors_cleared: bool,
        /// How the module rests afterwards.
        then: Rest,
    },
}

/// A movement's request.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// The request; `None` if a safety rule ordered the movement.
    pub requester: Option<RequestHeader>,
    /// How the module rests when the movement has ended as it should.
    pub then: Rest,
}

impl Order {
    /// The order of a request.
    pub const fn of(requester: RequestHeader) -> Order {
        Order {
            requester: Some(requester),
            then: Rest::Done,
        }
    }
}

/// A take-off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TakeOff {
    /// Whose request it is.
    pub order: Order,
    /// Height above take-off, m.
    pub height_m: f32,
    /// Telemetry altitude of the point of take-off, m.
    pub ground_altitude_m: f64,
    /// Flow control 1 came since the order, before a flying flag did, and the port has not read 1 after it.
    pub is_granted: bool,
    /// How far it is.
    pub step: DspOrder,
}

/// A landing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Landing {
    /// Whose request it is.
    pub order: Order,
    /// How far it is.
    pub step: DspOrder,
}

/// How far an order for take-off or landing is: the DSP forms these movements itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum DspOrder {
    /// What it needs is being written and read back.
    Preparing,
    /// The command is on its way.
    Ordering(Doubt),
    /// The command was acknowledged; that it is carried out is not known yet.
    Confirming {
        /// Until when the DSP must show that it carries it out.
        until: MonotonicNs,
        /// What speaks against it.
        doubt: Doubt,
    },
    /// The DSP carries it out.
    UnderWay,
}

/// What speaks against an order being carried out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Doubt {
    /// The DSP reported "invalid command" since it was given the order.
    pub is_refused: bool,
    /// The port of the movement read 0.
    pub reads_zero: bool,
}

/// A path being flown. Its waypoints are in [`Route`](super::route::Route).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Following {
    /// The request that closed the path.
    pub order: Order,
    /// How far it is.
    pub step: PathStep,
}

/// How far a path is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PathStep {
    /// It waits until the DSP's path buffer is known to be empty.
    AwaitingEmpty,
    /// The DSP has none of its waypoints yet.
    Ready,
    /// The DSP has waypoints of it.
    Flying,
    /// The helicopter is in the box of the last waypoint and goes on to the waypoint itself.
    Settling,
    /// It has been flown; the DSP's path buffer is being emptied.
    Finishing,
    /// The bridge is about to end; the DSP's path buffer is being emptied.
    BridgeEnding,
}

impl DspOrder {
    /// Whether the DSP may have got the order.
    pub fn may_be_begun(&self) -> bool {
        !matches!(self, DspOrder::Preparing)
    }
}

impl Motion {
    /// The movement's order.
    pub fn order(&self) -> Option<&Order> {
        match self {
            Motion::TakingOff(take_off) => Some(&take_off.order),
            Motion::Landing(landing) => Some(&landing.order),
            Motion::Following(following) => Some(&following.order),
            Motion::Holding { order } | Motion::Wanted { order, .. } => Some(order),
            Motion::Idle(_) | Motion::Stopping { .. } => None,
        }
    }

    /// The request that gets the final report when this ends.
    pub fn requester(&self) -> Option<&RequestHeader> {
        match self {
            Motion::Stopping { requester, .. } => Some(requester),
            other => other.order()?.requester.as_ref(),
        }
    }

    /// Which movement it is.
    pub fn kind(&self) -> Option<MovementKind> {
        match self {
            Motion::TakingOff(_) => Some(MovementKind::TakeOff),
            Motion::Landing(_) => Some(MovementKind::Land),
            Motion::Following(_) => Some(MovementKind::GoToWaypoint),
            Motion::Wanted { lands: true, .. } => Some(MovementKind::Land),
            Motion::Holding { .. } | Motion::Wanted { .. } => Some(MovementKind::Hold),
            Motion::Idle(_) | Motion::Stopping { .. } => None,
        }
    }

    /// What the manager's rules need to know of it.
    pub fn standing(&self) -> Standing<ImiError> {
        match self {
            Motion::Idle(rest) => Standing::Resting(*rest),
            Motion::TakingOff(_) | Motion::Landing(_) => Standing::Working(OnStop::Refused),
            Motion::Following(_) => Standing::Working(OnStop::Aborts),
            Motion::Holding { .. } | Motion::Wanted { .. } => Standing::Working(OnStop::Ends),
            Motion::Stopping { then, .. } => Standing::Stopping { then: *then },
        }
    }

    /// Take-off and landing cannot be aborted (`unable2abort`).
    pub fn unable_to_abort(&self) -> bool {
        self.standing().unable_to_abort()
    }

    /// Whether no movement is taken until the next start.
    pub fn is_blocked(&self) -> bool {
        self.standing().is_blocked()
    }

    /// Whether any movement but a hold or a landing wants a start first, also while one of these is carried out.
    pub fn wants_start(&self) -> bool {
        self.is_blocked() || self.order().is_some_and(|order| order.then.is_blocked())
    }

    /// The published state.
    pub fn status(&self) -> ModuleStatus {
        self.standing().status()
    }

    /// The error that holds as long as the module rests like this.
    pub fn error(&self) -> ImiError {
        self.standing().error()
    }

    /// How it is published.
    pub fn functionality(&self, is_receiving_path: bool) -> Functionality {
        match self {
            Motion::Idle(_) if is_receiving_path => Functionality::ReceivingPath,
            Motion::Idle(_) => Functionality::AtRest,
            Motion::TakingOff(_) => Functionality::TakingOff,
            Motion::Following(_) => Functionality::FollowingPath,
            Motion::Landing(_) => Functionality::Landing,
            Motion::Holding { .. } | Motion::Wanted { .. } => Functionality::Holding,
            Motion::Stopping { .. } => Functionality::Stopping,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use module_kit::rules::Refused;

    const ERROR: ImiError = ImiError::HeroDspFatalError;
    const NONE: ImiError = ImiError::None;
    const ORDER: Order = Order {
        requester: None,
        then: Rest::Done,
    };
    const REQUESTER: RequestHeader = RequestHeader::TEST;

    const TAKING_OFF: Motion = Motion::TakingOff(TakeOff {
        order: ORDER,
        height_m: 5.0,
        ground_altitude_m: 0.0,
        is_granted: false,
        step: DspOrder::Preparing,
    });
    const LANDING: Motion = Motion::Landing(Landing {
        order: ORDER,
        step: DspOrder::UnderWay,
    });
    const FOLLOWING: Motion = Motion::Following(Following {
        order: ORDER,
        step: PathStep::Flying,
    });
    const HOLDING: Motion = Motion::Holding { order: ORDER };
    const WANTED: Motion = Motion::Wanted {
        order: Order {
            requester: None,
            then: Rest::Stopped(NONE),
        },
        lands: true,
    };
    const STOPPING: Motion = Motion::Stopping {
        requester: REQUESTER,
        errors_cleared: false,
        then: Rest::Stopped(NONE),
    };

    #[test]
    fn every_motion_and_control() {
        use Refused::{Busy, Running, UnableToAbort};
        let idle = Motion::Idle;
        let (stopped, aborted) = (Rest::Stopped(NONE), Rest::Aborted(NONE));
        let table = [
            (idle(Rest::Waiting(ERROR)), Ok(Rest::Ready), Ok(stopped)),
            (idle(Rest::Ready), Err(Running), Ok(stopped)),
            (idle(Rest::Done), Ok(Rest::Ready), Ok(stopped)),
            (idle(Rest::Stopped(ERROR)), Ok(Rest::Ready), Ok(stopped)),
            (
                idle(Rest::Aborted(ERROR)),
                Ok(Rest::Ready),
                Ok(Rest::Aborted(ERROR)),
            ),
            (FOLLOWING, Err(Running), Ok(aborted)),
            (HOLDING, Err(Running), Ok(stopped)),
            (WANTED, Err(Running), Ok(stopped)),
            (TAKING_OFF, Err(Running), Err(UnableToAbort)),
            (LANDING, Err(Running), Err(UnableToAbort)),
            (STOPPING, Err(Busy), Err(Busy)),
        ];
        for (motion, started, stopped) in table {
            assert_eq!(motion.standing().start(), started, "{motion:?}");
            assert_eq!(motion.standing().stop(), stopped, "{motion:?}");
        }
    }

    #[test]
    fn a_motion_is_published_as_the_sources_four_states() {
        use Functionality as F;
        use ModuleStatus as S;
        let idle = Motion::Idle;
        let table = [
            (
                idle(Rest::Waiting(NONE)),
                S::WaitingDataToStart,
                true,
                F::AtRest,
            ),
            (idle(Rest::Ready), S::Running, false, F::AtRest),
            (idle(Rest::Done), S::Ended, false, F::AtRest),
            (idle(Rest::Stopped(NONE)), S::Ended, true, F::AtRest),
            (idle(Rest::Aborted(ERROR)), S::Aborted, true, F::AtRest),
            (FOLLOWING, S::Running, false, F::FollowingPath),
            (TAKING_OFF, S::Running, false, F::TakingOff),
            (LANDING, S::Running, false, F::Landing),
            (HOLDING, S::Running, false, F::Holding),
            (WANTED, S::Running, false, F::Holding),
            (STOPPING, S::Ended, true, F::Stopping),
        ];
        for (motion, status, blocked, functionality) in table {
            assert_eq!(motion.status(), status, "{motion:?}");
            assert_eq!(motion.is_blocked(), blocked, "{motion:?}");
            assert_eq!(motion.functionality(false), functionality, "{motion:?}");
        }
        assert_eq!(
            idle(Rest::Ready).functionality(true),
            Functionality::ReceivingPath
        );
    }
}
