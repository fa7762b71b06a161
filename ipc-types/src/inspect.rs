//! What is there of a domain, without touching it: for `ril doctor`, and for whoever wants to show it.
//!
//! Nothing here judges, creates, locks for longer than a look, or removes; [`Domain::repair`] does what can be done. A
//! root that belongs to somebody else is not entered: what is in it is that user's choice, and could hold up whoever
//! reads it.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use iceoryx2::node::NodeView;
use iceoryx2::prelude::{CallbackProgression, LogLevel, NodeState, set_log_level_from_env_or};

use crate::domain::owner::OWNERS_DIR;
use crate::domain::{
    Domain, DomainError, Provider, ProviderWatch, SHM_DIR, dead, management, remains,
};
use crate::iox::{Node, Svc};
use crate::robot::RobotId;
use crate::service::ServiceId;

/// What is there of a domain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inspection {
    /// The root folder; nothing when it does not exist.
    pub root: Option<Entry>,
    /// The management segments, usually one; none when no process has been here since the last one left.
    pub management: Vec<Management>,
    /// Nodes, live ones first; empty when the root is not ours.
    pub nodes: Vec<NodeFacts>,
    /// Things that processes left half made or half removed when they were killed, and that belong to nobody. What a
    /// process is just making counts for a moment.
    pub unfinished: usize,
    /// Files, folders and segments of the domain, all in all, the root with them.
    pub entries: usize,
    /// What lies in the root and is not the domain's. Nobody touches it, and the root stays as long as it is there.
    pub strangers: Vec<PathBuf>,
    /// Segments of other users under the domain's prefix. They are not the domain's, and nobody opens them.
    pub foreign: Vec<Entry>,
}

/// A file, folder or segment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Where.
    pub path: PathBuf,
    /// Whether it is a folder.
    pub is_folder: bool,
    /// Its owner.
    pub uid: u32,
    /// Who may do what with it: the lowest twelve bits.
    pub mode: u32,
}

/// A management segment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Management {
    /// Where, whose, and who may do what.
    pub entry: Entry,
    /// Why it would keep nodes from being made, as the end of a sentence; nothing when all is well as far as can be seen.
    pub defect: Option<&'static str>,
}

/// A node: what a process has in the domain for each of its parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeFacts {
    /// How its process is.
    pub life: Life,
    /// Its process, as it is numbered where that runs.
    pub pid: u32,
    /// The name that it joined with; empty when that cannot be read any more.
    pub process: String,
}

/// How the process of a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Life {
    /// It lives: the kernel keeps its lock.
    Live,
    /// It cannot be told.
    Unclear,
    /// It is dead.
    Dead,
}

impl Inspection {
    /// Nodes of this kind.
    pub fn nodes_that_are(&self, life: Life) -> impl Iterator<Item = &NodeFacts> {
        self.nodes.iter().filter(move |node| node.life == life)
    }
}

impl Entry {
    fn of(path: &Path) -> Option<Entry> {
        let metadata = fs::symlink_metadata(path).ok()?;
        Some(Entry {
            path: path.to_owned(),
            is_folder: metadata.is_dir(),
            uid: metadata.uid(),
            mode: metadata.mode() & 0o7777,
        })
    }

    /// Whether it belongs to the user of this process.
    pub fn is_ours(&self) -> bool {
        self.uid == rustix::process::geteuid().as_raw()
    }

    /// Whether others than the owner may write to it.
    pub fn others_may_write(&self) -> bool {
        self.mode & 0o022 != 0
    }

    /// Whether others than the owner may do anything with it.
    pub fn others_may_enter(&self) -> bool {
        self.mode & management::OTHERS != 0
    }
}

impl Domain {
    /// Looks at what is there. Takes milliseconds, whatever state the domain is in.
    pub fn inspect(&self) -> Inspection {
        set_log_level_from_env_or(LogLevel::Error);
        let root = Entry::of(self.root());
        let is_enterable = root
            .as_ref()
            .is_some_and(|root| root.is_folder && root.is_ours());
        let (mut nodes, mut unfinished) = (Vec::new(), 0);
        let (mut entries, mut strangers) = (self.residue(), Vec::new());
        if is_enterable {
            strangers = remains::strangers(self);
            entries.retain(|path| !strangers.iter().any(|stranger| path.starts_with(stranger)));
            nodes = self.nodes();
            let listed = nodes.iter().map(|(id, _)| *id).collect();
            unfinished = dead::count_abandoned(self, &listed);
        }
        Inspection {
            management: management::find(self)
                .iter()
                .filter_map(|path| look_at_management(path))
                .collect(),
            unfinished,
            nodes: nodes.into_iter().map(|(_, node)| node).collect(),
            entries: entries.len(),
            strangers,
            foreign: remains::with_prefix(Path::new(SHM_DIR), self.prefix())
                .iter()
                .filter_map(|path| Entry::of(path))
                .filter(|entry| !entry.is_ours())
                .collect(),
            root,
        }
    }

