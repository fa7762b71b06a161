//! A station's fence in the bridge's configuration file, by the code of `ril plan fly --fence`.

use std::path::{Path, PathBuf};

use operator::fence_file::{FenceChange, FenceFileError};
use plans::model::FenceArea;

use crate::number::{MissionRefusal, MissionResult};

/// What to do when this user may not replace the file.
const NEXT_STEP: &str =
    "this user, and its service, must be allowed to replace it: docs/mavlink.md, Geofence";

/// Puts the areas into `file` in place of those of the last fence.
///
/// # Errors
///
/// Why it was not changed, for the station.
pub(crate) fn put(file: &Path, areas: &[FenceArea]) -> Result<FenceChange, MissionRefusal> {
    FenceChange::put(file, areas).map_err(|error| MissionRefusal {
        result: match error {
            FenceFileError::Refused { .. } => MissionResult::Denied,
            FenceFileError::Configuration(_) => MissionResult::Invalid,
            _ => MissionResult::Error,
        },
        text: match error.is_forbidden() {
            true => format!("{error}; {NEXT_STEP}"),
            false => error.to_string(),
        },
    })
}

/// Why no fence of a station can come into force, as far as that is known before one comes.
pub(crate) fn trouble(file: Result<PathBuf, MissionRefusal>) -> Option<String> {
    let file = match file {
        Ok(file) => file,
        Err(refusal) => return Some(refusal.text),
    };
    let name = file.display();
    // Links lead to where it is replaced.
    let target = match file.canonicalize() {
        Ok(target) => target,
        Err(error) => return Some(format!("{name} cannot be read: {error}")),
    };
    let folder = target.parent().unwrap_or(Path::new("/"));
    tempfile::tempfile_in(folder)
        .err()
        .map(|error| format!("{name} cannot be written: {error}; {NEXT_STEP}"))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn what_stands_against_a_fence_is_said_before_one_comes() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("bridge.toml");
        let said = |file: &Path| trouble(Ok(file.to_owned())).unwrap_or_default();
        assert!(said(&file).contains("cannot be read"));
        fs::write(&file, "").unwrap();
        assert_eq!(said(&file), "");
        // A folder in which no user may write, root neither.
        let link = folder.path().join("link.toml");
        symlink("/proc/self/status", &link).unwrap();
        let why = said(&link);
        assert!(why.contains("link.toml cannot be written"), "{why}");
        assert!(why.ends_with(NEXT_STEP), "{why}");
        let unknown = MissionRefusal {
            result: MissionResult::Error,
            text: "name it".to_owned(),
        };
        assert_eq!(trouble(Err(unknown)).as_deref(), Some("name it"));
    }
}
