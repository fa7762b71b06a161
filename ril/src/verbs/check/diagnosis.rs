//! From facts to findings: the doctor's judgement of the machine. Pure: no look at anything, the same facts give the
//! same findings.
//!
//! Notes say what was found to be in order, or what a live process is about to put in order. Warnings keep no process
//! from its work now: they are cured by the next start, or mislead the operator. Errors keep a process from starting or
//! from its work.
//!
//! Here are memory, clock, configuration and repair; `domain`, `services`, `serial`, `realtime` and `gateways` have the
//! others.

use ipc_types::{LowLimit, Repair};
use operator::render::words::count_irregular;
use operator::robot::domain::{DomainFacts, Look, Trouble};
use runtime::exit::ExitCode;
use runtime::finding::{Finding, Severity};
use serde::Serialize;
use status::log::clock::Utc;

use super::facts::{ClockFacts, FileContent, FileFacts, FreeMemory, MachineFacts};
use super::{domain, gateways, realtime, serial, services};

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
    /// The wall clock.
    Clock,
    /// The provider of each service.
    Services,
    /// The relay's link to a robot on another machine.
    Relay,
    /// Configuration files and environment.
    Configuration,
    /// The serial port.
    Serial,
    /// What bridge and status ask for in `[realtime]`.
    Realtime,
    /// What the view is set up with.
    View,
    /// What the gateway to MAVLink is set up with.
    Mavlink,
}

impl Subject {
    /// The name for people; serde's is the same.
    pub fn name(self) -> &'static str {
        match self {
            Subject::Repair => "repair",
            Subject::Domain => "domain",
            Subject::Memory => "memory",
            Subject::Clock => "clock",
            Subject::Services => "services",
            Subject::Relay => "relay",
            Subject::Configuration => "configuration",
            Subject::Serial => "serial",
            Subject::Realtime => "realtime",
            Subject::View => "view",
            Subject::Mavlink => "mavlink",
        }
    }
}

/// What the facts mean, subject by subject.
pub fn diagnose(facts: &MachineFacts) -> Vec<(Subject, Finding)> {
    let mut findings = Vec::new();
    let mut add = |subject, found: Vec<Finding>| {
        findings.extend(found.into_iter().map(|finding| (subject, finding)));
    };
    if let Some(look) = &facts.repair {
        add(Subject::Repair, repair(look));
    }
    match &facts.domain {
        Ok(domain) => {
            add(Subject::Domain, domain::diagnose(domain));
            let unmakeable = |why: &String| root_unmakeable(domain, why);
            add(
                Subject::Domain,
                facts.root_fault.iter().map(unmakeable).collect(),
            );
            add(Subject::Services, services::diagnose(domain, facts.robot));
        }
        Err(reason) => add(Subject::Configuration, vec![domain_unnamed(reason)]),
    }
    if let Some(relay) = &facts.relay {
        add(Subject::Relay, gateways::relay(relay, facts.robot));
    }
    add(Subject::Memory, memory(&facts.free_memory));
    add(Subject::Memory, facts.limits.iter().map(limit).collect());
    add(Subject::Clock, vec![clock(&facts.clock)]);
    add(
        Subject::Configuration,
        facts.files.iter().map(configuration).collect(),
    );
    if let Some(port) = &facts.port {
        let domain = facts.domain.as_ref().ok();
        let bridge = domain.and_then(|domain| services::bridge_pid(domain, facts.robot));
        let finding = serial::diagnose(port, bridge);
        let is_elsewhere =
            domain.is_some_and(|domain| services::is_bridge_elsewhere(domain, facts.robot));
        let finding = match is_elsewhere {
            true => serial::of_a_bridge_elsewhere(finding),
            false => finding,
        };
        add(Subject::Serial, vec![finding]);
    }
    add(Subject::Realtime, realtime::diagnose(&facts.realtime));
    if let Some(look) = &facts.view {
        add(Subject::View, gateways::view(look));
    }
    if let Some(look) = &facts.mavlink {
        add(Subject::Mavlink, gateways::mavlink(look));
    }
    findings
}

