//! [`LastOrder`]: what last told the helicopter what to do, and whether the next step of a command may follow
//! (requirement H13).
//!
//! A step names the request that was the step before. It is taken only if nothing came between the two:
//!
//! | the step names | the last order is | |
//! |---|---|---|
//! | no request | any | taken, if its moment allows it ([`IssueMark`](super::request::IssueMark)) |
//! | a request | that request, if it was accepted, or that request and a parameter write that named it | taken |
//! | a parameter write | the request that the write named, and no later write named that | taken |
//! | the movement under way, and is a hold or a landing | one that was refused | taken |
//! | any request | another one, a safety rule, the pilot, a loss of the link or of the DSP, nothing yet | superseded |
//!
//! One order is remembered, whatever the number of commands: all but the last have had something between.

use ipc_types::code::{CameBetween, MovementKind, SafetyRule};
use serde::{Deserialize, Serialize};

use super::control::Who;
use super::request::RequestHeader;
use crate::safety::Violation;

/// The last order to the helicopter: what it was, and its request.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LastOrder {
    /// What it was.
    pub what: CameBetween,
    /// The request; 0 if it was none.
    pub request_id: u64,
    /// It was refused: a hold, a landing and a stop count all the same, and no step follows them.
    is_refused: bool,
    /// The last parameter write that was a step after it; 0 if there is none.
    write_id: u64,
    /// Who sent the request.
    pub sender: Option<Who>,
    /// The safety rule, if it was one.
    pub rule: Option<SafetyRule>,
}

/// A bridge that has just begun: it knows no step.
impl Default for LastOrder {
    fn default() -> LastOrder {
        LastOrder::event(CameBetween::BridgeBegan)
    }
}

impl LastOrder {
    /// A request that was taken as `what`.
    pub fn request(header: &RequestHeader, what: CameBetween) -> LastOrder {
        LastOrder {
            request_id: header.request_id,
            sender: Some(header.who()),
            ..LastOrder::event(what)
        }
    }

    /// Something that no request ordered.
    pub fn event(what: CameBetween) -> LastOrder {
        LastOrder {
            what,
            request_id: 0,
            is_refused: false,
            write_id: 0,
            sender: None,
            rule: None,
        }
    }

    /// A safety rule that holds or lands.
    pub fn rule(violation: &Violation) -> LastOrder {
        match violation.rule {
            SafetyRule::PilotSwitch => LastOrder::event(CameBetween::Pilot),
            rule => LastOrder {
                rule: Some(rule),
                ..LastOrder::event(CameBetween::SafetyRule)
            },
        }
    }

    /// Whether the step may follow.
    pub fn is_before(&self, step: &RequestHeader) -> bool {
        let follows = step.after == self.request_id || step.after == self.write_id;
        step.after == 0 || follows && !self.is_refused
    }

    /// A request was refused.
    pub fn refused(&mut self, header: &RequestHeader) {
        self.is_refused |= self.request_id == header.request_id;
    }

    /// A parameter write was taken. It counts if it is a step.
    pub fn wrote(&mut self, header: &RequestHeader) {
        if header.after != 0 {
            self.write_id = header.request_id;
        }
    }
}

/// What a movement is, when it comes between.
pub fn movement(kind: MovementKind) -> CameBetween {
    match kind {
        MovementKind::TakeOff => CameBetween::TakeOff,
        MovementKind::GoToWaypoint => CameBetween::GoTo,
        MovementKind::Land => CameBetween::Land,
        MovementKind::Hold => CameBetween::Hold,
    }
}
