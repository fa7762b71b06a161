//! [`PtyFolder`]: a temporary folder for the symbolic links that lead to pseudo-terminals.
//!
//! A simulator makes a pty with a name of the kernel's choice and puts a link to it where it is told; the bridge opens
//! the link. Neither is made here. [`open`] makes a pty for a test that is at its other end itself.

use std::fs::File;
use std::path::{Path, PathBuf};

use ipc_types::files;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use tempfile::TempDir;

/// A new pseudo-terminal: its master, which no child inherits, and the path of its slave.
///
/// # Panics
///
/// When the machine has no pseudo-terminal left.
pub fn open() -> (File, PathBuf) {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a pseudo-terminal");
    grantpt(&master).expect("a terminal of this user");
    unlockpt(&master).expect("a terminal that can be opened");
    let path = ptsname(&master, Vec::new()).expect("a name");
    (master.into(), path.into_string().expect("a path").into())
}

/// A folder that is removed with everything in it when this is dropped.
#[derive(Debug)]
pub struct PtyFolder {
    folder: TempDir,
}

impl PtyFolder {
    /// A new folder.
    ///
    /// # Panics
    ///
    /// When the temporary folder of the machine cannot be written.
    pub fn new() -> PtyFolder {
        let mut builder = tempfile::Builder::new();
        builder.prefix("ril-pty-");
        let folder = files::while_no_port_opens(|| builder.tempdir()).expect("a temporary folder");
        PtyFolder { folder }
    }

    /// The folder, also for logs and configuration files of the test.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Where to put the link called `name`. Nothing is there yet.
    pub fn link(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

impl Default for PtyFolder {
    fn default() -> Self {
        PtyFolder::new()
    }
}

/// Whether there is a link at `path`, whether or not its pty still is.
pub fn is_link(path: &Path) -> bool {
    path.symlink_metadata()
        .is_ok_and(|metadata| metadata.is_symlink())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_folder_goes_with_its_links() {
        let folder = PtyFolder::new();
        let link = folder.link("dsp");
        assert!(!is_link(&link));
        symlink("/dev/pts/nothing", &link).expect("a link");
        assert!(is_link(&link), "also when its pty is gone");
        let path = folder.path().to_owned();
        drop(folder);
        assert!(!path.exists());
    }
}
