//! [`Claim`]: a locked file beside the symbolic link of a pseudo-terminal, by which a PC knows that the simulator that
//! made the link lives and which terminal is its own. The kernel gives the number of a terminal to the next program as
//! soon as a simulator is killed, and the link goes on naming it; but the lock goes with the process, however it ends.
//!
//! The file is called as the link with `.owner` behind. It is one line: the file system and the number of the device,
//! as `stat` calls them `st_dev` and `st_rdev`, and the process, for people. It is replaced by a rename as a whole,
//! with its lock.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};

/// Exists as long as this value, unless another simulator takes the link over.
#[derive(Debug)]
pub(super) struct Claim {
    path: PathBuf,
    /// Holds the lock.
    file: File,
}

impl Claim {
    /// Says of the link at `link` that it leads to `terminal`, of this process.
    pub fn new(link: &Path, terminal: &Path) -> io::Result<Claim> {
        let link = std::path::absolute(link)?;
        let path = beside(&link, ".owner");
        let fresh = beside(&link, &format!(".owner.{}", std::process::id()));
        // Left behind by a process of the same number.
        let _ = fs::remove_file(&fresh);
        let device = fs::metadata(terminal)?;
        let mut file = File::create_new(&fresh)?;
        let text = format!(
            "{} {} {}\n",
            device.dev(),
            device.rdev(),
            std::process::id()
        );
        let made = flock(&file, FlockOperation::NonBlockingLockExclusive)
            .map_err(io::Error::from)
            .and_then(|()| file.write_all(text.as_bytes()))
            .and_then(|()| fs::rename(&fresh, &path));
        if let Err(error) = made {
            let _ = fs::remove_file(&fresh);
            return Err(error);
        }
        Ok(Claim { path, file })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let own = self.file.metadata().map(|own| (own.dev(), own.ino()));
        let found = fs::metadata(&self.path).map(|found| (found.dev(), found.ino()));
        if matches!((own, found), (Ok(own), Ok(found)) if own == found) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

fn beside(link: &Path, end: &str) -> PathBuf {
    let mut path = OsString::from(link);
    path.push(end);
    path.into()
}
