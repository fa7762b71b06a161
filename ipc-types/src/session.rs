//! What the ports of a process share: its membership, its housekeeper, and how generations are begun and entered.
//!
//! Joining makes nothing of iceoryx2's, installs no signal handler and reads no configuration file. Publishers and
//! servers begin a generation of their service each; subscribers and clients enter the one that is current.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use iceoryx2::prelude::{LogLevel, set_log_level_from_env_or};

use crate::domain::Domain;
use crate::domain_error::DomainError;
use crate::doorbell::Doorbell;
use crate::forked::{Forked, Maker, Owned};
use crate::generation::{self, EnterError, Generation};
use crate::housekeeper::{Housekeeper, Maintained};
use crate::limits;
use crate::open::{self, Offer, OpenError};
use crate::provider::{self, Provider, ProviderLock};
use crate::reserve;
use crate::robot::{InvalidRobotId, RobotId};
use crate::robot_folder::Membership;
use crate::service::{Pattern, folder_name, service_name};
use crate::time::MonotonicNs;

/// Longest process name, bytes: it stands in the names of nodes and in the locks of providers.
const MAX_PROCESS_NAME_LEN: usize = 64;

/// A process cannot take part.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    /// The domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// `RIL_ROBOT` names no robot.
    #[error("RIL_ROBOT: {0}")]
    InvalidRobot(#[from] InvalidRobotId),
    /// The name of the process cannot be used.
    #[error(
        "`{0}` is no process name: use 1 to {MAX_PROCESS_NAME_LEN} letters, digits, `-` and `_`"
    )]
    InvalidProcessName(String),
    /// The process may have less memory than its ports take.
    #[error(
        "this process may have {0} bytes of memory (`ulimit -d` and `-v` of its shell, `LimitDATA=` and `LimitAS=` of its service), and needs {least}: raise that",
        least = limits::LEAST_MEMORY
    )]
    LittleMemory(u64),
    /// The process was forked from one that had joined.
    #[error(transparent)]
    Forked(#[from] Forked),
}

/// What all ports share.
pub(crate) struct Session {
    /// First, so that it has ended before the process leaves. Begun when it is first needed.
    housekeeper: Owned<OnceLock<Housekeeper>>,
    membership: Arc<Membership>,
    process_name: String,
}

impl Session {
    /// Takes part in the shared memory of `robot`.
    pub(crate) fn join(
        domain: &Domain,
        robot: RobotId,
        process_name: &str,
    ) -> Result<Session, JoinError> {
        Maker::joining()?;
        if let Some(limit) = limits::too_little_memory() {
            return Err(JoinError::LittleMemory(limit));
        }
        check_process_name(process_name)?;
        set_log_level_from_env_or(LogLevel::Error);
        Ok(Session {
            housekeeper: Owned::new(OnceLock::new()),
            membership: Arc::new(Membership::join(domain, robot)?),
            process_name: process_name.to_owned(),
        })
    }

    pub(crate) fn membership(&self) -> &Arc<Membership> {
        &self.membership
    }

    /// Whether this is the process that joined.
    pub(crate) fn check_process(&self) -> Result<(), Forked> {
        self.doorbell().check_process()
    }

    pub(crate) fn doorbell(&self) -> &Doorbell {
        self.membership.doorbell()
    }

    pub(crate) fn process_name(&self) -> &str {
        &self.process_name
    }

    pub(crate) fn robot(&self) -> RobotId {
        self.membership.robot()
    }

    pub(crate) fn service_folder(&self, key: &str) -> PathBuf {
        service_folder(self.membership.domain(), self.robot(), key)
    }

    pub(crate) fn housekeeper(&self) -> &Housekeeper {
        self.housekeeper
            .get_or_init(|| Housekeeper::start(self.membership.domain()))
    }

    /// Becomes the one provider of the service `key`.
    pub(crate) fn provide(&self, key: &str) -> Result<Arc<ProviderLock>, OpenError> {
        self.check_process()?;
        let provider = Provider::this_process(&self.process_name, MonotonicNs::now().0);
        let lock = ProviderLock::acquire(&self.service_folder(key), &provider)?;
        lock.map(Arc::new).map_err(|by| OpenError::AlreadyProvided {
            service: service_name(self.robot(), key),
            by,
        })
    }

    /// Begins a generation of a service that this process provides, makes something in it, and then announces it.
    pub(crate) fn begin<P>(
        &self,
        lock: &Arc<ProviderLock>,
        offer: &Offer,
        make: impl FnOnce(Generation, Arc<Maintained>) -> Result<P, OpenError>,
    ) -> Result<P, OpenError> {
        let key = offer.key.as_str();
        let is_server = offer.pattern == Pattern::RequestResponse;
        if is_server {
            reserve::note_server();
        }
        let folder = self.service_folder(key);
        let domain = self.membership.domain();
        if !lock.is_in_place() {
            let service = service_name(self.robot(), key);
            return Err(open::failed(
                &service,
                "its folder was removed from outside",
            ));
        }
        generation::delete_many_dead(domain, &folder);
        let generation = Generation::begin(domain, &folder, &self.process_name)
            .map_err(|error| OpenError::enter(&service_name(self.robot(), key), error))?;
        generation.describe(&offer.text.get())?;
        let housekeeper = self.housekeeper();
        let maintained = Maintained::new(
            housekeeper,
            domain,
            lock,
            folder.clone(),
            &generation,
            is_server,
        );
        let name = generation.name().to_owned();
        let made = make(generation, Arc::clone(&maintained))?;
        generation::announce(domain, &folder, &name, key)?;
        self.doorbell().change_generation();
        housekeeper.service(&maintained);
        Ok(made)
    }

