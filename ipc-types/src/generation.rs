//! [`Generation`]: one life of a provider. It begins with an empty folder and a prefix of its own, and when no process
//! is in it any more it is deleted as a whole. Nothing in it is ever repaired.
//!
//! Its provider makes everything of it and then writes its name into `current`. Others only open what is there. Each of
//! them holds a shared `flock` on the generation's lock; a process that gets it exclusively knows that no other is
//! there, and deletes folder and segments without a look into them.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs::{self, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::prelude::{
    Config, FileName, NodeName, Path as IoxPath, SemanticString, SignalHandlingMode,
};
use rustix::fs::{FlockOperation, OFlags};
use rustix::io::Errno;

use crate::disk::{self, is_at, open_to_look};
use crate::domain::{Domain, GENERATION_LEN, MAX_GENERATION_LEN, PREFIX_LEN, SHM_DIR};
use crate::domain_error::DomainError;
use crate::files;
use crate::iox::{Node, NodeBuilder, Svc};
use crate::lock_file::{LockFile, flock, is_ours, make_lock_file_in, open_folder, unless_missing};
use crate::provider::{LockWatch, ProviderLock};
use crate::schema::{self, LoadError, Schema};
use crate::service::{MAX_KEY_LEN, is_key};

/// The file whose lock says that a process is in the generation.
const LOCK_FILE: &str = "lock";

/// The file that the provider has locked for as long as it publishes or serves in the generation.
const PROVIDER_FILE: &str = "provider";

/// The file with the name of the generation that lives.
const CURRENT_FILE: &str = "current";

/// The file with the schema of what lies in the generation.
const SCHEMA_FILE: &str = "schema.msg";

/// Ends the name of a generation that is being made.
const DRAFT: &str = ".new";

/// How often a process begins anew whose draft was removed before it was locked.
const BEGIN_ATTEMPTS: u32 = 4;

/// How long iceoryx2 waits for what is half made. A generation is announced when all of it is made; what its members
/// make later takes microseconds.
const CREATION_TIMEOUT: Duration = Duration::from_millis(100);

/// One life of a provider, and this process's part in it.
#[derive(Debug)]
pub(crate) struct Generation {
    /// Goes before the stay.
    node: Node,
    config: Config,
    stay: Stay,
}

/// A process's stay in the folder of a generation: its lock. The last one who leaves deletes everything.
#[derive(Debug)]
pub(crate) struct Stay {
    pub(crate) lock: LockFile,
    /// Locked while the provider lives; the provider alone has it.
    pub(crate) provider: Option<LockFile>,
    pub(crate) name: String,
    pub(crate) path: PathBuf,
    pub(crate) prefix: String,
}

/// Why a generation cannot be entered.
#[derive(Debug, thiserror::Error)]
pub(crate) enum EnterError {
    /// It is being deleted, or is gone: there will be another one.
    #[error("it has ended")]
    Ended,
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// iceoryx2 cannot make a node.
    #[error("iceoryx2 cannot make a node ({0})")]
    Node(String),
}

impl Generation {
    /// Begins a generation in the folder of a service. Others cannot enter it before [`announce`].
    pub(crate) fn begin(
        domain: &Domain,
        service: &Path,
        process_name: &str,
    ) -> Result<Generation, EnterError> {
        Generation::with_node(Stay::begin(domain, service)?, process_name)
    }

    /// Enters a generation that its provider has announced.
    pub(crate) fn enter(
        domain: &Domain,
        service: &Path,
        name: &str,
        process_name: &str,
    ) -> Result<Generation, EnterError> {
        Generation::with_node(Stay::enter(domain, service, name)?, process_name)
    }

