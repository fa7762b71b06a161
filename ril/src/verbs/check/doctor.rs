//! `ril doctor`: looks at a robot's shared memory, configuration and serial port, and says what is wrong and what to
//! do.
//!
//! Nothing is changed, unless `--repair` asks to remove what is certainly dead. Nothing is joined but the topic of a
//! live relay's link and, for a moment, the topic of a live bridge that has its configuration; no other port is
//! opened. Each look times out.

use std::io;

use operator::render::finding::lines;
use operator::render::print_as;
use operator::render::words::count;
use runtime::exit::{ExitCode, Failure};
use runtime::finding::{Finding, Severity};
use serde::{Serialize, Serializer};

use super::DoctorArgs;
use super::diagnosis::{Subject, diagnose, diagnose_files, exit_code};
use super::facts::{FileFacts, MachineFacts};
use super::{HEADING, gather, width};

/// `ril doctor`
///
/// # Errors
///
/// Code 78 when a configuration is wrong, 8 when something else is not in order, 6 when it is the serial port alone.
pub fn doctor(args: &DoctorArgs) -> Result<(), Failure> {
    let common = &args.machine.common;
    runtime::logging::init(common.verbosity())?;
    let (sim, view) = (args.sim.as_deref(), gather::view(args.view.as_deref()));
    let mavlink = gather::mavlink(args.mavlink.as_deref());
    let report = match common.settings.check_config {
        true => {
            let (mut files, ..) = gather::files(&args.machine, sim, None, None);
            files.extend(view.0.into_iter().chain(mavlink.0));
            DoctorReport::of_files(common.robot().get(), &files)
        }
        false => {
            let (mut facts, _) = gather::machine(&args.machine, sim, args.repair);
            facts.files.extend(view.0.into_iter().chain(mavlink.0));
            facts.view = view.1;
            facts.mavlink = mavlink.1;
            DoctorReport::of(&facts)
        }
    };
    print_as(args.json, &report, report.text(width(&io::stdout())))?;
    match report.exit_code {
        ExitCode::Ok => Ok(()),
        code => Err(Failure::new(code, report.verdict())),
    }
}

/// What the doctor found, as text for people and as JSON for programs.
#[derive(Clone, Debug, Serialize)]
pub struct DoctorReport {
    schema: &'static str,
    robot: u32,
    /// The folder of the domain; `None` if the environment names none, or it was not asked for.
    root: Option<String>,
    errors: usize,
    warnings: usize,
    #[serde(serialize_with = "number")]
    exit_code: ExitCode,
    #[serde(serialize_with = "objects")]
    findings: Vec<(Subject, Finding)>,
}

fn number<S: Serializer>(code: &ExitCode, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u8(code.code())
}

/// A finding for programs.
#[derive(Serialize)]
struct FindingObject<'a> {
    severity: Severity,
    subject: Subject,
    id: &'a str,
    text: &'a str,
    next_step: Option<&'a str>,
}

fn objects<S: Serializer>(
    findings: &[(Subject, Finding)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(findings.iter().map(|(subject, finding)| FindingObject {
        severity: finding.severity,
        subject: *subject,
        id: finding.id,
        text: &finding.text,
        next_step: finding.next_step.as_deref(),
    }))
}

impl DoctorReport {
    /// What the facts mean.
    pub fn of(facts: &MachineFacts) -> DoctorReport {
        let domain = facts.domain.as_ref().ok();
        DoctorReport {
            root: domain.map(|domain| domain.root.display().to_string()),
            ..DoctorReport::new(facts.robot, diagnose(facts))
        }
    }

    /// What the configuration files alone mean.
    pub fn of_files(robot: u32, files: &[FileFacts]) -> DoctorReport {
        DoctorReport::new(robot, diagnose_files(files))
    }

    fn new(robot: u32, findings: Vec<(Subject, Finding)>) -> DoctorReport {
        let number = |severity| {
            let alike = findings.iter().filter(|(_, one)| one.severity == severity);
            alike.count()
        };
        DoctorReport {
            schema: "ril.Doctor.v1",
            robot,
            root: None,
            errors: number(Severity::Error),
            warnings: number(Severity::Warning),
            exit_code: exit_code(&findings),
            findings,
        }
    }

    /// All of it in a few words.
    pub fn verdict(&self) -> String {
        let errors = (self.errors > 0).then(|| count(self.errors, "error"));
        let warnings = (self.warnings > 0).then(|| count(self.warnings, "warning"));
        let troubles: Vec<String> = errors.into_iter().chain(warnings).collect();
        match troubles.is_empty() {
            true => "everything that was looked at is in order".to_owned(),
            false => format!("{}; each says what to do", troubles.join(" and ")),
        }
    }

    /// A line for each finding, and one for what to do about it.
    pub fn text(&self, columns: usize) -> String {
        let mut text = format!("robot {}", self.robot);
        if let Some(root) = &self.root {
            text += &format!(", shared memory in {root}");
        }
        text.push('\n');
        for (subject, finding) in &self.findings {
            text += &lines(finding, subject.name(), HEADING, columns);
        }
        if self.exit_code == ExitCode::Ok {
            text += &format!("{}\n", self.verdict());
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::facts::FileContent;
    use super::*;
    use operator::robot::domain::Trouble;

    fn files() -> [FileFacts; 3] {
        let file = |command, path: &str, content| FileFacts {
            command,
            path: path.into(),
            content,
            is_in_force: None,
        };
        [
            file(Some("bridge"), "bridge.toml", Ok(FileContent::Right)),
            file(
                Some("status"),
                "status.toml",
                Ok(FileContent::Wrong("status.toml:3: no".to_owned())),
            ),
            file(
                None,
                "ril.toml",
                Err(Trouble::TookTooLong(Duration::from_secs(5))),
            ),
        ]
    }

    #[test]
    fn people_get_a_line_for_each_finding_and_one_for_what_to_do() {
        let report = DoctorReport::of_files(7, &files()[..2]);
        let expected = "\
robot 7
ok    configuration   bridge.toml of `ril run bridge` is right
FAIL  configuration   the configuration of `ril run status` is refused: status.toml:3: no
                      → correct it: its process does not start with this file
";
        assert_eq!(report.text(usize::MAX), expected);
        assert_eq!(report.verdict(), "1 error; each says what to do");
        let report = DoctorReport::of_files(7, &files()[..1]);
        assert!(
            report
                .text(usize::MAX)
                .ends_with("\neverything that was looked at is in order\n")
        );
    }

    #[test]
    fn programs_get_names_and_numbers() {
        let json = serde_json::to_value(DoctorReport::of_files(7, &files())).unwrap();
        for (pointer, expected) in [
            ("/schema", serde_json::json!("ril.Doctor.v1")),
            ("/robot", 7.into()),
            ("/root", serde_json::Value::Null),
            ("/errors", 2.into()),
            ("/warnings", 0.into()),
            ("/exit_code", 78.into()),
            ("/findings/0/severity", "note".into()),
            ("/findings/0/next_step", serde_json::Value::Null),
            ("/findings/1/subject", "configuration".into()),
            ("/findings/1/id", "configuration-wrong".into()),
            ("/findings/2/id", "configuration-unreadable".into()),
        ] {
            assert_eq!(json.pointer(pointer), Some(&expected), "{pointer}");
        }
    }
}
