//! What is there of a domain, without joining it: for `ril doctor`, and for whatever wants to show it.
//!
//! Nothing here judges. Only [`Domain::repair`] and [`Domain::remove_if_dead`] remove something, and only what is
//! certainly dead. A root that belongs to another user is not entered: what is in it is that user's choice.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use iceoryx2::node::NodeView;
use iceoryx2::prelude::{CallbackProgression, LogLevel, NodeState, set_log_level_from_env_or};

use crate::domain::{Domain, SHM_DIR};
use crate::domain_error::DomainError;
use crate::generation::{self, Current};
use crate::iox::{Node, Svc};
use crate::lock_file::{entries, is_ours};
use crate::provider::{self, Provider};
use crate::robot::RobotId;
use crate::robot_folder;
use crate::session::{Session, service_folder};

/// What is there of a domain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inspection {
    /// The root folder; `None` if it does not exist.
    pub root: Option<Entry>,
    /// The robots that have a folder, in ascending order.
    pub robots: Vec<RobotFacts>,
    /// What processes left that were killed while they deleted: folders, and segments without a folder.
    pub leftovers: usize,
    /// Files, folders and segments of the domain, all in all, the root with them.
    pub entries: usize,
}

/// What is there of a robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotFacts {
    /// Which robot.
    pub robot: RobotId,
    /// Whether a process takes part.
    pub is_live: bool,
    /// Generations of its services, those that are left behind included.
    pub generations: usize,
    /// Of these, generations that have no provider any more.
    pub former: usize,
    /// Members of the current generations, live ones first.
    pub members: Vec<Member>,
}

/// A process's part in the current generation of a service.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Member {
    /// How its process is.
    pub life: Life,
    /// Its process, as it is numbered in its own PID namespace.
    pub pid: u32,
    /// The name that it joined with; empty when that cannot be read any more.
    pub process: String,
    /// Key of the service.
    pub service: String,
    /// Whether the generation has a provider, which removes its dead members.
    pub is_tended: bool,
}

/// How the process of a member is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Life {
    /// It lives: the kernel keeps its lock.
    Live,
    /// It cannot be known.
    Unclear,
    /// It is dead.
    Dead,
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
    /// Access rights: the lowest twelve bits.
    pub mode: u32,
}

/// What became of a domain that was to be removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Removal {
    /// There was nothing.
    Nothing,
    /// So many files, folders and segments were removed.
    Removed(usize),
    /// A live process uses the domain; what it uses was not touched.
    InUse,
}

/// What [`Domain::repair`] removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repair {
    /// Folders of robots in which no process is.
    pub robots: usize,
    /// Generations in which no process is.
    pub generations: usize,
    /// Folders and segments that a killed process was deleting.
    pub leftovers: usize,
}

impl Repair {
    /// Whether there was nothing to remove.
    pub fn is_nothing(self) -> bool {
        self == Repair::default()
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
}

impl Domain {
    /// Looks at what is there. Takes milliseconds, and longer when there are very many segments of whomever in
    /// `/dev/shm`.
    pub fn inspect(&self) -> Inspection {
        set_log_level_from_env_or(LogLevel::Error);
        let root = Entry::of(self.root());
        if !self.is_enterable() {
            return Inspection {
                root,
                ..Inspection::default()
            };
        }
        Inspection {
            root,
            robots: robot_folder::robots(self)
                .into_iter()
                .map(|robot| robot_facts(self, robot))
                .collect(),
            leftovers: robot_folder::discarded(self).len() + generation::orphans(self).len(),
            entries: self.residue().len(),
        }
    }

    /// The live process that publishes or serves the service `key` of `robot`, or `None`.
    ///
    /// # Errors
    ///
    /// When the domain's folder cannot be read.
    pub fn provider(&self, robot: RobotId, key: &str) -> Result<Option<Provider>, DomainError> {
        provider::look(&service_folder(self, robot, key))
    }

    /// The robots whose service `key` a live process provides, in ascending order.
    ///
    /// # Errors
    ///
    /// When the domain's folder cannot be read.
    pub fn robots(&self, key: &str) -> Result<Vec<RobotId>, DomainError> {
        let mut live = Vec::new();
        if self.is_enterable() {
            for robot in robot_folder::robots(self) {
                if self.provider(robot, key)?.is_some() {
                    live.push(robot);
                }
            }
        }
        Ok(live)
    }