    fn with_node(stay: Stay, process_name: &str) -> Result<Generation, EnterError> {
        let config = config(&stay.path, &stay.prefix)?;
        let node_name =
            NodeName::new(process_name).map_err(|error| EnterError::Node(format!("{error:?}")))?;
        let node = files::while_no_port_opens(|| {
            NodeBuilder::new()
                .name(&node_name)
                .config(&config)
                .signal_handling_mode(SignalHandlingMode::Disabled)
                .create::<Svc>()
        });
        Ok(Generation {
            node: node.map_err(|error| EnterError::Node(format!("{error:?}")))?,
            config,
            stay,
        })
    }

    pub(crate) fn node(&self) -> &Node {
        &self.node
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    pub(crate) fn name(&self) -> &str {
        &self.stay.name
    }

    pub(crate) fn path(&self) -> &Path {
        &self.stay.path
    }

    /// Says that what is in it is not served any more.
    pub(crate) fn stop_serving(&mut self) {
        self.stay.provider = None;
    }

    /// Lays the schema of its content beside it.
    pub(crate) fn describe(&self, schema: &str) -> Result<(), DomainError> {
        let path = self.path().join(SCHEMA_FILE);
        files::while_no_port_opens(|| fs::write(&path, schema))
            .map_err(|error| DomainError::io("write", &path, error))
    }
}

impl Stay {
    pub(crate) fn begin(domain: &Domain, service: &Path) -> Result<Stay, EnterError> {
        let mut attempt = 1;
        loop {
            match Stay::try_begin(domain, service) {
                // A process that deletes dead generations took it for one before it was locked.
                Err(EnterError::Ended) if attempt < BEGIN_ATTEMPTS => attempt += 1,
                result => return result,
            }
        }
    }

    fn try_begin(domain: &Domain, service: &Path) -> Result<Stay, EnterError> {
        let name = disk::fresh_name(GENERATION_LEN);
        let draft = service.join(format!("{name}{DRAFT}"));
        disk::create_folder(&draft).map_err(|error| DomainError::io("create", &draft, error))?;
        // Locked before it gets its name: a folder without a lock counts as dead.
        let folder = open_folder(&draft)?.ok_or(EnterError::Ended)?;
        let lock = make_lock_file_in(&folder, LOCK_FILE, &draft)?.ok_or(EnterError::Ended)?;
        let path = service.join(&name);
        if !flock(&lock, FlockOperation::NonBlockingLockShared, &path)? {
            return Err(EnterError::Ended);
        }
        let provider =
            make_lock_file_in(&folder, PROVIDER_FILE, &draft)?.ok_or(EnterError::Ended)?;
        if !flock(&provider, FlockOperation::NonBlockingLockExclusive, &path)? {
            return Err(EnterError::Ended);
        }
        match disk::rename(&draft, &path) {
            Err(Errno::NOENT) => Err(EnterError::Ended),
            Err(error) => Err(DomainError::io("rename", &draft, error).into()),
            Ok(()) => Ok(Stay::with_locks(domain, &name, path, lock, Some(provider))),
        }
    }

    pub(crate) fn enter(domain: &Domain, service: &Path, name: &str) -> Result<Stay, EnterError> {
        let path = service.join(name);
        let lock_path = path.join(LOCK_FILE);
        let lock = unless_missing(open_to_look(&lock_path), "open", &lock_path)?;
        let lock = lock.ok_or(EnterError::Ended)?;
        if !flock(&lock, FlockOperation::NonBlockingLockShared, &lock_path)?
            || !is_at(&lock, &lock_path)
        {
            return Err(EnterError::Ended);
        }
        Ok(Stay::with_locks(domain, name, path, lock, None))
    }