    /// The live process that publishes or serves `service` of `robot`, or nothing.
    ///
    /// # Errors
    ///
    /// When the domain's folder cannot be read.
    pub fn provider(
        &self,
        robot: RobotId,
        service: ServiceId,
    ) -> Result<Option<Provider>, DomainError> {
        ProviderWatch::new(self, robot, service.spec().key).look()
    }

    /// The robots whose `service` a live process provides, in ascending order.
    ///
    /// # Errors
    ///
    /// When the domain's folder cannot be read.
    pub fn robots(&self, service: ServiceId) -> Result<Vec<RobotId>, DomainError> {
        let is_ours = |root: &Entry| root.is_folder && root.is_ours();
        if !Entry::of(self.root()).as_ref().is_some_and(is_ours) {
            return Ok(Vec::new());
        }
        let folder = self.root().join(OWNERS_DIR);
        let files = match fs::read_dir(&folder) {
            Ok(files) => files,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(DomainError::io("read", &folder, error)),
        };
        let mut robots = Vec::new();
        for file in files {
            let file = file.map_err(|error| DomainError::io("read", &folder, error))?;
            // The file of a service that was provided once stays; its lock says whether the provider lives.
            let robot = file.file_name().to_str().and_then(|name| {
                let (robot, key) = name.split_once('.')?;
                (key == service.spec().key).then(|| robot.parse().ok())?
            });
            if let Some(robot) = robot
                && self.provider(robot, service)?.is_some()
            {
                robots.push(robot);
            }
        }
        robots.sort_unstable();
        Ok(robots)
    }

    fn nodes(&self) -> Vec<(u128, NodeFacts)> {
        let mut nodes = Vec::new();
        let Ok(config) = self.config() else {
            return nodes;
        };
        let listed = Node::list(&config, |state| {
            let id = *state.node_id();
            let (life, details) = match &state {
                NodeState::Alive(node) => (Life::Live, node.details().as_ref()),
                NodeState::Dead(node) => (Life::Dead, node.details().as_ref()),
                NodeState::Inaccessible(_) | NodeState::Undefined(_) => (Life::Unclear, None),
            };
            let process = details.map(|details| details.name().to_string());
            let pid = id.pid::<Svc>().map_or(0, |pid| pid.value());
            let node = NodeFacts {
                life,
                pid: u32::try_from(pid).unwrap_or(0),
                process: process.unwrap_or_default(),
            };
            nodes.push((id.value(), node));
            CallbackProgression::Continue
        });
        if let Err(error) = listed {
            tracing::debug!(?error, "nodes cannot be listed");
        }
        nodes.sort_by(|(a, one), (b, other)| {
            (one.life, one.pid, a).cmp(&(other.life, other.pid, b))
        });
        nodes
    }
}

fn look_at_management(path: &Path) -> Option<Management> {
    let entry = Entry::of(path)?;
    // Somebody else's may be anything.
    let defect = entry.is_ours().then(|| management::defect(path)).flatten();
    Some(Management { entry, defect })
}

