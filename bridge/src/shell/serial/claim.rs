//! Whether a link to a pseudo-terminal still leads to the simulator that made it. A terminal's number says nothing: the
//! kernel gives it to the next program as soon as a simulator is killed. The simulator keeps a locked file beside its
//! link, `LINK.owner`, which names its terminal; the lock goes with the process.
//!
//! A link without such a file was made by hand, or by another program, and a path such as `/dev/pts/8` is no link: who
//! names it answers for whose terminal it is.

use std::ffi::OsString;
use std::fs::{self, File, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

/// Links that lead from one to the next; the kernel follows 40.
const MAX_LINKS: usize = 40;

/// Whether the link at `port`, or one that it leads to, has an owner that has ended, or whose terminal is another one
/// than that with `metadata`.
///
/// # Errors
/// When the file of the owner cannot be read.
pub(super) fn is_stale(port: &Path, metadata: &Metadata) -> io::Result<bool> {
    let mut path = port.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(target) = fs::read_link(&path) else {
            break;
        };
        match File::open(owner_of(&path)) {
            Ok(file) => return Ok(!is_alive(&file)? || !names(&file, metadata)?),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    Ok(false)
}

fn owner_of(link: &Path) -> PathBuf {
    let mut path = OsString::from(link);
    path.push(".owner");
    path.into()
}

/// Whether a process has the lock. A simulator never takes it on a file that has its name already, so that this look
/// disturbs none.
fn is_alive(file: &File) -> io::Result<bool> {
    match flock(file, FlockOperation::NonBlockingLockShared) {
        Ok(()) => Ok(false),
        Err(Errno::WOULDBLOCK) => Ok(true),
        Err(errno) => Err(errno.into()),
    }
}

/// Whether the file names this device.
fn names(file: &File, metadata: &Metadata) -> io::Result<bool> {
    let text = io::read_to_string(io::Read::take(file, 256))?;
    let mut numbers = text.split_ascii_whitespace().map(str::parse::<u64>);
    let [file_system, device] = [numbers.next(), numbers.next()].map(|one| one?.ok());
    Ok((file_system, device) == (Some(metadata.dev()), Some(metadata.rdev())))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_link_is_as_good_as_its_owner() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let device = fs::metadata("/dev/null").unwrap();
        symlink("/dev/null", at("dsp")).unwrap();
        symlink("dsp", at("mine")).unwrap();
        let stale = || [at("dsp"), at("mine")].map(|link| is_stale(&link, &device).unwrap());
        assert_eq!(stale(), [false; 2], "made by hand");
        assert!(!is_stale(Path::new("/dev/null"), &device).unwrap());
        let owner = |text: &str| {
            fs::write(at("fresh"), text).unwrap();
            let file = File::open(at("fresh")).unwrap();
            flock(&file, FlockOperation::NonBlockingLockExclusive).unwrap();
            fs::rename(at("fresh"), at("dsp.owner")).unwrap();
            file
        };
        let own = format!("{} {} 7\n", device.dev(), device.rdev());
        let first = owner(&own);
        assert_eq!(stale(), [false; 2]);
        drop(first);
        assert_eq!(stale(), [true; 2], "it was killed");
        let second = owner(&own);
        assert_eq!(stale(), [false; 2], "it was started again");
        drop(second);
        for text in [
            "",
            "x",
            "1",
            "1 2 3",
            "18446744073709551616 1",
            "\u{0}\u{0}",
        ] {
            let _other = owner(text);
            assert_eq!(stale(), [true; 2], "{text:?}");
        }
        // Links in a circle lead nowhere.
        symlink("round", at("round")).unwrap();
        assert!(!is_stale(&at("round"), &device).unwrap());
    }
}
