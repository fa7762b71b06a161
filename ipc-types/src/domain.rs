//! [`Domain`]: which shared memory a process uses, who may use it, and how nothing of it is left behind.
//!
//! A domain is a prefix for the names of shared-memory segments and a folder for everything else; both together keep
//! processes of different domains apart. Each user has one by default; a test makes its own.
//!
//! Every process that has joined a domain holds a shared `flock` on `<root>/domain.lock`. The kernel drops it when the
//! process ends, however it ends, so that whoever gets the lock exclusively knows that nobody is there: it may remove
//! everything, the remains of killed processes included. This is done by the first process that joins (what a crash
//! left) and by the last one that leaves (so that nothing is left).
//!
//! This module never touches a segment whose name does not begin with the domain's prefix, nor a file in the root that
//! is not one of the domain's.

mod abandoned;
pub(crate) mod dead;
mod error;
pub(crate) mod lock;
pub(crate) mod management;
pub(crate) mod owner;
pub(crate) mod remains;
mod repair;
mod spare;

use std::ffi::{OsStr, OsString};
use std::io::{self, Read};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, FilePath, Path as IoxPath, SemanticString};

pub use dead::Cleaning;
pub use error::DomainError;
pub(crate) use lock::{DomainLock, MakingLock};
pub use owner::Provider;
pub(crate) use owner::{OwnerLock, ProviderWatch};
pub use repair::Repair;

use crate::files;
use crate::time::MonotonicNs;

/// Environment variable with the prefix of the domain's shared-memory names.
pub const PREFIX_VARIABLE: &str = "RIL_IPC_PREFIX";

/// Environment variable with the folder of the domain.
pub const ROOT_VARIABLE: &str = "RIL_IPC_ROOT";

/// Longest sum of the lengths of prefix and root, in bytes.
///
/// A listener's socket is `<root>/<prefix><id>.event`; its name must fit in the 108 bytes of a socket address with the
/// final zero, and an id has up to 39 digits: 107 − 1 − 39 − 6.
pub const MAX_PREFIX_AND_ROOT_LEN: usize = 61;

/// Where the kernel shows shared-memory segments as files.
///
/// The roots of domains are there too, unless somebody chooses another: iceoryx2 syncs the files that it makes in the
/// root to the disk, some forty for a process that starts, and in memory that costs nothing. On a disk it made a bridge
/// start in 80 to 250 ms instead of 20, and it wears out the flash memory of a small machine.
pub(crate) const SHM_DIR: &str = "/dev/shm";

/// The file in the root with the domain's settings, for consumers in other languages.
pub(crate) const CONFIG_FILE: &str = "iceoryx2.toml";

/// Which shared memory a process uses: a prefix of segment names and a root folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    prefix: String,
    root: PathBuf,
    isolated: bool,
}

/// What [`Domain::remove_if_dead`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Removal {
    /// There was nothing.
    Nothing,
    /// Everything of the domain was removed: so many files and segments.
    Removed(usize),
    /// A live process uses the domain; nothing was touched.
    InUse,
}

impl Domain {
    /// The user's own domain: prefix `hero<uid>_`, root `/dev/shm/hero<uid>`.
    pub fn of_user() -> Domain {
        let uid = rustix::process::getuid().as_raw();
        Domain {
            prefix: format!("hero{uid}_"),
            root: Path::new(SHM_DIR).join(format!("hero{uid}")),
            isolated: false,
        }
    }

    /// The domain that `RIL_IPC_PREFIX` and `RIL_IPC_ROOT` name, or the user's own when neither is set.
    ///
    /// # Errors
    ///
    /// When only one of the two is set, or one is not usable.
    pub fn from_environment() -> Result<Domain, DomainError> {
        Domain::from_values(
            std::env::var_os(PREFIX_VARIABLE).as_deref(),
            std::env::var_os(ROOT_VARIABLE).as_deref(),
        )
    }

