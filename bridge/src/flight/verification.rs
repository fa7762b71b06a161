//! Verified delivery of waypoints (requirement D14; `docs/protocol.md` sections 6 and 8.4).
//!
//! Waypoints are never acknowledged. But the DSP counts those that it takes, and bytes keep their order on the line: when
//! the count is read after a waypoint was sent, it shows for certain whether that one arrived. So each waypoint is sent,
//! counted, and sent again if it was lost, before the next one goes. A copy does no harm: the DSP discards a waypoint
//! that equals the one before.
//!
//! | phase | grant | count read |
//! |---|---|---|
//! | asking for the count | nothing | may send; or, without such a port, unverified |
//! | may send | send, then ask → checking | – |
//! | checking | nothing | as before: send again · one more: next · else: failed |
//! | unverified, the error of the question may come | nothing | – |
//! | unverified | send → unverified | – |
//!
//! A DSP without the port reports error 30 for the question, right after a status. The first waypoint waits for it, so that every
//! error 15 or 30 after that is about a waypoint. Without counts no waypoint is sent twice: the first such error ends the path.
//!
//! In the classic profile a late or repeated answer to a read of another port can be taken for the count. A port that does not
//! exist reads 0, so any other value without the bit is none: it is asked for again, three times in a row at most.

use ipc_types::code::Reason;
use serde::{Deserialize, Serialize};

/// The bit that the port of a DSP that counts always has; an unknown port reads 0.
const COUNTS: u16 = 0x8000;

/// Times that one waypoint is sent. With three in ten messages lost in either direction, one waypoint in 10⁶ needs
/// more than this; then the path is reported as failed, which is true as well.
pub const MAX_SENDINGS: u32 = 16;

/// So many values in a row that are neither a count nor 0 mean that the DSP does not count.
const NO_COUNTS: u32 = 3;

/// Statuses after which a DSP that does not count has reported the error of the question, or will not.
const STATUSES: u32 = 2;

/// What to do with the waypoint that flow control asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnGrant {
    /// Nothing: the DSP's count is awaited.
    Wait,
    /// Send it and read the count.
    SendAndCount,
    /// Send it; whether it arrives cannot be known.
    Send,
}

/// What a count says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counted {
    /// The first waypoint may be sent.
    Ready,
    /// The value is no count, and may be that of another port: it is to be read again.
    AskAgain,
    /// The DSP does not count: delivery is unverified.
    Unverified,
    /// The waypoint arrived; the next one's turn.
    Arrived,
    /// The waypoint was lost; it is to be sent again.
    Lost,
    /// The count is not what it can be, or the waypoint was lost too often.
    Failed(Reason),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum VerificationPhase {
    Asking,
    MaySend {
        count: u16,
        sendings: u32,
    },
    Checking {
        count: u16,
        sendings: u32,
    },
    Unverified {
        /// Statuses to come before the first waypoint goes.
        awaited: u32,
    },
}

/// Delivery of one path.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Verification {
    phase: VerificationPhase,
    /// Values in a row that were no count.
    no_counts: u32,
}

impl Verification {
    /// A path begins: its count is to be read first.
    pub const fn begin() -> Self {
        Verification {
            phase: VerificationPhase::Asking,
            no_counts: 0,
        }
    }

    /// Flow control grants a waypoint.
    pub fn on_grant(&self) -> OnGrant {
        match self.phase {
            VerificationPhase::Asking
            | VerificationPhase::Checking { .. }
            | VerificationPhase::Unverified { awaited: 1.. } => OnGrant::Wait,
            VerificationPhase::MaySend { .. } => OnGrant::SendAndCount,
            VerificationPhase::Unverified { awaited: 0 } => OnGrant::Send,
        }
    }

    /// Whether it can not be known if waypoints arrive.
    pub fn is_unverified(&self) -> bool {
        matches!(self.phase, VerificationPhase::Unverified { .. })
    }

    /// A status arrived.
    pub fn status_arrived(&mut self) {
        if let VerificationPhase::Unverified { awaited } = &mut self.phase {
            *awaited = awaited.saturating_sub(1);
        }
    }

    /// Error 30 arrived: the answer to the question for a count that the DSP does not have comes before the first waypoint.
    pub fn question_refused(&mut self) {
        if let VerificationPhase::Unverified { awaited } = &mut self.phase {
            *awaited = 0;
        }
    }

    /// Whether the waypoint to send has been sent before.
    pub fn is_repetition(&self) -> bool {
        matches!(self.phase, VerificationPhase::MaySend { sendings, .. } if sendings > 0)
    }

    /// The waypoint was sent and the count is being read.
    pub fn sent(&mut self) {
        if let VerificationPhase::MaySend { count, sendings } = self.phase {
            self.phase = VerificationPhase::Checking {
                count,
                sendings: sendings + 1,
            };
        }
    }

