//! [`DspOrder`]: how far the order of a take-off or landing is, which the DSP carries out by itself (requirement D5;
//! `docs/protocol.md` section 8.5).
//!
//! The bridge gives the order, makes sure that the DSP carries it out, and takes the DSP's own word for the end. It
//! never judges an altitude.
//!
//! | step | take-off | landing |
//! |---|---|---|
//! | preparing | port 20121 is written, and read back | – |
//! | ordering | 1 is written to port 10121 | 1 is written to port 10122 |
//! | confirming | the port reads 1, or the flying flag is 1 → under way | the port reads 1 → under way; flag 0 and port 0 → done |
//! | under way | flow control 1 in the air, or port 0 in the air → done | flag 0 and port 0 → done |
//! | either, no flag since the order | flow control 1, then port 0 → done | – |
//! | refused | error 30 and the port reads 0 on the ground, or 0 for a second | error 30 and the port reads 0 in the air, or 0 for a second |

use std::time::Duration;

use dsp_protocol::DspErrorCode;
use ipc_types::MonotonicNs;
use serde::{Deserialize, Serialize};

/// How long the DSP may take after its acknowledgement to show that it carries out the order.
const CONFIRM_WITHIN: Duration = Duration::from_secs(1);

/// How far an order is.
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

/// What follows from a sign of the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Nothing follows.
    Wait,
    /// The port of the movement is to be read.
    Look,
    /// The DSP carries the order out since now.
    UnderWay,
    /// The movement is over.
    Done,
    /// The DSP does not do what it was ordered to, perhaps with this error.
    Refused(Option<DspErrorCode>),
}

/// An order with what its signs mean.
#[derive(Debug)]
pub struct Signs<'a> {
    /// The order.
    pub step: &'a mut DspOrder,
    /// Flow control 1 came since the order, before a flying flag did, and the port has not read 1 after it. `None` for
    /// a landing.
    pub granted: Option<&'a mut bool>,
    /// Whether the helicopter is in the air, if that is known since the order.
    pub flying: Option<bool>,
    /// The next look at the port has its time.
    pub looks_later: bool,
}

impl DspOrder {
    /// Whether the DSP may have got the order.
    pub fn may_be_begun(&self) -> bool {
        !matches!(self, DspOrder::Preparing)
    }

    /// The order was acknowledged. That it arrived does not say that it is carried out; false when it was not on its
    /// way.
    pub fn acknowledged(&mut self, now: MonotonicNs) -> bool {
        let DspOrder::Ordering(doubt) = *self else {
            return false;
        };
        let until = now + CONFIRM_WITHIN;
        *self = DspOrder::Confirming { until, doubt };
        true
    }

    /// The time for the next look has come.
    pub fn look_due(&self, now: MonotonicNs) -> Next {
        match self {
            // Without an answer about the port nothing speaks against the order: commands before the reading may have
            // been repeated.
            DspOrder::Confirming { until, doubt } if now >= *until && doubt.reads_zero => {
                doubt.refusal()
            }
            DspOrder::Confirming { .. } | DspOrder::UnderWay => Next::Look,
            DspOrder::Preparing | DspOrder::Ordering(_) => Next::Wait,
        }
    }

    /// Error 30 came. It may have another cause, so the port must say the same.
    pub fn error_30(&mut self) -> Next {
        match self {
            DspOrder::Ordering(doubt) => doubt.is_refused = true,
            DspOrder::Confirming { doubt, .. } => {
                doubt.is_refused = true;
                return doubt.judged();
            }
            DspOrder::Preparing | DspOrder::UnderWay => {}
        }
        Next::Wait
    }

    fn begin(&mut self) -> Next {
        *self = DspOrder::UnderWay;
        Next::UnderWay
    }
}

