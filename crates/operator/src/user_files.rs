//! Files of this user: where programs keep what outlives them, and what may be a secret.

use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Where programs of this user keep what outlives them; `None` if this user has no home.
pub fn state_folder() -> Option<PathBuf> {
    let folder = |name| std::env::var_os(name).filter(|path| !path.is_empty());
    let state = folder("XDG_STATE_HOME").map(PathBuf::from);
    let state = state.or_else(|| Some(PathBuf::from(folder("HOME")?).join(".local/state")))?;
    Some(state.join("ril"))
}

/// Why what is in this file is no secret of this user; `None` if it is, or there is no such file.
pub fn secret_fault(path: &Path) -> Option<String> {
    let there = match fs::symlink_metadata(path) {
        Ok(there) => there,
        Err(error) if error.kind() == ErrorKind::NotFound => return None,
        Err(error) => return Some(error.to_string()),
    };
    if !there.is_file() {
        return Some("it is no file".to_owned());
    }
    if there.mode() & 0o077 != 0 {
        let mode = there.mode() & 0o777;
        return Some(format!(
            "its mode is {mode:o}: other users may read or write it"
        ));
    }
    let own = rustix::process::getuid().as_raw();
    (there.uid() != own).then(|| format!("it belongs to user {}", there.uid()))
}