    /// The DSP's count was read.
    pub fn counted(&mut self, value: u16) -> Counted {
        let counts = value & COUNTS != 0;
        let now = value & !COUNTS;
        let is_of_another_port = !counts && value != 0;
        self.no_counts = if is_of_another_port {
            self.no_counts + 1
        } else {
            0
        };
        let is_awaited = matches!(
            self.phase,
            VerificationPhase::Asking | VerificationPhase::Checking { .. }
        );
        if is_awaited && (1..NO_COUNTS).contains(&self.no_counts) {
            return Counted::AskAgain;
        }
        match self.phase {
            VerificationPhase::Asking if counts => {
                self.phase = VerificationPhase::MaySend {
                    count: now,
                    sendings: 0,
                };
                Counted::Ready
            }
            VerificationPhase::Asking => {
                self.phase = VerificationPhase::Unverified { awaited: STATUSES };
                Counted::Unverified
            }
            VerificationPhase::Checking { count, .. } if counts && now == (count + 1) & !COUNTS => {
                self.phase = VerificationPhase::MaySend {
                    count: now,
                    sendings: 0,
                };
                Counted::Arrived
            }
            VerificationPhase::Checking { count, sendings } if counts && now == count => {
                if sendings == MAX_SENDINGS {
                    return Counted::Failed(Reason::DeliveryFailed);
                }
                self.phase = VerificationPhase::MaySend { count, sendings };
                Counted::Lost
            }
            VerificationPhase::Checking { .. }
            | VerificationPhase::MaySend { .. }
            | VerificationPhase::Unverified { .. } => Counted::Failed(Reason::DeliveryFailed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAILED: Counted = Counted::Failed(Reason::DeliveryFailed);

    #[test]
    fn every_phase_and_event() {
        let may_send = |count| VerificationPhase::MaySend { count, sendings: 0 };
        let checking = |count| VerificationPhase::Checking { count, sendings: 1 };
        // Phase, what a grant does, value read, what it says, phase afterwards.
        #[rustfmt::skip]
        let table = [
            (VerificationPhase::Asking, OnGrant::Wait, 0x8005, Counted::Ready, may_send(5)),
            (VerificationPhase::Asking, OnGrant::Wait, 0, Counted::Unverified, VerificationPhase::Unverified { awaited: STATUSES }),
            (
                VerificationPhase::Unverified { awaited: 1 },
                OnGrant::Wait,
                0x8005,
                FAILED,
                VerificationPhase::Unverified { awaited: 1 },
            ),
            (checking(5), OnGrant::Wait, 0x8006, Counted::Arrived, may_send(6)),
            (checking(0x7FFF), OnGrant::Wait, 0x8000, Counted::Arrived, may_send(0)),
            (checking(5), OnGrant::Wait, 0x8005, Counted::Lost, VerificationPhase::MaySend { count: 5, sendings: 1 }),
            (checking(5), OnGrant::Wait, 0x8007, FAILED, checking(5)),
            (checking(5), OnGrant::Wait, 0x8000, FAILED, checking(5)),
            (checking(5), OnGrant::Wait, 6, FAILED, checking(5)),
            (may_send(5), OnGrant::SendAndCount, 0x8005, FAILED, may_send(5)),
            (
                VerificationPhase::Unverified { awaited: 0 },
                OnGrant::Send,
                0x8005,
                FAILED,
                VerificationPhase::Unverified { awaited: 0 },
            ),
        ];
        for (phase, grant, value, counted, after) in table {
            // A value that is no count has come twice before.
            let mut verification = Verification {
                phase,
                no_counts: NO_COUNTS - 1,
            };
            assert_eq!(verification.on_grant(), grant, "{phase:?}");
            assert_eq!(verification.counted(value), counted, "{phase:?} {value:#x}");
            assert_eq!(verification.phase, after, "{phase:?} {value:#x}");
        }
    }

    #[test]
    fn the_value_of_another_port_is_not_taken_for_a_dsp_that_does_not_count() {
        let mut verification = Verification::begin();
        assert_eq!(verification.counted(2000), Counted::AskAgain);
        assert_eq!(verification.counted(2000), Counted::AskAgain);
        assert_eq!(verification.counted(0x8005), Counted::Ready);
        verification.sent();
        assert_eq!(verification.counted(1), Counted::AskAgain);
        assert_eq!(verification.counted(0x8006), Counted::Arrived);
    }

    #[test]
    fn a_waypoint_that_is_lost_again_and_again_fails_in_the_end() {
        let mut verification = Verification::begin();
        verification.counted(0x8000);
        for sending in 1..=MAX_SENDINGS {
            assert_eq!(verification.on_grant(), OnGrant::SendAndCount);
            verification.sent();
            let expected = if sending == MAX_SENDINGS {
                FAILED
            } else {
                Counted::Lost
            };
            assert_eq!(verification.counted(0x8000), expected);
        }
    }
}
