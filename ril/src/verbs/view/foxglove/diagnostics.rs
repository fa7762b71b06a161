//! [`Diagnostics`]: the alarms of a robot for the diagnostics panels of viewers, which keep the newest condition of each name: an alarm
//! that is over is reported as over.

use ros_messages::{Diagnostic, DiagnosticLevel};
use view::page;

/// Most alarms that are remembered when they are over. There are fewer kinds, but for DSP errors. The oldest goes.
const MAX_KNOWN: usize = 64;

/// See the module's documentation.
#[derive(Debug, Default)]
pub(super) struct Diagnostics {
    /// Names of alarms that there were.
    known: Vec<String>,
}

impl Diagnostics {
    /// The conditions of `robot`: what it does, and each alarm. `is_fresh` says whether its bridge's state is of the present.
    pub fn take(&mut self, robot: &page::RobotStatus, is_fresh: bool) -> Vec<Diagnostic> {
        let hardware = format!("robot{}", robot.robot);
        let condition = |name: &str, level, message: &str| Diagnostic {
            level,
            name: format!("{hardware}: {name}"),
            message: message.to_owned(),
            hardware: hardware.clone(),
            values: Vec::new(),
        };
        let level = match is_fresh {
            true => DiagnosticLevel::Ok,
            false => DiagnosticLevel::Stale,
        };
        let mut conditions = vec![condition("phase", level, &robot.phase)];
        for alarm in &robot.alarms {
            let mut one = condition(&alarm.id, self::level(alarm.severity), &alarm.text);
            let next_step = alarm.next_step.iter();
            one.values
                .extend(next_step.map(|step| ("next step".to_owned(), step.clone())));
            conditions.push(one);
            if !self.known.contains(&alarm.id) {
                self.known.push(alarm.id.clone());
            }
        }
        let over = self.known.len().saturating_sub(MAX_KNOWN);
        self.known.drain(..over);
        for name in &self.known {
            if !robot.alarms.iter().any(|alarm| alarm.id == *name) {
                conditions.push(condition(name, DiagnosticLevel::Ok, "over"));
            }
        }
        conditions
    }
}

fn level(severity: page::Severity) -> DiagnosticLevel {
    match severity {
        page::Severity::Ok | page::Severity::Note => DiagnosticLevel::Ok,
        page::Severity::Warning => DiagnosticLevel::Warn,
        page::Severity::Alarm => DiagnosticLevel::Error,
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::RobotId;

    use super::*;
    use crate::robot::fixture::{at, fly};
    use crate::robot::model::{Process, WatchedRobot};
    use crate::verbs::view::messages;

    fn said(
        diagnostics: &mut Diagnostics,
        robot: &WatchedRobot,
        ms: u64,
    ) -> Vec<(DiagnosticLevel, String, String)> {
        let is_fresh = robot.process(Process::Bridge, at(ms)).is_fresh();
        let conditions = diagnostics.take(&messages::robot(robot, at(ms)), is_fresh);
        assert!(conditions.iter().all(|one| one.hardware == "robot1"));
        conditions
            .into_iter()
            .map(|one| (one.level, one.name, one.message))
            .collect()
    }

    #[test]
    fn alarms_come_and_are_over() {
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        fly(&mut robot);
        robot.judge(at(20_000));
        let mut diagnostics = Diagnostics::default();
        let phase = "robot1: phase".to_owned();
        let flying = "flying the path, waypoint 2 of 3".to_owned();
        let expected = [(DiagnosticLevel::Ok, phase.clone(), flying.clone())];
        assert_eq!(said(&mut diagnostics, &robot, 20_100), expected);

        robot.provider(Process::Bridge, false, at(21_500));
        robot.judge(at(21_500));
        let gone = said(&mut diagnostics, &robot, 21_500);
        assert_eq!(gone[0], (DiagnosticLevel::Stale, phase, flying));
        assert_eq!(
            (gone[1].0, &*gone[1].1),
            (DiagnosticLevel::Error, "robot1: bridge-gone")
        );

        let state = robot.state.unwrap();
        let state = ipc_types::payload::ModuleState {
            published_ns: at(22_000).0,
            ..state
        };
        robot.state(&state, at(22_000));
        robot.provider(Process::Bridge, true, at(22_000));
        robot.judge(at(22_000));
        let back = said(&mut diagnostics, &robot, 22_000);
        let over = (
            DiagnosticLevel::Ok,
            "robot1: bridge-gone".to_owned(),
            "over".to_owned(),
        );
        assert!(back.contains(&over), "{back:?}");
    }
}
