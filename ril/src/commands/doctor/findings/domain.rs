//! Shared memory: the root, the management segment, who is there, what the dead left, and who provides what.

use std::collections::BTreeMap;

use ipc_types::inspect::{Entry, Inspection, Life, Management, NodeFacts};
use ipc_types::session::REQUIRED_SHM_BYTES;
use ipc_types::{Provider, ServiceId};

use super::super::facts::{DomainFacts, Look};
use super::{About, Finding, Subject, count};
use crate::commands::process_of;

const DOMAIN: About = About(Subject::Domain);
const MEMORY: About = About(Subject::Memory);
const SERVICES: About = About(Subject::Services);

/// What mends everything that is provably dead.
const REPAIR: &str = "`ril doctor --repair` removes it; the next process that starts does so, too";

/// What to do about a name that another user has taken.
const CHOOSE_ANOTHER: &str =
    "let its owner remove it, or choose another domain with RIL_IPC_PREFIX and RIL_IPC_ROOT";

/// Most processes that a line names: more would hide what matters.
const MAX_NAMED: usize = 8;

/// What the domain's state means for `robot`.
pub(super) fn diagnose(domain: &DomainFacts, robot: u32) -> Vec<Finding> {
    let place = domain.root.display();
    let mut findings = Vec::new();
    match &domain.inspection {
        Ok(inspection) => findings.extend(inspected(inspection, domain)),
        Err(trouble) => findings.push(DOMAIN.error(
            "domain-unclear",
            format!("looking at the domain in {place} {trouble}"),
            format!("stop every process of the domain, then remove {place}"),
        )),
    }
    match &domain.providers {
        Ok(providers) => findings.extend(services(providers, robot)),
        Err(trouble) => findings.push(SERVICES.error(
            "services-unclear",
            format!("looking who provides the services of robot {robot} {trouble}"),
            format!("stop every process of the domain, then remove {place}/owners"),
        )),
    }
    findings
}

fn inspected(inspection: &Inspection, domain: &DomainFacts) -> Vec<Finding> {
    let mut findings = vec![root(inspection.root.as_ref(), domain)];
    findings.extend(inspection.management.iter().map(management));
    findings.extend(living(inspection, &domain.stopped));
    findings.extend(remains(inspection));
    if !inspection.strangers.is_empty() {
        let strangers = count(inspection.strangers.len(), "thing", "things");
        let text = format!(
            "{strangers} in {} that the domain does not know stay there",
            domain.root.display()
        );
        findings.push(DOMAIN.note("strangers", text));
    }
    // Of management segments more was said above.
    let is_management = |entry: &Entry| {
        let mut segments = inspection.management.iter();
        segments.any(|management| management.entry.path == entry.path)
    };
    let foreign = inspection
        .foreign
        .iter()
        .filter(|entry| !is_management(entry));
    match foreign.count() {
        0 => {}
        number => {
            let segments = count(number, "segment", "segments");
            let text = format!(
                "{segments} of other users under the prefix {}: nobody opens them",
                domain.prefix
            );
            findings.push(DOMAIN.note("foreign-segments", text));
        }
    }
    findings
}

fn root(root: Option<&Entry>, domain: &DomainFacts) -> Finding {
    let path = domain.root.display();
    let Some(root) = root else {
        let text = format!("the domain is empty: nobody is there, and {path} does not exist");
        return DOMAIN.note("domain-empty", text);
    };
    let mode = root.mode;
    let next_step = format!("look who put what into it, then `chmod 700 {path}`");
    if !root.is_folder {
        DOMAIN.error(
            "root-not-a-folder",
            format!("{path} is not a folder"),
            CHOOSE_ANOTHER,
        )
    } else if !root.is_ours() {
        let text = format!("{path} belongs to user {}", root.uid);
        DOMAIN.error("root-of-another-user", text, CHOOSE_ANOTHER)
    } else if root.others_may_write() {
        let text = format!("others may write to {path} (mode {mode:03o}): no process starts");
        DOMAIN.error("root-open", text, next_step)
    } else if root.others_may_enter() {
        let text = format!("others may look into {path} (mode {mode:03o})");
        DOMAIN.warning("root-readable", text, next_step)
    } else if mode & 0o700 != 0o700 {
        let text = format!("its owner may not use {path} (mode {mode:03o}): no process starts");
        DOMAIN.error("root-closed", text, format!("`chmod 700 {path}`"))
    } else {
        let text = format!("{path} belongs to this user alone (mode {mode:03o})");
        DOMAIN.note("root-right", text)
    }
}

