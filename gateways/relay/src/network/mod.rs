//! [`Network`]: Zenoh, as far as a relay needs it. Nothing outside of this folder names it.
//!
//! Zenoh has threads of its own. What they receive waits in rings that keep the newest, with the moment of its arrival,
//! and an event descriptor wakes the relay's one wait. Sending never blocks: what a link cannot take is dropped, and
//! comes again where it must. Declaring may block, and is done in a thread of its own.

mod inbox;
mod outbox;
mod settings;

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;

use ipc_types::{SchedulingRole, request_slice};
use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd, poll};
use rustix::io::Errno;
use zenoh::Wait;
use zenoh::qos::{CongestionControl, Priority as ZenohPriority};

use crate::config::{Config, Side};
pub use crate::failure::NetworkError;
pub use inbox::{Inbox, ReceivedMessage, Room};
use outbox::Background;
pub use outbox::{Declaration, Outbox, Token, Watch};
pub use settings::{MAX_MESSAGE_BYTES, check, share_one_thread};

/// A relay's part in the network.
pub struct Network {
    /// First, so that what it does has ended before the session is closed.
    declarations: Background,
    session: zenoh::Session,
    arrivals: Arc<OwnedFd>,
}

impl Network {
    /// Takes part in the network. Connections are made, and made again, in the background; only a side that goes
    /// through a router waits here for the first one, or until `end` can be read.
    ///
    /// # Errors
    ///
    /// When the configuration's endpoints or certificates cannot be used, or an address is taken.
    pub fn open(config: &Config, side: Side, end: BorrowedFd<'_>) -> Result<Network, NetworkError> {
        let zenoh_config = settings::zenoh_config(config, side).map_err(|error| {
            NetworkError::new("the configuration of the network is refused", error)
        })?;
        // Zenoh's threads inherit it.
        request_slice(SchedulingRole::Provider);
        let session = open_session(zenoh_config, end)?.map_err(|error| {
            NetworkError::new(
                "the network cannot be opened; is an address taken or a certificate missing?",
                error,
            )
        })?;
        let (listen, connect) = side.endpoints(config);
        tracing::info!(?listen, ?connect, "the network is open");
        let arrivals = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)
            .map_err(|error| NetworkError::new("no event descriptor", error))?;
        let arrivals = Arc::new(arrivals);
        let declared = Arc::clone(&arrivals);
        let declarations = Background::start("declarations", move || {
            let _ = rustix::io::write(&*declared, &1_u64.to_ne_bytes());
        })
        .map_err(|error| NetworkError::new("no thread", error))?;
        Ok(Network {
            declarations,
            session,
            arrivals,
        })
    }

    /// Can be read when something has arrived, when a way out is open that was not, and when a [`Watch`] has noticed
    /// a process.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.arrivals.as_fd()
    }

    /// To be called before the inboxes are drained.
    pub fn drained(&self) {
        let _ = rustix::io::read(&*self.arrivals, &mut [0; 8]);
    }

    /// Receives what is sent to `key`, of which the newest wait as there is room. What comes under a key of `own` has
    /// room of its own, which nothing that comes under other keys takes. It may take as long as a peer that reads
    /// nothing is borne with.
    ///
    /// # Errors
    ///
    /// When Zenoh refuses the key expression.
    pub fn receive(&self, key: &str, own: Vec<String>, room: Room) -> Result<Inbox, NetworkError> {
        Inbox::open(&self.session, &self.arrivals, key, own, room)
    }

    /// A way out for samples, which opens later.
    pub fn outbox(&self, declaration: Declaration) -> Outbox {
        Outbox::open(&self.declarations, &self.session, declaration)
    }

    /// A liveliness token, which others see later, and before every way out that is asked for after it.
    pub fn token(&self, key: String) -> Token {
        Token::open(&self.declarations, &self.session, key)
    }

    /// Notices when another process is connected, and when the first one begins to receive what is sent to `key`, a
    /// pattern. It begins later.
    pub fn watch(&self, key: String) -> Watch {
        Watch::open(&self.declarations, &self.session, key, &self.arrivals)
    }

    /// The id of this relay in the network.
    pub fn id(&self) -> String {
        self.session.zid().to_string()
    }

    /// Sends a message. It may be lost.
    pub fn send(&self, key: &str, message: Vec<u8>) {
        let sent = self
            .session
            .put(key, message)
            .congestion_control(CongestionControl::Drop)
            .priority(ZenohPriority::InteractiveHigh)
            .express(true)
            .wait();
        if let Err(error) = sent {
            tracing::debug!(key, %error, "a message was not sent");
        }
    }
}

/// Opens a session in a thread of its own, because nothing can interrupt Zenoh while it looks for a router.
fn open_session(
    config: zenoh::Config,
    end: BorrowedFd<'_>,
) -> Result<zenoh::Result<zenoh::Session>, NetworkError> {
    let failed = |error| NetworkError::new("the network cannot be waited for", error);
    let opened = eventfd(0, EventfdFlags::CLOEXEC).map_err(failed)?;
    let opener = opened
        .try_clone()
        .map_err(|error| NetworkError::new("no descriptor", error))?;
    let thread = std::thread::spawn(move || {
        let session = zenoh::open(config).wait();
        let _ = rustix::io::write(&opener, &1_u64.to_ne_bytes());
        session
    });
    loop {
        let mut ready = [
            PollFd::new(&opened, PollFlags::IN),
            PollFd::new(&end, PollFlags::IN),
        ];
        match poll(&mut ready, None) {
            Err(Errno::INTR) => {}
            Err(error) => return Err(failed(error)),
            // The thread ends with the process.
            Ok(_) if ready[0].revents().is_empty() => return Err(NetworkError::Ended),
            Ok(_) => {
                let session = thread.join();
                return session
                    .map_err(|_| NetworkError::new("the network", "its thread has failed"));
            }
        }
    }
}