    /// Makes room for a client. Says whether that could be.
    pub(crate) fn make_room(&self) -> bool {
        let made = reserve::give_up(&self.membership.domain().robot_folder(self.robot()));
        if made {
            crate::log::warn!("/dev/shm is full: the reserve for those that give orders was used");
        }
        made
    }

    /// Enters a generation that another process provides; `None` when it has ended.
    pub(crate) fn enter(&self, key: &str, name: &str) -> Result<Option<Generation>, OpenError> {
        self.check_process()?;
        let (domain, folder) = (self.membership.domain(), self.service_folder(key));
        match Generation::enter(domain, &folder, name, &self.process_name) {
            Err(EnterError::Ended) => Ok(None),
            entered => entered
                .map(Some)
                .map_err(|error| OpenError::enter(&service_name(self.robot(), key), error)),
        }
    }

    /// The live provider of the service `key`.
    pub(crate) fn provider(&self, key: &str) -> Result<Option<Provider>, DomainError> {
        provider::look(&self.service_folder(key))
    }
}

/// The folder of a service of a robot.
pub(crate) fn service_folder(domain: &Domain, robot: RobotId, key: &str) -> PathBuf {
    domain.robot_folder(robot).join(folder_name(key))
}

fn check_process_name(name: &str) -> Result<(), JoinError> {
    let is_valid = (1..=MAX_PROCESS_NAME_LEN).contains(&name.len())
        && name
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte));
    if is_valid {
        Ok(())
    } else {
        Err(JoinError::InvalidProcessName(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ipc;
    use crate::files::while_no_port_opens;
    use std::fs;
    use std::os::unix::fs::DirBuilderExt;
    use std::os::unix::net::UnixListener;
    use std::path::Path;

    #[test]
    fn a_process_name_is_letters_digits_dashes_and_underscores() {
        let long = "n".repeat(65);
        for bad in ["", "a b", "a/b", "ä", &long] {
            assert!(check_process_name(bad).is_err(), "{bad}");
        }
        for good in ["bridge", "status-2", "my_module"] {
            assert!(check_process_name(good).is_ok(), "{good}");
        }
    }

    #[test]
    fn what_stands_in_the_place_of_a_folder_or_a_doorbell_is_named_with_what_to_do() {
        type Put = fn(&Path);
        let file: Put = |path| fs::write(path, "x").unwrap();
        let socket: Put = |path| drop(UnixListener::bind(path).unwrap());
        let folder: Put = |path| fs::create_dir(path).unwrap();
        let shut: Put = |path| fs::DirBuilder::new().mode(0o500).create(path).unwrap();
        let table = [
            ("1", file, "it is not a folder; remove it by hand"),
            ("1", socket, "it is not a folder; remove it by hand"),
            ("1", shut, "its own user may not use it (mode 500)"),
            (
                "1/doorbell",
                folder,
                "it is not a file; remove it by hand while no process",
            ),
            (
                "1/doorbell",
                socket,
                "it is not a file; remove it by hand while no process",
            ),
        ];
        for (name, put, says) in table {
            let domain = Domain::isolated();
            let at = domain.root().join(name);
            while_no_port_opens(|| {
                fs::create_dir_all(at.parent().unwrap()).unwrap();
                put(&at);
            });
            let error = match Ipc::join(&domain, RobotId::DEFAULT, "test") {
                Err(error) => error.to_string(),
                Ok(_) => panic!("joined with a wrong {name}"),
            };
            assert!(error.contains(says), "{name}: {error}");
            assert!(error.contains(at.to_str().unwrap()), "{error}");
            fs::remove_dir_all(domain.root()).unwrap();
        }
    }

    #[test]
    fn nothing_of_a_robot_is_left_when_the_last_has_gone() {
        let domain = Domain::isolated();
        let [one, other] =
            [1, 7].map(|robot| Ipc::join(&domain, RobotId::new(robot).unwrap(), "test").unwrap());
        assert!(domain.robot_folder(one.robot()).is_dir());
        drop(one);
        assert!(domain.root().is_dir());
        let again = Ipc::join(&domain, other.robot(), "test").unwrap();
        drop(other);
        assert!(domain.robot_folder(again.robot()).is_dir());
        drop(again);
        assert!(domain.residue().is_empty(), "{:?}", domain.residue());
    }
}
