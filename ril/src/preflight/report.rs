//! The checks as text for people and as JSON for programs.

use std::fmt::Write;

use serde::Serialize;

use super::check::{Check, Verdict, number_of, worst};
use crate::words::{count, wrap};

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Preflight.v1";

/// Width of the verdict and of the name of a check, and the space behind each.
const INDENT: usize = 22;

/// What `ril preflight` shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    schema: &'static str,
    robot: u32,
    /// The worst verdict of all.
    verdict: Verdict,
    failed: usize,
    warned: usize,
    passed: usize,
    /// Checks that could not be made, whatever they count as.
    unchecked: usize,
    checks: Vec<Check>,
}

impl Report {
    /// A report of `checks`.
    pub fn new(robot: u32, checks: Vec<Check>) -> Report {
        Report {
            schema: SCHEMA,
            robot,
            verdict: worst(&checks),
            failed: number_of(&checks, Some(Verdict::Fail)),
            warned: number_of(&checks, Some(Verdict::Warn)),
            passed: number_of(&checks, Some(Verdict::Pass)),
            unchecked: checks.iter().filter(|check| !check.checked).count(),
            checks,
        }
    }

    /// The worst verdict of all.
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// All of it in a few words.
    pub fn summary(&self) -> String {
        let warnings = count(self.warned, "warning");
        let mut text = format!("{} failed, {warnings}, {} passed", self.failed, self.passed);
        if self.unchecked > 0 {
            let unchecked = self.checks.iter().filter(|check| !check.checked);
            // Writing to a string cannot fail.
            let _ = write!(text, ", {} not checked: {}", self.unchecked, ids(unchecked));
        }
        text
    }

    /// A line for each check, one for its limit and what to do where it did not pass, and a summary; no line is longer than
    /// `width` characters if its words allow it.
    pub fn text(&self, width: usize) -> String {
        let mut text = format!("robot {}\n", self.robot);
        for check in &self.checks {
            lines(check, width, &mut text);
        }
        let readiness = match self.verdict {
            Verdict::Pass => "ready to take off",
            Verdict::Warn => "ready to take off, with warnings",
            Verdict::Fail => "NOT ready to take off",
        };
        text + &wrap(&format!("{readiness}: "), &self.summary(), width)
    }

    /// What a command that starts something says of the checks on standard error: each failure, and how many warnings.
    pub fn warnings(&self) -> Vec<String> {
        let failed = self.checks.iter();
        let failed = failed.filter(|check| check.verdict == Some(Verdict::Fail));
        let mut lines: Vec<String> = failed
            .map(|check| format!("not ready to take off: {}: {}", check.id, said(check)))
            .collect();
        for (verdict, text) in [
            (None, "not ready to take off, not checked: "),
            (Some(Verdict::Warn), "look at "),
        ] {
            if number_of(&self.checks, verdict) > 0 {
                let alike = self.checks.iter().filter(|check| check.verdict == verdict);
                lines.push(format!("{text}{}", ids(alike)));
            }
        }
        // The last line says where to read on.
        if let Some(last) = lines.last_mut() {
            *last += "; `ril preflight` says what to do";
        }
        lines
    }
}

fn ids<'a>(checks: impl Iterator<Item = &'a Check>) -> String {
    checks.map(|check| check.id).collect::<Vec<_>>().join(", ")
}

/// What was found, and of a check that could not be made that it was not.
fn said(check: &Check) -> String {
    match check.checked {
        true => check.value.clone(),
        false => format!("not checked: {}", check.value),
    }
}

fn lines(check: &Check, width: usize, text: &mut String) {
    let (mark, is_right) = match check.verdict {
        Some(Verdict::Pass) => ("ok", true),
        Some(Verdict::Warn) => ("warn", false),
        Some(Verdict::Fail) => ("FAIL", false),
        None => ("-", false),
    };
    let mut value = said(check);
    // A limit in words says of something that is in order what its value says already.
    let is_number = |limit: &&String| limit.bytes().any(|byte| byte.is_ascii_digit());
    let limit = check.limit.as_ref();
    if let Some(limit) = limit.filter(|limit| !is_right || is_number(limit)) {
        // Writing to a string cannot fail.
        let _ = write!(value, "; limit: {limit}");
    }
    let head = format!("{mark:<5} {:<16}", check.id);
    *text += &wrap(&head, &value, width);
    if let Some(next_step) = check.next_step.as_ref().filter(|_| !is_right) {
        let next_step = format!("→ {next_step}");
        *text += &wrap(&" ".repeat(INDENT), &next_step, width);
    }
}
