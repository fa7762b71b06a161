//! How a report of the bridge is answered: [`answer_of`] has a line for every reason.
//!
//! An ACK is the bridge's first report: "accepted" is not "done". What comes later shows in mode, landed state and
//! texts.

use ipc_types::code::{Reason, Stage};

use crate::number::MavResult;

/// What COMMAND_ACK says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandAck {
    /// The result.
    pub result: MavResult,
    /// The bridge's reason, in `result_param2`.
    pub reason: Reason,
}

impl CommandAck {
    /// A result without a reason of the bridge.
    pub const fn plain(result: MavResult) -> CommandAck {
        CommandAck {
            result,
            reason: Reason::None,
        }
    }

    /// Whether it says that something is done.
    pub fn is_accepted(self) -> bool {
        self.result == MavResult::Accepted
    }
}

/// What a report of this stage with this reason is answered with.
pub fn answer_of(stage: Stage, reason: Reason) -> CommandAck {
    let result = match stage {
        Stage::Accepted | Stage::Progress | Stage::Done => MavResult::Accepted,
        Stage::Refused | Stage::Aborted | Stage::Unknown => refusal(reason),
    };
    CommandAck { result, reason }
}

fn refusal(reason: Reason) -> MavResult {
    match reason {
        Reason::Busy
        | Reason::UnableToAbort
        | Reason::NotStarted
        | Reason::NotFlying
        | Reason::AlreadyFlying
        | Reason::NotInFlight
        | Reason::NoPosition
        | Reason::LinkDown
        | Reason::RelayLinkDown
        | Reason::PilotHasControl
        | Reason::TooManyRequests
        | Reason::StillOpen
        | Reason::TooLate
        | Reason::Superseded
        | Reason::BridgeEnding
        | Reason::PathReplaced
        | Reason::NotInControl
        | Reason::FenceUnread
        | Reason::RelayTwoRobots
        | Reason::RelayTooManyStations => MavResult::TemporarilyRejected,
        Reason::InvalidRequest
        | Reason::NotFinite
        | Reason::OutOfRange
        | Reason::TooFar
        | Reason::FenceBreach
        | Reason::InvalidFence
        | Reason::PathTooLong
        | Reason::PathWithoutHead
        | Reason::NoSuchPort
        | Reason::RelayNotPermitted
        | Reason::ClockDiffers
        | Reason::Replayed => MavResult::Denied,
        Reason::None
        | Reason::SupplyLow
        | Reason::RefusedByDsp
        | Reason::DspFatalError
        | Reason::CommunicationFatalError
        | Reason::MovementTimeout
        | Reason::DspRebooted
        | Reason::PathBroken
        | Reason::DeliveryFailed
        | Reason::BridgeGone
        | Reason::ModuleGone
        | Reason::LinkLost
        | Reason::RelayLinkLost
        | Reason::NotRemembered => MavResult::Failed,
        Reason::Replaced | Reason::Stopped | Reason::SenderLost => MavResult::Cancelled,
        // Started is what was wanted.
        Reason::AlreadyRunning => MavResult::Accepted,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_result_is_sent_on_which_a_client_ends() {
        for stage in Stage::ALL {
            for reason in Reason::ALL {
                let answer = answer_of(stage, reason);
                assert!(answer.result as u8 <= 6, "{stage}, {reason}");
                let is_refused = matches!(stage, Stage::Refused | Stage::Aborted | Stage::Unknown);
                let is_accepted = !is_refused || reason == Reason::AlreadyRunning;
                assert_eq!(answer.is_accepted(), is_accepted, "{stage}, {reason}");
            }
        }
    }
}
