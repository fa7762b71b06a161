//! What dead processes left in a domain in which others live.
//!
//! iceoryx2 removes what it can assign to a dead node. A process that is killed while it starts, or while it removes what
//! another one left, leaves things that iceoryx2 can assign to nobody, or that keep it from removing the rest:
//!
//! | left behind | what it does | here |
//! |---|---|---|
//! | a node's folder, files of its monitor | nothing | removed once old |
//! | a half-made tag in a dead node's folder | the removal of the node fails, again and again | removed first |
//! | a port's place in a service, without the port's tag | it is never given back, until there are none | the tag is put back first ([`spare`]) |
//! | a half-made connection with a dead node | who removes the node waits without end, and the other end as well | removed first |
//! | a half-made service | nobody can open the service any more | removed at once |
//! | a half-made segment of a service | who opens the service, or removes a dead node from it, waits without end | removed at once |
//! | segments and sockets of ports, drafts of files | take memory | removed once old |
//!
//! Nothing is touched that may belong to a live process: whether a node is dead is said by the kernel, who keeps the lock
//! of a live one; whether something half made will ever be finished is said by [`MakingLock`].

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};

use iceoryx2::config::Config;
use iceoryx2::node::{DeadNodeView, NodeCleanupFailure, NodeView};
use iceoryx2::prelude::{CallbackProgression, NodeState};

use super::abandoned::{self, DeadNode, Snapshot};
use super::lock::MakingLock;
use super::{Domain, spare};
use crate::iox::{Node, Svc};

/// How old something half made must be before it is taken for abandoned. Making it takes less than a millisecond.
///
/// Programs in other languages know nothing of [`MakingLock`]; this is for them. They make no services (`docs/ipc.md`),
/// so that a half-made service is removed at any age: it would keep a robot from starting.
pub(crate) const SETTLED_AFTER: Duration = Duration::from_secs(10);

/// What cleaning up after dead processes did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleaning {
    /// Dead nodes that were removed, and their partners told.
    pub removed: u64,
    /// Dead nodes that could not be removed: another process does it just now, or they were killed while they started or
    /// cleaned up. The latter become `swept` in one of the next rounds.
    pub failed: u64,
    /// Nodes, segments and files that were removed although iceoryx2 cannot assign them to anybody: their makers were killed
    /// while they started or cleaned up.
    pub swept: u64,
}

impl Cleaning {
    /// Whether there was nothing to do.
    pub const fn is_nothing(&self) -> bool {
        self.removed == 0 && self.failed == 0 && self.swept == 0
    }
}

/// How much [`clean`] looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scope {
    /// Whether a node is dead; at the rest only when one is. Takes about half as long.
    Nodes,
    /// Every file.
    Everything,
}

/// Removes what dead processes left. The domain's lock must be held.
///
/// iceoryx2's own clean-up counts remains that it cannot remove as removed, each time anew; here they are told apart.
pub(crate) fn clean(domain: &Domain, config: &Config, scope: Scope) -> Cleaning {
    let mut cleaning = Cleaning::default();
    let mut stripped = Vec::new();
    let claimed = survey(config, |dead| {
        let id = dead.id().value();
        match prepare(domain, id) {
            Ok(Prepared::Ready) => {}
            Ok(Prepared::Stripped) => {
                stripped.push(id);
                return true;
            }
            Ok(Prepared::NotYet) => {
                cleaning.failed += 1;
                return true;
            }
            Err(error) => {
                tracing::debug!(%error, "a dead node cannot be looked at");
                cleaning.failed += 1;
                return true;
            }
        }
        match dead.try_remove_stale_resources() {
            Ok(()) => {
                cleaning.removed += 1;
                spare::forget(domain, id);
            }
            Err(error) => {
                cleaning.failed += 1;
                // Nobody can say here whether it is really being cleaned up, or its cleaner died as well.
                return error != NodeCleanupFailure::AnotherInstanceIsCleaningUpTheNode;
            }
        }
        false
    });
    let is_all_well = cleaning.is_nothing() && stripped.is_empty();
    if let Some(claimed) = claimed
        && !(is_all_well && scope == Scope::Nodes)
    {
        match sweep(domain, config, &claimed, &stripped) {
            Ok(swept) => cleaning.swept = swept,
            Err(error) => tracing::debug!(%error, "what is abandoned cannot be looked for"),
        }
    }
    cleaning
}

/// How a dead node was found.
enum Prepared {
    /// Nothing is in the way of its removal by iceoryx2.
    Ready,
    /// It has given back everything; what is left of it can simply be removed.
    Stripped,
    /// Somebody makes something just now: a service of the node may be among it. To be tried again.
    NotYet,
}

/// Removes what would keep iceoryx2 from removing a dead node, or hold it up.
fn prepare(domain: &Domain, id: u128) -> io::Result<Prepared> {
    let node = DeadNode::look(domain, id)?;
    if node.is_stripped() {
        return Ok(Prepared::Stripped);
    }
    node.remove_half_made_tags();
    node.remove_half_made_connections(domain)?;
    spare::keep(domain, id)?;
    match remove_half_made_services(domain)? {
        true => Ok(Prepared::Ready),
        false => Ok(Prepared::NotYet),
    }
}

