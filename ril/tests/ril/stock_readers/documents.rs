//! The programs of `docs/recording.md`, as they stand there.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use ril_tests::languages::root;
use ril_tests::readers::{Reader, package};

/// A folder in which the programs find a flight, and what they import.
pub struct Programs {
    folder: tempfile::TempDir,
}

impl Programs {
    /// With `flight.mcap` in it.
    pub fn with(flight: &Path) -> Programs {
        let folder = tempfile::tempdir().unwrap();
        symlink(flight, folder.path().join("flight.mcap")).unwrap();
        let stand_in = format!(
            "__path__ = [{:?}]\nfrom hero_ril.flight import Flight\n",
            package()
        );
        fs::write(folder.path().join("hero_ril.py"), stand_in).unwrap();
        Programs { folder }
    }

    /// Runs those in the reader's language.
    #[track_caller]
    pub fn run(&self, reader: &Reader) {
        let (language, file) = match reader {
            Reader::Python { .. } => ("python", "program.py"),
            Reader::Node { .. } => ("js", "program.mjs"),
        };
        let document = fs::read_to_string(root().join("docs/recording.md")).unwrap();
        let mut programs = document.split("```").filter_map(|part| {
            let program = part.strip_prefix(language)?.strip_prefix('\n')?;
            program.contains("flight.mcap").then_some(program)
        });
        let first = programs.next();
        assert!(first.is_some(), "no program in {language}");
        for program in first.into_iter().chain(programs) {
            fs::write(self.folder.path().join(file), program).unwrap();
            let mut command = match reader {
                Reader::Python { interpreter, .. } => {
                    let mut command = Command::new(interpreter);
                    command.arg("-B");
                    command
                }
                Reader::Node { packages, .. } => {
                    let modules = self.folder.path().join("node_modules");
                    let _ = symlink(packages.join("node_modules"), modules);
                    Command::new("node")
                }
            };
            let output = command.arg(file).current_dir(self.folder.path()).output();
            let output = output.unwrap_or_else(|error| panic!("{language}: {error}"));
            let problems = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{program}\n{problems}");
        }
    }
}