    fn with_locks(
        domain: &Domain,
        name: &str,
        path: PathBuf,
        lock: LockFile,
        provider: Option<LockFile>,
    ) -> Stay {
        Stay {
            lock,
            provider,
            name: name.to_owned(),
            path,
            prefix: prefix(domain, name),
        }
    }
}

impl Drop for Stay {
    fn drop(&mut self) {
        if !self.lock.is_own() {
            return;
        }
        let lock_path = self.path.join(LOCK_FILE);
        let is_last = flock(
            &self.lock,
            FlockOperation::NonBlockingLockExclusive,
            &lock_path,
        );
        if is_last.unwrap_or(false) && is_at(&self.lock, &lock_path) {
            let result = delete(&self.path, HashSet::from([self.prefix.clone()]));
            if let Err(error) = result {
                crate::log::debug!(%error, "a generation was left behind");
            }
        }
    }
}

/// Makes the generation the one that others enter: its name, the prefix of its segments, which programs need that use
/// iceoryx2 by themselves, and the key of the service.
pub(crate) fn announce(
    domain: &Domain,
    service: &Path,
    name: &str,
    key: &str,
) -> Result<(), DomainError> {
    let path = service.join(CURRENT_FILE);
    // Always the same name: a provider that is killed here leaves one file, which the next one writes anew.
    let draft = service.join(format!("{CURRENT_FILE}{DRAFT}"));
    let text = format!("{name} {} {key}\n", prefix(domain, name));
    disk::replace(&path, &draft, &text).map_err(|error| DomainError::io("write", &path, error))
}

/// Says that no generation lives.
pub(crate) fn withdraw(lock: &ProviderLock) {
    if let Err(error) = lock.remove(CURRENT_FILE) {
        crate::log::debug!(?lock, %error, "not withdrawn");
    }
}

/// The generation that others may enter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Current {
    /// Its name.
    pub(crate) name: String,
    /// Key of the service.
    pub(crate) key: String,
}

/// The generation of a service that others may enter; `None` if it has no provider. One that is announced may have
/// vanished: its provider was killed, and the last process that was in it has deleted it.
///
/// # Errors
///
/// When that cannot be found out, for want of descriptors for example.
pub(crate) fn current(service: &Path) -> Result<Option<Current>, DomainError> {
    let path = service.join(CURRENT_FILE);
    let file = unless_missing(open_to_look(&path), "open", &path)?;
    let Some(current) = file.as_ref().and_then(read_current) else {
        return Ok(None);
    };
    let folder = service.join(&current.name);
    let is_there = unless_missing(disk::open_folder(&folder), "open", &folder)?;
    Ok(is_there.map(|_| current))
}

fn read_current(file: &LockFile) -> Option<Current> {
    let limit = GENERATION_LEN + 1 + PREFIX_LEN + 1 + MAX_KEY_LEN + 1;
    let text = disk::read(file, limit as u64)?;
    let mut words = text.trim_end().split(' ');
    let (name, _prefix, key) = (words.next()?, words.next()?, words.next()?);
    (is_name(name) && is_key(key)).then(|| Current {
        name: name.to_owned(),
        key: key.to_owned(),
    })
}

/// The schema of what lies in a generation, of samples or of requests, and its text.
pub(crate) fn schema(service: &Path, name: &str) -> Result<(Schema, String), LoadError> {
    schema::load(&service.join(name).join(SCHEMA_FILE))
}

/// Tells whether the generation in this folder has a provider.
pub(crate) fn provider_watch(generation: &Path) -> LockWatch {
    LockWatch::new(generation.join(PROVIDER_FILE))
}

/// The file of which the kernel closes one description when a process leaves the generation in this folder.
pub(crate) fn lock_file(generation: &Path) -> PathBuf {
    generation.join(LOCK_FILE)
}

/// The folders in a folder: those of a robot's services.
pub(crate) fn services(robot_folder: &Path) -> Vec<PathBuf> {
    let found = disk::list(robot_folder).into_iter();
    found
        .filter(|found| found.is_folder)
        .filter_map(|found| Some(robot_folder.join(found.name?)))
        .collect()
}

