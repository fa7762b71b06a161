//! [`Check`]: one thing that was looked at, with its value, its limit, the verdict and what to do.

use serde::Serialize;

/// What a check came to; the later is the worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// In order.
    Pass,
    /// The robot can fly, and the operator should know this first.
    Warn,
    /// Do not take off.
    Fail,
}

/// One check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Its name for programs; it stays the same from version to version.
    pub id: &'static str,
    /// `None` if the check could not be made. The robot is not ready then, unless the operator does without the check.
    pub verdict: Option<Verdict>,
    /// Whether the check could be made.
    pub checked: bool,
    /// What was found, with its unit; of a check that could not be made, why.
    pub value: String,
    /// What would be in order; nothing where the value says it.
    pub limit: Option<String>,
    /// What to do; always there when the verdict is a warning or a failure.
    pub next_step: Option<String>,
}

impl Check {
    /// Something that is in order.
    pub fn pass(id: &'static str, value: impl Into<String>) -> Check {
        Check {
            id,
            verdict: Some(Verdict::Pass),
            checked: true,
            value: value.into(),
            limit: None,
            next_step: None,
        }
    }

    /// Something that the operator should know.
    pub fn warn(id: &'static str, value: impl Into<String>, next_step: impl Into<String>) -> Check {
        Check {
            verdict: Some(Verdict::Warn),
            next_step: Some(next_step.into()),
            ..Check::pass(id, value)
        }
    }

    /// Something that keeps the helicopter on the ground.
    pub fn fail(id: &'static str, value: impl Into<String>, next_step: impl Into<String>) -> Check {
        Check {
            verdict: Some(Verdict::Fail),
            ..Check::warn(id, value, next_step)
        }
    }

    /// A check that could not be made.
    pub fn impossible(id: &'static str, why: impl Into<String>) -> Check {
        Check {
            verdict: None,
            checked: false,
            ..Check::pass(id, why)
        }
    }

    /// The same check with what to do about it.
    #[must_use]
    pub fn next_step(self, next_step: impl Into<String>) -> Check {
        Check {
            next_step: Some(next_step.into()),
            ..self
        }
    }

    /// The same check, which the operator does without if it cannot be made.
    #[must_use]
    pub fn may_be_unchecked(self) -> Check {
        match self.checked {
            true => self,
            false => Check {
                verdict: Some(Verdict::Warn),
                next_step: self
                    .next_step
                    .or_else(|| Some("look at it yourself".to_owned())),
                ..self
            },
        }
    }

    /// The same check with what would be in order.
    #[must_use]
    pub fn limit(self, limit: impl Into<String>) -> Check {
        Check {
            limit: Some(limit.into()),
            ..self
        }
    }
}

/// The worst verdict of `checks`. What was not checked is not ready.
pub fn worst(checks: &[Check]) -> Verdict {
    let verdicts = checks
        .iter()
        .map(|check| check.verdict.unwrap_or(Verdict::Fail));
    verdicts.max().unwrap_or(Verdict::Fail)
}

/// How many of `checks` have this verdict.
pub fn number_of(checks: &[Check], verdict: Option<Verdict>) -> usize {
    let alike = checks.iter().filter(|check| check.verdict == verdict);
    alike.count()
}
