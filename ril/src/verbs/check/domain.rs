//! Judges shared memory for the doctor: the root, the processes of each robot, what dead ones left, and other users'
//! domains.

use std::collections::BTreeSet;

use ipc_types::RobotId;
use ipc_types::inspect::{Entry, Inspection, Life, Member, RobotFacts};
use operator::render::words::count;
use operator::robot::domain::DomainFacts;
use operator::session::{as_user, process_of};
use runtime::finding::Finding;

/// What to do about what is certainly dead.
const REPAIR: &str =
    "nothing has to be done: the next start removes it; `ril doctor --repair` removes it now";

/// Most processes that a line names, and most users that have a domain: more would hide what matters.
const MAX_NAMED: usize = 8;

/// What the domain's state means.
pub(super) fn diagnose(domain: &DomainFacts) -> Vec<Finding> {
    match &domain.inspection {
        Ok(inspection) => inspected(inspection, domain),
        Err(trouble) => vec![Finding::error(
            "domain-unclear",
            format!(
                "looking at the domain in {} {trouble}",
                domain.root.display()
            ),
            "look again; if it stays so, land first, then restart the processes of the domain",
        )],
    }
}

fn inspected(inspection: &Inspection, domain: &DomainFacts) -> Vec<Finding> {
    let mut findings = vec![root(inspection.root.as_ref(), domain)];
    for robot in &inspection.robots {
        match robot.is_live {
            true => findings.extend(alive(robot, domain)),
            false => findings.push(residue(robot)),
        }
    }
    if inspection.leftovers > 0 {
        let things = count(inspection.leftovers, "thing");
        let text = format!("{things} half removed, perhaps by processes that were killed");
        let next_step = format!("look again, a process may be removing it; {REPAIR}");
        findings.push(Finding::warning("leftovers", text, next_step));
    }
    // Beside robots and leftovers they cannot be distinguished from what belongs to the domain.
    let entries = match inspection.robots.is_empty() && inspection.leftovers == 0 {
        true => inspection.entries.saturating_sub(1),
        false => 0,
    };
    if entries > 0 {
        let foreign = count(entries, "foreign file");
        let place = domain.root.display();
        let were = if entries == 1 { "was" } else { "were" };
        let text = format!("{foreign} in {place} {were} left alone");
        findings.push(Finding::note("strangers", text));
    }
    if !inspection.robots.iter().any(|robot| robot.is_live) {
        let others = domain.others.iter();
        // Of the domain itself more was said above.
        let others = others.filter(|one| one.path != domain.root);
        findings.extend(others.take(MAX_NAMED).map(other));
    }
    findings
}

fn root(root: Option<&Entry>, domain: &DomainFacts) -> Finding {
    let path = domain.root.display();
    let Some(root) = root else {
        let text = format!("the domain is empty: no process is there, and {path} does not exist");
        return Finding::note("domain-empty", text);
    };
    let mode = root.mode;
    let next_step = format!("look who put what into it, then `chmod 700 {path}`");
    if !root.is_folder {
        Finding::error(
            "root-not-a-folder",
            format!("{path} is not a folder: no process starts"),
            "remove it, or choose another domain with RIL_IPC_ROOT",
        )
    } else if !root.is_ours() {
        let uid = root.uid;
        Finding::error(
            "root-of-another-user",
            format!(
                "{path} belongs to user {uid}, whose robots may live there: no process of this user starts"
            ),
            format!(
                "{}; else choose another domain with RIL_IPC_ROOT",
                as_user(uid)
            ),
        )
    } else if root.others_may_write() {
        let text = format!("others may write to {path} (mode {mode:03o}): no process starts");
        Finding::error("root-open", text, next_step)
    } else if mode & 0o077 != 0 {
        let text = format!("others may look into {path} (mode {mode:03o})");
        Finding::warning("root-readable", text, next_step)
    } else if mode & 0o700 != 0o700 {
        let text = format!("its owner may not use {path} (mode {mode:03o}): no process starts");
        Finding::error("root-closed", text, format!("`chmod 700 {path}`"))
    } else {
        let text = format!("{path} belongs to this user alone (mode {mode:03o})");
        Finding::note("root-right", text)
    }
}