    /// The domains of all users in the usual place: each one's root, and its owner.
    pub fn others() -> Vec<Entry> {
        let mut found: Vec<Entry> = entries(Path::new(SHM_DIR))
            .filter(|entry| {
                let name = entry.file_name();
                let uid = name.to_str().and_then(|name| name.strip_prefix("hero"));
                uid.is_some_and(|uid| uid.parse::<u32>().is_ok())
            })
            .filter_map(|entry| Entry::of(&entry.path()))
            .filter(|entry| entry.is_folder && !entry.is_ours())
            .collect();
        found.sort_by(|one, other| one.path.cmp(&other.path));
        found
    }

    /// Everything of the domain that exists now: the root, files in it, segments. Empty when nothing is left.
    pub fn residue(&self) -> Vec<PathBuf> {
        let mut found = Vec::new();
        if fs::symlink_metadata(self.root()).is_ok() {
            found.push(self.root().to_owned());
            if self.is_enterable() {
                walk(self.root(), &mut found);
            }
        }
        found.extend(generation::segments_of(self));
        found
    }

    /// Removes everything of the domain that no live process uses.
    ///
    /// # Errors
    ///
    /// When something cannot be removed.
    pub fn remove_if_dead(&self) -> Result<Removal, DomainError> {
        let before = self.residue().len();
        if before == 0 {
            return Ok(Removal::Nothing);
        }
        self.repair()?;
        match fs::remove_dir(self.root()) {
            Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => Ok(Removal::InUse),
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(DomainError::io("remove", self.root(), error))
            }
            _ => Ok(Removal::Removed(before)),
        }
    }

    /// Removes what is certainly dead: robots and generations in which no process is, and what was half deleted.
    ///
    /// Nothing of it is needed: it is what the processes of the robot do by themselves.
    ///
    /// # Errors
    ///
    /// When something cannot be removed.
    pub fn repair(&self) -> Result<Repair, DomainError> {
        let mut repair = Repair::default();
        if !self.is_enterable() {
            return Ok(repair);
        }
        repair.robots = robot_folder::delete_dead_robots(self)?;
        for robot in robot_folder::robots(self) {
            for service in generation::services(&self.robot_folder(robot)) {
                repair.generations += generation::delete_dead(self, &service);
            }
        }
        repair.leftovers = robot_folder::delete_discarded(self) + generation::delete_orphans(self);
        Ok(repair)
    }

    /// Whether the root is a folder of this user.
    pub(crate) fn is_enterable(&self) -> bool {
        fs::symlink_metadata(self.root())
            .is_ok_and(|metadata| metadata.is_dir() && is_ours(&metadata))
    }
}

fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in entries(folder) {
        found.push(entry.path());
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            walk(&entry.path(), found);
        }
    }
}

fn robot_facts(domain: &Domain, robot: RobotId) -> RobotFacts {
    let mut facts = RobotFacts {
        robot,
        is_live: robot_folder::is_any_process_in(domain, robot),
        generations: 0,
        former: 0,
        members: Vec::new(),
    };
    for service in generation::services(&domain.robot_folder(robot)) {
        let names = generation::names(&service);
        let has_provider = |name: &str| generation::provider_watch(&service.join(name)).look();
        facts.generations += names.len();
        facts.former += names.iter().filter(|name| !has_provider(name)).count();
        if let Ok(Some(current)) = generation::current(&service) {
            let is_tended = has_provider(&current.name);
            facts
                .members
                .extend(members(domain, &service, &current, is_tended));
        }
    }
    facts.members.sort();
    facts
}