fn management(segment: &Management) -> Finding {
    let path = segment.entry.path.display();
    if !segment.entry.is_ours() {
        let text = format!(
            "the management segment {path} belongs to user {}: no process starts",
            segment.entry.uid
        );
        return DOMAIN.error("management-of-another-user", text, CHOOSE_ANOTHER);
    }
    if let Some(defect) = segment.defect {
        let text = format!("the management segment {path} is spoiled: {defect}");
        return DOMAIN.warning("management-spoiled", text, REPAIR);
    }
    if segment.entry.others_may_enter() {
        let mode = segment.entry.mode;
        let text = format!("others may use the management segment {path} (mode {mode:03o})");
        let next_step =
            "`ril doctor --repair` replaces it; the next process that starts does so, too";
        return DOMAIN.warning("management-open", text, next_step);
    }
    DOMAIN.note("management-right", format!("{path} is as it should be"))
}

/// Who is there.
fn living(inspection: &Inspection, stopped: &[u32]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let live: Vec<&NodeFacts> = inspection.nodes_that_are(Life::Live).collect();
    if !live.is_empty() {
        let text = format!("alive: {}", processes(&live));
        findings.push(DOMAIN.note("processes", text));
    }
    for node in &live {
        if stopped.contains(&node.pid) {
            let (name, pid) = (&node.process, node.pid);
            let text = format!("{name} (process {pid}) is stopped: it lives, but does nothing");
            let next_step = format!("`kill -CONT {pid}` lets it go on; `kill -KILL {pid}` ends it");
            let finding = DOMAIN.error("process-stopped", text, next_step);
            if !findings.contains(&finding) {
                findings.push(finding);
            }
        }
    }
    let unclear: Vec<&NodeFacts> = inspection.nodes_that_are(Life::Unclear).collect();
    if !unclear.is_empty() {
        let text = format!("whether these live cannot be told: {}", processes(&unclear));
        let next_step = "look at them with `ps`; is the domain used from a container, too?";
        findings.push(DOMAIN.warning("nodes-unclear", text, next_step));
    }
    findings
}

/// What the dead left.
fn remains(inspection: &Inspection) -> Vec<Finding> {
    let mut findings = Vec::new();
    let dead: Vec<&NodeFacts> = inspection.nodes_that_are(Life::Dead).collect();
    if !dead.is_empty() {
        let text = format!("left by dead processes: {}", processes(&dead));
        findings.push(DOMAIN.warning("dead-nodes", text, REPAIR));
    }
    if inspection.unfinished > 0 {
        let things = count(inspection.unfinished, "thing", "things");
        let text = format!("{things} half made or half removed, of processes that were killed");
        let next_step = format!("look again in ten seconds, a process may be making it; {REPAIR}");
        findings.push(DOMAIN.warning("half-made", text, next_step));
    }
    // Of a root in which others keep something the folder itself stays.
    let kept = usize::from(!inspection.strangers.is_empty());
    let nobody = inspection.nodes.is_empty() && inspection.unfinished == 0;
    let is_ours = inspection
        .root
        .as_ref()
        .is_none_or(|root| root.is_folder && root.is_ours());
    if nobody && is_ours && inspection.entries > kept {
        let entries = count(inspection.entries - kept, "thing", "things");
        let text = format!("{entries} left of the domain, and nobody is in it");
        findings.push(DOMAIN.warning("residue", text, REPAIR));
    }
    findings
}

