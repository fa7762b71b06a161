//! From facts to findings: the doctor's judgement. Pure: no look at anything, the same facts give the same findings.
//!
//! Notes say what was found to be in order, or what a live process is about to put in order. Warnings keep no process from its
//! work now: they are cured by the next start, or mislead the operator. Errors keep a process from starting or from its work.

mod configuration;
mod domain;
mod finding;
mod memory;
mod relay;
mod repair;
mod serial;
mod services;

use runtime::exit::ExitCode;

use super::facts::{Facts, FileFacts};

pub use finding::{Finding, Severity, Subject};
pub use services::bridge_pid;

/// What the facts mean, subject by subject.
pub fn diagnose(facts: &Facts) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some(repair) = &facts.repair {
        findings.extend(repair::diagnose(repair));
    }
    match &facts.domain {
        Ok(domain) => findings.extend(domain::diagnose(domain, facts.robot)),
        Err(reason) => findings.push(configuration::domain_unnamed(reason)),
    }
    if let Some(relay) = &facts.relay {
        findings.extend(relay::diagnose(relay, facts.robot));
    }
    findings.extend(memory::diagnose(&facts.free_memory));
    findings.extend(diagnose_files(&facts.files));
    if let Some(port) = &facts.port {
        let domain = facts.domain.as_ref().ok();
        let bridge = domain.and_then(|domain| bridge_pid(domain, facts.robot));
        let finding = serial::diagnose(port, bridge);
        let is_elsewhere =
            domain.is_some_and(|domain| services::is_bridge_elsewhere(domain, facts.robot));
        findings.push(match is_elsewhere {
            true => serial::of_a_bridge_elsewhere(finding),
            false => finding,
        });
    }
    findings
}

/// What configuration files mean.
pub fn diagnose_files(files: &[FileFacts]) -> Vec<Finding> {
    files.iter().map(configuration::diagnose).collect()
}

/// The exit code that tells a script about the findings: the gravest kind of trouble among them.
pub fn exit_code(findings: &[Finding]) -> ExitCode {
    let trouble = |is_about: fn(Subject) -> bool| {
        findings
            .iter()
            .any(|finding| finding.severity > Severity::Note && is_about(finding.subject))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gravest_kind_of_trouble_gives_the_exit_code() {
        use Severity::{Error, Note, Warning};
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
            let findings: Vec<Finding> = kinds
                .iter()
                .map(|(severity, subject)| Finding::new(*severity, *subject, "test", "text"))
                .collect();
            assert_eq!(exit_code(&findings), expected, "{kinds:?}");
        }
    }
}
