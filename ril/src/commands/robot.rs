//! Which robot a command is for: a command that moves a helicopter does not guess it when several are alive.
//!
//! A robot is alive when a process serves its movements, which is its bridge. The default stays robot 1 also when the only
//! robot that is alive is another one: a robot that was not named is never commanded in place of the default.

use std::path::Path;

use ipc_types::{Domain, RobotId};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::alive::commandable;
use crate::cli::RobotChoice;

/// Most users that are named who have a domain.
const MAX_NAMED: usize = 4;

/// Refuses a default robot when several are alive.
///
/// # Errors
///
/// Code 2 with the robots that are alive; code 1 or 78 when the domain cannot be read.
pub(crate) fn refuse_to_guess(choice: RobotChoice) -> Result<(), Failure> {
    if choice == RobotChoice::Explicit {
        return Ok(());
    }
    match ambiguity(&alive()?) {
        Some(text) => {
            Err(Failure::usage(text).with_next_step("say which one with --robot N or RIL_ROBOT"))
        }
        None => Ok(()),
    }
}

/// Which other robots could be meant when the one that was asked for does not answer; empty when there is none.
pub(crate) fn others_alive(robot: RobotId) -> String {
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

/// Which domain was looked at, when no robot is alive there, and which others there are; empty when a robot is alive there.
pub(crate) fn other_domains() -> String {
    let Ok(domain) = Domain::from_environment() else {
        return String::new();
    };
    let has_robots = |domain: &Domain| !commandable(domain).unwrap_or_default().is_empty();
    if has_robots(&domain) {
        return String::new();
    }
    let own = Some(Domain::of_user()).filter(|own| *own != domain && has_robots(own));
    let others = Domain::others();
    let others = others.iter().filter(|one| one.path != domain.root());
    let others: Vec<(u32, &Path)> = others.map(|one| (one.uid, one.path.as_path())).collect();
    elsewhere(domain.root(), own.as_ref().map(Domain::root), &others)
}

/// Where robots may be that are not in the domain at `root`: in the user's `own`, and in those of other users.
fn elsewhere(root: &Path, own: Option<&Path>, others: &[(u32, &Path)]) -> String {
    let mut text = format!("; no robot is alive in {}", root.display());
    if let Some(own) = own {
        text += &format!(
            "; robots are alive in {}: unset RIL_IPC_ROOT if they are meant",
            own.display()
        );
    }
    for (uid, path) in others.iter().take(MAX_NAMED) {
        text += &format!(
            "; user {uid} has a domain at {}: {}",
            path.display(),
            as_user(*uid)
        );
    }
    text
}

/// The way to the robots of another user. RIL_IPC_ROOT does not lead there: no process enters the folder of another user.
pub(crate) fn as_user(uid: u32) -> String {
    format!("if its robots are meant, run as that user: `sudo -u '#{uid}' ril ...`")
}

fn alive() -> Result<Vec<RobotId>, Failure> {
    let domain = Domain::from_environment().or_fail(ExitCode::Configuration)?;
    commandable(&domain).or_fail(ExitCode::Internal)
}

/// Why a default robot is refused; `None` if it is unambiguous.
fn ambiguity(alive: &[RobotId]) -> Option<String> {
    (alive.len() > 1).then(|| {
        format!(
            "several robots are alive ({}) and none was named",
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
    fn the_domains_where_robots_may_be_are_named_with_the_way_there() {
        let root = Path::new("/dev/shm/hero0");
        let text = elsewhere(root, None, &[]);
        assert_eq!(text, "; no robot is alive in /dev/shm/hero0");
        let own = Path::new("/dev/shm/hero1000");
        let text = elsewhere(Path::new("/dev/shm/test"), Some(own), &[]);
        assert!(
            text.ends_with(
                "; robots are alive in /dev/shm/hero1000: unset RIL_IPC_ROOT if they are meant"
            ),
            "{text}"
        );
        let others: Vec<(u32, &Path)> = (0..20).map(|_| (1000, own)).collect();
        let text = elsewhere(root, None, &others);
        let way = "user 1000 has a domain at /dev/shm/hero1000: if its robots are meant, run as that user: `sudo -u '#1000' ril ...`";
        assert_eq!(text.matches(way).count(), MAX_NAMED);
    }

    #[test]
    fn only_several_robots_are_ambiguous() {
        let robots = |ids: &[u32]| -> Vec<RobotId> {
            ids.iter().map(|id| RobotId::new(*id).unwrap()).collect()
        };
        for unambiguous in [&[][..], &[1], &[7]] {
            assert_eq!(ambiguity(&robots(unambiguous)), None, "{unambiguous:?}");
        }
        let text = ambiguity(&robots(&[2, 7])).unwrap();
        assert!(text.contains("(2, 7)"), "{text}");
    }
}
