//! [`Finding`]: one thing that the doctor has found.

use serde::Serialize;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// In order, or not to be judged.
    Note,
    /// Not in order, but it does no harm now.
    Warning,
    /// Keeps a process from its work.
    Error,
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Subject {
    /// What `--repair` did.
    Repair,
    /// The domain's folder, the processes in it, and what dead ones left.
    Domain,
    /// Space in `/dev/shm`.
    Memory,
    /// The provider of each service.
    Services,
    /// The relay's link to a robot on another machine.
    Relay,
    /// Configuration files and environment.
    Configuration,
    /// The serial port.
    Serial,
}

/// One thing that the doctor has found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What it is about.
    pub subject: Subject,
    /// Its name for programs; it stays the same from version to version.
    pub id: &'static str,
    /// What was found, in words.
    pub text: String,
    /// What the operator can do.
    pub next_step: Option<String>,
}

impl Finding {
    /// A finding without a next step.
    pub(super) fn new(
        severity: Severity,
        subject: Subject,
        id: &'static str,
        text: impl Into<String>,
    ) -> Finding {
        Finding {
            severity,
            subject,
            id,
            text: text.into(),
            next_step: None,
        }
    }

    /// The same with what the operator can do.
    pub(super) fn with_next_step(self, next_step: impl Into<String>) -> Finding {
        Finding {
            next_step: Some(next_step.into()),
            ..self
        }
    }
}

/// Makes the findings of one subject.
#[derive(Clone, Copy)]
pub(super) struct About(pub Subject);

impl About {
    /// Something that is in order.
    pub fn note(self, id: &'static str, text: impl Into<String>) -> Finding {
        Finding::new(Severity::Note, self.0, id, text)
    }

    /// Something that does no harm now.
    pub fn warning(
        self,
        id: &'static str,
        text: impl Into<String>,
        next_step: impl Into<String>,
    ) -> Finding {
        Finding::new(Severity::Warning, self.0, id, text).with_next_step(next_step)
    }

    /// Something that keeps a process from its work.
    pub fn error(
        self,
        id: &'static str,
        text: impl Into<String>,
        next_step: impl Into<String>,
    ) -> Finding {
        Finding::new(Severity::Error, self.0, id, text).with_next_step(next_step)
    }
}
