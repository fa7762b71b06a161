//! [`Finding`]: one thing that was looked at, how bad it is, and what to do about it.
//!
//! `ril doctor`, `ril preflight`, `ril demo` and the alarms of `ril watch` all find such things. [`Finding::lines`] shows one to people;
//! each verb has the fields of its own JSON object.

use serde::Serialize;

use crate::words::wrap;

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
    /// Its name for programs; it stays the same from version to version.
    pub id: &'static str,
    /// Which one of several with this name, such as the code of an error; 0 if there is only one.
    pub number: u32,
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
            number: 0,
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

    /// The same with what would be in order.
    #[must_use]
    pub fn with_limit(self, limit: impl Into<String>) -> Finding {
        Finding {
            limit: Some(limit.into()),
            ..self
        }
    }

    /// The same with what to do about it.
    #[must_use]
    pub fn with_next_step(self, next_step: impl Into<String>) -> Finding {
        Finding {
            next_step: Some(next_step.into()),
            ..self
        }
    }

    /// The same about one of several things.
    #[must_use]
    pub fn with_number(self, number: u32) -> Finding {
        Finding { number, ..self }
    }

    /// The same, which the operator does without if it could not be looked at.
    #[must_use]
    pub fn may_be_unchecked(self) -> Finding {
        if self.is_checked {
            return self;
        }
        let next_step = self.next_step.clone();
        Finding {
            severity: Severity::Warning,
            next_step: next_step.or_else(|| Some("look at it yourself".to_owned())),
            ..self
        }
    }

    /// What was found, or that it could not be looked at and why.
    pub fn shown(&self) -> String {
        match self.is_checked {
            true => self.text.clone(),
            false => format!("not checked: {}", self.text),
        }
    }

    /// A line of mark, heading, text and limit, and one of the next step. `width` is that of the heading; no line is longer than `columns`
    /// if its words allow it.
    pub fn lines(&self, heading: &str, width: usize, columns: usize) -> String {
        let mark = match (self.severity, self.is_checked) {
            (Severity::Note, _) => "ok",
            (Severity::Warning, _) => "warn",
            (Severity::Error, true) => "FAIL",
            (Severity::Error, false) => "-",
        };
        let mut text = self.shown();
        // Of something that is in order, a limit in words repeats the text.
        let is_number = |limit: &&String| limit.bytes().any(|byte| byte.is_ascii_digit());
        let limit = self.limit.as_ref();
        if let Some(limit) =
            limit.filter(|limit| self.severity > Severity::Note || is_number(limit))
        {
            text += &format!("; limit: {limit}");
        }
        let head = format!("{mark:<5} {heading:<width$}");
        let mut lines = wrap(&head, &text, columns);
        if let Some(next_step) = &self.next_step {
            let indent = " ".repeat(head.chars().count());
            lines += &wrap(&indent, &format!("→ {next_step}"), columns);
        }
        lines
    }
}

/// How many of `findings` are so severe.
pub fn count_of(findings: &[Finding], severity: Severity) -> usize {
    let alike = findings.iter().filter(|one| one.severity == severity);
    alike.count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_is_a_line_and_what_to_do_another_one() {
        let battery =
            || Finding::error("battery", "22.0 V", "charge it").with_limit("at least 24 V");
        for (finding, expected) in [
            (
                battery(),
                "FAIL  battery  22.0 V; limit: at least 24 V\n               → charge it\n",
            ),
            (
                Finding::note("link", "up").with_limit("up"),
                "ok    link     up\n",
            ),
            (
                Finding::note("battery", "25.0 V").with_limit("at least 24 V"),
                "ok    battery  25.0 V; limit: at least 24 V\n",
            ),
            (
                Finding::unchecked("fuel", "no sample").with_limit("full"),
                "-     fuel     not checked: no sample; limit: full\n",
            ),
            (
                Finding::unchecked("fuel", "no sample").may_be_unchecked(),
                "warn  fuel     not checked: no sample\n               → look at it yourself\n",
            ),
            (
                battery().may_be_unchecked(),
                &battery().lines("battery", 9, 80),
            ),
        ] {
            assert_eq!(finding.lines(finding.id, 9, 80), expected);
        }
        assert_eq!(
            Finding::note("a", "one two").lines("a", 2, 12),
            "ok    a one\n        two\n"
        );
    }
}