/// Bytes that are free in `/dev/shm`. [`REQUIRED_SHM_BYTES`](crate::session::REQUIRED_SHM_BYTES) must be.
///
/// # Errors
///
/// When there is no `/dev/shm`.
pub fn free_memory() -> io::Result<u64> {
    let stat = rustix::fs::statvfs(SHM_DIR)?;
    Ok(stat.f_bavail.saturating_mul(stat.f_frsize))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::Ipc;
    use crate::files::{test_folder, while_no_port_opens};
    use crate::payload::DspTelemetry;

    #[test]
    fn a_domain_that_is_not_there_stays_that_way() {
        let domain = Domain::isolated();
        let nothing = Inspection {
            root: None,
            management: Vec::new(),
            nodes: Vec::new(),
            unfinished: 0,
            entries: 0,
            strangers: Vec::new(),
            foreign: Vec::new(),
        };
        assert_eq!(domain.inspect(), nothing);
        let service = ServiceId::DspTelemetry;
        assert_eq!(domain.provider(RobotId::DEFAULT, service).unwrap(), None);
        assert!(domain.residue().is_empty());
    }

    #[test]
    fn who_is_there_is_seen_with_what_it_provides() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "bridge").unwrap();
        let _publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let other = Ipc::join(&domain, RobotId::DEFAULT, "ril").unwrap();
        let seen = domain.inspect();
        let root = seen.root.as_ref().unwrap();
        assert!(root.is_folder && root.is_ours() && !root.others_may_enter());
        let names: Vec<&str> = seen
            .nodes_that_are(Life::Live)
            .map(|node| node.process.as_str())
            .collect();
        assert_eq!(names, ["bridge", "ril"]);
        assert!(seen.nodes.iter().all(|node| node.pid == std::process::id()));
        let [management] = &seen.management[..] else {
            panic!("{seen:?}");
        };
        assert_eq!(management.entry.mode, 0o600);
        assert_eq!((management.defect, seen.unfinished), (None, 0));

        let provider = |service| domain.provider(RobotId::DEFAULT, service).unwrap();
        let publisher = provider(ServiceId::DspTelemetry).unwrap();
        assert_eq!(publisher.process, "bridge");
        assert_eq!(provider(ServiceId::Movement), None);
        drop((other, _publisher, ipc));
        assert_eq!(domain.inspect().entries, 0);
    }

    #[test]
    fn the_robots_whose_provider_lives_are_listed() {
        let domain = Domain::isolated();
        let robots = || domain.robots(ServiceId::DspTelemetry).unwrap();
        assert_eq!(robots(), []);
        let [one, ten] = [1, 10].map(|id| RobotId::new(id).unwrap());
        let join = |robot| Ipc::join(&domain, robot, "bridge").unwrap();
        let (first, second) = (join(ten), join(one));
        assert_eq!(robots(), []);
        let publisher = first.publisher::<DspTelemetry>().unwrap();
        let other = second.publisher::<DspTelemetry>().unwrap();
        assert_eq!(robots(), [one, ten]);
        assert_eq!(domain.robots(ServiceId::Movement).unwrap(), []);
        // Whatever else lies in the folder is no robot.
        let owners = domain.root().join(OWNERS_DIR);
        for name in ["x.dsp_telemetry", "0.dsp_telemetry", "2", "3.dsp_telemetry"] {
            fs::write(owners.join(name), "").unwrap();
        }
        drop(other);
        assert_eq!(robots(), [ten]);
        drop((publisher, first, second));
        assert_eq!(robots(), []);
    }

    #[test]
    fn a_root_that_cannot_be_trusted_is_described() {
        let folder = test_folder();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o1777)).unwrap();
        let domain = Domain::new("seen_", folder.path()).unwrap();
        let root = domain.inspect().root.unwrap();
        assert!(root.others_may_write());
        assert_eq!(root.mode, 0o1777);
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let domain = Domain::new("seen_", &file).unwrap();
        assert!(!domain.inspect().root.unwrap().is_folder);
    }

    #[test]
    fn what_lies_behind_a_link_is_not_looked_at() {
        let folder = test_folder();
        fs::write(folder.path().join("letter.txt"), "dear").unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(folder.path(), &link).unwrap();
        let seen = Domain::new("seen_", &link).unwrap().inspect();
        assert!(!seen.root.unwrap().is_folder);
        assert_eq!((seen.entries, seen.strangers.len()), (1, 0));
    }

    #[test]
    fn what_is_not_the_domain_s_is_told_apart() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let entries = domain.inspect().entries;
        let letters = domain.root().join("letters");
        while_no_port_opens(|| fs::create_dir(&letters)).unwrap();
        fs::write(letters.join("letter.txt"), "dear").unwrap();
        let seen = domain.inspect();
        assert_eq!(
            (seen.entries, seen.strangers),
            (entries, vec![letters.clone()])
        );
        drop(ipc);
        let seen = domain.inspect();
        assert_eq!((seen.entries, seen.strangers), (1, vec![letters.clone()]));
        fs::remove_dir_all(domain.root()).unwrap();
    }

    #[test]
    fn a_pipe_in_the_place_of_an_owner_holds_up_nobody() {
        use rustix::fs::{CWD, Mode, mkfifoat};
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let owners = domain.root().join("owners");
        while_no_port_opens(|| fs::create_dir_all(&owners)).unwrap();
        let service = ServiceId::Movement;
        let name = format!("{}.{}", RobotId::DEFAULT, service.spec().key);
        mkfifoat(CWD, owners.join(name), Mode::RUSR | Mode::WUSR).unwrap();
        assert_eq!(domain.provider(RobotId::DEFAULT, service).unwrap(), None);
        drop(ipc);
        assert!(domain.residue().is_empty());
    }
}
