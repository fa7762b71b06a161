//! What in a domain belongs to nobody any more, judged from a [`Snapshot`] of its files. Pure but for taking it.
//!
//! The names of iceoryx2's files say what they belong to, and their modes whether they were finished:
//!
//! | file | belongs to | is abandoned when |
//! |---|---|---|
//! | `nodes/<node>/…`, `nodes/<prefix><node>.node_monitor…` | the node | nobody claims the node, and it has no tags |
//! | `services/….service` | all nodes with a tag of it | its owner may still write to it: it was left half made |
//! | `…_<port>.data`, `….event_mgmt`, `<port>.event` | the port | no node has a tag of the port |
//! | `…_<port>_<port>.connection` | two ports | no node has a tag of one of them: who has it open, keeps it |
//! | `…_<service>.dynamic` | the service | no service has this number; its owner may not read it: it was left half made |
//! | any segment but a connection | | its owner may not read it: it was left half made |
//!
//! A name or a content that is not understood belongs to somebody.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::lock::is_ours;
use super::{CONFIG_FILE, Domain, SHM_DIR, management};

/// The folders of nodes and of services in the root.
pub(super) const NODES_DIR: &str = "nodes";
const SERVICES_DIR: &str = "services";

/// End of the name of a node's own file: the only thing in the folder of a node that has not begun to open services.
const DETAILS: &str = "node.details";

/// Mode bits: the owner may read, the owner may write.
const READABLE: u32 = 0o400;
const WRITABLE: u32 = 0o200;

/// A file that was there when the snapshot was taken.
#[derive(Clone, Debug)]
struct Found {
    path: PathBuf,
    /// The name without the domain's prefix.
    name: String,
    /// Whether it had the prefix. What has not may be anybody's.
    has_prefix: bool,
    mode: u32,
    len: u64,
    modified: SystemTime,
}

/// The files of a domain that may be left behind.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    /// Each with the node that it belongs to: the node's folder, what is in it, and what is beside it.
    nodes: Vec<(u128, Found)>,
    services: Vec<Found>,
    /// The numbers of the services that are finished; nothing when one could not be understood.
    service_ids: Option<BTreeSet<u128>>,
    /// Files and sockets in the root.
    root: Vec<Found>,
    segments: Vec<Found>,
}

impl Snapshot {
    /// Looks at all files of the domain.
    ///
    /// # Errors
    ///
    /// When a folder cannot be read: not to see something is not the same as that it is not there.
    pub(crate) fn take(domain: &Domain) -> io::Result<Snapshot> {
        let prefix = domain.prefix();
        let mut nodes = Vec::new();
        for found in list(&domain.root.join(NODES_DIR), prefix)? {
            let id = found.name.split('.').next().unwrap_or_default();
            let Ok(id) = id.parse() else {
                continue;
            };
            let inside = match found.path.is_dir() {
                true => list(&found.path, prefix)?,
                false => Vec::new(),
            };
            nodes.extend(inside.into_iter().map(|found| (id, found)));
            nodes.push((id, found));
        }
        let mut services = list(&domain.root.join(SERVICES_DIR), prefix)?;
        services.retain(|found| found.has_prefix);
        let mut segments = list(Path::new(SHM_DIR), prefix)?;
        segments.retain(|found| {
            let metadata = fs::symlink_metadata(&found.path);
            found.has_prefix && metadata.is_ok_and(|metadata| is_ours(&metadata))
        });
        Ok(Snapshot {
            nodes,
            service_ids: service_ids(&services),
            services,
            root: list(&domain.root, prefix)?,
            segments,
        })
    }

    /// Nodes with files that nobody claims, that never came to open a service, and all of whose files were last changed
    /// before `then`.
    pub(crate) fn nodes(&self, claimed: &BTreeSet<u128>, then: SystemTime) -> Vec<u128> {
        let mut ids: BTreeSet<u128> = self.nodes.iter().map(|(id, _)| *id).collect();
        ids.retain(|id| {
            let mut files = self.nodes.iter().filter(|(node, _)| node == id);
            !claimed.contains(id) && files.all(|(_, file)| file.modified < then && !file.is_tag())
        });
        ids.into_iter().collect()
    }

