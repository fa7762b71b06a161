//! [`Motion`]: what the module does, and what every order and every event makes of it (requirements B3, D6, D8).
//!
//! The published state follows from the motion alone. [`Motion::allows`] is the first table, [`Motion::apply`] the
//! second one; the flight carries out the [`Action`] that comes of it.
//!
//! | motion | published as | start | stop | take-off | path | hold | landing |
//! |---|---|---|---|---|---|---|---|
//! | idle, waiting | waiting-data-to-start, blocked | → ready | → stopped | not started | not started | may fly | may fly |
//! | idle, ready | running | error 1 | → stopped | taken | taken | taken | taken |
//! | idle, done | ended | → ready | → stopped | taken | taken | taken | taken |
//! | idle, stopped | ended, blocked | → ready | → stopped | not started | not started | may fly | may fly |
//! | idle, aborted | aborted, blocked | → ready | → aborted | not started | not started | may fly | may fly |
//! | following a path | running | error 1 | → aborted | busy | pre-empts | replaces it | pre-empts |
//! | taking off, landing | running, unable to abort | error 1 | error 2 | busy | busy | refused | busy |
//! | holding | running | error 1 | → stopped | busy | pre-empts | replaces it | pre-empts |
//! | deferred | running | error 1 | → stopped | busy | busy | replaces it | replaces it |
//! | stopping | ended or aborted, blocked | busy | busy | not started | not started | busy | busy |
//!
//! Error 1 is module-running-to-restart-stop-it-before, error 2 is impossible-to-stop-module. "May fly": taken as long
//! as the helicopter flies or may fly, also while the module is blocked; the module rests afterwards as it did before.
//! "Pre-empts": the request says that it may replace what is under way, otherwise the module is busy. While the DSP
//! cannot be reached, hold and landing are *deferred*: accepted with the reason link-down, and carried out when the DSP
//! can be reached before their moment has passed. A stop at rest empties the DSP's buffer as well: the operator who
//! repeats it means it.
//!
//! | event | taking off, landing | following | holding | deferred | stopping |
//! |---|---|---|---|---|---|
//! | status | its order ([`DspOrder`]) | arrival | – | – | – |
//! | flow control 1 | its order | the next waypoint | – | – | – |
//! | a command acknowledged | its order | verifies a waypoint | – | – | errors cleared |
//! | error 15, 30, 100, 102 | its order | may be about a waypoint | – | – | – |
//! | path buffer empty | – | may send; or done, if flown | done | – | done |
//! | path buffer not emptied | – | fatal | unknown | – | unknown |
//! | path dropped | – | fatal | – | – | – |
//! | a command not acknowledged | fatal | fatal | fatal | fatal | unknown, if it clears errors |
//! | DSP rebooted, link lost | fatal | fatal | fatal | – | aborted |
//! | DSP reachable | – | – | – | → landing, holding | – |
//! | moment to begin passed | aborted if not begun | aborted if not begun | unknown | aborted | unknown |
//! | time limit | fatal | fatal | – | – | – |
//! | safety rule: hold | aborted, by the pilot's switch only | aborted | – | – | – |
//! | safety rule: land | – | – | → landing | – | – |
//! | sender lost | – | aborted, unless it has been flown | – | – | – |
//! | bridge winds down | – | aborted if not begun, else its buffer is emptied | – | – | – |
//! | bridge closes | unknown | unknown | unknown | aborted | unknown |
//!
//! At rest, a command that is not acknowledged is a fatal error, a safety rule may land, and nothing else does
//! anything. Every request ends in exactly one final report. Where the DSP may be doing what cannot be seen any more,
//! it is `unknown`. A *fatal* error ends the functionality: → aborted. Where nothing runs that could be ended it is
//! only noted.

use dsp_protocol::DspErrorCode;
use dsp_protocol::downlink::Geographic;
use ipc_types::MonotonicNs;
use ipc_types::code::{
    Functionality, ImiError, ModuleStatus, MovementKind, Reason, SafetyRule, Stage,
};
use module_kit::rules::{OnStop, Standing};
use serde::{Deserialize, Serialize};

use super::dsp_order::{Doubt, DspOrder, Next, Signs};
use super::report::Verdict;
use super::request::RequestHeader;
use crate::link::FlightCommand;
use crate::link::commands::AckData;
use crate::safety::Violation;

/// How a module without a movement came to rest.
pub type Rest = module_kit::rules::Rest<ImiError>;

