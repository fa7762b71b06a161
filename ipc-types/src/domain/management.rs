//! iceoryx2's management segment: a counter that the making of every node reads, and the one name in shared memory that
//! another user can guess.
//!
//! iceoryx2 creates it with mode 0666. Another user who opens it in the instant before that is mended could zero it or
//! cut it short at any later time, and no node could be made any more. Therefore a segment that was open to others is
//! replaced by a private copy instead of changing its mode, and one that keeps nodes from being made is removed.
//!
//! Both are harmless to whoever lives in the domain: the counter only tells apart nodes that one process makes within a
//! nanosecond, and nobody keeps the segment open.

use std::fs::{self, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use iceoryx2::config::Config;
use iceoryx2::prelude::SemanticString;

use super::lock::{check_owner, open_to_look};
use super::{Domain, DomainError, remains};
use crate::files;

/// What anybody but its owner may do with a segment.
pub(crate) const OTHERS: u32 = 0o077;

/// What its owner must be able to do with a segment that was made completely.
const OWNER_READ_WRITE: u32 = 0o600;

/// Longest management segment that is copied, bytes: iceoryx2's has 16. A longer one was tampered with.
const MAX_LEN: u64 = 4096;

/// The management segments of the domain: one for each version of iceoryx2 that was here.
pub(crate) fn find(domain: &Domain) -> Vec<PathBuf> {
    let suffix = suffix();
    let mut found = remains::with_prefix(Path::new(super::SHM_DIR), &domain.prefix);
    found.retain(|path| path.as_os_str().as_encoded_bytes().ends_with(&suffix));
    found
}

/// Whether this is a copy that [`replace`] was about to put in its place.
pub(crate) fn is_draft(path: &Path) -> bool {
    let name = path.as_os_str().as_encoded_bytes();
    let mut suffix = suffix();
    suffix.push(b'.');
    name.windows(suffix.len()).any(|part| part == suffix)
}

fn suffix() -> Vec<u8> {
    let config = Config::default();
    config.global.node.global_mgmt_suffix.as_bytes().to_vec()
}

/// Why a management segment would keep nodes from being made, as the end of a sentence; nothing when it would not.
///
/// A segment that was overwritten with something else than zeros is not recognised; making a node then fails, and
/// [`renew`] helps.
pub(crate) fn defect(path: &Path) -> Option<&'static str> {
    let metadata = fs::symlink_metadata(path).ok()?;
    if metadata.len() == 0 {
        return Some("it is empty");
    }
    if metadata.mode() & OWNER_READ_WRITE != OWNER_READ_WRITE {
        return Some("it was left half made");
    }
    match content(path) {
        Ok(bytes) if bytes.iter().any(|byte| *byte != 0) => None,
        Ok(_) => Some("it holds nothing but zeros"),
        Err(_) => Some("it cannot be read"),
    }
}

/// Refuses a management segment of another user, which only that user or an administrator can remove.
pub(crate) fn check(domain: &Domain) -> Result<(), DomainError> {
    for path in find(domain) {
        if let Ok(metadata) = fs::symlink_metadata(&path) {
            check_owner(&path, &metadata)?;
        }
    }
    Ok(())
}

/// What [`mend`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mended {
    /// A segment that was open to other users was replaced by a private one.
    pub(crate) secured: bool,
    /// A segment that would have kept nodes from being made was removed.
    pub(crate) renewed: bool,
}

/// Removes a management segment that would keep nodes from being made, and takes a good one away from everybody else.
///
/// A segment that another process is just making may be removed as well; that process does not notice.
///
/// # Errors
///
/// When it belongs to another user, or cannot be replaced.
pub(crate) fn mend(domain: &Domain) -> Result<Mended, DomainError> {
    check(domain)?;
    let mut mended = Mended::default();
    for path in find(domain) {
        if defect(&path).is_some() {
            mended.renewed |= remains::remove_path(&path, fs::remove_file)? > 0;
        } else if fs::symlink_metadata(&path).is_ok_and(|found| found.mode() & OTHERS != 0) {
            match replace(&path) {
                // Another process has replaced or removed it meanwhile.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                result => result.map_err(|error| DomainError::io("replace", &path, error))?,
            }
            mended.secured = true;
        }
    }
    Ok(mended)
}