fn is_name(name: &str) -> bool {
    name.len() == GENERATION_LEN && name.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

fn prefix(domain: &Domain, name: &str) -> String {
    format!("{}{name}_", domain.tag())
}

/// The configuration of iceoryx2. Only what names the generation matters; the rest is set service by service.
fn config(path: &Path, prefix: &str) -> Result<Config, DomainError> {
    let too_long = || DomainError::TooLong {
        root: path.to_owned(),
        len: path.as_os_str().len(),
        max: MAX_GENERATION_LEN - PREFIX_LEN,
    };
    if path.as_os_str().len() + prefix.len() > MAX_GENERATION_LEN {
        return Err(too_long());
    }
    let prefix = FileName::new(prefix.as_bytes()).map_err(|_| too_long())?;
    let root = IoxPath::new(path.as_os_str().as_bytes()).map_err(|_| too_long())?;
    let mut config = Config::default();
    config.global.prefix = prefix;
    config.global.set_root_path(&root);
    config.global.creation_timeout = CREATION_TIMEOUT;
    // Only a provider removes what dead members left, and never while it opens something.
    config.global.service.cleanup_dead_nodes_on_open = false;
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    Ok(config)
}

/// The configuration of iceoryx2 for a generation.
pub(crate) fn config_of(
    domain: &Domain,
    service: &Path,
    name: &str,
) -> Result<Config, DomainError> {
    config(&service.join(name), &prefix(domain, name))
}

/// The generations of a service that there are, drafts included, as names of folders.
pub(crate) fn names(service: &Path) -> Vec<String> {
    let found = disk::list(service).into_iter();
    found
        .filter_map(|found| found.name)
        .filter(|name| is_name(without_draft(name)))
        .collect()
}

fn without_draft(name: &str) -> &str {
    name.strip_suffix(DRAFT).unwrap_or(name)
}

/// Former generations of a service above which a provider that starts deletes the dead ones first: its predecessors
/// crashed before they looked for what others left.
const MAX_FORMER: usize = 16;

/// Deletes dead generations of a service when there are many.
pub(crate) fn delete_many_dead(domain: &Domain, service: &Path) {
    if names(service).len() > MAX_FORMER {
        delete_dead(domain, service);
    }
}

/// Deletes the generations of a service in which no process is. Returns how many those were.
pub(crate) fn delete_dead(domain: &Domain, service: &Path) -> usize {
    let mut dead = Vec::new();
    for name in names(service) {
        let path = service.join(&name);
        let lock_path = path.join(LOCK_FILE);
        let Ok(lock) = open_to_look(&lock_path) else {
            // Its maker was killed before it made the lock, or is about to make it and will then begin anew.
            let _ = disk::remove_folder(&path);
            continue;
        };
        let is_dead = flock(&lock, FlockOperation::NonBlockingLockExclusive, &lock_path);
        if is_dead.unwrap_or(false) && is_at(&lock, &lock_path) {
            dead.push((path, prefix(domain, without_draft(&name)), lock));
        }
    }
    // One look at the segments of all users for all of them. Their locks are held until they are gone.
    delete_segments(&dead.iter().map(|(_, prefix, _)| prefix.clone()).collect());
    let deleted = dead.iter().filter(|(path, ..)| delete_folder(path).is_ok());
    deleted.count()
}

/// The prefixes of all generations in a robot's folder.
fn prefixes_in(domain: &Domain, robot_folder: &Path) -> HashSet<String> {
    services(robot_folder)
        .iter()
        .flat_map(|service| names(service))
        .map(|name| prefix(domain, without_draft(&name)))
        .collect()
}

/// Deletes a robot's folder that no process can enter any more, with all generations in it.
pub(crate) fn delete_robot_folder(domain: &Domain, folder: &Path) -> Result<(), DomainError> {
    delete(folder, prefixes_in(domain, folder))
}

/// Deletes segments, then the folder, whose existence is the record of them.
fn delete(folder: &Path, prefixes: HashSet<String>) -> Result<(), DomainError> {
    delete_segments(&prefixes);
    delete_folder(folder)
}

fn delete_segments(prefixes: &HashSet<String>) {
    if prefixes.is_empty() {
        return;
    }
    for path in segments(|name| prefix_of(name).is_some_and(|prefix| prefixes.contains(prefix))) {
        // Another process may be deleting the same.
        let _ = disk::remove_file(&path);
    }
}

fn delete_folder(folder: &Path) -> Result<(), DomainError> {
    match disk::remove_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(DomainError::io("delete", folder, error))
        }
        _ => Ok(()),
    }
}

