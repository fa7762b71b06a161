//! [`Claim`]: a locked file beside the symbolic link of a pseudo-terminal, by which a PC knows that the simulator that
//! made the link lives and which terminal is its own. The kernel gives the number of a terminal to the next program as
//! soon as a simulator is killed, and the link goes on naming it; but the lock goes with the process, however it ends.
//!
//! The file is called as the link with `.owner` behind. It is one line: the file system and the number of the device,
//! as `stat` calls them `st_dev` and `st_rdev`, and the process, for people. It is replaced by a rename as a whole,
//! with its lock.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};

use super::error::PtyError;

/// More bytes than a claim has.
const MAX_CLAIM: u64 = 200;

/// Exists as long as this value. Of a simulator that lives no other one takes the link over.
#[derive(Debug)]
pub(super) struct Claim {
    path: PathBuf,
    /// Holds the lock.
    file: File,
}

impl Claim {
    /// Says of the link at `link` that it leads to `terminal`, of this process.
    ///
    /// # Errors
    /// Another simulator lives whose link it is, or the file cannot be made.
    pub fn new(link: &Path, terminal: &Path) -> Result<Claim, PtyError> {
        let failed = |source| PtyError::Link {
            path: link.to_owned(),
            source,
        };
        let link = std::path::absolute(link).map_err(failed)?;
        let path = beside(&link, ".owner");
        match living(&path) {
            Some(owner) => Err(PtyError::Taken { path: link, owner }),
            None => Claim::lay_down(&link, path, terminal).map_err(failed),
        }
    }

    fn lay_down(link: &Path, path: PathBuf, terminal: &Path) -> io::Result<Claim> {
        let fresh = beside(link, &format!(".owner.{}", std::process::id()));
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

/// Who holds the lock of the claim at `path`, as that says, with a comma in front; `None` if nobody does.
fn living(path: &Path) -> Option<String> {
    let file = File::open(path).ok()?;
    if flock(&file, FlockOperation::NonBlockingLockShared).is_ok() {
        return None;
    }
    let text = io::read_to_string(file.take(MAX_CLAIM)).unwrap_or_default();
    let process = text
        .split_whitespace()
        .nth(2)
        .and_then(|word| word.parse::<u32>().ok());
    Some(process.map_or_else(String::new, |process| format!(", process {process}")))
}

fn beside(link: &Path, end: &str) -> PathBuf {
    let mut path = OsString::from(link);
    path.push(end);
    path.into()
}
