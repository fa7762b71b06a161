//! [`Ipc`]: a process's part in the shared memory of one robot; it makes the ports.
//!
//! Joining checks what could go wrong later without an error (space in `/dev/shm`, owner and mode of the domain),
//! cleans up after the dead, and makes the iceoryx2 node. It installs no signal handler and reads no configuration file
//! but the domain's own.

use std::cell::Cell;
use std::io;
use std::rc::Rc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::Duration;

use iceoryx2::node::NodeCreationFailure;
use iceoryx2::prelude::{
    Config, LogLevel, NodeName, SignalHandlingMode, set_log_level_from_env_or,
};

use crate::bell::Bell;
use crate::domain::dead::{self, SETTLED_AFTER, Scope};
use crate::domain::{
    Cleaning, Domain, DomainError, DomainLock, MakingLock, OwnerLock, Provider, ProviderWatch,
    management,
};
use crate::files;
use crate::inspect;
use crate::iox::{Node, NodeBuilder, Svc};
use crate::open::OpenError;
use crate::robot::RobotId;
use crate::service::{Request, ServiceId, Topic};
use crate::time::MonotonicNs;
use crate::{Client, Publisher, Server, Subscriber};

/// Free space in `/dev/shm` that joining asks for, bytes.
///
/// A full `/dev/shm` is no error but a fatal signal when a page is first touched. The publishers of one robot take 4 MB,
/// its servers 0.5 MB, each client 1.6 MB and each subscriber 7 kB: this is enough for all of them and 16 clients.
pub const REQUIRED_SHM_BYTES: u64 = 32 << 20;

/// How long making a node may take before the management segment is thought to be the cause: iceoryx2 waits without end
/// for one that is empty. Making a node takes milliseconds, and a second when iceoryx2 waits for one that is half made.
const NODE_PATIENCE: Duration = Duration::from_secs(2);

/// How long making a node may take with a new management segment; much longer than a machine that is overloaded needs.
const NODE_TIMEOUT: Duration = Duration::from_secs(10);

/// How often making a node is tried: once; again with a new management segment; and once more, because it can also fail
/// when another process removes a dead node at that moment.
const NODE_ATTEMPTS: u32 = 3;

/// Longest process name, bytes: it stands in node names and owner files.
const MAX_PROCESS_NAME_LEN: usize = 64;

/// A process cannot take part.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    /// The domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// `/dev/shm` is nearly full.
    #[error(
        "/dev/shm has {available} bytes free, {REQUIRED_SHM_BYTES} are needed: remove what fills it, or enlarge it (`mount -o remount,size=256m /dev/shm`)"
    )]
    NoSpace {
        /// Bytes free.
        available: u64,
    },
    /// The free space of `/dev/shm` cannot be asked for.
    #[error("cannot look at /dev/shm, which shared memory needs")]
    NoSharedMemory(#[source] io::Error),
    /// The name of the process cannot be used.
    #[error(
        "`{0}` is no process name: use 1 to {MAX_PROCESS_NAME_LEN} letters, digits, `-` and `_`"
    )]
    InvalidProcessName(String),
    /// iceoryx2 cannot make a node.
    #[error(
        "iceoryx2 cannot make a node in the domain ({reason}): stop every process of the domain; the next one cleans up"
    )]
    Node {
        /// What iceoryx2 says.
        reason: String,
    },
}

/// A process's part in the shared memory of one robot.
///
/// Cheap to clone. All ports stay on the thread that made them; another thread joins by itself. When the last part
/// of the domain's last process is dropped, nothing of the domain is left.
#[derive(Clone)]
pub struct Ipc {
    session: Rc<Session>,
}

/// What all ports share: the node and the place in the domain.
pub(crate) struct Session {
    /// Nothing only while dropping: the node must go before the lock.
    node: Option<Node>,
    lock: Option<DomainLock>,
    config: Config,
    domain: Domain,
    robot: RobotId,
    process_name: String,
    /// Nothing when it cannot be used; events then wake everybody.
    bell: Option<Rc<Bell>>,
    /// When the last clean-up looked at everything.
    cleaned_all: Cell<MonotonicNs>,
}