impl Signs<'_> {
    /// The port of the movement was read: it is 1 as long as the DSP says that the movement is under way.
    pub fn port_read(self, is_under_way: bool) -> Next {
        let is_take_off = self.granted.is_some();
        if is_under_way {
            if let Some(granted) = self.granted {
                *granted = false;
            }
            return match *self.step {
                DspOrder::Confirming { .. } => self.step.begin(),
                _ => Next::Wait,
            };
        }
        let is_refused =
            matches!(self.step, DspOrder::Confirming { doubt, .. } if doubt.is_refused);
        let is_over_by_grant = self.granted.is_some_and(|granted| *granted) && !is_refused;
        match (self.flying, self.step) {
            (None, _) if is_over_by_grant => Next::Done,
            // In the air after a take-off, on the ground with the rotor stopped after a landing.
            (Some(flying), DspOrder::Confirming { .. } | DspOrder::UnderWay)
                if flying == is_take_off =>
            {
                Next::Done
            }
            (Some(_), DspOrder::UnderWay) => Next::Refused(None),
            (_, DspOrder::Confirming { doubt, .. }) => {
                doubt.reads_zero = true;
                doubt.judged()
            }
            _ => Next::Wait,
        }
    }

    /// A status says whether the helicopter flies.
    pub fn status(self, flying: bool) -> Next {
        let is_begun = self.is_begun();
        match (self.granted, &self.step) {
            (Some(_), DspOrder::Confirming { .. }) if flying => self.step.begin(),
            // Touch-down: the landing lasts until the rotor has stopped, which its port shows.
            (None, _) if is_begun && !flying && !self.looks_later => Next::Look,
            _ => Next::Wait,
        }
    }

    /// Flow control 1: the DSP flies, and neither takes off nor lands. A flying flag that was received since the order
    /// and says otherwise makes it a damaged message. Without a flag it may be a late one: the port must say the same.
    pub fn flow_control(self) -> Next {
        if !self.is_begun() || self.flying == Some(false) {
            return Next::Wait;
        }
        match self.granted {
            Some(_) if self.flying.is_some() => Next::Done,
            Some(granted) => {
                *granted = true;
                Next::Look
            }
            // It has ended the landing by itself, or has not begun it yet: the port shows which.
            None if !self.looks_later => Next::Look,
            None => Next::Wait,
        }
    }

    fn is_begun(&self) -> bool {
        matches!(self.step, DspOrder::Confirming { .. } | DspOrder::UnderWay)
    }
}

impl Doubt {
    /// An order that the DSP reported as invalid and whose port reads 0 is refused. Either alone may have another
    /// cause.
    fn judged(self) -> Next {
        match self.is_refused && self.reads_zero {
            true => self.refusal(),
            false => Next::Wait,
        }
    }

    fn refusal(self) -> Next {
        Next::Refused(self.is_refused.then_some(DspErrorCode::INVALID_COMMAND))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_refused_only_when_its_port_has_read_zero() {
        let at = |ms: u64| MonotonicNs(ms * 1_000_000);
        let mut order = DspOrder::Ordering(Doubt::default());
        assert!(order.acknowledged(at(0)));
        // The reading waits behind commands that are repeated.
        assert_eq!(order.look_due(at(1_500)), Next::Look);
        let signs = Signs {
            step: &mut order,
            granted: None,
            flying: Some(true),
            looks_later: false,
        };
        assert_eq!(signs.port_read(false), Next::Wait);
        assert_eq!(order.look_due(at(999)), Next::Look);
        assert_eq!(order.look_due(at(1_000)), Next::Refused(None));
    }

    /// Take-off or landing, how far it is, the flying flag, whether a look follows anyway, and what comes of a status.
    #[test]
    fn a_status_begins_a_take_off_and_lets_a_landing_be_looked_at() {
        let until = MonotonicNs(9);
        let doubt = Doubt::default();
        let steps = [
            DspOrder::Preparing,
            DspOrder::Ordering(doubt),
            DspOrder::Confirming { until, doubt },
            DspOrder::UnderWay,
        ];
        for (index, step) in steps.into_iter().enumerate() {
            for bits in 0..8 {
                let [is_take_off, flying, looks_later] = [1, 2, 4].map(|bit| bits & bit != 0);
                let (mut after, mut granted) = (step, false);
                let signs = Signs {
                    step: &mut after,
                    granted: is_take_off.then_some(&mut granted),
                    flying: Some(flying),
                    looks_later,
                };
                let expected = match (is_take_off, index, flying, looks_later) {
                    (true, 2, true, _) => Next::UnderWay,
                    (false, 2 | 3, false, false) => Next::Look,
                    _ => Next::Wait,
                };
                assert_eq!(signs.status(flying), expected, "{step:?} {bits:#b}");
                let begins = expected == Next::UnderWay;
                assert_eq!(after, if begins { DspOrder::UnderWay } else { step });
            }
        }
    }
}