    /// Everything of these nodes, folders after what is in them.
    pub(crate) fn files_of(&self, nodes: &[u128]) -> Vec<PathBuf> {
        self.nodes
            .iter()
            .filter(|(id, _)| nodes.contains(id))
            .map(|(_, file)| file.path.clone())
            .collect()
    }

    /// Other files that belong to nobody: services, and segments of services, that were left half made; and what was last changed before `then` and
    /// belongs to no port and no service, or was left half made.
    pub(crate) fn files(&self, then: SystemTime) -> Vec<PathBuf> {
        let ports: BTreeSet<u128> = self
            .nodes
            .iter()
            .filter_map(|(_, file)| file.tag())
            .collect();
        let services = self
            .services
            .iter()
            .filter(|file| file.mode & WRITABLE != 0);
        let half_made = services.chain(
            self.segments
                .iter()
                .filter(|file| file.is_half_made_service()),
        );
        let segments = self.segments.iter().filter(|file| {
            !file.is_half_made_service()
                && file.modified < then
                && self.is_abandoned_segment(file, &ports)
        });
        let root = self.root.iter().filter(|file| {
            file.modified < then && (file.is_draft() || file.belongs_to_no_port(&ports))
        });
        let found = half_made.chain(segments).chain(root);
        found.map(|file| file.path.clone()).collect()
    }

    fn is_abandoned_segment(&self, file: &Found, ports: &BTreeSet<u128>) -> bool {
        if file.belongs_to_no_port(ports) || management::is_draft(&file.path) {
            return true;
        }
        match file.name.rsplit_once('.') {
            // Connections are made while samples are sent and received: nobody can say that they are not being made.
            Some((_, "connection")) => false,
            _ if file.mode & READABLE == 0 => true,
            Some((rest, "dynamic")) => match (last_number(rest), &self.service_ids) {
                (Some(id), Some(services)) => !services.contains(&id),
                _ => false,
            },
            _ => false,
        }
    }
}

impl Found {
    /// Whether this is something in the folder of a node but the node's own file.
    fn is_tag(&self) -> bool {
        self.name.ends_with("_tag")
    }

    /// The port that this is a tag of.
    fn tag(&self) -> Option<u128> {
        self.name.strip_suffix(".port_tag")?.parse().ok()
    }

    /// Whether this is the segment of a service that was not finished.
    fn is_half_made_service(&self) -> bool {
        self.name.ends_with(".dynamic") && (self.len == 0 || self.mode & READABLE == 0)
    }

    fn is_draft(&self) -> bool {
        let rest = self.name.strip_prefix(CONFIG_FILE);
        rest.is_some_and(|rest| rest.starts_with('.'))
    }

    /// Whether this belongs to ports, and to none of these.
    fn belongs_to_no_port(&self, ports: &BTreeSet<u128>) -> bool {
        let Some((rest, kind)) = self.name.rsplit_once('.') else {
            return false;
        };
        if !self.has_prefix {
            return false;
        }
        match kind {
            "data" | "event" | "event_mgmt" => {
                last_number(rest).is_some_and(|port| !ports.contains(&port))
            }
            "connection" => self
                .ends()
                .is_some_and(|ends| !ends.iter().all(|port| ports.contains(port))),
            _ => false,
        }
    }

    /// The two ports that this is the connection of.
    fn ends(&self) -> Option<[u128; 2]> {
        let rest = self.name.strip_suffix(".connection")?;
        let (rest, receiver) = rest.rsplit_once('_')?;
        Some([last_number(rest)?, receiver.parse().ok()?])
    }
}

/// The number after the last `_`, or all of it.
fn last_number(text: &str) -> Option<u128> {
    text.rsplit('_').next()?.parse().ok()
}