/// A robot that processes take part in.
fn alive(robot: &RobotFacts, domain: &DomainFacts) -> Vec<Finding> {
    let id = robot.robot;
    let live = members(robot, Life::Live);
    let text = match live.as_slice() {
        // A process that waits for a provider is a member of no service: its name stands nowhere.
        [] => format!("processes of robot {id} live; they wait for one that provides something"),
        live => format!("alive in robot {id}: {}", processes(live)),
    };
    let mut findings = vec![Finding::note("processes", text)];
    findings.extend(stopped(&live, &domain.stopped));
    let unclear = members(robot, Life::Unclear);
    if !unclear.is_empty() {
        let text = format!(
            "whether these processes of robot {id} live cannot be known: {}",
            processes(&unclear)
        );
        let next_step = format!(
            "look again, they may be starting or ending; if it stays so, restart {}: it begins with new memory",
            commands(&unclear, id)
        );
        findings.push(Finding::warning("nodes-unclear", text, next_step));
    }
    findings.extend(dead(robot));
    if robot.former > 0 {
        let former = count(robot.former, "generation");
        let text = format!(
            "robot {id} has {former} of leftover shared memory: it is cleaned up automatically"
        );
        findings.push(Finding::note("former-generations", text));
    }
    findings
}

fn members(robot: &RobotFacts, life: Life) -> Vec<&Member> {
    let members = robot.members.iter();
    members.filter(|member| member.life == life).collect()
}

fn stopped(live: &[&Member], stopped: &[u32]) -> Vec<Finding> {
    let found: BTreeSet<(u32, &str)> = live
        .iter()
        .filter(|member| stopped.contains(&member.pid))
        .map(|member| (member.pid, member.process.as_str()))
        .collect();
    found
        .into_iter()
        .map(|(pid, name)| {
            let text = format!("{name} (process {pid}) is stopped: it lives, but does nothing");
            let next_step = format!("`kill -CONT {pid}` lets it go on; `kill -KILL {pid}` ends it");
            Finding::error("process-stopped", text, next_step)
        })
        .collect()
}

/// Members of a live robot that are dead.
fn dead(robot: &RobotFacts) -> Vec<Finding> {
    let id = robot.robot;
    let (passing, left): (Vec<&Member>, Vec<&Member>) = members(robot, Life::Dead)
        .into_iter()
        .partition(|member| member.is_tended);
    let mut findings = Vec::new();
    if !passing.is_empty() {
        let text = format!(
            "left by dead processes of robot {id}: {}; the provider removes it within two seconds",
            processes(&passing)
        );
        findings.push(Finding::note("dead-nodes", text));
    }
    if !left.is_empty() {
        let text = format!("left by dead processes of robot {id}: {}", processes(&left));
        // A repair leaves a generation alone in which a live process is, too.
        let next_step = format!("start {} again: it removes that, too", commands(&left, id));
        findings.push(Finding::warning("dead-nodes", text, next_step));
    }
    findings
}

/// What is there of a robot that no process takes part in.
fn residue(robot: &RobotFacts) -> Finding {
    let generations = count(robot.generations, "generation");
    let mut text = format!(
        "no process of robot {} lives; left of its shared memory: {generations}",
        robot.robot
    );
    let members: Vec<&Member> = robot.members.iter().collect();
    if !members.is_empty() {
        text += &format!(" with {}", processes(&members));
    }
    Finding::warning("residue", text, REPAIR)
}

/// The finding about another user's domain.
fn other(root: &Entry) -> Finding {
    let (uid, path) = (root.uid, root.path.display());
    let text = format!("no robot is alive for this user; user {uid} has a domain at {path}");
    Finding::note("domain-of-another-user", text).with_next_step(as_user(uid))
}

/// `bridge (process 7), ril (process 9)`; a process that is a member of several services once.
fn processes(members: &[&Member]) -> String {
    let named: BTreeSet<(&str, u32)> = members
        .iter()
        .map(|member| (member.process.as_str(), member.pid))
        .collect();
    let mut words: Vec<String> = named
        .iter()
        .take(MAX_NAMED)
        .map(|(process, pid)| {
            let name = match *process {
                "" => "nameless",
                name => name,
            };
            format!("{name} (process {pid})")
        })
        .collect();
    if named.len() > MAX_NAMED {
        words.push(format!("{} more", named.len() - MAX_NAMED));
    }
    words.join(", ")
}

/// What provides the services of these members, as something that can be started.
fn commands(members: &[&Member], robot: RobotId) -> String {
    let concerned: BTreeSet<&str> = members
        .iter()
        .map(|member| member.service.as_str())
        .collect();
    let commands: BTreeSet<String> = concerned
        .into_iter()
        .map(|key| match process_of(key) {
            Some(process) => format!("`ril run {process} --robot {robot}`"),
            None => format!("the module that provides {key}"),
        })
        .collect();
    commands.into_iter().collect::<Vec<_>>().join(" and ")
}

#[cfg(test)]
mod tests;
