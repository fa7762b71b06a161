//! Findings as text for people and as JSON for programs.

use std::fmt;

use runtime::exit::ExitCode;
use serde::{Serialize, Serializer};

use super::facts::{Facts, FileFacts};
use super::findings::{Finding, Severity, diagnose, diagnose_files, exit_code};
use crate::words::count;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Doctor.v1";

/// What the doctor tells.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    schema: &'static str,
    robot: u32,
    /// The folder of the domain; nothing when the environment names none, or it was not asked for.
    root: Option<String>,
    errors: usize,
    warnings: usize,
    #[serde(serialize_with = "number")]
    exit_code: ExitCode,
    findings: Vec<Finding>,
}

fn number<S: Serializer>(code: &ExitCode, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u8(code.code())
}

impl Report {
    /// What the facts mean.
    pub fn of(facts: &Facts) -> Report {
        let domain = facts.domain.as_ref().ok();
        Report {
            root: domain.map(|domain| domain.root.display().to_string()),
            ..Report::new(facts.robot, diagnose(facts))
        }
    }

    /// What the configuration files alone mean.
    pub fn of_files(robot: u32, files: &[FileFacts]) -> Report {
        Report::new(robot, diagnose_files(files))
    }

    fn new(robot: u32, findings: Vec<Finding>) -> Report {
        let number = |severity| {
            let wanted = findings
                .iter()
                .filter(|finding| finding.severity == severity);
            wanted.count()
        };
        Report {
            schema: SCHEMA,
            robot,
            root: None,
            errors: number(Severity::Error),
            warnings: number(Severity::Warning),
            exit_code: exit_code(&findings),
            findings,
        }
    }

    /// How the process ends.
    pub fn exit_code(&self) -> ExitCode {
        self.exit_code
    }

    /// All of it in a few words.
    pub fn verdict(&self) -> String {
        if self.errors + self.warnings == 0 {
            return "everything that was looked at is in order".to_owned();
        }
        let errors = count(self.errors, "error");
        let warnings = count(self.warnings, "warning");
        format!("{errors} and {warnings}; each says what to do")
    }
}

impl fmt::Display for Report {
    /// A line for each finding, and one for what to do about it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "robot {}", self.robot)?;
        if let Some(root) = &self.root {
            write!(f, ", shared memory in {root}")?;
        }
        writeln!(f)?;
        for finding in &self.findings {
            let mark = match finding.severity {
                Severity::Note => "ok",
                Severity::Warning => "warning",
                Severity::Error => "ERROR",
            };
            writeln!(f, "{mark:<8}{}", finding.text)?;
            if let Some(next_step) = &finding.next_step {
                writeln!(f, "        → {next_step}")?;
            }
        }
        if self.exit_code == ExitCode::Ok {
            writeln!(f, "{}", self.verdict())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::facts::{FileContent, Trouble};
    use super::*;

    fn files() -> [FileFacts; 3] {
        let file = |command, path: &str, content| FileFacts {
            command,
            path: path.into(),
            content,
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
        let report = Report::of_files(7, &files()[..2]);
        let expected = "\
robot 7
ok      bridge.toml of `ril run bridge` is right
ERROR   the configuration of `ril run status` is refused: status.toml:3: no
        → correct it: its process does not start with this file
";
        assert_eq!(report.to_string(), expected);
        assert_eq!(
            report.verdict(),
            "1 error and 0 warnings; each says what to do"
        );
        let report = Report::of_files(7, &files()[..1]);
        assert!(
            report
                .to_string()
                .ends_with("\neverything that was looked at is in order\n")
        );
    }

    #[test]
    fn programs_get_names_and_numbers() {
        let json = serde_json::to_value(Report::of_files(7, &files())).unwrap();
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
