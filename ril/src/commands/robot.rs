//! Which robot a command is for: a command that moves a helicopter does not guess it when several are alive.
//!
//! A robot is alive when a process serves its movements, which is its bridge. The default stays robot 1 also when the only
//! robot that is alive is another one: a robot that was not named is never commanded in place of the default.

use ipc_types::payload::MovementData;
use ipc_types::{Domain, Request, RobotId};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::cli::RobotChoice;

/// Refuses a default robot when several are alive.
///
/// # Errors
///
/// Code 2 with the robots that are alive; code 1 or 78 when the domain cannot be read.
pub(super) fn refuse_to_guess(choice: RobotChoice) -> Result<(), Failure> {
    if choice == RobotChoice::Explicit {
        return Ok(());
    }
    match ambiguity(&alive()?) {
        Some(text) => Err(Failure::usage(text)),
        None => Ok(()),
    }
}

/// Which other robots could be meant when the one that was asked for does not answer; empty when there is none.
pub(super) fn others_alive(robot: RobotId) -> String {
    let mut others = alive().unwrap_or_default();
    others.retain(|other| *other != robot);
    match others.as_slice() {
        [] => String::new(),
        [one] => format!("; robot {one} is alive: name it with --robot {one} if it is meant"),
        several => format!(
            "; robots {} are alive: name one with --robot if it is meant",
            list(several)
        ),
    }
}

fn alive() -> Result<Vec<RobotId>, Failure> {
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    domain.robots(MovementData::KEY).or_fail(ExitCode::Internal)
}

/// Why a default robot is refused; nothing when it is unambiguous.
fn ambiguity(alive: &[RobotId]) -> Option<String> {
    (alive.len() > 1).then(|| {
        format!(
            "several robots are alive ({}) and none was named: say which one with --robot N or RIL_ROBOT",
            list(alive)
        )
    })
}

fn list(robots: &[RobotId]) -> String {
    let numbers: Vec<String> = robots.iter().map(RobotId::to_string).collect();
    numbers.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_several_robots_are_ambiguous() {
        let robots = |ids: &[u32]| -> Vec<RobotId> {
            ids.iter().map(|id| RobotId::new(*id).unwrap()).collect()
        };
        for unambiguous in [&[][..], &[1], &[7]] {
            assert_eq!(ambiguity(&robots(unambiguous)), None, "{unambiguous:?}");
        }
        let text = ambiguity(&robots(&[2, 7])).unwrap();
        assert!(
            text.contains("(2, 7)") && text.contains("--robot"),
            "{text}"
        );
    }
}
