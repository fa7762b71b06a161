//! [`Domain`]: which shared memory a process uses. A domain is one folder in memory, and names of segments.
//!
//! ```text
//! /dev/shm/hero<uid>/           the root: the user's, mode 700
//!   <robot>/                    everything of one robot
//!     doorbell                  wakes the robot's processes; each holds a shared lock on it
//!     <service>/                one folder for each service
//!       lock                    exclusive: its one live provider
//!       current                 the name of the provider's generation, written when all is made
//!       <generation>/           one life of a provider: what iceoryx2 keeps there, and its lock
//! /dev/shm/<tag><generation>_*  the segments of a generation
//! ```

use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use crate::domain_error::DomainError;
use crate::random;
use crate::robot::RobotId;

/// Where the operating system keeps shared-memory segments.
pub(crate) const SHM_DIR: &str = "/dev/shm";

/// The environment variable that names the root.
pub const ROOT_VARIABLE: &str = "RIL_IPC_ROOT";

/// Longest path of a generation's folder and prefix of its names together, bytes. Sockets lie in the folder, and a
/// socket's name has at most 107 bytes, of which iceoryx2 adds up to 46.
pub(crate) const MAX_GENERATION_LEN: usize = 61;

/// Longest root, bytes: what [`MAX_GENERATION_LEN`] leaves beside robot 1, the longest of the RIL's services (14
/// letters), a generation, and three separators.
const MAX_ROOT_LEN: usize = MAX_GENERATION_LEN - PREFIX_LEN - GENERATION_LEN - 18;

/// Letters of a generation's name: 30 random bits.
pub(crate) const GENERATION_LEN: usize = 6;

/// Random letters of an isolated domain's root: 30 bits.
const ISOLATED_LEN: usize = 6;

/// Letters of a domain's tag, by which its segments are found: 20 bits of a hash of the root.
const TAG_LEN: usize = 5;

/// Letters of the prefix of a segment's name: tag, generation, and a `_`.
pub(crate) const PREFIX_LEN: usize = TAG_LEN + GENERATION_LEN + 1;

/// Which shared memory a process uses: a root folder.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Domain {
    root: PathBuf,
}

impl Domain {
    /// The user's own domain: `/dev/shm/hero<uid>`.
    pub fn of_user() -> Domain {
        let uid = rustix::process::geteuid().as_raw();
        Domain {
            root: Path::new(SHM_DIR).join(format!("hero{uid}")),
        }
    }

    /// The domain that `RIL_IPC_ROOT` names, or the user's own when it is not set or empty.
    ///
    /// # Errors
    ///
    /// When the root is not usable.
    pub fn from_environment() -> Result<Domain, DomainError> {
        match std::env::var_os(ROOT_VARIABLE).filter(|root| !root.is_empty()) {
            None => Ok(Domain::of_user()),
            Some(root) => Domain::new(Path::new(&root)),
        }
    }

    /// The domain with this root.
    ///
    /// # Errors
    ///
    /// When the root is not absolute, has unusual characters, or is too long.
    pub fn new(root: &Path) -> Result<Domain, DomainError> {
        if !is_root(root) {
            return Err(DomainError::InvalidRoot {
                root: root.to_owned(),
            });
        }
        let len = root.as_os_str().len();
        if len > MAX_ROOT_LEN {
            return Err(DomainError::TooLong {
                root: root.to_owned(),
                len,
                max: MAX_ROOT_LEN,
            });
        }
        Ok(Domain {
            root: root.to_owned(),
        })
    }

    /// A domain of its own: for tests and demonstrations. Nothing is created before a process joins.
    ///
    /// Child processes get it by [`Domain::environment`].
    pub fn isolated() -> Domain {
        // The process id helps a person to find the process; the letters distinguish domains.
        let (pid, letters) = (std::process::id(), random::name(ISOLATED_LEN));
        Domain {
            root: Path::new(SHM_DIR).join(format!("hx{pid:x}-{letters}")),
        }
    }

    /// Like [`Domain::isolated`], with the root in another folder.
    ///
    /// # Errors
    ///
    /// When `parent` is too long or has unusual characters.
    pub fn isolated_in(parent: &Path) -> Result<Domain, DomainError> {
        Domain::new(&parent.join(format!("hx{}", random::name(GENERATION_LEN))))
    }

    /// The root folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// What to set in the environment of a child process so that it uses this domain.
    pub fn environment(&self) -> [(&'static str, OsString); 1] {
        [(ROOT_VARIABLE, self.root.clone().into_os_string())]
    }

    /// The folder of a robot.
    pub(crate) fn robot_folder(&self, robot: RobotId) -> PathBuf {
        self.root.join(robot.to_string())
    }

    /// How the names of this domain's segments begin: a letter, and a hash of the root.
    pub fn tag(&self) -> String {
        let hash = random::hash(self.root.as_os_str().as_bytes());
        format!("h{}", random::letters(hash, TAG_LEN - 1))
    }
}

/// Absolute, at least one folder below `/`, no `.` and `..`, no trailing `/`, only characters that need no quoting.
fn is_root(root: &Path) -> bool {
    let bytes = root.as_os_str().as_bytes();
    let Some(path) = bytes.strip_prefix(b"/") else {
        return false;
    };
    path.split(|byte| *byte == b'/').all(|part| {
        !part.is_empty()
            && part != b"."
            && part != b".."
            && part
                .iter()
                .all(|byte| byte.is_ascii_alphanumeric() || b"-_.".contains(byte))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_root_is_absolute_and_plain() {
        for good in ["/tmp/hero0", "/run/user/1000/hero", "/a.b/c-d_e"] {
            assert!(is_root(Path::new(good)), "{good}");
        }
        for bad in [
            "",
            "/",
            "tmp",
            "/tmp/",
            "/tmp//a",
            "/tmp/../a",
            "/tmp/a b",
            "/tmp/\"",
            "/.",
        ] {
            assert!(!is_root(Path::new(bad)), "{bad}");
        }
    }

    #[test]
    fn a_root_that_is_too_long_for_a_socket_is_refused_with_the_way_out() {
        let root = format!("/tmp/{}", "r".repeat(60));
        let error = Domain::new(Path::new(&root)).unwrap_err();
        assert!(
            error.to_string().contains("choose a shorter root"),
            "{error}"
        );
    }

    #[test]
    fn isolated_domains_differ_and_are_handed_on_by_the_environment() {
        let (one, two) = (Domain::isolated(), Domain::isolated());
        assert_ne!(one, two);
        assert_ne!(one.tag(), two.tag());
        let [(name, root)] = one.environment();
        assert_eq!(name, ROOT_VARIABLE);
        assert_eq!(Domain::new(Path::new(&root)).unwrap(), one);
    }

    #[test]
    fn a_tag_is_five_letters() {
        for domain in [Domain::of_user(), Domain::isolated()] {
            let tag = domain.tag();
            assert_eq!(tag.len(), TAG_LEN, "{tag}");
        }
    }
}