/// The first letters of a segment's name.
fn prefix_of(name: &str) -> Option<&str> {
    name.get(..PREFIX_LEN)
}

/// This user's segments with such a name. Costs in proportion to the segments of all users.
fn segments(mut is_wanted: impl FnMut(&str) -> bool) -> Vec<PathBuf> {
    let found = disk::list(Path::new(SHM_DIR)).into_iter();
    found
        .filter_map(|found| found.name.filter(|name| is_wanted(name)))
        .map(|name| Path::new(SHM_DIR).join(name))
        .filter(|path| is_ours_at(path))
        .collect()
}

/// Whether what is there belongs to this user.
fn is_ours_at(path: &Path) -> bool {
    #[cfg(test)]
    if disk::model::is_there() {
        return true;
    }
    fs::symlink_metadata(path).is_ok_and(|metadata| is_ours(&metadata))
}

/// The domain's segments, in whichever generation.
pub(crate) fn segments_of(domain: &Domain) -> Vec<PathBuf> {
    let tag = domain.tag();
    segments(|name| {
        prefix_of(name).is_some_and(|prefix| prefix.starts_with(&tag) && prefix.ends_with('_'))
    })
}

/// Segments of generations that have no folder any more: no process can open them, and none will delete them.
pub(crate) fn orphans(domain: &Domain) -> Vec<PathBuf> {
    // Elsewhere two containers can have a root of the same name each, and share the segments' folder.
    if !domain.root().starts_with(SHM_DIR) {
        return Vec::new();
    }
    // Listed before the folders: a generation has its folder before its first segment.
    let mut segments = segments_of(domain);
    if !segments.is_empty() {
        let known: HashSet<String> = services(domain.root())
            .iter()
            .flat_map(|robot| prefixes_in(domain, robot))
            .collect();
        segments.retain(|path| {
            let name = path.file_name().and_then(OsStr::to_str);
            name.and_then(prefix_of)
                .is_some_and(|prefix| !known.contains(prefix))
                && is_unused(path)
        });
    }
    segments
}

/// Whether no process has the segment open, in whichever container: only then the kernel grants a lease. The domain's
/// tag is short, so another domain of this user may have the same.
fn is_unused(path: &Path) -> bool {
    #[cfg(test)]
    if disk::model::is_there() {
        return disk::model::is_unused(path);
    }
    let mut options = OpenOptions::new();
    options
        .read(true)
        .write(true)
        .custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32);
    options.open(path).is_ok_and(|file| {
        let descriptor = file.as_raw_fd();
        // SAFETY: commands for an open descriptor, without pointers. A process that opens the segment meanwhile is
        // announced by a signal: by one that does nothing unless it is handled.
        #[allow(unsafe_code)]
        unsafe {
            libc::fcntl(descriptor, F_SETSIG, libc::SIGURG) == 0
                && libc::fcntl(descriptor, libc::F_SETLEASE, libc::F_WRLCK) == 0
        }
    })
}

/// `F_SETSIG` of Linux, which the crate `libc` has not for every C library.
const F_SETSIG: i32 = 10;

/// Deletes the [`orphans`]. Returns how many those were.
pub(crate) fn delete_orphans(domain: &Domain) -> usize {
    orphans(domain)
        .iter()
        .filter(|path| disk::remove_file(path).is_ok())
        .count()
}
