//! What a domain consists of in the file system: finding it and removing it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use iceoryx2::prelude::{CallbackProgression, NodeState};

use super::lock::{LOCK_FILE, MAKING_FILE, is_ours};
use super::owner::OWNERS_DIR;
use super::spare::SPARE_DIR;
use super::{CONFIG_FILE, Domain, DomainError, SHM_DIR};
use crate::iox::Node;

/// Folders that iceoryx2 and we make in the root.
const FOLDERS: [&str; 4] = ["nodes", "services", OWNERS_DIR, SPARE_DIR];

/// How deep [`list`] looks: root / nodes / node / file.
const MAX_DEPTH: usize = 4;

/// Everything of the domain that exists.
///
/// What is in a root of another user, or behind a symbolic link, is not looked at: it could hold up whoever does.
pub(super) fn list(domain: &Domain) -> Vec<PathBuf> {
    let mut found = segments(domain);
    if let Ok(metadata) = fs::symlink_metadata(&domain.root) {
        found.push(domain.root.clone());
        if metadata.is_dir() && is_ours(&metadata) {
            list_folder(&domain.root, MAX_DEPTH, &mut found);
        }
    }
    found
}

fn list_folder(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) {
    for path in entries(folder) {
        if depth > 0 && fs::symlink_metadata(&path).is_ok_and(|metadata| metadata.is_dir()) {
            list_folder(&path, depth - 1, found);
        }
        found.push(path);
    }
}

/// What lies in the root, which must be ours, and is not the domain's: [`remove`] leaves it alone.
pub(crate) fn strangers(domain: &Domain) -> Vec<PathBuf> {
    let is_domain_s = |name: &str| {
        FOLDERS.contains(&name)
            || name == LOCK_FILE
            || name == MAKING_FILE
            || name.starts_with(&domain.prefix)
            || name.starts_with(CONFIG_FILE)
    };
    let mut found: Vec<PathBuf> = entries(&domain.root).collect();
    found.retain(|path| {
        !path
            .file_name()
            .and_then(|name| name.to_str())
            .is_some_and(is_domain_s)
    });
    found
}

/// The domain's shared-memory segments. A folder is none: it may be the root of a domain, even of this one.
///
/// A segment of another user is none of them, whatever its name: `/dev/shm` lets everybody choose. It cannot be
/// removed, and it does no harm: iceoryx2 makes its segments exclusively, under names that nobody can guess. The one
/// exception is looked at by [`management`](super::management).
pub(crate) fn segments(domain: &Domain) -> Vec<PathBuf> {
    let mut found = with_prefix(Path::new(SHM_DIR), &domain.prefix);
    found.retain(|path| {
        fs::symlink_metadata(path).is_ok_and(|metadata| is_ours(&metadata) && !metadata.is_dir())
    });
    found
}

/// Paths in a folder, in no order; a folder that cannot be read has none.
pub(crate) fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
}

pub(crate) fn with_prefix(folder: &Path, prefix: &str) -> Vec<PathBuf> {
    entries(folder)
        .filter(|path| {
            path.file_name()
                .and_then(|name| name.to_str())
                .is_some_and(|name| name.starts_with(prefix))
        })
        .collect()
}

/// Whether a node of the domain belongs to a live process, also one of another language that knows no lock.
///
/// A process that is just making its node is not seen; therefore docs/ipc.md asks foreign consumers for the lock.
pub(super) fn has_live_node(domain: &Domain) -> bool {
    let Ok(config) = domain.config() else {
        return true;
    };
    let mut live = false;
    let listed = Node::list(&config, |node| {
        live = matches!(node, NodeState::Alive(_) | NodeState::Inaccessible(_));
        if live {
            CallbackProgression::Stop
        } else {
            CallbackProgression::Continue
        }
    });
    // Whoever cannot tell must not remove.
    live || listed.is_err()
}

/// Removes everything of the domain but its lock file and root, and says how many files and segments that were.
///
/// Nobody may be in the domain.
pub(super) fn remove(domain: &Domain) -> Result<usize, DomainError> {
    let mut removed = 0;
    for path in segments(domain) {
        removed += remove_path(&path, fs::remove_file)?;
    }
    for folder in FOLDERS {
        removed += remove_path(&domain.root.join(folder), fs::remove_dir_all)?;
    }
    for path in with_prefix(&domain.root, &domain.prefix) {
        removed += remove_path(&path, fs::remove_file)?;
    }
    for path in with_prefix(&domain.root, CONFIG_FILE) {
        removed += remove_path(&path, fs::remove_file)?;
    }
    removed += remove_path(&domain.root.join(MAKING_FILE), fs::remove_file)?;
    debug_assert!(domain.root.join(LOCK_FILE).exists());
    Ok(removed)
}

pub(crate) fn remove_path<'a>(
    path: &'a Path,
    remove: impl FnOnce(&'a Path) -> io::Result<()>,
) -> Result<usize, DomainError> {
    match remove(path) {
        Ok(()) => Ok(1),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(error) => Err(DomainError::io("remove", path, error)),
    }
}
