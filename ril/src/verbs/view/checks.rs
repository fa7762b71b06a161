//! [`Checks`]: what a page asks before an order: a flight is judged at once, a take-off by `ril preflight` beside the server.

use std::os::fd::BorrowedFd;

use ipc_types::MonotonicNs;
use runtime::finding::Severity;
use view::{ViewerId, page};

use super::fleet::ShownRobot;
use super::messages;
use super::orders::{check_go_to, target};
use super::preflight::{Preflight, PreflightCheck};

/// Most preflights at a time, each a process. A further one is answered with a finding that says so.
pub(super) const MAX_PREFLIGHTS: usize = 2;

/// A preflight that a page waits for.
struct PendingPreflight {
    viewer: ViewerId,
    order: String,
    robot: u32,
    preflight: Preflight,
}

/// See the module's documentation.
#[derive(Default)]
pub(super) struct Checks {
    asked: Vec<PendingPreflight>,
}

impl Checks {
    /// Begins what `check` asks for; gives the answer if it is there at once.
    pub fn take(
        &mut self,
        viewer: ViewerId,
        check: &page::CheckRequest,
        shown: &ShownRobot,
        now: MonotonicNs,
    ) -> Option<page::CheckResult> {
        match check.kind {
            page::CheckKind::Goto => Some(go_to(check, shown, now)),
            page::CheckKind::Takeoff => self.take_off(viewer, check, shown, now),
        }
    }

    fn take_off(
        &mut self,
        viewer: ViewerId,
        check: &page::CheckRequest,
        shown: &ShownRobot,
        now: MonotonicNs,
    ) -> Option<page::CheckResult> {
        // Of the same page only the newest question is worth an answer.
        self.asked.retain(|asked| asked.viewer != viewer);
        if self.asked.len() >= MAX_PREFLIGHTS {
            let why = "other pages are being answered: ask again in some seconds";
            return Some(failed(&check.order, check.robot, why));
        }
        match Preflight::start(shown.robot.id, now) {
            Ok(preflight) => {
                self.asked.push(PendingPreflight {
                    viewer,
                    order: check.order.clone(),
                    robot: check.robot,
                    preflight,
                });
                None
            }
            Err(error) => {
                let why = format!("`ril preflight` cannot be started: {error}");
                Some(failed(&check.order, check.robot, &why))
            }
        }
    }

    /// The answers that are there now.
    pub fn answers(&mut self, now: MonotonicNs) -> Vec<(ViewerId, page::CheckResult)> {
        let mut answers = Vec::new();
        self.asked.retain_mut(|asked| {
            let Some(ended) = asked.preflight.take(now) else {
                return true;
            };
            let answer = match ended {
                Ok(checks) => of_preflight(&asked.order, asked.robot, &checks),
                Err(why) => failed(&asked.order, asked.robot, &why),
            };
            answers.push((asked.viewer, answer));
            false
        });
        answers
    }

    /// What to wait for, [`MAX_PREFLIGHTS`] at most.
    pub fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        self.asked.iter().map(|asked| asked.preflight.descriptor())
    }

    /// When to look although nothing comes.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        let deadlines = self.asked.iter().map(|asked| asked.preflight.deadline());
        deadlines.min()
    }
}

fn go_to(check: &page::CheckRequest, shown: &ShownRobot, now: MonotonicNs) -> page::CheckResult {
    let target = match target(check.position, check.altitude_m) {
        Ok(target) => target,
        Err(why) => return failed(&check.order, check.robot, &why),
    };
    let checked = check_go_to(shown, target, now);
    page::CheckResult {
        order: check.order.clone(),
        robot: check.robot,
        severity: checked
            .findings
            .iter()
            .map(messages::finding_severity)
            .max()
            .unwrap_or(page::Severity::Ok),
        findings: checked.findings.iter().map(messages::finding).collect(),
        distance_m: checked.distance_m,
        duration_s: checked.duration_s,
    }
}

/// All checks that did not pass; the others are counted.
fn of_preflight(order: &str, robot: u32, checks: &[PreflightCheck]) -> page::CheckResult {
    let mut findings = Vec::new();
    let mut passed = 0;
    for check in checks {
        let severity = match check.verdict.as_deref() {
            Some("pass") => {
                passed += 1;
                continue;
            }
            Some("warn") => page::Severity::Warning,
            _ => page::Severity::Alarm,
        };
        findings.push(page::Finding {
            severity,
            text: format!("{}: {}", check.id, check.value),
            next_step: check.next_step.clone(),
        });
    }
    findings.sort_by_key(|finding| finding.severity != page::Severity::Alarm);
    let severity = findings
        .first()
        .map_or(page::Severity::Ok, |worst| worst.severity);
    findings.push(page::Finding {
        severity: page::Severity::Note,
        text: format!(
            "{passed} of {} checks of the preflight passed",
            checks.len()
        ),
        next_step: None,
    });
    page::CheckResult {
        order: order.to_owned(),
        robot,
        severity,
        findings,
        distance_m: None,
        duration_s: None,
    }
}

/// A check that could not be made.
pub(super) fn failed(order: &str, robot: u32, why: &str) -> page::CheckResult {
    page::CheckResult {
        order: order.to_owned(),
        robot,
        severity: messages::severity(Severity::Error),
        findings: vec![page::Finding {
            severity: messages::severity(Severity::Error),
            text: why.to_owned(),
            next_step: None,
        }],
        distance_m: None,
        duration_s: None,
    }
}