/// What configuration files mean.
pub fn diagnose_files(files: &[FileFacts]) -> Vec<(Subject, Finding)> {
    let findings = files.iter().map(configuration);
    findings
        .map(|finding| (Subject::Configuration, finding))
        .collect()
}

/// The exit code of the findings, for scripts: that of the gravest kind of trouble among them.
pub fn exit_code(findings: &[(Subject, Finding)]) -> ExitCode {
    let trouble = |is_about: fn(Subject) -> bool| {
        findings
            .iter()
            .any(|(subject, finding)| finding.severity > Severity::Note && is_about(*subject))
    };
    if trouble(|subject| subject == Subject::Configuration) {
        ExitCode::Configuration
    } else if trouble(|subject| subject != Subject::Serial) {
        ExitCode::NotInOrder
    } else if trouble(|_| true) {
        ExitCode::LinkDown
    } else {
        ExitCode::Ok
    }
}

/// What a configuration file means.
fn configuration(file: &FileFacts) -> Finding {
    let path = file.path.display();
    let whose = match file.command {
        Some(command) => format!("of `ril run {command}`"),
        None => "of the operator's commands".to_owned(),
    };
    match &file.content {
        Ok(FileContent::Right) if file.is_in_force == Some(false) => Finding::warning(
            "configuration-not-in-force",
            format!("{path} {whose} is right, but the running process has another configuration"),
            "was it changed since the start? `ril fence reload` takes its fence, a restart takes all of it",
        ),
        Ok(FileContent::Right) if file.is_in_force == Some(true) => Finding::note(
            "configuration-right",
            format!("{path} {whose} is right, and the running process has it in force"),
        ),
        Ok(FileContent::Absent) if file.is_in_force == Some(false) => Finding::note(
            "configuration-absent",
            format!("no {path} here: the configuration {whose} is what the running process says"),
        ),
        Ok(FileContent::Right) => {
            Finding::note("configuration-right", format!("{path} {whose} is right"))
        }
        Ok(FileContent::Absent) => Finding::note(
            "configuration-absent",
            format!("no {path} here: the configuration {whose} is the built-in one"),
        ),
        Ok(FileContent::Wrong(reason)) => Finding::error(
            "configuration-wrong",
            format!("the configuration {whose} is refused: {reason}"),
            "correct it: its process does not start with this file",
        ),
        Err(trouble) => Finding::error(
            "configuration-unreadable",
            format!("reading {path} {whose} {trouble}"),
            "look what stands in its place: a pipe, or a file system that does not answer?",
        ),
    }
}

/// The environment names no usable domain.
fn domain_unnamed(reason: &str) -> Finding {
    Finding::error(
        "domain-unnamed",
        format!("no process finds its shared memory: {reason}"),
        "fix RIL_IPC_ROOT, or unset it",
    )
}

const MIB: u64 = 1 << 20;

/// With less no process starts: below this `ipc-types` lays its failures to the room.
const FULL_BYTES: u64 = 4 * MIB;
const FULL_INODES: u64 = 32;

/// What a robot may take. Its bridge takes 8.6 MiB and 232 inodes, its status 2.8 MiB and 101, each consumer 14 inodes;
/// and twice that while a provider that was restarted has begun a generation and consumers are in the former one.
const ROBOT_BYTES: u64 = 24 * MIB;
const ROBOT_INODES: u64 = 768;