impl Ipc {
    /// Takes part in the shared memory of `robot`.
    ///
    /// `process_name` (such as `bridge`) is what others read when they ask who provides a service. A domain that is
    /// not isolated becomes the one domain of the process.
    ///
    /// # Errors
    ///
    /// See [`JoinError`]; each says what to do.
    pub fn join(domain: &Domain, robot: RobotId, process_name: &str) -> Result<Ipc, JoinError> {
        set_log_level_from_env_or(LogLevel::Error);
        check_process_name(process_name)?;
        check_space()?;
        let config = domain.config()?;
        let mut session = Session {
            node: None,
            lock: Some(DomainLock::acquire(domain)?),
            config,
            domain: domain.clone(),
            robot,
            process_name: process_name.to_owned(),
            bell: None,
            cleaned_all: Cell::default(),
        };
        if !domain.is_isolated() {
            let _making = MakingLock::share(domain);
            domain.set_global_config()?;
        }
        session.clean_dead();
        let making = MakingLock::share(domain);
        // Before, so that nobody else's segment is opened; afterwards, because the first node makes it.
        management::mend(domain)?;
        // Held here, not by the thread that makes the node: that one may be given up while it hangs.
        let node = files::while_no_port_opens(|| make_node(domain, &session.config, process_name))?;
        session.node = Some(node);
        management::mend(domain)?;
        drop(making);
        session.bell = open_bell(domain, robot);
        Ok(Ipc {
            session: Rc::new(session),
        })
    }

    /// The robot.
    pub fn robot(&self) -> RobotId {
        self.session.robot
    }

    /// The domain.
    pub fn domain(&self) -> &Domain {
        &self.session.domain
    }

    /// The publisher of `T`, of which a robot has one in all processes.
    ///
    /// # Errors
    ///
    /// [`OpenError::AlreadyProvided`] names the live process that publishes; see the others there.
    pub fn publisher<T: Topic>(&self) -> Result<Publisher<T>, OpenError> {
        Publisher::open(&self.session)
    }

    /// A subscriber of `T`. It may be there before the publisher.
    ///
    /// # Errors
    ///
    /// See [`OpenError`].
    pub fn subscriber<T: Topic>(&self) -> Result<Subscriber<T>, OpenError> {
        Subscriber::open(&self.session)
    }

    /// The server of `R`, of which a robot has one in all processes.
    ///
    /// # Errors
    ///
    /// [`OpenError::AlreadyProvided`] names the live process that serves; see the others there.
    pub fn server<R: Request>(&self) -> Result<Server<R>, OpenError> {
        Server::open(&self.session)
    }

    /// A client of `R`. It may be there before the server.
    ///
    /// # Errors
    ///
    /// See [`OpenError`].
    pub fn client<R: Request>(&self) -> Result<Client<R>, OpenError> {
        Client::open(&self.session)
    }

    /// The live process that publishes or serves `service` of this robot, or nothing.
    ///
    /// # Errors
    ///
    /// When the domain's folder cannot be read.
    pub fn provider(&self, service: ServiceId) -> Result<Option<Provider>, OpenError> {
        self.session.provider(service)
    }

    /// Removes what dead processes left in the domain, and tells their partners that they died.
    ///
    /// Call it on a timer, once or twice a second: nobody else does while processes just run. It takes less than a
    /// millisecond when nobody died.
    pub fn clean_dead(&self) -> Cleaning {
        let session = &self.session;
        // What nobody but a death left behind is removed when it is that old; there is no hurry to look for it.
        if MonotonicNs::now().since(session.cleaned_all.get()) >= SETTLED_AFTER {
            return session.clean_dead();
        }
        dead::clean(&session.domain, &session.config, Scope::Nodes)
    }
}

impl Session {
    pub(crate) fn node(&self) -> &Node {
        // Only dropping takes the node away, and nobody can borrow a session that is being dropped.
        self.node.as_ref().expect("a session has a node")
    }