    fn from_values(prefix: Option<&OsStr>, root: Option<&OsStr>) -> Result<Domain, DomainError> {
        match (prefix, root) {
            (None, None) => Ok(Domain::of_user()),
            (Some(prefix), Some(root)) => {
                let prefix = prefix.to_string_lossy();
                Domain::new(&prefix, Path::new(root))
            }
            (Some(_), None) => Err(DomainError::OnlyOneVariable {
                set: PREFIX_VARIABLE,
                missing: ROOT_VARIABLE,
            }),
            (None, Some(_)) => Err(DomainError::OnlyOneVariable {
                set: ROOT_VARIABLE,
                missing: PREFIX_VARIABLE,
            }),
        }
    }

    /// The domain with this prefix and root.
    ///
    /// The prefix ends in `_` and has no other, so that no domain's prefix is the beginning of another's.
    ///
    /// # Errors
    ///
    /// When one of them is not usable; see [`DomainError`].
    pub fn new(prefix: &str, root: &Path) -> Result<Domain, DomainError> {
        if !is_prefix(prefix) {
            return Err(DomainError::InvalidPrefix {
                prefix: prefix.to_owned(),
            });
        }
        if !is_root(root) {
            return Err(DomainError::InvalidRoot {
                root: root.to_owned(),
            });
        }
        let len = prefix.len() + root.as_os_str().len();
        if len > MAX_PREFIX_AND_ROOT_LEN {
            return Err(DomainError::TooLong {
                root: root.to_owned(),
                prefix: prefix.to_owned(),
                len,
            });
        }
        Ok(Domain {
            prefix: prefix.to_owned(),
            root: root.to_owned(),
            isolated: false,
        })
    }

    /// A domain that nobody else has, with a root of its own in memory: for tests and demonstrations.
    ///
    /// Nothing is created before somebody joins. A process may join any number of isolated domains; the processes it
    /// starts with [`Domain::environment`] take it as their one domain.
    pub fn isolated() -> Domain {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        // The moment tells domains of processes apart that had the same id, one after the other or in containers that
        // share /dev/shm.
        let moment = MonotonicNs::now().0 & 0xff_ffff;
        let name = format!("hx{:x}-{count:x}-{moment:x}", std::process::id());
        Domain {
            prefix: format!("{name}_"),
            root: Path::new(SHM_DIR).join(name),
            isolated: true,
        }
    }

    /// Like [`Domain::isolated`], with the root in another folder.
    ///
    /// # Errors
    ///
    /// When `parent` is too long or has unusual characters.
    pub fn isolated_in(parent: &Path) -> Result<Domain, DomainError> {
        let domain = Domain::isolated();
        let name = domain.prefix.trim_end_matches('_').to_owned();
        Ok(Domain {
            isolated: true,
            ..Domain::new(&domain.prefix, &parent.join(name))?
        })
    }

