//! [`Lease`]: which page commands a robot. It is courtesy among pages: hold and land need none, and it binds no other
//! program.
//!
//! | | free | held by h | held by h, asked by a |
//! |---|---|---|---|
//! | take by v | held by v | h: renewed; else asked by v | h: renewed; else – |
//! | release by h | – | free | held by a |
//! | give by h | – | – | held by a |
//! | keep by h | – | – | held by h |
//! | sign of h | – | renewed | renewed |
//! | h is gone | – | free | held by a |
//! | a is gone | – | – | held by h |
//! | h was silent for 10 s | – | free | held by a |
//! | a has waited for 5 s | – | – | held by a |
//!
//! What others than h say changes nothing in the rows of h.

use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::event::ViewerId;
use crate::page::LeaseAction;

/// A page that gives no sign for so long does not command any more. A page that is hidden gives none.
pub const LEASE_TIME: Duration = Duration::from_secs(10);

/// A page that asks has command after so long, if the one that has it does not answer.
pub const ANSWER_TIME: Duration = Duration::from_secs(5);

/// A page that asks for the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Asker {
    pub viewer: ViewerId,
    /// When it has it without an answer.
    pub at: MonotonicNs,
}

/// Which page commands a robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Lease {
    /// No page commands.
    #[default]
    Free,
    /// A page commands.
    Held {
        by: ViewerId,
        until: MonotonicNs,
        asked: Option<Asker>,
    },
}

/// What happens to a lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Act {
    /// A page wants something of it.
    Want(ViewerId, LeaseAction),
    /// A page that is seen has given a sign.
    Sign(ViewerId),
    /// A page is gone, or looks at another robot.
    Gone(ViewerId),
    /// Time has passed.
    Time,
}

impl Lease {
    /// The page that commands.
    pub fn holder(self) -> Option<ViewerId> {
        match self {
            Lease::Free => None,
            Lease::Held { by, .. } => Some(by),
        }
    }

    /// When [`Act::Time`] changes something.
    pub fn deadline(self) -> Option<MonotonicNs> {
        match self {
            Lease::Free => None,
            Lease::Held { until, asked, .. } => {
                Some(asked.map_or(until, |asker| asker.at.min(until)))
            }
        }
    }

    /// The lease after this.
    pub fn after(self, act: Act, now: MonotonicNs) -> Lease {
        let Lease::Held { by, until, asked } = self else {
            return match act {
                Act::Want(viewer, LeaseAction::Take) => held(viewer, now),
                _ => Lease::Free,
            };
        };
        let renewed = Lease::Held {
            by,
            until: now + LEASE_TIME,
            asked,
        };
        let passed = asked.map_or(Lease::Free, |asker| held(asker.viewer, now));
        match act {
            Act::Want(viewer, LeaseAction::Take) if viewer == by => renewed,
            Act::Want(viewer, LeaseAction::Take) => {
                let asker = Asker {
                    viewer,
                    at: now + ANSWER_TIME,
                };
                Lease::Held {
                    by,
                    until,
                    asked: asked.or(Some(asker)),
                }
            }
            Act::Want(viewer, _) | Act::Sign(viewer) if viewer != by => self,
            Act::Want(_, LeaseAction::Release) => passed,
            Act::Want(_, LeaseAction::Give) if asked.is_some() => passed,
            Act::Want(_, LeaseAction::Give) => self,
            Act::Want(_, LeaseAction::Keep) => Lease::Held {
                by,
                until,
                asked: None,
            },
            Act::Sign(_) => renewed,
            Act::Gone(viewer) if viewer == by => passed,
            Act::Gone(viewer) => Lease::Held {
                by,
                until,
                asked: asked.filter(|asker| asker.viewer != viewer),
            },
            Act::Time if self.deadline().is_some_and(|deadline| now >= deadline) => passed,
            Act::Time => self,
        }
    }
}

fn held(by: ViewerId, now: MonotonicNs) -> Lease {
    Lease::Held {
        by,
        until: now + LEASE_TIME,
        asked: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: ViewerId = ViewerId(1);
    const A: ViewerId = ViewerId(2);
    const V: ViewerId = ViewerId(3);

    fn s(seconds: u64) -> MonotonicNs {
        MonotonicNs(seconds * 1_000_000_000)
    }

    #[test]
    fn each_act_in_each_state() {
        use LeaseAction::{Give, Keep, Release, Take};
        let held = |by, until, asked: Option<(ViewerId, u64)>| Lease::Held {
            by,
            until: s(until),
            asked: asked.map(|(viewer, at)| Asker { viewer, at: s(at) }),
        };
        let free = Lease::Free;
        let (plain, asked) = (held(H, 105, None), held(H, 105, Some((A, 104))));
        // At 100 s: the act, and what comes of free, held by H, and held by H with A that asks.
        let rows = [
            (
                Act::Want(H, Take),
                held(H, 110, None),
                held(H, 110, None),
                held(H, 110, Some((A, 104))),
            ),
            (
                Act::Want(V, Take),
                held(V, 110, None),
                held(H, 105, Some((V, 105))),
                asked,
            ),
            (
                Act::Want(A, Take),
                held(A, 110, None),
                held(H, 105, Some((A, 105))),
                asked,
            ),
            (Act::Want(H, Release), free, free, held(A, 110, None)),
            (Act::Want(A, Release), free, plain, asked),
            (Act::Want(H, Give), free, plain, held(A, 110, None)),
            (Act::Want(A, Give), free, plain, asked),
            (Act::Want(H, Keep), free, plain, plain),
            (Act::Want(A, Keep), free, plain, asked),
            (
                Act::Sign(H),
                free,
                held(H, 110, None),
                held(H, 110, Some((A, 104))),
            ),
            (Act::Sign(A), free, plain, asked),
            (Act::Gone(H), free, free, held(A, 110, None)),
            (Act::Gone(A), free, plain, plain),
            (Act::Gone(V), free, plain, asked),
            (Act::Time, free, plain, asked),
        ];
        for (act, of_free, of_held, of_asked) in rows {
            for (before, after) in [(free, of_free), (plain, of_held), (asked, of_asked)] {
                assert_eq!(before.after(act, s(100)), after, "{act:?} in {before:?}");
            }
        }
    }

    #[test]
    fn time_ends_it_at_the_edge() {
        let lease = Lease::Free.after(Act::Want(H, LeaseAction::Take), s(0));
        assert_eq!(lease.deadline(), Some(s(10)));
        assert_eq!(lease.after(Act::Time, MonotonicNs(s(10).0 - 1)), lease);
        assert_eq!(lease.after(Act::Time, s(10)), Lease::Free);
        let asked = lease.after(Act::Want(A, LeaseAction::Take), s(3));
        assert_eq!(asked.deadline(), Some(s(8)));
        assert_eq!(asked.after(Act::Time, MonotonicNs(s(8).0 - 1)), asked);
        assert_eq!(asked.after(Act::Time, s(8)).holder(), Some(A));
        // Signs do not put the answer off.
        let signed = asked.after(Act::Sign(H), s(7));
        assert_eq!(signed.after(Act::Time, s(8)).holder(), Some(A));
        // A holder that is silent does not wait for the answer.
        let late = lease.after(Act::Want(A, LeaseAction::Take), s(9));
        assert_eq!(late.after(Act::Time, s(10)).holder(), Some(A));
    }
}