    pub(crate) fn bell(&self) -> Option<&Rc<Bell>> {
        self.bell.as_ref()
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    pub(crate) fn robot(&self) -> RobotId {
        self.robot
    }

    /// At once, and of everything: something is in somebody's way.
    pub(crate) fn clean_dead(&self) -> Cleaning {
        self.cleaned_all.set(MonotonicNs::now());
        dead::clean(&self.domain, &self.config, Scope::Everything)
    }

    /// Makes a service or a port, one at a time in this process (see [`files`]), and says meanwhile that it does.
    pub(crate) fn make<T>(&self, make: impl FnOnce() -> T) -> T {
        // First, because it may wait for another process.
        let _making = MakingLock::share(&self.domain);
        files::while_no_port_opens(make)
    }

    /// Becomes the one provider of `service`.
    pub(crate) fn provide(&self, service: ServiceId) -> Result<OwnerLock, OpenError> {
        let provider = Provider {
            pid: std::process::id(),
            process: self.process_name.clone(),
            since_ns: MonotonicNs::now().0,
        };
        OwnerLock::acquire(&self.domain, self.robot, service.spec().key, &provider)?.map_err(|by| {
            OpenError::AlreadyProvided {
                service: service.name(self.robot),
                by,
            }
        })
    }

    /// Looks for the provider of `service`, time and again.
    pub(crate) fn watch(&self, service: ServiceId) -> ProviderWatch {
        ProviderWatch::new(&self.domain, self.robot, service.spec().key)
    }

    pub(crate) fn provider(&self, service: ServiceId) -> Result<Option<Provider>, OpenError> {
        Ok(self.domain.provider(self.robot, service)?)
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        drop(self.node.take());
        if let Some(lock) = self.lock.take() {
            lock.release(&self.domain);
        }
    }
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

fn check_space() -> Result<(), JoinError> {
    let available = inspect::free_memory().map_err(JoinError::NoSharedMemory)?;
    if available < REQUIRED_SHM_BYTES {
        return Err(JoinError::NoSpace { available });
    }
    Ok(())
}

/// Without a bell everything works, and waking up takes about twice as long.
fn open_bell(domain: &Domain, robot: RobotId) -> Option<Rc<Bell>> {
    match Bell::open(domain, robot) {
        Ok(bell) => Some(Rc::new(bell)),
        Err(error) => {
            let path = Bell::path(domain, robot);
            tracing::warn!(
                path = %path.display(),
                %error,
                "the bell cannot be used, wake-ups take longer: find out whose it is (`ls -l`), and have it removed"
            );
            None
        }
    }
}

/// Makes the node on a thread of its own, because iceoryx2 has no limit of time for it.
///
/// Whatever somebody has done to the management segment, one attempt with a new one follows.
fn make_node(domain: &Domain, config: &Config, process_name: &str) -> Result<Node, JoinError> {
    let name = NodeName::new(process_name)
        .map_err(|_| JoinError::InvalidProcessName(process_name.to_owned()))?;
    let mut last = String::new();
    for _ in 0..NODE_ATTEMPTS {
        let result = begin_node(&name, config)?;
        let made = match result.recv_timeout(NODE_PATIENCE) {
            Err(RecvTimeoutError::Timeout) => {
                tracing::warn!("making a node takes long: the management segment is made anew");
                // The thread finds that it is gone, and goes on.
                management::renew(domain)?;
                result.recv_timeout(NODE_TIMEOUT)
            }
            made => made,
        };
        match made {
            Ok(Ok(node)) => return Ok(node),
            Ok(Err(error)) => {
                last = format!("{error:?}");
                tracing::debug!(?error, "making a node failed");
                management::renew(domain)?;
            }
            Err(_) => {
                let reason = format!("no result after {NODE_TIMEOUT:?}");
                return Err(JoinError::Node { reason });
            }
        }
    }
    Err(JoinError::Node { reason: last })
}

type NodeResult = Result<Node, NodeCreationFailure>;

/// Begins to make a node. Who stops listening leaves it to its thread, which drops it.
fn begin_node(name: &NodeName, config: &Config) -> Result<Receiver<NodeResult>, JoinError> {
    let builder = NodeBuilder::new()
        .name(name)
        .config(config)
        .signal_handling_mode(SignalHandlingMode::Disabled);
    let (sender, receiver) = mpsc::sync_channel(1);
    std::thread::Builder::new()
        .name("ipc-join".to_owned())
        .spawn(move || {
            let _ = sender.send(builder.create::<Svc>());
        })
        .map_err(|error| JoinError::Node {
            reason: error.to_string(),
        })?;
    Ok(receiver)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    /// Somebody may spoil it in the instant after it was looked at.
    #[test]
    fn a_node_is_made_whatever_happens_to_the_management_segment() {
        let domain = Domain::isolated();
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "test").unwrap();
        let config = domain.config().unwrap();
        for (bytes, mode) in [
            (&[][..], 0o600),
            (&[0; 16], 0o600),
            (&[0xff; 16], 0o600),
            (&[0; 16], 0o200),
        ] {
            let [path] = &management::find(&domain)[..] else {
                panic!("one management segment");
            };
            fs::write(path, bytes).unwrap();
            fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
            let node = make_node(&domain, &config, "test");
            assert!(node.is_ok(), "{bytes:?} {mode:03o}: {:?}", node.err());
        }
        drop(ipc);
        assert!(domain.residue().is_empty());
    }
}
