//! [`Ipc`]: a process's part in the shared memory of one robot; it makes the ports.

use std::sync::Arc;

use crate::client::{BytesClient, Client};
use crate::domain::Domain;
use crate::forked::Forked;
use crate::journal::{JournalPiece, JournalTail, LeftTail};
use crate::lease_page;
use crate::members::Members;
use crate::open::{Offer, OpenError};
use crate::patience::Patience;
use crate::provider::Provider;
use crate::publisher::{BytesPublisher, Publisher};
use crate::robot::RobotId;
use crate::server::{BytesServer, Server};
use crate::service::{LATEST, Request, Topic};
use crate::session::{JoinError, Session};
use crate::subscriber::{BytesSubscriber, Subscriber};
use crate::time::MonotonicNs;

/// The environment variable that names the robot.
const ROBOT_VARIABLE: &str = "RIL_ROBOT";

/// A process's part in the shared memory of one robot.
///
/// Cheap to clone, and to hand to other threads. When the last part of the robot's last process is dropped, nothing of
/// the robot is left.
#[derive(Clone)]
pub struct Ipc {
    session: Arc<Session>,
}

/// The bindings share it between threads.
const _: () = {
    const fn is_shared<T: Send + Sync>() {}
    is_shared::<Ipc>();
};

impl Ipc {
    /// Takes part in the shared memory that the environment names: the user's own domain or that of `RIL_IPC_ROOT`, and
    /// the robot of `RIL_ROBOT`, or 1. A variable that is empty is not set.
    ///
    /// # Errors
    ///
    /// As [`Ipc::join`]; and when a variable cannot be used.
    pub fn connect(process_name: &str) -> Result<Ipc, JoinError> {
        let robot = match std::env::var(ROBOT_VARIABLE) {
            Ok(robot) if !robot.is_empty() => robot.parse()?,
            _ => RobotId::DEFAULT,
        };
        Ipc::join(&Domain::from_environment()?, robot, process_name)
    }

    /// Takes part in the shared memory of `robot`.
    ///
    /// `process_name` (such as `bridge`) is what others read as the provider of a service.
    ///
    /// # Errors
    ///
    /// See [`JoinError`]; each says what to do.
    pub fn join(domain: &Domain, robot: RobotId, process_name: &str) -> Result<Ipc, JoinError> {
        Ok(Ipc {
            session: Arc::new(Session::join(domain, robot, process_name)?),
        })
    }

    /// Whether this is the process that joined.
    ///
    /// # Errors
    ///
    /// [`Forked`] in a child that was forked from it.
    pub fn check_process(&self) -> Result<(), Forked> {
        self.session.check_process()
    }

    /// The robot.
    pub fn robot(&self) -> RobotId {
        self.session.robot()
    }

    /// The domain.
    pub fn domain(&self) -> &Domain {
        self.session.membership().domain()
    }

    /// The publisher of `T`, of which a robot has one in all processes.
    ///
    /// # Errors
    ///
    /// [`OpenError::AlreadyProvided`] names the live process that publishes; see the others there.
    pub fn publisher<T: Topic>(&self) -> Result<Publisher<T>, OpenError> {
        BytesPublisher::open(&self.session, Offer::of_topic::<T>()).map(Publisher::of)
    }

    /// The publisher of `T` in a test, which waits while the queue of a subscriber is full: no sample gives way to a
    /// newer one. Subscribers in every language see a topic as any other. A robot's own publishers never wait.
    ///
    /// # Errors
    ///
    /// As [`Ipc::publisher`].
    pub fn patient_publisher<T: Topic>(
        &self,
        patience: Patience,
    ) -> Result<Publisher<T>, OpenError> {
        let mut offer = Offer::of_topic::<T>();
        offer.patience = Some(patience);
        BytesPublisher::open(&self.session, offer).map(Publisher::of)
    }

    /// A subscriber of `T`. It may be there before the publisher.
    ///
    /// # Errors
    ///
    /// When there is a publisher, and its service cannot be opened: see [`OpenError`].
    pub fn subscriber<T: Topic>(&self) -> Result<Subscriber<T>, OpenError> {
        BytesSubscriber::open(&self.session, Offer::of_topic::<T>(), LATEST).map(Subscriber::of)
    }

    /// The server of `R`, of which a robot has one in all processes.
    ///
    /// # Errors
    ///
    /// [`OpenError::AlreadyProvided`] names the live process that serves; see the others there.
    pub fn server<R: Request>(&self) -> Result<Server<R>, OpenError> {
        BytesServer::open(&self.session, Offer::of_request::<R>(R::KEY)).map(Server::of)
    }

    /// A client of `R`. It may be there before the server.
    ///
    /// # Errors
    ///
    /// When there is a server, and its service cannot be opened: see [`OpenError`].
    pub fn client<R: Request>(&self) -> Result<Client<R>, OpenError> {
        self.client_of(R::KEY)
    }

    /// A client of the service `key`, which carries `R` as that of `R` itself does: for a tool that sends the
    /// contract's requests to a module whose types it was not built with.
    ///
    /// # Errors
    ///
    /// As [`Ipc::client`]; and when the service carries something else.
    pub fn client_of<R: Request>(&self, key: &str) -> Result<Client<R>, OpenError> {
        BytesClient::open(&self.session, Offer::of_request::<R>(key)).map(Client::of)
    }

    /// Where the publisher of a journal, which is this process, keeps what it has not published.
    ///
    /// # Errors
    ///
    /// When shared memory is full, or the service's folder is gone.
    pub fn journal_tail<P: JournalPiece>(&self) -> Result<JournalTail, OpenError> {
        Ok(JournalTail::create::<P>(
            &self.session.service_folder(P::KEY),
        )?)
    }

    /// The tail of the journal whose publisher lives, for when it does not; `None` if it has none.
    ///
    /// # Errors
    ///
    /// When the service's folder cannot be read.
    pub fn left_tail<P: JournalPiece>(&self) -> Result<Option<LeftTail>, OpenError> {
        Ok(LeftTail::open(&self.session.service_folder(P::KEY))?)
    }

    /// The live process that publishes or serves the service `key` of this robot, or `None`.
    ///
    /// # Errors
    ///
    /// When the service's folder cannot be read.
    pub fn provider(&self, key: &str) -> Result<Option<Provider>, OpenError> {
        Ok(self.session.provider(key)?)
    }

    /// Counts the beginnings and ends of the robot's services, in all processes, wrapping around: another value than
    /// before is a reason to look for services that are new. Costs no system call.
    pub fn generations(&self) -> u32 {
        self.session.doorbell().generations()
    }

    /// Looks who is a process of the robot, for as long as this one takes part.
    pub fn members(&self) -> Members {
        Members::with(self.session.membership().doorbell_file())
    }

    /// When the lease of this path was last renewed by its sender, by that one's clock; `None` if it has none.
    pub fn lease_renewed(&self, path_id: u64) -> Option<MonotonicNs> {
        lease_page::renewed(self.session.doorbell().leases(), path_id)
    }

    pub(crate) fn session(&self) -> &Arc<Session> {
        &self.session
    }
}