/// What the module does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// No movement; a path may be under assembly.
    Idle(Rest),
    /// A take-off.
    TakingOff {
        /// Whose request it is.
        order: MovementOrder,
        /// Height above take-off, m.
        height_m: f32,
        /// Telemetry altitude of the point of take-off, m.
        ground_altitude_m: f64,
        /// Flow control 1 came since the order, before a flying flag did, and the port has not read 1 after it.
        is_granted: bool,
        /// How far it is.
        step: DspOrder,
    },
    /// A landing.
    Landing {
        /// Whose request it is.
        order: MovementOrder,
        /// How far it is.
        step: DspOrder,
    },
    /// A path. Its waypoints are in [`Route`](super::route::Route).
    Following {
        /// The request that closed the path.
        order: MovementOrder,
        /// How far it is.
        step: PathStep,
    },
    /// The DSP's path buffer is being emptied so that the helicopter hovers; the module stays started.
    Holding {
        /// Whose request it is.
        order: MovementOrder,
    },
    /// A hold or a landing that is carried out when the DSP can be reached.
    Deferred {
        /// Whose request it is.
        order: MovementOrder,
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
pub struct MovementOrder {
    /// The request; `None` if a safety rule ordered the movement.
    pub requester: Option<RequestHeader>,
    /// How the module rests when the movement has ended as it should.
    pub then: Rest,
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

/// What an event or an order depends on besides the motion.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// The present moment.
    pub now: MonotonicNs,
    /// The DSP takes commands.
    pub is_link_up: bool,
    /// The DSP's path buffer is known to be empty.
    pub is_path_empty: bool,
    /// Whether the helicopter is in the air, if that is known.
    pub flying: Option<bool>,
    /// It was in the air when that was last known, or that was never known.
    pub may_fly: bool,
    /// The next look at a take-off or landing has its time.
    pub looks_later: bool,
}

/// What happens to a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A status arrived.
    Status {
        /// Its flying flag.
        flying: bool,
        /// Its position, if it has one.
        position: Option<Geographic>,
    },
    /// Flow control 1: the DSP asks for a waypoint, which it does only when it flies and neither takes off nor lands.
    Grant,
    /// A command was acknowledged.
    Delivered(FlightCommand, AckData),
    /// A command was not acknowledged in three attempts.
    Undelivered(FlightCommand),
    /// The DSP reported an error that is not fatal.
    DspError(DspErrorCode),
    /// The DSP's path buffer is known to be empty.
    PathEmptied,
    /// The DSP did not acknowledge that it empties its path buffer. The link goes on trying.
    PathNotEmptied,
    /// The DSP may take the bridge for gone and stop by itself.
    PathDropped,
    /// The DSP cannot be reached, or is not the one it was. The start-up sequence, which runs next, empties its path
    /// buffer.
    Vanished(ImiError, Reason),
    /// Something happened on the link: the DSP may be reachable again.
    Reachable,
    /// The moment to begin has passed, or that to end of a hold or stop.
    BeginByPassed,
    /// A movement that has begun has not ended in time.
    TimeLimit,
    /// The next look at how the movement goes on is due.
    StepDue,
    /// A safety rule that is broken ends what it must end.
    SafetyHold(Violation),
    /// A safety rule that is broken lands the helicopter.
    SafetyLand,
    /// The sender of the path is lost, and the path does not go on without it.
    SenderLost,
    /// The bridge is about to end.
    WindDown,
    /// The bridge ends: every request gets its final report.
    Close,
}

/// What the flight does about an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Nothing.
    None,
    /// The movement or stop has ended: its request gets this final report, and the module rests.
    End(Verdict, Rest),
    /// The movement ends early, and what the DSP may hold of it is taken back.
    GiveUp(Verdict, Rest),
    /// A fatal error (requirement D8).
    Fatal(ImiError, Reason),
    /// A fatal error that the safety rule about a lost link remembers.
    PathLost(ImiError, Reason),
    /// Gives up the movement if its command has not been sent.
    Withdraw(FlightCommand, Verdict),
    /// Gives up the movement for a safety rule.
    Intervene(Violation),
    /// Begins a hold whose request was taken before.
    Hold(MovementOrder),
    /// Begins a landing whose request was taken before, or that a safety rule orders.
    Land(MovementOrder),
    /// Reads the take-off altitude back.
    ReadTakeOffAltitude,
    /// Orders the take-off.
    OrderTakeOff,
    /// The DSP has the order for the take-off or landing.
    Ordered,
    /// Reads the port of the take-off or landing.
    Look,
    /// The DSP carries the take-off or landing out.
    UnderWay,
    /// The take-off or landing has ended as it should.
    OrderDone,
    /// The path may be sent.
    BeginPath,
    /// Sends a waypoint.
    SendWaypoint,
    /// The DSP's count of waypoints was read.
    Counted(u16),
    /// The DSP's error may be about a waypoint.
    WaypointError(DspErrorCode),
    /// A status while a path is under way, with its position.
    Watch(Option<Geographic>),
    /// The time for the helicopter to reach the last waypoint itself is over.
    SettlingOver,
    /// The bridge is about to end: the DSP's path buffer is emptied.
    EmptyPath,
}

/// An order whose admission depends on the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrderKind {
    /// A take-off.
    TakeOff,
    /// A waypoint of a path.
    Path,
    /// A hold.
    Hold,
    /// A landing.
    Land,
}