/// The processes with live members in the present generation of a service, but for its provider's own, in words.
pub(crate) fn users(session: &Session, key: &str) -> Vec<String> {
    let (domain, folder) = (session.membership().domain(), session.service_folder(key));
    let Ok(Some(current)) = generation::current(&folder) else {
        return Vec::new();
    };
    let mut ports: BTreeMap<(String, u32), usize> = BTreeMap::new();
    for member in members(domain, &folder, &current, true) {
        if member.life == Life::Live {
            *ports.entry((member.process, member.pid)).or_default() += 1;
        }
    }
    if let Ok(Some(provider)) = session.provider(key)
        && let Some(count) = ports.get_mut(&(provider.process, provider.pid))
    {
        *count -= 1;
    }
    let names = ports.into_iter().filter(|(_, count)| *count > 0);
    names
        .map(|((process, pid), count)| match count {
            // It is about to begin, or its name is damaged.
            _ if process.is_empty() => format!("process {pid}"),
            1 => format!("`{process}` (process {pid})"),
            _ => format!("`{process}` (process {pid}, {count} times)"),
        })
        .collect()
}

fn members(domain: &Domain, service: &Path, current: &Current, is_tended: bool) -> Vec<Member> {
    let mut members = Vec::new();
    let Ok(config) = generation::config_of(domain, service, &current.name) else {
        return members;
    };
    let listed = Node::list(&config, |state| {
        let id = *state.node_id();
        let (life, details) = match &state {
            NodeState::Alive(node) => (Life::Live, node.details().as_ref()),
            NodeState::Dead(node) => (Life::Dead, node.details().as_ref()),
            NodeState::Inaccessible(_) | NodeState::Undefined(_) => (Life::Unclear, None),
        };
        let pid = id.pid::<Svc>().map_or(0, |pid| pid.value());
        members.push(Member {
            life,
            pid: u32::try_from(pid).unwrap_or(0),
            process: details.map_or_else(String::new, |details| details.name().to_string()),
            service: current.key.clone(),
            is_tended,
        });
        CallbackProgression::Continue
    });
    if let Err(error) = listed {
        crate::log::debug!(?error, "members cannot be listed");
    }
    members
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
        assert_eq!(domain.inspect(), Inspection::default());
        let service = "dsp_telemetry";
        assert_eq!(domain.provider(RobotId::DEFAULT, service).unwrap(), None);
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::Nothing);
        assert!(domain.repair().unwrap().is_nothing());
        assert!(domain.residue().is_empty());
    }

    #[test]
    fn a_robot_is_seen_with_its_members_and_providers() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "bridge").unwrap();
        let publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let other = Ipc::join(&domain, RobotId::DEFAULT, "ril").unwrap();
        let subscriber = other.subscriber::<DspTelemetry>().unwrap();
        let seen = domain.inspect();
        let root = seen.root.as_ref().unwrap();
        assert!(root.is_folder && root.is_ours() && root.mode == 0o700);
        let [robot] = &seen.robots[..] else {
            panic!("{seen:?}");
        };
        assert!(robot.is_live);
        assert_eq!((robot.robot, robot.generations), (RobotId::DEFAULT, 1));
        let names: Vec<&str> = robot
            .members
            .iter()
            .map(|member| member.process.as_str())
            .collect();
        assert_eq!(names, ["bridge", "ril"]);
        for member in &robot.members {
            assert_eq!(member.pid, std::process::id());
            assert_eq!(
                (member.life, member.service.as_str()),
                (Life::Live, "dsp_telemetry")
            );
        }
        let provider = |service| domain.provider(RobotId::DEFAULT, service).unwrap();
        assert_eq!(provider("dsp_telemetry").unwrap().process, "bridge");
        assert_eq!(provider("movement"), None);
        assert_eq!(domain.remove_if_dead().unwrap(), Removal::InUse);
        drop((subscriber, other, publisher, ipc));
        assert_eq!(domain.inspect().entries, 0);
    }

    #[test]
    fn a_member_whose_name_cannot_be_read_is_a_number_to_others() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "bridge").unwrap();
        let publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let other = Ipc::join(&domain, RobotId::DEFAULT, "consumer").unwrap();
        let ports = [0; 2].map(|_| other.subscriber::<DspTelemetry>().unwrap());
        let users = || users(ipc.session(), "dsp_telemetry");
        let own = std::process::id();
        assert_eq!(users(), [format!("`consumer` (process {own}, 2 times)")]);
        let names = |path: &PathBuf| fs::read(path).is_ok_and(|text| has(&text, b"consumer"));
        for path in domain.residue().iter().filter(|path| names(path)) {
            fs::set_permissions(path, fs::Permissions::from_mode(0o600)).unwrap();
            fs::write(path, "").unwrap();
        }
        assert_eq!(users(), [format!("process {own}")]);
        drop((ports, other, publisher, ipc));
        domain.remove_if_dead().unwrap();
    }

    fn has(text: &[u8], part: &[u8]) -> bool {
        text.windows(part.len()).any(|window| window == part)
    }

    #[test]
    fn the_robots_whose_provider_lives_are_listed() {
        let domain = Domain::isolated();
        let robots = || domain.robots("dsp_telemetry").unwrap();
        assert_eq!(robots(), []);
        let [one, ten] = [1, 10].map(|id| RobotId::new(id).unwrap());
        let join = |robot| Ipc::join(&domain, robot, "bridge").unwrap();
        let (first, second) = (join(ten), join(one));
        assert_eq!(robots(), []);
        let publisher = first.publisher::<DspTelemetry>().unwrap();
        let other = second.publisher::<DspTelemetry>().unwrap();
        assert_eq!(robots(), [one, ten]);
        assert_eq!(domain.robots("movement").unwrap(), []);
        drop(other);
        assert_eq!(robots(), [ten]);
        drop((publisher, first, second));
        assert_eq!(robots(), []);
    }

    #[test]
    fn a_root_that_cannot_be_trusted_is_described_and_refused() {
        let folder = test_folder();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o1777)).unwrap();
        let domain = Domain::new(folder.path()).unwrap();
        let root = domain.inspect().root.unwrap();
        assert!(root.others_may_write());
        assert_eq!(root.mode, 0o1777);
        let Err(error) = Ipc::join(&domain, RobotId::DEFAULT, "test") else {
            panic!("it was joined");
        };
        assert!(error.to_string().contains("others may write"), "{error}");
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let domain = Domain::new(&file).unwrap();
        assert!(!domain.inspect().root.unwrap().is_folder);
        assert!(Ipc::join(&domain, RobotId::DEFAULT, "test").is_err());
    }

    #[test]
    fn what_lies_behind_a_link_is_not_looked_at() {
        let folder = test_folder();
        fs::write(folder.path().join("letter.txt"), "dear").unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(folder.path(), &link).unwrap();
        let domain = Domain::new(&link).unwrap();
        assert!(!domain.inspect().root.unwrap().is_folder);
        assert_eq!(domain.residue(), [link]);
    }

    #[test]
    fn what_the_dead_left_is_removed() {
        let domain = Domain::isolated();
        let make = |path: &str| {
            let path = domain.root().join(path);
            while_no_port_opens(|| fs::create_dir_all(path)).unwrap();
        };
        make("1/movement/abcdef");
        make("2~abcdefgh/movement/abcdef");
        let segment = Path::new(SHM_DIR).join(format!("{}ghijkl_x", domain.tag()));
        fs::write(&segment, "x").unwrap();
        fs::write(domain.root().join("1/doorbell"), "").unwrap();
        // Another domain may have the same tag: what a process has open is not taken for left behind.
        let open = fs::File::options().write(true).open(&segment).unwrap();
        assert_eq!(domain.inspect().leftovers, 1);
        drop(open);
        assert_eq!(domain.inspect().leftovers, 2);
        let repair = domain.repair().unwrap();
        assert_eq!((repair.robots, repair.leftovers), (1, 2));
        assert!(matches!(
            domain.remove_if_dead().unwrap(),
            Removal::Removed(_)
        ));
        assert!(domain.residue().is_empty());
    }

    #[test]
    fn a_pipe_in_the_place_of_a_lock_holds_up_nothing() {
        use rustix::fs::{CWD, Mode, mkfifoat};
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let service = "movement";
        let folder = service_folder(&domain, RobotId::DEFAULT, service);
        while_no_port_opens(|| fs::create_dir_all(&folder)).unwrap();
        for name in ["lock", "current"] {
            mkfifoat(CWD, folder.join(name), Mode::RUSR | Mode::WUSR).unwrap();
        }
        assert_eq!(domain.provider(RobotId::DEFAULT, service).unwrap(), None);
        assert_eq!(generation::current(&folder).unwrap(), None);
        drop(ipc);
        assert!(domain.residue().is_empty());
    }
}