/// `bridge (process 7), ril (process 9)`; a process that has several nodes once.
fn processes(nodes: &[&NodeFacts]) -> String {
    let mut named: BTreeMap<(&str, u32), usize> = BTreeMap::new();
    for node in nodes {
        *named.entry((&node.process, node.pid)).or_default() += 1;
    }
    let mut words: Vec<String> = named
        .iter()
        .take(MAX_NAMED)
        .map(|((process, pid), nodes)| {
            let name = match *process {
                "" => "nameless",
                name => name,
            };
            match nodes {
                1 => format!("{name} (process {pid})"),
                _ => format!("{name} (process {pid}, {nodes} nodes)"),
            }
        })
        .collect();
    if named.len() > MAX_NAMED {
        words.push(format!("{} more", named.len() - MAX_NAMED));
    }
    words.join(", ")
}

/// What of the services is there.
fn services(providers: &[(ServiceId, Option<Provider>)], robot: u32) -> Vec<Finding> {
    let mut findings = Vec::new();
    for command in ["bridge", "status"] {
        let of_command: Vec<_> = providers
            .iter()
            .filter(|(service, _)| process_of(*service) == command)
            .collect();
        findings.push(one_process(command, &of_command, robot));
    }
    findings
}

/// What of the services that `command` provides is there. One process must provide them all.
fn one_process(command: &str, providers: &[&(ServiceId, Option<Provider>)], robot: u32) -> Finding {
    let keys = |wanted: bool| -> Vec<&str> {
        let chosen = providers
            .iter()
            .filter(|(_, provider)| provider.is_some() == wanted);
        chosen.map(|(service, _)| service.spec().key).collect()
    };
    let mut by: Vec<&Provider> = providers
        .iter()
        .filter_map(|(_, provider)| provider.as_ref())
        .collect();
    by.sort_by_key(|provider| provider.pid);
    by.dedup_by_key(|provider| provider.pid);
    let names: Vec<String> = by
        .iter()
        .map(|provider| format!("{} (process {})", provider.process, provider.pid))
        .collect();
    let absent = keys(false);
    match names.as_slice() {
        [] => {
            let text = format!("no {command} of robot {robot} is running");
            let finding = SERVICES.note("service-absent", text);
            finding.with_next_step(format!("`ril {command} --robot {robot}` starts one"))
        }
        [name] if absent.is_empty() => {
            let text = format!("{name} provides {} of robot {robot}", keys(true).join(", "));
            SERVICES.note("service-right", text)
        }
        [name] => {
            let text = format!(
                "{name} provides {} of robot {robot}, but not {}",
                keys(true).join(", "),
                absent.join(", ")
            );
            let next_step = "look again: it may just be starting; if it stays so, restart it";
            SERVICES.warning("service-incomplete", text, next_step)
        }
        names => {
            let names = names.join(", ");
            let text =
                format!("what one {command} of robot {robot} should provide is divided: {names}");
            SERVICES.warning("service-divided", text, "keep one of them running")
        }
    }
}

/// The process that provides what a bridge provides.
pub fn bridge_pid(domain: &DomainFacts) -> Option<u32> {
    let providers = domain.providers.as_ref().ok()?;
    providers
        .iter()
        .filter(|(service, _)| process_of(*service) == "bridge")
        .find_map(|(_, provider)| provider.as_ref().map(|provider| provider.pid))
}

/// Whether there is room for those who join.
pub(super) fn memory(free: &Look<u64>) -> Finding {
    let needed = mebibytes(REQUIRED_SHM_BYTES);
    match free {
        Err(trouble) => MEMORY.error(
            "memory-unclear",
            format!("looking at /dev/shm {trouble}"),
            "mount it: `mount -t tmpfs tmpfs /dev/shm`; nothing works without it",
        ),
        Ok(free) if *free < REQUIRED_SHM_BYTES => MEMORY.error(
            "memory-short",
            format!(
                "/dev/shm has {} MiB free, each process needs {needed} MiB to start",
                mebibytes(*free)
            ),
            "remove what fills it, or enlarge it: `mount -o remount,size=256m /dev/shm`",
        ),
        Ok(free) => {
            let text = format!("/dev/shm has {} MiB free", mebibytes(*free));
            MEMORY.note("memory-right", text)
        }
    }
}

fn mebibytes(bytes: u64) -> u64 {
    bytes >> 20
}

#[cfg(test)]
mod tests;