impl Motion {
    /// Whether an order may be taken, and how the module rests when it has ended as it should.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn allows(&self, kind: OrderKind, preempt: bool, facts: &Facts) -> Result<Rest, Reason> {
        let on_the_spot = matches!(kind, OrderKind::Hold | OrderKind::Land);
        let preempts = kind == OrderKind::Hold || kind != OrderKind::TakeOff && preempt;
        let wants_start = match on_the_spot {
            true => self.is_blocked() && !facts.may_fly,
            false => self.wants_start(),
        };
        match *self {
            _ if kind == OrderKind::Hold && self.unable_to_abort() => Err(Reason::UnableToAbort),
            // On the ground there is nothing to land or hold.
            _ if on_the_spot && wants_start => Err(Reason::NotStarted),
            // A start would be refused for the link as well.
            _ if !(facts.is_link_up || on_the_spot && facts.may_fly) => Err(Reason::LinkDown),
            _ if wants_start => Err(Reason::NotStarted),
            Motion::Idle(rest) => Ok(rest_after(rest)),
            Motion::Following { order, .. } | Motion::Holding { order } if preempts => {
                Ok(rest_after(order.then))
            }
            Motion::Deferred { order, .. } if on_the_spot => Ok(rest_after(order.then)),
            _ => Err(Reason::Busy),
        }
    }

    /// What an event makes of the motion, and what is to be done about it.
    pub fn apply(&mut self, event: Event, facts: &Facts) -> Action {
        use Event as E;
        use Motion as M;
        let lost = ImiError::CommunicationFatalError;
        let reason = Reason::CommunicationFatalError;
        let unknown = Verdict::ended(Stage::Unknown, reason, lost);
        match (*self, event) {
            (M::TakingOff { .. } | M::Landing { .. }, E::Status { flying, .. }) => {
                self.order(|signs| signs.status(flying), facts)
            }
            (M::TakingOff { .. } | M::Landing { .. }, E::Grant) => {
                self.order(|signs| signs.flow_control(), facts)
            }
            (
                M::TakingOff { .. } | M::Landing { .. },
                E::DspError(DspErrorCode::INVALID_COMMAND),
            ) => self.order(|signs| signs.step.error_30(), facts),
            (M::TakingOff { .. } | M::Landing { .. }, E::StepDue) => {
                self.order(|signs| signs.step.look_due(facts.now), facts)
            }
            (M::TakingOff { .. } | M::Landing { .. }, E::Delivered(command, data)) => {
                self.ordered(command, data, facts)
            }
            (M::Following { .. }, E::Status { position, .. }) => Action::Watch(position),
            (M::Following { .. }, E::Grant) => Action::SendWaypoint,
            (
                M::Following { .. },
                E::Delivered(FlightCommand::CountWaypoints, AckData::Bits16(count)),
            ) => Action::Counted(count),
            (
                M::Following { .. },
                E::DspError(
                    code @ (DspErrorCode::INVALID_COMMAND
                    | DspErrorCode::UART_QUEUE_FULL
                    | DspErrorCode::UNKNOWN_HEADER
                    | DspErrorCode::PC_CHECKSUM),
                ),
            ) => Action::WaypointError(code),
            (M::Following { .. }, E::StepDue) => Action::SettlingOver,
            (M::Stopping { then, .. }, E::Delivered(FlightCommand::ClearErrors, _)) => {
                if let M::Stopping { errors_cleared, .. } = self {
                    *errors_cleared = true;
                }
                match facts.is_path_empty {
                    true => Action::End(Verdict::DONE, then),
                    false => Action::None,
                }
            }

            (M::Following { step, .. }, E::PathEmptied) => match step {
                PathStep::AwaitingEmpty => Action::BeginPath,
                PathStep::Finishing => Action::End(Verdict::DONE, Rest::Done),
                PathStep::BridgeEnding => {
                    Action::End(Verdict::aborted(Reason::BridgeEnding), Rest::Ready)
                }
                PathStep::Ready | PathStep::Flying | PathStep::Settling => Action::None,
            },
            (M::Holding { .. }, E::PathEmptied) => Action::End(Verdict::DONE, Rest::Done),
            (
                M::Stopping {
                    errors_cleared,
                    then,
                    ..
                },
                E::PathEmptied,
            ) if errors_cleared && facts.is_path_empty => Action::End(Verdict::DONE, then),
            (M::Stopping { then, .. }, E::PathNotEmptied) => {
                Action::End(unknown, then.with_fatal(lost))
            }
            (M::Holding { .. }, E::PathNotEmptied) => Action::End(unknown, Rest::Aborted(lost)),
            (M::Following { .. }, E::PathNotEmptied) => Action::Fatal(lost, reason),
            // To the DSP the link was lost, also when the bridge sees that only later, or not at all.
            (M::Following { .. }, E::PathDropped) => Action::PathLost(lost, reason),

            (M::Stopping { then, .. }, E::Undelivered(FlightCommand::ClearErrors)) => {
                Action::End(unknown, then.with_fatal(lost))
            }
            // The command was sent because of another error, which is shown.
            (_, E::Undelivered(FlightCommand::ClearErrors)) => Action::None,
            (_, E::Undelivered(_)) => Action::Fatal(lost, reason),
            (M::Stopping { then, .. }, E::Vanished(error, reason)) => {
                Action::End(Verdict::ended(Stage::Aborted, reason, error), then)
            }
            (M::Following { .. } | M::Holding { .. }, E::Vanished(error, reason)) => {
                Action::PathLost(error, reason)
            }
            (M::TakingOff { .. } | M::Landing { .. }, E::Vanished(error, reason)) => {
                Action::Fatal(error, reason)
            }
            (M::Deferred { order, lands }, E::Reachable) if facts.is_link_up => match lands {
                true if facts.flying == Some(false) => {
                    Action::End(Verdict::aborted(Reason::NotFlying), Rest::Ready)
                }
                true => Action::Land(order),
                false => Action::Hold(order),
            },

            (_, E::BeginByPassed) => self.begin_by_passed(facts.now),
            (_, E::TimeLimit) => Action::Fatal(ImiError::MovementTimeout, Reason::MovementTimeout),
            (M::Following { .. }, E::SafetyHold(violation)) => Action::Intervene(violation),
            (M::TakingOff { .. } | M::Landing { .. }, E::SafetyHold(violation))
                if violation.rule == SafetyRule::PilotSwitch =>
            {
                Action::Intervene(violation)
            }
            (M::Idle(then), E::SafetyLand) => self.safety_landing(then, facts),
            (M::Holding { .. }, E::SafetyLand) => self.safety_landing(Rest::Ready, facts),
            (M::Following { step, .. }, E::SenderLost) => match step {
                PathStep::Finishing | PathStep::BridgeEnding => Action::None,
                _ => Action::GiveUp(Verdict::aborted(Reason::SenderLost), Rest::Ready),
            },
            (M::Following { step, .. }, E::WindDown) => match step {
                // The DSP has no waypoint of the path.
                PathStep::AwaitingEmpty | PathStep::Ready => {
                    Action::GiveUp(Verdict::aborted(Reason::BridgeEnding), Rest::Ready)
                }
                PathStep::Flying | PathStep::Settling => {
                    self.set_path_step(PathStep::BridgeEnding);
                    Action::EmptyPath
                }
                PathStep::Finishing | PathStep::BridgeEnding => Action::None,
            },
            // The last published state says how the module rested.
            (M::Idle(_), E::Close) => Action::None,
            (M::Deferred { .. }, E::Close) => {
                Action::End(Verdict::aborted(Reason::BridgeEnding), Rest::Ready)
            }
            (motion, E::Close) => {
                let then = match motion {
                    M::Stopping { then, .. } => then,
                    _ => Rest::Ready,
                };
                // A take-off or landing goes on; the bridge will not see its end.
                let stage = Stage::Unknown;
                Action::End(Verdict::aborted(Reason::BridgeEnding).at(stage), then)
            }
            _ => Action::None,
        }
    }

    /// A fatal error comes. Whether something runs that it ends; else it is noted.
    pub fn note_fatal(&mut self, error: ImiError) -> bool {
        match self {
            Motion::Stopping { then, .. } => {
                *then = then.with_fatal(error);
                false
            }
            Motion::Idle(rest) => {
                let was_blocked = rest.is_blocked();
                *rest = rest.with_fatal(error);
                !was_blocked
            }
            _ => true,
        }
    }

    /// Whether an early end is known to be one. Once the DSP may have the movement, a broken link says nothing about
    /// what it does with it.
    pub fn stage_of_early_end(&self, reason: Reason) -> Stage {
        let is_lost = reason == Reason::CommunicationFatalError;
        let out_of_sight = is_lost || reason == Reason::MovementTimeout;
        let may_go_on = match self {
            Motion::TakingOff { step, .. } | Motion::Landing { step, .. } => {
                step.may_be_begun() && out_of_sight
            }
            Motion::Following { step, .. } => step.has_begun() && is_lost,
            Motion::Holding { .. } => out_of_sight,
            Motion::Idle(_) | Motion::Deferred { .. } | Motion::Stopping { .. } => false,
        };
        match may_go_on {
            true => Stage::Unknown,
            false => Stage::Aborted,
        }
    }

    fn begin_by_passed(&self, now: MonotonicNs) -> Action {
        let late = match self.requester() {
            Some(requester) => Verdict::too_late(requester, now),
            None => Reason::TooLate.into(),
        };
        let (aborted, unknown) = (late.at(Stage::Aborted), late.at(Stage::Unknown));
        match *self {
            Motion::TakingOff { step, .. } | Motion::Landing { step, .. }
                if !step.may_be_begun() =>
            {
                Action::GiveUp(aborted, Rest::Ready)
            }
            // The acknowledgement of an order that is on its way decides; it comes or fails soon.
            Motion::TakingOff { .. } => Action::Withdraw(FlightCommand::TakeOff, aborted),
            Motion::Landing { .. } => Action::Withdraw(FlightCommand::Land, aborted),
            Motion::Following { step, .. } if step.has_begun() => Action::None,
            Motion::Following { .. } => Action::GiveUp(aborted, Rest::Ready),
            Motion::Holding { .. } => Action::End(unknown, Rest::Ready),
            Motion::Stopping { then, .. } => Action::End(unknown, then),
            // The DSP could not be reached, so no part of the movement was sent.
            Motion::Deferred { .. } => Action::End(aborted, Rest::Ready),
            Motion::Idle(_) => Action::None,
        }
    }

    fn safety_landing(&self, then: Rest, facts: &Facts) -> Action {
        // Rules land a helicopter that flies, or flew when that was last known.
        match facts.flying != Some(false) && facts.is_link_up {
            true => Action::Land(MovementOrder {
                requester: None,
                then,
            }),
            false => Action::None,
        }
    }

    /// A command of a take-off or landing was acknowledged.
    fn ordered(&mut self, command: FlightCommand, data: AckData, facts: &Facts) -> Action {
        match (command, &mut *self) {
            (FlightCommand::WriteTakeOffAltitude, Motion::TakingOff { .. }) => {
                Action::ReadTakeOffAltitude
            }
            (FlightCommand::ReadTakeOffAltitude, Motion::TakingOff { height_m, .. }) => {
                match data == AckData::Bits32(*height_m) {
                    true => Action::OrderTakeOff,
                    // A DSP that has another altitude than the requested one must not take off.
                    false => refused_by_dsp(Some(DspErrorCode::INVALID_COMMAND)),
                }
            }
            (FlightCommand::TakeOff, Motion::TakingOff { step, .. })
            | (FlightCommand::Land, Motion::Landing { step, .. }) => {
                match step.acknowledged(facts.now) {
                    true => Action::Ordered,
                    false => Action::None,
                }
            }
            (FlightCommand::ReadMovement, _) => {
                let is_under_way = data != AckData::Bits16(0);
                self.order(|signs| signs.port_read(is_under_way), facts)
            }
            // The answer belongs to a movement that has ended meanwhile.
            _ => Action::None,
        }
    }

    /// A sign of the DSP about the order of a take-off or landing.
    fn order(&mut self, sign: impl FnOnce(Signs<'_>) -> Next, facts: &Facts) -> Action {
        let (step, granted) = match self {
            Motion::TakingOff {
                step, is_granted, ..
            } => (step, Some(is_granted)),
            Motion::Landing { step, .. } => (step, None),
            _ => return Action::None,
        };
        let signs = Signs {
            step,
            granted,
            flying: facts.flying,
            looks_later: facts.looks_later,
        };
        match sign(signs) {
            Next::Wait => Action::None,
            Next::Look => Action::Look,
            Next::UnderWay => Action::UnderWay,
            Next::Done => Action::OrderDone,
            Next::Refused(error) => refused_by_dsp(error),
        }
    }

    /// The order for the take-off is on its way.
    pub fn take_off_sent(&mut self) {
        if let Motion::TakingOff { step, .. } = self {
            *step = DspOrder::Ordering(Doubt::default());
        }
    }

    /// How far the path under way is; `None` if none is.
    pub fn path_step(&self) -> Option<PathStep> {
        match self {
            Motion::Following { step, .. } => Some(*step),
            _ => None,
        }
    }

    /// The path under way is so far now.
    pub fn set_path_step(&mut self, to: PathStep) {
        if let Motion::Following { step, .. } = self {
            *step = to;
        }
    }

    /// The movement's order.
    pub fn movement_order(&self) -> Option<&MovementOrder> {
        match self {
            Motion::TakingOff { order, .. }
            | Motion::Landing { order, .. }
            | Motion::Following { order, .. }
            | Motion::Holding { order }
            | Motion::Deferred { order, .. } => Some(order),
            Motion::Idle(_) | Motion::Stopping { .. } => None,
        }
    }

    /// The request that gets the final report when this ends.
    pub fn requester(&self) -> Option<&RequestHeader> {
        match self {
            Motion::Stopping { requester, .. } => Some(requester),
            other => other.movement_order()?.requester.as_ref(),
        }
    }

    /// Which movement it is.
    pub fn kind(&self) -> Option<MovementKind> {
        match self {
            Motion::TakingOff { .. } => Some(MovementKind::TakeOff),
            Motion::Landing { .. } => Some(MovementKind::Land),
            Motion::Following { .. } => Some(MovementKind::GoToWaypoint),
            Motion::Deferred { lands: true, .. } => Some(MovementKind::Land),
            Motion::Holding { .. } | Motion::Deferred { .. } => Some(MovementKind::Hold),
            Motion::Idle(_) | Motion::Stopping { .. } => None,
        }
    }

    /// What the manager's rules need to know of it.
    pub fn standing(&self) -> Standing<ImiError> {
        match self {
            Motion::Idle(rest) => Standing::Resting(*rest),
            Motion::TakingOff { .. } | Motion::Landing { .. } => Standing::Working(OnStop::Refused),
            Motion::Following { .. } => Standing::Working(OnStop::Aborts),
            Motion::Holding { .. } | Motion::Deferred { .. } => Standing::Working(OnStop::Ends),
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
        self.is_blocked()
            || self
                .movement_order()
                .is_some_and(|order| order.then.is_blocked())
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
            Motion::TakingOff { .. } => Functionality::TakingOff,
            Motion::Following { .. } => Functionality::FollowingPath,
            Motion::Landing { .. } => Functionality::Landing,
            Motion::Holding { .. } | Motion::Deferred { .. } => Functionality::Holding,
            Motion::Stopping { .. } => Functionality::Stopping,
        }
    }
}