/// Removes segments of services that were left half made, at any age: iceoryx2 waits without end for an empty one to be
/// finished, whether it opens the service or removes a dead node from it. False when they may be in the making.
fn remove_half_made_services(domain: &Domain) -> io::Result<bool> {
    if abandoned::half_made_services(domain)?.is_empty() {
        return Ok(true);
    }
    let Some(_making) = MakingLock::exclude(domain) else {
        return Ok(false);
    };
    // Once more, now that nobody can make anything meanwhile.
    for path in abandoned::half_made_services(domain)? {
        tracing::debug!(path = %path.display(), "a half-made service is removed");
        if let Err(error) = fs::remove_file(&path)
            && error.kind() != io::ErrorKind::NotFound
        {
            return Err(error);
        }
    }
    Ok(true)
}

/// The nodes that live, and those dead ones that `claims` says to keep. Nothing when that cannot be told: then nothing may
/// be removed either.
fn survey(
    config: &Config,
    mut claims: impl FnMut(DeadNodeView<Svc>) -> bool,
) -> Option<BTreeSet<u128>> {
    let mut claimed = BTreeSet::new();
    let listed = Node::list(config, |node| {
        let id = node.node_id().value();
        let is_claimed = match node {
            NodeState::Alive(_) | NodeState::Inaccessible(_) => true,
            NodeState::Dead(dead) => claims(dead),
            NodeState::Undefined(_) => false,
        };
        if is_claimed {
            claimed.insert(id);
        }
        CallbackProgression::Continue
    });
    match listed {
        Ok(()) => Some(claimed),
        Err(error) => {
            tracing::debug!(?error, "the dead cannot be looked for");
            None
        }
    }
}

/// Removes what is left of `stripped` nodes, the files of nodes that nobody claims, and other abandoned files. Says how
/// many nodes and files that were.
fn sweep(
    domain: &Domain,
    config: &Config,
    claimed: &BTreeSet<u128>,
    stripped: &[u128],
) -> io::Result<u64> {
    spare::forget_gone(domain);
    let snapshot = Snapshot::take(domain)?;
    let mut swept = remove_nodes(&snapshot, stripped);
    let then = SystemTime::now() - SETTLED_AFTER;
    if snapshot.nodes(claimed, then).is_empty() && snapshot.files(then).is_empty() {
        return Ok(swept);
    }
    let Some(_making) = MakingLock::exclude(domain) else {
        return Ok(swept);
    };
    // Once more, now that nobody can make anything meanwhile.
    let Some(claimed) = survey(config, |dead| dead.details().is_some()) else {
        return Ok(swept);
    };
    let snapshot = Snapshot::take(domain)?;
    swept += remove_nodes(&snapshot, &snapshot.nodes(&claimed, then));
    for file in snapshot.files(then) {
        swept += u64::from(fs::remove_file(&file).is_ok());
    }
    Ok(swept)
}

/// Removes everything of these nodes, and says how many there were.
fn remove_nodes(snapshot: &Snapshot, nodes: &[u128]) -> u64 {
    for path in snapshot.files_of(nodes) {
        if let Err(error) = remove(&path)
            && error.kind() != io::ErrorKind::NotFound
        {
            tracing::debug!(%error, path = %path.display(), "remains were left");
        }
    }
    nodes.len() as u64
}

fn remove(path: &Path) -> io::Result<()> {
    match path.is_dir() {
        true => fs::remove_dir(path),
        false => fs::remove_file(path),
    }
}

