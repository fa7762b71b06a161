//! Judges the machine for the preflight: the doctor's findings by subject, the clock, and room for logs.

use operator::config::PreflightLimits;
use runtime::finding::{Finding, Severity};

use super::diagnosis;
use super::diagnosis::{Subject, diagnose};
use super::facts::{LogPlace, Logs, PreflightFacts};

const MIB: u64 = 1 << 20;

/// The checks of the machine.
pub(super) fn judge(facts: &PreflightFacts, limits: &PreflightLimits) -> Vec<Finding> {
    let findings = diagnose(&facts.machine);
    let mut checks = vec![diagnosis::clock(&facts.machine.clock)];
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

/// The doctor's findings about one subject as one check; `None` if there is none.
fn of_findings(
    id: &'static str,
    subject: Subject,
    findings: &[(Subject, Finding)],
) -> Option<Finding> {
    let about = findings.iter().filter(|(of, _)| *of == subject);
    let about: Vec<&Finding> = about.map(|(_, finding)| finding).collect();
    let worst = about.iter().map(|one| one.severity).max()?;
    let mut worst_ones = about.iter().filter(|one| one.severity == worst);
    let first = worst_ones.next()?;
    let more = worst_ones.count();
    let text = match (worst, more) {
        (_, 0) => first.text.clone(),
        // Of several notes none matters more than another: the number says that all was looked at.
        (Severity::Note, more) => format!("{} things looked at, no trouble", more + 1),
        (_, more) => format!("{}; and {more} more: `ril doctor`", first.text),
    };
    let finding = Finding::new(worst, id, text);
    Some(match worst {
        Severity::Note => finding,
        Severity::Warning | Severity::Error => {
            let next_step = first.next_step.clone();
            finding.with_next_step(next_step.unwrap_or_else(|| "`ril doctor` says more".to_owned()))
        }
    })
}

fn log_room(facts: &PreflightFacts, limits: &PreflightLimits) -> Finding {
    const ID: &str = "log-room";
    let logs = match &facts.logs {
        Logs::Unknown => return Finding::unchecked(ID, "the configuration of status is wrong"),
        Logs::NoFile => {
            return Finding::warning(
                ID,
                "no status.toml is here, and without one status writes no log",
                "name the file of status with --status, or add a `[[log]]` to status.toml",
            )
            .with_limit("at least 1 log");
        }
        Logs::Configured(logs) if logs.is_empty() => {
            return Finding::warning(
                ID,
                "status.toml has no log: nothing of the flight is written",
                "add a `[[log]]` with groups to status.toml and restart status",
            )
            .with_limit("at least 1 log");
        }
        Logs::Configured(logs) => logs,
    };
    // Logs in one folder share its room: the worst of them stands for all.
    let checks = logs.iter().map(|log| of_log(ID, log, logs, limits));
    let worst = checks.max_by_key(|check| check.severity);
    worst.unwrap_or_else(|| Finding::unchecked(ID, "no log"))
}

fn of_log(id: &'static str, log: &LogPlace, all: &[LogPlace], limits: &PreflightLimits) -> Finding {
    let place = log.directory.display();
    let free = match &log.free_bytes {
        Ok(free) => *free,
        Err(reason) => {
            let next_step = "look at the disk that `directory` of status.toml names";
            return Finding::error(
                id,
                format!("{place} cannot be looked at: {reason}"),
                next_step,
            );
        }
    };
    if !log.is_writable {
        return Finding::error(
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
        Finding::error(id, format!("{value}: the log pauses"), next_step)
    } else if free < wanted {
        Finding::warning(id, value, next_step)
    } else {
        Finding::note(id, value)
    };
    check.with_limit(format!(
        "at least {} MiB (fail below {} MiB)",
        wanted / MIB,
        least / MIB
    ))
}