/// A module that is blocked rests after a hold or landing as it did before.
fn rest_after(before: Rest) -> Rest {
    match before.is_blocked() {
        true => before,
        false => Rest::Done,
    }
}

/// The DSP does not do what it was ordered to. Nothing is under way, so the next order may come.
fn refused_by_dsp(error: Option<DspErrorCode>) -> Action {
    Action::GiveUp(Verdict::refused_by_dsp(error), Rest::Ready)
}

impl PathStep {
    /// Whether the DSP may have a waypoint of it.
    pub fn has_begun(self) -> bool {
        !matches!(self, PathStep::AwaitingEmpty | PathStep::Ready)
    }
}

impl MovementOrder {
    /// The order of a request.
    pub const fn of(requester: RequestHeader) -> MovementOrder {
        MovementOrder {
            requester: Some(requester),
            then: Rest::Done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use module_kit::rules::Refused;

    const ERROR: ImiError = ImiError::HeroDspFatalError;
    const NONE: ImiError = ImiError::None;
    const ORDER: MovementOrder = MovementOrder {
        requester: None,
        then: Rest::Done,
    };
    const REQUESTER: RequestHeader = RequestHeader::TEST;

    const TAKING_OFF: Motion = Motion::TakingOff {
        order: ORDER,
        height_m: 5.0,
        ground_altitude_m: 0.0,
        is_granted: false,
        step: DspOrder::Preparing,
    };
    const LANDING: Motion = Motion::Landing {
        order: ORDER,
        step: DspOrder::UnderWay,
    };
    const FOLLOWING: Motion = Motion::Following {
        order: ORDER,
        step: PathStep::Flying,
    };
    const HOLDING: Motion = Motion::Holding { order: ORDER };
    const DEFERRED: Motion = Motion::Deferred {
        order: MovementOrder {
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
            (DEFERRED, Err(Running), Ok(stopped)),
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
            (DEFERRED, S::Running, false, F::Holding),
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

    const FACTS: Facts = Facts {
        now: MonotonicNs(9),
        is_link_up: true,
        is_path_empty: true,
        flying: Some(true),
        may_fly: true,
        looks_later: false,
    };

    #[test]
    fn every_motion_and_order() {
        use Reason as R;
        let ok = |then| -> Result<Rest, Reason> { Ok(then) };
        let (done, stopped) = (Ok(Rest::Done), ok(Rest::Stopped(NONE)));
        let [busy, unable, start] = [R::Busy, R::UnableToAbort, R::NotStarted].map(Err);
        // Take-off, path, path that pre-empts, hold, landing, landing that pre-empts.
        let asked = [
            (OrderKind::TakeOff, false),
            (OrderKind::Path, false),
            (OrderKind::Path, true),
            (OrderKind::Hold, false),
            (OrderKind::Land, false),
            (OrderKind::Land, true),
        ];
        let (order, lands) = (ORDER, false);
        let hold = Motion::Deferred { order, lands };
        let table = [
            (Motion::Idle(Rest::Ready), [done; 6]),
            (
                Motion::Idle(Rest::Stopped(NONE)),
                [start, start, start, stopped, stopped, stopped],
            ),
            (FOLLOWING, [busy, busy, done, done, busy, done]),
            (HOLDING, [busy, busy, done, done, busy, done]),
            (TAKING_OFF, [busy, busy, busy, unable, busy, busy]),
            (LANDING, [busy, busy, busy, unable, busy, busy]),
            (hold, [busy, busy, busy, done, done, done]),
            // Its module is stopped.
            (DEFERRED, [start, start, start, stopped, stopped, stopped]),
            (STOPPING, [start, start, start, busy, busy, busy]),
        ];
        for (motion, expected) in table {
            let allows = |facts| asked.map(|(kind, preempt)| motion.allows(kind, preempt, &facts));
            assert_eq!(allows(FACTS), expected, "{motion:?}");
            // On the ground, hold and landing want a start as well.
            let may_fly = false;
            if motion.is_blocked() {
                assert_eq!(allows(Facts { may_fly, ..FACTS }), [start; 6], "{motion:?}");
                let facts = Facts {
                    is_link_up: false,
                    may_fly,
                    ..FACTS
                };
                let mut ground = [Err(R::LinkDown); 6];
                ground[3..].fill(start);
                assert_eq!(allows(facts), ground, "{motion:?}");
            }
            // Without the link only hold and landing are taken, and these only in the air.
            let mut down = [Err(R::LinkDown); 6];
            if motion.unable_to_abort() {
                down[3] = unable;
            }
            let facts = Facts {
                is_link_up: false,
                may_fly,
                ..FACTS
            };
            if !motion.is_blocked() {
                assert_eq!(allows(facts), down, "{motion:?}");
            }
            down[3..].copy_from_slice(&expected[3..]);
            let facts = Facts {
                is_link_up: false,
                ..FACTS
            };
            assert_eq!(allows(facts), down, "{motion:?}");
        }
    }

    /// What an event makes of each motion, with its rest, error and reason, whatever is known of flight and link.
    #[test]
    #[rustfmt::skip]
    fn every_motion_and_event() {
        use {Action as A, Event as E, Reason as R};
        let (idle, lost) = (Motion::Idle(Rest::Ready), ImiError::CommunicationFatalError);
        let hold = Motion::Deferred { order: ORDER, lands: false };
        let motions = [idle, TAKING_OFF, LANDING, FOLLOWING, HOLDING, DEFERRED, hold, STOPPING];
        let aborted = Verdict::aborted;
        let at_unknown = |reason| aborted(reason).at(Stage::Unknown);
        let not_told = Verdict::ended(Stage::Unknown, R::CommunicationFatalError, lost);
        let fatal = A::Fatal(lost, R::CommunicationFatalError);
        let timeout = A::Fatal(ImiError::MovementTimeout, R::MovementTimeout);
        let error_30 = DspErrorCode::INVALID_COMMAND;
        let refused = |error| A::GiveUp(Verdict::refused_by_dsp(error), Rest::Ready);
        let breach = |rule| Violation { rule, action: ipc_types::code::SafetyAction::Hold, amount: 0.0 };
        let (fuel, pilot) = (breach(SafetyRule::Fuel), breach(SafetyRule::PilotSwitch));
        let status = E::Status { flying: false, position: None };
        let told = |command, data| E::Delivered(command, data);
        let port_reads = |value| told(FlightCommand::ReadMovement, AckData::Bits16(value));
        let height_reads = |value| told(FlightCommand::ReadTakeOffAltitude, AckData::Bits32(value));
        let vanished = E::Vanished(ERROR, R::DspRebooted);
        let (stopped, stopped_late) = (Rest::Stopped(NONE), Verdict::too_late(&REQUESTER, FACTS.now));
        let lands = A::Land(MovementOrder { requester: None, then: Rest::Ready });
        let waiting = *DEFERRED.movement_order().unwrap();
        // The helicopter flies and the link is up. A motion that is not named: nothing.
        let table: Vec<(Event, Vec<(Motion, Action)>)> = vec![
            (status, vec![(LANDING, A::Look), (FOLLOWING, A::Watch(None))]),
            (E::Grant, vec![(LANDING, A::Look), (FOLLOWING, A::SendWaypoint)]),
            (E::StepDue, vec![(LANDING, A::Look), (FOLLOWING, A::SettlingOver)]),
            (E::DspError(error_30), vec![(FOLLOWING, A::WaypointError(error_30))]),
            (E::DspError(DspErrorCode::PC_CHECKSUM), vec![(FOLLOWING, A::WaypointError(DspErrorCode::PC_CHECKSUM))]),
            (E::DspError(DspErrorCode(77)), vec![]),
            (told(FlightCommand::CountWaypoints, AckData::Bits16(7)), vec![(FOLLOWING, A::Counted(7))]),
            (told(FlightCommand::WriteTakeOffAltitude, AckData::None), vec![(TAKING_OFF, A::ReadTakeOffAltitude)]),
            (height_reads(5.0), vec![(TAKING_OFF, A::OrderTakeOff)]),
            (height_reads(4.0), vec![(TAKING_OFF, refused(Some(error_30)))]),
            // Neither order is on its way.
            (told(FlightCommand::TakeOff, AckData::None), vec![]),
            (told(FlightCommand::Land, AckData::None), vec![]),
            (port_reads(1), vec![]),
            (port_reads(0), vec![(LANDING, refused(None))]),
            (told(FlightCommand::ClearErrors, AckData::None), vec![(STOPPING, A::End(Verdict::DONE, stopped))]),
            // The errors of the one that is stopping are not cleared.
            (E::PathEmptied, vec![(HOLDING, A::End(Verdict::DONE, Rest::Done))]),
            (E::PathNotEmptied, vec![
                (FOLLOWING, fatal), (HOLDING, A::End(not_told, Rest::Aborted(lost))),
                (STOPPING, A::End(not_told, Rest::Stopped(lost))),
            ]),
            (E::PathDropped, vec![(FOLLOWING, A::PathLost(lost, R::CommunicationFatalError))]),
            (E::Undelivered(FlightCommand::Land), motions.map(|motion| (motion, fatal)).to_vec()),
            (E::Undelivered(FlightCommand::ClearErrors), vec![(STOPPING, A::End(not_told, Rest::Stopped(lost)))]),
            (vanished, vec![
                (TAKING_OFF, A::Fatal(ERROR, R::DspRebooted)), (LANDING, A::Fatal(ERROR, R::DspRebooted)),
                (FOLLOWING, A::PathLost(ERROR, R::DspRebooted)), (HOLDING, A::PathLost(ERROR, R::DspRebooted)),
                (STOPPING, A::End(Verdict::ended(Stage::Aborted, R::DspRebooted, ERROR), stopped)),
            ]),
            (E::Reachable, vec![(DEFERRED, A::Land(waiting)), (hold, A::Hold(ORDER))]),
            (E::BeginByPassed, vec![
                (TAKING_OFF, A::GiveUp(aborted(R::TooLate), Rest::Ready)),
                (LANDING, A::Withdraw(FlightCommand::Land, aborted(R::TooLate))),
                (HOLDING, A::End(at_unknown(R::TooLate), Rest::Ready)),
                (DEFERRED, A::End(aborted(R::TooLate), Rest::Ready)),
                (hold, A::End(aborted(R::TooLate), Rest::Ready)),
                (STOPPING, A::End(stopped_late.at(Stage::Unknown), stopped)),
            ]),
            (E::TimeLimit, motions.map(|motion| (motion, timeout)).to_vec()),
            (E::SafetyHold(fuel), vec![(FOLLOWING, A::Intervene(fuel))]),
            (E::SafetyHold(pilot), [TAKING_OFF, LANDING, FOLLOWING].map(|motion| (motion, A::Intervene(pilot))).to_vec()),
            (E::SafetyLand, vec![(idle, lands), (HOLDING, lands)]),
            (E::SenderLost, vec![(FOLLOWING, A::GiveUp(aborted(R::SenderLost), Rest::Ready))]),
            (E::WindDown, vec![(FOLLOWING, A::EmptyPath)]),
            (E::Close, vec![
                (TAKING_OFF, A::End(at_unknown(R::BridgeEnding), Rest::Ready)),
                (LANDING, A::End(at_unknown(R::BridgeEnding), Rest::Ready)),
                (FOLLOWING, A::End(at_unknown(R::BridgeEnding), Rest::Ready)),
                (HOLDING, A::End(at_unknown(R::BridgeEnding), Rest::Ready)),
                (DEFERRED, A::End(aborted(R::BridgeEnding), Rest::Ready)),
                (hold, A::End(aborted(R::BridgeEnding), Rest::Ready)),
                (STOPPING, A::End(at_unknown(R::BridgeEnding), stopped)),
            ]),
        ];
        let any = [None, Some(false), Some(true)];
        let [unknown, ground, air] = [&any[..1], &any[1..2], &any[2..]];
        let (both, down): (&[bool], &[bool]) = (&[false, true], &[false]);
        // Where flight or link make another thing of it.
        type Other<'a> = (Event, Motion, &'a [Option<bool>], &'a [bool], Action);
        let others: [Other<'_>; 12] = [
            (E::Grant, LANDING, ground, both, A::None),
            (port_reads(0), LANDING, ground, both, A::OrderDone),
            (port_reads(0), LANDING, unknown, both, A::None),
            (E::Reachable, DEFERRED, &any, down, A::None),
            (E::Reachable, DEFERRED, ground, &[true], A::End(aborted(R::NotFlying), Rest::Ready)),
            (E::Reachable, hold, &any, down, A::None),
            (E::SafetyLand, idle, ground, both, A::None),
            (E::SafetyLand, idle, air, down, A::None),
            (E::SafetyLand, idle, unknown, down, A::None),
            (E::SafetyLand, HOLDING, ground, both, A::None),
            (E::SafetyLand, HOLDING, air, down, A::None),
            (E::SafetyLand, HOLDING, unknown, down, A::None),
        ];
        for ((event, actions), motion) in table.iter().flat_map(|row| motions.map(|motion| (row, motion))) {
            for (flying, is_link_up) in any.iter().flat_map(|flying| both.iter().map(|up| (*flying, *up))) {
                let other = others.iter().find(|other| {
                    (other.0, other.1) == (*event, motion) && other.2.contains(&flying) && other.3.contains(&is_link_up)
                });
                let named = actions.iter().find(|(named, _)| *named == motion).map_or(A::None, |(_, action)| *action);
                let expected = other.map_or(named, |other| other.4);
                let (mut after, facts) = (motion, Facts { flying, is_link_up, ..FACTS });
                assert_eq!(after.apply(*event, &facts), expected, "{event:?} {motion:?} {facts:?}");
                match (event, &after) {
                    (E::Delivered(..), Motion::Stopping { errors_cleared, .. }) => {
                        assert_eq!(*errors_cleared, expected != A::None);
                    }
                    (E::WindDown, Motion::Following { step, .. }) => assert_eq!(*step, PathStep::BridgeEnding),
                    _ => assert_eq!(after, motion, "{event:?}"),
                }
            }
        }
        // A stop ends when both are known, in either order.
        let mut stopping = STOPPING;
        let facts = Facts { is_path_empty: false, ..FACTS };
        assert_eq!(stopping.apply(told(FlightCommand::ClearErrors, AckData::None), &facts), A::None);
        assert_eq!(stopping.apply(E::PathEmptied, &facts), A::None);
        assert_eq!(stopping.apply(E::PathEmptied, &FACTS), A::End(Verdict::DONE, stopped));
    }

    /// Once the DSP may have a movement, a link that is lost says nothing of it.
    #[test]
    fn an_early_end_is_known_as_far_as_the_dsp_has_it_and_a_fatal_error_blocks() {
        let reasons = [
            Reason::CommunicationFatalError,
            Reason::MovementTimeout,
            Reason::DspRebooted,
        ];
        let mut ordering = TAKING_OFF;
        ordering.take_off_sent();
        let mut ready = FOLLOWING;
        ready.set_path_step(PathStep::Ready);
        let (known, idle) = ([false; 3], Motion::Idle);
        // Whether the end is unknown, by reason; how the module rests after a fatal error, and whether that ends
        // anything.
        let table = [
            (TAKING_OFF, known, None, true),
            (ordering, [true, true, false], None, true),
            (LANDING, [true, true, false], None, true),
            (FOLLOWING, [true, false, false], None, true),
            (ready, known, None, true),
            (HOLDING, [true, true, false], None, true),
            (DEFERRED, known, None, true),
            (STOPPING, known, Some(Rest::Stopped(ERROR)), false),
            (
                idle(Rest::Ready),
                known,
                Some(Rest::Ready.with_fatal(ERROR)),
                true,
            ),
            (
                idle(Rest::Stopped(NONE)),
                known,
                Some(Rest::Stopped(ERROR)),
                false,
            ),
        ];
        for (motion, is_unknown, rests, ends) in table {
            let stages = reasons.map(|reason| motion.stage_of_early_end(reason));
            assert_eq!(
                stages.map(|it| it == Stage::Unknown),
                is_unknown,
                "{motion:?}"
            );
            let mut after = motion;
            assert_eq!(after.note_fatal(ERROR), ends, "{motion:?}");
            match after {
                Motion::Idle(then) | Motion::Stopping { then, .. } => {
                    assert_eq!(Some(then), rests)
                }
                _ => assert_eq!((after, None), (motion, rests)),
            }
        }
    }

    #[test]
    fn a_path_ends_when_the_buffer_is_empty_as_far_as_it_has_come() {
        use PathStep as P;
        let ended = |stage, reason| Some((stage, reason));
        let done = ended(Stage::Done, Reason::None);
        let ending = ended(Stage::Aborted, Reason::BridgeEnding);
        let late = ended(Stage::Aborted, Reason::TooLate);
        // Step, and what comes of an empty buffer, the end of the bridge, and the moment to begin.
        let table = [
            (P::AwaitingEmpty, [None, ending, late]),
            (P::Ready, [None, ending, late]),
            (P::Flying, [None, None, None]),
            (P::Settling, [None, None, None]),
            (P::Finishing, [done, None, None]),
            (P::BridgeEnding, [ending, None, None]),
        ];
        for (step, expected) in table {
            let found = [Event::PathEmptied, Event::WindDown, Event::BeginByPassed].map(|event| {
                let mut motion = Motion::Following { order: ORDER, step };
                match motion.apply(event, &FACTS) {
                    Action::End(verdict, _) | Action::GiveUp(verdict, _) => {
                        ended(verdict.stage, verdict.reason)
                    }
                    _ => None,
                }
            });
            assert_eq!(found, expected, "{step:?}");
        }
    }
}