/// How much is abandoned, or being made, beside these nodes.
pub(crate) fn count_abandoned(domain: &Domain, nodes: &BTreeSet<u128>) -> usize {
    match Snapshot::take(domain) {
        Ok(snapshot) => {
            let now = SystemTime::now();
            snapshot.nodes(nodes, now).len() + snapshot.files(now).len()
        }
        Err(error) => {
            tracing::debug!(%error, "what is abandoned cannot be looked for");
            0
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use rustix::fs::{AtFlags, CWD, Timespec, Timestamps, utimensat};

    use super::super::lock::DomainLock;
    use super::*;
    use crate::files;

    const NODES_DIR: &str = "nodes";
    const SERVICES_DIR: &str = "services";

    /// By its name, because only root can open everything that was left half made.
    fn make_old(path: &Path) {
        let then = SystemTime::now() - 2 * SETTLED_AFTER;
        let since_1970 = then.duration_since(SystemTime::UNIX_EPOCH).unwrap();
        let then = Timespec::try_from(since_1970).unwrap();
        let times = Timestamps {
            last_access: then,
            last_modification: then,
        };
        utimensat(CWD, path, &times, AtFlags::SYMLINK_NOFOLLOW).unwrap();
    }

    /// A domain with somebody in it, the remains of a node, and those of a segment.
    struct Scene {
        domain: Domain,
        node: PathBuf,
        segment: PathBuf,
        lock: Option<DomainLock>,
    }

    impl Scene {
        fn new(files: &[&str]) -> Scene {
            let domain = Domain::isolated();
            let lock = DomainLock::acquire(&domain).unwrap();
            let nodes = domain.root().join(NODES_DIR);
            let node = nodes.join("4711");
            files::create_dir_all(&node).unwrap();
            for file in files {
                fs::write(nodes.join(file.replace('%', domain.prefix())), "").unwrap();
            }
            let segment = PathBuf::from(format!("/dev/shm/{}42.event_mgmt", domain.prefix()));
            fs::write(&segment, [0; 8]).unwrap();
            let half_made = std::os::unix::fs::PermissionsExt::from_mode(0o200);
            fs::set_permissions(&segment, half_made).unwrap();
            Scene {
                domain,
                node,
                segment,
                lock: Some(lock),
            }
        }

        /// Makes everything look older.
        fn age(&self) {
            let snapshot = Snapshot::take(&self.domain).unwrap();
            let mut paths = snapshot.files_of(&[4711]);
            paths.push(self.segment.clone());
            paths.iter().for_each(|path| make_old(path));
        }

        fn swept(&self) -> u64 {
            clean(
                &self.domain,
                &self.domain.config().unwrap(),
                Scope::Everything,
            )
            .swept
        }
    }

    impl Drop for Scene {
        fn drop(&mut self) {
            if let Some(lock) = self.lock.take() {
                lock.release(&self.domain);
            }
        }
    }

    #[test]
    fn what_was_left_half_made_is_removed_once_nobody_can_be_making_it() {
        for files in [
            &[][..],
            &["4711/%node.details"],
            &["4711/%node.details", "%4711.node_monitor_context"],
            &["%4711.node_monitor", "%4711.node_monitor_owner_lock"],
        ] {
            let scene = Scene::new(files);
            assert_eq!(scene.swept(), 0, "it is too young");
            scene.age();
            let making = MakingLock::share(&scene.domain).unwrap();
            assert_eq!(scene.swept(), 0, "somebody is making something");
            drop(making);
            assert_eq!(scene.swept(), 2, "{files:?}");
            assert!(!scene.node.exists() && !scene.segment.exists());
            let left = Snapshot::take(&scene.domain).unwrap().files_of(&[4711]);
            assert!(left.is_empty(), "{left:?}");
            assert_eq!(scene.swept(), 0);
        }
    }

    #[test]
    fn a_half_made_service_is_removed_at_once_and_a_whole_one_stays() {
        let scene = Scene::new(&[]);
        let services = scene.domain.root().join(SERVICES_DIR);
        files::create_dir_all(&services).unwrap();
        let path = |name: &str| services.join(format!("{}{name}", scene.domain.prefix()));
        for (name, mode) in [("half", 0o600), ("whole", 0o400)] {
            let path = path(name);
            fs::write(&path, "").unwrap();
            let mode = std::os::unix::fs::PermissionsExt::from_mode(mode);
            fs::set_permissions(&path, mode).unwrap();
        }
        let making = MakingLock::share(&scene.domain).unwrap();
        assert_eq!(scene.swept(), 0, "somebody may be making it");
        drop(making);
        assert_eq!(scene.swept(), 1);
        assert!(path("whole").exists() && !path("half").exists());
    }

    #[test]
    fn a_half_made_segment_of_a_service_is_removed_at_once() {
        let scene = Scene::new(&[]);
        let path =
            |id: u32| PathBuf::from(format!("/dev/shm/{}h_{id}.dynamic", scene.domain.prefix()));
        for (id, mode, content) in [(1, 0o200, ""), (2, 0o200, "half"), (3, 0o600, "whole")] {
            fs::write(path(id), content).unwrap();
            let mode = std::os::unix::fs::PermissionsExt::from_mode(mode);
            fs::set_permissions(path(id), mode).unwrap();
        }
        let making = MakingLock::share(&scene.domain).unwrap();
        assert!(!remove_half_made_services(&scene.domain).unwrap());
        assert_eq!(scene.swept(), 0, "somebody may be making it");
        drop(making);
        assert!(remove_half_made_services(&scene.domain).unwrap());
        assert!(path(3).exists() && !path(2).exists() && !path(1).exists());
        fs::remove_file(path(3)).unwrap();
    }

    #[test]
    fn drafts_that_were_never_put_in_their_place_are_removed() {
        let scene = Scene::new(&["4711/1.service_tag"]);
        let prefix = scene.domain.prefix();
        let drafts = [
            scene.domain.root().join("iceoryx2.toml.12-0"),
            PathBuf::from(format!("/dev/shm/{prefix}0_node.global_mgmt.12-0")),
        ];
        for draft in &drafts {
            fs::write(draft, [1]).unwrap();
            make_old(draft);
        }
        assert_eq!(scene.swept(), 2);
        assert!(!drafts.iter().any(|draft| draft.exists()));
        assert!(scene.segment.exists(), "it is younger");
    }

    #[test]
    fn a_node_that_had_opened_services_is_left_to_iceoryx2() {
        let scene = Scene::new(&["4711/%node.details", "4711/%1.service_tag"]);
        scene.age();
        assert_eq!(scene.swept(), 1, "the segment");
        assert!(scene.node.exists());
    }
}
