//! Copies of the port tags of dead nodes, so that a removal can be taken up where its cleaner was killed.
//!
//! iceoryx2 gives back a port of a dead node in two steps: it removes the port's tag, then the port's place in the service.
//! When a cleaner is killed between the two, the next one stumbles over the missing tag, and the place is never given
//! back: after four such deaths a service had no place for its publisher any more. Therefore the tags are kept as hard
//! links until the node is gone, and put back before its removal is tried again. A tag too many harms nothing: iceoryx2
//! removes it when it has looked for what the port left.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::Domain;
use super::abandoned::NODES_DIR;
use crate::files;

/// The folder of the copies in the root; in it a folder for each node that is being removed.
pub(super) const SPARE_DIR: &str = "cleaning";

/// End of the name of a port's tag.
const PORT_TAG: &str = ".port_tag";

/// Copies the port tags of a dead node, and puts back those that are missing.
///
/// # Errors
///
/// When that is not possible; the node must not be removed then.
pub(super) fn keep(domain: &Domain, node: u128) -> io::Result<()> {
    let (folder, spare) = (folder_of(domain, node), spare_of(domain, node));
    files::while_no_port_opens(|| fs::create_dir_all(&spare))?;
    link_tags(&folder, &spare)?;
    link_tags(&spare, &folder)
}

/// Forgets the copies for a node that was removed.
pub(super) fn forget(domain: &Domain, node: u128) {
    if let Err(error) = fs::remove_dir_all(spare_of(domain, node))
        && error.kind() != io::ErrorKind::NotFound
    {
        tracing::debug!(%error, node, "copies of tags were left");
    }
    // Those for other nodes keep it.
    let _ = fs::remove_dir(domain.root.join(SPARE_DIR));
}

/// Forgets the copies for all nodes that are no more: their cleaner was killed at the very end.
pub(super) fn forget_gone(domain: &Domain) {
    let spares = fs::read_dir(domain.root.join(SPARE_DIR));
    for spare in spares.into_iter().flatten().flatten() {
        let node = spare.file_name().to_string_lossy().parse();
        if let Ok(node) = node
            && !folder_of(domain, node).exists()
        {
            forget(domain, node);
        }
    }
}

fn folder_of(domain: &Domain, node: u128) -> PathBuf {
    domain.root.join(NODES_DIR).join(node.to_string())
}

fn spare_of(domain: &Domain, node: u128) -> PathBuf {
    domain.root.join(SPARE_DIR).join(node.to_string())
}

/// Links the port tags of one folder into another. What another cleaner has removed meanwhile is left out.
fn link_tags(from: &Path, to: &Path) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let name = entry.file_name();
        if !name.to_string_lossy().ends_with(PORT_TAG) {
            continue;
        }
        match fs::hard_link(entry.path(), to.join(&name)) {
            Ok(()) => {}
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::AlreadyExists | io::ErrorKind::NotFound
                ) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries
            .map(|entry| entry.file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn tags_come_back_until_their_node_is_gone() {
        let domain = Domain::isolated();
        let (folder, spare) = (folder_of(&domain, 4711), spare_of(&domain, 4711));
        files::create_dir_all(&folder).unwrap();
        for name in ["a.port_tag", "b.port_tag", "c.service_tag", "node.details"] {
            fs::write(folder.join(name), "").unwrap();
        }
        keep(&domain, 4711).unwrap();
        assert_eq!(names(&spare), ["a.port_tag", "b.port_tag"]);
        // A cleaner that is killed has removed one, and another could only copy some.
        fs::remove_file(folder.join("a.port_tag")).unwrap();
        fs::remove_file(spare.join("b.port_tag")).unwrap();
        keep(&domain, 4711).unwrap();
        let all = ["a.port_tag", "b.port_tag", "c.service_tag", "node.details"];
        assert_eq!(names(&folder), all);
        assert_eq!(names(&spare), ["a.port_tag", "b.port_tag"]);

        forget_gone(&domain);
        assert!(spare.exists(), "the node is still there");
        fs::remove_dir_all(&folder).unwrap();
        forget_gone(&domain);
        assert!(!domain.root().join(SPARE_DIR).exists());
        assert!(keep(&domain, 4711).is_err(), "there is no such node");
        fs::remove_dir_all(domain.root()).unwrap();
    }
}