/// What is in a folder, nothing when it does not exist. What vanishes meanwhile, or is neither file, folder nor socket,
/// is left out.
fn list(folder: &Path, prefix: &str) -> io::Result<Vec<Found>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry?;
        let (Ok(metadata), Ok(name)) = (entry.metadata(), entry.file_name().into_string()) else {
            continue;
        };
        let kind = metadata.file_type();
        if !(kind.is_file() || kind.is_dir() || kind.is_socket()) {
            continue;
        }
        let stripped = name.strip_prefix(prefix);
        found.push(Found {
            path: entry.path(),
            name: stripped.unwrap_or(&name).to_owned(),
            has_prefix: stripped.is_some(),
            mode: metadata.mode(),
            len: metadata.len(),
            modified: metadata.modified()?,
        });
    }
    Ok(found)
}

/// The numbers of the services that are finished.
fn service_ids(services: &[Found]) -> Option<BTreeSet<u128>> {
    let finished = services.iter().filter(|file| file.mode & WRITABLE == 0);
    finished
        .map(|file| service_id(&fs::read_to_string(&file.path).ok()?))
        .collect()
}

/// The number of the service whose settings these are. iceoryx2 writes them as TOML, the number in two halves.
fn service_id(settings: &str) -> Option<u128> {
    let (_, section) = settings.split_once("[unique_service_id]\n")?;
    let half = |name: &str| -> Option<u128> {
        let line = section.lines().find(|line| line.starts_with(name))?;
        let number = line.split_once(" = ")?.1.trim_matches('"');
        number.parse::<u64>().ok().map(u128::from)
    };
    Some(half("unique_value")? << 64 | half("payload_value")?)
}

/// The segments of services that are half made.
///
/// # Errors
///
/// When the segments cannot be listed.
pub(crate) fn half_made_services(domain: &Domain) -> io::Result<Vec<PathBuf>> {
    let mut found = list(Path::new(SHM_DIR), domain.prefix())?;
    found.retain(|file| file.has_prefix && file.is_half_made_service());
    Ok(found.into_iter().map(|file| file.path).collect())
}

/// What of a dead node iceoryx2 can still give back, and what keeps it from doing so.
pub(crate) struct DeadNode {
    folder: PathBuf,
    files: Vec<Found>,
}

impl DeadNode {
    /// Looks at the folder of a node.
    ///
    /// # Errors
    ///
    /// When it cannot be read.
    pub(crate) fn look(domain: &Domain, id: u128) -> io::Result<DeadNode> {
        let folder = domain.root.join(NODES_DIR).join(id.to_string());
        let files = list(&folder, domain.prefix())?;
        Ok(DeadNode { folder, files })
    }

    /// Whether the node has given back everything that it had: its own file goes last.
    pub(crate) fn is_stripped(&self) -> bool {
        !self.files.iter().any(|file| file.name.ends_with(DETAILS))
    }

    /// Removes connections with this node that were left half made. iceoryx2 would wait for them to be finished, for an
    /// empty one without end; so would the other end of the connection if it lives, which this frees.
    ///
    /// # Errors
    ///
    /// When the segments cannot be listed.
    pub(crate) fn remove_half_made_connections(&self, domain: &Domain) -> io::Result<()> {
        let ports: BTreeSet<u128> = self.files.iter().filter_map(Found::tag).collect();
        for file in list(Path::new(SHM_DIR), domain.prefix())? {
            let is_half_made = file.len == 0 || file.mode & READABLE == 0;
            let ends = file.ends().filter(|_| file.has_prefix && is_half_made);
            if ends.is_some_and(|ends| ends.iter().any(|port| ports.contains(port)))
                && let Err(error) = fs::remove_file(&file.path)
            {
                tracing::debug!(%error, path = %file.path.display(), "a connection was left");
            }
        }
        Ok(())
    }