    /// Prefix of the names of shared-memory segments.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Folder of everything that is not a segment.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// What to set in the environment of a child process so that it uses this domain.
    pub fn environment(&self) -> [(&'static str, OsString); 2] {
        [
            (PREFIX_VARIABLE, OsString::from(&self.prefix)),
            (ROOT_VARIABLE, self.root.clone().into_os_string()),
        ]
    }

    /// Makes this the one domain of the process, also for those parts of iceoryx2 that ask its global configuration.
    ///
    /// Joining a domain that is not isolated does this by itself. Without it, the clean-up after a process that was
    /// killed while it started would look in iceoryx2's default domain.
    ///
    /// # Errors
    ///
    /// [`DomainError::AnotherDomainEntered`] when the process already has another; or when the root is not usable.
    pub fn enter(&self) -> Result<(), DomainError> {
        let lock = DomainLock::acquire(self)?;
        let making = MakingLock::share(self);
        let result = self.set_global_config();
        drop(making);
        lock.release(self);
        result
    }

    /// Everything of the domain that exists now: the root, files in it, segments. Empty when nothing is left.
    pub fn residue(&self) -> Vec<PathBuf> {
        remains::list(self)
    }

    /// Removes everything of the domain, unless a live process uses it.
    ///
    /// # Errors
    ///
    /// When the root belongs to another user, or something cannot be removed.
    pub fn remove_if_dead(&self) -> Result<Removal, DomainError> {
        if self.residue().is_empty() {
            return Ok(Removal::Nothing);
        }
        match DomainLock::acquire_exclusive(self)? {
            None => Ok(Removal::InUse),
            Some(lock) => lock.remove_domain(self),
        }
    }

    pub(crate) fn is_isolated(&self) -> bool {
        self.isolated
    }

    /// The iceoryx2 configuration of this domain. Only what names the domain and its clean-up matters; the rest is set
    /// service by service.
    pub(crate) fn config(&self) -> Result<Config, DomainError> {
        let prefix =
            FileName::new(self.prefix.as_bytes()).map_err(|_| DomainError::InvalidPrefix {
                prefix: self.prefix.clone(),
            })?;
        let root = IoxPath::new(self.root.as_os_str().as_bytes()).map_err(|_| {
            DomainError::InvalidRoot {
                root: self.root.clone(),
            }
        })?;
        let mut config = Config::default();
        config.global.prefix = prefix;
        config.global.set_root_path(&root);
        // We clean up ourselves, before each of these and on timers: iceoryx2 stumbles over what was left half made, and
        // then keeps both the remains and descriptors of them.
        config.global.service.cleanup_dead_nodes_on_open = false;
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        Ok(config)
    }

    /// Writes the settings file and makes it iceoryx2's global configuration. The domain's lock must be held.
    pub(crate) fn set_global_config(&self) -> Result<(), DomainError> {
        let path = self.write_config_file()?;
        let file =
            FilePath::new(path.as_os_str().as_bytes()).map_err(|_| DomainError::InvalidRoot {
                root: self.root.clone(),
            })?;
        let global = Config::setup_global_config_from_file(&file).map_err(|error| {
            DomainError::io(
                "read iceoryx2's settings from",
                &path,
                io::Error::other(format!("{error:?}")),
            )
        })?;
        // iceoryx2 says Ok when another configuration was loaded before, so the result must be looked at.
        if global.global.prefix.as_bytes() != self.prefix.as_bytes()
            || global.global.root_path().as_bytes() != self.root.as_os_str().as_bytes()
        {
            return Err(DomainError::AnotherDomainEntered {
                present: String::from_utf8_lossy(global.global.prefix.as_bytes()).into_owned(),
                wanted: self.prefix.clone(),
            });
        }
        Ok(())
    }

    /// The file is replaced as a whole, so that nobody who reads it meanwhile ever sees half of it.
    fn write_config_file(&self) -> Result<PathBuf, DomainError> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let path = self.root.join(CONFIG_FILE);
        let settings = self.settings();
        if file_holds(&path, settings.as_bytes()) {
            return Ok(path);
        }
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let draft = format!("{CONFIG_FILE}.{}-{count}", std::process::id());
        let draft = self.root.join(draft);
        files::while_no_port_opens(|| std::fs::write(&draft, settings))
            .and_then(|()| std::fs::rename(&draft, &path))
            .map_err(|error| DomainError::io("write", &path, error))?;
        Ok(path)
    }

    /// The settings that a foreign consumer needs, as iceoryx2 reads them.
    fn settings(&self) -> String {
        format!(
            "# The domain of the HERO RIL, for consumers in other languages. Written by its processes.\n\
             [global]\nroot-path = \"{}\"\nprefix = \"{}\"\n",
            self.root.display(),
            self.prefix
        )
    }
}

/// Whether the file at `path` holds exactly `content`. Waits for nobody, whatever stands there.
fn file_holds(path: &Path, content: &[u8]) -> bool {
    let Ok(file) = lock::open_to_look(path) else {
        return false;
    };
    let mut present = Vec::new();
    // One byte more tells a longer one.
    let limit = content.len() as u64 + 1;
    file.take(limit).read_to_end(&mut present).is_ok() && present == content
}

