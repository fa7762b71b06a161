//! Configuration files and the environment.

use super::super::facts::{FileContent, FileFacts};
use super::finding::{About, Finding, Subject};

const ABOUT: About = About(Subject::Configuration);

/// What a configuration file means.
pub(super) fn diagnose(file: &FileFacts) -> Finding {
    let path = file.path.display();
    let whose = match file.command {
        Some(command) => format!("of `ril run {command}`"),
        None => "of the operator's commands".to_owned(),
    };
    match &file.content {
        Ok(FileContent::Right) => {
            ABOUT.note("configuration-right", format!("{path} {whose} is right"))
        }
        Ok(FileContent::Absent) => ABOUT.note(
            "configuration-absent",
            format!("no {path} here: the configuration {whose} is the built-in one"),
        ),
        Ok(FileContent::Wrong(reason)) => ABOUT.error(
            "configuration-wrong",
            format!("the configuration {whose} is refused: {reason}"),
            "correct it: its process does not start with this file",
        ),
        Err(trouble) => ABOUT.error(
            "configuration-unreadable",
            format!("reading {path} {whose} {trouble}"),
            "look what stands in its place: a pipe, or a file system that does not answer?",
        ),
    }
}

/// The environment names no usable domain.
pub(super) fn domain_unnamed(reason: &str) -> Finding {
    ABOUT.error(
        "domain-unnamed",
        format!("no process finds its shared memory: {reason}"),
        "fix RIL_IPC_ROOT, or unset it",
    )
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::super::facts::Trouble;
    use super::super::finding::Severity;
    use super::*;

    #[test]
    fn each_state_of_a_file() {
        for (content, severity, expected) in [
            (
                Ok(FileContent::Right),
                Severity::Note,
                "bridge.toml of `ril run bridge` is right",
            ),
            (
                Ok(FileContent::Absent),
                Severity::Note,
                "no bridge.toml here: the configuration of `ril run bridge` is the built-in one",
            ),
            (
                Ok(FileContent::Wrong(
                    "bridge.toml:2: unknown field".to_owned(),
                )),
                Severity::Error,
                "the configuration of `ril run bridge` is refused: bridge.toml:2: unknown field",
            ),
            (
                Err(Trouble::TookTooLong(Duration::from_secs(5))),
                Severity::Error,
                "reading bridge.toml of `ril run bridge` was given up after 5s",
            ),
        ] {
            let finding = diagnose(&FileFacts {
                command: Some("bridge"),
                path: "bridge.toml".into(),
                content,
            });
            assert_eq!(
                (finding.severity, finding.text.as_str()),
                (severity, expected)
            );
            assert_eq!(finding.next_step.is_some(), severity > Severity::Note);
        }
    }
}