/// Removes the management segment, whatever is in it, so that the next node makes a new one. Says whether there was one.
///
/// # Errors
///
/// When it belongs to another user, or cannot be removed.
pub(crate) fn renew(domain: &Domain) -> Result<bool, DomainError> {
    check(domain)?;
    let mut done = false;
    for path in find(domain) {
        done |= remains::remove_path(&path, fs::remove_file)? > 0;
    }
    Ok(done)
}

/// Puts a copy that nobody else has ever been able to open in the place of `path`.
fn replace(path: &Path) -> io::Result<()> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let bytes = content(path)?;
    if bytes.is_empty() || bytes.len() as u64 > MAX_LEN {
        return fs::remove_file(path);
    }
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    // Begins with the domain's prefix as well, so that it is found should this process be killed just here.
    let mut copy = path.as_os_str().to_owned();
    copy.push(format!(".{}-{count}", std::process::id()));
    let copy = PathBuf::from(copy);
    let mut options = OpenOptions::new();
    options.write(true).create_new(true).mode(OWNER_READ_WRITE);
    let mut file = files::while_no_port_opens(|| options.open(&copy))?;
    file.write_all(&bytes)?;
    fs::rename(&copy, path)
}

/// What the segment holds, up to one byte more than it may have.
fn content(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_to_look(path)?
        .take(MAX_LEN + 1)
        .read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn segment(domain: &Domain) -> PathBuf {
        let name = format!("/dev/shm/{}test_node.0_10_0.global_mgmt", domain.prefix());
        PathBuf::from(name)
    }

    fn set_mode(path: &Path, mode: u32) {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    }

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().mode() & 0o777
    }

    #[test]
    fn whoever_had_it_open_has_nothing_of_its_successor() {
        let domain = Domain::isolated();
        let path = segment(&domain);
        fs::write(&path, [7; 16]).unwrap();
        set_mode(&path, 0o666);
        let intruder = OpenOptions::new().write(true).open(&path).unwrap();

        let secured = Mended {
            secured: true,
            ..Mended::default()
        };
        assert_eq!(mend(&domain).unwrap(), secured);
        assert_eq!(
            (mode(&path), fs::read(&path).unwrap()),
            (0o600, vec![7; 16])
        );
        intruder.set_len(0).unwrap();
        assert_eq!(fs::read(&path).unwrap().len(), 16);
        assert_eq!(mend(&domain).unwrap(), Mended::default(), "it is mended");
        assert_eq!(domain.residue(), [path]);

        assert!(renew(&domain).unwrap());
        assert!(!renew(&domain).unwrap());
        assert!(domain.residue().is_empty());
    }

    #[test]
    fn what_keeps_nodes_from_being_made_is_recognised() {
        let domain = Domain::isolated();
        let path = segment(&domain);
        for (bytes, file_mode, expected) in [
            (&[1, 0, 0][..], 0o600, None),
            (&[1], 0o666, None),
            (&[], 0o600, Some("it is empty")),
            (&[], 0o200, Some("it is empty")),
            (&[0; 16], 0o600, Some("it holds nothing but zeros")),
            (&[0; 16], 0o200, Some("it was left half made")),
            (&[1; 16], 0o400, Some("it was left half made")),
        ] {
            fs::write(&path, bytes).unwrap();
            set_mode(&path, file_mode);
            assert_eq!(defect(&path), expected, "{bytes:?} {file_mode:03o}");
            let renewed = mend(&domain).unwrap().renewed;
            assert_eq!(
                (renewed, path.exists()),
                (expected.is_some(), expected.is_none())
            );
            let _ = fs::remove_file(&path);
        }
        assert_eq!(defect(&path), None, "what is not there harms nobody");
    }

    #[test]
    fn a_segment_of_absurd_length_is_removed_instead_of_copied() {
        let domain = Domain::isolated();
        let path = segment(&domain);
        fs::write(&path, [1]).unwrap();
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_len(1 << 40)
            .unwrap();
        set_mode(&path, 0o622);
        assert!(mend(&domain).unwrap().secured);
        assert!(!path.exists());
    }
}