/// 1 to 24 letters, digits and `-`, then one `_`.
fn is_prefix(prefix: &str) -> bool {
    let Some(name) = prefix.strip_suffix('_') else {
        return false;
    };
    (1..=24).contains(&name.len())
        && name
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
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
    fn both_variables_or_none() {
        let some = |text| Some(OsStr::new(text));
        assert_eq!(Domain::from_values(None, None).unwrap(), Domain::of_user());
        let domain = Domain::from_values(some("lab_"), some("/tmp/lab")).unwrap();
        assert_eq!(
            (domain.prefix(), domain.root()),
            ("lab_", Path::new("/tmp/lab"))
        );
        for (prefix, root, missing) in [
            (some("lab_"), None, ROOT_VARIABLE),
            (None, some("/tmp/lab"), PREFIX_VARIABLE),
        ] {
            let error = Domain::from_values(prefix, root).unwrap_err().to_string();
            assert!(
                error.contains(&format!("{missing} is not: set both")),
                "{error}"
            );
        }
    }

    #[test]
    fn roots_are_in_memory_and_are_no_segments() {
        for domain in [Domain::of_user(), Domain::isolated()] {
            assert_eq!(domain.root().parent(), Some(Path::new(SHM_DIR)));
            let name = domain.root().file_name().unwrap().to_str().unwrap();
            assert!(!name.starts_with(domain.prefix()), "{name}");
        }
    }

    #[test]
    fn a_prefix_is_letters_digits_and_dashes_then_one_underscore() {
        for good in ["a_", "hero1000_", "hx1f-2-aabbcc_", "A-1_"] {
            assert!(is_prefix(good), "{good}");
        }
        let long = format!("{}_", "a".repeat(25));
        for bad in ["", "_", "a", "a__", "a_b_", "a/_", "ä_", "a _", &long] {
            assert!(!is_prefix(bad), "{bad}");
        }
    }

    #[test]
    fn no_prefix_begins_another() {
        let one = Domain::new("hero1_", Path::new("/tmp/one")).unwrap();
        let ten = Domain::new("hero10_", Path::new("/tmp/ten")).unwrap();
        assert!(!ten.prefix().starts_with(one.prefix()));
    }

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
        let error = Domain::new("lab_", Path::new(&root)).unwrap_err();
        assert!(
            error.to_string().contains("choose a shorter root"),
            "{error}"
        );
    }

    #[test]
    fn isolated_domains_differ_and_are_handed_on_by_the_environment() {
        let (one, two) = (Domain::isolated(), Domain::isolated());
        assert_ne!(one.prefix(), two.prefix());
        assert_ne!(one.root(), two.root());
        let [(_, prefix), (_, root)] = one.environment();
        let child = Domain::from_values(Some(&prefix), Some(&root)).unwrap();
        assert_eq!((child.prefix(), child.root()), (one.prefix(), one.root()));
        assert!(one.isolated && !child.isolated);
    }

    #[test]
    fn settings_are_written_once_and_replace_whatever_stands_in_their_place() {
        use rustix::fs::{CWD, Mode, mkfifoat};
        use std::os::unix::fs::MetadataExt;
        let folder = files::test_folder();
        let domain = Domain::new("lab_", folder.path()).unwrap();
        let path = folder.path().join(CONFIG_FILE);
        // Nobody writes into the pipe: whoever reads it would wait without end.
        mkfifoat(CWD, &path, Mode::RUSR | Mode::WUSR).unwrap();
        domain.write_config_file().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), domain.settings());
        let inode = || std::fs::symlink_metadata(&path).unwrap().ino();
        let before = inode();
        domain.write_config_file().unwrap();
        assert_eq!(inode(), before);
        std::fs::write(&path, domain.settings() + "#").unwrap();
        domain.write_config_file().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), domain.settings());
    }
}
