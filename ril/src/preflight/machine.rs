//! The machine: what `ril doctor` finds, the clock, and room for logs.

use status::log::clock::Utc;

use super::check::{Check, Verdict};
use super::facts::{Facts, LogPlace, Logs};
use super::limits::Limits;
use crate::commands::doctor::findings::{Finding, Severity, Subject, diagnose};

const MIB: u64 = 1 << 20;

/// The checks of the machine.
pub(super) fn judge(facts: &Facts, limits: &Limits) -> Vec<Check> {
    let findings = diagnose(&facts.machine);
    let mut checks = vec![clock(facts)];
    // Of a robot on another machine, status writes its logs there.
    if !facts.live.is_relayed {
        checks.push(log_room(facts, limits));
    }
    for (id, subject) in [
        ("shared-memory", Subject::Memory),
        ("domain", Subject::Domain),
        ("services", Subject::Services),
        ("configuration", Subject::Configuration),
        ("serial-port", Subject::Serial),
        ("relay-link", Subject::Relay),
    ] {
        checks.extend(of_findings(id, subject, &findings));
    }
    checks
}

/// The doctor's findings about one subject as one check; nothing when there is none.
fn of_findings(id: &'static str, subject: Subject, findings: &[Finding]) -> Option<Check> {
    let about: Vec<&Finding> = findings
        .iter()
        .filter(|one| one.subject == subject)
        .collect();
    let worst = about.iter().map(|one| one.severity).max()?;
    let mut worst_ones = about.iter().filter(|one| one.severity == worst);
    let first = worst_ones.next()?;
    let more = worst_ones.count();
    let verdict = match worst {
        Severity::Note => {
            // Of several notes none matters more than another: the number says that all was looked at.
            let value = match about.len() {
                1 => first.text.clone(),
                number => format!("{number} things looked at, no trouble"),
            };
            return Some(Check::pass(id, value));
        }
        Severity::Warning => Verdict::Warn,
        Severity::Error => Verdict::Fail,
    };
    let value = match more {
        0 => first.text.clone(),
        more => format!("{}; and {more} more: `ril doctor`", first.text),
    };
    let next_step = first.next_step.clone();
    Some(Check {
        verdict: Some(verdict),
        next_step: next_step.or_else(|| Some("`ril doctor` says more".to_owned())),
        ..Check::pass(id, value)
    })
}

fn clock(facts: &Facts) -> Check {
    const ID: &str = "clock";
    let clock = facts.clock;
    let shown = |unix_s| {
        let Utc {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = Utc::from_unix(unix_s);
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
    };
    let now = shown(clock.unix_s);
    let check = if clock.unix_s < clock.not_before_unix_s {
        Check::warn(
            ID,
            format!("{now} is before this program was installed"),
            "set the clock (`timedatectl`): logs get wrong names and times",
        )
    } else if clock.is_synchronized {
        Check::pass(ID, format!("{now}, synchronized"))
    } else {
        Check::pass(
            ID,
            format!("{now}; whether it is synchronized is not known"),
        )
    };
    check.limit(format!("after {}", shown(clock.not_before_unix_s)))
}

fn log_room(facts: &Facts, limits: &Limits) -> Check {
    const ID: &str = "log-room";
    let logs = match &facts.logs {
        Logs::Unknown => return Check::impossible(ID, "the configuration of status is wrong"),
        Logs::NoFile => {
            return Check::warn(
                ID,
                "no status.toml is here, and without one status writes no log",
                "name the file of status with --status, or add a `[[log]]` to status.toml",
            )
            .limit("at least 1 log");
        }
        Logs::Configured(logs) if logs.is_empty() => {
            return Check::warn(
                ID,
                "status.toml has no log: nothing of the flight is written",
                "add a `[[log]]` with groups to status.toml and restart status",
            )
            .limit("at least 1 log");
        }
        Logs::Configured(logs) => logs,
    };
    // Logs in one folder share its room: the worst of them stands for all.
    let checks = logs.iter().map(|log| of_log(ID, log, logs, limits));
    let worst = checks.max_by_key(|check| check.verdict);
    worst.unwrap_or_else(|| Check::impossible(ID, "no log"))
}

fn of_log(id: &'static str, log: &LogPlace, all: &[LogPlace], limits: &Limits) -> Check {
    let place = log.directory.display();
    let free = match &log.free_bytes {
        Ok(free) => *free,
        Err(reason) => {
            let next_step = "look at the disk that `directory` of status.toml names";
            return Check::fail(
                id,
                format!("{place} cannot be looked at: {reason}"),
                next_step,
            );
        }
    };
    if !log.is_writable {
        return Check::fail(
            id,
            format!("{place} may not be written by this user"),
            "give status's user permission, or change `directory` in status.toml",
        );
    }
    let sharing = all.iter().filter(|one| one.directory == log.directory);
    let room = limits.log_room_mib * MIB * sharing.count() as u64;
    let (least, wanted) = (log.min_free_bytes, log.min_free_bytes.saturating_add(room));
    let value = format!("{} MiB free in {place}", free / MIB);
    let next_step = "make room, or lower `min_free_mib` in status.toml";
    let check = if free < least {
        Check::fail(id, format!("{value}: the log pauses"), next_step)
    } else if free < wanted {
        Check::warn(id, value, next_step)
    } else {
        Check::pass(id, value)
    };
    check.limit(format!(
        "at least {} MiB (fail below {} MiB)",
        wanted / MIB,
        least / MIB
    ))
}