    /// Removes tags that were left half made: what they were to announce was not made either, and iceoryx2, which does
    /// not see them, could not remove the folder.
    pub(crate) fn remove_half_made_tags(&self) {
        for file in &self.files {
            if file.is_tag()
                && file.mode & WRITABLE != 0
                && let Err(error) = fs::remove_file(&file.path)
            {
                tracing::debug!(%error, folder = %self.folder.display(), "a tag was left");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const OLD: SystemTime = SystemTime::UNIX_EPOCH;

    fn then() -> SystemTime {
        OLD + Duration::from_secs(10)
    }

    /// A file; `%` in front of its name stands for the prefix, `young:` says that it is, and a number after it is its mode.
    fn file(description: &str) -> Found {
        let (name, mode) = description
            .split_once(' ')
            .map_or((description, 0o400), |(name, mode)| {
                (name, u32::from_str_radix(mode, 8).unwrap())
            });
        let (modified, name) = match name.strip_prefix("young:") {
            Some(name) => (then(), name),
            None => (OLD, name),
        };
        Found {
            path: PathBuf::from(name),
            name: name.trim_start_matches('%').to_owned(),
            has_prefix: name.starts_with('%'),
            mode,
            len: 1,
            modified,
        }
    }

    fn snapshot(
        nodes: &[(u128, &str)],
        services: &[&str],
        ids: Option<&[u128]>,
        root: &[&str],
        segments: &[&str],
    ) -> Snapshot {
        let files = |descriptions: &[&str]| descriptions.iter().map(|text| file(text)).collect();
        Snapshot {
            nodes: nodes.iter().map(|(id, text)| (*id, file(text))).collect(),
            services: files(services),
            service_ids: ids.map(|ids| ids.iter().copied().collect()),
            root: files(root),
            segments: files(segments),
        }
    }

    #[test]
    fn a_node_is_abandoned_when_it_is_old_and_nobody_s_and_has_no_tags() {
        let nodes = [
            (1, "1"),
            (1, "%node.details"),
            (2, "%2.node_monitor_context"),
            (2, "%2.node_monitor"),
            (3, "3"),
            (3, "young:%node.details"),
            (4, "4"),
            (4, "%node.details"),
            (4, "%77.port_tag"),
            (5, "5"),
            (5, "%abc.service_tag"),
            (6, "6"),
        ];
        let snapshot = snapshot(&nodes, &[], None, &[], &[]);
        assert_eq!(snapshot.nodes(&BTreeSet::from([6]), then()), [1, 2]);
        let of_two = ["%2.node_monitor_context", "%2.node_monitor"];
        assert_eq!(snapshot.files_of(&[2]), of_two.map(PathBuf::from));
    }

    /// One row: a segment or a file in the root, and whether it is abandoned. Port 7 has a tag, service 9 exists.
    #[test]
    fn a_file_is_abandoned_when_what_it_belongs_to_is_gone() {
        for (description, expected) in [
            ("%hash_7.data 600", false),
            ("%hash_8.data 600", true),
            ("young:%hash_8.data 600", false),
            ("%hash_7.event_mgmt 600", false),
            ("%hash_8.event_mgmt 600", true),
            ("%7.event 600", false),
            ("%8.event 600", true),
            ("8.event 600", false),
            ("letter_8.data 600", false),
            ("%hash_7_7.connection 600", false),
            ("%hash_7_8.connection 600", true),
            ("%hash_8_7.connection 600", true),
            ("young:%hash_8_7.connection 600", false),
            ("%hash_8_88.connection 600", true),
            ("%hash_8_what.connection 600", false),
            ("%hash_7_8.connection 200", true),
            ("%hash_7_7.connection 200", false),
            ("%hash_9.dynamic 600", false),
            ("%hash_10.dynamic 600", true),
            ("%hash_what.dynamic 600", false),
            ("%hash_what.data 600", false),
            ("%hash_9.dynamic 200", true),
            ("young:%hash_9.dynamic 200", true),
            ("young:%hash_9.dynamic 600", false),
            ("%hash_7.event_mgmt 200", true),
            ("young:%hash_7.event_mgmt 200", false),
            ("%hash_node.global_mgmt 600", false),
            ("%hash_node.global_mgmt.12-0 600", true),
            ("young:%hash_node.global_mgmt.12-0 600", false),
            ("%something 600", false),
        ] {
            let tag = [(1, "%7.port_tag")];
            let of = |root: &[&str], segments: &[&str]| {
                snapshot(&tag, &[], Some(&[9]), root, segments).files(then())
            };
            let is_socket = description.contains(".event ");
            let found = match is_socket {
                true => of(&[description], &[]),
                false => of(&[], &[description]),
            };
            assert_eq!(!found.is_empty(), expected, "{description}");
        }
    }

    #[test]
    fn a_service_that_is_not_understood_keeps_all_of_their_segments() {
        let segments = ["%hash_10.dynamic 600"];
        let of = |ids| snapshot(&[], &[], ids, &[], &segments).files(then());
        assert_eq!(of(None), Vec::<PathBuf>::new());
        assert_eq!(of(Some(&[][..])).len(), 1);
    }

    #[test]
    fn half_made_services_and_drafts_are_abandoned_and_other_files_are_not() {
        let services = ["young:%a.service 600", "%b.service 400"];
        let root = [
            "iceoryx2.toml",
            "iceoryx2.toml.12-0",
            "young:iceoryx2.toml.12-1",
            "domain.lock",
            "making.lock",
            "letter.txt",
        ];
        let found = snapshot(&[], &services, None, &root, &[]).files(then());
        let expected = ["%a.service", "iceoryx2.toml.12-0"];
        assert_eq!(found.len(), expected.len(), "{found:?}");
        assert!(found[0].ends_with("%a.service") && found[1].ends_with(expected[1]));
    }

    #[test]
    fn the_number_of_a_service_is_read_as_iceoryx2_writes_it() {
        let settings = "a = 1\n[unique_service_id]\npayload_value = 3\nunique_value = 2\n\n[b]\n";
        assert_eq!(service_id(settings), Some(2 << 64 | 3));
        for wrong in [
            "",
            "[unique_service_id]\npayload_value = 3\n",
            "unique_value = 2",
        ] {
            assert_eq!(service_id(wrong), None, "{wrong}");
        }
    }

    /// What a live process has must be known to belong to somebody, however old it is.
    #[test]
    fn nothing_of_a_live_process_is_abandoned() {
        use crate::payload::{DspTelemetry, ModuleControl, ModuleState};
        use crate::{Ipc, RobotId};
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let mut publisher = ipc.publisher::<DspTelemetry>().unwrap();
        let mut subscriber = ipc.subscriber::<DspTelemetry>().unwrap();
        let _late = ipc.subscriber::<ModuleState>().unwrap();
        let server = ipc.server::<ModuleControl>().unwrap();
        let client = ipc.client::<ModuleControl>().unwrap();
        publisher.publish(|_| {}).unwrap();
        assert_eq!(subscriber.drain(|_| {}).unwrap(), 1);

        let snapshot = Snapshot::take(&domain).unwrap();
        let later = SystemTime::now() + Duration::from_secs(1);
        assert_eq!(snapshot.files(later), Vec::<PathBuf>::new());
        let services = snapshot.service_ids.as_ref().unwrap();
        assert_eq!(services.len(), snapshot.services.len());
        // All kinds of files are there, so that all have been judged.
        for kind in ["data", "event_mgmt", "connection", "dynamic"] {
            let mut segments = snapshot.segments.iter();
            assert!(segments.any(|file| file.name.ends_with(kind)), "{kind}");
        }
        assert!(
            snapshot
                .root
                .iter()
                .any(|file| file.name.ends_with(".event"))
        );
        drop((client, server, _late, subscriber, publisher, ipc));
        assert!(domain.residue().is_empty());
    }
}