/// How much is free of bytes or of inodes.
struct FreeRoom {
    /// Names of the findings: as good as full, and nearly full.
    ids: [&'static str; 2],
    free: u64,
    full: u64,
    for_a_robot: u64,
    /// An amount in words.
    words: fn(u64) -> String,
    next_step: &'static str,
}

/// The domain's folder does not exist and cannot be made.
fn root_unmakeable(domain: &DomainFacts, why: &str) -> Finding {
    let root = domain.root.display();
    Finding::error(
        "root-unmakeable",
        format!("{root} cannot be made, so no process starts: {why}"),
        "choose another domain with RIL_IPC_ROOT, or unset it",
    )
}

/// A limit of this shell, or of whatever has started this process; a unit has its own.
fn limit(low: &LowLimit) -> Finding {
    let LowLimit {
        name,
        value,
        needed,
    } = low;
    Finding::warning(
        "limit-low",
        format!("the limit `{name}` is {value} here, and a robot's processes may need {needed}"),
        format!(
            "raise it before you start them: `ulimit` of the shell, or `Limit{}=` of the unit",
            name.to_uppercase()
        ),
    )
}

/// Whether there is room for the processes of another robot.
fn memory(free: &Look<FreeMemory>) -> Vec<Finding> {
    let free = match free {
        Ok(free) => free,
        Err(trouble) => {
            return vec![Finding::error(
                "memory-unclear",
                format!("looking at /dev/shm {trouble}"),
                "mount it: `mount -t tmpfs tmpfs /dev/shm`; nothing works without it",
            )];
        }
    };
    let bytes = FreeRoom {
        ids: ["memory-short", "memory-low"],
        free: free.bytes,
        full: FULL_BYTES,
        for_a_robot: ROBOT_BYTES,
        words: |bytes| format!("{} MiB", bytes / MIB),
        next_step: "remove what fills it (`df -h /dev/shm`), or enlarge it: `mount -o remount,size=256m /dev/shm`",
    };
    let inodes = free.inodes.map(|inodes| FreeRoom {
        ids: ["inodes-short", "inodes-low"],
        free: inodes,
        full: FULL_INODES,
        for_a_robot: ROBOT_INODES,
        words: |inodes| format!("{inodes} inodes"),
        next_step: "remove files that fill it (`df -i /dev/shm`), or allow more: `mount -o remount,nr_inodes=64k /dev/shm`",
    });
    let rooms: Vec<FreeRoom> = [Some(bytes), inodes].into_iter().flatten().collect();
    let troubles: Vec<Finding> = rooms.iter().filter_map(shortage).collect();
    if !troubles.is_empty() {
        return troubles;
    }
    let words: Vec<String> = rooms.iter().map(|room| (room.words)(room.free)).collect();
    let text = format!("/dev/shm has {} free", words.join(" and "));
    vec![Finding::note("memory-right", text)]
}

fn shortage(room: &FreeRoom) -> Option<Finding> {
    let [short, low] = room.ids;
    let [free, wanted] = [room.free, room.for_a_robot].map(room.words);
    if room.free < room.full {
        let text = format!("/dev/shm is as good as full, {free} are free: no process starts");
        Some(Finding::error(short, text, room.next_step))
    } else if room.free < room.for_a_robot {
        let text = format!("/dev/shm is nearly full, {free} are free: a robot may take {wanted}");
        Some(Finding::warning(low, text, room.next_step))
    } else {
        None
    }
}

/// What became of the repair.
fn repair(repair: &Look<Repair>) -> Vec<Finding> {
    match repair {
        Ok(repair) => repaired(repair),
        Err(trouble @ Trouble::TookTooLong(_)) => vec![Finding::error(
            "repair-failed",
            format!("the repair {trouble}; what it did so far stays done"),
            "stop every process of the domain and repair again",
        )],
        Err(trouble @ Trouble::Failed(_)) => vec![Finding::error(
            "repair-failed",
            format!("the repair {trouble}"),
            "do what is said there, then repair again",
        )],
    }
}

fn repaired(repair: &Repair) -> Vec<Finding> {
    let Repair {
        robots,
        generations,
        leftovers,
    } = *repair;
    let removed = [
        (
            robots,
            "robot in which no process was",
            "robots in which no process was",
        ),
        (
            generations,
            "generation of leftover shared memory",
            "generations of leftover shared memory",
        ),
        (leftovers, "thing half removed", "things half removed"),
    ];
    let mut findings: Vec<Finding> = removed
        .into_iter()
        .filter(|(number, ..)| *number > 0)
        .map(|(number, singular, plural)| {
            let text = format!("removed: {}", count_irregular(number, singular, plural));
            Finding::note("repaired", text)
        })
        .collect();
    if findings.is_empty() {
        findings.push(Finding::note(
            "nothing-to-repair",
            "there was nothing to repair",
        ));
    }
    findings
}

const CLOCK: &str = "clock";

/// What the wall clock means.
pub(super) fn clock(facts: &ClockFacts) -> Finding {
    let clock = facts.clock;
    let now = Utc::from_unix(clock.unix_s);
    let check = if !clock.was_set() {
        Finding::warning(
            CLOCK,
            format!("the clock was never set: {now} is before this program was installed"),
            "set it: connect a network that has the time, or `sudo date --set 'YYYY-MM-DD hh:mm'`; until then files have wrong names and times, \
             and no certificate of other machines is taken",
        )
    } else if facts.is_synchronized {
        Finding::note(CLOCK, format!("{now}, synchronized"))
    } else {
        Finding::note(
            CLOCK,
            format!("{now}; whether it is synchronized is not known"),
        )
    };
    check.with_limit(format!("after {}", Utc::from_unix(clock.not_before_unix_s)))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use runtime::finding::Severity::{Error, Note, Warning};

    #[test]
    fn the_gravest_kind_of_trouble_gives_the_exit_code() {
        use Subject::{Configuration, Domain, Memory, Serial};
        let cases: [(&[(Severity, Subject)], ExitCode); 7] = [
            (&[], ExitCode::Ok),
            (&[(Note, Serial), (Note, Configuration)], ExitCode::Ok),
            (&[(Error, Serial), (Note, Domain)], ExitCode::LinkDown),
            (&[(Warning, Domain)], ExitCode::NotInOrder),
            (&[(Error, Serial), (Warning, Memory)], ExitCode::NotInOrder),
            (
                &[(Error, Domain), (Error, Configuration)],
                ExitCode::Configuration,
            ),
            (
                &[(Error, Configuration), (Error, Serial)],
                ExitCode::Configuration,
            ),
        ];
        for (kinds, expected) in cases {
            let findings: Vec<_> = kinds
                .iter()
                .map(|(severity, subject)| (*subject, Finding::new(*severity, "test", "text")))
                .collect();
            assert_eq!(exit_code(&findings), expected, "{kinds:?}");
        }
    }

    #[test]
    fn each_state_of_a_file() {
        for (content, severity, expected) in [
            (
                Ok(FileContent::Right),
                Note,
                "bridge.toml of `ril run bridge` is right",
            ),
            (
                Ok(FileContent::Absent),
                Note,
                "no bridge.toml here: the configuration of `ril run bridge` is the built-in one",
            ),
            (
                Ok(FileContent::Wrong(
                    "bridge.toml:2: unknown field".to_owned(),
                )),
                Error,
                "the configuration of `ril run bridge` is refused: bridge.toml:2: unknown field",
            ),
            (
                Err(Trouble::TookTooLong(Duration::from_secs(5))),
                Error,
                "reading bridge.toml of `ril run bridge` was given up after 5s",
            ),
        ] {
            let finding = configuration(&FileFacts {
                command: Some("bridge"),
                path: "bridge.toml".into(),
                content,
                is_in_force: None,
            });
            assert_eq!(
                (finding.severity, finding.text.as_str()),
                (severity, expected)
            );
            assert_eq!(finding.next_step.is_some(), severity > Note);
        }
    }

    #[test]
    fn a_file_that_differs_from_what_the_process_runs_with_is_told() {
        use FileContent::{Absent, Right};
        for (content, is_in_force, severity, expected) in [
            (Right, true, Note, "and the running process has it in force"),
            (
                Right,
                false,
                Warning,
                "but the running process has another configuration",
            ),
            (Absent, true, Note, "is the built-in one"),
            (Absent, false, Note, "is what the running process says"),
        ] {
            let finding = configuration(&FileFacts {
                command: Some("bridge"),
                path: "bridge.toml".into(),
                content: Ok(content),
                is_in_force: Some(is_in_force),
            });
            assert_eq!(finding.severity, severity, "{finding:?}");
            assert!(finding.text.ends_with(expected), "{finding:?}");
        }
    }

    fn said(free: &Look<FreeMemory>) -> Vec<(Severity, &'static str)> {
        let findings = memory(free);
        for finding in &findings {
            assert_eq!(finding.next_step.is_some(), finding.severity > Note);
        }
        findings.iter().map(|one| (one.severity, one.id)).collect()
    }

    #[test]
    fn bytes_and_inodes_are_enough_or_low_or_as_good_as_gone() {
        let right = (Note, "memory-right");
        let many = Some(ROBOT_INODES);
        #[rustfmt::skip]
        let cases = [
            (ROBOT_BYTES, many, &[right][..]),
            (ROBOT_BYTES, None, &[right]),
            (ROBOT_BYTES - 1, many, &[(Warning, "memory-low")]),
            (FULL_BYTES, None, &[(Warning, "memory-low")]),
            (FULL_BYTES - 1, None, &[(Error, "memory-short")]),
            (ROBOT_BYTES, Some(ROBOT_INODES - 1), &[(Warning, "inodes-low")]),
            (ROBOT_BYTES, Some(FULL_INODES), &[(Warning, "inodes-low")]),
            (ROBOT_BYTES, Some(FULL_INODES - 1), &[(Error, "inodes-short")]),
            (0, Some(0), &[(Error, "memory-short"), (Error, "inodes-short")]),
        ];
        for (bytes, inodes, expected) in cases {
            let free = Ok(FreeMemory { bytes, inodes });
            assert_eq!(said(&free), expected, "{free:?}");
        }
        let unclear = Err(Trouble::Failed("no such folder".to_owned()));
        assert_eq!(said(&unclear), [(Error, "memory-unclear")]);
    }

    #[test]
    fn amounts_are_reported() {
        let free = |bytes, inodes| Ok(FreeMemory { bytes, inodes });
        let text = |free| memory(&free)[0].text.clone();
        assert_eq!(
            text(free(64 * MIB, Some(800))),
            "/dev/shm has 64 MiB and 800 inodes free"
        );
        assert_eq!(text(free(64 * MIB, None)), "/dev/shm has 64 MiB free");
        assert_eq!(
            text(free(64 * MIB, Some(77))),
            "/dev/shm is nearly full, 77 inodes are free: a robot may take 768 inodes"
        );
    }

    #[test]
    fn what_was_done_is_reported() {
        let repair = |robots, generations, leftovers| {
            Ok(Repair {
                robots,
                generations,
                leftovers,
            })
        };
        type Case = (Look<Repair>, &'static [(Severity, &'static str)]);
        #[rustfmt::skip]
        let cases: [Case; 5] = [
            (repair(0, 0, 0), &[(Note, "there was nothing to repair")]),
            (repair(1, 0, 0), &[(Note, "removed: 1 robot in which")]),
            (repair(0, 1, 3), &[(Note, "removed: 1 generation of"), (Note, "removed: 3 things")]),
            (Err(Trouble::Failed("it is not ours".to_owned())), &[(Error, "the repair failed: it is not ours")]),
            (Err(Trouble::TookTooLong(Duration::from_secs(15))), &[(Error, "given up after 15s")]),
        ];
        for (repair, expected) in cases {
            let findings = super::repair(&repair);
            assert_eq!(findings.len(), expected.len(), "{findings:?}");
            for (finding, (severity, text)) in findings.iter().zip(expected) {
                assert_eq!(finding.severity, *severity, "{finding:?}");
                assert!(finding.text.contains(text), "{finding:?}");
            }
        }
    }
}
