//! [`Finding`]: one thing that was looked at, how bad it is, and what to do about it.
//!
//! The checks of a machine, of a robot before its flight, of a plan and of a demonstration find such things, and so do
//! alarms in flight. Each has the fields of its own JSON object.

use serde::Serialize;

/// How bad a finding is; the later is the worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// In order, or not to be judged.
    Note,
    /// Not in order, but it does no harm now: the operator should know it.
    Warning,
    /// Keeps a process from its work, or the helicopter on the ground.
    Error,
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// Its name for programs, in lower kebab case; it stays the same from version to version.
    pub id: &'static str,
    /// Which of several things with this name, in order, such as the items of a plan or the code of an error; empty if
    /// there is one.
    pub items: Vec<u32>,
    /// The leg of a plan, from 1: leg 1 leads to the first waypoint.
    pub leg: Option<u32>,
    /// By how much a limit is exceeded, metres.
    pub amount_m: Option<f64>,
    /// Whether it could be looked at. If not, it is an error, unless the operator does without it.
    pub is_checked: bool,
    /// What was found, with its unit; of a thing that could not be looked at, why.
    pub text: String,
    /// What would be in order; `None` if the text says it.
    pub limit: Option<String>,
    /// What to do; `None` if nothing, or if the text says it.
    pub next_step: Option<String>,
}

impl Finding {
    /// Something without a limit and a next step.
    pub fn new(severity: Severity, id: &'static str, text: impl Into<String>) -> Finding {
        Finding {
            severity,
            id,
            items: Vec::new(),
            leg: None,
            amount_m: None,
            is_checked: true,
            text: text.into(),
            limit: None,
            next_step: None,
        }
    }

    /// Something that is in order.
    pub fn note(id: &'static str, text: impl Into<String>) -> Finding {
        Finding::new(Severity::Note, id, text)
    }

    /// Something that the operator should know.
    pub fn warning(
        id: &'static str,
        text: impl Into<String>,
        next_step: impl Into<String>,
    ) -> Finding {
        Finding::new(Severity::Warning, id, text).with_next_step(next_step)
    }

    /// Something that keeps a process from its work, or the helicopter on the ground.
    pub fn error(
        id: &'static str,
        text: impl Into<String>,
        next_step: impl Into<String>,
    ) -> Finding {
        Finding::new(Severity::Error, id, text).with_next_step(next_step)
    }

    /// Something that could not be looked at.
    pub fn unchecked(id: &'static str, why: impl Into<String>) -> Finding {
        Finding {
            is_checked: false,
            ..Finding::new(Severity::Error, id, why)
        }
    }

    /// Adds what would be in order.
    #[must_use]
    pub fn with_limit(mut self, limit: impl Into<String>) -> Finding {
        self.limit = Some(limit.into());
        self
    }

    /// Adds what to do about it.
    #[must_use]
    pub fn with_next_step(mut self, next_step: impl Into<String>) -> Finding {
        self.next_step = Some(next_step.into());
        self
    }

    /// Says which one of several things it is about.
    #[must_use]
    pub fn about(mut self, item: u32) -> Finding {
        self.items.push(item);
        self
    }

    /// Says on which leg it is.
    #[must_use]
    pub fn on_leg(mut self, leg: u32) -> Finding {
        self.leg = Some(leg);
        self
    }

    /// Adds the metres by which a limit is exceeded.
    #[must_use]
    pub fn by_m(mut self, amount_m: f64) -> Finding {
        self.amount_m = Some(amount_m);
        self
    }

    /// Makes it a warning if it could not be looked at: the operator does without it.
    #[must_use]
    pub fn may_be_unchecked(mut self) -> Finding {
        if !self.is_checked {
            self.severity = Severity::Warning;
            let default = || "look at it yourself".to_owned();
            self.next_step.get_or_insert_with(default);
        }
        self
    }

    /// Whether it was looked at and is an error.
    pub fn has_failed(&self) -> bool {
        self.is_checked && self.severity == Severity::Error
    }

    /// Whether it could not be looked at, and the operator does not do without it.
    pub fn is_unmade(&self) -> bool {
        !self.is_checked && self.severity == Severity::Error
    }
}
